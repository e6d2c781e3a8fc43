//! How are eight numbers reckoned at once? As arrays: the compiler turns each operation into the widest registers that
//! a kernel may use, and into the same bytes whatever their width.
//!
//! A kernel is written once over these types, compiled for the plain processor and for its extensions, and chosen at
//! run time: see [`registers`](crate::registers).
//! Fixed arrays alone would not do: the compiler unrolls a long loop body over eight numbers before it looks for
//! vectors in it.

mod held;
mod vectors;

pub use held::Held;
use held::{Doubles, Singles, Words};
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Sub};
pub use vectors::{DVec3x8, Vec3x8};

/// Makes eight of something, lane by lane. A plain loop: closures may stay calls in builds that do not optimize
/// across them.
macro_rules! lanes {
    ($zero:expr, $i:ident => $value:expr) => {{
        let mut all = [$zero; LANES];
        for $i in 0..LANES {
            all[$i] = $value;
        }
        all
    }};
}

/// How many numbers there are at once.
pub const LANES: usize = 8;

/// Eight numbers in single precision.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct F32x8(pub Held<Singles, f32>);

/// Eight numbers in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct F64x8(pub Held<Doubles, f64>);

/// Eight whole numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct I32x8(pub Held<Words, i32>);

/// Eight truth values: all bits set, or none.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct Mask8(pub Held<Words, u32>);

macro_rules! numbers {
    ($lanes:ident, $number:ty: $($trait:ident $method:ident $op:tt),*) => {
        impl $lanes {
            /// Repeats a number.
            #[must_use]
            #[inline(always)]
            pub fn splat(value: $number) -> Self {
                Self::new([value; LANES])
            }

            /// Reads the first eight numbers of a slice.
            ///
            /// # Panics
            /// When there are less.
            #[must_use]
            #[inline(always)]
            pub fn load(from: &[$number]) -> Self {
                let from: &[$number; LANES] = from[..LANES].try_into().expect("a slice of eight");
                Self::new(*from)
            }

            /// Writes them over the first eight numbers of a slice.
            ///
            /// # Panics
            /// When there are less.
            #[inline(always)]
            pub fn store(self, to: &mut [$number]) {
                to[..LANES].copy_from_slice(&*self.0);
            }
        }
        $(impl $trait for $lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let (a, b) = (self.0.values(), other.0.values());
                Self::new(lanes!(0 as $number, i => a[i] $op b[i]))
            }
        })*
    };
}
numbers!(F32x8, f32: Add add +, Sub sub -, Mul mul *, Div div /);
numbers!(F64x8, f64: Add add +, Sub sub -, Mul mul *, Div div /);
numbers!(I32x8, i32: Add add +, Sub sub -, Mul mul *, BitOr bitor |, BitAnd bitand &, BitXor bitxor ^);

impl F32x8 {
    /// Zeros.
    pub const ZERO: Self = Self::new([0.0; LANES]);

    /// Takes eight small whole numbers.
    #[must_use]
    #[inline(always)]
    pub fn from_u16(values: [u16; LANES]) -> Self {
        Self::new(lanes!(0.0, i => f32::from(values[i])))
    }

    /// Widens to double precision.
    #[must_use]
    #[inline(always)]
    pub fn to_f64(self) -> F64x8 {
        let a = self.0.values();
        F64x8::new(lanes!(0.0, i => f64::from(a[i])))
    }

