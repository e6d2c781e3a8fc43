//! Turns any shape into triangles, voxels or a signed-distance grid: on demand, to a stated tolerance, once
//! for all back ends, and with the error bound that was reached.
//!
//! Nothing is converted that no one asked for. Tolerances are grouped in classes half an octave wide, as shares of
//! the body's size, so that a scene in other units becomes the same picture; a result is kept under (shape, class)
//! as long as the shape lives, and shared by all who ask again. A conversion that the host stops leaves nothing behind.

mod cache;
#[cfg(test)]
mod cancelling;
mod chunks;
mod distance;
mod field_mesh;
mod height_mesh;
mod levels;
mod palette;
mod primitive_mesh;
mod voxel_mesh;
mod voxelize;

use crate::scene::{Material, Mesh, Object, Scene, Shape, Voxels};
use crate::seam::{Cancelled, Control};
use cache::Cache;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// Converts shapes and keeps the results for all back ends.
#[derive(Default)]
pub struct Converter {
    meshes: Cache<MeshModel>,
    levels: Cache<MeshModel>,
    /// For each [`Filling`].
    voxels: [Cache<VoxelModel>; 4],
    distances: Cache<DistanceModel>,
}

/// What a conversion would make, told without making it.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// Bytes, estimated.
    pub bytes: u64,
    /// Bound on the distance between the surfaces in world space, estimated.
    pub bound: f64,
    /// What would be built, for people: `"about 12,000 triangles"`.
    pub builds: String,
    /// Triangles; 0 for what is none.
    pub triangles: u64,
    /// Corners of them that are kept apart.
    pub vertices: u64,
}

impl Forecast {
    fn of_grid(bytes: u64, bound: f64, builds: String) -> Self {
        Self { bytes, bound, builds, triangles: 0, vertices: 0 }
    }
}

/// How large a mesh is or would be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct MeshSize {
    vertices: f64,
    triangles: f64,
    /// Bytes of a vertex and of a triangle.
    each: [f64; 2],
    /// Whether the numbers are those that come out, and no estimate.
    is_exact: bool,
}

impl MeshSize {
    /// The size of a mesh whose vertices have normals and texture coordinates.
    fn exact(vertices: u32, triangles: u32) -> Self {
        Self {
            vertices: f64::from(vertices),
            triangles: f64::from(triangles),
            each: [32.0, 12.0],
            is_exact: true,
        }
    }
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
    /// Signed distances in object space, clamped to [`DistanceModel::BAND`] steps around the surface.
    pub distances: Vec<f32>,
    /// For each sample the byte `v` whose material `palette[v - 1]` the nearest surface has; 0 far from any.
    pub colors: Vec<u8>,
    /// Materials of the surface.
    pub palette: Vec<Material>,
    /// Half of the thickness, object space, that a surface which encloses nothing was given so that it has an inside;
    /// 0 for bodies. The surface itself lies in the middle.
    pub half_sheet: f64,
    /// Bound on the distance between the surfaces, in world space.
    pub bound: f64,
    /// What was done, for the report.
    pub why: String,
}

impl DistanceModel {
    /// Distances are exact up to this many steps from the surface and clamped beyond.
    pub const BAND: f64 = 3.0;
}

/// Why a shape could not be converted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConvertError {
    /// The host asked to stop. Nothing is kept of what was begun.
    #[error("cancelled")]
    Cancelled,
    /// There is nothing to convert, or nothing comes of it.
    #[error("{object}: {reason}")]
    Impossible {
        /// The object's name.
        object: String,
        /// What is in the way.
        reason: String,
    },
}

impl ConvertError {
    fn of(object: &Object, reason: impl Into<String>) -> Self {
        Self::Impossible { object: object.name.clone(), reason: reason.into() }
    }

    /// Returns what is in the way of the shape itself.
    ///
    /// # Errors
    /// [`Cancelled`] when nothing is but the host.
    pub fn reason(self) -> Result<String, Cancelled> {
        match self {
            Self::Cancelled => Err(Cancelled),
            Self::Impossible { reason, .. } => Ok(reason),
        }
    }
}

impl From<Cancelled> for ConvertError {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

/// How fine a conversion shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// Greatest distance between the surfaces, world space.
    pub tolerance: f64,
    /// Most cells along the longest edge; where the tolerance would need more, the bound says what was reached.
    pub max_resolution: u32,
}

