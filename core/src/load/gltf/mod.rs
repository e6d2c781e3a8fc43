//! Reads glTF 2.0, as JSON with files beside it or as one `.glb`.
//!
//! The document is read with own types and not with the crate `gltf`: that one follows references out of the folder,
//! panics on damaged files, does not notice loops, and refuses quantized meshes. What is read: meshes of every mode,
//! sparse and normalized accessors, base color textures with transforms and wrap modes, vertex colors, materials (see
//! [`material`]), cameras, punctual lights. Skins, morph targets and animations are left out, with a note: the model
//! stands as it was bound.

mod check;
mod container;
mod data;
mod document;
mod material;
mod mesh;
mod nodes;

use super::error::Fault;
use super::source::Source;
use crate::scene::Scene;
use data::Data;
use material::Materials;
use mesh::MeshBuilder;

/// Loads a glTF file.
pub(super) fn load(source: &mut Source<'_>) -> Result<Scene, Fault> {
    let bytes = std::mem::take(&mut source.bytes);
    let (json, binary) = container::split(&bytes)?;
    let document = container::parse(json)?;
    check::check(&document)?;
    let binary = binary.map(<[u8]>::to_vec);
    drop(bytes);
    let data = Data::read(&document, binary, source)?;
    let mut materials = Materials::new(&document, &data, source);
    let mut builder = MeshBuilder { document: &document, data: &data, vertices: 0, triangles: 0 };
    let mut meshes = Vec::new();
    for index in 0..document.meshes.len() {
        meshes.push(builder.build(index, &mut materials, source)?);
    }
    let mut scene = materials.scene;
    for (index, world_from_node) in nodes::placed_nodes(&document) {
        let node = &document.nodes[index];
        if let Some(mesh) = node.mesh.and_then(|m| meshes[m].as_ref()) {
            nodes::add_object(&mut scene, node, mesh, format!("node {index}"), world_from_node, source)?;
        }
        if let Some(reference) = &node.extensions.light {
            let light = &document.extensions.lights.lights[reference.light];
            nodes::add_light(&mut scene, light, &world_from_node, source);
        }
        if let Some(camera) = node.camera {
            let name = node.name.clone().unwrap_or_else(|| format!("camera {camera}"));
            let entry = &document.cameras[camera];
            if !nodes::add_camera(&mut scene, entry, super::error::one_line(&name), &world_from_node) {
                source.notes.add(format!("camera {camera} is left out: its values make no sense"));
            }
        }
    }
    nodes::expose(&mut scene, source);
    if !document.skins.is_empty() {
        source.notes.add("skins are not applied: the model stands as it was bound");
    }
    if !document.animations.is_empty() {
        source.notes.add(format!("{} animations are left out", document.animations.len()));
    }
    if scene.objects.is_empty() {
        source.notes.add("the file places no mesh");
    }
    Ok(scene)
}
