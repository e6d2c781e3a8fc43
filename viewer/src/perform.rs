//! What does each action do?

use crate::actions::Action;
use crate::dialog::Dialog;
use crate::modes::Mode;
use crate::navigation::Navigation;
use crate::palette::Palette;
use crate::scene_panel::{Chosen, delete, duplicate};
use crate::tools::Tool;
use crate::viewer::Viewer;
use eframe::egui::{Context, ViewportCommand};
use glam::DVec3;
use polyptych::framebuffer::Channel;

/// Field of view that a step changes, as a factor.
const ZOOM: f64 = 1.1;
/// Least and greatest size of the window's controls.
const ZOOMS: [f32; 2] = [0.5, 3.0];

impl Viewer {
    /// Does something.
    pub fn perform(&mut self, action: Action, ctx: &Context) {
        use Action as A;
        match action {
            A::Open => self.dialog = Some(Dialog::open()),
            A::Save => self.save(ctx),
            A::SaveAs => self.dialog = Some(Dialog::save(&self.document)),
            A::Reload => self.reload(ctx),
            A::Watch => self.set_watch(self.watch.is_none(), ctx),
            A::Screenshot => self.save_screenshot(None, ctx),
            A::Sheet => self.save_sheet(ctx),
            A::Quit => ctx.send_viewport_cmd(ViewportCommand::Close),
            A::Undo => self.document.undo(),
            A::Redo => self.document.redo(),
            A::Duplicate => self.edit(self.chosen.and_then(|c| duplicate(&self.document.scene, c)), ctx),
            A::Delete => {
                let edit = self.chosen.take().and_then(|c| delete(&self.document.scene, c));
                self.edit(edit, ctx);
            }
            A::FrameAll => self.frame(false),
            A::FrameChosen => self.frame(true),
            A::Front => self.look_along(DVec3::NEG_Z),
            A::Back => self.look_along(DVec3::Z),
            A::Left => self.look_along(DVec3::X),
            A::Right => self.look_along(DVec3::NEG_X),
            A::Top => self.look_along(DVec3::NEG_Y),
            A::Bottom => self.look_along(DVec3::Y),
            A::Level => self.navigation.level(),
            A::SceneCamera => self.next_camera(),
            A::Parallel => self.navigation.change_projection(),
            A::Wider => self.navigation.widen(ZOOM),
            A::Narrower => self.navigation.widen(1.0 / ZOOM),
            A::Turntable => self.is_turning = !self.is_turning,
            A::AddPane => self.set_count(self.panes.len() + 1, ctx),
            A::RemovePane => self.set_count(self.panes.len() - 1, ctx),
            A::NextPane => self.active = (self.active + 1) % self.panes.len().max(1),
            A::Backend(number) => self.switch(number, ctx),
            A::NextChannel => self.next_channel(),
            A::SideBySide => self.mode = Mode::SideBySide,
            A::Wipe => self.toggle_mode(Mode::Wipe),
            A::Flip => self.toggle_mode(Mode::Flip),
            A::Difference => self.toggle_mode(Mode::Difference),
            A::ErrorMaps => {
                self.toggle_mode(Mode::ErrorMaps);
                self.set_truth(self.mode == Mode::ErrorMaps || self.truth.is_some(), ctx);
            }
            A::EqualTime => self.equal.toggle_time(),
            A::EqualError => self.equal.toggle_error(),
            A::Objects => self.panels.objects = !self.panels.objects,
            A::Settings => self.panels.settings = !self.panels.settings,
            A::Values => self.panels.values = !self.panels.values,
            A::Errors => self.set_truth(self.truth.is_none(), ctx),
            A::Chart => {
                self.panels.chart = !self.panels.chart;
                self.set_truth(self.panels.chart || self.truth.is_some(), ctx);
            }
            A::ClearChart => self.chart.clear(),
            A::NoTool => self.leave(),
            A::Move => self.tool.toggle(Tool::Move),
            A::Turn => self.tool.toggle(Tool::Turn),
            A::Scale => self.tool.toggle(Tool::Scale),
            A::Paint => self.tool.toggle(Tool::Paint),
            A::Erase => self.tool.toggle(Tool::Erase),
            A::Raise => self.tool.toggle(Tool::Raise),
            A::Lower => self.tool.toggle(Tool::Lower),
            A::Palette => self.palette = self.palette.take().is_none().then(Palette::default),
            A::Welcome => self.panels.welcome = !self.panels.welcome,
            A::Theme => self.set_theme(!self.memory.is_light, ctx),
            A::Larger => self.set_zoom(ctx.zoom_factor() * 1.1, ctx),
            A::Smaller => self.set_zoom(ctx.zoom_factor() / 1.1, ctx),
            A::FullScreen => {
                let is_full = ctx.input(|i| i.viewport().fullscreen.unwrap_or(false));
                ctx.send_viewport_cmd(ViewportCommand::Fullscreen(!is_full));
            }
        }
        ctx.request_repaint();
    }