    /// Returns the smaller ones; the other where one is not a number.
    #[must_use]
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        let (a, b) = (self.0.values(), other.0.values());
        Self::new(lanes!(0.0, i => if a[i] < b[i] { a[i] } else { b[i] }))
    }

    /// Returns the larger ones; the other where one is not a number.
    #[must_use]
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        let (a, b) = (self.0.values(), other.0.values());
        Self::new(lanes!(0.0, i => if a[i] > b[i] { a[i] } else { b[i] }))
    }

    /// Returns the square roots.
    #[must_use]
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        let a = self.0.values();
        Self::new(lanes!(0.0, i => a[i].sqrt()))
    }

    /// Returns them without sign.
    #[must_use]
    #[inline(always)]
    pub fn abs(self) -> Self {
        let a = self.0.values();
        Self::new(lanes!(0.0, i => a[i].abs()))
    }

    /// Tells which are greater.
    #[must_use]
    #[inline(always)]
    pub fn above(self, other: Self) -> Mask8 {
        let (a, b) = (self.0.values(), other.0.values());
        Mask8::new(lanes!(0_u32, i => if a[i] > b[i] { u32::MAX } else { 0 }))
    }

    /// Tells which are greater or equal.
    #[must_use]
    #[inline(always)]
    pub fn at_least(self, other: Self) -> Mask8 {
        let (a, b) = (self.0.values(), other.0.values());
        Mask8::new(lanes!(0_u32, i => if a[i] >= b[i] { u32::MAX } else { 0 }))
    }

    /// Tells which are equal.
    #[must_use]
    #[inline(always)]
    pub fn equal(self, other: Self) -> Mask8 {
        let (a, b) = (self.0.values(), other.0.values());
        Mask8::new(lanes!(0_u32, i => if a[i] == b[i] { u32::MAX } else { 0 }))
    }

    /// Rounds numbers less than 2^22 from zero to the nearest whole ones, of two equally near to the even one.
    #[must_use]
    #[inline(always)]
    pub fn nearest(self) -> I32x8 {
        let a = self.0.values();
        // Adding 1.5 * 2^23 leaves whole numbers in the low bits, above what the sum's exponent says.
        const SHIFT: f32 = 12_582_912.0;
        I32x8::new(lanes!(0, i => (a[i] + SHIFT).to_bits() as i32 - SHIFT.to_bits() as i32))
    }

    /// Rounds numbers less than 2^22 from zero down to whole ones.
    #[must_use]
    #[inline(always)]
    pub fn nearest_below(self) -> I32x8 {
        self.floor().nearest()
    }

    /// Returns the whole numbers below.
    #[must_use]
    #[inline(always)]
    pub fn floor(self) -> Self {
        let a = self.0.values();
        Self::new(lanes!(0.0, i => a[i].floor()))
    }

    /// Returns the bits of each.
    #[must_use]
    #[inline(always)]
    pub fn to_bits(self) -> I32x8 {
        let a = self.0.values();
        I32x8::new(lanes!(0, i => a[i].to_bits() as i32))
    }

    /// Returns the numbers of these bits.
    #[must_use]
    #[inline(always)]
    pub fn from_bits(bits: I32x8) -> Self {
        let bits = bits.0.values();
        Self::new(lanes!(0.0, i => f32::from_bits(bits[i] as u32)))
    }

    /// Puts zero in place of what is not finite.
    #[must_use]
    #[inline(always)]
    pub fn finite(self) -> Self {
        Self::splat(f32::INFINITY).above(self.abs()).pick(self, Self::splat(0.0))
    }
}

impl Neg for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let a = self.0.values();
        Self::new(lanes!(0.0, i => -a[i]))
    }
}

impl Neg for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let a = self.0.values();
        Self::new(lanes!(0.0, i => -a[i]))
    }
}

impl F64x8 {
    /// Zeros.
    pub const ZERO: Self = Self::new([0.0; LANES]);

