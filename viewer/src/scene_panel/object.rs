//! Which numbers make an object: its place, its shape, and what it is made of?

use super::{Edit, body, form};
use crate::field::{ANY, checked, color, numbers, slider};
use eframe::egui;
use glam::{DAffine3, DMat3, DQuat, EulerRot};
use polyptych::scene::{FreeForm, Material, Object, Scene, Shape};
use std::sync::Arc;

/// Shows the fields of an object. Returns the scene with it changed.
pub(super) fn show(ui: &mut egui::Ui, scene: &Scene, index: usize) -> Option<Edit> {
    let mut object = scene.objects[index].clone();
    let grid = egui::Grid::new(("object", index)).num_columns(2);
    let mut what = grid.show(ui, |ui| place_fields(ui, &mut object)).inner;
    let shape = ui.push_id(("shape", index), |ui| shape_fields(ui, &object.shape)).inner;
    if let Some(shape) = shape {
        (object.shape, what) = (Arc::new(shape), Some("shape"));
    }
    let mut edit =
        what.map(|what| Edit::new(scene, format!("{what} {index}"), |scene| scene.objects[index] = object));
    let mut slots = scene.objects[index].materials.clone();
    slots.sort_unstable();
    slots.dedup();
    for slot in slots {
        let Some(material) = scene.materials.get(slot) else { continue };
        let users = scene.objects.iter().filter(|o| o.materials.contains(&slot)).count();
        let shared = if users > 1 { format!(", shared by {users} objects") } else { String::new() };
        ui.separator();
        ui.strong(format!("material {slot} {}{shared}", material.name));
        let mut material = material.clone();
        let grid = egui::Grid::new(("material", slot)).num_columns(2);
        if grid.show(ui, |ui| material_fields(ui, &mut material)).inner {
            edit = Some(Edit::new(scene, format!("material {slot}"), |s| s.materials[slot] = material));
        }
    }
    edit
}

/// Shows name and place. Returns what was changed.
fn place_fields(ui: &mut egui::Ui, object: &mut Object) -> Option<&'static str> {
    let mut what = None;
    let name = ui.label("name").id;
    if ui.text_edit_singleline(&mut object.name).labelled_by(name).changed() {
        what = Some("name");
    }
    ui.end_row();
    let at = &mut object.world_from_object.translation;
    if numbers(ui, "place", [&mut at.x, &mut at.y, &mut at.z], &ANY) {
        what = Some("place");
    }
    if let Some(turned) = turning(ui, &object.world_from_object) {
        object.world_from_object = turned;
        what = Some("turn");
    }
    what
}

/// Shows angles about the axes (yaw, pitch, roll) and a scale. Returns the changed transform; a transform that is no
/// turn and scale stays as it is.
fn turning(ui: &mut egui::Ui, before: &DAffine3) -> Option<DAffine3> {
    let (mut scale, turn, translation) = before.to_scale_rotation_translation();
    let rebuilt = DMat3::from_quat(turn) * DMat3::from_diagonal(scale);
    if !rebuilt.abs_diff_eq(before.matrix3, 1e-9 * scale.abs().max_element()) {
        ui.label("turn");
        ui.weak("sheared: not edited here");
        ui.end_row();
        return None;
    }
    let (yaw, pitch, roll) = turn.to_euler(EulerRot::YXZ);
    let [mut yaw, mut pitch, mut roll] = [yaw, pitch, roll].map(f64::to_degrees);
    let turned = numbers(ui, "turn, degrees", [&mut yaw, &mut pitch, &mut roll], &(-360.0..=360.0));
    let scaled = numbers(ui, "scale", [&mut scale.x, &mut scale.y, &mut scale.z], &(-1e6..=1e6));
    let is_flat = scale.to_array().iter().any(|s| s.abs() < 1e-9);
    let flat = (scaled && is_flat).then(|| Err("a scale of 0 squeezes it to nothing".to_owned()));
    checked::<()>(ui, "flat", flat.or((scaled && !is_flat).then_some(Ok(()))));
    ((turned || scaled) && !is_flat).then(|| {
        let [yaw, pitch, roll] = [yaw, pitch, roll].map(f64::to_radians);
        let turn = DQuat::from_euler(EulerRot::YXZ, yaw, pitch, roll);
        DAffine3::from_scale_rotation_translation(scale, turn, translation)
    })
}

/// Shows what makes the shape. Returns the changed one; one that will not do is refused with the reason.
fn shape_fields(ui: &mut egui::Ui, shape: &Shape) -> Option<Shape> {
    let made = match shape {
        Shape::Primitive(body) => {
            let mut body = *body;
            let grid = egui::Grid::new("body").num_columns(2);
            let is_changed = grid.show(ui, |ui| body::fields(ui, &mut body)).inner;
            is_changed.then(|| body.check().map(|()| Shape::Primitive(body)))
        }
        Shape::FreeForm(free) => {
            let mut form = free.form().clone();
            let is_changed = form::fields(ui, "form", &mut form, 0);
            is_changed.then(|| FreeForm::new(form).map(Shape::FreeForm))
        }
        other => {
            ui.weak(told(other));
            None
        }
    };
    checked(ui, "shape", made)
}

/// Says in a line what a shape without numbers is, and how it is changed.
fn told(shape: &Shape) -> String {
    match shape {
        Shape::Mesh(mesh) => format!("{} triangles, {} vertices", mesh.triangles.len(), mesh.positions.len()),
        Shape::Voxels(voxels) => {
            let [x, y, z] = voxels.size();
            format!("{x} x {y} x {z} cells: paint them with B, erase with Shift-B")
        }
        Shape::HeightField(field) => {
            format!("{} x {} heights: raise them with U, lower with Shift-U", field.columns(), field.rows())
        }
        Shape::Volume(volume) => {
            let [x, y, z] = volume.size();
            format!("{x} x {y} x {z} samples, {:?}", volume.range())
        }
        Shape::Primitive(_) | Shape::FreeForm(_) => String::new(),
    }
}

fn material_fields(ui: &mut egui::Ui, material: &mut Material) -> bool {
    let mut is_changed = color(ui, "color", &mut material.base_color);
    for (name, value, range) in [
        ("ambient", &mut material.ambient, 0.0..=1.0),
        ("diffuse", &mut material.diffuse, 0.0..=1.0),
        ("specular", &mut material.specular, 0.0..=1.0),
        ("shininess", &mut material.shininess, 1.0..=256.0),
        ("opacity", &mut material.opacity, 0.0..=1.0),
        ("reflectivity", &mut material.reflectivity, 0.0..=1.0),
    ] {
        is_changed |= slider(ui, name, value, range);
    }
    is_changed | color(ui, "emission", &mut material.emission)
}
