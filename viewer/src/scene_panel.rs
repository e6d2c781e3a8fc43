//! What is in the scene, and how is it changed? A list of things, and the fields of the one that is chosen.

use eframe::egui;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use polyptych::scene::{Light, LightKind, Material, Object, Primitive, Scene, Shape};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// What is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Chosen {
    Object(usize),
    Light(usize),
}

/// A change of the scene.
pub(crate) struct Edit {
    pub(crate) scene: Scene,
    /// What was changed: changes of one thing after another are one step.
    pub(crate) what: String,
}

/// Bodies that can be added, with the names of their kinds.
const BODIES: [(&str, Primitive); 7] = [
    ("box", Primitive::Box { size: DVec3::ONE }),
    ("ball", Primitive::Sphere { radius: 0.5 }),
    ("cylinder", Primitive::Cylinder { radius: 0.5, height: 1.0 }),
    ("cone", Primitive::Cone { radius: 0.5, height: 1.0 }),
    ("ring", Primitive::Torus { major: 0.5, minor: 0.15 }),
    ("plane", Primitive::Plane { width: 2.0, depth: 2.0 }),
    ("frustum", Primitive::Frustum { sides: 6, lower_radius: 0.5, upper_radius: 0.3, height: 1.0 }),
];

/// Shows the panel. Returns the changed scene, if there is one.
pub(crate) fn show(
    ui: &mut egui::Ui,
    scene: &Scene,
    chosen: &mut Option<Chosen>,
    center: DVec3,
) -> Option<Edit> {
    let mut edit = None;
    ui.horizontal(|ui| {
        ui.menu_button("Add", |ui| edit = add(ui, scene, chosen, center));
        let has = chosen.is_some();
        if ui.add_enabled(has, egui::Button::new("Duplicate")).clicked() {
            edit = chosen.as_ref().and_then(|c| duplicate(scene, *c));
        }
        if ui.add_enabled(has, egui::Button::new("Delete")).clicked() {
            edit = chosen.take().and_then(|c| delete(scene, c));
        }
    });
    ui.separator();
    let all = egui::ScrollArea::vertical().id_salt("things").max_height(ui.available_height() * 0.4);
    all.show(ui, |ui| {
        for (index, object) in scene.objects.iter().enumerate() {
            ui.push_id(("object", index), |ui| {
                ui.horizontal(|ui| {
                    let mut visible = object.visible;
                    let shown = ui.checkbox(&mut visible, "").on_hover_text("Whether it is drawn");
                    shown.widget_info(|| {
                        let label = format!("{} is drawn", object.name);
                        egui::WidgetInfo::selected(egui::Role::CheckBox, true, visible, label)
                    });
                    if shown.changed() {
                        edit = changed(scene, format!("visible {index}"), |s| {
                            s.objects[index].visible = visible;
                        });
                    }
                    let is_chosen = *chosen == Some(Chosen::Object(index));
                    if ui.selectable_label(is_chosen, &object.name).clicked() {
                        *chosen = Some(Chosen::Object(index));
                    }
                    ui.weak(object.shape.kind().name());
                });
            });
        }
        for (index, light) in scene.lights.iter().enumerate() {
            let kind = match light.kind {
                LightKind::Directional { .. } => "directional",
                LightKind::Point { .. } => "point",
                LightKind::Spot { .. } => "spot",
            };
            let is_chosen = *chosen == Some(Chosen::Light(index));
            if ui.selectable_label(is_chosen, format!("light {index} ({kind})")).clicked() {
                *chosen = Some(Chosen::Light(index));
            }
        }
    });
    ui.separator();
    egui::ScrollArea::vertical().id_salt("fields").show(ui, |ui| match *chosen {
        Some(Chosen::Object(index)) if index < scene.objects.len() => {
            edit = object_fields(ui, scene, index).or_else(|| edit.take());
        }
        Some(Chosen::Light(index)) if index < scene.lights.len() => {
            edit = light_fields(ui, scene, index).or_else(|| edit.take());
        }
        _ => drop(ui.weak("Choose a thing above, or click one in a picture.")),
    });
    edit
}

#[expect(clippy::unnecessary_wraps, reason = "every edit of the panel is an option")]
fn changed(scene: &Scene, what: String, change: impl FnOnce(&mut Scene)) -> Option<Edit> {
    let mut scene = scene.clone();
    change(&mut scene);
    Some(Edit { scene, what })
}

fn add(ui: &mut egui::Ui, scene: &Scene, chosen: &mut Option<Chosen>, center: DVec3) -> Option<Edit> {
    for (name, body) in BODIES {
        if ui.button(name).clicked() {
            *chosen = Some(Chosen::Object(scene.objects.len()));
            return changed(scene, format!("add {}", scene.objects.len()), |scene| {
                let gray = scene.add_material(Material::new(Vec3::splat(0.6)));
                scene.objects.push(Object::new(name, Shape::Primitive(body), gray).at(center));
            });
        }
    }
    let lights = [
        ("directional light", Light::directional(DVec3::new(-0.4, -1.0, -0.3))),
        ("point light", Light::point(center + DVec3::Y, 1.0)),
    ];
    for (name, light) in lights {
        if ui.button(name).clicked() {
            *chosen = Some(Chosen::Light(scene.lights.len()));
            return changed(scene, format!("add light {}", scene.lights.len()), |s| s.lights.push(light));
        }
    }
    None
}

