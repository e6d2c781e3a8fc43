//! How is a scene opened without stopping the window?

use polyptych::builtin;
use polyptych::load::{LoadOptions, load};
use polyptych::scene::Scene;
use std::path::Path;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Opens a scene file, a model, or `builtin:NAME`.
///
/// # Errors
/// One line: the file, the place, the reason, and what to do.
pub fn open(name: &str) -> Result<Scene, String> {
    match name.strip_prefix("builtin:") {
        Some(builtin) => builtin::scene(builtin),
        None => load(Path::new(name), &LoadOptions::default()).map_err(|error| error.to_string()),
    }
}

/// A scene that is being opened on a thread of its own.
pub(crate) struct Loading {
    pub(crate) name: String,
    result: Receiver<Result<Scene, String>>,
}

impl Loading {
    /// Starts to open a scene; `wake` is called when it is done.
    pub(crate) fn start(name: String, wake: impl Fn() + Send + 'static) -> Self {
        let (sender, result) = channel();
        let opened = name.clone();
        std::thread::spawn(move || {
            // The window may be gone by now: then nobody waits for the scene.
            let _ = sender.send(open(&opened));
            wake();
        });
        Self { name, result }
    }

    /// Returns the scene, or why there is none, once it is known.
    pub(crate) fn poll(&self) -> Option<Result<Scene, String>> {
        match self.result.try_recv() {
            Ok(result) => Some(result),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(format!("{}: the reader stopped", self.name))),
        }
    }
}
