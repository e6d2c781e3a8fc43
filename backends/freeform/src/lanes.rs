//! Eight numbers at once, in plain arrays: the compiler turns them into the widest registers that a kernel may
//! use, and into the same bytes whatever the width.

use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};

/// Fills eight lanes. A loop and no closure: a call that is not inlined would be made once for each lane.
macro_rules! lanes {
    ($zero:expr, $i:ident => $value:expr) => {{
        let mut out = [$zero; LANES];
        for ($i, lane) in out.iter_mut().enumerate() {
            *lane = $value;
        }
        out
    }};
}

/// How many rays a packet holds.
pub(crate) const LANES: usize = 8;

/// Eight numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes(pub(crate) [f32; LANES]);

/// Eight truth values, all bits set or none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mask(pub(crate) [u32; LANES]);

impl Lanes {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(crate) fn splat(value: f32) -> Self {
        Self([value; LANES])
    }
    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Self(lanes!(0.0, i => if self.0[i] < other.0[i] { self.0[i] } else { other.0[i] }))
    }
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self(lanes!(0.0, i => if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
    }
    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self(lanes!(0.0, i => self.0[i].abs()))
    }
    #[inline(always)]
    pub(crate) fn over(self, other: Self) -> Self {
        Self(lanes!(0.0, i => self.0[i] / other.0[i]))
    }
    #[inline(always)]
    pub(crate) fn above(self, other: Self) -> Mask {
        Mask(lanes!(0, i => if self.0[i] > other.0[i] { u32::MAX } else { 0 }))
    }
    #[inline(always)]
    pub(crate) fn at_least(self, other: Self) -> Mask {
        Mask(lanes!(0, i => if self.0[i] >= other.0[i] { u32::MAX } else { 0 }))
    }
}

impl Mask {
    pub(crate) const NONE: Self = Self([0; LANES]);

    #[inline(always)]
    pub(crate) fn any(self) -> bool {
        {
            let mut all = 0;
            for lane in self.0 {
                all |= lane;
            }
            all != 0
        }
    }
    #[inline(always)]
    pub(crate) fn has(self, lane: usize) -> bool {
        self.0[lane] != 0
    }
    /// Takes `yes` where the mask is set, else `no`.
    #[inline(always)]
    pub(crate) fn pick(self, yes: Lanes, no: Lanes) -> Lanes {
        Lanes(lanes!(0.0, i => {
            f32::from_bits((yes.0[i].to_bits() & self.0[i]) | (no.0[i].to_bits() & !self.0[i]))
        }))
    }
}

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(lanes!(0.0, i => self.0[i] $op other.0[i]))
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(lanes!(0.0, i => -self.0[i]))
    }
}

impl BitAnd for Mask {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(lanes!(0, i => self.0[i] & other.0[i]))
    }
}
impl BitOr for Mask {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(lanes!(0, i => self.0[i] | other.0[i]))
    }
}
impl Not for Mask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(lanes!(0, i => !self.0[i]))
    }
}
