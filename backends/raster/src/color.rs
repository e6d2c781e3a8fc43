//! What color has a surface where a pixel shows it, and how much light does it let through?
//!
//! Texture coordinates are weighted by corner in double precision. What a pixel covers of a texture comes from the exact
//! change of the weights over one pixel to the right and one down.

use crate::lens::{Lens, OnRays, Rays};
use crate::model::Part;
use glam::{Vec2, Vec3, Vec4};
use polyptych_core::lanes::{F32x8, F64x8};
use polyptych_core::scene::{Mapping, Material, NormalMap, Scene, Texture, TextureWrap};

/// How the weights of the second and third corner change over one pixel to the right, and over one down.
#[derive(Clone, Copy)]
pub(crate) struct Changes {
    pub(crate) right: [f32; 2],
    pub(crate) down: [f32; 2],
}

/// The same for eight pixels.
#[derive(Clone, Copy)]
pub(crate) struct ChangesAll {
    pub(crate) right: [F32x8; 2],
    pub(crate) down: [F32x8; 2],
}

impl ChangesAll {
    #[inline(always)]
    pub(crate) fn of(&self, lane: usize) -> Changes {
        let of = |all: &[F32x8; 2]| [all[0].0[lane], all[1].0[lane]];
        Changes { right: of(&self.right), down: of(&self.down) }
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, changes: Changes) {
        for k in 0..2 {
            (self.right[k].0[lane], self.down[k].0[lane]) = (changes.right[k], changes.down[k]);
        }
    }
}

impl Changes {
    /// Of what is met nowhere else.
    pub(crate) const NONE: Self = Self { right: [0.0; 2], down: [0.0; 2] };
}

/// A place on a triangle of a part.
#[derive(Clone, Copy)]
pub(crate) struct Spot<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) part: &'a Part,
    pub(crate) triangle: usize,
    /// Of the second and third corner.
    pub(crate) weights: [f64; 2],
    pub(crate) changes: Changes,
}

impl Spot<'_> {
    /// Returns base color and effective opacity.
    #[inline(always)]
    pub(crate) fn color(&self, material: &Material) -> (Vec3, f32) {
        let texture = material.texture.and_then(|t| self.scene.textures.get(t));
        let (base, opacity) = match texture {
            None => (material.base_color, material.opacity),
            Some(texture) => {
                let has_uvs = !self.part.mesh().uvs.is_empty();
                let texel = match material.mapping {
                    Mapping::Uv if has_uvs => self.texel(texture),
                    Mapping::Uv => self.triplanar(texture, 1.0),
                    Mapping::Triplanar { scale } => self.triplanar(texture, scale),
                };
                (material.base_color * texel.truncate(), material.opacity * texel.w)
            }
        };
        let [v, w] = self.weights;
        let tinted = self.part.tinted(base, self.triangle, [v as f32, w as f32]);
        (tinted, material.effective_opacity(opacity).min(1.0))
    }

    /// Returns a unit shading normal as a normal map turns it. Both normals are on the viewer's side.
    #[inline(always)]
    pub(crate) fn turned(&self, map: &NormalMap, normal: Vec3, true_normal: Vec3) -> Vec3 {
        let (part, mesh) = (self.part, self.part.mesh());
        let Some(texture) = self.scene.textures.get(map.texture) else { return normal };
        let Some(along) = mesh.along_uv(self.triangle) else { return normal };
        let along = along.map(|v| (part.world_from_object.matrix3 * v.as_dvec3()).as_vec3());
        let [a, b, c] = mesh.corners(self.triangle);
        let outside = part.world_from_normal * (b - a).cross(c - a);
        let side = if outside.dot(true_normal) < 0.0 { -1.0 } else { 1.0 };
        map.turned(normal * side, along, self.texel(texture).truncate()) * side
    }

    /// Returns the mean of a texture over the pixel.
    #[inline(always)]
    fn texel(&self, texture: &Texture) -> Vec4 {
        let mesh = self.part.mesh();
        let [a, b, c] = mesh.triangles[self.triangle];
        let (a, b, c) = (mesh.uvs[a as usize], mesh.uvs[b as usize], mesh.uvs[c as usize]);
        let [v, w] = self.weights;
        let uv = a.as_dvec2() * (1.0 - v - w) + b.as_dvec2() * v + c.as_dvec2() * w;
        let moved = |[v, w]: [f32; 2]| (b - a) * v + (c - a) * w;
        let (uv, [width, height]) = (uv.as_vec2(), texture.size());
        let size = Vec2::new(width as f32, height as f32);
        // Beyond a border that is drawn out nothing changes: a halved picture would show what is within it.
        let extent = |k: usize| {
            let is_border = texture.wrap[k] == TextureWrap::Clamp && !(0.0..=1.0).contains(&uv[k]);
            if is_border { 0.0 } else { size[k] }
        };
        let extent = Vec2::new(extent(0), extent(1));
        let print = Footprint::of(moved(self.changes.right) * extent, moved(self.changes.down) * extent);
        let lod = Texture::level_of(print.width_squared, logarithm);
        if print.count == 1 {
            return texture.sample_here(uv.to_array(), lod);
        }
        let share = 1.0 / print.count as f32;
        let (step, mut sum) = (print.axis / size * share, Vec4::ZERO);
        let first = uv - step * (0.5 * (print.count - 1) as f32);
        for k in 0..print.count {
            sum += texture.sample_here((first + step * k as f32).to_array(), lod);
        }
        sum * share
    }

    #[inline(never)]
    fn triplanar(&self, texture: &Texture, scale: f32) -> Vec4 {
        let mesh = self.part.mesh();
        let [a, b, c] = mesh.triangles[self.triangle].map(|i| mesh.positions[i as usize].as_dvec3());
        let [v, w] = self.weights;
        let position = (a * (1.0 - v - w) + b * v + c * w).as_vec3() * scale;
        let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
        let (ab, ac) = ((b - a).as_vec3() * scale, (c - a).as_vec3() * scale);
        let moved = |[v, w]: [f32; 2]| Vec2::new((ab * v + ac * w).length(), 0.0);
        texture.triplanar(position, normal, texture.lod(moved(self.changes.right), moved(self.changes.down)))
    }
}

