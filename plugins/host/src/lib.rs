//! Finds, checks and calls back ends in libraries of their own.
//!
//! [`discover`] lists what lies in folders, by manifests, without running any of it. [`PluginFactory`] makes
//! renderers of a listed or a named library; the library is opened when the first one is made. What a plugin does
//! not take as given is converted here, by the shared converter, and the bound goes into the report.

mod call;
mod callee;
#[cfg(target_os = "linux")]
mod child;
mod discover;
mod factory;
mod flat;
mod flat_scene;
mod hand_over;
mod image;
mod library;
mod limits;
mod manifest;
mod refusal;
mod renderer;
mod table;
mod words;

pub use call::{LogLine, Severity};
pub use discover::{Found, discover, plugin_folders};
pub use factory::{Isolation, Options, PluginFactory, serve};
pub use library::open;
pub use limits::Limits;
pub use manifest::{Manifest, ParameterEntry};
pub use refusal::Refusal;
pub use table::Loaded;
