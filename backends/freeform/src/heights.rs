//! How does a ray meet a height field?
//!
//! The rays of a tile are bounded together first: stretches in which all of them are above the highest or below the
//! lowest of the heights there are jumped, for the tile and then for each of its blocks. From there eight rays at a time
//! walk over the cells.

use crate::bundle::{COLUMNS, Hits, NOWHERE, OCTETS, Rays};
use crate::height_ranges::Ranges;
use crate::height_walk::Walk;
use crate::pyramid::{Pyramid, clip};
use glam::{DAffine3, DVec2};
use polyptych_core::lanes::{DVec3x8, F64x8, Mask8};
use polyptych_core::math::Aabb;
use polyptych_core::scene::HeightField;

/// Rows of a block of rays that is bounded by itself.
const BLOCK_ROWS: usize = 4;

/// Most cells along an edge of the box around a stretch of rays that are looked at.
const CELLS: i64 = 3;

/// A height field with its ranges of heights.
#[derive(Debug)]
pub(crate) struct HeightBody {
    ranges: Ranges,
    bounds: Aabb,
}

/// Scratch memory of one worker: the rays of a tile in object space.
#[derive(Default)]
pub(crate) struct HeightScratch {
    rays: Vec<Local>,
    /// Those that are on their way, by octet.
    walks: Vec<(usize, Walk)>,
}

/// Eight rays in object space with the stretch in which they may meet something.
#[derive(Clone, Copy)]
struct Local {
    origin: DVec3x8,
    direction: DVec3x8,
    near: F64x8,
    far: F64x8,
    open: Mask8,
}

impl HeightBody {
    pub(crate) fn new(field: &HeightField) -> Self {
        Self { ranges: Ranges::new(field), bounds: field.bounds() }
    }

    /// Returns what [`HeightBody::bytes`] will be.
    pub(crate) fn planned_bytes(field: &HeightField) -> u64 {
        Ranges::planned_bytes(field)
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.ranges.bytes()
    }

    polyptych_core::for_registers! {
        /// Improves `hits` where a ray of a tile meets the surface sooner.
        pub(crate) fn cast(
            &self,
            field: &HeightField,
            object_from_world: &DAffine3,
            body: u32,
            rays: &[Rays],
            hits: &mut [Hits],
            scratch: &mut HeightScratch,
        ) = cast_512, cast_256, cast_here;
    }

    #[inline(always)]
    fn cast_here(
        &self,
        field: &HeightField,
        object_from_world: &DAffine3,
        body: u32,
        rays: &[Rays],
        hits: &mut [Hits],
        scratch: &mut HeightScratch,
    ) {
        self.enter(object_from_world, rays, hits, &mut scratch.rays);
        let Some((start, length)) = self.first_near(field, &scratch.rays, (0.0, f64::INFINITY), 1.0) else {
            return;
        };
        // Blocks of the same columns and a few rows: as wide as high.
        scratch.walks.clear();
        for first in (0..OCTETS).step_by(BLOCK_ROWS * COLUMNS) {
            for column in 0..COLUMNS {
                let octets: [usize; BLOCK_ROWS] = std::array::from_fn(|row| first + row * COLUMNS + column);
                let block = octets.map(|octet| scratch.rays[octet]);
                let Some((start, _)) = self.first_near(field, &block, (start, length), 0.25) else {
                    continue;
                };
                for octet in octets {
                    let rays = &scratch.rays[octet];
                    let near = rays.near.max(F64x8::splat(start));
                    let open = rays.open & rays.far.at_least(near);
                    if open.any() {
                        let ways = (&rays.origin, &rays.direction);
                        let walk = Walk::start(field, &self.ranges, ways, (near, rays.far), open);
                        scratch.walks.push((octet, walk));
                    }
                }
            }
        }
        // One step each in turn: the processor begins the next while it waits for what one reads.
        let walks = &mut scratch.walks;
        let mut count = walks.len();
        while count > 0 {
            let mut at = 0;
            while at < count {
                walks[at].1.step(field, &self.ranges);
                if walks[at].1.open.any() {
                    at += 1;
                } else {
                    count -= 1;
                    walks.swap(at, count);
                }
            }
        }
        for (octet, walk) in walks {
            let (met, t) = walk.met();
            hits[*octet].improve(met, t, body, NOWHERE);
        }
    }

