//! Where are eight rays in a grid, and in which cells at some distances? In double precision, as [`super::GridRay`].

use super::GridRay;
use polyptych_core::lanes::{DVec3x8, F64x8, I32x8, LANES, Mask8};

/// Eight rays in the space of a grid; see [`GridRay`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct GridRays {
    pub(super) place: [F64x8; 3],
    pub(super) origin: [F64x8; 3],
    pub(super) direction: [F64x8; 3],
    pub(super) inverse: [F64x8; 3],
    pub(super) flip: [I32x8; 3],
    pub(super) still: [Mask8; 3],
    /// Those that go somewhere.
    pub(super) there: Mask8,
}

impl GridRays {
    /// Rays of which none is there.
    pub(crate) const NOWHERE: Self = Self {
        place: [F64x8::ZERO; 3],
        origin: [F64x8::ZERO; 3],
        direction: [F64x8::ZERO; 3],
        inverse: [F64x8::ZERO; 3],
        flip: [I32x8::new([0; LANES]); 3],
        still: [Mask8::ALL; 3],
        there: Mask8::NONE,
    };

    /// Makes rays ready; of those that go nowhere, or are not finite, none is there.
    #[inline(always)]
    pub(crate) fn new(origin: DVec3x8, direction: DVec3x8, there: Mask8) -> Self {
        let (zero, infinity) = (F64x8::ZERO, F64x8::splat(f64::INFINITY));
        let place = [origin.x, origin.y, origin.z];
        let given = [direction.x, direction.y, direction.z];
        let mut rays = Self {
            place,
            origin: [F64x8::splat(-1.0); 3],
            direction: [zero; 3],
            inverse: [infinity; 3],
            flip: [I32x8::splat(0); 3],
            still: [Mask8::ALL; 3],
            there,
        };
        let mut moves = Mask8::NONE;
        for a in 0..3 {
            let length = given[a].abs();
            let still = F64x8::splat(super::SLOWEST).above(length);
            let descends = zero.above(given[a]) & !still;
            rays.flip[a] = I32x8::pick(descends, I32x8::splat(-1), I32x8::splat(0));
            rays.still[a] = still;
            rays.origin[a] = F64x8::pick(still, rays.origin[a], F64x8::pick(descends, -place[a], place[a]));
            rays.direction[a] = F64x8::pick(still, zero, length);
            rays.inverse[a] = F64x8::pick(still, infinity, F64x8::splat(1.0) / length);
            rays.there = rays.there & infinity.above(length) & infinity.above(place[a].abs());
            moves = moves | !still;
        }
        rays.there = rays.there & moves;
        rays
    }

    #[inline(always)]
    pub(super) fn plane(&self, axis: usize, k: I32x8) -> F64x8 {
        (k.to_f64() - self.origin[axis]) * self.inverse[axis]
    }

    /// Returns the distance of a plane between cells as they are, not mirrored.
    #[inline(always)]
    pub(crate) fn plane_of(&self, axis: usize, k: i32) -> F64x8 {
        let ascends = I32x8::splat(k);
        self.plane(axis, I32x8::pick(self.flip[axis].is_negative(), I32x8::splat(-k), ascends))
    }

    /// Returns one of them.
    #[inline(always)]
    pub(crate) fn one(&self, lane: usize) -> GridRay {
        let of = |v: &[F64x8; 3]| [v[0].0[lane], v[1].0[lane], v[2].0[lane]];
        GridRay {
            place: of(&self.place),
            origin: of(&self.origin),
            direction: of(&self.direction),
            inverse: of(&self.inverse),
            flip: [self.flip[0].0[lane], self.flip[1].0[lane], self.flip[2].0[lane]],
        }
    }
}

impl GridRays {
    /// Returns the cells along an axis, between two, after all planes before a moment were crossed; see
    /// [`GridRay::cell_at`].
    #[inline(always)]
    pub(super) fn cell_at(
        &self,
        a: usize,
        from: I32x8,
        to: I32x8,
        t: F64x8,
        axis: I32x8,
        active: Mask8,
    ) -> I32x8 {
        let step = self.direction[a] * t;
        let place = self.origin[a] + step;
        let mut cell = (place - F64x8::splat(0.5)).nearest().max(from).min(to);
        let (within, one) = (place - cell.to_f64(), F64x8::splat(1.0));
        let slack = (self.origin[a].abs() + step + one) * F64x8::splat(super::ROUNDING);
        let reached = within.above(slack) | cell.equal(from);
        let inside = (one - slack).above(within) | cell.equal(to);
        let unsure = active & !(reached & inside);
        if unsure.any() {
            self.correct(a, &mut cell, [from, to], (t, axis), unsure);
        }
        cell
    }

    /// Returns the cells at some distances, if all of them are beyond doubt and within the grid.
    #[inline(always)]
    pub(super) fn cells_within(&self, size: [i32; 3], t: F64x8) -> Option<[I32x8; 3]> {
        let mut cells = [I32x8::splat(0); 3];
        let (mut sure, one) = (Mask8::ALL, F64x8::splat(1.0));
        for (a, &edge) in size.iter().enumerate() {
            let step = self.direction[a] * t;
            let place = self.origin[a] + step;
            let cell = (place - F64x8::splat(0.5)).nearest();
            let within = place - cell.to_f64();
            let slack = (self.origin[a].abs() + step + one) * F64x8::splat(super::ROUNDING);
            let given = cell ^ self.flip[a];
            let inside = !given.is_negative() & given.below(I32x8::splat(edge));
            sure = sure & within.above(slack) & (one - slack).above(within) & inside & !self.still[a];
            cells[a] = cell;
        }
        (!(self.there & !sure).any()).then_some(cells)
    }

    #[cold]
    #[inline(never)]
    fn correct(
        &self,
        a: usize,
        cell: &mut I32x8,
        [from, to]: [I32x8; 2],
        moment: (F64x8, I32x8),
        unsure: Mask8,
    ) {
        for i in (0..LANES).filter(|&i| unsure.has(i)) {
            let moment = super::Moment { t: moment.0.0[i], axis: moment.1.0[i] as usize };
            cell.0[i] = self.one(i).correct(a, cell.0[i], from.0[i], to.0[i], moment);
        }
    }
}
