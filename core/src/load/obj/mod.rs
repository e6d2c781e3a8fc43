//! Makes a scene of a Wavefront OBJ file with its material libraries and textures.

mod mtl;
mod parts;
mod read;
mod statements;

use super::error::{Fault, one_line};
use super::image::{Holds, TextureMaker};
use super::source::Source;
use crate::scene::{Material, NormalMap, Object, Scene, Shape};
use mtl::{LibraryMaterial, TextureReference};
use std::collections::HashMap;
use std::sync::Arc;

/// Loads an OBJ file.
pub(in crate::load) fn load(source: &mut Source<'_>) -> Result<Scene, Fault> {
    let file = read::read(&source.bytes, source.limits, &mut source.notes)?;
    source.bytes = Vec::new();
    let mut materials = MaterialTable::default();
    for library in &file.libraries {
        materials.add_library(library, source);
    }
    let mut scene = Scene::default();
    let mut textures = TextureMaker::new(source.limits);
    for part in file.parts {
        let name = if part.name.is_empty() { source.name.clone() } else { part.name };
        let slots = part.materials.iter();
        let materials: Vec<usize> =
            slots.map(|m| materials.material(m.as_deref(), &mut scene, &mut textures, source)).collect();
        let (mesh, world_from_object) = part.mesh.finish(&name, &mut source.notes);
        let shape = Arc::new(Shape::Mesh(mesh));
        scene.objects.push(Object {
            name,
            shape,
            world_from_object,
            materials,
            visible: true,
            required: false,
        });
    }
    if scene.objects.is_empty() {
        source.notes.add("the file has no faces and no lines");
    }
    Ok(scene)
}

/// Splits the argument of `mtllib`: one name with spaces if there is such a file, else several; `\\ ` is a space.
fn library_files(argument: &str, source: &Source<'_>) -> Vec<String> {
    let unescaped = argument.replace("\\ ", " ");
    for whole in [argument, &unescaped] {
        if source.folder.find(whole).is_ok() {
            return vec![whole.to_owned()];
        }
    }
    let joined = argument.replace("\\ ", "\0");
    joined.split_whitespace().take(64).map(|file| file.replace('\0', " ")).collect()
}

/// The materials of all libraries, put into the scene when they are first used.
#[derive(Default)]
struct MaterialTable {
    entries: HashMap<String, LibraryMaterial>,
    placed: HashMap<Option<String>, usize>,
    textures: HashMap<(TextureReference, Holds), usize>,
}

impl MaterialTable {
    /// Reads the libraries that one `mtllib` statement names.
    fn add_library(&mut self, argument: &str, source: &mut Source<'_>) {
        for file in library_files(argument, source) {
            let read = source.folder.read(&file).and_then(|bytes| mtl::read(&bytes, &mut source.notes));
            match read {
                Ok(list) => {
                    for entry in list {
                        self.entries.entry(entry.name.clone()).or_insert(entry);
                    }
                }
                Err(fault) => source.notes.add(format!("material library left out: {}", fault.what())),
            }
        }
    }

    fn material(
        &mut self,
        name: Option<&str>,
        scene: &mut Scene,
        textures: &mut TextureMaker<'_>,
        source: &mut Source<'_>,
    ) -> usize {
        let key = name.map(str::to_owned);
        if let Some(&known) = self.placed.get(&key) {
            return known;
        }
        let material = match name.and_then(|n| self.entries.get(n)) {
            Some(entry) => {
                let mut material = entry.material.clone();
                let (color, normals) = (entry.texture.clone(), entry.normals.clone());
                if let Some(reference) = color {
                    material.texture =
                        Some(self.texture((reference, Holds::Colors), scene, textures, source));
                }
                if let Some(reference) = normals {
                    let texture = self.texture((reference, Holds::Data), scene, textures, source);
                    material.normal_map = Some(NormalMap { texture, scale: 1.0 });
                }
                material
            }
            None => {
                if let Some(name) = name {
                    source.notes.add(format!("material `{name}` is in no library, a plain one is taken"));
                }
                Material { name: name.map(one_line).unwrap_or_default(), ..Material::default() }
            }
        };
        let index = scene.add_material(material);
        self.placed.insert(key, index);
        index
    }

    fn texture(
        &mut self,
        asked: (TextureReference, Holds),
        scene: &mut Scene,
        textures: &mut TextureMaker<'_>,
        source: &mut Source<'_>,
    ) -> usize {
        if let Some(&known) = self.textures.get(&asked) {
            return known;
        }
        let (reference, holds) = &asked;
        let bytes = source.folder.read(&reference.file);
        let name = one_line(&reference.file);
        let texture = textures.make(&name, bytes, (reference.wrap, *holds), &mut source.notes);
        let index = scene.add_texture(texture);
        self.textures.insert(asked, index);
        index
    }
}