    /// Returns the smaller ones; the other where one is not a number.
    #[must_use]
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        let (a, b) = (self.0.values(), other.0.values());
        Self::new(lanes!(0.0, i => if a[i] < b[i] { a[i] } else { b[i] }))
    }

    /// Returns the larger ones; the other where one is not a number.
    #[must_use]
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        let (a, b) = (self.0.values(), other.0.values());
        Self::new(lanes!(0.0, i => if a[i] > b[i] { a[i] } else { b[i] }))
    }

    /// Returns them without sign.
    #[must_use]
    #[inline(always)]
    pub fn abs(self) -> Self {
        let a = self.0.values();
        Self::new(lanes!(0.0, i => a[i].abs()))
    }

    /// Tells which are greater.
    #[must_use]
    #[inline(always)]
    pub fn above(self, other: Self) -> Mask8 {
        let (a, b) = (self.0.values(), other.0.values());
        Mask8::new(lanes!(0_u32, i => if a[i] > b[i] { u32::MAX } else { 0 }))
    }

    /// Tells which are greater or equal.
    #[must_use]
    #[inline(always)]
    pub fn at_least(self, other: Self) -> Mask8 {
        let (a, b) = (self.0.values(), other.0.values());
        Mask8::new(lanes!(0_u32, i => if a[i] >= b[i] { u32::MAX } else { 0 }))
    }

    /// Tells which are equal.
    #[must_use]
    #[inline(always)]
    pub fn equal(self, other: Self) -> Mask8 {
        let (a, b) = (self.0.values(), other.0.values());
        Mask8::new(lanes!(0_u32, i => if a[i] == b[i] { u32::MAX } else { 0 }))
    }

    /// Takes `yes` where the mask is set, else `no`.
    #[must_use]
    #[inline(always)]
    pub fn pick(mask: Mask8, yes: Self, no: Self) -> Self {
        let (mask, yes, no) = (mask.0.values(), yes.0.values(), no.0.values());
        let wide = |i: usize| i64::from(mask[i] as i32) as u64;
        Self::new(lanes!(0.0, i =>
            f64::from_bits((yes[i].to_bits() & wide(i)) | (no[i].to_bits() & !wide(i)))))
    }

    /// Returns the square roots.
    #[must_use]
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        let a = self.0.values();
        Self::new(lanes!(0.0, i => a[i].sqrt()))
    }

    /// Rounds numbers less than 2^31 from zero to the nearest whole ones, of two equally near to the even one.
    #[must_use]
    #[inline(always)]
    pub fn nearest(self) -> I32x8 {
        let a = self.0.values();
        // Adding 1.5 * 2^52 leaves whole numbers in the low bits. A cast would saturate, which is done one by one.
        I32x8::new(lanes!(0, i => (a[i] + 6_755_399_441_055_744.0).to_bits() as i32))
    }

    /// Rounds numbers less than 2^31 from zero down to whole ones.
    #[must_use]
    #[inline(always)]
    pub fn nearest_below(self) -> I32x8 {
        let a = self.0.values();
        F64x8::new(lanes!(0.0, i => a[i].floor())).nearest()
    }

    /// Rounds to single precision.
    #[must_use]
    #[inline(always)]
    pub fn round(self) -> F32x8 {
        let a = self.0.values();
        F32x8::new(lanes!(0.0, i => a[i] as f32))
    }
}

impl I32x8 {
    /// Counts from a number up.
    #[must_use]
    #[inline(always)]
    pub fn count_from(first: i32) -> Self {
        Self::splat(first) + Self::new([0, 1, 2, 3, 4, 5, 6, 7])
    }

    /// Tells which are negative.
    #[must_use]
    #[inline(always)]
    pub fn is_negative(self) -> Mask8 {
        let a = self.0.values();
        Mask8::new(lanes!(0_u32, i => (a[i] >> 31) as u32))
    }

    /// Tells which are neither negative nor as large as a length.
    #[must_use]
    #[inline(always)]
    pub fn is_index_below(self, length: u32) -> Mask8 {
        let a = self.0.values();
        Mask8::new(lanes!(0_u32, i => if (a[i] as u32) < length { u32::MAX } else { 0 }))
    }

    /// Turns them into numbers in double precision.
    #[must_use]
    #[inline(always)]
    pub fn to_f64(self) -> F64x8 {
        let a = self.0.values();
        F64x8::new(lanes!(0.0, i => f64::from(a[i])))
    }

    /// Turns them into numbers in single precision; what lies beyond 2^24 is rounded.
    #[must_use]
    #[inline(always)]
    pub fn to_f32(self) -> F32x8 {
        let a = self.0.values();
        F32x8::new(lanes!(0.0, i => a[i] as f32))
    }

    /// Shifts bits up; only the five lowest bits of the count matter.
    #[must_use]
    #[inline(always)]
    pub fn up(self, by: Self) -> Self {
        let (a, by) = (self.0.values(), by.0.values());
        Self::new(lanes!(0, i => a[i].wrapping_shl(by[i] as u32)))
    }

    /// Shifts bits down and zeros in; only the five lowest bits of the count matter.
    #[must_use]
    #[inline(always)]
    pub fn down(self, by: Self) -> Self {
        let (a, by) = (self.0.values(), by.0.values());
        Self::new(lanes!(0, i => (a[i] as u32).wrapping_shr(by[i] as u32) as i32))
    }

