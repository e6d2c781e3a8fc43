//! What surfaces are made of.

use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A material for the lighting models of [`crate::shade`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// Its name in reports.
    pub name: String,
    /// Diffuse color in linear light; multiplied with the texture.
    #[serde(with = "color_text")]
    #[schemars(with = "color_text::ColorText")]
    pub base_color: Vec3,
    /// Index into the scene's textures, multiplied with the base color.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub texture: Option<usize>,
    /// How the texture is laid on.
    pub mapping: Mapping,
    /// Share of ambient light that is returned.
    pub ambient: f32,
    /// Share of light that is scattered evenly.
    pub diffuse: f32,
    /// Share of light that is mirrored as a highlight, white.
    pub specular: f32,
    /// Exponent of the highlight.
    pub shininess: f32,
    /// Light that the surface gives off, linear.
    #[serde(with = "color_text")]
    #[schemars(with = "color_text::ColorText")]
    pub emission: Vec3,
    /// 1 hides what lies behind, 0 is clear. Surfaces below 1 cast no shadow.
    pub opacity: f32,
    /// Share of the color that comes from the mirror direction.
    pub reflectivity: f32,
    /// What the texture's alpha means.
    pub alpha: AlphaMode,
    /// What turns the normals of its surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_map: Option<NormalMap>,
}

/// A picture of normals, laid on by the texture coordinates of a shape: red to the right, green up, blue outward, each
/// from -1 to 1 (glTF 2.0, 3.9.3). Shapes without texture coordinates keep their normals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NormalMap {
    /// Index into the scene's textures; of its bytes no gamma is taken off.
    pub texture: usize,
    /// Factor on red and green.
    #[serde(default = "one")]
    pub scale: f32,
}

fn one() -> f32 {
    1.0
}

impl NormalMap {
    /// Turns a unit normal by a texel. `along` are the changes of the place with u, to the right in the picture, and with
    /// v, down in it; only their directions count. Both are made square to the normal, as in MikkTSpace, but belong to
    /// the triangle, not to its corners. A normal that comes out as nothing, or of directions that are none, is the given
    /// one.
    #[must_use]
    #[inline(always)]
    pub fn turned(&self, normal: Vec3, along: [Vec3; 2], texel: Vec3) -> Vec3 {
        let right = along[0] - normal * normal.dot(along[0]);
        let right = right / right.length();
        let across = normal.cross(right);
        let up = if across.dot(along[1]) > 0.0 { -across } else { across };
        let [x, y, z] = (texel * 2.0 - 1.0).to_array();
        let turned = right * (x * self.scale) + up * (y * self.scale) + normal * z;
        let unit = turned / turned.length();
        if unit.is_finite() { unit } else { normal }
    }
}

/// What the alpha of a texture means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum AlphaMode {
    /// Nothing: the surface is as opaque as its material.
    #[default]
    Opaque,
    /// Texels below the cutoff are holes, the others are solid.
    Mask(f32),
    /// Alpha is opacity.
    Blend,
}

/// How a texture is laid on a shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Mapping {
    /// By the texture coordinates of the shape; triplanar with scale 1 where it has none.
    #[default]
    Uv,
    /// Projected along the three object axes, blended by the normal; `scale` repeats a meter.
    Triplanar {
        /// Repeats of the texture in a unit of object space.
        scale: f32,
    },
}

impl Default for Material {
    fn default() -> Self {
        Self::new(Vec3::new(0.75, 0.72, 0.68))
    }
}

impl Material {
    /// Builds a matte material with a soft highlight.
    #[must_use]
    pub const fn new(base_color: Vec3) -> Self {
        Self {
            name: String::new(),
            base_color,
            texture: None,
            mapping: Mapping::Uv,
            ambient: 1.0,
            diffuse: 0.85,
            specular: 0.2,
            shininess: 32.0,
            emission: Vec3::ZERO,
            opacity: 1.0,
            reflectivity: 0.0,
            alpha: AlphaMode::Opaque,
            normal_map: None,
        }
    }

    /// Returns the material of things that name none.
    #[must_use]
    pub fn fallback() -> &'static Self {
        static FALLBACK: Material = Material::new(Vec3::new(0.75, 0.72, 0.68));
        &FALLBACK
    }

    /// Tells whether light passes through every point, some points, or none: false only for solid surfaces.
    #[must_use]
    pub fn is_see_through(&self) -> bool {
        self.opacity < 1.0 || self.alpha != AlphaMode::Opaque
    }

    /// Applies the alpha mode to an opacity read from the texture; 0 is a hole.
    #[must_use]
    pub fn effective_opacity(&self, opacity: f32) -> f32 {
        match self.alpha {
            AlphaMode::Opaque => self.opacity,
            AlphaMode::Mask(cutoff) => {
                if opacity < cutoff * self.opacity {
                    0.0
                } else {
                    self.opacity
                }
            }
            AlphaMode::Blend => opacity,
        }
    }
}

