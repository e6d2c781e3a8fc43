//! A window in which back ends draw one scene side by side, and are switched live.
//!
//! ```no_run
//! let scene = polyptych::builtin::scene("atelier").unwrap();
//! polyptych_viewer::show(scene)?;
//! # Ok::<(), polyptych_viewer::ViewerError>(())
//! ```
//!
//! ```text
//!  painter    one worker thread a pane: prepares, draws coarse then fine, drops what is out of date
//!  navigation the camera that all panes share: orbit, pan, dolly, fly
//!  pane       a picture with its name, time and decisions
//!  scene_panel the things of the scene and their fields; history undoes what they change
//!  settings   the panel of a back end, made from its declared parameters
//!  difference where two pictures differ, and by how much
//!  probe      the values of all pictures at one place
//!  modes      how panes share the window
//!  viewer     the window: which panes, which mode, which scene
//! ```
//!
//! Nothing that takes long runs on the window's own thread: it only shows what the painters have finished.

mod difference;
mod history;
mod loading;
mod modes;
mod navigation;
mod painter;
mod pane;
mod probe;
mod scene_panel;
mod settings;
mod viewer;

pub use loading::open;
pub use modes::Mode;
pub use viewer::Viewer;

use polyptych::BuiltinBackends;
use polyptych::scene::Scene;
use polyptych::seam::Registry;

/// Why no window could be shown.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum ViewerError {
    #[error("no window can be opened: {0}: is there a display?")]
    Window(String),
    #[error("{0}")]
    Threads(String),
}

/// Shows a scene in a window with the built-in back ends, and returns when it is closed.
///
/// # Errors
/// When there is no display, or no threads can be started.
pub fn show(scene: Scene) -> Result<(), ViewerError> {
    show_with(Registry::builtin(), scene)
}

/// Shows a scene in a window with the back ends of a registry, and returns when it is closed.
///
/// # Errors
/// When there is no display, or no threads can be started.
pub fn show_with(registry: Registry, scene: Scene) -> Result<(), ViewerError> {
    show_viewer(Viewer::new(registry, scene)?)
}

/// Shows a viewer in a window, and returns when it is closed.
///
/// # Errors
/// When there is no display.
pub fn show_viewer(viewer: Viewer) -> Result<(), ViewerError> {
    let options = eframe::NativeOptions {
        viewport: eframe::egui::ViewportBuilder::default()
            .with_title("Polyptych")
            .with_inner_size([1280.0, 800.0])
            .with_drag_and_drop(true),
        ..eframe::NativeOptions::default()
    };
    eframe::run_native("polyptych", options, Box::new(|_| Ok(Box::new(viewer))))
        .map_err(|error| ViewerError::Window(error.to_string()))
}
