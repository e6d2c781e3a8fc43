//! What do eight pixels see of a texture?

use crate::color::{Spots, by_channel};
use glam::Vec4;
use polyptych_core::lanes::{F32x8, F64x8, LANES, Mask8};
use polyptych_core::scene::{Mesh, Texture, TextureWrap};

/// Most lookups side by side in a pixel.
const MOST: f32 = 16.0;

impl Spots<'_> {
    /// Returns the means of a texture over the pixels of some places, channel by channel.
    #[inline(always)]
    pub(crate) fn texels(&self, mesh: &Mesh, texture: &Texture, lanes: Mask8) -> [F32x8; 4] {
        let ([a, b, c], [v, w], one) = (self.corners(mesh, lanes), *self.weights, F32x8::splat(1.0));
        let u = F64x8::splat(1.0) - v - w;
        let (mut uv, mut size) = ([F32x8::ZERO; 2], [F32x8::ZERO; 2]);
        let (mut right, mut down) = ([F32x8::ZERO; 2], [F32x8::ZERO; 2]);
        for k in 0..2 {
            uv[k] = (a[k].to_f64() * u + b[k].to_f64() * v + c[k].to_f64() * w).round();
            size[k] = F32x8::splat(texture.size()[k] as f32);
            // Beyond a border that is drawn out nothing changes: a halved picture would show what is within it.
            let is_within = uv[k].at_least(F32x8::ZERO) & one.at_least(uv[k]);
            let is_border = texture.wrap[k] == TextureWrap::Clamp;
            let extent = if is_border { is_within.pick(size[k], F32x8::ZERO) } else { size[k] };
            let (ab, ac, changes) = (b[k] - a[k], c[k] - a[k], self.changes);
            right[k] = (ab * changes.right[0] + ac * changes.right[1]) * extent;
            down[k] = (ab * changes.down[0] + ac * changes.down[1]) * extent;
        }
        let print = Footprints::of(right, down);
        let lod = Texture::levels_of(print.width_squared);
        let (share, back) = (one / print.count, F32x8::splat(0.5) * (print.count - one));
        let step = [print.axis[0] / size[0] * share, print.axis[1] / size[1] * share];
        let first = [uv[0] - step[0] * back, uv[1] - step[1] * back];
        let (mut sums, mut done) = ([Vec4::ZERO; LANES], F32x8::ZERO);
        let mut left = lanes;
        while left.any() {
            let place = [first[0] + step[0] * done, first[1] + step[1] * done];
            texture.add_samples(place, lod, left, &mut sums);
            done = done + one;
            left = left & print.count.above(done);
        }
        // Of equal texels the mean is theirs to the bit.
        let full = F32x8::splat(Texture::FULL) * print.count;
        let [r, g, b, a] = by_channel(&sums);
        [r / full, g / full, b / full, a / full]
    }

    /// Returns the texture coordinates of the corners of triangles.
    #[inline(always)]
    fn corners(&self, mesh: &Mesh, lanes: Mask8) -> [[F32x8; 2]; 3] {
        let mut corners = [[F32x8::ZERO; 2]; 3];
        for lane in 0..LANES {
            if lanes.has(lane) {
                let triangle = mesh.triangles[self.names.triangle[lane] as usize];
                for k in 0..3 {
                    let uv = mesh.uvs[triangle[k] as usize];
                    if self.is_one {
                        corners[k] = [F32x8::splat(uv.x), F32x8::splat(uv.y)];
                    } else {
                        (corners[k][0].0[lane], corners[k][1].0[lane]) = (uv.x, uv.y);
                    }
                }
                if self.is_one {
                    break;
                }
            }
        }
        corners
    }
}

/// What pixels cover of a texture: as many squares in a row.
///
/// A pixel's square becomes a parallelogram, whose variances are those of a rectangle of its singular values: as many
/// lookups of the shorter width fill the longer one (after J. McCormack et al., *Feline: fast elliptical lines for
/// anisotropic texture mapping*, SIGGRAPH 1999, section 3).
struct Footprints {
    /// Whole numbers.
    count: F32x8,
    /// The longer side, texels; zero where one square is enough.
    axis: [F32x8; 2],
    /// Of one lookup, texels.
    width_squared: F32x8,
}

