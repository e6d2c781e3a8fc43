//! The words of a scene file: types for serde, used for RON and JSON alike, in both directions.
//!
//! Lengths are meters, angles degrees, colors `"#rrggbb"` (sRGB) or three linear numbers. Names tie things together:
//! an object names its material, a material its texture.

use crate::scene::color_text;
use crate::scene::{
    AlphaMode, Environment, Form, Mapping, Material, Primitive, TextureWrap, TransferFunction,
};
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
}

impl Default for MaterialEntry {
    fn default() -> Self {
        Self::of(&Material::default(), None)
    }
}

impl MaterialEntry {
    /// Describes a material whose texture has a name.
    #[must_use]
    pub fn of(material: &Material, texture: Option<String>) -> Self {
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
        }
    }

    /// Builds the material.
    #[must_use]
    pub fn material(&self, name: &str, texture: Option<usize>) -> Material {
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

fn yes() -> bool {
    true
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
fn is_true(value: &bool) -> bool {
    *value
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
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

/// Geometry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum ShapeEntry {
    /// A parametric body.
    Primitive(Primitive),
    /// A model file (.obj .gltf .glb .stl .ply .vox) with everything in it.
    Model {
        /// Its name, relative to the scene file.
        file: String,
    },
    /// Triangles and segments.
    Mesh(MeshEntry),
    /// A grid of palette bytes.
    Voxels {
        /// Cells along each axis.
        size: [u32; 3],
        /// One byte a cell, x fastest, then y, then z, packed by gzip, as base64.
        cells: String,
    },
    /// An implicit function.
    FreeForm {
        /// The function, positive inside.
        form: Form,
        /// Smallest and largest corner of a box that cuts it off; forms without an end need it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        bounds: Option<[[f64; 3]; 2]>,
    },
    /// Heights over a rectangle.
    HeightField(HeightEntry),
    /// A scalar field.
    Volume(VolumeEntry),
}

/// Triangles and segments; lists are empty or as long as the positions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MeshEntry {
    /// Corner positions.
    pub positions: Vec<[f32; 3]>,
    /// Corner indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Normals for smooth shading.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, v = 0 at the top.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub uvs: Vec<[f32; 2]>,
    /// Vertex colors, linear.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub colors: Vec<[f32; 3]>,
    /// Material slot of each triangle; empty = all in slot 0.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub slots: Vec<u16>,
    /// Free segments.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub segments: Vec<[u32; 2]>,
}

/// Heights over a rectangle, from a picture or in the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HeightEntry {
    /// A gray picture of 8 or 16 bits, relative to the scene file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Heights in rows, all rows of the same length; instead of a file.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rows: Vec<Vec<f32>>,
    /// Lengths along x and z; left out, 2 m for the longer side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extent: Option<[f64; 2]>,
    /// Height over the range of values of a picture; left out, a fifth of the longer side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height: Option<f64>,
}

/// A scalar field, from a file or in the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct VolumeEntry {
    /// A volume file (.nrrd .nhdr .nii .nii.gz .raw), relative to the scene file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// `WxHxD:FORMAT` of a raw file or of `samples`, for example `64x64x32:u8`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<String>,
    /// Samples, x fastest, little-endian, packed by gzip, as base64; instead of a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples: Option<String>,
    /// Distance of neighboring samples; left out, that of the file or 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spacing: Option<[f64; 3]>,
    /// Turns values into color and opacity; left out, one that suits the range of values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transfer: Option<TransferFunction>,
    /// Draws only what lies inside this form.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shell: Option<Form>,
}

/// A place: scaled, then rotated, then moved; or a matrix.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TransformEntry {
    /// Where the origin goes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translate: Option<[f64; 3]>,
    /// Degrees around x, then around y, then around z (axes of the world).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotate_deg: Option<[f64; 3]>,
    /// A rotation as a quaternion `x y z w`, instead of angles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quaternion: Option<[f64; 4]>,
    /// One factor, or one along each axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<Scale>,
    /// The three upper rows of a matrix, instead of all others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub matrix: Option<[[f64; 4]; 3]>,
}

/// Factors of a scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Scale {
    /// The same along all axes.
    Uniform(f64),
    /// Along x, y and z.
    Axes(f64, f64, f64),
}

/// A light source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightEntry {
    /// Where the light comes from.
    pub kind: LightKindEntry,
    /// Its color.
    #[serde(with = "color_text", default = "white")]
    #[schemars(with = "color_text::ColorText")]
    pub color: Vec3,
    /// Factor of the color; for point and spot lights the light at a distance of one meter.
    #[serde(default = "one")]
    pub intensity: f32,
    /// Whether opaque things block it.
    #[serde(default = "yes", skip_serializing_if = "is_true")]
    pub casts_shadow: bool,
}

fn white() -> Vec3 {
    Vec3::ONE
}
fn one() -> f32 {
    1.0
}

/// Where light comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum LightKindEntry {
    /// Parallel light.
    Directional {
        /// Where the light travels.
        direction: [f64; 3],
    },
    /// Light from a point.
    Point {
        /// Where it is.
        position: [f64; 3],
    },
    /// A point light inside a cone.
    Spot {
        /// Where it is.
        position: [f64; 3],
        /// Where the cone points.
        direction: [f64; 3],
        /// Half angle of full light.
        inner_deg: f64,
        /// Half angle of no light.
        outer_deg: f64,
    },
}

/// A view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraEntry {
    /// What the view is called.
    pub name: String,
    /// Where the eye is.
    pub eye: [f64; 3],
    /// What it looks at.
    pub target: [f64; 3],
    /// What is up in the picture.
    #[serde(default = "up", skip_serializing_if = "is_up")]
    pub up: [f64; 3],
    /// How directions become pixels; left out, a perspective of 40 degrees.
    #[serde(default)]
    pub projection: ProjectionEntry,
}

fn up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}
fn is_up(value: &[f64; 3]) -> bool {
    *value == up()
}

/// How directions become pixels; angles are whole angles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum ProjectionEntry {
    /// Straight lines stay straight.
    Perspective {
        /// Vertical field of view.
        fov_y_deg: f64,
    },
    /// Parallel rays.
    Orthographic {
        /// Height of the picture.
        height: f64,
    },
    /// Equidistant fisheye.
    Fisheye {
        /// Angle across the image circle.
        fov_deg: f64,
    },
    /// Columns are angles around the up axis.
    Cylindrical {
        /// Angle across the width.
        fov_x_deg: f64,
        /// Vertical field of view at eye level.
        fov_y_deg: f64,
    },
}

impl Default for ProjectionEntry {
    fn default() -> Self {
        Self::Perspective { fov_y_deg: 40.0 }
    }
}

/// Returns the JSON Schema of scene files, for editors.
#[must_use]
pub fn json_schema() -> String {
    let schema = schemars::schema_for!(SceneFile);
    serde_json::to_string_pretty(&schema).expect("a schema is plain JSON")
}
