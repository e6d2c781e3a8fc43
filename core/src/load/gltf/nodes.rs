//! Walks the nodes of a glTF scene and places meshes, lights and cameras. Matrices are multiplied in double precision,
//! and the walk keeps its own stack: a chain of a hundred thousand nodes is only a long list.

use super::document::{CameraEntry, Document, LightEntry, Node};
use super::mesh::Placeable;
use crate::camera::{Camera, Projection};
use crate::load::error::{Fault, one_line};
use crate::load::source::Source;
use crate::scene::{Light, LightKind, Object, Scene};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3};
use std::f32::consts::PI;

/// Returns the meshes that the scene's nodes place, in the order of the walk.
pub(super) fn placed_nodes(document: &Document) -> Vec<(usize, DAffine3)> {
    let mut open: Vec<(usize, DAffine3)> =
        roots(document).into_iter().map(|n| (n, DAffine3::IDENTITY)).rev().collect();
    // The nodes are trees, but a scene may list a node twice, or one and its child.
    let mut seen = vec![false; document.nodes.len()];
    let mut placed = Vec::new();
    while let Some((index, world_from_parent)) = open.pop() {
        if std::mem::replace(&mut seen[index], true) {
            continue;
        }
        let node = &document.nodes[index];
        let world_from_node = world_from_parent * local(node);
        open.extend(node.children.iter().rev().map(|&child| (child, world_from_node)));
        if node.mesh.is_some() || node.camera.is_some() || node.extensions.light.is_some() {
            placed.push((index, world_from_node));
        }
    }
    placed
}

/// The nodes of the scene that is shown: the default one, else the first, else all that have no parent.
fn roots(document: &Document) -> Vec<usize> {
    if let Some(scene) = document.scenes.get(document.scene.unwrap_or(0)) {
        return scene.nodes.clone();
    }
    let mut has_parent = vec![false; document.nodes.len()];
    document.nodes.iter().flat_map(|n| &n.children).for_each(|&child| has_parent[child] = true);
    (0..document.nodes.len()).filter(|&i| !has_parent[i]).collect()
}

fn local(node: &Node) -> DAffine3 {
    if let Some(matrix) = node.matrix {
        return DAffine3::from_mat4(DMat4::from_cols_array(&matrix));
    }
    let rotation = node.rotation.map(DQuat::from_array).filter(|q| q.length_squared() > 0.0);
    DAffine3::from_scale_rotation_translation(
        node.scale.map_or(DVec3::ONE, DVec3::from_array),
        rotation.map_or(DQuat::IDENTITY, DQuat::normalize),
        node.translation.map_or(DVec3::ZERO, DVec3::from_array),
    )
}

/// Places a mesh.
pub(super) fn add_object(
    scene: &mut Scene,
    node: &Node,
    mesh: &Placeable,
    name: String,
    world_from_node: DAffine3,
    source: &mut Source<'_>,
) -> Result<(), Fault> {
    if scene.objects.len() as u64 >= source.limits.instances {
        let what = format!("nodes place more than {} meshes", source.limits.instances);
        return Err(Fault::over(what, "instances"));
    }
    let name = node.name.as_deref().map(one_line).filter(|n| !n.is_empty()).unwrap_or(name);
    let world_from_object = world_from_node * mesh.mesh_from_shape;
    if !world_from_object.is_finite() {
        source.notes.add(format!("`{name}` is left out: its transform is not finite"));
        return Ok(());
    }
    scene.objects.push(Object {
        name,
        shape: mesh.shape.clone(),
        world_from_object,
        materials: mesh.materials.clone(),
        visible: true,
        required: false,
    });
    Ok(())
}

