//! Where do eight rays begin, and how did they enter the cells that they came to? The walk of [`super::Walk`], eight rays
//! at once, in single precision; [`super::steps`] takes its steps.
//!
//! Rays begin anew at a place within the grid, and so small numbers are enough. With [`Order::Exact`] each step is
//! taken only where its outcome is beyond doubt: where the place at which a ray leaves a block lies farther from all
//! other planes than rounding can have moved it. Doubtful steps, one or two in a thousand, are taken in double
//! precision by [`super::Walk::leave`]. So the cells are those of the walk over single cells in double precision, for
//! every ray. [`Order::Rounded`] takes places as they are rounded, moved into the block: a few rays in a million then
//! see a neighbor of their cell.

pub(crate) use super::rays::GridRays;
use crate::grid::Layer;
use polyptych_core::lanes::{DVec3x8, F64x8, I32x8, LANES, Mask8};

/// How the cell behind an empty block is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// As the walk over single cells in double precision finds it.
    Exact,
    /// By the rounded place.
    Rounded,
}

/// Single precision stands for a place by this share of the largest number at hand: the roundings of a place and of
/// the distance that it is reckoned from are eight of 2^-24 at most.
const DOUBT: f64 = 8.0 / 16_777_216.0;

/// Grids longer than this are walked in double precision: nearly every step would be in doubt.
const LONGEST: i32 = 1 << 15;

/// So are rays from as many cells away: double precision then places them no better.
const FARTHEST: f64 = 1e12;

/// Where eight walks are to go.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    /// Distance before which nothing is met; not positive where a ray begins at its origin.
    pub(crate) from: F64x8,
    /// Distance up to which cells are looked for.
    pub(crate) to: F64x8,
}

/// Where eight walks begin.
struct Place {
    /// Mirrored.
    cell: [I32x8; 3],
    /// See [`Packet::entered`].
    entered: I32x8,
    /// Distances.
    begun: F64x8,
    /// Those that are in the grid.
    active: Mask8,
}

impl Place {
    /// Moves to where rays enter the grid; `late` are those that begin behind their origins.
    #[inline(always)]
    fn enter(&mut self, rays: &GridRays, size: [i32; 3], late: Mask8) {
        let (zero, mut start, mut active) = (F64x8::ZERO, self.begun, self.active);
        let mut axis = I32x8::pick(late, I32x8::splat(0), I32x8::splat(3));
        let mut entered = I32x8::splat(3);
        let low = |a: usize| rays.flip[a] & I32x8::splat(-size[a]);
        for (a, &edge) in size.iter().enumerate() {
            let this = I32x8::splat(a as i32);
            let t = rays.plane(a, low(a));
            let passed = start.above(t) | (t.equal(start) & this.below(axis));
            let enters = !(passed | rays.still[a]);
            start = F64x8::pick(enters, t, start);
            axis = I32x8::pick(enters, this, axis);
            entered = I32x8::pick(enters, this, entered);
            let (place, last) = (rays.place[a], F64x8::splat(f64::from(edge)));
            active = active & (!rays.still[a] | (place.at_least(zero) & last.at_least(place)));
        }
        active = active & F64x8::splat(f64::INFINITY).above(start);
        for (a, &edge) in size.iter().enumerate() {
            let this = I32x8::splat(a as i32);
            let last = low(a) + I32x8::splat(edge - 1);
            let t = rays.plane(a, last + I32x8::splat(1));
            let left = start.above(t) | (t.equal(start) & this.below(axis));
            active = active & (rays.still[a] | !left);
            let moving = rays.cell_at(a, low(a), last, start, axis, active);
            let moving = I32x8::pick(entered.equal(this), low(a), moving);
            // The last cell holds both of its faces, so that a ray in the border of the grid is in it.
            let still = rays.place[a].nearest_below().min(I32x8::splat(edge - 1));
            self.cell[a] = I32x8::pick(rays.still[a], still, moving);
        }
        (self.entered, self.begun, self.active) = (entered, start, active);
    }
}