/// Which cells of a grid a shape fills.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Filling {
    /// Bodies that are told by a formula or by samples as a whole, triangles and heights as their surface.
    #[default]
    Natural,
    /// The surface, so that no way leads from one side to the other over empty cells, be it over their faces, edges or
    /// corners (26-separating): of triangles all cells that they touch, of bodies those with an empty neighbor.
    Surface,
    /// The surface, so that no way over faces of empty cells leads from one side to the other (6-separating): about half
    /// as many cells.
    Thin,
    /// All cells whose middle is inside: of a closed mesh those with a winding number other than 0; of an open one those
    /// that most directions call so, and its surface.
    Solid,
}

impl Filling {
    /// All of them, in the order of [`Filling::NAMES`].
    pub const ALL: [Self; 4] = [Self::Natural, Self::Surface, Self::Thin, Self::Solid];
    /// What they are called in commands and parameters.
    pub const NAMES: [&'static str; 4] = ["natural", "surface", "thin", "solid"];

    /// Returns the one of a name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().position(|&n| n == name).map(|i| Self::ALL[i])
    }
}

impl Detail {
    /// Returns the class of the tolerance for an object, rounded down: half octaves of its share of the body's size.
    /// What is converted is the same for all tolerances of a class.
    #[must_use]
    pub fn class(&self, object: &Object) -> i32 {
        let share = self.tolerance / (scale_of(object) * extent_of(object));
        if share > 0.0 && share.is_finite() { (share.log2() * 2.0 + 1e-9).floor() as i32 } else { i32::MIN }
    }

    /// Returns the tolerance of the class in object space.
    fn in_object(&self, object: &Object) -> f64 {
        match self.class(object) {
            i32::MIN => 0.0,
            class => 2f64.powf(f64::from(class) * 0.5) * extent_of(object),
        }
    }
}

impl Converter {
    /// Counts the conversions at hand: meshes, voxels, grids of distances. What nobody asked for is none.
    #[must_use]
    pub fn kept(&self) -> [usize; 3] {
        [self.meshes.count(), self.voxels.iter().map(Cache::count).sum(), self.distances.count()]
    }

    /// Returns the shape of an object as triangles. Meshes are returned as they are.
    ///
    /// # Errors
    /// When the shape has no surface at all, or the host cancelled.
    pub fn mesh(
        &self,
        scene: &Scene,
        object: &Object,
        detail: Detail,
        control: &Control<'_>,
    ) -> Result<Arc<MeshModel>, ConvertError> {
        let scale = scale_of(object);
        self.meshes.get(scene, object, detail, control, |tolerance| {
            let (mesh, bound, why) = match &*object.shape {
                Shape::Mesh(mesh) => (mesh.clone(), 0.0, "triangles as given".to_owned()),
                Shape::Primitive(primitive) => {
                    let (mesh, bound) = primitive_mesh::tessellate(primitive, tolerance);
                    let why = format!("{} triangles", mesh.triangles.len());
                    (mesh, bound, why)
                }
                Shape::Voxels(voxels) => {
                    let clear = clear_values(scene, object);
                    let mesh = voxel_mesh::exposed_faces(voxels, &clear, control)?;
                    let why = format!("{} exposed faces", mesh.triangles.len() / 2);
                    (mesh, 0.0, why)
                }
                Shape::FreeForm(form) => {
                    let resolution = detail.max_resolution.min(field_mesh::FINEST);
                    let (mesh, bound) = field_mesh::of_form(form, tolerance, resolution, control)?;
                    let why = format!("{} triangles by dual contouring", mesh.triangles.len());
                    (mesh, bound, why)
                }
                Shape::HeightField(field) => {
                    let (mesh, bound) = height_mesh::triangulate(field, tolerance, control)?;
                    let why = format!("{} triangles", mesh.triangles.len());
                    (mesh, bound, why)
                }
                Shape::Volume(volume) => {
                    let (mesh, bound) = field_mesh::of_volume(volume, control)?;
                    let why = format!(
                        "surface at value {:.4} as {} triangles; what is translucent is lost",
                        volume.transfer.surface_value(),
                        mesh.triangles.len()
                    );
                    (mesh, bound, why)
                }
            };
            Ok(MeshModel { mesh, bound: bound * scale, why })
        })
    }

