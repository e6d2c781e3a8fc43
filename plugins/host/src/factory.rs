//! How are renderers of a plugin made? The library is opened for the first one.

use crate::call::LogLine;
use crate::library::open;
use crate::manifest::Manifest;
use crate::refusal::Refusal;
use crate::renderer::{Log, PluginRenderer};
use crate::table::Loaded;
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::scene::Scene;
use polyptych_core::seam::{
    BackendFactory, BackendInfo, Control, Frame, Need, Plan, Prepared, Registry, RenderError, Renderer,
    Report,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How plugins are run.
#[derive(Clone)]
pub struct Options {
    /// Where lines of their logs go.
    pub log: Arc<dyn Fn(LogLine) + Send + Sync>,
}

impl Default for Options {
    fn default() -> Self {
        Self { log: Arc::new(|_| {}) }
    }
}

/// Makes renderers of a plugin.
pub struct PluginFactory {
    info: BackendInfo,
    library: PathBuf,
    manifest: Option<Manifest>,
    log: Log,
}

impl PluginFactory {
    /// Makes a factory of a plugin that was found with a manifest. Its library is opened when it is needed.
    #[must_use]
    pub fn listed(library: PathBuf, manifest: Manifest, options: &Options) -> Self {
        Self { info: manifest.info(), library, manifest: Some(manifest), log: options.log.clone() }
    }

    /// Makes a factory of a library that was named, and opens it.
    ///
    /// # Errors
    /// Says in one line why the library is refused.
    pub fn named(library: &Path, options: &Options) -> Result<Self, Refusal> {
        let loaded = open(library)?;
        let log = options.log.clone();
        Ok(Self { info: loaded.info.clone(), library: library.into(), manifest: None, log })
    }

    fn loaded(&self) -> Result<&'static Loaded, Refusal> {
        let loaded = open(&self.library)?;
        match self.manifest.as_ref().and_then(|m| m.differs_from(loaded)) {
            Some(what) => Err(Refusal::OtherThanManifest { path: self.library.clone(), what }),
            None => Ok(loaded),
        }
    }
}

impl BackendFactory for PluginFactory {
    fn info(&self) -> BackendInfo {
        self.info.clone()
    }

    fn create(&self, _: &Registry) -> Box<dyn Renderer> {
        match self.loaded() {
            Ok(loaded) => Box::new(PluginRenderer::new(loaded, self.log.clone())),
            Err(refusal) => Box::new(Refused { info: self.info.clone(), why: refusal.to_string() }),
        }
    }
}

/// Stands in for a library that was refused when it was opened.
struct Refused {
    info: BackendInfo,
    why: String,
}

impl Renderer for Refused {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, _: &Scene, _: &Need) -> Plan {
        Plan::default()
    }

    fn prepare(
        &mut self,
        _: &Arc<Scene>,
        _: &Need,
        _: &Converter,
        _: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        Err(RenderError::Failed(self.why.clone()))
    }

    fn render(&mut self, _: &Frame, _: &mut Framebuffer, _: &Control<'_>) -> Result<Report, RenderError> {
        Err(RenderError::Failed(self.why.clone()))
    }
}
