//! The lighting equation, once for all back ends, so that two pictures differ by their method and never by
//! their formula.
//!
//! `I = emission + ka Ia c + sum over lights of S I0 (kd (L.N) c + ks h)` where `c` is the base color, `S` is 0
//! in shadow and 1 in light, and the highlight `h` is `(R.V)^a` (Phong, `R = 2 (L.N) N - L`) or `(H.N)^a`
//! (Blinn-Phong, `H` between `L` and `V`). Source: J. F. Blinn, *Models of light reflection for computer
//! synthesized pictures*, SIGGRAPH 1977.

use crate::lanes::{F32x8, LANES, Mask8, Vec3x8};
use crate::scene::{Environment, LightingModel, Material};
use glam::{DVec3, Vec3};

/// A point of a surface, seen.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// Its material.
    pub material: &'a Material,
    /// Base color with texture and vertex color applied, linear.
    pub color: Vec3,
    /// Unit normal, on the viewer's side.
    pub normal: Vec3,
    /// Unit vector to the eye.
    pub to_eye: Vec3,
}

impl Surface<'_> {
    /// Returns the light that needs no light source: emission and ambient.
    #[must_use]
    pub fn ambient(&self, environment: &Environment) -> Vec3 {
        self.material.emission + environment.ambient * self.color * self.material.ambient
    }

    /// Returns what one unshadowed light adds; nothing for light from behind.
    #[must_use]
    #[inline]
    pub fn lit_by(&self, model: LightingModel, to_light: Vec3, radiance: Vec3) -> Vec3 {
        let facing = self.normal.dot(to_light);
        if facing <= 0.0 {
            return Vec3::ZERO;
        }
        let m = self.material;
        let cosine =
            if m.specular > 0.0 { cosine(model, facing, self.normal, to_light, self.to_eye) } else { 0.0 };
        let shine = if cosine > 0.0 { m.specular * highlight(cosine, m.shininess) } else { 0.0 };
        reflected(self.color, m.diffuse * facing, shine, radiance)
    }
}

/// Eight points of one material: the form in which many are lit at once, to the same bytes as one by one.
#[derive(Clone, Copy, Debug)]
pub struct Surfaces<'a> {
    /// Their material.
    pub material: &'a Material,
    /// Base colors.
    pub color: Vec3x8,
    /// Unit normals, on the viewer's side.
    pub normal: Vec3x8,
    /// Unit vectors to the eye.
    pub to_eye: Vec3x8,
}

impl Surfaces<'_> {
    /// Returns what one unshadowed light adds to each point; see [`Surface::lit_by`].
    #[must_use]
    #[inline(always)]
    pub fn lit_by(&self, model: LightingModel, to_light: Vec3x8, radiance: Vec3x8) -> Vec3x8 {
        let (m, zero) = (self.material, F32x8::splat(0.0));
        let facing = self.normal.dot(to_light);
        let cosine = match model {
            _ if m.specular <= 0.0 => zero,
            LightingModel::Lambert => zero,
            LightingModel::Phong => {
                (self.normal.scaled(F32x8::splat(2.0) * facing) - to_light).dot(self.to_eye)
            }
            LightingModel::BlinnPhong => {
                let between = to_light + self.to_eye;
                between.dot(self.normal) / between.length().max(F32x8::splat(f32::MIN_POSITIVE))
            }
        };
        let shine = F32x8::splat(m.specular) * highlights(cosine, m.shininess);
        let diffuse = self.color.scaled(F32x8::splat(m.diffuse) * facing);
        let sum = (diffuse + Vec3x8 { x: shine, y: shine, z: shine }) * radiance;
        Vec3x8::pick(facing.above(zero), sum, Vec3x8::splat(Vec3::ZERO))
    }
}

