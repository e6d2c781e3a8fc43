//! How does an object take paint, and where does the pattern of its strokes lie?

use glam::{Mat3, Vec3};
use polyptych_core::camera::Camera;
use polyptych_core::scene::Object;

/// How an object takes paint: what is the same for all its pixels.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Look {
    pub(crate) specular: f32,
    pub(crate) shininess: f32,
    /// Cosine below which its highlight is less than a five-hundredth: not seen.
    pub(crate) faint: f32,
    /// Whether its color channel holds texture coordinates and the slot of its material.
    pub(crate) is_coded: bool,
    /// Edge of the strokes' pattern in object space, before scaling.
    pub(crate) period: f64,
    /// From places relative to the eye to the pattern.
    pub(crate) pattern: Mat3,
    /// Where the eye is in the pattern.
    pub(crate) eye: Vec3,
    /// Turns normals to the body's axes.
    pub(crate) turn: Mat3,
    /// Pattern in a meter.
    pub(crate) repeats: f32,
}

impl Look {
    /// Places the pattern for a frame.
    pub(crate) fn place(&mut self, object: &Object, camera: &Camera, scale: f32) {
        let period = self.period * f64::from(scale);
        if !(period > 0.0 && period.is_finite()) {
            return;
        }
        let from_world = object.world_from_object.inverse();
        self.pattern = (from_world.matrix3 * (1.0 / period)).as_mat3();
        // Whole periods away it is the same, and nearer to the numbers that can be told apart.
        let eye = from_world.transform_point3(camera.eye) / period;
        self.eye = (eye - eye.floor()).as_vec3();
        let turn = object.world_from_object.matrix3.transpose();
        let largest =
            [turn.x_axis, turn.y_axis, turn.z_axis].iter().map(|a| a.abs().max_element()).fold(0.0, f64::max);
        self.turn = (turn * (1.0 / largest)).as_mat3();
        self.repeats = (from_world.matrix3.determinant().abs().cbrt() / period) as f32;
    }
}
