//! Pictures on surfaces: bilinear lookups in a chain of halved pictures.

mod lookups;

use crate::lanes::F32x8;
use crate::shade::linear_from_srgb;
use glam::{Vec2, Vec3, Vec4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a lookup outside of `[0, 1]` means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TextureWrap {
    /// The picture repeats.
    #[default]
    Repeat,
    /// The picture repeats, every other time mirrored.
    Mirror,
    /// The border is drawn out.
    Clamp,
}

/// A picture in linear light with alpha, with all its halvings.
///
/// Row 0 is at v = 0, the top, as in glTF; loaders of formats that count v from below turn it.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Its name in reports.
    pub name: String,
    /// What lies outside along u and v.
    pub wrap: [TextureWrap; 2],
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    width: u32,
    height: u32,
    texels: Vec<[u16; 4]>,
}

/// How often textures were read, all together.
#[cfg(debug_assertions)]
static LOOKUPS: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);

/// Returns how often textures were read in this process, so that tests can tell what a picture read. Only builds with
/// debug assertions count: a frame of others pays nothing.
#[cfg(debug_assertions)]
#[must_use]
pub fn texture_lookups() -> u64 {
    LOOKUPS.load(std::sync::atomic::Ordering::Relaxed)
}

/// One over the texels of a pixel whose lookups are as wide as it at the full picture: see [`Texture::lod`].
const FINEST: f32 = 1.0 / 3.0;

impl Texture {
    /// What 1 is stored as: linear light in 16 bits, so that dark sRGB steps stay apart.
    pub const FULL: f32 = 65535.0;

    /// Builds a texture from 8-bit sRGB pixels with linear alpha, row 0 at the top, `4 * width * height` bytes.
    ///
    /// # Panics
    /// When the number of bytes does not fit the size, or the size is zero.
    #[must_use]
    pub fn from_srgb8(name: impl Into<String>, width: u32, height: u32, rgba: &[u8]) -> Self {
        assert!(width > 0 && height > 0, "a texture needs at least one texel, got {width}x{height}");
        assert_eq!(rgba.len(), 4 * width as usize * height as usize, "bytes of a {width}x{height} texture");
        let table: Vec<u16> =
            (0..=255u32).map(|b| (linear_from_srgb(b as f32 / 255.0) * Self::FULL).round() as u16).collect();
        let texels = rgba
            .chunks_exact(4)
            .map(|p| {
                [
                    table[usize::from(p[0])],
                    table[usize::from(p[1])],
                    table[usize::from(p[2])],
                    u16::from(p[3]) * 257,
                ]
            })
            .collect();
        Self::from_linear16(name, width, height, texels)
    }

