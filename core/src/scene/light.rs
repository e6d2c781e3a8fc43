//! Light sources.

use super::material::color_text;
use glam::{DVec3, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A light source without extent: its shadows are hard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Where the light comes from.
    pub kind: LightKind,
    /// Color in linear light.
    #[serde(with = "color_text", default = "white")]
    #[schemars(with = "color_text::ColorText")]
    pub color: Vec3,
    /// Factor of the color. For point and spot lights the light at a distance of one meter.
    #[serde(default = "one")]
    pub intensity: f32,
    /// Whether opaque things block it.
    #[serde(default = "yes")]
    pub casts_shadow: bool,
}

fn white() -> Vec3 {
    Vec3::ONE
}
fn one() -> f32 {
    1.0
}
fn yes() -> bool {
    true
}

/// Where light comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum LightKind {
    /// Parallel light, like the sun's.
    Directional {
        /// Where the light travels.
        #[schemars(with = "[f64; 3]")]
        direction: DVec3,
    },
    /// Light from a point, falling with the square of the distance.
    Point {
        /// Where it is.
        #[schemars(with = "[f64; 3]")]
        position: DVec3,
    },
    /// A point light inside a cone.
    Spot {
        /// Where it is.
        #[schemars(with = "[f64; 3]")]
        position: DVec3,
        /// Where the cone points.
        #[schemars(with = "[f64; 3]")]
        direction: DVec3,
        /// Half angle of full light, radians.
        inner: f64,
        /// Half angle of no light, radians.
        outer: f64,
    },
}

/// Light arriving at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arriving {
    /// Unit vector from the point to the light.
    pub to_light: DVec3,
    /// Distance to the light; infinite for directional lights.
    pub distance: f64,
    /// Color times intensity times falloff.
    pub radiance: Vec3,
}

impl Light {
    /// Builds a white directional light of intensity 1 that travels along `direction`.
    #[must_use]
    pub fn directional(direction: DVec3) -> Self {
        Self {
            kind: LightKind::Directional { direction },
            color: Vec3::ONE,
            intensity: 1.0,
            casts_shadow: true,
        }
    }

    /// Builds a white point light.
    #[must_use]
    pub fn point(position: DVec3, intensity: f32) -> Self {
        Self { kind: LightKind::Point { position }, color: Vec3::ONE, intensity, casts_shadow: true }
    }

    /// Returns the light that would arrive at a point if nothing were in between; nothing for a dark light,
    /// outside of a spot's cone, or at the very place of the light.
    #[must_use]
    pub fn arriving(&self, point: DVec3) -> Option<Arriving> {
        let full = self.color * self.intensity;
        let (to_light, distance, falloff) = match self.kind {
            LightKind::Directional { direction } => (-direction.try_normalize()?, f64::INFINITY, 1.0),
            LightKind::Point { position } => {
                let (to_light, distance) = toward(point, position)?;
                (to_light, distance, 1.0 / (distance * distance))
            }
            LightKind::Spot { position, direction, inner, outer } => {
                let (to_light, distance) = toward(point, position)?;
                let cosine = direction.try_normalize()?.dot(-to_light);
                let (full_at, none_at) = (inner.cos(), outer.cos());
                let cone = if cosine >= full_at {
                    1.0
                } else if cosine <= none_at {
                    return None;
                } else {
                    let s = (cosine - none_at) / (full_at - none_at);
                    s * s * (3.0 - 2.0 * s)
                };
                (to_light, distance, cone / (distance * distance))
            }
        };
        let radiance = full * falloff as f32;
        (radiance.max_element() > 0.0 && radiance.is_finite()).then_some(Arriving {
            to_light,
            distance,
            radiance,
        })
    }
}

fn toward(point: DVec3, light: DVec3) -> Option<(DVec3, f64)> {
    let offset = light - point;
    let distance = offset.length();
    (distance > 0.0 && distance.is_finite()).then(|| (offset / distance, distance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn point_light_falls_with_the_square() {
        let light = Light::point(DVec3::new(0.0, 2.0, 0.0), 8.0);
        let arriving = light.arriving(DVec3::ZERO).unwrap();
        assert_eq!((arriving.distance, arriving.radiance.x), (2.0, 2.0));
        assert_eq!(light.arriving(DVec3::new(0.0, 2.0, 0.0)), None);
    }
}