fn duplicate(scene: &Scene, chosen: Chosen) -> Option<Edit> {
    changed(
        scene,
        format!("duplicate {} {}", scene.objects.len(), scene.lights.len()),
        |scene| match chosen {
            Chosen::Object(index) if index < scene.objects.len() => {
                let mut copy = scene.objects[index].clone();
                copy.world_from_object.translation.x += copy.bounds().size().x;
                copy.name += " (copy)";
                scene.objects.push(copy);
            }
            Chosen::Light(index) if index < scene.lights.len() => {
                scene.lights.push(scene.lights[index].clone());
            }
            Chosen::Object(_) | Chosen::Light(_) => {}
        },
    )
}

fn delete(scene: &Scene, chosen: Chosen) -> Option<Edit> {
    changed(scene, format!("delete {} {}", scene.objects.len(), scene.lights.len()), |scene| match chosen {
        Chosen::Object(index) if index < scene.objects.len() => drop(scene.objects.remove(index)),
        Chosen::Light(index) if index < scene.lights.len() => drop(scene.lights.remove(index)),
        Chosen::Object(_) | Chosen::Light(_) => {}
    })
}

/// Shows fields of numbers in a row. Tells whether one was changed.
fn numbers<const N: usize>(
    ui: &mut egui::Ui,
    name: &str,
    values: [&mut f64; N],
    range: RangeInclusive<f64>,
) -> bool {
    let mut is_changed = false;
    ui.label(name);
    ui.horizontal(|ui| {
        for (i, value) in values.into_iter().enumerate() {
            let speed = (value.abs() * 0.01).max(0.005);
            let field = egui::DragValue::new(value).range(range.clone()).speed(speed).max_decimals(4);
            let field = ui.add(field);
            field.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::SpinButton, true, format!("{name} {i}"))
            });
            is_changed |= field.changed();
        }
    });
    ui.end_row();
    is_changed
}

const ANY: RangeInclusive<f64> = -1e9..=1e9;
const POSITIVE: RangeInclusive<f64> = 1e-6..=1e9;

fn object_fields(ui: &mut egui::Ui, scene: &Scene, index: usize) -> Option<Edit> {
    let (mut object, mut is_changed, mut what) = (scene.objects[index].clone(), false, "");
    let grid = |name: &str| egui::Grid::new((name, index)).num_columns(2);
    grid("object").show(ui, |ui| {
        let name = ui.label("name").id;
        if ui.text_edit_singleline(&mut object.name).labelled_by(name).changed() {
            (is_changed, what) = (true, "name");
        }
        ui.end_row();
        let at = &mut object.world_from_object.translation;
        if numbers(ui, "place", [&mut at.x, &mut at.y, &mut at.z], ANY) {
            (is_changed, what) = (true, "place");
        }
        if let Some(turned) = turning(ui, &object.world_from_object) {
            object.world_from_object = turned;
            (is_changed, what) = (true, "turn");
        }
        if let Shape::Primitive(body) = &*object.shape {
            let mut body = *body;
            if body_fields(ui, &mut body) && body.check().is_ok() {
                object.shape = Arc::new(Shape::Primitive(body));
                (is_changed, what) = (true, "shape");
            }
        }
    });
    let mut edit = is_changed
        .then(|| changed(scene, format!("{what} {index}"), |s| s.objects[index] = object.clone()))
        .flatten();
    let mut slots = object.materials.clone();
    slots.sort_unstable();
    slots.dedup();
    for slot in slots {
        let Some(material) = scene.materials.get(slot) else { continue };
        let users = scene.objects.iter().filter(|o| o.materials.contains(&slot)).count();
        let shared = if users > 1 { format!(", shared by {users} objects") } else { String::new() };
        ui.separator();
        ui.strong(format!("material {slot} {}{shared}", material.name));
        let mut material = material.clone();
        if grid(&format!("material {slot}")).show(ui, |ui| material_fields(ui, &mut material)).inner {
            edit = changed(scene, format!("material {slot}"), |s| s.materials[slot] = material);
        }
    }
    edit
}