    /// Returns the smaller ones.
    #[must_use]
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        let (a, b) = (self.0.values(), other.0.values());
        Self::new(lanes!(0, i => if a[i] < b[i] { a[i] } else { b[i] }))
    }

    /// Returns the larger ones.
    #[must_use]
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        let (a, b) = (self.0.values(), other.0.values());
        Self::new(lanes!(0, i => if a[i] > b[i] { a[i] } else { b[i] }))
    }

    /// Tells which are less.
    #[must_use]
    #[inline(always)]
    pub fn below(self, other: Self) -> Mask8 {
        let (a, b) = (self.0.values(), other.0.values());
        Mask8::new(lanes!(0_u32, i => if a[i] < b[i] { u32::MAX } else { 0 }))
    }

    /// Tells which are equal.
    #[must_use]
    #[inline(always)]
    pub fn equal(self, other: Self) -> Mask8 {
        let (a, b) = (self.0.values(), other.0.values());
        Mask8::new(lanes!(0_u32, i => if a[i] == b[i] { u32::MAX } else { 0 }))
    }

    /// Takes `yes` where the mask is set, else `no`.
    #[must_use]
    #[inline(always)]
    pub fn pick(mask: Mask8, yes: Self, no: Self) -> Self {
        let (mask, yes, no) = (mask.0.values(), yes.0.values(), no.0.values());
        Self::new(lanes!(0, i => (yes[i] & mask[i] as i32) | (no[i] & !(mask[i] as i32))))
    }
}

impl Mask8 {
    /// None.
    pub const NONE: Self = Self::new([0; LANES]);

    /// All.
    pub const ALL: Self = Self::new([u32::MAX; LANES]);

    /// Sets the first ones, as many as asked.
    #[must_use]
    #[inline(always)]
    pub fn first(count: usize) -> Self {
        Self::new(lanes!(0_u32, i => if i < count { u32::MAX } else { 0 }))
    }

    /// Counts those that are set.
    #[must_use]
    #[inline(always)]
    pub fn count(self) -> u32 {
        self.0.iter().map(|&m| m & 1).sum()
    }

    /// Reads eight words as they are.
    ///
    /// # Panics
    /// When there are less.
    #[must_use]
    #[inline(always)]
    pub fn load(from: &[u32]) -> Self {
        let from: &[u32; LANES] = from[..LANES].try_into().expect("a slice of eight");
        Self::new(*from)
    }

    /// Tells whether there is one.
    #[must_use]
    #[inline(always)]
    pub fn any(self) -> bool {
        let [a, b, c, d, e, f, g, h] = self.0.values();
        a | b | c | d | e | f | g | h != 0
    }

    /// Tells whether one of them is set.
    #[must_use]
    #[inline(always)]
    pub fn has(self, lane: usize) -> bool {
        self.0[lane] != 0
    }

    /// Takes `yes` where it is set, else `no`.
    #[must_use]
    #[inline(always)]
    pub fn pick(self, yes: F32x8, no: F32x8) -> F32x8 {
        let (yes, no) = (yes.0.values(), no.0.values());
        let yes = Self::new(lanes!(0_u32, i => yes[i].to_bits()));
        let no = Self::new(lanes!(0_u32, i => no[i].to_bits()));
        let bits = self.pick_bits(yes, no).0.values();
        F32x8::new(lanes!(0.0, i => f32::from_bits(bits[i])))
    }

    /// Takes the bits of `yes` where it is set, else those of `no`.
    #[must_use]
    #[inline(always)]
    pub fn pick_bits(self, yes: Self, no: Self) -> Self {
        let (mask, yes, no) = (self.0.values(), yes.0.values(), no.0.values());
        Self::new(lanes!(0_u32, i => (yes[i] & mask[i]) | (no[i] & !mask[i])))
    }
}

impl BitAnd for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        let (a, b) = (self.0.values(), other.0.values());
        Self::new(lanes!(0_u32, i => a[i] & b[i]))
    }
}

impl BitOr for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        let (a, b) = (self.0.values(), other.0.values());
        Self::new(lanes!(0_u32, i => a[i] | b[i]))
    }
}

impl Not for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        let a = self.0.values();
        Self::new(lanes!(0_u32, i => !a[i]))
    }
}