/// Reads and writes colors as `"#rrggbb"` (sRGB) or three linear numbers.
pub mod color_text {
    use crate::pixels::srgb_bytes;
    use crate::shade::linear_from_srgb;
    use glam::Vec3;
    use schemars::JsonSchema;
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    /// The two ways of writing a color.
    #[derive(Serialize, Deserialize, JsonSchema)]
    #[serde(untagged)]
    pub enum ColorText {
        /// `"#rrggbb"` or `"#rgb"`, sRGB.
        Hex(String),
        /// Red, green and blue in linear light.
        Linear(f32, f32, f32),
    }

    /// Parses `#rrggbb` or `#rgb`.
    ///
    /// # Errors
    /// Says what a color looks like when the text is not one.
    pub fn parse_hex(text: &str) -> Result<Vec3, String> {
        let refuse = || format!("`{text}` is not a color: write \"#rrggbb\" or three linear numbers");
        let digits: Vec<u32> = text
            .strip_prefix('#')
            .ok_or_else(refuse)?
            .chars()
            .map(|c| c.to_digit(16).ok_or_else(refuse))
            .collect::<Result<_, _>>()?;
        let channel = match digits[..] {
            [r, g, b] => [r * 17, g * 17, b * 17],
            [a, b, c, d, e, f] => [a * 16 + b, c * 16 + d, e * 16 + f],
            _ => return Err(refuse()),
        };
        Ok(Vec3::from_array(channel.map(|c| linear_from_srgb(c as f32 / 255.0))))
    }

    /// Writes a color: as `#rrggbb` where that reads back as exactly the same color, else as numbers.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(color: &Vec3, serializer: S) -> Result<S::Ok, S::Error> {
        let [r, g, b] = srgb_bytes(*color);
        let hex = format!("#{r:02x}{g:02x}{b:02x}");
        if parse_hex(&hex).is_ok_and(|c| c == *color) {
            ColorText::Hex(hex).serialize(serializer)
        } else {
            ColorText::Linear(color.x, color.y, color.z).serialize(serializer)
        }
    }

    /// Reads a color.
    ///
    /// # Errors
    /// When it is neither a hex color nor three finite numbers.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
        match ColorText::deserialize(deserializer)? {
            ColorText::Hex(text) => parse_hex(&text).map_err(D::Error::custom),
            ColorText::Linear(r, g, b) => {
                let color = Vec3::new(r, g, b);
                if color.is_finite() { Ok(color) } else { Err(D::Error::custom("a color must be finite")) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_read_back_as_written() {
        for color in [Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.1234, 2.5, 0.0)] {
            let material = Material::new(color);
            let text = ron::to_string(&material).unwrap();
            assert_eq!(ron::from_str::<Material>(&text).unwrap(), material, "{text}");
        }
    }

    #[test]
    fn normals_turn_to_the_right_and_up_of_the_picture() {
        let map = NormalMap { texture: 0, scale: 1.0 };
        // On a floor whose picture's right is x and whose picture's down is z.
        let along = [Vec3::X * 3.0, Vec3::Z * 0.5];
        let turned = |texel: Vec3| map.turned(Vec3::Y, along, texel);
        assert_eq!(turned(Vec3::new(0.5, 0.5, 1.0)), Vec3::Y);
        assert_eq!(turned(Vec3::new(1.0, 0.5, 0.5)), Vec3::X);
        assert_eq!(turned(Vec3::new(0.5, 1.0, 0.5)), -Vec3::Z);
        let mirrored = map.turned(Vec3::Y, [-Vec3::X, Vec3::Z], Vec3::new(1.0, 1.0, 0.5));
        assert!((mirrored - Vec3::new(-1.0, 0.0, -1.0).normalize_or_zero()).length() < 1e-6, "{mirrored}");
        let half = NormalMap { scale: 0.5, ..map }.turned(Vec3::Y, along, Vec3::new(1.0, 0.5, 1.0));
        assert!((half - Vec3::new(0.5, 1.0, 0.0).normalize_or_zero()).length() < 1e-6, "{half}");
        for (along, texel) in [([Vec3::Y; 2], Vec3::X), ([Vec3::ZERO; 2], Vec3::X), (along, Vec3::splat(0.5))]
        {
            assert_eq!(map.turned(Vec3::Y, along, texel), Vec3::Y);
        }
    }

    #[test]
    fn wrong_colors_say_what_a_color_is() {
        let error = color_text::parse_hex("red").unwrap_err();
        assert_eq!(error, "`red` is not a color: write \"#rrggbb\" or three linear numbers");
    }
}
