//! What is asked before something is done: which file, and how to begin?

use crate::document::Document;
use crate::viewer::Viewer;
use eframe::egui::{self, Align2, Context, Key, Vec2};
use std::path::PathBuf;

/// Beginning of the names of scenes that come along.
pub(crate) const BUILTIN: &str = "builtin:";

/// A question that is open.
pub(crate) struct Dialog {
    purpose: Purpose,
    path: String,
    /// Why the path was refused.
    refusal: Option<String>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Purpose {
    Open,
    Save,
}

impl Dialog {
    /// Asks what to open.
    pub(crate) fn open() -> Self {
        Self { purpose: Purpose::Open, path: String::new(), refusal: None }
    }

    /// Asks where to write the scene.
    pub(crate) fn save(document: &Document) -> Self {
        let name = document.scene_file().unwrap_or_else(|| {
            let stem: String =
                document.scene.name.chars().filter(|c| c.is_alphanumeric() || *c == '_').collect();
            PathBuf::from(if stem.is_empty() { "scene.ron".to_owned() } else { format!("{stem}.ron") })
        });
        let path = name.to_string_lossy().into_owned();
        Self { purpose: Purpose::Save, path, refusal: None }
    }

    /// Says why the path will not do.
    fn refused(&self) -> Option<String> {
        let path = PathBuf::from(self.path.trim());
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        match self.purpose {
            _ if self.path.trim().is_empty() => Some("write the name of a file".to_owned()),
            Purpose::Open if self.path.starts_with(BUILTIN) || path.is_file() => None,
            Purpose::Open => Some(format!("{}: there is no such file", path.display())),
            Purpose::Save if extension == "ron" || extension == "json" => {
                let folder = path.parent().filter(|f| !f.as_os_str().is_empty() && !f.is_dir());
                folder.map(|folder| format!("{}: there is no such folder", folder.display()))
            }
            Purpose::Save => Some("scenes are written as .ron or .json".to_owned()),
        }
    }
}

impl Viewer {
    /// Shows what lies over the window.
    pub(crate) fn show_dialogs(&mut self, ctx: &Context) {
        self.show_path_dialog(ctx);
        self.show_palette(ctx);
        if self.panels.welcome {
            self.show_welcome(ctx);
        }
    }

    fn show_path_dialog(&mut self, ctx: &Context) {
        let Some(mut dialog) = self.dialog.take() else { return };
        let (title, go) = match dialog.purpose {
            Purpose::Open => ("Open a scene", "Open"),
            Purpose::Save => ("Save the scene", "Save"),
        };
        let (mut is_done, mut is_left) =
            (ctx.input_mut(|i| i.consume_key(egui::Modifiers::NONE, Key::Enter)), false);
        window(title).show(ctx, |ui| {
            ui.set_width(460.0);
            let label = ui.label("Path, or builtin:NAME").id;
            let field = egui::TextEdit::singleline(&mut dialog.path).desired_width(f32::INFINITY);
            let field = ui.add(field).labelled_by(label);
            if ui.memory(|m| m.focused().is_none()) {
                field.request_focus();
            }
            if let Some(why) = &dialog.refusal {
                ui.colored_label(ui.visuals().error_fg_color, why);
            }
            ui.horizontal(|ui| {
                is_done |= ui.button(go).clicked();
                is_left |= ui.button("Leave it").clicked();
            });
            if dialog.purpose == Purpose::Open {
                ui.separator();
                ui.weak("Scenes .ron .json, models .obj .gltf .glb .stl .ply .vox, volumes .nrrd .nii, height maps .png");
                for name in &self.memory.recent {
                    if ui.link(name).clicked() {
                        (dialog.path, is_done) = (name.clone(), true);
                    }
                }
            }
        });
        if is_done {
            dialog.refusal = dialog.refused();
            if dialog.refusal.is_none() {
                let path = dialog.path.trim();
                match dialog.purpose {
                    Purpose::Open => self.open(path, ctx),
                    Purpose::Save => self.save_to(PathBuf::from(path), ctx),
                }
                return;
            }
        }
        self.dialog = (!is_left).then_some(dialog);
    }

    /// Shows the first screen.
    fn show_welcome(&mut self, ctx: &Context) {
        let mut is_open = true;
        let mut is_read = false;
        window("Where do two renderers differ?").open(&mut is_open).show(ctx, |ui| {
            ui.set_width(460.0);
            for (step, what) in [
                ("1", "Drop a model onto this window, or choose a scene from the menu Scene."),
                ("2", "Choose a back end above each picture. Both draw the same scene from the same side."),
                ("3", "Drag in a picture to turn the camera, scroll to come nearer."),
                ("4", "Press G to see where the two differ, X to wipe between them, V for the numbers under the mouse."),
                ("5", "Press R to hold every picture against the exact reference."),
            ] {
                ui.horizontal_wrapped(|ui| {
                    ui.strong(step);
                    ui.label(what);
                });
            }
            ui.add_space(6.0);
            ui.weak("Ctrl-P finds everything else. F1 shows this again.");
            is_read = ui.button("Begin").clicked();
        });
        self.panels.welcome = is_open && !is_read;
    }
}

fn window(title: &str) -> egui::Window<'_> {
    egui::Window::new(title)
        .collapsible(false)
        .resizable(false)
        .fade_in(false)
        .anchor(Align2::CENTER_TOP, Vec2::new(0.0, 90.0))
}
