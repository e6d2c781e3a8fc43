//! What does a drag over a picture do: turn the camera, move the chosen thing, or paint?

use crate::gizmo;
use crate::scene_panel::Edit;
use crate::viewer::Viewer;
use eframe::egui::{self, Rect};

/// What a drag over a picture does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Tool {
    /// A drag turns the camera, a click chooses.
    #[default]
    Choose,
    Move,
    Turn,
    Scale,
    Paint,
    Erase,
    Raise,
    Lower,
}

impl Tool {
    /// Takes up a tool, or puts it away.
    pub(crate) fn toggle(&mut self, tool: Self) {
        *self = if *self == tool { Self::Choose } else { tool };
    }

    fn is_brush(self) -> bool {
        matches!(self, Self::Paint | Self::Erase | Self::Raise | Self::Lower)
    }

    /// Tells whether it must know what the picture shows where it is used.
    pub(crate) fn needs_a_place(self) -> bool {
        self != Self::Choose
    }

    fn told(self) -> &'static str {
        match self {
            Self::Choose => "",
            Self::Move => "Drag an arrow to move what is chosen.",
            Self::Turn => "Drag a ring's grip to turn what is chosen.",
            Self::Scale => "Drag a handle to scale what is chosen.",
            Self::Paint => "Drag over voxels to add some.",
            Self::Erase => "Drag over voxels to take them away.",
            Self::Raise => "Drag over a terrain to raise it.",
            Self::Lower => "Drag over a terrain to lower it.",
        }
    }
}

impl Viewer {
    /// Says what the tool does, and shows its size where it is a brush.
    pub(crate) fn show_tool(&mut self, ui: &mut egui::Ui) {
        if self.tool == Tool::Choose {
            return;
        }
        ui.separator();
        ui.label(self.tool.told());
        if self.tool.is_brush() {
            self.brush.show(ui);
        }
    }

    /// Uses the tool over a picture. Tells whether it took what the mouse did.
    pub(crate) fn use_tool(
        &mut self,
        ui: &egui::Ui,
        picture: Rect,
        response: &egui::Response,
        pane: usize,
    ) -> bool {
        let (scene, camera) = (&self.document.scene, &self.navigation.camera);
        if !self.tool.is_brush() {
            let chosen = self.chosen.filter(|_| self.tool != Tool::Choose);
            let edit = chosen.and_then(|chosen| {
                gizmo::show(ui, picture, camera, scene, (self.tool, chosen), &format!("{pane}"))
            });
            let is_held =
                ui.ctx().dragged_id().is_some_and(|id| id != response.id) && response.contains_pointer();
            self.edit(edit, ui.ctx());
            return is_held;
        }
        let Some(pointer) = response.interact_pointer_pos().filter(|_| response.is_pointer_button_down_on())
        else {
            self.brush.lift();
            // With a brush in hand the secondary button turns the camera.
            return !response.dragged_by(egui::PointerButton::Secondary);
        };
        if ui.input(|i| i.pointer.secondary_down()) {
            return false;
        }
        let edit: Option<Edit> = self.panes.get(pane).and_then(|p| p.painting()).and_then(|painting| {
            self.brush.dab((scene, camera), &painting.framebuffer, (pointer, picture), self.tool)
        });
        self.edit(edit, ui.ctx());
        true
    }
}
