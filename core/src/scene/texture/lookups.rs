//! Eight lookups at once: which texels are read and how they are mixed is reckoned in lanes, one for each; only the
//! texels themselves are fetched one after the other.

use super::{FINEST, Texture, TextureWrap, mix};
use crate::lanes::{F32x8, I32x8, LANES, Mask8};
use glam::Vec4;

/// The texels around eight places of one level each, and the shares of those to the right and below.
struct Squares {
    texels: [I32x8; 4],
    right: F32x8,
    down: F32x8,
}

impl Texture {
    /// Adds what [`Texture::sample`] gives at those of eight places that are asked for, as multiples of
    /// [`Texture::FULL`]: divided by that, one lookup has the same bits.
    #[inline(always)]
    pub fn add_samples(&self, uv: [F32x8; 2], lod: F32x8, asked: Mask8, sums: &mut [Vec4; LANES]) {
        #[cfg(debug_assertions)]
        super::LOOKUPS.fetch_add(u64::from(asked.count()), std::sync::atomic::Ordering::Relaxed);
        let uv = [uv[0].finite(), uv[1].finite()];
        let last = F32x8::splat((self.levels.len() - 1) as f32);
        let lod = lod.above(F32x8::ZERO).pick(lod.min(last), F32x8::ZERO);
        let below = lod.nearest_below();
        let part = lod - below.to_f32();
        let near = self.squares(below, uv);
        let far = self.squares(below + I32x8::splat(1), uv);
        for (lane, sum) in sums.iter_mut().enumerate() {
            if asked.has(lane) {
                let (level, part) = (below.0[lane] as usize, part.0[lane]);
                let mut mean = self.mixed(level, &near, lane);
                if part != 0.0 {
                    mean = mix(mean, self.mixed(level + 1, &far, lane), part);
                }
                *sum += mean;
            }
        }
    }

    /// Returns the mip levels whose lookups are as wide as pixels that so many texels, squared, run past, to 2e-5: see
    /// [`Texture::lod`].
    #[must_use]
    #[inline(always)]
    pub fn levels_of(texels_squared: F32x8) -> F32x8 {
        let ratio = texels_squared * F32x8::splat(FINEST);
        let is_wide = ratio.above(F32x8::splat(1.0)) & F32x8::splat(f32::INFINITY).above(ratio);
        is_wide.pick(logarithm(ratio) * F32x8::splat(0.5), F32x8::ZERO)
    }

    #[inline(always)]
    fn mixed(&self, level: usize, squares: &Squares, lane: usize) -> Vec4 {
        let [a, b, c, d] = &squares.texels;
        let texels = [a.0[lane] as u32, b.0[lane] as u32, c.0[lane] as u32, d.0[lane] as u32];
        self.levels[level].mixed(texels, [squares.right.0[lane], squares.down.0[lane]])
    }

    /// Finds the texels around places. Each halving rounds down, but not to nothing.
    #[inline(always)]
    fn squares(&self, level: I32x8, [u, v]: [F32x8; 2]) -> Squares {
        let ([width, height], one) = (self.size(), I32x8::splat(1));
        let width = I32x8::splat(width as i32).down(level).max(one);
        let height = I32x8::splat(height as i32).down(level).max(one);
        let ([left, next], right) = neighbors(u, width, self.wrap[0]);
        let ([above, below], down) = neighbors(v, height, self.wrap[1]);
        let (upper, lower) = (above * width, below * width);
        Squares { texels: [upper + left, upper + next, lower + left, lower + next], right, down }
    }
}

