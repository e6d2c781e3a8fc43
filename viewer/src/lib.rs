//! A window in which back ends draw one scene side by side, and are switched live.
//!
//! ```no_run
//! let scene = polyptych::builtin::scene("atelier").unwrap();
//! polyptych_viewer::show(scene)?;
//! # Ok::<(), polyptych_viewer::ViewerError>(())
//! ```
//!
//! ```text
//!  actions     one table of all that can be done; perform does it, bar, palette and keys find it
//!  painter     a worker thread a pane: prepares, draws coarse then fine, drops what is out of date
//!  pictures    which pictures are ordered and compared; pane shows one; modes: how panes share the window
//!  difference  where two pictures differ; probe, values: what they say of one place; chart: error against time
//!  equal       tolerances with which all back ends take the same time, or make the same error
//!  navigation  the camera that all panes share
//!  document    the scene, its file and its history; files, keeper, watch: what goes to disk and comes back
//!  scene_panel the things of the scene and their fields; gizmo, brush: changed in the picture
//!  settings    the panel of a back end, made from its declared parameters; style: that of the stylized one
//!  live        programs that change the scene; script: sessions that go by themselves
//! ```
//!
//! Nothing that takes long runs on the window's own thread: it only shows what the painters have finished.

mod actions;
mod bar;
mod brush;
mod chart;
mod dialog;
mod difference;
mod document;
mod equal;
mod export;
mod field;
mod files;
mod gizmo;
mod history;
mod keeper;
mod live;
mod measure;
mod modes;
mod navigation;
mod painter;
mod palette;
mod pane;
mod perform;
mod pictures;
mod probe;
mod scene_panel;
mod script;
mod settings;
mod style;
mod tools;
mod values;
mod viewer;
mod watch;

pub use actions::{ACTIONS, Action, Entry, Menu};
pub use document::open;
pub use eframe::egui::{InputState, Key};
pub use keeper::data_folder;
pub use live::Stage;
pub use measure::Times;
pub use modes::Mode;
pub use script::Script;
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
}

/// Shows a scene in a window with the built-in back ends, and returns when it is closed.
///
/// # Errors
/// When there is no display.
pub fn show(scene: Scene) -> Result<(), ViewerError> {
    show_viewer(Viewer::new(Registry::builtin(), scene)?)
}

/// Shows a scene that a program changes while it is shown: `step` is called before every frame with the scene, the
/// seconds since the window was opened, and what keys and mouse do.
///
/// ```no_run
/// use polyptych_viewer::{Key, show_with};
/// let scene = polyptych::builtin::scene("polyhedra").unwrap();
/// show_with(scene, |scene, time, input| {
///     scene.objects[0].world_from_object.translation.y = time.sin();
///     if input.key_pressed(Key::Backspace) {
///         scene.objects.pop();
///     }
/// })?;
/// # Ok::<(), polyptych_viewer::ViewerError>(())
/// ```
///
/// # Errors
/// When there is no display.
pub fn show_with(
    scene: Scene,
    step: impl FnMut(&mut Stage<'_>, f64, &InputState) + 'static,
) -> Result<(), ViewerError> {
    let mut viewer = Viewer::new(Registry::builtin(), scene)?;
    viewer.run(step);
    show_viewer(viewer)
}

/// Shows a viewer in a window, and returns when it is closed.
///
/// # Errors
/// When there is no display.
pub fn show_viewer(mut viewer: Viewer) -> Result<(), ViewerError> {
    let options = eframe::NativeOptions {
        viewport: eframe::egui::ViewportBuilder::default()
            .with_title("Polyptych")
            .with_inner_size(viewer.window_size().unwrap_or([1280.0, 800.0]))
            .with_drag_and_drop(true),
        ..eframe::NativeOptions::default()
    };
    let create: eframe::AppCreator<'_> = Box::new(|creation| {
        // Keys of our own do that.
        creation.egui_ctx.options_mut(|options| options.zoom_with_keyboard = false);
        viewer.dress(&creation.egui_ctx);
        Ok(Box::new(viewer))
    });
    eframe::run_native("polyptych", options, create).map_err(|error| ViewerError::Window(error.to_string()))
}
