//! Checks that every index of a glTF document points at something, and that its nodes are trees.

use super::document::Document;
use crate::load::error::Fault;

/// Checks all references between the lists of a document.
pub(super) fn check(d: &Document) -> Result<(), Fault> {
    let points = |index: usize, count: usize, what: &str, place: &dyn Fn() -> String| {
        if index < count {
            return Ok(());
        }
        Err(Fault::malformed(format!("{}: there is no {what} {index} (of {count})", place())))
    };
    if let Some(scene) = d.scene {
        points(scene, d.scenes.len(), "scene", &|| "scene".to_owned())?;
    }
    for (i, scene) in d.scenes.iter().enumerate() {
        for &node in &scene.nodes {
            points(node, d.nodes.len(), "node", &|| format!("scenes[{i}]"))?;
        }
    }
    for (i, node) in d.nodes.iter().enumerate() {
        let place = || format!("nodes[{i}]");
        for &child in &node.children {
            points(child, d.nodes.len(), "node", &place)?;
        }
        let light = node.extensions.light.as_ref().map(|l| l.light);
        for (index, count, what) in [
            (node.mesh, d.meshes.len(), "mesh"),
            (node.camera, d.cameras.len(), "camera"),
            (light, d.extensions.lights.lights.len(), "light"),
        ] {
            index.map_or(Ok(()), |index| points(index, count, what, &place))?;
        }
    }
    for (i, mesh) in d.meshes.iter().enumerate() {
        for (j, primitive) in mesh.primitives.iter().enumerate() {
            let place = || format!("meshes[{i}].primitives[{j}]");
            for &accessor in primitive.attributes.values().chain(primitive.indices.iter()) {
                points(accessor, d.accessors.len(), "accessor", &place)?;
            }
            primitive.material.map_or(Ok(()), |m| points(m, d.materials.len(), "material", &place))?;
        }
    }
    check_materials(d, &points)?;
    for (i, accessor) in d.accessors.iter().enumerate() {
        let sparse = accessor.sparse.iter().flat_map(|s| [s.indices.buffer_view, s.values.buffer_view]);
        for view in accessor.buffer_view.into_iter().chain(sparse) {
            points(view, d.buffer_views.len(), "bufferView", &|| format!("accessors[{i}]"))?;
        }
    }
    for (i, view) in d.buffer_views.iter().enumerate() {
        points(view.buffer, d.buffers.len(), "buffer", &|| format!("bufferViews[{i}]"))?;
    }
    check_trees(d)
}

type Points<'a> = dyn Fn(usize, usize, &str, &dyn Fn() -> String) -> Result<(), Fault> + 'a;

fn check_materials(d: &Document, points: &Points<'_>) -> Result<(), Fault> {
    for (i, m) in d.materials.iter().enumerate() {
        let pbr = &m.pbr_metallic_roughness;
        let textures = [
            &pbr.base_color_texture,
            &pbr.metallic_roughness_texture,
            &m.emissive_texture,
            &m.normal_texture,
            &m.occlusion_texture,
        ];
        for texture in textures.into_iter().flatten() {
            points(texture.index, d.textures.len(), "texture", &|| format!("materials[{i}]"))?;
        }
    }
    for (i, texture) in d.textures.iter().enumerate() {
        let place = || format!("textures[{i}]");
        texture.source.map_or(Ok(()), |s| points(s, d.images.len(), "image", &place))?;
        texture.sampler.map_or(Ok(()), |s| points(s, d.samplers.len(), "sampler", &place))?;
    }
    for (i, image) in d.images.iter().enumerate() {
        let view = image.buffer_view;
        view.map_or(Ok(()), |v| points(v, d.buffer_views.len(), "bufferView", &|| format!("images[{i}]")))?;
    }
    Ok(())
}

/// Each node has one parent at most, and none is below itself: walked as trees the nodes end.
fn check_trees(d: &Document) -> Result<(), Fault> {
    let mut has_parent = vec![false; d.nodes.len()];
    for (i, node) in d.nodes.iter().enumerate() {
        for &child in &node.children {
            if std::mem::replace(&mut has_parent[child], true) {
                let what = format!("nodes[{i}].children: node {child} already has a parent");
                return Err(Fault::malformed(what));
            }
        }
    }
    let mut reached = 0;
    let mut open: Vec<usize> = (0..d.nodes.len()).filter(|&i| !has_parent[i]).collect();
    while let Some(node) = open.pop() {
        reached += 1;
        open.extend(&d.nodes[node].children);
    }
    if reached < d.nodes.len() {
        let what = format!("nodes: {} nodes are below themselves", d.nodes.len() - reached);
        return Err(Fault::malformed(what));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check_json(json: &str) -> Result<(), String> {
        check(&serde_json::from_str(json).unwrap()).map_err(|fault| fault.what())
    }

    #[test]
    fn loops_shared_children_and_missing_things_are_found() {
        for (json, message) in [
            (r#"{"nodes":[{"children":[0]}]}"#, "nodes: 1 nodes are below themselves"),
            (r#"{"nodes":[{"children":[1]},{"children":[0]}]}"#, "nodes: 2 nodes are below themselves"),
            (r#"{"nodes":[{"children":[1,1]},{}]}"#, "nodes[0].children: node 1 already has a parent"),
            (r#"{"nodes":[{"mesh":3}]}"#, "nodes[0]: there is no mesh 3 (of 0)"),
            (r#"{"scene":1,"scenes":[{}]}"#, "scene: there is no scene 1 (of 1)"),
        ] {
            assert_eq!(check_json(json).unwrap_err(), message);
        }
        assert_eq!(check_json(r#"{"nodes":[{"children":[1,2]},{},{}]}"#), Ok(()));
    }
}
