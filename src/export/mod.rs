//! How is a scene written as a model of one representation: triangles, voxels or distances?

mod vox;

use crate::convert::{ConvertError, Converter, Detail, DistanceModel, Filling};
use crate::math::Aabb;
use crate::picture::write_whole;
use crate::scene::{Material, Mesh, Object, Scene, Shape};
use crate::seam::Control;
use glam::Vec3;
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// What was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// For people: `"1,280 triangles"`.
    pub what: String,
    /// Bound on the distance between the surfaces, meters.
    pub bound: f64,
    /// What was left out, a line each.
    pub notes: Vec<String>,
}

/// Why nothing was written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}: {reason}", path.display())]
pub struct ExportError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub reason: String,
}

/// Converts a scene into one model and writes it; the extension chooses the format: `.obj` and `.glb` hold
/// triangles, `.vox` voxels, filled as `filling` says, `.nrrd` signed distances.
///
/// # Errors
/// When the extension is unknown, nothing can be converted, a limit of the format is passed, or the file
/// cannot be written.
pub fn export(
    scene: &Scene,
    path: &Path,
    detail: Detail,
    filling: Filling,
    converter: &Converter,
    control: &Control<'_>,
) -> Result<Exported, ExportError> {
    let refuse = |reason: String| ExportError { path: path.to_owned(), reason };
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let (bytes, exported) = match extension.as_str() {
        "obj" | "glb" => {
            let merged = Merged::of(scene, detail, converter, control).map_err(&refuse)?;
            let Shape::Mesh(mesh) = &*merged.object().shape else {
                return Err(refuse("no triangles".to_owned()));
            };
            let what = format!("{} triangles", mesh.triangles.len());
            let bytes = if extension == "obj" { obj(mesh, &merged.scene) } else { glb(mesh, &merged.scene) };
            (bytes, Exported { what, bound: merged.bound, notes: merged.notes })
        }
        "vox" => {
            let (grids, bound, notes) =
                voxel_scene(scene, detail, filling, converter, control).map_err(&refuse)?;
            let (bytes, what) = vox::written(&grids).map_err(&refuse)?;
            (bytes, Exported { what, bound, notes })
        }
        "nrrd" => {
            let merged = Merged::of(scene, detail, converter, control).map_err(&refuse)?;
            let model = converter
                .distance(&merged.scene, merged.object(), detail, control)
                .map_err(|e| refuse(e.to_string()))?;
            let bound = merged.bound + model.bound;
            (nrrd(&model), Exported { what: model.why.clone(), bound, notes: merged.notes })
        }
        _ => {
            let all = "use .obj or .glb for triangles, .vox for voxels, .nrrd for distances";
            return Err(refuse(format!("no model format is called `{extension}`: {all}")));
        }
    };
    write_whole(path, &bytes).map_err(|e| refuse(format!("cannot be written: {e}")))?;
    Ok(exported)
}

/// All objects of a scene as one object of triangles in world space.
struct Merged {
    scene: Scene,
    bound: f64,
    notes: Vec<String>,
}

impl Merged {
    fn of(
        scene: &Scene,
        detail: Detail,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Self, String> {
        let mut mesh = Mesh::default();
        let (mut bound, mut notes) = (0.0_f64, Vec::new());
        for object in scene.objects.iter().filter(|o| o.visible) {
            match converter.mesh(scene, object, detail, control) {
                Ok(model) => {
                    bound = bound.max(model.bound);
                    append(&mut mesh, &model.mesh, object);
                }
                Err(stopped @ ConvertError::Cancelled) => return Err(stopped.to_string()),
                Err(error) => notes.push(error.to_string()),
            }
        }
        if mesh.triangles.is_empty() {
            return Err(notes.pop().unwrap_or_else(|| "the scene has no visible surface".to_owned()));
        }
        let mut object = Object::new(scene.name.clone(), Shape::Mesh(mesh), 0);
        object.materials = (0..scene.materials.len().max(1)).collect();
        let merged = Scene {
            name: scene.name.clone(),
            objects: vec![object],
            materials: scene.materials.clone(),
            textures: scene.textures.clone(),
            ..Scene::default()
        };
        Ok(Self { scene: merged, bound, notes })
    }

    fn object(&self) -> &Object {
        &self.scene.objects[0]
    }
}

/// Appends a mesh placed by its object; slots become indices of the scene's materials.
fn append(target: &mut Mesh, mesh: &Mesh, object: &Object) {
    let first = target.positions.len() as u32;
    let normal_map = object.world_from_object.matrix3.inverse().transpose();
    let flip = object.world_from_object.matrix3.determinant() < 0.0;
    for i in 0..mesh.positions.len() {
        let p = object.world_from_object.transform_point3(mesh.positions[i].as_dvec3());
        target.positions.push(p.as_vec3());
        // All arrays are filled, so that meshes with and without an attribute can be joined.
        let normal = mesh
            .normals
            .get(i)
            .map_or(Vec3::ZERO, |n| (normal_map * n.as_dvec3()).normalize_or_zero().as_vec3());
        target.normals.push(normal);
        target.uvs.push(mesh.uvs.get(i).copied().unwrap_or_default());
        target.colors.push(mesh.colors.get(i).copied().unwrap_or(Vec3::ONE));
    }
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|i| i + first);
        target.triangles.push(if flip { [a, c, b] } else { [a, b, c] });
        target.slots.push(object.material_in_slot(mesh.slot(t)).min(usize::from(u16::MAX)) as u16);
    }
    fill_missing_normals(target, first as usize);
}