    /// Tells whether an action that switches something has switched it on; nothing for others.
    #[must_use]
    pub fn is_on(&self, action: Action) -> Option<bool> {
        use Action as A;
        Some(match action {
            A::Watch => self.watch.is_some(),
            A::Turntable => self.is_turning,
            A::Parallel => self.navigation.is_parallel(),
            A::Backend(number) => self
                .panes
                .get(self.active)
                .is_some_and(|p| self.backends.get(usize::from(number)) == Some(&p.backend)),
            A::SideBySide => self.mode == Mode::SideBySide,
            A::Wipe => self.mode == Mode::Wipe,
            A::Flip => self.mode == Mode::Flip,
            A::Difference => self.mode == Mode::Difference,
            A::ErrorMaps => self.mode == Mode::ErrorMaps,
            A::EqualTime => self.equal.is_time(),
            A::EqualError => self.equal.is_error(),
            A::Objects => self.panels.objects,
            A::Settings => self.panels.settings,
            A::Values => self.panels.values,
            A::Errors => self.truth.is_some(),
            A::Chart => self.panels.chart,
            A::NoTool => self.tool == Tool::Choose,
            A::Move => self.tool == Tool::Move,
            A::Turn => self.tool == Tool::Turn,
            A::Scale => self.tool == Tool::Scale,
            A::Paint => self.tool == Tool::Paint,
            A::Erase => self.tool == Tool::Erase,
            A::Raise => self.tool == Tool::Raise,
            A::Lower => self.tool == Tool::Lower,
            A::Welcome => self.panels.welcome,
            _ => return None,
        })
    }

    /// Tells whether an action can be done now.
    pub(crate) fn can(&self, action: Action) -> bool {
        match action {
            Action::Undo => self.document.can()[0],
            Action::Redo => self.document.can()[1],
            Action::Duplicate | Action::Delete | Action::FrameChosen => self.chosen.is_some(),
            Action::Reload | Action::Watch => self.document.file().is_some(),
            Action::Backend(number) => usize::from(number) < self.backends.len(),
            Action::RemovePane => self.panes.len() > 1,
            _ => true,
        }
    }

    fn toggle_mode(&mut self, mode: Mode) {
        self.mode = if self.mode == mode { Mode::SideBySide } else { mode };
    }

    /// Puts away what lies on top: a list, a dialog, and then the tool.
    fn leave(&mut self) {
        if self.palette.take().is_none() && self.dialog.take().is_none() {
            self.panels.welcome = false;
            self.tool = Tool::Choose;
        }
    }

    /// Has the active pane drawn by another back end. What was set by meaning is taken along.
    fn switch(&mut self, number: u8, ctx: &Context) {
        let Some(id) = self.backends.get(usize::from(number)).cloned() else { return };
        self.set_backend(self.active, id);
        // The panel shows other parameters now: none of them is to take the next key.
        ctx.memory_mut(|memory| {
            if let Some(focused) = memory.focused() {
                memory.surrender_focus(focused);
            }
        });
    }

    fn next_channel(&mut self) {
        let Some(pane) = self.panes.get_mut(self.active) else { return };
        let at = Channel::ALL.iter().position(|c| *c == pane.channel).unwrap_or(0);
        pane.channel = Channel::ALL[(at + 1) % Channel::ALL.len()];
    }

    /// Width over height of the active pane's picture.
    fn aspect(&self) -> f64 {
        let [width, height] = self.panes.get(self.active).map_or([1, 1], |pane| pane.size);
        f64::from(width.max(1)) / f64::from(height.max(1))
    }

    fn frame(&mut self, only_chosen: bool) {
        let chosen = match self.chosen {
            Some(Chosen::Object(index)) if only_chosen => self.document.scene.objects.get(index),
            _ => None,
        };
        let bounds = chosen.map_or(self.document.scene.bounds(), polyptych::scene::Object::bounds);
        self.navigation.frame(bounds, self.aspect());
    }

    fn look_along(&mut self, direction: DVec3) {
        self.navigation.look_along(direction, self.aspect());
    }

    fn next_camera(&mut self) {
        let cameras = &self.document.scene.cameras;
        let at = cameras.iter().position(|(_, camera)| *camera == self.navigation.camera);
        let next = at.map_or(0, |at| (at + 1) % cameras.len().max(1));
        if let Some((name, camera)) = cameras.get(next) {
            self.message = format!("camera {name}");
            self.navigation = Navigation::new(camera.clone(), self.document.scene.bounds());
        }
    }

    pub(crate) fn set_theme(&mut self, is_light: bool, ctx: &Context) {
        self.memory.is_light = is_light;
        ctx.set_theme(if is_light { eframe::egui::Theme::Light } else { eframe::egui::Theme::Dark });
    }

    pub(crate) fn set_zoom(&mut self, zoom: f32, ctx: &Context) {
        self.memory.zoom = zoom.clamp(ZOOMS[0], ZOOMS[1]);
        ctx.set_zoom_factor(self.memory.zoom);
    }
}
