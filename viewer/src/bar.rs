//! What stands above the pictures: menus, what is used most, and what there is to say?

use crate::actions::{ACTIONS, Action, Menu, entry_of};
use crate::dialog::BUILTIN;
use crate::navigation::Navigation;
use crate::viewer::Viewer;
use eframe::egui::{self, RichText};

/// What can be switched by a click.
const BUTTONS: [&[Action]; 2] = [
    &[Action::SideBySide, Action::Wipe, Action::Flip, Action::Difference, Action::ErrorMaps],
    &[Action::Objects, Action::Settings, Action::Values, Action::Errors, Action::Chart],
];

impl Viewer {
    /// Shows the bar at the top.
    pub(crate) fn show_bar(&mut self, ui: &mut egui::Ui) {
        egui::Panel::top("bar").show(ui, |ui| {
            ui.horizontal_wrapped(|ui| {
                for (menu, name) in Menu::ALL {
                    ui.menu_button(name, |ui| self.show_menu(ui, menu));
                }
                ui.menu_button("Scene", |ui| self.show_scenes(ui));
                ui.menu_button("Camera", |ui| self.show_cameras(ui));
                ui.separator();
                ui.label("Panes");
                for count in 1..=4 {
                    if ui.selectable_label(self.panes.len() == count, count.to_string()).clicked() {
                        self.set_count(count, ui.ctx());
                    }
                }
                for group in BUTTONS {
                    ui.separator();
                    for &action in group {
                        self.show_button(ui, action);
                    }
                }
                ui.separator();
                self.equal.show(ui);
                let changed = if self.document.is_changed() { "(unsaved changes) " } else { "" };
                ui.label(format!("{changed}{}", self.message));
            });
            self.show_left_over(ui);
            ui.small(
                "Drag: orbit. Shift-drag: pan. Scroll: nearer. WASD QE: fly. F: show all. 1-9: back end of the chosen pane. \
                 X: wipe. G: difference. V: values. Ctrl-P: all actions. Drop a file: open it.",
            );
        });
    }

    fn show_button(&mut self, ui: &mut egui::Ui, action: Action) {
        let entry = entry_of(action);
        let is_on = self.is_on(action).unwrap_or(false);
        let button = ui.selectable_label(is_on, entry.name).on_hover_ui(|ui| {
            let key = entry.key.map_or(String::new(), |key| format!(" ({})", ui.ctx().format_shortcut(&key)));
            ui.label(format!("{}{key}", entry.help));
        });
        if button.clicked() {
            self.perform(action, ui.ctx());
        }
    }

    fn show_menu(&mut self, ui: &mut egui::Ui, menu: Menu) {
        for entry in ACTIONS.iter().filter(|e| e.menu == menu) {
            let key = entry.key.map_or(String::new(), |key| ui.ctx().format_shortcut(&key));
            let name = match (entry.action, self.is_on(entry.action)) {
                (Action::Backend(number), _) if self.can(entry.action) => {
                    self.backends[usize::from(number)].clone()
                }
                (_, Some(true)) => format!("{} ✔", entry.name),
                _ => entry.name.to_owned(),
            };
            let button = egui::Button::new(name).shortcut_text(key);
            if ui.add_enabled(self.can(entry.action), button).on_hover_text(entry.help).clicked() {
                self.perform(entry.action, ui.ctx());
                ui.close();
            }
        }
    }

    fn show_scenes(&mut self, ui: &mut egui::Ui) {
        let recent = self.memory.recent.iter().filter(|name| !name.starts_with(BUILTIN)).cloned();
        let builtin = polyptych::builtin::NAMES.map(|name| format!("{BUILTIN}{name}"));
        let all: Vec<_> = builtin.into_iter().chain(recent).collect();
        if let Some(name) = all.iter().find(|name| ui.button(*name).clicked()) {
            self.open(name, ui.ctx());
        }
    }

    fn show_cameras(&mut self, ui: &mut egui::Ui) {
        let scene = self.document.scene.clone();
        if let Some((_, camera)) = scene.cameras.iter().find(|(name, _)| ui.button(name).clicked()) {
            self.navigation = Navigation::new(camera.clone(), scene.bounds());
        }
        ui.separator();
        self.navigation.show_lens(ui);
    }

    /// Offers what an earlier session left unsaved.
    fn show_left_over(&mut self, ui: &mut egui::Ui) {
        let Some(file) = self.left_over.first().cloned() else { return };
        ui.horizontal(|ui| {
            let warn = ui.visuals().warn_fg_color;
            ui.label(RichText::new("An earlier session ended with changes that were not saved.").color(warn));
            if ui.button("Restore them").clicked() {
                self.open(&file.to_string_lossy(), ui.ctx());
            }
            if ui.button("Throw them away").clicked() {
                // If it stays there it is offered again.
                let _ = std::fs::remove_file(&file);
                self.left_over.remove(0);
            }
        });
    }
}
