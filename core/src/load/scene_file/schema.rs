//! The words of a scene file: types for serde, used for RON and JSON alike, in both directions.
//!
//! Lengths are meters, angles degrees, colors `"#rrggbb"` (sRGB) or three linear numbers. Names tie things together:
//! an object names its material, a material its texture.

use super::schema_shapes::ShapeEntry;
use super::schema_views::{CameraEntry, LightEntry, TransformEntry};
use crate::scene::color_text;
use crate::scene::{AlphaMode, Environment, Mapping, Material, NormalMap, TextureWrap};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A scene as it stands in a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SceneFile {
    /// What the scene is called; left out, the name of the file.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Pictures by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub textures: BTreeMap<String, TextureEntry>,
    /// Materials by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub materials: BTreeMap<String, MaterialEntry>,
    /// What is there.
    pub objects: Vec<ObjectEntry>,
    /// Light sources; none = one from the upper right front.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lights: Vec<LightEntry>,
    /// Background, ambient light, fog and the lighting model.
    #[serde(skip_serializing_if = "is_default")]
    pub environment: Environment,
    /// Views; the first is the default. None = one that sees everything.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<CameraEntry>,
}

/// A picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum TextureEntry {
    /// A picture file in the folder of the scene file.
    File {
        /// Its name, relative to the scene file.
        path: String,
        /// What lies outside along u and v.
        #[serde(default, skip_serializing_if = "is_default")]
        wrap: [TextureWrap; 2],
    },
    /// A picture in the scene file: PNG as base64.
    Png {
        /// The bytes of the PNG file.
        base64: String,
        /// What lies outside along u and v.
        #[serde(default, skip_serializing_if = "is_default")]
        wrap: [TextureWrap; 2],
    },
    /// A generated checker.
    Checker {
        /// Its two colors.
        #[schemars(with = "[color_text::ColorText; 2]")]
        colors: [Color; 2],
        /// Fields along each edge.
        #[serde(default = "eight")]
        cells: u32,
    },
}

/// A color in linear light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Color(#[serde(with = "color_text")] pub Vec3);

fn eight() -> u32 {
    8
}

/// A material; what is left out is as in [`Material::default`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MaterialEntry {
    /// Diffuse color; multiplied with the texture.
    #[serde(with = "color_text")]
    #[schemars(with = "color_text::ColorText")]
    pub base_color: Vec3,
    /// Name of the texture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub texture: Option<String>,
    /// How the texture is laid on.
    #[serde(skip_serializing_if = "is_default")]
    pub mapping: Mapping,
    /// Share of ambient light that is returned.
    pub ambient: f32,
    /// Share of light that is scattered evenly.
    pub diffuse: f32,
    /// Share of light that is mirrored as a highlight.
    pub specular: f32,
    /// Exponent of the highlight.
    pub shininess: f32,
    /// Light that the surface gives off.
    #[serde(with = "color_text")]
    #[schemars(with = "color_text::ColorText")]
    pub emission: Vec3,
    /// 1 hides what lies behind, 0 is clear.
    pub opacity: f32,
    /// Share of the color that comes from the mirror direction.
    pub reflectivity: f32,
    /// What the texture's alpha means.
    #[serde(skip_serializing_if = "is_default")]
    pub alpha: AlphaMode,
    /// What turns the normals of its surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_map: Option<NormalMapEntry>,
}

/// A picture of normals: red to the right, green up, blue outward, each from -1 to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NormalMapEntry {
    /// Name of the texture; no gamma is taken off its bytes.
    pub texture: String,
    /// Factor on red and green.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f32,
}

impl Default for MaterialEntry {
    fn default() -> Self {
        Self::of(&Material::default(), None, None)
    }
}

impl MaterialEntry {
    /// Describes a material whose texture and normal map have names.
    #[must_use]
    pub fn of(material: &Material, texture: Option<String>, normal_map: Option<NormalMapEntry>) -> Self {
        Self {
            base_color: material.base_color,
            texture,
            mapping: material.mapping,
            ambient: material.ambient,
            diffuse: material.diffuse,
            specular: material.specular,
            shininess: material.shininess,
            emission: material.emission,
            opacity: material.opacity,
            reflectivity: material.reflectivity,
            alpha: material.alpha,
            normal_map,
        }
    }

    /// Builds the material.
    #[must_use]
    pub fn material(&self, name: &str, texture: Option<usize>, normal_map: Option<NormalMap>) -> Material {
        Material {
            name: name.to_owned(),
            base_color: self.base_color,
            texture,
            mapping: self.mapping,
            ambient: self.ambient,
            diffuse: self.diffuse,
            specular: self.specular,
            shininess: self.shininess,
            emission: self.emission,
            opacity: self.opacity,
            reflectivity: self.reflectivity,
            alpha: self.alpha,
            normal_map,
        }
    }
}

/// One thing in the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectEntry {
    /// Its name in reports; left out, its kind and number.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Its geometry.
    pub shape: ShapeEntry,
    /// Its place.
    #[serde(default, skip_serializing_if = "is_default")]
    pub transform: TransformEntry,
    /// Names of its materials, one for each slot of the shape; one name alone serves all. A model keeps its own
    /// materials where none is named.
    #[serde(default, skip_serializing_if = "MaterialNames::is_empty")]
    pub material: MaterialNames,
    /// Whether it is drawn.
    #[serde(default = "yes", skip_serializing_if = "is_true")]
    pub visible: bool,
    /// Whether a back end that cannot draw it must refuse the scene.
    #[serde(default, skip_serializing_if = "is_default")]
    pub required: bool,
}

pub(super) fn yes() -> bool {
    true
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
pub(super) fn is_true(value: &bool) -> bool {
    *value
}

fn one() -> f32 {
    1.0
}

fn is_one(value: &f32) -> bool {
    *value == 1.0
}

pub(super) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// One material, or one for each slot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum MaterialNames {
    /// One for all slots.
    One(String),
    /// One for each slot.
    Slots(Vec<String>),
}

impl Default for MaterialNames {
    fn default() -> Self {
        Self::Slots(Vec::new())
    }
}

impl MaterialNames {
    /// Returns the names by slot.
    #[must_use]
    pub fn names(&self) -> &[String] {
        match self {
            Self::One(name) => std::slice::from_ref(name),
            Self::Slots(names) => names,
        }
    }

    fn is_empty(&self) -> bool {
        self.names().is_empty()
    }
}

/// Returns the JSON Schema of scene files, for editors.
#[must_use]
pub fn json_schema() -> String {
    let schema = schemars::schema_for!(SceneFile);
    serde_json::to_string_pretty(&schema).expect("a schema is plain JSON")
}