    /// Returns a mesh with as few triangles as stay within the tolerance; other shapes as [`Converter::mesh`] does, which
    /// makes no more than are needed.
    ///
    /// # Errors
    /// When the shape has no surface at all, or the host cancelled.
    pub fn level(
        &self,
        scene: &Scene,
        object: &Object,
        detail: Detail,
        control: &Control<'_>,
    ) -> Result<Arc<MeshModel>, ConvertError> {
        let Shape::Mesh(mesh) = &*object.shape else { return self.mesh(scene, object, detail, control) };
        let scale = scale_of(object);
        self.levels.get(scene, object, detail, control, |tolerance| {
            let (fewer, bound) = levels::simplified(mesh, tolerance, control)?;
            let why = format!("{} of {} triangles", fewer.triangles.len(), mesh.triangles.len());
            Ok(MeshModel { mesh: fewer, bound: bound * scale, why })
        })
    }

    /// Returns the shape of an object as voxels: bodies filled, meshes and height fields as their surface.
    ///
    /// # Errors
    /// When the shape has no surface at all, or the host cancelled.
    pub fn voxels(
        &self,
        scene: &Scene,
        object: &Object,
        detail: Detail,
        control: &Control<'_>,
    ) -> Result<Arc<VoxelModel>, ConvertError> {
        self.voxels_filled(scene, object, detail, Filling::Natural, control)
    }

    /// Returns the shape of an object as voxels of your choice. Grids are returned as they are.
    ///
    /// # Errors
    /// When the shape has no surface at all, or the host cancelled.
    pub fn voxels_filled(
        &self,
        scene: &Scene,
        object: &Object,
        detail: Detail,
        filling: Filling,
        control: &Control<'_>,
    ) -> Result<Arc<VoxelModel>, ConvertError> {
        let scale = scale_of(object);
        self.voxels[filling as usize].get(scene, object, detail, control, |tolerance| {
            let resolution = detail.max_resolution;
            let mut model = voxelize::voxelize(scene, object, tolerance, resolution, filling, control)?;
            model.bound *= scale;
            note_normal_maps(&mut model.why, scene, object);
            Ok(model)
        })
    }

    /// Returns the shape of an object as signed distances. Shapes that are not meshes go through triangles; the
    /// bounds add up.
    ///
    /// # Errors
    /// When the shape has no surface at all, or the host cancelled.
    pub fn distance(
        &self,
        scene: &Scene,
        object: &Object,
        detail: Detail,
        control: &Control<'_>,
    ) -> Result<Arc<DistanceModel>, ConvertError> {
        let scale = scale_of(object);
        let half = Detail { tolerance: detail.tolerance * 0.5, ..detail };
        let surface = self.mesh(scene, object, half, control)?;
        self.distances.get(scene, object, detail, control, |tolerance| {
            let mut model =
                distance::of_mesh(scene, object, &surface.mesh, tolerance, detail.max_resolution, control)?;
            model.bound = model.bound * scale + surface.bound;
            note_normal_maps(&mut model.why, scene, object);
            Ok(model)
        })
    }

    /// Tells what [`Converter::mesh`] would make.
    #[must_use]
    pub fn mesh_forecast(&self, scene: &Scene, object: &Object, detail: Detail) -> Forecast {
        if let Some(model) = self.meshes.find(scene, object, detail) {
            let mesh = &model.mesh;
            return Forecast {
                bytes: mesh.bytes(),
                bound: model.bound,
                builds: model.why.clone(),
                triangles: mesh.triangles.len() as u64,
                vertices: mesh.positions.len() as u64,
            };
        }
        let scale = scale_of(object);
        let Ok((size, bound)) = mesh_size(scene, object, detail, &Control::simple()) else {
            unreachable!("nobody can stop it")
        };
        let bytes = size.vertices * size.each[0] + size.triangles * size.each[1];
        Forecast {
            bytes: bytes as u64,
            bound: bound * scale,
            builds: format!("{}{:.0} triangles", if size.is_exact { "" } else { "about " }, size.triangles),
            triangles: size.triangles as u64,
            vertices: size.vertices as u64,
        }
    }

    /// Tells what [`Converter::voxels`] would make.
    #[must_use]
    pub fn voxels_forecast(&self, scene: &Scene, object: &Object, detail: Detail) -> Forecast {
        if let Some(model) = self.voxels[Filling::Natural as usize].find(scene, object, detail) {
            return Forecast::of_grid(model.voxels.bytes(), model.bound, model.why.clone());
        }
        let scale = scale_of(object);
        let tolerance = detail.in_object(object);
        let (size, cell) = voxelize::grid_size(&object.shape.bounds(), tolerance, detail.max_resolution);
        let grid = voxelize::Grid::around(&object.shape.bounds(), size, cell);
        let bytes = chunks::taken(scene, object, &grid) * u64::from(crate::scene::CHUNK).pow(3);
        let [x, y, z] = size;
        Forecast::of_grid(bytes, cell * 3f64.sqrt() * scale, format!("{x}x{y}x{z} voxels"))
    }

