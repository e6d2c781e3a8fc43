//! The lighting equation, once for all back ends, so that two pictures differ by their method and never by
//! their formula.
//!
//! `I = emission + ka Ia c + sum over lights of S I0 (kd (L.N) c + ks h)` where `c` is the base color, `S` is 0
//! in shadow and 1 in light, and the highlight `h` is `(R.V)^a` (Phong, `R = 2 (L.N) N - L`) or `(H.N)^a`
//! (Blinn-Phong, `H` between `L` and `V`). Source: J. F. Blinn, *Models of light reflection for computer
//! synthesized pictures*, SIGGRAPH 1977.

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
    pub fn lit_by(&self, model: LightingModel, to_light: Vec3, radiance: Vec3) -> Vec3 {
        let facing = self.normal.dot(to_light);
        if facing <= 0.0 {
            return Vec3::ZERO;
        }
        let m = self.material;
        let mut sum = self.color * (m.diffuse * facing);
        if m.specular > 0.0 {
            let cosine = match model {
                LightingModel::Lambert => 0.0,
                LightingModel::Phong => (self.normal * (2.0 * facing) - to_light).dot(self.to_eye),
                LightingModel::BlinnPhong => (to_light + self.to_eye).normalize_or_zero().dot(self.normal),
            };
            if cosine > 0.0 {
                sum += Vec3::splat(m.specular * highlight(cosine, m.shininess));
            }
        }
        sum * radiance
    }
}

/// Returns `cosine^shininess`; whole exponents, which most materials have, by repeated squaring.
#[must_use]
pub fn highlight(cosine: f32, shininess: f32) -> f32 {
    if shininess.fract() != 0.0 || !(1.0..=65536.0).contains(&shininess) {
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
