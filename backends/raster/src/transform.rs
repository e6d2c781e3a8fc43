//! Where on the picture is every vertex?

use crate::lens::{GUARD, Lens, ScreenFromObject};
use crate::model::Model;
use glam::Vec3;
use polyptych_core::parallel::{Threads, for_each_mut};

/// Vertices that one thread takes at a time.
const GRAIN: usize = 2048;

/// A vertex on the picture.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ScreenVertex {
    /// Column in pixels.
    pub(crate) x: f64,
    /// Row in pixels.
    pub(crate) y: f64,
    /// See [`Lens::depth`].
    pub(crate) depth: f64,
    /// Which of the borders below it is beyond.
    pub(crate) beyond: u32,
}

/// Bits of [`ScreenVertex::beyond`].
pub(crate) mod border {
    /// Not far enough ahead: column, row and depth mean nothing.
    pub(crate) const NEAR: u32 = 1;
    pub(crate) const LEFT: u32 = 2;
    pub(crate) const RIGHT: u32 = 4;
    pub(crate) const TOP: u32 = 8;
    pub(crate) const BOTTOM: u32 = 16;
    /// Beyond the guard band.
    pub(crate) const GUARD: u32 = 32;
    /// A coordinate that is not finite.
    pub(crate) const NOWHERE: u32 = 64;
    /// A triangle with all corners beyond one of these is not seen.
    pub(crate) const HIDING: u32 = NEAR | LEFT | RIGHT | TOP | BOTTOM;
    /// A triangle with a corner beyond one of these must be clipped.
    pub(crate) const CLIPPING: u32 = NEAR | GUARD;
}

/// Transforms all vertices of a model, those of a part at its `first_vertex`.
pub(crate) fn transform(model: &Model, lens: &Lens, vertices: &mut Vec<ScreenVertex>, threads: &dyn Threads) {
    vertices.resize(model.vertices, ScreenVertex::default());
    for part in &model.parts {
        let screen_from_object = lens.for_object(&part.world_from_object);
        let positions = &part.mesh().positions;
        let of_part = &mut vertices[part.first_vertex..][..positions.len()];
        for_each_mut(threads, of_part, GRAIN, &|i, vertex| {
            *vertex = project(lens, &screen_from_object, positions[i]);
        });
    }
}

fn project(lens: &Lens, screen_from_object: &ScreenFromObject, position: Vec3) -> ScreenVertex {
    let h = screen_from_object.apply(position.as_dvec3());
    if !(h.x + h.y + h.ahead).is_finite() {
        return ScreenVertex { beyond: border::NOWHERE, ..ScreenVertex::default() };
    }
    if h.ahead < lens.near {
        return ScreenVertex { beyond: border::NEAR, ..ScreenVertex::default() };
    }
    let share = 1.0 / lens.divisor(h.ahead);
    let (x, y) = (h.x * share, h.y * share);
    let (width, height) = (f64::from(lens.width), f64::from(lens.height));
    let bit = |is_beyond: bool, border: u32| if is_beyond { border } else { 0 };
    let beyond = bit(x < 0.0, border::LEFT)
        | bit(x > width, border::RIGHT)
        | bit(y < 0.0, border::TOP)
        | bit(y > height, border::BOTTOM)
        | bit(x < -GUARD || x > width + GUARD || y < -GUARD || y > height + GUARD, border::GUARD);
    ScreenVertex { x, y, depth: lens.depth(h.ahead), beyond }
}
