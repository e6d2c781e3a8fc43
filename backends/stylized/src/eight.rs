//! What is at eight pixels of a row?

use glam::Vec3;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::lanes::{F32x8, LANES, Vec3x8};
use std::hint::black_box;

/// Eight pixels of a row, of which those beyond the picture's edge show nothing.
#[derive(Clone, Copy)]
pub(crate) struct Eight<'a> {
    pub(crate) x: u32,
    pub(crate) y: u32,
    /// How many are within the picture.
    pub(crate) count: usize,
    pub(crate) seen: Seen<'a>,
    /// Unit vectors from the eye.
    pub(crate) direction: Vec3x8,
}

/// What is seen at eight pixels. Without a plane distances and colors are zero, and all is lit.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    pub(crate) ids: &'a [u32; LANES],
    pub(crate) distance: &'a [f32; LANES],
    pub(crate) normal: &'a [Vec3; LANES],
    pub(crate) albedo: &'a [Vec3; LANES],
    pub(crate) shadow: &'a [f32; LANES],
}

/// Room for the last pixels of a row that are less than eight.
pub(crate) struct Few {
    ids: [u32; LANES],
    distance: [f32; LANES],
    normal: [Vec3; LANES],
    albedo: [Vec3; LANES],
    shadow: [f32; LANES],
}

impl Default for Few {
    fn default() -> Self {
        Self { ids: [0; LANES], distance: DARK, normal: BLACK, albedo: BLACK, shadow: LIT }
    }
}

const DARK: [f32; LANES] = [0.0; LANES];
const LIT: [f32; LANES] = [1.0; LANES];
const BLACK: [Vec3; LANES] = [Vec3::ZERO; LANES];

/// Returns up to eight values of a plane from one on, those beyond as they are in `few`; `none` without that plane.
#[inline(always)]
fn of<'a, T: Copy>(
    plane: &'a [T],
    first: usize,
    count: usize,
    few: &'a mut [T; LANES],
    none: &'a [T; LANES],
) -> &'a [T; LANES] {
    if plane.is_empty() {
        return none;
    }
    if count == LANES {
        return plane[first..first + LANES].try_into().expect("eight");
    }
    few[..count].copy_from_slice(&plane[first..first + count]);
    few
}

impl<'a> Seen<'a> {
    /// Reads pixels of all planes: `count` of them, at most eight, from one on.
    #[inline(always)]
    pub(crate) fn at(visible: &'a Framebuffer, first: usize, count: usize, few: &'a mut Few) -> Self {
        Self {
            ids: of(visible.id(), first, count, &mut few.ids, &[0; LANES]),
            distance: of(visible.distance(), first, count, &mut few.distance, &DARK),
            normal: of(visible.normal(), first, count, &mut few.normal, &BLACK),
            albedo: of(visible.albedo(), first, count, &mut few.albedo, &BLACK),
            shadow: of(visible.shadow(), first, count, &mut few.shadow, &LIT),
        }
    }
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

/// Sorts eight vectors by their axes.
#[inline(always)]
pub(crate) fn sorted(from: &[Vec3; LANES]) -> Vec3x8 {
    let mut flat = [[0.0f32; LANES]; 3];
    for (i, v) in from.iter().enumerate() {
        for (k, component) in v.to_array().into_iter().enumerate() {
            flat[(3 * i + k) / LANES][(3 * i + k) % LANES] = component;
        }
    }
    // Three registers, whatever follows: the compiler would else read the numbers one by one.
    let flat = flat.map(|row| black_box(F32x8::new(row)).0.values());
    let mut axes = [[0.0f32; LANES]; 3];
    for i in 0..LANES {
        for (k, axis) in axes.iter_mut().enumerate() {
            axis[i] = flat[(3 * i + k) / LANES][(3 * i + k) % LANES];
        }
    }
    let [x, y, z] = axes.map(F32x8::new);
    Vec3x8 { x, y, z }
}

/// Returns by how much numbers change to the row before or after, whichever is less.
#[inline(always)]
pub(crate) fn steepness(here: F32x8, all: &[f32], before: usize, after: usize) -> F32x8 {
    let (before, after) = (F32x8::load(&all[before..]), F32x8::load(&all[after..]));
    (here - before).abs().min((after - here).abs())
}