/// Shows angles about the axes (yaw, pitch, roll) and a scale. Returns the changed transform; a transform that is no
/// turn and scale stays as it is.
fn turning(ui: &mut egui::Ui, before: &DAffine3) -> Option<DAffine3> {
    let (scale, turn, translation) = before.to_scale_rotation_translation();
    let rebuilt = DMat3::from_quat(turn) * DMat3::from_diagonal(scale);
    if !rebuilt.abs_diff_eq(before.matrix3, 1e-9 * scale.abs().max_element()) {
        ui.label("turn");
        ui.weak("sheared: not edited here");
        ui.end_row();
        return None;
    }
    let (mut yaw, mut pitch, mut roll) = turn.to_euler(glam::EulerRot::YXZ);
    for angle in [&mut yaw, &mut pitch, &mut roll] {
        *angle = angle.to_degrees();
    }
    let mut scale = scale;
    let turned = numbers(ui, "turn, degrees", [&mut yaw, &mut pitch, &mut roll], -360.0..=360.0);
    let scaled = numbers(ui, "scale", [&mut scale.x, &mut scale.y, &mut scale.z], -1e6..=1e6);
    let is_flat = scale.to_array().iter().any(|s| s.abs() < 1e-9);
    ((turned || scaled) && !is_flat).then(|| {
        let [yaw, pitch, roll] = [yaw, pitch, roll].map(f64::to_radians);
        let turn = glam::DQuat::from_euler(glam::EulerRot::YXZ, yaw, pitch, roll);
        DAffine3::from_scale_rotation_translation(scale, turn, translation)
    })
}

fn body_fields(ui: &mut egui::Ui, body: &mut Primitive) -> bool {
    match body {
        Primitive::Box { size } => numbers(ui, "edges", [&mut size.x, &mut size.y, &mut size.z], POSITIVE),
        Primitive::Sphere { radius } => numbers(ui, "radius", [radius], POSITIVE),
        Primitive::Cylinder { radius, height } | Primitive::Cone { radius, height } => {
            numbers(ui, "radius, height", [radius, height], POSITIVE)
        }
        Primitive::Torus { major, minor } => numbers(ui, "radii of ring and tube", [major, minor], POSITIVE),
        Primitive::Plane { width, depth } => numbers(ui, "width, depth", [width, depth], POSITIVE),
        Primitive::Frustum { sides, lower_radius, upper_radius, height } => {
            let mut count = f64::from(*sides);
            let sided = numbers(ui, "sides", [&mut count], 3.0..=4096.0);
            *sides = count.round() as u32;
            let lower = numbers(ui, "lower radius, height", [lower_radius, height], POSITIVE);
            sided | lower | numbers(ui, "upper radius", [upper_radius], 0.0..=1e9)
        }
    }
}

fn color_field(ui: &mut egui::Ui, name: &str, color: &mut Vec3) -> bool {
    let label = ui.label(name).id;
    let mut rgb = color.to_array();
    let is_changed = ui.color_edit_button_rgb(&mut rgb).labelled_by(label).changed();
    *color = Vec3::from_array(rgb);
    ui.end_row();
    is_changed
}

fn share_field(ui: &mut egui::Ui, name: &str, value: &mut f32, range: RangeInclusive<f32>) -> bool {
    let label = ui.label(name).id;
    let is_changed = ui.add(egui::Slider::new(value, range)).labelled_by(label).changed();
    ui.end_row();
    is_changed
}

fn material_fields(ui: &mut egui::Ui, material: &mut Material) -> bool {
    let mut is_changed = color_field(ui, "color", &mut material.base_color);
    for (name, value, range) in [
        ("ambient", &mut material.ambient, 0.0..=1.0),
        ("diffuse", &mut material.diffuse, 0.0..=1.0),
        ("specular", &mut material.specular, 0.0..=1.0),
        ("shininess", &mut material.shininess, 1.0..=256.0),
        ("opacity", &mut material.opacity, 0.0..=1.0),
        ("reflectivity", &mut material.reflectivity, 0.0..=1.0),
    ] {
        is_changed |= share_field(ui, name, value, range);
    }
    is_changed | color_field(ui, "emission", &mut material.emission)
}

fn light_fields(ui: &mut egui::Ui, scene: &Scene, index: usize) -> Option<Edit> {
    let (mut light, mut is_changed) = (scene.lights[index].clone(), false);
    egui::Grid::new(("light", index)).num_columns(2).show(ui, |ui| {
        let (place, direction) = match &mut light.kind {
            LightKind::Directional { direction } => (None, Some(direction)),
            LightKind::Point { position } => (Some(position), None),
            LightKind::Spot { position, direction, .. } => (Some(position), Some(direction)),
        };
        for (name, vector) in [("place", place), ("direction", direction)] {
            if let Some(v) = vector {
                is_changed |= numbers(ui, name, [&mut v.x, &mut v.y, &mut v.z], ANY);
            }
        }
        is_changed |= color_field(ui, "color", &mut light.color);
        is_changed |= share_field(ui, "intensity", &mut light.intensity, 0.0..=20.0);
        is_changed |= ui.checkbox(&mut light.casts_shadow, "casts shadows").changed();
    });
    is_changed.then(|| changed(scene, format!("light {index}"), |s| s.lights[index] = light)).flatten()
}
