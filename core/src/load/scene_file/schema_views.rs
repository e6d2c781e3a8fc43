//! The words of a scene file for places, lights and cameras.

use super::schema::{is_true, yes};
use crate::projector::Screen;
use crate::scene::color_text;
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
    /// A projector before a curved screen: the camera's eye is the viewer's, for whom the picture looks right.
    Projector {
        /// Where the projector is.
        at: [f64; 3],
        /// What its lens looks at.
        toward: [f64; 3],
        /// Vertical field of view of its lens.
        fov_y_deg: f64,
        /// Width of its picture over the height.
        aspect: f64,
        /// What it throws its picture on.
        screen: Screen,
    },
}

impl Default for ProjectionEntry {
    fn default() -> Self {
        Self::Perspective { fov_y_deg: 40.0 }
    }
}
