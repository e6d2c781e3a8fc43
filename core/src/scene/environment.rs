//! What surrounds the objects: background, ambient light, fog, and the lighting model.

use super::material::color_text;
use crate::lanes::{F32x8, Vec3x8};
use glam::{DVec3, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is there where no object is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Environment {
    /// Color of rays that hit nothing.
    pub background: Background,
    /// Light that comes from everywhere, linear.
    #[serde(with = "color_text")]
    #[schemars(with = "color_text::ColorText")]
    pub ambient: Vec3,
    /// Fades surfaces with distance.
    pub fog: Option<Fog>,
    /// How highlights are reckoned.
    pub lighting: LightingModel,
}

/// Color of rays that hit nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Background {
    /// One color.
    Solid(
        #[serde(with = "color_text")]
        #[schemars(with = "color_text::ColorText")]
        Vec3,
    ),
    /// A gradient by the height of the direction: `below` at the nadir, `horizon` at eye level, `above` at the zenith.
    Gradient {
        /// Straight down.
        #[serde(with = "color_text")]
        #[schemars(with = "color_text::ColorText")]
        below: Vec3,
        /// At eye level.
        #[serde(with = "color_text")]
        #[schemars(with = "color_text::ColorText")]
        horizon: Vec3,
        /// Straight up.
        #[serde(with = "color_text")]
        #[schemars(with = "color_text::ColorText")]
        above: Vec3,
    },
}

/// Exponential fog: a share `1 - exp(-density * distance)` of the light is replaced by the fog's color.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fog {
    /// Color of fog, linear.
    #[serde(with = "color_text")]
    #[schemars(with = "color_text::ColorText")]
    pub color: Vec3,
    /// Extinction for each meter.
    pub density: f32,
}

/// How highlights are reckoned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LightingModel {
    /// Diffuse light only.
    Lambert,
    /// Highlight by the mirrored light direction.
    Phong,
    /// Highlight by the half vector.
    #[default]
    BlinnPhong,
}

impl Default for Environment {
    fn default() -> Self {
        Self {
            background: Background::Gradient {
                below: Vec3::new(0.10, 0.11, 0.13),
                horizon: Vec3::new(0.42, 0.47, 0.54),
                above: Vec3::new(0.16, 0.24, 0.40),
            },
            ambient: Vec3::splat(0.18),
            fog: None,
            lighting: LightingModel::BlinnPhong,
        }
    }
}

impl Background {
    /// Returns the color in a direction of unit length.
    #[must_use]
    pub fn color(&self, direction: DVec3) -> Vec3 {
        self.color_at(direction.y as f32)
    }

    /// Returns the color in directions of that height: the y component of a direction of unit length.
    #[must_use]
    pub fn color_at(&self, height: f32) -> Vec3 {
        self.gradient().color(height)
    }

    /// Returns the background as a gradient, which one color is, too: for many directions in a row.
    #[must_use]
    pub fn gradient(&self) -> Gradient {
        match *self {
            Self::Solid(color) => Gradient { below: color, horizon: color, above: color },
            Self::Gradient { below, horizon, above } => Gradient { below, horizon, above },
        }
    }
}

/// Colors by the height of a direction.
#[derive(Clone, Copy, Debug)]
pub struct Gradient {
    below: Vec3,
    horizon: Vec3,
    above: Vec3,
}

impl Gradient {
    /// Returns the color in directions of that height: the y component of a direction of unit length.
    #[must_use]
    #[inline(always)]
    pub fn color(&self, height: f32) -> Vec3 {
        let side = if height >= 0.0 { self.above } else { self.below };
        self.horizon + (side - self.horizon) * height.abs()
    }

    /// Returns the colors in eight directions, to the same bytes.
    #[must_use]
    #[inline(always)]
    pub fn colors(&self, height: F32x8) -> Vec3x8 {
        let up = height.at_least(F32x8::splat(0.0));
        let side = Vec3x8::pick(up, Vec3x8::splat(self.above), Vec3x8::splat(self.below));
        let horizon = Vec3x8::splat(self.horizon);
        horizon + (side - horizon).scaled(height.abs())
    }
}
