//! The words of a scene file for shapes.

use crate::scene::{Form, Primitive, TransferFunction, TransferPreset};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
        /// Which frame of an animated .vox file is shown, counted from 0.
        #[serde(default, skip_serializing_if = "is_first")]
        frame: u32,
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

fn is_first(frame: &u32) -> bool {
    *frame == 0
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
    /// A transfer function by its name, instead of `transfer`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<TransferPreset>,
    /// Draws only what lies inside this form.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shell: Option<Form>,
}