/// Lights eight points of any materials, see [`Surfaces::lit_by`]; those without a material stay black.
#[must_use]
#[inline(always)]
pub fn lit_by_material(
    mut materials: [Option<&Material>; LANES],
    (color, normal, to_eye): (Vec3x8, Vec3x8, Vec3x8),
    model: LightingModel,
    to_light: Vec3x8,
    radiance: Vec3x8,
) -> Vec3x8 {
    let mut sum = Vec3x8::splat(Vec3::ZERO);
    while let Some(material) = materials.iter().flatten().next().copied() {
        let lit = Surfaces { material, color, normal, to_eye }.lit_by(model, to_light, radiance);
        let mut mask = Mask8::NONE;
        for (lane, waits) in materials.iter_mut().enumerate() {
            if waits.is_some_and(|m| std::ptr::eq(m, material)) {
                (*waits, mask.0[lane]) = (None, u32::MAX);
            }
        }
        sum = Vec3x8::pick(mask, lit, sum);
    }
    sum
}

/// Returns the cosine that the highlight is a power of; nothing but its sign counts where it is negative.
#[inline(always)]
fn cosine(model: LightingModel, facing: f32, normal: Vec3, to_light: Vec3, to_eye: Vec3) -> f32 {
    match model {
        LightingModel::Lambert => 0.0,
        LightingModel::Phong => (normal * (2.0 * facing) - to_light).dot(to_eye),
        LightingModel::BlinnPhong => {
            let between = to_light + to_eye;
            // Light from straight behind the surface has nothing in between, and faces it by nothing.
            between.dot(normal) / between.length().max(f32::MIN_POSITIVE)
        }
    }
}

/// Returns the diffuse and the specular share of arriving light.
#[inline(always)]
fn reflected(color: Vec3, diffuse: f32, shine: f32, radiance: Vec3) -> Vec3 {
    (color * diffuse + Vec3::splat(shine)) * radiance
}

/// Raises cosines to the shininess; those that are not positive become 0.
#[inline(always)]
#[must_use]
pub fn highlights(cosine: F32x8, shininess: f32) -> F32x8 {
    let zero = F32x8::splat(0.0);
    if !is_whole(shininess) {
        return F32x8::new(cosine.0.map(|c| if c > 0.0 { c.powf(shininess) } else { 0.0 }));
    }
    let mut power = cosine.above(zero).pick(cosine, zero);
    let (mut result, mut left) = (F32x8::splat(1.0), shininess as u32);
    while left > 0 {
        if left & 1 == 1 {
            result = result * power;
        }
        power = power * power;
        left >>= 1;
    }
    result
}

/// Tells whether a shininess is raised to by repeated squaring.
#[inline(always)]
fn is_whole(shininess: f32) -> bool {
    shininess.fract() == 0.0 && (1.0..=65536.0).contains(&shininess)
}

/// Returns `cosine^shininess`; whole exponents, which most materials have, by repeated squaring.
#[must_use]
pub fn highlight(cosine: f32, shininess: f32) -> f32 {
    if !is_whole(shininess) {
        return cosine.powf(shininess);
    }
    let (mut power, mut result, mut left) = (cosine, 1.0, shininess as u32);
    while left > 0 {
        if left & 1 == 1 {
            result *= power;
        }
        power *= power;
        left >>= 1;
    }
    result
}

/// Turns a normal to the viewer's side.
#[must_use]
pub fn facing(normal: DVec3, ray_direction: DVec3) -> DVec3 {
    if normal.dot(ray_direction) > 0.0 { -normal } else { normal }
}

/// Tells whether a light on a surface needs no shadow test because the surface itself is in between: the light
/// and the eye are on different sides of the true (not interpolated) surface.
///
/// Every back end applies this rule before its own shadow method, so that the terminator of coarse meshes is
/// the same everywhere.
#[must_use]
pub fn turned_away(true_normal_to_eye: DVec3, to_light: DVec3) -> bool {
    true_normal_to_eye.dot(to_light) <= 0.0
}

/// Fades a color into fog over a distance; an infinite distance is left as it is, background shows through.
#[must_use]
pub fn fogged(environment: &Environment, color: Vec3, distance: f64) -> Vec3 {
    match &environment.fog {
        Some(fog) if distance.is_finite() => fog.color.lerp(color, (-fog.density * distance as f32).exp()),
        _ => color,
    }
}

