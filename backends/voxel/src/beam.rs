//! Which part of a grid may many rays meet that go about the same way?
//!
//! Rays that share a longest axis stay within a prism that widens along it: an interval of origins plus an
//! interval of slopes. Where no block of the grid that the prism touches is marked, no ray of it meets anything,
//! so each may begin where the prism first touches a marked block and end where it last does. That changes no
//! result: the walk begins before the plane through which its ray enters that block.

use crate::grid::Layer;
use crate::walk::GridRay;
use crate::walk::packet::GridRays;
use glam::{DAffine3, DVec3};
use polyptych_core::lanes::F64x8;
use polyptych_core::math::Aabb;

/// Rays in the world: every origin may go with every direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bundle<'a> {
    pub(crate) origins: Aabb,
    pub(crate) directions: &'a [DVec3],
}

/// A prism around rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam {
    /// The axis along which the rays go farthest.
    axis: usize,
    ascends: bool,
    origins: Aabb,
    /// Steps along the two axes after `axis` for one along it: least and most.
    slopes: [(f64, f64); 2],
}

/// Stretch of a grid along an axis in which marked cells are: planes between cells, in the order of the rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    axis: usize,
    near: i32,
    far: i32,
}

/// Directions whose part along the axis is smaller than this share of the largest part make no beam.
const STEEPEST: f64 = 0.2;
/// Far more than rounding moves a ray, as a share of the numbers at hand; far less than a cell.
const SLACK: f64 = 1e-9;
/// A section that touches more blocks is taken to touch a marked one: looking would cost more than it saves.
const MOST_BLOCKS: i64 = 256;
/// Grids longer than this many of the coarsest slabs are not looked through for each tile.
const MOST_SLABS: i32 = 1024;
/// Edges of the blocks that are looked at, as exponents of two.
const COARSEST: u32 = 6;
const FINEST: u32 = 2;

impl Beam {
    /// Bounds rays, moved into another space. Nothing where they go apart too far.
    pub(crate) fn of(bundle: &Bundle<'_>, map: &DAffine3) -> Option<Self> {
        let origins = bundle.origins.transformed(map);
        let largest = origins.min.abs().max(origins.max.abs()).max_element();
        if origins.is_empty() || !largest.is_finite() {
            return None;
        }
        let directions = || bundle.directions.iter().map(|&d| map.transform_vector3(d));
        let mean: DVec3 = directions().sum();
        let [x, y, z] = mean.abs().to_array();
        let axis = if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        };
        let sign = mean[axis].signum();
        let mut slopes = [(f64::INFINITY, f64::NEG_INFINITY); 2];
        for d in directions() {
            // False for what is not a number, too.
            let is_steep = d[axis] * sign > STEEPEST * d.abs().max_element();
            if !is_steep {
                return None;
            }
            for (i, (low, high)) in slopes.iter_mut().enumerate() {
                let slope = d[(axis + 1 + i) % 3] / d[axis];
                (*low, *high) = (low.min(slope), high.max(slope));
            }
        }
        let slopes = slopes.map(|(low, high)| (low - SLACK, high + SLACK));
        let origins = origins.grown(largest * SLACK);
        (!bundle.directions.is_empty()).then_some(Self { axis, ascends: sign > 0.0, origins, slopes })
    }

    /// Returns the least and most coordinates along the two axes after [`Self::axis`] between two planes, grown by
    /// `slack`. Nothing where no ray gets there.
    fn section(&self, from: f64, to: f64, slack: f64) -> Option<[(f64, f64); 2]> {
        let (low, high) = (self.origins.min[self.axis], self.origins.max[self.axis]);
        // How far rays went along the axis.
        let (a, b) = if self.ascends {
            ((from - high).max(0.0), to - low)
        } else {
            (from - high, (to - low).min(0.0))
        };
        if a > b {
            return None;
        }
        let slack = slack + SLACK * (a.abs().max(b.abs()));
        Some(std::array::from_fn(|i| {
            let ((low, high), axis) = (self.slopes[i], (self.axis + 1 + i) % 3);
            let least = (low * a).min(low * b).min(high * a).min(high * b);
            let most = (low * a).max(low * b).max(high * a).max(high * b);
            (self.origins.min[axis] + least - slack, self.origins.max[axis] + most + slack)
        }))
    }

    /// Tells whether a ray may meet a box.
    pub(crate) fn touches(&self, bounds: &Aabb) -> bool {
        let section = self.section(bounds.min[self.axis], bounds.max[self.axis], 0.0);
        section.is_some_and(|section| {
            section.iter().enumerate().all(|(i, &(low, high))| {
                let axis = (self.axis + 1 + i) % 3;
                low <= bounds.max[axis] && bounds.min[axis] <= high
            })
        })
    }

    /// Finds where marked cells are that a ray may meet; the beam must be in the space of the grid.
    pub(crate) fn span(&self, layer: &Layer) -> Option<Span> {
        let slabs = 0..(layer.size[self.axis] + (1 << COARSEST) - 1) >> COARSEST;
        if slabs.end > MOST_SLABS {
            let (low, high) = (0, layer.size[self.axis]);
            let (near, far) = if self.ascends { (low, high) } else { (high, low) };
            return Some(Span { axis: self.axis, near, far });
        }
        let lowest = self.slab(layer, COARSEST, slabs.clone(), false)?;
        let highest = self.slab(layer, COARSEST, slabs, true)?;
        let (low, high) = (lowest << FINEST, (highest + 1) << FINEST);
        let (near, far) = if self.ascends { (low, high) } else { (high, low) };
        Some(Span { axis: self.axis, near, far })
    }

    /// Finds the first, or the last, of the finest slabs in which a marked block is touched.
    fn slab(
        &self,
        layer: &Layer,
        exponent: u32,
        slabs: std::ops::Range<i32>,
        from_above: bool,
    ) -> Option<i32> {
        let count = slabs.len() as i32;
        for i in 0..count {
            let slab = if from_above { slabs.end - 1 - i } else { slabs.start + i };
            if !self.is_marked(layer, exponent, slab) {
                continue;
            }
            if exponent == FINEST {
                return Some(slab);
            }
            let parts = slab << 2..(slab + 1) << 2;
            if let Some(found) = self.slab(layer, exponent - 2, parts, from_above) {
                return Some(found);
            }
        }
        None
    }

    /// Tells whether a marked block is touched between two planes.
    fn is_marked(&self, layer: &Layer, exponent: u32, slab: i32) -> bool {
        let (from, to) = (f64::from(slab << exponent), f64::from((slab + 1) << exponent));
        let Some(section) = self.section(from, to, 1e-6) else { return false };
        let (b, c) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let blocks = |i: usize, axis: usize| {
            let last = f64::from(layer.size[axis] - 1);
            let (low, high) = section[i];
            // Cells up to and including the last.
            let is_touched = low < last + 1.0 && high > 0.0;
            is_touched.then(|| ((low.max(0.0) as i32) >> exponent, (high.min(last) as i32) >> exponent))
        };
        let (Some((b0, b1)), Some((c0, c1))) = (blocks(0, b), blocks(1, c)) else { return false };
        if i64::from(b1 - b0 + 1) * i64::from(c1 - c0 + 1) > MOST_BLOCKS {
            return true;
        }
        let mut cell = [0; 3];
        cell[self.axis] = slab << exponent;
        (c0..=c1).any(|at_c| {
            cell[c] = at_c << exponent;
            (b0..=b1).any(|at_b| {
                cell[b] = at_b << exponent;
                layer.has_block(cell, exponent)
            })
        })
    }
}

