//! Why is a library not taken?

use std::path::PathBuf;

/// Why a library or its manifest was refused, in one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum Refusal {
    #[error("{}: cannot be read ({what}): check the path and its permissions", .path.display())]
    Unreadable { path: PathBuf, what: String },
    #[error("{}: is not a library: {what}", .path.display())]
    NotALibrary { path: PathBuf, what: String },
    #[error("{}: is cut off: it ends after {length} bytes and says that it has {wanted}: build or copy it again", .path.display())]
    Truncated { path: PathBuf, length: u64, wanted: u64 },
    #[error("{}: the system cannot open it ({what})", .path.display())]
    Unopened { path: PathBuf, what: String },
    #[error("{}: is no plugin of Polyptych: it has no function `polyptych_plugin`", .path.display())]
    NoEntry { path: PathBuf },
    #[error("{}: `polyptych_plugin` returned nothing", .path.display())]
    NullTable { path: PathBuf },
    #[error("{}: the table of functions begins with {magic:#010x}, not with the mark of a plugin", .path.display())]
    WrongMagic { path: PathBuf, magic: u32 },
    #[error("{}: the table of functions has {size} bytes, at least {least} are needed", .path.display())]
    ShortTable { path: PathBuf, size: u32, least: u32 },
    #[error("{}: speaks version {major}.{minor} of the interface, this program {ours}: build it with this program's header", .path.display())]
    OtherMajor { path: PathBuf, major: u32, minor: u32, ours: String },
    #[error("{}: needs a processor with {features}", .path.display())]
    MissingCpu { path: PathBuf, features: String },
    #[error("{}: the table has no `{function}`", .path.display())]
    NoFunction { path: PathBuf, function: &'static str },
    #[error("{}: what it says of itself is wrong: {what}", .path.display())]
    WrongInfo { path: PathBuf, what: String },
    #[error("{}: {what}", .path.display())]
    WrongManifest { path: PathBuf, what: String },
    #[error("{}: has no manifest beside it: write one with `polyptych backends --manifest {}`", .path.display(), .path.display())]
    NoManifest { path: PathBuf },
    #[error("{}: its manifest says something else about {what}: write it anew with `polyptych backends --manifest`", .path.display())]
    OtherThanManifest { path: PathBuf, what: &'static str },
    #[error("{}: cannot run in a process of its own: {what}", .path.display())]
    NoChild { path: PathBuf, what: String },
    #[error("{what}")]
    InChild { path: PathBuf, what: String },
    #[error("{}: there is a back end `{id}` already ({of}): give it another id", .path.display())]
    IdTaken { path: PathBuf, id: String, of: String },
}

impl Refusal {
    /// Returns the file that was refused.
    #[must_use]
    pub fn path(&self) -> &std::path::Path {
        match self {
            Self::Unreadable { path, .. }
            | Self::NotALibrary { path, .. }
            | Self::Truncated { path, .. }
            | Self::Unopened { path, .. }
            | Self::NoEntry { path }
            | Self::NullTable { path }
            | Self::WrongMagic { path, .. }
            | Self::ShortTable { path, .. }
            | Self::OtherMajor { path, .. }
            | Self::MissingCpu { path, .. }
            | Self::NoFunction { path, .. }
            | Self::WrongInfo { path, .. }
            | Self::WrongManifest { path, .. }
            | Self::NoManifest { path }
            | Self::OtherThanManifest { path, .. }
            | Self::NoChild { path, .. }
            | Self::InChild { path, .. }
            | Self::IdTaken { path, .. } => path,
        }
    }
}