    /// Tells what [`Converter::distance`] would make.
    #[must_use]
    pub fn distance_forecast(&self, scene: &Scene, object: &Object, detail: Detail) -> Forecast {
        if let Some(model) = self.distances.find(scene, object, detail) {
            let bytes = model.distances.len() as u64 * 5;
            return Forecast::of_grid(bytes, model.bound, model.why.clone());
        }
        let scale = scale_of(object);
        let tolerance = detail.in_object(object);
        // The grid lies around the triangles that it is made of: cells that are empty have none.
        let bounds = match &*object.shape {
            Shape::Voxels(voxels) => voxels.filled_bounds(),
            shape => shape.bounds(),
        };
        let (size, step) = distance::grid_size(&bounds, tolerance, detail.max_resolution);
        let bytes = size.iter().map(|&s| u64::from(s)).product::<u64>() * 5;
        let [x, y, z] = size;
        Forecast::of_grid(bytes, distance::bound(step) * scale, format!("{x}x{y}x{z} signed distances"))
    }
}

/// Tells how large a shape would be as triangles, and how far from it, in object space.
fn mesh_size(
    scene: &Scene,
    object: &Object,
    detail: Detail,
    control: &Control<'_>,
) -> Result<(MeshSize, f64), Cancelled> {
    let tolerance = detail.in_object(object);
    Ok(match &*object.shape {
        Shape::Mesh(mesh) => {
            let (vertices, triangles) = (mesh.positions.len() as f64, mesh.triangles.len() as f64);
            (MeshSize { vertices, triangles, is_exact: true, ..MeshSize::default() }, 0.0)
        }
        Shape::Primitive(primitive) => primitive_mesh::forecast(primitive, tolerance),
        Shape::Voxels(voxels) => (voxel_mesh::forecast(voxels, &clear_values(scene, object)), 0.0),
        Shape::FreeForm(form) => {
            field_mesh::forecast(form, tolerance, detail.max_resolution.min(field_mesh::FINEST), control)?
        }
        Shape::HeightField(field) => height_mesh::forecast(field, tolerance, control)?,
        Shape::Volume(volume) => {
            (field_mesh::forecast_of_volume(volume, control)?, volume.spacing().length())
        }
    })
}

/// Says that normal maps are lost, if there are any.
fn note_normal_maps(why: &mut String, scene: &Scene, object: &Object) {
    if (0..object.materials.len()).any(|slot| scene.material(object, slot).normal_map.is_some()) {
        why.push_str(", without its normal maps");
    }
}

/// Returns the largest factor by which the object's transform stretches a length.
fn scale_of(object: &Object) -> f64 {
    let m = object.world_from_object.matrix3;
    // The Frobenius norm bounds the spectral norm; for rotations with uniform scale it is sqrt(3) of it, so
    // the exact largest singular value is found by a few power iterations instead.
    let square = m.transpose() * m;
    let mut v = DVec3::new(0.6, 0.5, 0.4);
    for _ in 0..64 {
        v = (square * v).normalize_or(DVec3::X);
    }
    let scale = (square * v).length().sqrt();
    if scale > 0.0 && scale.is_finite() { scale } else { 1.0 }
}

/// Returns the size of an object's shape, in object space: 1 where it has none.
fn extent_of(object: &Object) -> f64 {
    let size = object.shape.bounds().radius();
    if size > 0.0 && size.is_finite() { size } else { 1.0 }
}