/// Most lookups side by side in a pixel.
const MOST: f32 = 16.0;

/// What a pixel covers of a texture: as many squares in a row.
///
/// The pixel's square becomes a parallelogram, whose variances are those of a rectangle of its singular values: as many
/// lookups of the shorter width fill the longer one (after J. McCormack et al., *Feline: fast elliptical lines for
/// anisotropic texture mapping*, SIGGRAPH 1999, section 3).
struct Footprint {
    count: u32,
    /// The longer side, texels.
    axis: Vec2,
    /// Of one lookup, texels.
    width_squared: f32,
}

impl Footprint {
    /// Takes what one pixel to the right and one down move by, in texels.
    #[inline(always)]
    fn of(right: Vec2, down: Vec2) -> Self {
        let sum = right * right + down * down;
        let (mixed, area) = (right.x * right.y + down.x * down.y, right.perp_dot(down));
        let half = 0.5 * (sum.x - sum.y);
        let longer = 0.5 * (sum.x + sum.y) + (half * half + mixed * mixed).sqrt();
        // A lookup is no narrower than what a texel of the full picture spreads to.
        let shorter = (area * area / longer).max(3.0);
        let ratio = (longer / shorter).sqrt();
        if !(ratio >= 1.5 && longer.is_finite()) {
            return Self { count: 1, axis: Vec2::ZERO, width_squared: longer };
        }
        let count = (ratio + 0.5).min(MOST) as u32;
        let width_squared = shorter.max(longer / (count * count) as f32);
        // Of the two forms of the direction, that without cancellation.
        let along =
            if half > 0.0 { Vec2::new(longer - sum.y, mixed) } else { Vec2::new(mixed, longer - sum.x) };
        let length = along.length();
        let axis =
            if length > 0.0 { along * (longer.sqrt() / length) } else { Vec2::new(longer.sqrt(), 0.0) };
        Self { count, axis, width_squared }
    }
}

/// Returns the logarithm to base 2 of a number above 1, to 2e-5: with `t = (m - 1) / (m + 1)` of the mantissa `m`,
/// `2 artanh(t) / ln 2` by its series.
#[inline(always)]
fn logarithm(v: f32) -> f32 {
    let bits = v.to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let mantissa = f32::from_bits(bits & 0x7F_FFFF | 0x3F80_0000);
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let squared = t * t;
    let series = 1.0 + squared * (1.0 / 3.0 + squared * (1.0 / 5.0 + squared * (1.0 / 7.0 + squared / 9.0)));
    exponent as f32 + t * series * (2.0 * std::f32::consts::LOG2_E)
}

