//! What is in the scene, and how is it changed? A list of things, and the fields of the one that is chosen.

mod add;
mod body;
mod form;
mod light;
mod object;

use crate::actions::Action;
use crate::probe;
use crate::viewer::Viewer;
use eframe::egui;
use polyptych::scene::{LightKind, Scene};
use std::ops::Range;

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

impl Edit {
    /// Changes a copy of a scene.
    pub(crate) fn new(scene: &Scene, what: String, change: impl FnOnce(&mut Scene)) -> Self {
        let mut scene = scene.clone();
        change(&mut scene);
        Self { scene, what }
    }
}

impl Viewer {
    /// Shows what is in the scene.
    pub(crate) fn show_scene(&mut self, ui: &mut egui::Ui) {
        let center = self.navigation.pivot();
        egui::Panel::left("scene").default_size(310.0).size_range(220.0..=520.0).show(ui, |ui| {
            ui.horizontal_wrapped(|ui| {
                for action in [Action::Undo, Action::Redo, Action::Duplicate, Action::Delete] {
                    let entry = crate::actions::entry_of(action);
                    let key = entry.key.map_or(String::new(), |key| ui.ctx().format_shortcut(&key));
                    let button = ui.add_enabled(self.can(action), egui::Button::new(entry.name));
                    if button.on_hover_text(key).clicked() {
                        self.perform(action, ui.ctx());
                    }
                }
                let (scene, chosen) = (&self.document.scene, &mut self.chosen);
                let added = ui.menu_button("Add", |ui| add::show(ui, scene, chosen, center));
                self.edit(added.inner.flatten(), ui.ctx());
            });
            self.show_tool(ui);
            ui.separator();
            let scene = self.document.scene.clone();
            let hidden = tree(ui, &scene, &mut self.chosen);
            self.edit(hidden, ui.ctx());
            ui.separator();
            let fields = egui::ScrollArea::vertical().id_salt("fields").show(ui, |ui| match self.chosen {
                Some(Chosen::Object(index)) if index < scene.objects.len() => object::show(ui, &scene, index),
                Some(Chosen::Light(index)) if index < scene.lights.len() => light::show(ui, &scene, index),
                _ => {
                    ui.weak("Choose a thing above, or click one in a picture.");
                    None
                }
            });
            self.edit(fields.inner, ui.ctx());
        });
    }

    /// Chooses what a picture shows at the place under the mouse.
    pub(crate) fn choose_at(&mut self, pane: usize) {
        let (Some(place), Some(painting)) = (self.pointed, self.panes.get(pane).and_then(|p| p.painting()))
        else {
            return;
        };
        let id = probe::id_at(&painting.framebuffer, place);
        self.chosen = id.map(|id| Chosen::Object(id as usize - 1));
    }
}

/// Shows all things of the scene, of which only those in sight are laid out. Returns the scene with one hidden or shown.
fn tree(ui: &mut egui::Ui, scene: &Scene, chosen: &mut Option<Chosen>) -> Option<Edit> {
    let mut edit = None;
    let (objects, lights) = (scene.objects.len(), scene.lights.len());
    let height = ui.spacing().interact_size.y;
    let list = egui::ScrollArea::vertical().id_salt("things").max_height(ui.available_height() * 0.4);
    list.show_rows(ui, height, objects + lights, |ui, rows: Range<usize>| {
        for row in rows {
            ui.push_id(("thing", row), |ui| match row.checked_sub(objects) {
                None => edit = object_row(ui, scene, row, chosen).or(edit.take()),
                Some(light) => light_row(ui, scene, light, chosen),
            });
        }
    });
    edit
}

fn object_row(ui: &mut egui::Ui, scene: &Scene, index: usize, chosen: &mut Option<Chosen>) -> Option<Edit> {
    let object = &scene.objects[index];
    let mut visible = object.visible;
    let mut edit = None;
    ui.horizontal(|ui| {
        let shown = ui.checkbox(&mut visible, "").on_hover_text("Whether it is drawn");
        shown.widget_info(|| {
            let label = format!("{} is drawn", object.name);
            egui::WidgetInfo::selected(egui::Role::CheckBox, true, visible, label)
        });
        if shown.changed() {
            edit = Some(Edit::new(scene, format!("visible {index}"), |s| s.objects[index].visible = visible));
        }
        if ui.selectable_label(*chosen == Some(Chosen::Object(index)), &object.name).clicked() {
            *chosen = Some(Chosen::Object(index));
        }
        ui.weak(object.shape.kind().name());
    });
    edit
}

fn light_row(ui: &mut egui::Ui, scene: &Scene, index: usize, chosen: &mut Option<Chosen>) {
    let kind = match scene.lights[index].kind {
        LightKind::Directional { .. } => "directional",
        LightKind::Point { .. } => "point",
        LightKind::Spot { .. } => "spot",
    };
    let is_chosen = *chosen == Some(Chosen::Light(index));
    if ui.selectable_label(is_chosen, format!("light {index} ({kind})")).clicked() {
        *chosen = Some(Chosen::Light(index));
    }
}

/// Puts a copy of a thing beside it.
pub(crate) fn duplicate(scene: &Scene, chosen: Chosen) -> Option<Edit> {
    let what = format!("duplicate {} {}", scene.objects.len(), scene.lights.len());
    match chosen {
        Chosen::Object(index) => {
            let mut copy = scene.objects.get(index)?.clone();
            copy.world_from_object.translation.x += copy.bounds().size().x;
            copy.name += " (copy)";
            Some(Edit::new(scene, what, |scene| scene.objects.push(copy)))
        }
        Chosen::Light(index) => {
            let copy = scene.lights.get(index)?.clone();
            Some(Edit::new(scene, what, |scene| scene.lights.push(copy)))
        }
    }
}

/// Takes a thing out of the scene.
pub(crate) fn delete(scene: &Scene, chosen: Chosen) -> Option<Edit> {
    let what = format!("delete {} {}", scene.objects.len(), scene.lights.len());
    let exists = match chosen {
        Chosen::Object(index) => index < scene.objects.len(),
        Chosen::Light(index) => index < scene.lights.len(),
    };
    exists.then(|| {
        Edit::new(scene, what, |scene| match chosen {
            Chosen::Object(index) => drop(scene.objects.remove(index)),
            Chosen::Light(index) => drop(scene.lights.remove(index)),
        })
    })
}
