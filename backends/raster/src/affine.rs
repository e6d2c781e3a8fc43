//! What is affine in a point, or in a place of the picture?

use crate::lens::Rays;
use glam::{DAffine3, DVec3};
use polyptych_core::lanes::{DVec3x8, F64x8};

/// An affine function of a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) slope: DVec3,
    pub(crate) offset: f64,
}

/// An affine function of a place in the picture, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Linear {
    pub(crate) base: DVec3,
    pub(crate) by_column: DVec3,
    pub(crate) by_row: DVec3,
}

/// A linear function of a point along the rays of a picture: the part that differs from ray to ray, affine in
/// column and row, and the part that all share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnRays {
    pub(crate) base: f64,
    pub(crate) by_column: f64,
    pub(crate) by_row: f64,
    pub(crate) shared: f64,
}

impl Row {
    #[inline(always)]
    pub(crate) fn at(&self, p: DVec3) -> f64 {
        self.slope.dot(p) + self.offset
    }

    #[inline(always)]
    pub(crate) fn at_all(&self, p: DVec3x8) -> F64x8 {
        DVec3x8::splat(self.slope).dot(p) + F64x8::splat(self.offset)
    }

    /// Applies the function to points that an affine map places first.
    pub(crate) fn after(&self, map: &DAffine3, origin: DVec3) -> Self {
        Self {
            slope: map.matrix3.transpose() * self.slope,
            offset: self.slope.dot(map.translation - origin) + self.offset,
        }
    }
}

impl Linear {
    #[inline(always)]
    pub(crate) fn at(&self, x: f64, y: f64) -> DVec3 {
        self.base + self.by_column * x + self.by_row * y
    }

    #[inline(always)]
    pub(crate) fn at_all(&self, x: F64x8, y: F64x8) -> DVec3x8 {
        let (right, down) = (DVec3x8::splat(self.by_column), DVec3x8::splat(self.by_row));
        DVec3x8::splat(self.base) + right.scaled(x) + down.scaled(y)
    }
}

impl OnRays {
    /// Returns the function's value at the start of a ray and its change over the ray's direction.
    #[inline(always)]
    pub(crate) fn at(&self, rays: Rays, x: f64, y: f64) -> (f64, f64) {
        let own = self.base + self.by_column * x + self.by_row * y;
        match rays {
            Rays::Central => (self.shared, own),
            Rays::Parallel => (own, self.shared),
        }
    }

    /// Returns by what it differs over one pixel to the right and one down, eight times.
    #[inline(always)]
    pub(crate) fn steps(&self) -> [F64x8; 2] {
        [F64x8::splat(self.by_column), F64x8::splat(self.by_row)]
    }

    /// The same for eight rays.
    #[inline(always)]
    pub(crate) fn at_all(&self, rays: Rays, x: F64x8, y: F64x8) -> (F64x8, F64x8) {
        let of = F64x8::splat;
        let (own, shared) = (of(self.base) + of(self.by_column) * x + of(self.by_row) * y, of(self.shared));
        match rays {
            Rays::Central => (shared, own),
            Rays::Parallel => (own, shared),
        }
    }
}
