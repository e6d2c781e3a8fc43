//! What is listed of the place under the mouse?

use crate::probe;
use crate::viewer::Viewer;
use eframe::egui;
use polyptych::scene::{Object, Scene};
use polyptych::seam::Decision;

impl Viewer {
    /// Lists what all panes show at the place under the mouse, and what each did to the object there.
    pub(crate) fn show_values(&self, ui: &mut egui::Ui) {
        egui::Panel::bottom("values").show(ui, |ui| {
            let Some(place) = self.pointed else {
                ui.label("Point at a picture: here are the values of all panes at that place.");
                return;
            };
            let wide = egui::ScrollArea::horizontal().id_salt("values");
            let grid = egui::Grid::new("values of panes").striped(true);
            wide.show(ui, |ui| {
                grid.show(ui, |ui| {
                    for pane in &self.panes {
                        ui.strong(&pane.backend);
                        let Some(painting) = pane.painting() else { continue };
                        let scene = &self.document.scene;
                        for (channel, value) in probe::values(&painting.framebuffer, scene, place) {
                            ui.label(format!("{} {value}", channel.name()));
                        }
                        let id = probe::id_at(&painting.framebuffer, place);
                        ui.label(id.map_or(String::new(), |id| did(scene, &painting.decisions, id)));
                        ui.end_row();
                    }
                })
            });
        });
    }
}

/// Says what a back end did to the object of an id.
fn did(scene: &Scene, decisions: &[Decision], id: u32) -> String {
    let index = (id as usize).wrapping_sub(1);
    let (Some(Object { shape, .. }), Some(decision)) = (scene.objects.get(index), decisions.get(index))
    else {
        return String::new();
    };
    match decision {
        Decision::Exact => format!("{} drawn as given", shape.kind().name()),
        other => format!("{} {}: {}", shape.kind().name(), other.word(), other.why()),
    }
}
