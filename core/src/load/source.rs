//! What every loader is given: the bytes of the file, its folder, the limits, and a list for notes.

use super::folder::Folder;
use super::limits::{Limits, LoadOptions};
use super::notes::Notes;

/// A file being loaded.
pub(crate) struct Source<'a> {
    /// The name of the file without folder and extension.
    pub(crate) name: String,
    /// The extension, lower case.
    pub(crate) extension: String,
    pub(crate) bytes: Vec<u8>,
    pub(crate) folder: Folder,
    pub(crate) options: &'a LoadOptions,
    pub(crate) limits: &'a Limits,
    pub(crate) notes: Notes,
}