    /// Builds a texture of data from 8-bit pixels: nothing is taken for sRGB. Otherwise as [`Texture::from_srgb8`].
    ///
    /// # Panics
    /// When the number of bytes does not fit the size, or the size is zero.
    #[must_use]
    pub fn from_linear8(name: impl Into<String>, width: u32, height: u32, rgba: &[u8]) -> Self {
        assert_eq!(rgba.len(), 4 * width as usize * height as usize, "bytes of a {width}x{height} texture");
        let texels =
            rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]].map(|b| u16::from(b) * 257)).collect();
        Self::from_linear16(name, width, height, texels)
    }

    /// Builds a texture from [`Texture::texels`]: linear light and alpha, 65535 = 1, row 0 at the top.
    ///
    /// # Panics
    /// When the number of texels does not fit the size, or the size is zero.
    #[must_use]
    pub fn from_linear16(name: impl Into<String>, width: u32, height: u32, texels: Vec<[u16; 4]>) -> Self {
        assert!(width > 0 && height > 0, "a texture needs at least one texel, got {width}x{height}");
        assert_eq!(texels.len(), width as usize * height as usize, "texels of a {width}x{height} texture");
        let mut levels = vec![Level { width, height, texels }];
        while let Some(next) = levels.last().and_then(Level::halved) {
            levels.push(next);
        }
        Self { name: name.into(), wrap: [TextureWrap::Repeat; 2], levels }
    }

    /// Returns the full picture in linear light, 65535 = 1, rows from the top.
    #[must_use]
    pub fn texels(&self) -> &[[u16; 4]] {
        &self.levels[0].texels
    }

    /// Returns the size of the full picture.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.levels[0].width, self.levels[0].height]
    }

    /// Returns the bytes held, all levels together.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.levels.iter().map(|l| l.texels.len() as u64 * 8).sum()
    }

    /// Samples by bilinear interpolation in the two levels around `lod` (trilinear; level 0 alone for `lod <= 0`).
    ///
    /// Coordinates that are not finite read as 0. Returns linear RGBA in `[0, 1]`.
    ///
    /// See [`Texture::add_samples`] for eight at once.
    #[must_use]
    pub fn sample(&self, uv: [f32; 2], lod: f32) -> Vec4 {
        #[cfg(debug_assertions)]
        LOOKUPS.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let [u, v] = uv;
        let uv = [if u.is_finite() { u } else { 0.0 }, if v.is_finite() { v } else { 0.0 }];
        let last = (self.levels.len() - 1) as f32;
        let lod = if lod > 0.0 { lod.min(last) } else { 0.0 };
        let below = lod as usize;
        let part = lod - below as f32;
        let near = self.levels[below].bilinear(uv, self.wrap);
        let mean =
            if part == 0.0 { near } else { mix(near, self.levels[below + 1].bilinear(uv, self.wrap), part) };
        mean / Self::FULL
    }

    /// Samples along the three axes and blends by the fourth power of the normal's components.
    #[must_use]
    pub fn triplanar(&self, position: Vec3, normal: Vec3, lod: f32) -> Vec4 {
        let weight = (normal * normal) * (normal * normal);
        let sum = weight.element_sum();
        if sum.is_nan() || sum <= 0.0 {
            return self.sample([position.x, position.y], lod);
        }
        let (p, mut color) = (position, Vec4::ZERO);
        for (w, uv) in [(weight.x, [p.z, -p.y]), (weight.y, [p.x, p.z]), (weight.z, [p.x, -p.y])] {
            if w > 0.0 {
                color += self.sample(uv, lod) * (w / sum);
            }
        }
        color
    }

    /// Returns the mip level whose lookups are as wide as a pixel, from the change of the texture coordinates over one
    /// pixel to the right and one down: the longer one decides.
    ///
    /// A texel of width `t` is the mean of a square and is weighted by a tent, with variances of `t^2 / 12` and
    /// `t^2 / 6`; the mean over a pixel of width `p` has one of `p^2 / 12`. Both are equal for `t = p / sqrt(3)`. At the
    /// level of `t = p` everything would be blurred over almost two pixels.
    #[must_use]
    pub fn lod(&self, duv_dx: Vec2, duv_dy: Vec2) -> f32 {
        let size = Vec2::new(self.levels[0].width as f32, self.levels[0].height as f32);
        let ratio = (duv_dx * size).length_squared().max((duv_dy * size).length_squared()) * FINEST;
        if ratio > 1.0 && ratio.is_finite() { 0.5 * ratio.log2() } else { 0.0 }
    }
}