macro_rules! constructors {
    ($($lanes:ident $number:ty),*) => {$(
        impl $lanes {
            /// Takes eight values.
            #[must_use]
            #[inline(always)]
            pub const fn new(values: [$number; LANES]) -> Self {
                Self(Held::new(values))
            }
        }
    )*};
}
constructors!(F32x8 f32, F64x8 f64, I32x8 i32, Mask8 u32);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_reckoned_apart() {
        let a = F32x8::new([1.0, -2.0, 3.5, 0.0, f32::NAN, 1e30, -0.0, 8.0]);
        let b = F32x8::splat(2.0);
        assert_eq!((a * b + b).0[..4], [4.0, -2.0, 9.0, 2.0]);
        assert_eq!(a.above(b).0, [0, 0, u32::MAX, 0, 0, u32::MAX, 0, u32::MAX]);
        assert_eq!(a.above(b).pick(a, b).0, [2.0, 2.0, 3.5, 2.0, 2.0, 1e30, 2.0, 8.0]);
        assert_eq!(a.finite().0[4], 0.0);
        assert_eq!(a.finite().0[5], 1e30);
        assert!(a.above(b).any() && !(a.above(b) & Mask8::NONE).any());
        let count = I32x8::count_from(-3);
        assert_eq!((!count.is_negative()).0, [0, 0, 0, u32::MAX, u32::MAX, u32::MAX, u32::MAX, u32::MAX]);
        assert_eq!(count.to_f64().round().0[7], 4.0);
        let wide = F32x8::new([1.0, -2.0, 3.5, 0.0, f32::NAN, 1e30, -0.0, 8.0]).to_f64();
        let two = F64x8::splat(2.0);
        assert_eq!(wide.above(two).0, a.above(b).0);
        assert_eq!(F64x8::pick(wide.above(two), wide, two).round(), a.above(b).pick(a, b));
        assert_eq!(wide.min(two).max(-two).0, [1.0, -2.0, 2.0, 0.0, 2.0, 2.0, 0.0, 2.0]);
        assert_eq!((Mask8::first(3).count(), Mask8::ALL.count()), (3, 8));
        let halves = F64x8::new([0.5, -0.5, 1.5, 2.4, -2.6, 1e9, -1e9, 0.0]);
        assert_eq!(halves.nearest().0, [0, 0, 2, 2, -3, 1_000_000_000, -1_000_000_000, 0]);
        let single = F32x8::new([0.5, -0.5, 1.5, 2.4, -2.6, 4e6, -4e6, 0.0]);
        assert_eq!(single.nearest().0, [0, 0, 2, 2, -3, 4_000_000, -4_000_000, 0]);
        assert_eq!(single.floor().0, [0.0, -1.0, 1.0, 2.0, -3.0, 4e6, -4e6, 0.0]);
        assert_eq!(F32x8::from_bits(single.to_bits()), single);
        assert_eq!(single.nearest_below().0, [0, -1, 1, 2, -3, 4_000_000, -4_000_000, 0]);
        let (low, high) = (I32x8::splat(-3), I32x8::count_from(-5));
        assert_eq!(high.max(low).min(I32x8::splat(0)).0, [-3, -3, -3, -2, -1, 0, 0, 0]);
        assert_eq!(I32x8::pick(high.below(low) | high.equal(low), low, high), high.max(low));
        assert_eq!((I32x8::splat(5).up(I32x8::count_from(0)) ^ I32x8::splat(1)).0[..3], [4, 11, 21]);
        assert_eq!(I32x8::splat(-1).down(I32x8::count_from(28)).0[..4], [15, 7, 3, 1]);
        assert_eq!(count.to_f32().0[0], -3.0);
        let turn = glam::DMat3::from_rotation_z(0.3);
        let turned = DVec3x8::splat(glam::DVec3::new(1.0, 2.0, 3.0)).turned(&turn);
        assert_eq!(turned.get(5), turn * glam::DVec3::new(1.0, 2.0, 3.0));
        let (a, b) = (glam::DVec3::new(1.0, 2.0, 3.0), glam::DVec3::new(-4.0, 0.5, 7.0));
        assert_eq!(DVec3x8::splat(a).cross(DVec3x8::splat(b)).get(2), a.cross(b));
        let v = Vec3x8::splat(glam::Vec3::new(2.0, 3.0, 6.0));
        assert_eq!(v.to_f64().get(7), glam::DVec3::new(2.0, 3.0, 6.0));
        assert_eq!(v.length(), F32x8::splat(7.0));
    }
}