/// Decodes an sRGB channel in `[0, 1]` (IEC 61966-2-1).
#[must_use]
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Encodes a linear channel as sRGB; values outside of `[0, 1]` are clamped, what is not a number becomes 0.
#[must_use]
pub fn srgb_from_linear(linear: f32) -> f32 {
    let linear = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn head_on_light_gives_diffuse_plus_specular() {
        let material = Material { diffuse: 0.5, specular: 0.25, ..Material::new(Vec3::ONE) };
        let surface = Surface {
            material: &material,
            color: Vec3::new(1.0, 0.5, 0.0),
            normal: Vec3::Z,
            to_eye: Vec3::Z,
        };
        for model in [LightingModel::Phong, LightingModel::BlinnPhong] {
            assert_eq!(surface.lit_by(model, Vec3::Z, Vec3::splat(2.0)), Vec3::new(1.5, 1.0, 0.5));
        }
        assert_eq!(surface.lit_by(LightingModel::Lambert, Vec3::Z, Vec3::ONE), Vec3::new(0.5, 0.25, 0.0));
        assert_eq!(surface.lit_by(LightingModel::Phong, Vec3::NEG_Z, Vec3::ONE), Vec3::ZERO);
    }

    #[test]
    fn many_points_are_lit_as_one_by_one() {
        let unit =
            |i: usize, k: f32| Vec3::new((i as f32 * k).sin(), (i as f32 + k).cos(), 0.3).normalize_or_zero();
        let eight = |of: &dyn Fn(usize) -> Vec3, first: usize| {
            let mut all = Vec3x8::splat(Vec3::ZERO);
            (0..8).for_each(|i| all.set(i, of(first + i)));
            all
        };
        let color = |i: usize| Vec3::new(0.1, 0.02 * i as f32, 0.9);
        let (normal, to_light, to_eye) = (|i| unit(i, 0.7), |i| unit(i, 1.9), |i| unit(i, 2.3));
        let (mut lit, mut dark) = (0, 0);
        for (shininess, specular) in [(32.0, 0.5), (7.5, 0.5), (1.0, 0.0)] {
            let material = Material { shininess, specular, ..Material::new(Vec3::ONE) };
            for model in [LightingModel::Lambert, LightingModel::Phong, LightingModel::BlinnPhong] {
                for first in [0, 8, 16] {
                    let many = Surfaces {
                        material: &material,
                        color: eight(&color, first),
                        normal: eight(&normal, first),
                        to_eye: eight(&to_eye, first),
                    };
                    let sums = many.lit_by(model, eight(&to_light, first), eight(&color, first));
                    for i in first..first + 8 {
                        let (color, normal, to_eye) = (color(i), normal(i), to_eye(i));
                        let one = Surface { material: &material, color, normal, to_eye };
                        let sum = sums.get(i - first);
                        assert_eq!(sum, one.lit_by(model, to_light(i), color), "{model:?} {i}");
                        *(if sum == Vec3::ZERO { &mut dark } else { &mut lit }) += 1;
                    }
                }
            }
        }
        assert!(lit > 9 && dark > 9, "{lit} {dark}");
    }

    #[test]
    fn highlights_agree_with_the_power_function() {
        for shininess in [0.0, 0.5, 1.0, 7.0, 32.0, 33.5, 1000.0] {
            for cosine in [0.0, 0.3, 0.9, 0.999, 1.0] {
                let (fast, exact) = (highlight(cosine, shininess), cosine.powf(shininess));
                assert!((fast - exact).abs() <= 1e-4 * exact, "{cosine}^{shininess}: {fast} for {exact}");
            }
        }
    }

    #[test]
    fn srgb_goes_there_and_back() {
        for i in 0..=255 {
            let encoded = i as f32 / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(encoded)) - encoded).abs() < 1e-6);
        }
        assert_eq!(srgb_from_linear(f32::NAN), 0.0);
    }
}
