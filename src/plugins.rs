//! Which back ends lie in libraries, and how do they come into a registry?

use crate::seam::{Origin, Registry};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use polyptych_plugin_host::{
    Found, Isolation, Limits, LogLine, Manifest, Options, PluginFactory, Refusal, Severity, discover, open,
    plugin_folders, serve,
};

/// Adds back ends in libraries to a registry.
pub trait PluginBackends: Sized {
    /// Returns the registry with the plugins of a folder, passing over those that are refused.
    ///
    /// ```no_run
    /// use polyptych::prelude::*;
    ///
    /// let renderer = Registry::builtin().with_plugins("/usr/lib/polyptych").create("occlusion")?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    fn with_plugins(self, folder: impl AsRef<Path>) -> Self;

    /// Adds the plugins of folders, by their manifests; a library is opened when the first renderer is made. Returns
    /// what is refused, and why. A plugin does not take the id of a back end that is there.
    ///
    /// # Errors
    /// When a folder cannot be read.
    fn add_plugins(&mut self, folders: &[PathBuf], options: &Options) -> Result<Vec<Refusal>, Refusal>;

    /// Opens a library and adds its back end, in the place of one with the same id. Returns the id.
    ///
    /// # Errors
    /// Says in one line why the library is refused.
    fn load(&mut self, library: impl AsRef<Path>) -> Result<String, Refusal> {
        self.load_with(library, &Options::default())
    }

    /// Opens a library and adds its back end, to be run as the options say. Returns the id.
    ///
    /// # Errors
    /// Says in one line why the library is refused.
    fn load_with(&mut self, library: impl AsRef<Path>, options: &Options) -> Result<String, Refusal>;
}

impl PluginBackends for Registry {
    fn with_plugins(mut self, folder: impl AsRef<Path>) -> Self {
        // A folder that cannot be read has no plugins; who wants to know why calls `add_plugins`.
        let _ = self.add_plugins(&[folder.as_ref().into()], &Options::default());
        self
    }

    fn add_plugins(&mut self, folders: &[PathBuf], options: &Options) -> Result<Vec<Refusal>, Refusal> {
        let mut refused = Vec::new();
        for found in discover(folders)? {
            let manifest = match found.manifest {
                Ok(manifest) => manifest,
                Err(refusal) => {
                    refused.push(refusal);
                    continue;
                }
            };
            let taken =
                self.iter().find(|(info, _)| info.id == manifest.id).map(|(_, origin)| match origin {
                    Origin::BuiltIn => "built-in".to_owned(),
                    Origin::Library(path) => path.display().to_string(),
                });
            if let Some(of) = taken {
                refused.push(Refusal::IdTaken { path: found.library, id: manifest.id, of });
                continue;
            }
            let factory = PluginFactory::listed(found.library.clone(), manifest, options);
            self.add(Arc::new(factory), Origin::Library(found.library));
        }
        Ok(refused)
    }

    fn load_with(&mut self, library: impl AsRef<Path>, options: &Options) -> Result<String, Refusal> {
        let library = library.as_ref();
        let factory = PluginFactory::named(library, options)?;
        let id = crate::seam::BackendFactory::info(&factory).id;
        self.add(Arc::new(factory), Origin::Library(library.into()));
        Ok(id)
    }
}
