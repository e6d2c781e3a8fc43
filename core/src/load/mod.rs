//! Turns files into scenes: scene files, models, volumes and height maps.
//!
//! [`load`] takes any of them. Whatever is in a file, it ends in a [`Scene`] or in a [`LoadError`] of one line: nothing
//! panics, nothing outside of the file's folder is read, and what a header claims is compared with [`Limits`] and
//! with the bytes that are there before memory is taken. What was repaired, replaced or left out stands in
//! [`Scene::notes`].

mod error;
mod folder;
mod gltf;
mod height;
pub mod image;
mod limits;
mod notes;
mod obj;
mod ply;
mod polygon;
pub mod scene_file;
mod smooth;
mod source;
mod stl;
mod surface;
mod text;
mod volume;
mod vox;

pub use error::LoadError;
pub use limits::{Limits, LoadOptions, RawVolume, SampleFormat};
pub use scene_file::{SaveError, SceneFile, json_schema, save};

use crate::camera::{Camera, Projection};
use crate::scene::{Light, Material, Object, Scene, Shape};
use error::Fault;
use glam::DVec3;
use source::Source;
use std::path::Path;

/// Loads a scene file, a model, a volume or a height map, by the file's extension.
///
/// A file that brings no light gets one from the upper right front, and a file that brings no camera gets one named
/// `default` that sees everything.
///
/// # Errors
/// When the file cannot be read, is damaged, needs something that is not read here, or exceeds a limit; the message is
/// one line that names the file, what is wrong and where, and what to do.
///
/// # Example
/// ```
/// use polyptych_core::load::{LoadOptions, load};
/// let path = std::env::temp_dir().join("polyptych-doc-triangle.obj");
/// std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
/// let scene = load(&path, &LoadOptions::default()).unwrap();
/// assert_eq!((scene.objects.len(), scene.lights.len(), scene.cameras.len()), (1, 1, 1));
/// ```
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, LoadError> {
    let read = reader_of(&extension_of(path), options).map_err(|fault| fault.in_file(path))?;
    let mut source = Source::open(path, options, folder::read_file(path, options.limits.file_bytes)?);
    let mut scene = read(&mut source).map_err(|fault| fault.in_file(path))?;
    scene.notes.extend(source.notes.into_lines());
    if scene.name.is_empty() {
        scene.name = source.name;
    }
    add_default_view(&mut scene);
    Ok(scene)
}

/// Adds a light to a scene that has none, and a camera named `default` that sees everything to one that has none.
pub fn add_default_view(scene: &mut Scene) {
    if scene.lights.is_empty() {
        let from_upper_right_front = DVec3::new(-0.5, -0.8, -0.6);
        scene.lights.push(Light { intensity: 0.9, ..Light::directional(from_upper_right_front) });
    }
    if scene.cameras.is_empty() {
        let projection = Projection::Perspective { fov_y: 0.7 };
        let camera = Camera::framing(&scene.bounds(), 0.6, 0.35, 16.0 / 9.0, projection);
        scene.cameras.push(("default".to_owned(), camera));
    }
}

/// Makes a scene of one mesh.
fn scene_of_mesh(mesh: surface::RawMesh, source: &mut Source<'_>) -> Scene {
    let mut scene = Scene::default();
    if mesh.triangles.is_empty() && mesh.segments.is_empty() {
        source.notes.add("the file has no faces");
        return scene;
    }
    let (mesh, world_from_object) = mesh.finish(&source.name, &mut source.notes);
    let material = scene.add_material(Material::default());
    let object = Object::new(source.name.clone(), Shape::Mesh(mesh), material);
    scene.objects.push(object.placed(world_from_object));
    scene
}

type Reader = fn(&mut Source<'_>) -> Result<Scene, Fault>;

fn extension_of(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if extension == "gz" && stem.ends_with(".nii") { "nii.gz".to_owned() } else { extension }
}

fn reader_of(extension: &str, options: &LoadOptions) -> Result<Reader, Fault> {
    Ok(match extension {
        "ron" | "json" => scene_file::load,
        "obj" => obj::load,
        "gltf" | "glb" => gltf::load,
        "stl" => stl::load,
        "ply" => ply::load,
        "vox" => vox::load,
        "nrrd" | "nhdr" | "nii" | "nii.gz" | "raw" => volume::load,
        "png" | "tif" | "tiff" | "jpg" | "jpeg" | "bmp" | "tga" | "gif" | "hdr" | "exr"
            if options.height_map =>
        {
            height::load
        }
        "png" | "tif" | "tiff" | "jpg" | "jpeg" | "bmp" | "tga" | "gif" | "hdr" | "exr" => {
            let what = "a picture is no scene by itself";
            return Err(Fault::unsupported(what, "ask for it as a height map (`--height-map`)"));
        }
        other => return Err(unknown(other)),
    })
}

fn unknown(extension: &str) -> Fault {
    let what = match extension {
        "" => "has no extension that says what it is".to_owned(),
        other => format!("files `.{other}` are not read"),
    };
    Fault::unsupported(
        what,
        "give .ron .json .obj .gltf .glb .stl .ply .vox .nrrd .nhdr .nii .nii.gz, .raw with a size, or a picture as height map",
    )
}