/// Tells for each palette byte whether light passes through.
fn clear_values(scene: &Scene, object: &Object) -> [bool; 256] {
    std::array::from_fn(|v| v == 0 || scene.material(object, v - 1).is_see_through())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Primitive;

    fn ball() -> (Scene, Object) {
        let object = Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), 0);
        (Scene::default(), object)
    }

    #[test]
    fn the_same_class_is_converted_once_and_shared() {
        let (scene, object) = ball();
        let converter = Converter::default();
        let get = |object: &Object, tolerance: f64| {
            converter
                .mesh(&scene, object, Detail { tolerance, max_resolution: 64 }, &Control::simple())
                .unwrap()
        };
        assert!(Arc::ptr_eq(&get(&object, 0.0101), &get(&object.clone(), 0.0105)));
        assert!(!Arc::ptr_eq(&get(&object, 0.01), &get(&object, 0.001)));
        assert!(get(&object, 0.01).bound <= 0.01);
    }

    #[test]
    fn forecasts_are_what_is_made_then() {
        let scene = Scene::default();
        let heights = (0..24 * 17).map(|i| (f64::from(i % 24) * 0.4).sin() as f32).collect();
        let form = |center: f64| crate::scene::Form::Ellipsoid {
            center: DVec3::X * center,
            radii: DVec3::new(1.0, 0.7, 0.8),
        };
        let union = crate::scene::Form::Union(vec![form(0.0), form(0.9)]);
        let ball = |x: u32, y: u32, z: u32| {
            let p = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - 11.5;
            u8::from(p.length() < 11.0)
        };
        // Share by which bytes may be off: what has a formula is exact, what must be found on a grid is not.
        let shapes: Vec<(Shape, f64)> = vec![
            (Shape::Primitive(Primitive::Sphere { radius: 1.0 }), 0.0),
            (Shape::Primitive(Primitive::Torus { major: 1.0, minor: 0.3 }), 0.0),
            (Shape::Primitive(Primitive::Cylinder { radius: 1.0, height: 2.0 }), 0.0),
            (Shape::Primitive(Primitive::Cone { radius: 1.0, height: 2.0 }), 0.0),
            (Shape::Primitive(Primitive::Box { size: DVec3::ONE }), 0.0),
            (Shape::Primitive(Primitive::Plane { width: 1.0, depth: 2.0 }), 0.0),
            (Shape::Primitive(Primitive::prism(7, 1.0, 2.0)), 0.0),
            (
                Shape::Primitive(Primitive::Frustum {
                    sides: 5,
                    lower_radius: 1.0,
                    upper_radius: 0.0,
                    height: 2.0,
                }),
                0.0,
            ),
            (
                Shape::HeightField(
                    crate::scene::HeightField::new(24, 17, glam::DVec2::ONE, heights).unwrap(),
                ),
                0.0,
            ),
            (Shape::Voxels(Voxels::from_fn([24; 3], ball)), 0.02),
            (Shape::FreeForm(crate::scene::FreeForm::new(union).unwrap()), 0.1),
        ];
        for (shape, slack) in shapes {
            let object = Object::new("thing", shape, 0);
            for tolerance in [0.05, 0.004] {
                let detail = Detail { tolerance, max_resolution: 256 };
                let planned = Converter::default().mesh_forecast(&scene, &object, detail);
                let made = Converter::default().mesh(&scene, &object, detail, &Control::simple()).unwrap();
                let off = planned.bytes as f64 / made.mesh.bytes() as f64 - 1.0;
                assert!(off.abs() <= slack, "{:?} at {tolerance}: {off}", object.shape.kind());
            }
        }
    }

    #[test]
    fn tolerance_is_meant_in_world_space() {
        let (scene, mut object) = ball();
        let converter = Converter::default();
        let detail = Detail { tolerance: 0.01, max_resolution: 64 };
        let small = converter.mesh(&scene, &object, detail, &Control::simple()).unwrap();
        object.world_from_object = DAffine3::from_scale(DVec3::splat(100.0));
        let large = converter.mesh(&scene, &object, detail, &Control::simple()).unwrap();
        assert!(large.bound <= 0.01, "{}", large.bound);
        assert!(large.mesh.triangles.len() > 20 * small.mesh.triangles.len());
    }

    #[test]
    fn the_same_body_in_other_units_becomes_the_same_triangles() {
        let (scene, object) = ball();
        let converter = Converter::default();
        let triangles = |unit: f64| {
            let mut object = object.clone();
            object.world_from_object = DAffine3::from_scale(DVec3::splat(unit));
            let detail = Detail { tolerance: 0.0123 * unit, max_resolution: 64 };
            let model = converter.mesh(&scene, &object, detail, &Control::simple()).unwrap();
            assert!(model.bound <= 0.0123 * unit);
            model.mesh.positions.clone()
        };
        let meters = triangles(1.0);
        for power in -12..=12 {
            assert!(triangles(10f64.powi(power)) == meters, "10^{power}");
        }
    }

    #[test]
    fn what_cannot_be_drawn_cannot_be_converted() {
        let (scene, mut object) = ball();
        object.world_from_object = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
        let error = Converter::default()
            .mesh(&scene, &object, Detail { tolerance: 0.1, max_resolution: 8 }, &Control::simple())
            .unwrap_err();
        assert_eq!(error.to_string(), "ball: its transform squeezes it to nothing");
    }
}
