//! What color has a surface where a pixel shows it, and how much light does it let through?
//!
//! Texture coordinates are weighted by corner in double precision. The mip level comes from the exact change of the
//! weights over one pixel to the right and one down.

use crate::lens::{Lens, OnRays, Rays};
use crate::model::Part;
use glam::{Vec2, Vec3};
use polyptych_core::lanes::{F32x8, F64x8};
use polyptych_core::scene::{Mapping, Material, NormalMap, Scene, Texture};

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
                    Mapping::Uv if has_uvs => {
                        let (uv, lod) = self.uv(texture);
                        texture.sample_here(uv.to_array(), lod)
                    }
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
        let (uv, lod) = self.uv(texture);
        map.turned(normal * side, along, texture.sample_here(uv.to_array(), lod).truncate()) * side
    }

    /// Returns the texture coordinates and the mip level.
    #[inline(always)]
    fn uv(&self, texture: &Texture) -> (Vec2, f32) {
        let mesh = self.part.mesh();
        let [a, b, c] = mesh.triangles[self.triangle];
        let (a, b, c) = (mesh.uvs[a as usize], mesh.uvs[b as usize], mesh.uvs[c as usize]);
        let [v, w] = self.weights;
        let uv = a.as_dvec2() * (1.0 - v - w) + b.as_dvec2() * v + c.as_dvec2() * w;
        let moved = |[v, w]: [f32; 2]| (b - a) * v + (c - a) * w;
        let [width, height] = texture.size();
        let size = Vec2::new(width as f32, height as f32);
        let (right, down) = (moved(self.changes.right) * size, moved(self.changes.down) * size);
        (uv.as_vec2(), Texture::level_of(right.length_squared().max(down.length_squared()), logarithm))
    }

    #[inline(never)]
    fn triplanar(&self, texture: &Texture, scale: f32) -> glam::Vec4 {
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
    fn logarithms_are_right_to_two_hundred_thousandths() {
        for i in 0..10_000 {
            let v = 1.0001_f32 * 1.003_f32.powi(i % 9000);
            if v.is_finite() {
                assert!((logarithm(v) - v.log2()).abs() < 2e-5 + 1e-6 * v.log2(), "{v}");
            }
        }
    }
}