/// Eight walks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Packet {
    /// Mirrored cells in which the walks begin: places are counted from them, so that near ones are told best.
    pub(super) base: [[i32; LANES]; 3],
    /// Where the walks begin.
    pub(super) origin: [[f32; LANES]; 3],
    pub(super) direction: [[f32; LANES]; 3],
    pub(super) inverse: [[f32; LANES]; 3],
    /// By how much rounding may change the distance of a plane of each axis.
    pub(super) fuzz: [[f32; LANES]; 3],
    /// By how much it may change a place.
    pub(super) slack: [f32; LANES],
    pub(super) flip: [[i32; LANES]; 3],
    /// First mirrored cell beyond the grid.
    pub(super) end: [[i32; LANES]; 3],
    pub(super) cell: [[i32; LANES]; 3],
    /// The axis along which each cell was entered, 3 where the walk began in it.
    pub(super) entered: [i32; LANES],
    /// How far the walks go.
    pub(super) to: [f32; LANES],
    /// Distances at which they begin.
    begun: F64x8,
    /// Those that go.
    pub(super) active: Mask8,
    /// Those that must be walked in double precision.
    pub(crate) refused: Mask8,
    size: [i32; 3],
}

/// How eight cells were entered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Faces {
    /// Distances.
    pub(crate) t: F64x8,
    pub(crate) cell: [I32x8; 3],
    /// See [`Walk::cell_before`].
    pub(crate) before: [I32x8; 3],
    /// See [`Walk::face`].
    pub(crate) face: I32x8,
    /// The axis, 3 where the walk began in the cell.
    pub(crate) entered: I32x8,
    /// See [`Walk::rank`].
    pub(crate) rank: I32x8,
    /// See [`Walk::point`].
    pub(crate) point: DVec3x8,
}

/// Where the walks came to, a bit for each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Hits {
    /// Which of them met a marked cell.
    pub(crate) marked: u32,
    /// Which passed cells before it that are not marked.
    pub(crate) passed_empty: u32,
}

impl Packet {
    /// Walks that go nowhere.
    pub(crate) const NOWHERE: Self = Self {
        base: [[0; LANES]; 3],
        origin: [[0.0; LANES]; 3],
        direction: [[0.0; LANES]; 3],
        inverse: [[0.0; LANES]; 3],
        fuzz: [[0.0; LANES]; 3],
        slack: [0.0; LANES],
        flip: [[0; LANES]; 3],
        end: [[0; LANES]; 3],
        cell: [[0; LANES]; 3],
        entered: [0; LANES],
        to: [0.0; LANES],
        begun: F64x8::ZERO,
        active: Mask8::NONE,
        refused: Mask8::NONE,
        size: [0; 3],
    };

    /// Tells whether rays can be walked so.
    pub(crate) fn can(layer: &Layer) -> bool {
        layer.size.iter().all(|&edge| edge <= LONGEST) && layer.masks.are_counted()
    }

    /// Begins in cells that are known to be those at the origins of rays, see [`Walk::begin_in`]; or at stretches of
    /// rays, or later where they enter the grid, see [`Walk::begin`].
    #[inline(always)]
    pub(crate) fn begin(
        rays: &GridRays,
        size: [i32; 3],
        known: Option<[I32x8; 3]>,
        stretch: &Stretch,
    ) -> Self {
        let late = stretch.from.above(F64x8::ZERO);
        let mut place = Place {
            cell: [I32x8::splat(0); 3],
            entered: I32x8::splat(3),
            begun: F64x8::pick(late, stretch.from, F64x8::ZERO),
            active: rays.there,
        };
        if let Some(cell) = known {
            for (a, &edge) in size.iter().enumerate() {
                place.active = place.active & !cell[a].is_negative() & cell[a].below(I32x8::splat(edge));
                place.cell[a] = cell[a] ^ rays.flip[a];
            }
        } else if let Some(cell) = rays.cells_within(size, place.begun) {
            place.cell = cell;
        } else {
            place.enter(rays, size, late);
        }
        Self::at(rays, size, &place, stretch.to)
    }

