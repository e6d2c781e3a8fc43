//! The walk in fixed-point numbers: 32 bits before the point and 32 behind it.
//!
//! A ray begins anew where its walk is, with the longest part of its direction as 1, so that no number is larger than
//! the grid. Crossings have the order of [`super::Walk`], in the numbers at hand: what is rounded is the ray, by 2^-32
//! of a cell and 2^-32 of its slope, and its distances. Rays closer to an edge than that may see the neighbor of their
//! cell. Axes along which a ray moves by less than 2^-31 of the longest stand still.

use super::{Found, GridRay, Walk};
use crate::grid::Layer;

/// Bits behind the point.
const POINT: u32 = 32;

/// A number in fixed point, `value / 2^32`; those that are too large are the largest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Fixed(i64);

impl Fixed {
    const MOST: Self = Self(i64::MAX);

    fn of(value: f64) -> Self {
        // A cast holds what is too large at the end of the range.
        Self((value * (1u64 << POINT) as f64).round_ties_even() as i64)
    }

    fn whole(value: i32) -> Self {
        Self(i64::from(value) << POINT)
    }

    fn times(self, other: Self) -> Self {
        let product = (i128::from(self.0) * i128::from(other.0)) >> POINT;
        Self(product.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64)
    }

    fn minus(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }

    fn plus(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }

    fn floor(self) -> i32 {
        (self.0 >> POINT) as i32
    }
}

/// A ray that begins where its walk is.
struct Course {
    origin: [Fixed; 3],
    direction: [Fixed; 3],
    inverse: [Fixed; 3],
}

impl Course {
    fn new(ray: &GridRay, cell: [i32; 3], t: f64) -> Self {
        let longest = ray.direction[ray.longest_axis()];
        let mut course = Self { origin: [Fixed(0); 3], direction: [Fixed(0); 3], inverse: [Fixed::MOST; 3] };
        for (a, &cell) in cell.iter().enumerate() {
            let from = f64::from(cell);
            course.origin[a] = Fixed::of((ray.origin[a] + ray.direction[a] * t).clamp(from, from + 1.0));
            course.direction[a] = Fixed::of(ray.direction[a] / longest);
            if course.direction[a].0 > 1 {
                course.inverse[a] = Fixed::of(longest / ray.direction[a]);
            } else {
                (course.origin[a], course.direction[a]) = (Fixed::whole(cell), Fixed(0));
            }
        }
        course
    }

    fn plane(&self, axis: usize, k: i32) -> Fixed {
        if self.direction[axis].0 == 0 {
            return Fixed::MOST;
        }
        Fixed::whole(k).minus(self.origin[axis]).times(self.inverse[axis])
    }

    /// Returns the cell along an axis, between two, after all planes before a crossing were crossed.
    fn cell_at(&self, axis: usize, from: i32, to: i32, (t, by): (Fixed, usize)) -> i32 {
        let is_before = |k: i32| (self.plane(axis, k), axis) < (t, by);
        let mut cell = self.origin[axis].plus(self.direction[axis].times(t)).floor().clamp(from, to);
        while cell < to && is_before(cell + 1) {
            cell += 1;
        }
        while cell > from && !is_before(cell) {
            cell -= 1;
        }
        cell
    }
}

/// Goes on to the first marked cell; see [`Walk::find_marked`].
pub(crate) fn find_marked(walk: &mut Walk, layer: &Layer, before: f64) -> Found {
    let course = Course::new(&walk.ray, walk.cell, walk.t);
    let mut passed_empty = false;
    loop {
        let Some(exponent) = layer.empty_around(walk.cell()) else {
            return Found::Marked { passed_empty };
        };
        passed_empty = true;
        walk.steps += 1;
        let mask = (1 << exponent) - 1;
        let last = walk.cell.map(|c| c | mask);
        let far = [0, 1, 2].map(|a| (course.plane(a, last[a] + 1), a));
        let (t, axis) = far[0].min(far[1]).min(far[2]);
        if t == Fixed::MOST {
            return Found::Nothing;
        }
        let cell = walk.cell;
        for a in (0..3).filter(|&a| a != axis) {
            walk.cell[a] = course.cell_at(a, cell[a], last[a], (t, axis));
        }
        walk.cell[axis] = last[axis] + 1;
        walk.entered = Some(axis);
        walk.t = walk.ray.plane(axis, last[axis] + 1).max(0.0);
        if !walk.is_inside() || walk.t > before {
            return Found::Nothing;
        }
    }
}