/// Gives vertices without a normal that of a face they belong to.
fn fill_missing_normals(mesh: &mut Mesh, from: usize) {
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t);
        let flat = (b - a).cross(c - a).normalize_or_zero();
        for i in mesh.triangles[t].map(|i| i as usize).into_iter().filter(|&i| i >= from) {
            if mesh.normals[i] == Vec3::ZERO {
                mesh.normals[i] = flat;
            }
        }
    }
}

/// Turns a scene into grids. Grids that lie in one lattice are kept as they are; everything else is joined to one
/// grid.
fn voxel_scene(
    scene: &Scene,
    detail: Detail,
    filling: Filling,
    converter: &Converter,
    control: &Control<'_>,
) -> Result<(Scene, f64, Vec<String>), String> {
    if vox::is_lattice(scene) {
        return Ok((scene.clone(), 0.0, Vec::new()));
    }
    let merged = Merged::of(scene, detail, converter, control)?;
    let model = converter
        .voxels_filled(&merged.scene, merged.object(), detail, filling, control)
        .map_err(|e| e.to_string())?;
    let mut object = Object::new(scene.name.clone(), Shape::Voxels(model.voxels.clone()), 0);
    object.materials = (0..model.palette.len()).collect();
    let joined = Scene { objects: vec![object], materials: model.palette.clone(), ..Scene::default() };
    let mut notes = merged.notes;
    notes.push(model.why.clone());
    Ok((joined, merged.bound + model.bound, notes))
}

/// Writes Wavefront OBJ with vertex colors instead of a material library.
fn obj(mesh: &Mesh, scene: &Scene) -> Vec<u8> {
    let mut text = String::from("# triangles in meters, y up; colors are linear\n");
    let colors = vertex_colors(mesh, scene);
    for (p, c) in mesh.positions.iter().zip(&colors) {
        let _ = writeln!(text, "v {} {} {} {:.4} {:.4} {:.4}", p.x, p.y, p.z, c.x, c.y, c.z);
    }
    for uv in &mesh.uvs {
        let _ = writeln!(text, "vt {} {}", uv.x, 1.0 - uv.y);
    }
    for n in &mesh.normals {
        let _ = writeln!(text, "vn {:.6} {:.6} {:.6}", n.x, n.y, n.z);
    }
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| i + 1);
        let _ = writeln!(text, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}");
    }
    text.into_bytes()
}

/// Returns the color of each vertex: its own times that of the material of the last face that uses it.
fn vertex_colors(mesh: &Mesh, scene: &Scene) -> Vec<Vec3> {
    let mut colors = mesh.colors.clone();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let material = scene.materials.get(mesh.slot(t)).unwrap_or(Material::fallback());
        for i in triangle.map(|i| i as usize) {
            colors[i] = mesh.colors[i] * material.base_color;
        }
    }
    colors
}

/// Writes binary glTF 2.0: one primitive with positions, normals and vertex colors.
fn glb(mesh: &Mesh, scene: &Scene) -> Vec<u8> {
    let mut data = Vec::new();
    let mut views = Vec::new();
    let mut view = |data: &mut Vec<u8>, bytes: Vec<u8>, target: u32| {
        views.push(
            json!({"buffer": 0, "byteOffset": data.len(), "byteLength": bytes.len(), "target": target}),
        );
        data.extend(bytes);
    };
    let floats = |list: &[Vec3]| {
        list.iter().flat_map(glam::Vec3::to_array).flat_map(f32::to_le_bytes).collect::<Vec<u8>>()
    };
    view(&mut data, floats(&mesh.positions), 34962);
    view(&mut data, floats(&mesh.normals), 34962);
    view(&mut data, floats(&vertex_colors(mesh, scene)), 34962);
    view(&mut data, mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect(), 34963);
    let bounds = Aabb::of_points(mesh.positions.iter().map(|p| p.as_dvec3()));
    let (count, indices) = (mesh.positions.len(), mesh.triangles.len() * 3);
    let vectors =
        |view: u32| json!({"bufferView": view, "componentType": 5126, "count": count, "type": "VEC3"});
    let mut positions = vectors(0);
    positions["min"] = json!(bounds.min.as_vec3().to_array());
    positions["max"] = json!(bounds.max.as_vec3().to_array());
    let document = json!({
        "asset": {"version": "2.0", "generator": "polyptych"},
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": scene.name}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}, "indices": 3, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.6}, "doubleSided": true}],
        "accessors": [positions, vectors(1), vectors(2), {"bufferView": 3, "componentType": 5125, "count": indices, "type": "SCALAR"}],
        "bufferViews": views, "buffers": [{"byteLength": data.len()}],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    data.resize(data.len().next_multiple_of(4), 0);
    let length = |n: usize| (n as u32).to_le_bytes();
    let mut file = Vec::new();
    file.extend(b"glTF");
    file.extend(2u32.to_le_bytes());
    file.extend(length(12 + 8 + text.len() + 8 + data.len()));
    file.extend(length(text.len()));
    file.extend(b"JSON");
    file.extend(text);
    file.extend(length(data.len()));
    file.extend(b"BIN\0");
    file.extend(data);
    file
}

/// Writes nearly raw raster data: signed distances as 32-bit floats, x fastest.
fn nrrd(model: &DistanceModel) -> Vec<u8> {
    let ([x, y, z], step) = (model.size, model.step);
    let mut bytes = format!(
        "NRRD0004\n# signed distances in meters, positive inside; first sample at {} {} {}\n\
         type: float\ndimension: 3\nsizes: {x} {y} {z}\nspacings: {step} {step} {step}\n\
         endian: little\nencoding: raw\n\n",
        model.first.x, model.first.y, model.first.z
    )
    .into_bytes();
    bytes.extend(model.distances.iter().flat_map(|d| d.to_le_bytes()));
    bytes
}