/// Places a light: it shines along -z. The unit is that of `KHR_lights_punctual` (candela, lux) by pi, since diffuse
/// surfaces here return all light and not one pi-th of it.
pub(super) fn add_light(
    scene: &mut Scene,
    entry: &LightEntry,
    world_from_node: &DAffine3,
    source: &mut Source<'_>,
) {
    let position = world_from_node.translation;
    let direction = world_from_node.transform_vector3(DVec3::NEG_Z);
    let (inner, outer) = (entry.spot.inner_cone_angle, entry.spot.outer_cone_angle);
    let color = Vec3::from_array(entry.color);
    let sound = color.is_finite()
        && color.min_element() >= 0.0
        && entry.intensity.is_finite()
        && entry.intensity >= 0.0
        && position.is_finite()
        && direction.try_normalize().is_some();
    let kind = match entry.kind.as_str() {
        "directional" => Some(LightKind::Directional { direction }),
        "point" => Some(LightKind::Point { position }),
        "spot" if 0.0 <= inner && inner < outer && outer <= std::f64::consts::FRAC_PI_2 + 1e-6 => {
            Some(LightKind::Spot { position, direction, inner, outer })
        }
        _ => None,
    };
    match kind {
        Some(kind) if sound => {
            scene.lights.push(Light { kind, color, intensity: entry.intensity / PI, casts_shadow: true });
        }
        _ => source
            .notes
            .add(format!("a light of type `{}` is left out: its values make no sense", entry.kind)),
    }
}

/// Places a camera: it looks along -z.
pub(super) fn add_camera(
    scene: &mut Scene,
    entry: &CameraEntry,
    name: String,
    world_from_node: &DAffine3,
) -> bool {
    let projection = match (&entry.perspective, &entry.orthographic) {
        (Some(p), _) if p.yfov > 0.0 && p.yfov < std::f64::consts::PI => {
            Projection::Perspective { fov_y: p.yfov }
        }
        (_, Some(o)) if o.ymag.abs() > 0.0 => Projection::Orthographic { height: 2.0 * o.ymag.abs() },
        _ => return false,
    };
    let eye = world_from_node.translation;
    let backward = world_from_node.transform_vector3(DVec3::Z).normalize_or_zero();
    let up = world_from_node.transform_vector3(DVec3::Y);
    let right = up.cross(backward).normalize_or_zero();
    let world_from_camera = DMat3::from_cols(right, backward.cross(right), backward);
    let is_frame = (world_from_camera.determinant() - 1.0).abs() < 1e-6;
    if !(eye.is_finite() && is_frame) {
        return false;
    }
    let name = entry.name.as_deref().map(one_line).filter(|n| !n.is_empty()).unwrap_or(name);
    scene.cameras.push((name, Camera { eye, world_from_camera, projection }));
    true
}

/// Brings lights in physical units into the range that is shown: their sum at the middle of the scene becomes 1,
/// where it is more than 3 or less than 0.05.
pub(super) fn expose(scene: &mut Scene, source: &mut Source<'_>) {
    let center = scene.bounds().center();
    let sum: f32 =
        scene.lights.iter().filter_map(|l| l.arriving(center)).map(|a| a.radiance.max_element()).sum();
    if sum.is_finite() && sum > 0.0 && !(0.05..=3.0).contains(&sum) {
        scene.lights.iter_mut().for_each(|l| l.intensity /= sum);
        source.notes.add(format!("lights are dimmed by {sum:.3} to be shown without an exposure"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_and_their_parts_mean_the_same() {
        let parts: Node = serde_json::from_str(
            r#"{"translation":[1,2,3],"rotation":[0,0,0.7071067811865476,0.7071067811865476],"scale":[2,3,4]}"#,
        )
        .unwrap();
        let whole: Node =
            serde_json::from_str(r#"{"matrix":[0,2,0,0, -3,0,0,0, 0,0,4,0, 1,2,3,1]}"#).unwrap();
        assert!(local(&parts).abs_diff_eq(local(&whole), 1e-12));
    }

    #[test]
    fn a_long_chain_is_walked_without_recursion() {
        let mut document = Document::default();
        for i in 0..200_000usize {
            let children = if i + 1 < 200_000 { vec![i + 1] } else { Vec::new() };
            document.nodes.push(Node { children, translation: Some([1.0, 0.0, 0.0]), ..Node::default() });
        }
        document.nodes[199_999].mesh = Some(0);
        let placed = placed_nodes(&document);
        assert_eq!((placed.len(), placed[0].1.translation.x), (1, 200_000.0));
    }
}
