//! How are the lines of a picture drawn as vectors?

use crate::scene::Scene;
use crate::seam::{Control, Need, RenderError, Renderer};
use crate::{Studio, StudioError};
use polyptych_stylized::Stylized;
use std::sync::Arc;

/// Draws the contours of a scene as an SVG picture, in the style that the settings of the need name: those of the
/// back end `stylized`. Where the style has paper it is the ground; tones and strokes are left out.
///
/// ```
/// # use polyptych::prelude::*;
/// let scene = polyptych::builtin::scene("polyhedra")?;
/// let need = Need::new(scene.cameras[0].1.clone(), 320, 180);
/// let svg = polyptych::vector::lines_as_svg(&Studio::new(Registry::builtin(), 1)?, &scene.into(), &need)?;
/// assert!(svg.starts_with("<svg ") && svg.contains("data-kind=\"crease\""));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the settings name no style, or a required object cannot be drawn.
pub fn lines_as_svg(studio: &Studio, scene: &Arc<Scene>, need: &Need) -> Result<String, StudioError> {
    let mut renderer = Stylized::new(studio.registry().clone());
    let mut draw = || -> Result<String, RenderError> {
        let control = Control::new(studio.pool());
        renderer.prepare(scene, need, studio.converter(), &control)?;
        renderer.svg(&need.frame(), need.width, need.height, &control)
    };
    draw().map_err(|error| StudioError::Render { backend: "stylized".to_owned(), error })
}
