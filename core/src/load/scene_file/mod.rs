//! Reads and writes scene files, in RON and in JSON.
//!
//! RON is read and written with two of its extensions: optional fields without `Some`, and variants without a second
//! pair of brackets: `HeightField(file: "alps.png")`.

use ron::extensions::Extensions;

mod place;
mod read;
mod schema;
mod schema_shapes;
mod schema_views;
mod shape;
mod write;

pub use schema::{
    Color, MaterialEntry, MaterialNames, NormalMapEntry, ObjectEntry, SceneFile, TextureEntry, json_schema,
};
pub use schema_shapes::{HeightEntry, MeshEntry, ShapeEntry, VolumeEntry};
pub use schema_views::{CameraEntry, LightEntry, LightKindEntry, ProjectionEntry, Scale, TransformEntry};
pub use write::{SaveError, save};

pub(super) use read::load;

/// The extensions of RON in scene files.
/// What is wrong with a texture that is taken for two things.
const BOTH: &str = "is used for colors and for normals";

fn extensions() -> Extensions {
    Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES
}