impl Span {
    /// Returns the distances at which a ray enters and leaves the stretch.
    #[inline(always)]
    pub(crate) fn distances(&self, ray: &GridRay) -> (f64, f64) {
        (ray.plane_of(self.axis, self.near), ray.plane_of(self.axis, self.far))
    }

    /// Does the same for eight rays.
    #[inline(always)]
    pub(crate) fn eight_distances(&self, rays: &GridRays) -> (F64x8, F64x8) {
        (rays.plane_of(self.axis, self.near), rays.plane_of(self.axis, self.far))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Chunks;
    use crate::occupancy::Values;
    use crate::walk::{Found, Moment, Walk};
    use polyptych_core::scene::Voxels;
    use polyptych_core::seam::Control;

    fn random(state: &mut u64) -> f64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Every ray of a beam meets its first marked cell within the span, and none where there is no span.
    #[test]
    fn no_ray_of_a_beam_meets_anything_outside_of_its_span() {
        let all = Values::of(|_| true);
        let mut state = 9;
        let (mut empty, mut met, mut shortened) = (0, 0, 0);
        for round in 0..8 {
            let size = [130, 70, 90];
            let voxels = Voxels::from_fn(size, |x, y, z| {
                let d = DVec3::new(f64::from(x) - 60.0, f64::from(y) - 35.0, f64::from(z) - 45.0).length();
                u8::from((20.0..21.5).contains(&d) || (x + 2 * y + 5 * z) % 3001 == round)
            });
            let grid = Chunks::default().grid(&voxels, all, all, &Control::simple()).unwrap();
            for _ in 0..100 {
                let mut point = |scale: f64| {
                    DVec3::new(random(&mut state), random(&mut state), random(&mut state)) * scale
                };
                let origin = point(300.0) - 100.0;
                let directions: Vec<DVec3> = {
                    let to = point(90.0) - origin;
                    (0..4).map(|_| (to + point(12.0)).normalize_or(DVec3::X)).collect()
                };
                let bundle =
                    Bundle { origins: Aabb::new(origin, origin + point(3.0)), directions: &directions };
                let Some(beam) = Beam::of(&bundle, &DAffine3::IDENTITY) else { continue };
                let span = beam.span(&grid.seen);
                empty += u32::from(span.is_none());
                for _ in 0..8 {
                    let weights: [f64; 4] = std::array::from_fn(|_| random(&mut state));
                    let direction: DVec3 = (0..4).map(|i| directions[i] * weights[i]).sum();
                    let place = DVec3::new(random(&mut state), random(&mut state), random(&mut state));
                    let from = bundle.origins.min + bundle.origins.size() * place;
                    let ray = GridRay::new(from, direction).unwrap();
                    let Some(mut walk) = Walk::begin(ray, grid.seen.size, Moment::START) else { continue };
                    if walk.find_marked(&grid.seen, f64::INFINITY) == Found::Nothing {
                        continue;
                    }
                    let (near, far) = span.expect("a ray met a cell").distances(&ray);
                    assert!(near.max(0.0) <= walk.t && walk.t <= far, "{near} {} {far}", walk.t);
                    // Begun at the span, the walk finds the same.
                    if near > 0.0 {
                        let mut late = Walk::begin(ray, grid.seen.size, Moment::before(near)).unwrap();
                        assert_ne!(late.find_marked(&grid.seen, far), Found::Nothing);
                        assert_eq!((late.cell(), late.t, late.entered), (walk.cell(), walk.t, walk.entered));
                        shortened += u32::from(late.steps < walk.steps);
                    }
                    met += 1;
                }
            }
        }
        assert!(empty > 20 && met > 1000 && shortened > 200, "{empty} {met} {shortened}");
    }
}
