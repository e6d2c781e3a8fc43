//! Eight vectors at once, an axis after the other.

use super::{F32x8, F64x8, Mask8};
use std::ops::{Add, Mul, Sub};

/// Eight vectors, or colors.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the axes")]
pub struct Vec3x8 {
    pub x: F32x8,
    pub y: F32x8,
    pub z: F32x8,
}

/// Eight vectors in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the axes")]
pub struct DVec3x8 {
    pub x: F64x8,
    pub y: F64x8,
    pub z: F64x8,
}

macro_rules! vectors {
    ($vectors:ident, $lanes:ident, $one:ty) => {
        impl $vectors {
            /// Repeats a vector.
            #[must_use]
            #[inline(always)]
            pub fn splat(v: $one) -> Self {
                Self { x: $lanes::splat(v.x), y: $lanes::splat(v.y), z: $lanes::splat(v.z) }
            }

            /// Returns one of them.
            #[must_use]
            #[inline(always)]
            pub fn get(&self, lane: usize) -> $one {
                <$one>::new(self.x.0[lane], self.y.0[lane], self.z.0[lane])
            }

            /// Sets one of them.
            #[inline(always)]
            pub fn set(&mut self, lane: usize, v: $one) {
                (self.x.0[lane], self.y.0[lane], self.z.0[lane]) = (v.x, v.y, v.z);
            }

            /// Returns the inner products.
            #[must_use]
            #[inline(always)]
            pub fn dot(self, other: Self) -> $lanes {
                self.x * other.x + self.y * other.y + self.z * other.z
            }

            /// Returns the lengths.
            #[must_use]
            #[inline(always)]
            pub fn length(self) -> $lanes {
                self.dot(self).sqrt()
            }

            /// Multiplies each by its number.
            #[must_use]
            #[inline(always)]
            pub fn scaled(self, by: $lanes) -> Self {
                Self { x: self.x * by, y: self.y * by, z: self.z * by }
            }
        }

        impl Add for $vectors {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
            }
        }

        impl Sub for $vectors {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
            }
        }

        impl Mul for $vectors {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                Self { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
            }
        }
    };
}
vectors!(Vec3x8, F32x8, glam::Vec3);
vectors!(DVec3x8, F64x8, glam::DVec3);

impl Vec3x8 {
    /// Takes `yes` where the mask is set, else `no`.
    #[must_use]
    #[inline(always)]
    pub fn pick(mask: Mask8, yes: Self, no: Self) -> Self {
        Self { x: mask.pick(yes.x, no.x), y: mask.pick(yes.y, no.y), z: mask.pick(yes.z, no.z) }
    }

    /// Puts zero in place of components that are not finite.
    #[must_use]
    #[inline(always)]
    pub fn finite(self) -> Self {
        Self { x: self.x.finite(), y: self.y.finite(), z: self.z.finite() }
    }
}

impl Vec3x8 {
    /// Widens to double precision.
    #[must_use]
    #[inline(always)]
    pub fn to_f64(self) -> DVec3x8 {
        DVec3x8 { x: self.x.to_f64(), y: self.y.to_f64(), z: self.z.to_f64() }
    }
}

impl DVec3x8 {
    /// Takes `yes` where the mask is set, else `no`.
    #[must_use]
    #[inline(always)]
    pub fn pick(mask: Mask8, yes: Self, no: Self) -> Self {
        Self {
            x: F64x8::pick(mask, yes.x, no.x),
            y: F64x8::pick(mask, yes.y, no.y),
            z: F64x8::pick(mask, yes.z, no.z),
        }
    }

    /// Returns the cross products.
    #[must_use]
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    /// Multiplies each as a vector by a matrix.
    #[must_use]
    #[inline(always)]
    pub fn turned(self, by: &glam::DMat3) -> Self {
        Self::splat(by.x_axis).scaled(self.x)
            + Self::splat(by.y_axis).scaled(self.y)
            + Self::splat(by.z_axis).scaled(self.z)
    }

    /// Rounds to single precision.
    #[must_use]
    #[inline(always)]
    pub fn round(self) -> Vec3x8 {
        Vec3x8 { x: self.x.round(), y: self.y.round(), z: self.z.round() }
    }
}