impl Level {
    fn halved(&self) -> Option<Self> {
        if self.width == 1 && self.height == 1 {
            return None;
        }
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut texels = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                texels.push(self.mean(span(x, width, self.width), span(y, height, self.height)));
            }
        }
        Some(Self { width, height, texels })
    }

    /// Returns the mean of a block, colors weighted by alpha so that hidden texels do not bleed.
    fn mean(&self, columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> [u16; 4] {
        let (mut color, mut plain, mut alpha, mut count) = (Vec3::ZERO, Vec3::ZERO, 0.0_f32, 0.0_f32);
        for y in rows {
            for x in columns.clone() {
                let t = self.texels[(y * self.width + x) as usize].map(f32::from);
                let c = Vec3::new(t[0], t[1], t[2]);
                color += c * t[3];
                plain += c;
                alpha += t[3];
                count += 1.0;
            }
        }
        let color = if alpha > 0.0 { color / alpha } else { plain / count };
        [color.x, color.y, color.z, alpha / count].map(|v| v.round() as u16)
    }

    #[inline(always)]
    fn bilinear(&self, uv: [f32; 2], wrap: [TextureWrap; 2]) -> Vec4 {
        let (x0, x1, fx) = neighbors(uv[0], self.width, wrap[0]);
        let (y0, y1, fy) = neighbors(uv[1], self.height, wrap[1]);
        let (upper, lower) = (y0 * self.width, y1 * self.width);
        self.mixed([upper + x0, upper + x1, lower + x0, lower + x1], [fx, fy])
    }

    /// Mixes four texels, two of a row and two of the next, by the shares of the right and lower ones; 65535 = 1.
    #[inline(always)]
    fn mixed(&self, [a, b, c, d]: [u32; 4], [right, down]: [f32; 2]) -> Vec4 {
        let (upper, lower) = (self.pair(a, b), self.pair(c, d));
        let [r, g, b, a, next @ ..] = (upper + (lower - upper) * F32x8::splat(down)).0.values();
        mix(Vec4::new(r, g, b, a), Vec4::from_array(next), right)
    }

    /// Reads two texels, which mostly lie side by side.
    #[inline(always)]
    fn pair(&self, first: u32, second: u32) -> F32x8 {
        let at = first as usize;
        let both = match self.texels.get(at..at + 2) {
            Some(&[a, b]) if second == first + 1 => [a, b],
            _ => [self.texels[at], self.texels[second as usize]],
        };
        F32x8::from_u16(bytemuck::must_cast(both))
    }
}

/// Mixes such that two equal ones give themselves.
#[inline(always)]
fn mix(a: Vec4, b: Vec4, share: f32) -> Vec4 {
    a + (b - a) * share
}

/// Returns which of `full` texels make texel `i` of `half`: two, or three at the end of an odd row.
fn span(i: u32, half: u32, full: u32) -> std::ops::Range<u32> {
    let begin = (i * 2).min(full - 1);
    begin..if i + 1 == half { full } else { begin + 2 }
}

/// Returns the two texels around a coordinate and the share of the second.
#[inline(always)]
fn neighbors(coordinate: f32, size: u32, wrap: TextureWrap) -> (u32, u32, f32) {
    let folded = match wrap {
        TextureWrap::Repeat => coordinate - coordinate.floor(),
        TextureWrap::Mirror => {
            let twice = coordinate - 2.0 * (coordinate * 0.5).floor();
            if twice > 1.0 { 2.0 - twice } else { twice }
        }
        TextureWrap::Clamp => coordinate.clamp(0.0, 1.0),
    };
    // From half a texel before the first one to half a texel before the end.
    let texel = folded * size as f32 - 0.5;
    let floor = texel.floor();
    let (first, last) = (floor as i32, size as i32 - 1);
    let (before, behind) = match wrap {
        TextureWrap::Repeat => (last, 0),
        TextureWrap::Mirror | TextureWrap::Clamp => (0, last),
    };
    let place = |i: i32| {
        let i = if i < 0 { before } else { i };
        (if i > last { behind } else { i }) as u32
    };
    (place(first), place(first + 1), texel - floor)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_by_one() -> Texture {
        Texture::from_srgb8("t", 2, 1, &[0, 0, 0, 255, 255, 255, 255, 255])
    }

    #[test]
    fn bilinear_mixes_in_linear_light_and_wraps() {
        let mut texture = two_by_one();
        assert_eq!(texture.sample([0.5, 0.5], 0.0).x, 0.5);
        assert_eq!(texture.sample([0.0, 0.5], 0.0).x, 0.5);
        texture.wrap = [TextureWrap::Clamp; 2];
        assert_eq!(texture.sample([0.0, 0.5], 0.0).x, 0.0);
        assert_eq!(texture.sample([7.5, 0.5], 0.0).x, 1.0);
    }

    #[test]
    fn last_level_is_the_mean_and_wild_coordinates_are_safe() {
        let texture = two_by_one();
        assert!((texture.sample([0.3, 0.3], 99.0).x - 0.5).abs() < 1e-4);
        for wild in [f32::NAN, f32::INFINITY, 1e30, -1e30] {
            assert!(texture.sample([wild, wild], 0.0).is_finite());
        }
    }
}