    /// Turns rays into object space and cuts them to the bounds and to what they met already.
    #[inline(always)]
    fn enter(&self, object_from_world: &DAffine3, rays: &[Rays], hits: &[Hits], locals: &mut Vec<Local>) {
        locals.clear();
        let shift = DVec3x8::splat(object_from_world.translation);
        for (r, hits) in rays.iter().zip(hits) {
            let origin = r.origin.turned(&object_from_world.matrix3) + shift;
            let direction = r.direction.turned(&object_from_world.matrix3);
            let (enter, leave) = clip(&self.bounds, &origin, &direction);
            let (near, far) = (enter.max(r.near), leave.min(r.far).min(hits.t));
            let open = r.open() & far.at_least(near);
            locals.push(Local { origin, direction, near, far, open });
        }
    }

    /// Returns a distance before which none of some rays meets anything, and the length of the stretches that were
    /// jumped last, where those get shorter than a share of the width of the rays. Nothing where they meet nothing at
    /// all. Begins at a distance with stretches of some length.
    #[inline(always)]
    fn first_near(
        &self,
        field: &HeightField,
        rays: &[Local],
        (start, length): (f64, f64),
        share: f64,
    ) -> Option<(f64, f64)> {
        let bounded = rays.iter().map(|r| (r.open, r.origin, r.direction, r.near, r.far));
        let (pyramid, near, far) = Pyramid::around(bounded)?;
        let over_grid = OverGrid::new(field);
        let mut begin = near.max(start);
        let mut length = length.min((far - begin) * 0.125);
        // Rays that go all ways get no further than their longest: the loop ends, as the stretch is halved each time.
        while begin < far {
            let end = (begin + length).min(far);
            if self.is_clear(&over_grid, &pyramid.between(begin, end)) {
                begin = end;
                length += length;
            } else {
                length *= 0.5;
                if length <= share * pyramid.width(begin) || length <= 1e-6 * (far - near) {
                    return Some((begin, length));
                }
            }
        }
        None
    }

    /// Tells whether a box is above or below all heights under it.
    #[inline(always)]
    fn is_clear(&self, over_grid: &OverGrid, part: &Aabb) -> bool {
        let low = DVec2::new(part.min.x, part.min.z) * over_grid.cells + over_grid.middle;
        let high = DVec2::new(part.max.x, part.max.z) * over_grid.cells + over_grid.middle;
        // Blocks of which so many hold the box, and no more than one more.
        let cells = (high - low).max_element() / (CELLS - 1) as f64;
        let level = (cells as u32).checked_ilog2().map_or(1, |l| l as usize + 1).min(self.ranges.top());
        let one_over = 1.0 / f64::from(1u32 << level);
        let [columns, rows] = self.ranges.size(level).map(|n| n as i32 - 1);
        let inside = |v: f64, last: i32| ((v * one_over).floor() as i32).clamp(0, last) as u32;
        let [steps, zero] = self.ranges.scale();
        let (bottom, top) = (part.min.y * steps + zero, part.max.y * steps + zero);
        let (first, last) = (inside(low.x, columns), inside(high.x, columns));
        for row in inside(low.y, rows)..=inside(high.y, rows) {
            for column in first..=last {
                let [lowest, highest] = self.ranges.of_block([column, row], level);
                if bottom <= highest && top >= lowest {
                    return false;
                }
            }
        }
        true
    }
}

/// Turns places over the base plane into cells from the first one.
struct OverGrid {
    cells: DVec2,
    middle: DVec2,
}

impl OverGrid {
    #[inline(always)]
    fn new(field: &HeightField) -> Self {
        let middle = DVec2::new(f64::from(field.columns() - 1), f64::from(field.rows() - 1)) * 0.5;
        Self { cells: field.cell_size().recip(), middle }
    }
}
