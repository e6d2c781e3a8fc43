//! How long will a frame take?

use polyptych_core::framebuffer::Channel;
use polyptych_core::scene::{Object, Scene, Shape};
use polyptych_core::seam::{Need, Survey};

/// Nanoseconds on one thread of the machine that all back ends' constants were measured on.
mod nanoseconds {
    /// A pixel.
    pub(super) const PIXEL: f64 = 60.0;
    /// A ray against a body.
    pub(super) const BODY: f64 = 100.0;
    /// A ray against a mesh, for each doubling of its triangles.
    pub(super) const TRIANGLES: f64 = 34.0;
    /// A ray into a grid of voxels, for each cell along its longest edge.
    pub(super) const VOXELS: f64 = 9.0;
    /// A ray against a form, for each function in it.
    pub(super) const FUNCTION: f64 = 310.0;
    /// A ray against a height field, for each doubling of its columns.
    pub(super) const HEIGHTS: f64 = 160.0;
    /// A sample of a volume, with what it takes to light it.
    pub(super) const SAMPLE: f64 = 75.0;
    /// A surface.
    pub(super) const SURFACE: f64 = 100.0;
    /// A light on it.
    pub(super) const LIGHT: f64 = 60.0;
}

/// Foretells a frame on one thread; `lights` are all and those that cast shadows.
pub(crate) fn milliseconds(
    scene: &Scene,
    need: &Need,
    [lights, casting]: [usize; 2],
    samples: u32,
    volume_step: f64,
) -> f64 {
    use nanoseconds::{BODY, FUNCTION, HEIGHTS, LIGHT, PIXEL, SAMPLE, SURFACE, TRIANGLES, VOXELS};
    let survey = Survey::of(scene, need);
    let surface_of = |_: usize, object: &Object| match &*object.shape {
        Shape::Primitive(_) => BODY,
        Shape::Mesh(mesh) => BODY + TRIANGLES * (mesh.triangles.len().max(2) as f64).log2(),
        Shape::Voxels(voxels) => BODY + VOXELS * f64::from(voxels.size().into_iter().max().unwrap_or(1)),
        Shape::FreeForm(form) => FUNCTION * form.form().node_count() as f64,
        Shape::HeightField(field) => HEIGHTS * f64::from(field.columns().max(2)).log2(),
        Shape::Volume(_) => 0.0,
    };
    let volume_of = |index: usize, object: &Object| SAMPLE * survey.samples(index, object, volume_step);
    let rays = survey.sum(scene, surface_of);
    // A shadow ray passes what a ray of the picture passes, where there is anything.
    let shadow = rays / survey.entered.max(1e-3);
    let shades = need.channels.has(Channel::Color) || need.channels.has(Channel::Shadow);
    let light = if shades { lights as f64 * LIGHT + casting as f64 * shadow } else { 0.0 };
    let pixels = f64::from(need.width) * f64::from(need.height) * f64::from(samples);
    pixels * (PIXEL + rays + survey.sum(scene, volume_of) + survey.seen * (SURFACE + light)) * 1e-6
}
