//! Which back ends there are, and making one by its name.

use super::info::BackendInfo;
use super::parameter::nearest;
use super::renderer::Renderer;
use std::path::PathBuf;
use std::sync::Arc;

/// Makes instances of a back end.
pub trait BackendFactory: Send + Sync {
    /// Returns what the back end says of itself.
    fn info(&self) -> BackendInfo;

    /// Makes an instance. A renderer over a renderer takes its inner one from the registry.
    fn create(&self, registry: &Registry) -> Box<dyn Renderer>;
}

/// Where a back end comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Linked into the program.
    BuiltIn,
    /// Loaded from a library.
    Library(PathBuf),
}

#[derive(Clone)]
struct Entry {
    info: Arc<BackendInfo>,
    origin: Origin,
    factory: Arc<dyn BackendFactory>,
}

/// The back ends that a program knows. Cheap to clone.
#[derive(Clone, Default)]
pub struct Registry {
    entries: Vec<Entry>,
}

/// No back end has that name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no back end `{name}`; the nearest is `{nearest}` (all: {all})")]
pub struct UnknownBackend {
    /// The name that was asked for.
    pub name: String,
    /// The most similar name.
    pub nearest: String,
    /// All names.
    pub all: String,
}

impl Registry {
    /// Adds a back end; one with the same id is replaced.
    pub fn add(&mut self, factory: Arc<dyn BackendFactory>, origin: Origin) {
        let info = Arc::new(factory.info());
        self.entries.retain(|e| e.info.id != info.id);
        self.entries.push(Entry { info, origin, factory });
    }

    /// Lists the back ends in the order of their registration.
    pub fn iter(&self) -> impl Iterator<Item = (&BackendInfo, &Origin)> {
        self.entries.iter().map(|e| (&*e.info, &e.origin))
    }

    /// Lists the ids.
    pub fn ids(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|e| e.info.id.as_str())
    }

    /// Returns what a back end says of itself.
    ///
    /// # Errors
    /// Names the nearest id when there is none of that name.
    pub fn info(&self, id: &str) -> Result<&BackendInfo, UnknownBackend> {
        self.entry(id).map(|e| &*e.info)
    }

    /// Makes an instance of a back end.
    ///
    /// # Errors
    /// Names the nearest id when there is none of that name.
    pub fn create(&self, id: &str) -> Result<Box<dyn Renderer>, UnknownBackend> {
        self.entry(id).map(|e| e.factory.create(self))
    }

    fn entry(&self, id: &str) -> Result<&Entry, UnknownBackend> {
        self.entries.iter().find(|e| e.info.id == id).ok_or_else(|| UnknownBackend {
            name: id.to_owned(),
            nearest: nearest(id, self.ids()).unwrap_or("none").to_owned(),
            all: self.ids().collect::<Vec<_>>().join(", "),
        })
    }
}
