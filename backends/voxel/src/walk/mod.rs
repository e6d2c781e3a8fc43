//! Which cells does a ray cross, in order? This file deals with grids of cells only, not with what they are
//! made of.
//!
//! Source: J. Amanatides, A. Woo, *A Fast Voxel Traversal Algorithm for Ray Tracing*, Eurographics 1987. We
//! deviate in three ways:
//!
//! - The distance of a plane `k` is always `(k - o) / d`, computed from its whole number and never summed up.
//! - Crossings have one order: by distance, then by axis (x, y, z), then along the ray. It is monotone even in
//!   rounded numbers, because the formula is. The cell at any moment is what all earlier crossings make it.
//! - An empty block is left in one stride. Its exit is the first crossing of one of its three far planes;
//!   the other axes are moved over exactly the planes that come before in the order. So the cells met behind
//!   it, and the distances, are those of the walk over single cells, bit for bit.
//!
//! Axes along which the ray descends are mirrored: cell `c` becomes `!c = -1 - c`, so that every ray ascends
//! and every aligned block stays an aligned block.

pub(crate) mod fixed;
mod lanes;
pub(crate) mod packet;
mod rays;
pub(crate) mod steps;

#[cfg(test)]
mod exactness;
#[cfg(test)]
mod tests;

use crate::grid::Layer;
use glam::DVec3;

/// A ray in the space of a grid, one unit a cell. Its direction need not have unit length: distances along
/// it are those of the space that it comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GridRay {
    /// Where it begins, as given.
    place: [f64; 3],
    /// Mirrored; -1 for an axis along which the ray stands still, so that all its planes lie at infinity.
    origin: [f64; 3],
    /// Mirrored, not negative; 0 for an axis along which the ray stands still.
    direction: [f64; 3],
    /// Infinite for an axis along which the ray stands still.
    inverse: [f64; 3],
    /// All bits set for a mirrored axis.
    flip: [i32; 3],
}

/// Share of the numbers at hand by which a place on a ray may be off, and with it the order of its planes: a few
/// roundings of 1e-16, and some more.
const ROUNDING: f64 = 1e-14;

/// Directions below this stand still: with it the distance of a plane could overflow.
const SLOWEST: f64 = 1e-290;

impl GridRay {
    /// Makes a ray ready. Nothing for one that goes nowhere, or whose numbers are not finite.
    #[inline(always)]
    pub(crate) fn new(origin: DVec3, direction: DVec3) -> Option<Self> {
        if !origin.is_finite() || !direction.is_finite() || direction.abs().max_element() < SLOWEST {
            return None;
        }
        let mut ray = Self {
            place: origin.to_array(),
            origin: [-1.0; 3],
            direction: [0.0; 3],
            inverse: [f64::INFINITY; 3],
            flip: [0; 3],
        };
        for a in 0..3 {
            let d = direction[a];
            if d.abs() < SLOWEST {
                continue;
            }
            let sign = if d < 0.0 { -1.0 } else { 1.0 };
            ray.flip[a] = if d < 0.0 { -1 } else { 0 };
            ray.origin[a] = sign * origin[a];
            ray.direction[a] = sign * d;
            ray.inverse[a] = 1.0 / ray.direction[a];
        }
        Some(ray)
    }

    /// Returns the distance of a plane between mirrored cells.
    #[inline(always)]
    fn plane(&self, axis: usize, k: i32) -> f64 {
        (f64::from(k) - self.origin[axis]) * self.inverse[axis]
    }

    /// Returns the distance of a plane between cells as they are, not mirrored.
    #[inline(always)]
    pub(crate) fn plane_of(&self, axis: usize, k: i32) -> f64 {
        self.plane(axis, if self.flip[axis] == 0 { k } else { -k })
    }

    /// Mirrors a cell, or mirrors it back. Written out: arrays built by closures cost calls here.
    #[inline(always)]
    fn mirrored(&self, [x, y, z]: [i32; 3]) -> [i32; 3] {
        [x ^ self.flip[0], y ^ self.flip[1], z ^ self.flip[2]]
    }

    #[inline(always)]
    fn stands_still(&self, axis: usize) -> bool {
        self.direction[axis] == 0.0
    }

    /// Returns the point at a distance.
    #[inline(always)]
    pub(crate) fn at(&self, t: f64) -> DVec3 {
        let along = |a: usize| {
            let step = self.direction[a] * t;
            if self.flip[a] == 0 { self.place[a] + step } else { self.place[a] - step }
        };
        DVec3::new(along(0), along(1), along(2))
    }

