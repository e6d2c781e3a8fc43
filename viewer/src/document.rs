//! Which scene is open, where does it come from, and what was it before it was edited?

use crate::history::History;
use polyptych::builtin;
use polyptych::load::{LoadOptions, add_default_view, load, save};
use polyptych::scene::Scene;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Opens a scene file, a model, or `builtin:NAME`. A picture is read as a height map.
///
/// # Errors
/// One line: the file, the place, the reason, and what to do.
pub fn open(name: &str) -> Result<Scene, String> {
    if let Some(name) = name.strip_prefix("builtin:") {
        return builtin::scene(name);
    }
    // Here a picture can mean nothing else.
    let options = LoadOptions { height_map: true, ..LoadOptions::default() };
    load(Path::new(name), &options).map_err(|error| error.to_string())
}

/// The scene that is open.
pub(crate) struct Document {
    pub(crate) scene: Arc<Scene>,
    /// The file, or `builtin:NAME`, that it was read from.
    pub(crate) name: Option<String>,
    /// The scene as it is on disk.
    saved: Arc<Scene>,
    history: History,
}

impl Document {
    /// Opens a scene; one without camera or light gets them.
    pub(crate) fn new(mut scene: Scene, name: Option<String>) -> Self {
        add_default_view(&mut scene);
        let scene = Arc::new(scene);
        Self { saved: scene.clone(), scene, name, history: History::default() }
    }

    /// Puts a changed scene in the place of the one that is open; `what` names what was changed.
    pub(crate) fn edit(&mut self, scene: impl Into<Arc<Scene>>, what: &str, now: f64) {
        self.history.keep(&self.scene, what, now);
        self.scene = scene.into();
    }

    /// Tells whether there is something to undo, and to redo.
    pub(crate) fn can(&self) -> [bool; 2] {
        self.history.can()
    }

    pub(crate) fn undo(&mut self) {
        self.scene = self.history.undo(&self.scene).unwrap_or_else(|| self.scene.clone());
    }

    pub(crate) fn redo(&mut self) {
        self.scene = self.history.redo(&self.scene).unwrap_or_else(|| self.scene.clone());
    }

    /// Tells whether something was changed that is not on disk.
    pub(crate) fn is_changed(&self) -> bool {
        !Arc::ptr_eq(&self.scene, &self.saved)
    }

    /// Says that the scene is not on disk as it is.
    pub(crate) fn mark_changed(&mut self) {
        self.saved = Arc::default();
    }

    /// Returns the scene file that it was read from or written to; models are no scene files.
    pub(crate) fn scene_file(&self) -> Option<PathBuf> {
        let path = PathBuf::from(self.name.as_ref()?);
        let is_scene = path.extension().is_some_and(|e| e == "ron" || e == "json");
        is_scene.then_some(path)
    }

    /// Returns what is on disk to be read and watched.
    pub(crate) fn file(&self) -> Option<PathBuf> {
        self.name.as_ref().filter(|name| !name.starts_with("builtin:")).map(PathBuf::from)
    }

    /// Says that a scene was written to a file.
    pub(crate) fn was_saved(&mut self, scene: Arc<Scene>, file: &Path) {
        self.saved = scene;
        self.name = Some(file.to_string_lossy().into_owned());
    }
}

/// Work on a file, on a thread of its own.
pub(crate) struct Errand<T> {
    pub(crate) name: String,
    result: Receiver<Result<T, String>>,
}

impl Errand<Scene> {
    /// Starts to open a scene; `wake` is called when it is done.
    pub(crate) fn open(name: String, wake: impl Fn() + Send + 'static) -> Self {
        let opened = name.clone();
        Self::start(name, move || open(&opened), wake)
    }
}

impl Errand<Arc<Scene>> {
    /// Starts to write a scene.
    pub(crate) fn save(scene: Arc<Scene>, path: PathBuf, wake: impl Fn() + Send + 'static) -> Self {
        let name = path.to_string_lossy().into_owned();
        let work = move || save(&scene, &path).map(|()| scene.clone()).map_err(|error| error.to_string());
        Self::start(name, work, wake)
    }
}

impl<T: Send + 'static> Errand<T> {
    pub(crate) fn start(
        name: String,
        work: impl FnOnce() -> Result<T, String> + Send + 'static,
        wake: impl Fn() + Send + 'static,
    ) -> Self {
        let (sender, result) = channel();
        std::thread::spawn(move || {
            // The window may be gone by now: then nobody waits.
            let _ = sender.send(work());
            wake();
        });
        Self { name, result }
    }

    /// Returns what came of it, once that is known.
    pub(crate) fn poll(&self) -> Option<Result<T, String>> {
        match self.result.try_recv() {
            Ok(result) => Some(result),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(format!("{}: the reader stopped", self.name))),
        }
    }
}
