//! What is at eight pixels of a row?

use glam::Vec3;
use polyptych_core::lanes::{F32x8, LANES, Vec3x8};

/// Eight pixels of a row.
#[derive(Clone, Copy)]
pub(crate) struct Eight {
    pub(crate) x: u32,
    pub(crate) y: u32,
    pub(crate) count: usize,
    pub(crate) first: usize,
    /// What is seen; nothing beyond the picture.
    pub(crate) ids: [u32; LANES],
    /// Unit vectors from the eye.
    pub(crate) direction: Vec3x8,
}

/// Reads the ids of up to eight pixels; the rest show nothing.
#[inline(always)]
pub(crate) fn ids(from: &[u32], first: usize, count: usize) -> [u32; LANES] {
    let mut all = [0; LANES];
    if count == LANES {
        all.copy_from_slice(&from[first..first + LANES]);
    } else {
        all[..count].copy_from_slice(&from[first..first + count]);
    }
    all
}

/// Returns the bits that any of some ids has.
#[inline(always)]
pub(crate) fn union<const N: usize>(ids: &[u32]) -> u32 {
    difference::<N>(ids, 0)
}

/// Returns the bits in which any of some ids differ from one. Counts are constant where they can be: of loops whose ends
/// it does not know the compiler makes no vectors so short.
#[inline(always)]
pub(crate) fn difference<const N: usize>(ids: &[u32], one: u32) -> u32 {
    let mut any = 0;
    if let Ok(all) = <&[u32; N]>::try_from(ids) {
        for id in all {
            any |= id ^ one;
        }
    } else {
        for id in ids {
            any |= id ^ one;
        }
    }
    any
}

/// Tells whether any of some pixels shows nothing.
#[inline(always)]
pub(crate) fn lacks<const N: usize>(ids: &[u32]) -> bool {
    let mut any = 0;
    if let Ok(all) = <&[u32; N]>::try_from(ids) {
        for id in all {
            any |= u32::from(*id == 0);
        }
    } else {
        for id in ids {
            any |= u32::from(*id == 0);
        }
    }
    any != 0
}

/// Reads up to eight vectors; the rest are zero.
#[inline(always)]
pub(crate) fn gather(from: &[Vec3], first: usize, count: usize) -> Vec3x8 {
    let mut all = Vec3x8::splat(Vec3::ZERO);
    if count == LANES {
        let eight: &[Vec3; LANES] = from[first..first + LANES].try_into().expect("eight vectors");
        for (lane, v) in eight.iter().enumerate() {
            (all.x.0[lane], all.y.0[lane], all.z.0[lane]) = (v.x, v.y, v.z);
        }
    } else {
        from[first..first + count].iter().enumerate().for_each(|(lane, v)| all.set(lane, *v));
    }
    all
}

#[inline(always)]
pub(crate) fn numbers(from: &[f32], first: usize, count: usize) -> F32x8 {
    if count == LANES {
        return F32x8::load(&from[first..]);
    }
    let mut all = F32x8::ZERO;
    all.0[..count].copy_from_slice(&from[first..first + count]);
    all
}

/// Returns by how much numbers change to the row before or after, whichever is less.
#[inline(always)]
pub(crate) fn steepness(here: F32x8, all: &[f32], before: usize, after: usize) -> F32x8 {
    let (before, after) = (F32x8::load(&all[before..]), F32x8::load(&all[after..]));
    (here - before).abs().min((after - here).abs())
}