    /// Returns the axis with the longest part of the direction, the first of equals.
    #[inline(always)]
    fn longest_axis(&self) -> usize {
        let [x, y, z] = self.direction;
        if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        }
    }

    /// Returns the cell along an axis, between two, after all planes before a moment were crossed.
    #[inline(always)]
    fn cell_at(&self, axis: usize, from: i32, to: i32, moment: Moment) -> i32 {
        let step = self.direction[axis] * moment.t;
        let place = self.origin[axis] + step;
        let cell = nearest_whole(place - 0.5).clamp(from, to);
        // Far enough from both planes rounding cannot change their order; a cell at the end of its block has only
        // one plane that counts.
        let within = place - f64::from(cell);
        let slack = (self.origin[axis].abs() + step + 1.0) * ROUNDING;
        if (within > slack || cell == from) && (within < 1.0 - slack || cell == to) {
            return cell;
        }
        let is_reached = cell == from || moment.is_after(self.plane(axis, cell), axis);
        let is_left = cell < to && moment.is_after(self.plane(axis, cell + 1), axis);
        if is_reached && !is_left { cell } else { self.correct(axis, cell, from, to, moment) }
    }

    /// Moves a cell to where the planes say: the rounded place may be a cell off, or far off for huge numbers.
    #[cold]
    #[inline(never)]
    fn correct(&self, axis: usize, mut cell: i32, from: i32, to: i32, moment: Moment) -> i32 {
        while cell < to && moment.is_after(self.plane(axis, cell + 1), axis) {
            cell += 1;
        }
        while cell > from && !moment.is_after(self.plane(axis, cell), axis) {
            cell -= 1;
        }
        cell
    }
}

/// Rounds to a whole number by one addition; numbers beyond 2^31 give some number.
#[inline]
fn nearest_whole(x: f64) -> i32 {
    const SHIFT: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52: the lowest bits then count ones
    (x + SHIFT).to_bits() as i32
}

/// A place in the order of crossings: before the crossing of `axis` at `t`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    /// Distance.
    pub(crate) t: f64,
    /// Axes below it are crossed before at the same distance.
    pub(crate) axis: usize,
}

impl Moment {
    /// After everything at distance 0: rays begin with these planes crossed.
    pub(crate) const START: Self = Self { t: 0.0, axis: 3 };

    /// Before everything at a distance.
    pub(crate) fn before(t: f64) -> Self {
        Self { t, axis: 0 }
    }

    #[inline]
    fn is_after(self, t: f64, axis: usize) -> bool {
        t < self.t || (t == self.t && axis < self.axis)
    }
}

/// A walk along a ray through the cells of a grid.
///
/// Invariant: the ray is in `cell` from `t` on, until the first of the three far planes of the cell is crossed.
#[derive(Clone, Debug)]
pub(crate) struct Walk {
    ray: GridRay,
    size: [i32; 3],
    /// Mirrored.
    cell: [i32; 3],
    /// Where the cell was entered.
    pub(crate) t: f64,
    /// The axis along which it was entered; nothing where the walk began in it.
    pub(crate) entered: Option<usize>,
    /// How often a cell or an empty block was left.
    pub(crate) steps: u32,
}

impl Walk {
    /// Begins at a moment within the grid, or later where the ray enters it. Nothing where it never does.
    #[inline(always)]
    pub(crate) fn begin(ray: GridRay, size: [i32; 3], moment: Moment) -> Option<Self> {
        let low = [-(size[0] & ray.flip[0]), -(size[1] & ray.flip[1]), -(size[2] & ray.flip[2])];
        let (mut start, mut entered) = (moment, None);
        for (a, &low) in low.iter().enumerate() {
            if ray.stands_still(a) {
                if !(0.0..=f64::from(size[a])).contains(&ray.place[a]) {
                    return None;
                }
            } else if !start.is_after(ray.plane(a, low), a) {
                (start, entered) = (Moment { t: ray.plane(a, low), axis: a }, Some(a));
            }
        }
        if start.t == f64::INFINITY {
            return None;
        }
        let mut cell = low;
        for a in 0..3 {
            if ray.stands_still(a) {
                // The last cell holds both of its faces, so that a ray in the border of the grid is in it.
                cell[a] = (ray.place[a] as i32).min(size[a] - 1);
            } else if start.is_after(ray.plane(a, low[a] + size[a]), a) {
                return None;
            } else if entered != Some(a) {
                cell[a] = ray.cell_at(a, low[a], low[a] + size[a] - 1, start);
            }
        }
        Some(Self { ray, size, cell, t: start.t, entered, steps: 0 })
    }

