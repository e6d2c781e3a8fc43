//! Turns any shape into triangles, voxels or a signed-distance grid: on demand, to a stated tolerance, once
//! for all back ends, and with the error bound that was reached.

use crate::scene::{Material, Mesh, Scene, Voxels};
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// Converts shapes and keeps the results for all back ends.
#[derive(Default)]
pub struct Converter {}

/// What a conversion would make, told without making it.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// Bytes, estimated.
    pub bytes: u64,
    /// Bound on the distance between the surfaces in world space, estimated.
    pub bound: f64,
    /// What would be built, for people: `"about 12,000 triangles"`.
    pub builds: String,
}

/// A shape as triangles, in its object space; slots are the object's.
#[derive(Clone, Debug)]
pub struct MeshModel {
    /// The triangles.
    pub mesh: Mesh,
    /// Bound on the distance between the surfaces, in world space.
    pub bound: f64,
    /// What was done, for the report.
    pub why: String,
}

/// A shape as voxels.
#[derive(Clone, Debug)]
pub struct VoxelModel {
    /// The grid; byte `v` has the material `palette[v - 1]`.
    pub voxels: Voxels,
    /// One material for each color that occurs.
    pub palette: Vec<Material>,
    /// Places the grid (one unit a cell) in object space.
    pub object_from_voxels: DAffine3,
    /// Bound on the distance between the surfaces, in world space.
    pub bound: f64,
    /// What was done, for the report.
    pub why: String,
}

/// A shape as signed distances on a grid (positive inside), to be interpolated trilinearly; its surface is the
/// zero level. Samples lie at `first + index * step` in object space, x fastest.
#[derive(Clone, Debug)]
pub struct DistanceModel {
    /// Samples along each axis.
    pub size: [u32; 3],
    /// Position of the first sample, object space.
    pub first: DVec3,
    /// Distance of neighboring samples, object space, the same along all axes.
    pub step: f64,
    /// Signed distances in object space, clamped to a band of a few steps around the surface.
    pub distances: Vec<f32>,
    /// For each sample the index into `palette` of the nearest surface.
    pub colors: Vec<u8>,
    /// Materials of the surface.
    pub palette: Vec<Material>,
    /// Bound on the distance between the surfaces, in world space.
    pub bound: f64,
    /// What was done, for the report.
    pub why: String,
}

/// Why a shape could not be converted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{object}: {reason}")]
pub struct ConvertError {
    /// The object's name.
    pub object: String,
    /// What is in the way.
    pub reason: String,
}
