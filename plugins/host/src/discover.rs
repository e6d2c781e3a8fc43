//! Which plugins are there? Folders are read, manifests parsed, libraries looked at; nothing is run.

use crate::image;
use crate::manifest::Manifest;
use crate::refusal::Refusal;
use crate::table::refuse_missing_cpu;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// A library in a plugin folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Where the library lies, or would.
    pub library: PathBuf,
    /// Its manifest, or why it is refused.
    pub manifest: Result<Manifest, Refusal>,
}

/// Lists the folders to look in: the given ones, those of `POLYPTYCH_PLUGIN_PATH`, and the user's own. Relative folders
/// in the variable are passed over, so that the current folder is never one by itself.
#[must_use]
pub fn plugin_folders(given: &[PathBuf]) -> Vec<PathBuf> {
    let mut folders = given.to_vec();
    if let Some(listed) = std::env::var_os("POLYPTYCH_PLUGIN_PATH") {
        folders.extend(std::env::split_paths(&listed).filter(|folder| folder.is_absolute()));
    }
    folders.extend(user_folder().filter(|folder| folder.is_dir()));
    folders
}

fn user_folder() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let data = if cfg!(windows) {
        variable("APPDATA")?
    } else if cfg!(target_os = "macos") {
        variable("HOME")?.join("Library/Application Support")
    } else {
        variable("XDG_DATA_HOME").or_else(|| Some(variable("HOME")?.join(".local/share")))?
    };
    Some(data.join("polyptych").join("plugins"))
}

/// Lists what lies in folders, by name: libraries with their manifests, and what is wrong. Runs nothing.
///
/// # Errors
/// When a folder cannot be read.
pub fn discover(folders: &[PathBuf]) -> Result<Vec<Found>, Refusal> {
    let mut all = Vec::new();
    let mut seen = BTreeSet::new();
    for folder in folders {
        let unreadable =
            |e: std::io::Error| Refusal::Unreadable { path: folder.clone(), what: e.to_string() };
        if !seen.insert(folder.canonicalize().map_err(unreadable)?) {
            continue;
        }
        let mut files = BTreeSet::new();
        for entry in std::fs::read_dir(folder).map_err(unreadable)? {
            files.insert(entry.map_err(unreadable)?.path());
        }
        let with = |extension: &str| {
            let extension = OsStr::new(extension).to_owned();
            files.iter().filter(move |f| f.extension() == Some(&extension))
        };
        let listed: Vec<Found> = with("toml").map(|manifest| find(manifest)).collect();
        let alone = with(std::env::consts::DLL_EXTENSION)
            .filter(|library| !listed.iter().any(|found| found.library == **library));
        let alone: Vec<Found> = alone.map(|library| without_manifest(library)).collect();
        all.extend(listed.into_iter().chain(alone));
    }
    Ok(all)
}

fn find(manifest: &Path) -> Found {
    match Manifest::read(manifest) {
        Err(refusal) => Found { library: manifest.into(), manifest: Err(refusal) },
        Ok(read) => {
            let library = read.library_path(manifest);
            let fits = image::check(&library).and_then(|()| refuse_missing_cpu(&library, &read.cpu));
            Found { library, manifest: fits.map(|()| read) }
        }
    }
}

fn without_manifest(library: &Path) -> Found {
    let refusal = image::check(library).err().unwrap_or(Refusal::NoManifest { path: library.into() });
    Found { library: library.into(), manifest: Err(refusal) }
}