    /// Begins at the origin of the ray in a cell that is known. Nothing where it lies outside of the grid; a ray
    /// that left the grid and goes away from it never returns.
    #[inline(always)]
    pub(crate) fn begin_in(ray: GridRay, size: [i32; 3], cell: [i32; 3]) -> Option<Self> {
        let cell = ray.mirrored(cell);
        let walk = Self { ray, size, cell, t: 0.0, entered: None, steps: 0 };
        walk.is_inside().then_some(walk)
    }

    /// Returns the cell.
    #[inline(always)]
    pub(crate) fn cell(&self) -> [i32; 3] {
        self.ray.mirrored(self.cell)
    }

    /// Counts the planes between the cell and the corner at which a ray of this direction enters: rises by one
    /// with each single step, and is the same wherever the walk began.
    #[inline(always)]
    pub(crate) fn rank(&self) -> i64 {
        let low = |a: usize| i64::from(-(self.size[a] & self.ray.flip[a]));
        (0..3).map(|a| i64::from(self.cell[a]) - low(a)).sum()
    }

    /// Leaves an aligned block of `2^exponent` cells around the cell, in which nothing is of interest. False where
    /// the grid or the ray ends; the walk is then over.
    #[inline(always)]
    pub(crate) fn leave(&mut self, exponent: u32) -> bool {
        let mask = (1 << exponent) - 1;
        let exit = |a: usize| self.ray.plane(a, (self.cell[a] | mask) + 1);
        let (x, y, z) = (exit(0), exit(1), exit(2));
        self.steps += 1;
        if x <= y && x <= z {
            self.cross::<0>(x, mask);
        } else if y <= z {
            self.cross::<1>(y, mask);
        } else {
            self.cross::<2>(z, mask);
        }
        self.t < f64::INFINITY && self.is_inside()
    }

    /// Goes through the far plane of the block along an axis.
    #[inline(always)]
    fn cross<const AXIS: usize>(&mut self, t: f64, mask: i32) {
        if mask != 0 {
            let moment = Moment { t, axis: AXIS };
            for a in [(AXIS + 1) % 3, (AXIS + 2) % 3] {
                self.cell[a] = self.ray.cell_at(a, self.cell[a], self.cell[a] | mask, moment);
            }
        }
        self.cell[AXIS] = (self.cell[AXIS] | mask) + 1;
        // A walk that began in a known cell may find a plane behind its rounded origin.
        self.t = t.max(0.0);
        self.entered = Some(AXIS);
    }

    #[inline(always)]
    fn is_inside(&self) -> bool {
        let cell = self.cell();
        (cell[0] as u32) < self.size[0] as u32
            && (cell[1] as u32) < self.size[1] as u32
            && (cell[2] as u32) < self.size[2] as u32
    }

    /// Goes on to the first marked cell, this one included, that is entered before a distance. Tells whether
    /// there is one, and whether empty cells were passed on the way.
    #[inline(always)]
    pub(crate) fn find_marked(&mut self, layer: &Layer, before: f64) -> Found {
        let mut passed_empty = false;
        loop {
            let Some(exponent) = layer.empty_around(self.cell()) else {
                return Found::Marked { passed_empty };
            };
            passed_empty = true;
            if !self.leave(exponent) || self.t > before {
                return Found::Nothing;
            }
        }
    }

    /// Returns the face entered: twice the axis, plus one when it is the upper face of the cell. A walk that
    /// began in the cell is taken to have entered against the longest part of its direction.
    #[inline(always)]
    pub(crate) fn face(&self) -> usize {
        let axis = self.entered.unwrap_or(self.ray.longest_axis());
        axis * 2 + usize::from(self.ray.flip[axis] != 0)
    }

    /// Returns the point at which the cell was entered: within the cell, and exactly in the face.
    #[inline(always)]
    pub(crate) fn point(&self) -> DVec3 {
        let cell = DVec3::from_array(self.cell().map(f64::from));
        let mut point = self.ray.at(self.t).clamp(cell, cell + 1.0);
        if let Some(a) = self.entered {
            point[a] = cell[a] + f64::from(u8::from(self.ray.flip[a] != 0));
        }
        point
    }

    /// Returns the cell from which this one was entered: across the face, or the same where the walk began.
    #[inline(always)]
    pub(crate) fn cell_before(&self) -> [i32; 3] {
        let mut cell = self.cell;
        if let Some(a) = self.entered {
            cell[a] -= 1;
        }
        self.ray.mirrored(cell)
    }
}

/// What a walk came upon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Found {
    /// A marked cell.
    Marked {
        /// Whether cells that are not marked lay before it.
        passed_empty: bool,
    },
    /// The end of the grid, of the ray, or the distance.
    Nothing,
}
