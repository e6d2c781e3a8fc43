//! What every loader is given: the bytes of the file, its folder, the limits, and a list for notes.

use super::error::one_line;
use super::folder::Folder;
use super::limits::{Limits, LoadOptions};
use super::notes::Notes;
use std::path::Path;

/// A file being loaded.
pub(crate) struct Source<'a> {
    /// The name of the file without folder and extension.
    pub(crate) name: String,
    /// The extension, lower case.
    pub(crate) extension: String,
    /// The file; readers take it, and let go of it as soon as they can.
    pub(crate) bytes: Vec<u8>,
    pub(crate) folder: Folder,
    pub(crate) options: &'a LoadOptions,
    pub(crate) limits: &'a Limits,
    pub(crate) notes: Notes,
}

impl<'a> Source<'a> {
    /// Begins to load a file whose bytes were read.
    pub(crate) fn open(path: &Path, options: &'a LoadOptions, bytes: Vec<u8>) -> Self {
        Self {
            name: one_line(&path.file_stem().unwrap_or_default().to_string_lossy()),
            extension: super::extension_of(path),
            bytes,
            folder: Folder::of(path, options.limits.file_bytes),
            options,
            limits: &options.limits,
            notes: Notes::default(),
        }
    }
}
