//! Where on the picture is every vertex?

use crate::lens::{GUARD, Lens, ScreenFromObject};
use crate::model::{Model, Part};
use crate::setup::{Corners, STEPS, ScreenPoint};
use glam::Vec3;
use polyptych_core::lanes::{F64x8, LANES, Mask8, Vec3x8};
use polyptych_core::seam::{Cancelled, Control};

/// Eights of vertices that one thread takes at a time.
const GRAIN: usize = 256;

/// Eight vertices on the picture. What decides about most triangles comes first in memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenVertices {
    /// In steps.
    column: [i32; LANES],
    row: [i32; LANES],
    /// Which of the borders below each is beyond.
    beyond: [u32; LANES],
    /// In pixels.
    x: [f64; LANES],
    y: [f64; LANES],
    /// See [`Lens::depth`].
    depth: [f64; LANES],
}

/// The vertices of a part on the picture.
#[derive(Clone, Copy)]
pub(crate) struct PartOnScreen<'a>(&'a [ScreenVertices]);

/// Borders that a vertex can be beyond, one bit each.
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

impl<'a> PartOnScreen<'a> {
    pub(crate) fn of(vertices: &'a [ScreenVertices], part: &Part) -> Self {
        Self(&vertices[part.first_eight..])
    }

    /// Returns column and row of a vertex, in steps, and which borders it is beyond.
    #[inline(always)]
    pub(crate) fn snapped(&self, vertex: u32) -> (i32, i32, u32) {
        let (eight, lane) = (&self.0[vertex as usize / LANES], vertex as usize % LANES);
        (eight.column[lane], eight.row[lane], eight.beyond[lane])
    }

    /// Returns a vertex that is ahead.
    #[inline(always)]
    pub(crate) fn point(&self, vertex: u32) -> ScreenPoint {
        let (eight, lane) = (&self.0[vertex as usize / LANES], vertex as usize % LANES);
        ScreenPoint { x: eight.x[lane], y: eight.y[lane], depth: eight.depth[lane] }
    }

    /// Returns the corners of a triangle that is ahead.
    #[inline(always)]
    pub(crate) fn corners(&self, [a, b, c]: [u32; 3]) -> Corners {
        let [p, q, r] = [self.snapped(a), self.snapped(b), self.snapped(c)];
        let points = [self.point(a), self.point(b), self.point(c)];
        Corners { points, x: [p.0, q.0, r.0], y: [p.1, q.1, r.1] }
    }
}

polyptych_core::for_registers! {
    /// Projects up to eight points.
    fn project(lens: &Lens, screen_from_object: &ScreenFromObject, points: &[Vec3]) -> ScreenVertices
        = project_512, project_256, project_here;
}

#[inline(always)]
fn project_here(lens: &Lens, screen_from_object: &ScreenFromObject, points: &[Vec3]) -> ScreenVertices {
    ScreenVertices::of(lens, screen_from_object, points)
}

impl ScreenVertices {
    const NONE: Self = Self {
        column: [0; LANES],
        row: [0; LANES],
        beyond: [border::NOWHERE; LANES],
        x: [0.0; LANES],
        y: [0.0; LANES],
        depth: [0.0; LANES],
    };

    /// Projects up to eight points.
    #[inline(always)]
    fn of(lens: &Lens, screen_from_object: &ScreenFromObject, points: &[Vec3]) -> Self {
        let mut gathered = Vec3x8::splat(Vec3::ZERO);
        for (lane, point) in points.iter().enumerate().take(LANES) {
            gathered.set(lane, *point);
        }
        let [x, y, ahead] = screen_from_object.apply_all(gathered.to_f64());
        let is_somewhere = F64x8::splat(f64::INFINITY).above((x + y + ahead).abs());
        let is_near = F64x8::splat(lens.near).above(ahead);
        let (divisor, depth) = lens.divisors_and_depths(ahead);
        let share = F64x8::splat(1.0) / divisor;
        let (x, y) = (x * share, y * share);
        let (width, height) = (f64::from(lens.width), f64::from(lens.height));
        let bit = |is_beyond: Mask8, border: u32| is_beyond & Mask8::new([border; LANES]);
        let at = F64x8::splat;
        let beyond_guard = at(-GUARD).above(x)
            | x.above(at(width + GUARD))
            | at(-GUARD).above(y)
            | y.above(at(height + GUARD));
        let beyond = bit(at(0.0).above(x), border::LEFT)
            | bit(x.above(at(width)), border::RIGHT)
            | bit(at(0.0).above(y), border::TOP)
            | bit(y.above(at(height)), border::BOTTOM)
            | bit(beyond_guard, border::GUARD);
        let beyond = is_near.pick_bits(Mask8::new([border::NEAR; LANES]), beyond);
        let steps = F64x8::splat(f64::from(STEPS));
        Self {
            column: (x * steps).nearest().0.values(),
            row: (y * steps).nearest().0.values(),
            beyond: is_somewhere.pick_bits(beyond, Mask8::new([border::NOWHERE; LANES])).0.values(),
            x: x.0.values(),
            y: y.0.values(),
            depth: depth.0.values(),
        }
    }
}

/// Transforms all vertices of a model, those of a part from its `first_eight` on.
pub(crate) fn transform(
    model: &Model,
    lens: &Lens,
    vertices: &mut Vec<ScreenVertices>,
    control: &Control<'_>,
) -> Result<(), Cancelled> {
    vertices.resize(model.eights, ScreenVertices::NONE);
    for part in &model.parts {
        let screen_from_object = lens.for_object(&part.world_from_object);
        let positions = &part.mesh().positions;
        let of_part = &mut vertices[part.first_eight..][..positions.len().div_ceil(LANES)];
        control.for_each_mut(of_part, GRAIN, &|i, eight| {
            let end = positions.len().min((i + 1) * LANES);
            *eight = project(lens, &screen_from_object, &positions[i * LANES..end]);
        })?;
    }
    Ok(())
}