/// Finds how weights change whose functions along the rays are given, as is the plane's and how far along the rays it
/// is met.
///
/// On central rays `w = s t - o` with `t = h / n`, so `w' = t (s' - s n' / n)`; on parallel ones `w' = s' - s n' / n`.
#[inline(always)]
pub(crate) fn changes(
    lens: &Lens,
    across: &OnRays,
    weights: &[OnRays; 2],
    (x, y): (f64, f64),
    t: f64,
) -> Changes {
    let share = 1.0 / across.at(lens.rays, x, y).1;
    let (right, down) = (across.by_column * share, across.by_row * share);
    let factor = match lens.rays {
        Rays::Central => t,
        Rays::Parallel => 1.0,
    };
    let slopes = weights.map(|w| w.at(lens.rays, x, y).1);
    let of = |own: [f64; 2], of_plane: f64| {
        [0, 1].map(|i: usize| ((own[i] - slopes[i] * of_plane) * factor) as f32)
    };
    Changes { right: of(weights.map(|w| w.by_column), right), down: of(weights.map(|w| w.by_row), down) }
}

/// The same for eight pixels: `plane` and `slopes` are what the plane's function and the weights' change by along the
/// rays, `steps` by how much those differ over one pixel to the right and one down.
#[inline(always)]
pub(crate) fn changes_all(
    lens: &Lens,
    t: F64x8,
    (plane, slopes): (F64x8, [F64x8; 2]),
    (plane_steps, slope_steps): ([F64x8; 2], [[F64x8; 2]; 2]),
) -> ChangesAll {
    let share = F64x8::splat(1.0) / plane;
    let (right, down) = (plane_steps[0] * share, plane_steps[1] * share);
    let factor = match lens.rays {
        Rays::Central => t,
        Rays::Parallel => F64x8::splat(1.0),
    };
    let [v, w] = slopes;
    let [v_steps, w_steps] = slope_steps;
    ChangesAll {
        right: [((v_steps[0] - v * right) * factor).round(), ((w_steps[0] - w * right) * factor).round()],
        down: [((v_steps[1] - v * down) * factor).round(), ((w_steps[1] - w * down) * factor).round()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lookups_cover_what_a_pixel_covers() {
        for (longer, shorter) in
            [(0.5, 0.2), (3.0, 3.0), (4.0, 3.5), (12.0, 3.0), (9.0, 0.1), (90.0, 2.0), (9.0, 0.0)]
        {
            for (turn, spin) in (0..12).flat_map(|i| (0..7).map(move |k| (i as f32 * 0.5, k as f32 * 0.9))) {
                let (first, second) =
                    (Vec2::from_angle(turn) * longer, Vec2::from_angle(turn).perp() * shorter);
                let along = Vec2::from_angle(spin);
                let print =
                    Footprint::of(first * along.x + second * along.y, second * along.x - first * along.y);
                let width = print.width_squared.sqrt();
                let wide = shorter.max(3f32.sqrt());
                if print.count == 1 {
                    assert!(
                        (width - longer).abs() < 1e-3 && longer < 1.5 * wide + 1e-3,
                        "{longer} {shorter}: {width}"
                    );
                    continue;
                }
                let count = print.count as f32;
                assert!(
                    (print.axis.length() - longer).abs() < 1e-3 * longer,
                    "{longer} {shorter} {turn} {spin}"
                );
                assert!(
                    print.axis.perp_dot(first).abs() < 2e-3 * longer * longer,
                    "{turn} {spin}: {}",
                    print.axis
                );
                assert!(
                    width * count >= longer * 0.999 && width >= wide * 0.999,
                    "{longer} {shorter}: {width}"
                );
                assert!(count == MOST || width < 1.51 * wide, "{longer} {shorter}: {width} x {count}");
            }
        }
        for strange in [f32::NAN, f32::INFINITY, 1e30, 0.0] {
            assert_eq!(Footprint::of(Vec2::splat(strange), Vec2::X).count.max(16), 16, "{strange}");
        }
    }

    #[test]
    fn logarithms_are_right_to_two_hundred_thousandths() {
        for i in 0..10_000 {
            let v = 1.0001_f32 * 1.003_f32.powi(i % 9000);
            if v.is_finite() {
                assert!((logarithm(v) - v.log2()).abs() < 2e-5 + 1e-6 * v.log2(), "{v}");
            }
        }
    }
}
