//! How do eight numbers lie while nothing is reckoned with them?
//!
//! As what the processor's registers hold. The compiler would take an array apart into eight numbers, put these
//! together to reckon, and take them apart again at every branch that it meets on the way.

use bytemuck::{Pod, must_cast, must_cast_mut, must_cast_ref};
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

#[cfg(target_arch = "x86_64")]
mod register {
    pub(crate) type Singles = std::arch::x86_64::__m256;
    pub(crate) type Doubles = std::arch::x86_64::__m512d;
    pub(crate) type Words = std::arch::x86_64::__m256i;
}
#[cfg(not(target_arch = "x86_64"))]
mod register {
    pub(crate) type Singles = [f32; super::LANES];
    pub(crate) type Doubles = [f64; super::LANES];
    pub(crate) type Words = [u32; super::LANES];
}
pub(crate) use register::{Doubles, Singles, Words};

use super::LANES;

/// Eight values in a register, or in as many as they need: used as the array of them.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Held<R, T> {
    register: R,
    values: PhantomData<T>,
}

impl<R: Pod, T: Pod> Held<R, T> {
    /// Takes eight values.
    #[must_use]
    #[inline(always)]
    pub const fn new(values: [T; LANES]) -> Self {
        Self { register: must_cast(values), values: PhantomData }
    }

    /// Returns the eight values.
    #[must_use]
    #[inline(always)]
    pub const fn values(self) -> [T; LANES] {
        must_cast(self.register)
    }
}

impl<R: Pod, T: Pod> Deref for Held<R, T> {
    type Target = [T; LANES];
    #[inline(always)]
    fn deref(&self) -> &[T; LANES] {
        must_cast_ref(&self.register)
    }
}

impl<R: Pod, T: Pod> DerefMut for Held<R, T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T; LANES] {
        must_cast_mut(&mut self.register)
    }
}

impl<R: Pod, T: Pod> IntoIterator for Held<R, T> {
    type Item = T;
    type IntoIter = std::array::IntoIter<T, LANES>;
    #[inline(always)]
    fn into_iter(self) -> Self::IntoIter {
        self.values().into_iter()
    }
}

impl<R: Pod, T: Pod + PartialEq> PartialEq for Held<R, T> {
    fn eq(&self, other: &Self) -> bool {
        self.values() == other.values()
    }
}

impl<R: Pod, T: Pod + PartialEq> PartialEq<[T; LANES]> for Held<R, T> {
    fn eq(&self, other: &[T; LANES]) -> bool {
        self.values() == *other
    }
}

impl<R: Pod, T: Pod + std::fmt::Debug> std::fmt::Debug for Held<R, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.values().fmt(f)
    }
}
