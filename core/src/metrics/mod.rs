//! How far apart are two pictures, channel by channel?
//!
//! Geometry channels are compared off a one-pixel band around the edges of the reference (pixels whose 3x3
//! neighborhood shows more than one object), because there a pixel's middle may fall on either side. Colors
//! are compared as they are displayed: sRGB-encoded and clamped to `[0, 1]`, edges included.

mod color;
mod filter;
mod flip;
mod gate;
mod geometry;
mod ssim;

pub use color::ColorErrors;
pub use flip::flip_map;
pub use gate::{Gate, GateClass, Verdict};
pub use geometry::{DistanceErrors, NormalErrors};
pub use ssim::ssim;

use crate::framebuffer::{Channel, Framebuffer};
use serde::Serialize;

/// Errors of a picture against a reference; a channel that one of the two lacks has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Differences of distance where both see the same object.
    pub distance: Option<DistanceErrors>,
    /// Angles between normals where both see the same object, degrees.
    pub normal_deg: Option<NormalErrors>,
    /// Share of pixels off edges with the same id.
    pub id_agreement: Option<f64>,
    /// Pixels where both see something over pixels where one does.
    pub silhouette_iou: Option<f64>,
    /// Share of pixels off edges, showing the same object, whose shadow differs by less than a half.
    pub shadow_agreement: Option<f64>,
    /// Differences of color.
    pub color: Option<ColorErrors>,
}

impl Errors {
    /// Compares a picture with a reference of the same size.
    ///
    /// # Panics
    /// When the sizes differ: pictures of one comparison always have one size.
    #[must_use]
    pub fn between(picture: &Framebuffer, reference: &Framebuffer) -> Self {
        let mut errors = Self::of_geometry(picture, reference);
        if picture.channels().has(Channel::Color) && reference.channels().has(Channel::Color) {
            errors.color = Some(ColorErrors::between(picture, reference));
        }
        errors
    }

    /// Compares everything but color, which takes most of the time.
    ///
    /// # Panics
    /// When the sizes differ: pictures of one comparison always have one size.
    #[must_use]
    pub fn of_geometry(picture: &Framebuffer, reference: &Framebuffer) -> Self {
        assert_eq!(
            (picture.width(), picture.height()),
            (reference.width(), reference.height()),
            "pictures of different size"
        );
        let both = |c: Channel| picture.channels().has(c) && reference.channels().has(c);
        let mut errors = Self::default();
        if both(Channel::Id) {
            let edges = geometry::edge_band(reference);
            let same = geometry::same_object(picture, reference, &edges);
            errors.id_agreement = Some(geometry::id_agreement(picture, reference, &edges));
            errors.silhouette_iou = Some(geometry::silhouette_iou(picture, reference));
            if both(Channel::Distance) {
                errors.distance = Some(DistanceErrors::between(picture, reference, &same));
            }
            if both(Channel::Normal) {
                errors.normal_deg = Some(NormalErrors::between(picture, reference, &same));
            }
            if both(Channel::Shadow) {
                errors.shadow_agreement = Some(geometry::shadow_agreement(picture, reference, &same));
            }
        }
        errors
    }
}

/// Returns the root mean square difference of displayed colors alone; nothing where a picture has none.
#[must_use]
pub fn color_rmse(picture: &Framebuffer, reference: &Framebuffer) -> Option<f64> {
    let both = picture.channels().has(Channel::Color) && reference.channels().has(Channel::Color);
    both.then(|| color::differences(&display_colors(picture), &display_colors(reference)).0)
}

/// Encodes the color plane as it is displayed.
#[must_use]
pub fn display_colors(picture: &Framebuffer) -> Vec<[f32; 3]> {
    picture.color().iter().map(|c| c.to_array().map(crate::shade::srgb_from_linear)).collect()
}

/// Returns the value below which 99 of 100 lie; 0 of none.
fn percentile_99(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((values.len() - 1) as f64 * 0.99).round() as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}