impl Footprints {
    /// Takes what one pixel to the right and one down move by, in texels.
    #[inline(always)]
    fn of(right: [F32x8; 2], down: [F32x8; 2]) -> Self {
        let (zero, one, half) = (F32x8::ZERO, F32x8::splat(1.0), F32x8::splat(0.5));
        let (x, y) = (right[0] * right[0] + down[0] * down[0], right[1] * right[1] + down[1] * down[1]);
        let mixed = right[0] * right[1] + down[0] * down[1];
        let area = right[0] * down[1] - right[1] * down[0];
        let leads = half * (x - y);
        let longer = half * (x + y) + (leads * leads + mixed * mixed).sqrt();
        // A lookup is no narrower than what a texel of the full picture spreads to.
        let shorter = (area * area / longer).max(F32x8::splat(3.0));
        let ratio = (longer / shorter).sqrt();
        let is_long = ratio.at_least(F32x8::splat(1.5)) & F32x8::splat(f32::INFINITY).above(longer);
        let count = is_long.pick((ratio + half).min(F32x8::splat(MOST)).floor(), one);
        let width_squared = is_long.pick(shorter.max(longer / (count * count)), longer);
        // Of the two forms of the direction, that without cancellation.
        let is_across = leads.above(zero);
        let along = [is_across.pick(longer - y, mixed), is_across.pick(mixed, longer - x)];
        let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
        let (has_length, extent) = (length.above(zero), longer.sqrt());
        let share = extent / length;
        let across = has_length.pick(along[0] * share, extent);
        let axis = [is_long.pick(across, zero), (is_long & has_length).pick(along[1] * share, zero)];
        Self { count, axis, width_squared }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    /// The first of eight alike: how many lookups, along what, and how wide.
    fn of(right: Vec2, down: Vec2) -> (f32, Vec2, f32) {
        let all = |v: Vec2| [F32x8::splat(v.x), F32x8::splat(v.y)];
        let Footprints { count, axis, width_squared } = Footprints::of(all(right), all(down));
        (count.0[0], Vec2::new(axis[0].0[0], axis[1].0[0]), width_squared.0[0].sqrt())
    }

    #[test]
    fn lookups_cover_what_a_pixel_covers() {
        for (longer, shorter) in
            [(0.5, 0.2), (3.0, 3.0), (4.0, 3.5), (12.0, 3.0), (9.0, 0.1), (90.0, 2.0), (9.0, 0.0)]
        {
            for (turn, spin) in (0..12).flat_map(|i| (0..7).map(move |k| (i as f32 * 0.5, k as f32 * 0.9))) {
                let (first, second) =
                    (Vec2::from_angle(turn) * longer, Vec2::from_angle(turn).perp() * shorter);
                let along = Vec2::from_angle(spin);
                let (count, axis, width) =
                    of(first * along.x + second * along.y, second * along.x - first * along.y);
                let (wide, case) = (shorter.max(3f32.sqrt()), format!("{longer} {shorter} {turn} {spin}"));
                if count == 1.0 {
                    assert!((width - longer).abs() < 1e-3 && longer < 1.5 * wide + 1e-3, "{case}: {width}");
                    assert_eq!(axis, Vec2::ZERO);
                    continue;
                }
                assert!((axis.length() - longer).abs() < 1e-3 * longer, "{case}");
                assert!(axis.perp_dot(first).abs() < 2e-3 * longer * longer, "{case}: {axis}");
                assert!(width * count >= longer * 0.999 && width >= wide * 0.999, "{case}: {width}");
                assert!(count == MOST || width < 1.51 * wide, "{case}: {width} x {count}");
            }
        }
        for strange in [f32::NAN, f32::INFINITY, 1e30, 0.0] {
            let count = of(Vec2::splat(strange), Vec2::X).0;
            assert!((1.0..=MOST).contains(&count), "{strange}: {count}");
        }
    }
}