    #[inline(always)]
    fn at(
        rays: &GridRays,
        size: [i32; 3],
        &Place { cell, entered, begun, mut active }: &Place,
        to: F64x8,
    ) -> Self {
        // Distances are counted in steps along the axis of the longest part: no number is then too large or small.
        let [x, y, z] = rays.direction;
        let longest = x.max(y).max(z);
        let unit = F64x8::splat(1.0) / longest;
        let edge = f64::from(size[0].max(size[1]).max(size[2])) + 1.0;
        let mut far = F64x8::ZERO;
        let flip = rays.flip.map(|f| f.0.values());
        let mut packet = Self { flip, entered: entered.0.values(), begun, size, ..Self::NOWHERE };
        for a in 0..3 {
            far = far.max(rays.origin[a].abs());
        }
        // What double precision lost on the way counts, too; from very far away it is too much.
        let doubt = F64x8::splat(DOUBT * edge) + far * F64x8::splat(1e-15);
        packet.refused = active & !F64x8::splat(FARTHEST).above(far);
        active = active & !packet.refused;
        for a in 0..3 {
            let ends = I32x8::pick(rays.flip[a].is_negative(), I32x8::splat(0), I32x8::splat(size[a]));
            packet.end[a] = ends.0.values();
            let origin = rays.origin[a] + rays.direction[a] * begun;
            // Within the cell, so that no number is larger than the grid.
            let origin = (origin - cell[a].to_f64()).max(F64x8::ZERO).min(F64x8::splat(1.0));
            let direction = rays.direction[a] * unit;
            packet.direction[a] = direction.round().0.values();
            let still = F64x8::splat(1e-30).above(direction);
            let inverse = F64x8::pick(still, F64x8::splat(f64::INFINITY), rays.inverse[a] * longest);
            packet.inverse[a] = inverse.round().0.values();
            packet.fuzz[a] = (inverse * doubt).round().0.values();
            // All planes of what stands still lie at infinity.
            packet.origin[a] = F64x8::pick(still, F64x8::splat(-1.0), origin).round().0.values();
            // Those that go nowhere are looked up, too: in the first cell.
            packet.cell[a] = I32x8::pick(active, cell[a], rays.flip[a]).0.values();
            packet.base[a] = packet.cell[a];
        }
        packet.slack = doubt.round().0.values();
        let to = (to - begun) * longest;
        packet.to = (to + doubt + doubt + to.abs() * F64x8::splat(1e-6)).round().0.values();
        packet.active = active;
        packet
    }

    /// Tells which walks are in the cell that they began in.
    pub(crate) fn begun_in(&self) -> Mask8 {
        I32x8::new(self.entered).equal(I32x8::splat(3))
    }

    /// Returns how the cells at hand were entered, in double precision.
    #[inline(always)]
    pub(crate) fn faces(&self, rays: &GridRays) -> Faces {
        let mirrored = [I32x8::new(self.cell[0]), I32x8::new(self.cell[1]), I32x8::new(self.cell[2])];
        let entered = I32x8::new(self.entered);
        let (one, zero) = (I32x8::splat(1), I32x8::splat(0));
        let by = [0, 1, 2].map(|a| entered.equal(I32x8::splat(a)));
        let planes = [rays.plane(0, mirrored[0]), rays.plane(1, mirrored[1]), rays.plane(2, mirrored[2])];
        let t = F64x8::pick(by[1], planes[1], F64x8::pick(by[2], planes[2], self.begun));
        let t = F64x8::pick(by[0], planes[0], t).max(F64x8::ZERO);
        let [x, y, z] = rays.direction;
        let longest = I32x8::pick(y.at_least(z), one, I32x8::splat(2));
        let longest = I32x8::pick(x.at_least(y) & x.at_least(z), zero, longest);
        let axis = I32x8::pick(entered.equal(I32x8::splat(3)), longest, entered);
        let mut faces = Faces {
            t,
            cell: mirrored,
            before: mirrored,
            face: zero,
            entered,
            rank: zero,
            point: DVec3x8 { x: F64x8::ZERO, y: F64x8::ZERO, z: F64x8::ZERO },
        };
        let mut point = [F64x8::ZERO; 3];
        for a in 0..3 {
            let flip = rays.flip[a];
            let descends = flip.is_negative();
            faces.cell[a] = mirrored[a] ^ flip;
            faces.before[a] = (mirrored[a] - I32x8::pick(by[a], one, zero)) ^ flip;
            let is_axis = axis.equal(I32x8::splat(a as i32));
            let face = I32x8::splat(2 * a as i32) + I32x8::pick(descends, one, zero);
            faces.face = I32x8::pick(is_axis, face, faces.face);
            // Planes from the corner at which a ray of this direction enters.
            let low = I32x8::pick(descends, I32x8::splat(self.size[a]), zero);
            faces.rank = faces.rank + mirrored[a] + low;
            let step = rays.direction[a] * t;
            let along = F64x8::pick(descends, rays.place[a] - step, rays.place[a] + step);
            let from = faces.cell[a].to_f64();
            let upper = F64x8::pick(descends, from + F64x8::splat(1.0), from);
            let within = along.max(from).min(from + F64x8::splat(1.0));
            point[a] = F64x8::pick(by[a], upper, within);
        }
        let [x, y, z] = point;
        faces.point = DVec3x8 { x, y, z };
        faces
    }
}
