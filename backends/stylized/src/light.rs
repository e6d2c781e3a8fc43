//! How much does a surface face the light?

use glam::{DVec3, Vec3};
use polyptych_core::scene::{Light, LightKind};

/// The lights, as far as tone asks for them.
///
/// Several lights count as one from their mean direction, weighted by what arrives of each: so every tone lies
/// between the two colors, and the terminator is one clean line.
pub(crate) struct Lighting<'a> {
    lights: &'a [Light],
    /// The mean direction when it is the same everywhere.
    pub(crate) uniform: Option<Vec3>,
}

impl<'a> Lighting<'a> {
    pub(crate) fn of(lights: &'a [Light]) -> Self {
        let is_far = |l: &Light| matches!(l.kind, LightKind::Directional { .. });
        let mean = || mean(lights, DVec3::ZERO);
        let uniform = if lights.iter().all(is_far) { mean() } else { None };
        Self { lights, uniform }
    }

    /// Returns the mean direction to the lights; to the eye where none arrives.
    #[inline]
    pub(crate) fn toward(&self, position: impl Fn() -> DVec3, to_eye: impl Fn() -> Vec3) -> Vec3 {
        match self.uniform {
            Some(direction) => direction,
            None => mean(self.lights, position()).unwrap_or_else(to_eye),
        }
    }
}

fn mean(lights: &[Light], place: DVec3) -> Option<Vec3> {
    let arriving = lights.iter().filter_map(|l| l.arriving(place));
    arriving.map(|a| a.to_light.as_vec3() * a.radiance.element_sum()).sum::<Vec3>().try_normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_lights_mix_by_what_arrives_of_each() {
        let from = |d: DVec3, intensity: f32| Light { intensity, ..Light::directional(-d) };
        let both = [from(DVec3::X, 3.0), from(DVec3::Y, 1.0)];
        let direction = Lighting::of(&both).uniform.unwrap();
        assert!((direction - Vec3::new(3.0, 1.0, 0.0) / 10f32.sqrt()).length() < 1e-6);
        let opposed = [from(DVec3::X, 1.0), from(DVec3::NEG_X, 1.0)];
        assert_eq!(Lighting::of(&opposed).uniform, None);
        assert_eq!(Lighting::of(&opposed).toward(|| DVec3::ZERO, || Vec3::Z), Vec3::Z);
        let near = [Light::point(DVec3::Y, 1.0)];
        assert_eq!(Lighting::of(&near).toward(|| DVec3::ZERO, || Vec3::Z), Vec3::Y);
    }
}