/// Returns the two texels around coordinates and the share of the second.
#[inline(always)]
fn neighbors(coordinate: F32x8, size: I32x8, wrap: TextureWrap) -> ([I32x8; 2], F32x8) {
    let (zero, one, two) = (F32x8::ZERO, F32x8::splat(1.0), F32x8::splat(2.0));
    let folded = match wrap {
        TextureWrap::Repeat => coordinate - coordinate.floor(),
        TextureWrap::Mirror => {
            let twice = coordinate - two * (coordinate * F32x8::splat(0.5)).floor();
            twice.above(one).pick(two - twice, twice)
        }
        TextureWrap::Clamp => coordinate.max(zero).min(one),
    };
    let texel = folded * size.to_f32() - F32x8::splat(0.5);
    let floor = texel.floor();
    let first = floor.to_f64().nearest();
    let (nothing, last) = (I32x8::splat(0), size - I32x8::splat(1));
    let (before, behind) = match wrap {
        TextureWrap::Repeat => (last, nothing),
        TextureWrap::Mirror | TextureWrap::Clamp => (nothing, last),
    };
    let next = first + I32x8::splat(1);
    let first = I32x8::pick(first.is_negative(), before, first);
    // The second is never before the picture, the first behind it only where the coordinate was rounded up to it.
    let first = I32x8::pick(last.below(first), behind, first);
    ([first, I32x8::pick(last.below(next), behind, next)], texel - floor)
}

/// Returns the logarithms to base 2 of numbers above 1, to 2e-5: with `t = (m - 1) / (m + 1)` of the mantissa `m`,
/// `2 artanh(t) / ln 2` by its series.
#[inline(always)]
fn logarithm(v: F32x8) -> F32x8 {
    let (bits, one) = (v.to_bits(), F32x8::splat(1.0));
    let exponent = bits.down(I32x8::splat(23)) - I32x8::splat(127);
    let mantissa = F32x8::from_bits(bits & I32x8::splat(0x7F_FFFF) | I32x8::splat(0x3F80_0000));
    let t = (mantissa - one) / (mantissa + one);
    let squared = t * t;
    let mut series = squared * F32x8::splat(1.0 / 9.0);
    for share in [1.0 / 7.0, 1.0 / 5.0, 1.0 / 3.0] {
        series = squared * (F32x8::splat(share) + series);
    }
    exponent.to_f32() + t * (one + series) * F32x8::splat(2.0 * std::f32::consts::LOG2_E)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_lookups_are_those_of_one() {
        let texel =
            |i: u16| [i.wrapping_mul(7919), i.wrapping_mul(104), i.wrapping_mul(31), i.wrapping_mul(977)];
        for (width, height) in [(1, 1), (5, 3), (16, 1), (7, 32)] {
            let texels = (0..width * height).map(|i| texel(i as u16)).collect();
            let mut texture = Texture::from_linear16("t", width, height, texels);
            let wraps = [TextureWrap::Repeat, TextureWrap::Mirror, TextureWrap::Clamp];
            for (across, along) in wraps.into_iter().flat_map(|a| wraps.map(|b| (a, b))) {
                texture.wrap = [across, along];
                let us = F32x8::new([0.0, 0.3, -0.7, 1.0, 5.49, f32::NAN, -1e30, 0.999_999_94]);
                for v in [0.0, -0.0, 0.51, 1.0, -3.3, f32::INFINITY, 1e9, -1e-9] {
                    for lod in [0.0, 0.3, 1.0, 2.7, 99.0, -1.0, f32::NAN] {
                        let (mut sums, asked) = ([Vec4::ZERO; LANES], Mask8::first(7));
                        texture.add_samples([us, F32x8::splat(v)], F32x8::splat(lod), asked, &mut sums);
                        for (lane, sum) in sums.into_iter().enumerate().take(7) {
                            assert_eq!(
                                sum / Texture::FULL,
                                texture.sample([us.0[lane], v], lod),
                                "{lane} {v} {lod}"
                            );
                        }
                        assert_eq!(sums[7], Vec4::ZERO);
                    }
                }
            }
        }
    }

    #[test]
    fn levels_are_those_of_the_exact_logarithm() {
        let texture = Texture::from_srgb8("t", 1, 1, &[0; 4]);
        for i in 0..10_000 {
            let v = 1.003_f32.powi(i % 9000);
            let exact = texture.lod(glam::Vec2::new(v.sqrt(), 0.0), glam::Vec2::ZERO);
            let found = Texture::levels_of(F32x8::splat(v)).0[3];
            assert!((found - exact).abs() < 1e-5 + 1e-6 * exact, "{v}: {found} {exact}");
        }
        for (strange, level) in [(f32::NAN, 0.0), (f32::INFINITY, 0.0), (-1.0, 0.0), (0.0, 0.0)] {
            assert_eq!(Texture::levels_of(F32x8::splat(strange)).0[0], level);
        }
    }
}
