//! The window: which panes, which mode, which scene, and what the keys do.

use crate::ViewerError;
use crate::difference::Comparer;
use crate::history::History;
use crate::loading::Loading;
use crate::modes::Mode;
use crate::navigation::Navigation;
use crate::painter::{Order, Painter};
use crate::pane::Pane;
use crate::scene_panel::Chosen;
use crate::{probe, scene_panel, settings};
use eframe::egui::{self, Key};
use polyptych::convert::Converter;
use polyptych::framebuffer::{Channel, Channels};
use polyptych::load::add_default_view;
use polyptych::parallel::Pool;
use polyptych::scene::Scene;
use polyptych::seam::{Need, Registry, Settings};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Back ends of the first panes: a method beside the ruler.
const FIRST: [&str; 4] = ["raster", "reference", "voxel", "freeform"];
/// Most panes at once.
const MOST: usize = 9;

/// The viewer: back ends side by side, with one camera.
pub struct Viewer {
    registry: Registry,
    pub(crate) backends: Vec<String>,
    /// Why plugins are not among them.
    pub(crate) refused: Vec<String>,
    pool: Pool,
    converter: Arc<Converter>,
    pub(crate) scene: Arc<Scene>,
    pub(crate) navigation: Navigation,
    pub(crate) panes: Vec<Pane>,
    /// The pane that keys act on.
    pub(crate) active: usize,
    pub(crate) mode: Mode,
    /// Where the line of a wipe is, as a share of the width.
    pub(crate) line: f32,
    /// What was set for each back end, kept while another one is shown.
    settings: BTreeMap<String, Settings>,
    loading: Option<Loading>,
    message: String,
    shows_settings: bool,
    shows_scene: bool,
    /// What is chosen in the scene.
    pub(crate) chosen: Option<Chosen>,
    history: History,
    /// Whether the values of all panes are listed for the place under the mouse.
    pub(crate) shows_values: bool,
    /// That place, as shares of a picture's width and height.
    pub(crate) pointed: Option<[f32; 2]>,
    /// What differs between the first two panes.
    pub(crate) difference: Comparer,
    /// The reference that all panes are held against, while that is wanted.
    pub(crate) truth: Option<Pane>,
    /// Whether the reference's picture is still to be ordered: it waits until the panes are done.
    truth_waits: bool,
    /// Whether pictures are shown whose comparison is not done yet.
    compares_still: bool,
}

impl Viewer {
    /// Makes a viewer with two panes.
    ///
    /// # Errors
    /// When no threads can be started.
    pub fn new(registry: Registry, mut scene: Scene) -> Result<Self, ViewerError> {
        add_default_view(&mut scene);
        let backends: Vec<_> = registry.ids().map(str::to_owned).collect();
        let camera = scene.cameras[0].1.clone();
        let navigation = Navigation::new(camera, scene.bounds());
        Ok(Self {
            registry,
            backends,
            refused: Vec::new(),
            pool: Pool::new(0).map_err(ViewerError::Threads)?,
            converter: Arc::default(),
            scene: Arc::new(scene),
            navigation,
            panes: Vec::new(),
            active: 0,
            mode: Mode::SideBySide,
            line: 0.5,
            settings: BTreeMap::new(),
            loading: None,
            message: String::new(),
            shows_settings: false,
            shows_scene: false,
            chosen: None,
            history: History::default(),
            shows_values: false,
            pointed: None,
            difference: Comparer::default(),
            truth: None,
            truth_waits: false,
            compares_still: false,
        })
    }

    /// Lists plugins that were refused, a line each, below the back ends that can be chosen.
    pub fn list_refused(&mut self, lines: impl IntoIterator<Item = String>) {
        self.refused.extend(lines);
    }

    /// Lists the back ends of the panes.
    pub fn shown(&self) -> impl Iterator<Item = &str> {
        self.panes.iter().map(|pane| pane.backend.as_str())
    }

    /// Returns the camera that all panes share.
    #[must_use]
    pub fn camera(&self) -> &polyptych::camera::Camera {
        &self.navigation.camera
    }

    /// Returns how panes share the window.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Returns the scene.
    #[must_use]
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Returns what was set for a back end.
    #[must_use]
    pub fn settings(&self, backend: &str) -> Settings {
        self.settings.get(backend).cloned().unwrap_or_default()
    }

    /// Tells whether all panes show their full picture of what was ordered last.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.loading.is_none()
            && !self.compares_still
            && !self.truth_waits
            && self.panes.iter().chain(&self.truth).all(Pane::is_at_rest)
    }

    /// Returns the map of what differs between the first two panes, row by row, in the mode that shows it.
    #[must_use]
    pub fn difference(&self) -> Option<&[[u8; 3]]> {
        self.difference.pixels().filter(|_| self.mode == Mode::Difference)
    }

    /// Returns how far a pane is from the reference, in words, while that is shown.
    #[must_use]
    pub fn error(&self, pane: usize) -> Option<String> {
        self.panes.get(pane)?.error.summary().filter(|_| self.truth.is_some())
    }

    /// Returns the pixels that a pane shows, row by row, with width and height.
    #[must_use]
    pub fn picture(&self, pane: usize) -> Option<(&[[u8; 3]], [usize; 2])> {
        self.panes.get(pane)?.painting().map(|p| (&p.pixels[..], p.size))
    }

    /// Begins to open a scene file, a model, or `builtin:NAME`; what is shown stays until it is read.
    pub fn open(&mut self, name: &str, ctx: &egui::Context) {
        let ctx = ctx.clone();
        self.message = format!("opening {name}");
        self.loading = Some(Loading::start(name.to_owned(), move || ctx.request_repaint()));
    }

    /// Shows everything.
    pub fn ui(&mut self, ui: &mut egui::Ui) {
        let ctx = ui.ctx().clone();
        if self.panes.is_empty() {
            self.set_count(2, &ctx);
        }
        self.take_files(&ctx);
        let mut changed = self.take_scene();
        changed |= self.take_keys(&ctx);
        changed |= self.show_bar(ui, &ctx);
        if self.shows_scene {
            changed |= self.show_scene(ui);
        }
        if self.shows_settings {
            changed |= self.show_settings(ui);
        }
        if self.shows_values {
            self.show_values(ui);
        }
        egui::CentralPanel::no_frame().show(ui, |ui| {
            let rect = ui.available_rect_before_wrap();
            changed |= self.show_panes(ui, rect);
        });
        for pane in self.panes.iter_mut().chain(&mut self.truth) {
            pane.update(&ctx);
        }
        if let (Some(truth), Some(pane)) = (&mut self.truth, self.panes.first()) {
            changed |= truth.size != pane.size || truth.channel != pane.channel;
            (truth.size, truth.channel) = (pane.size, pane.channel);
        }
        if changed {
            self.panes.iter().for_each(|pane| self.order(pane));
            self.truth_waits = self.truth.is_some();
        }
        if let Some(truth) = self.truth.as_ref().filter(|_| self.truth_waits)
            && self.panes.iter().all(Pane::is_at_rest)
        {
            self.order(truth);
            self.truth_waits = false;
        }
        self.compare(&ctx);
    }

    /// Holds full pictures against one another where that is shown.
    fn compare(&mut self, ctx: &egui::Context) {
        let full = |pane: &Pane| {
            pane.painting().filter(|p| p.is_full && !pane.painter.is_busy()).map(|p| p.framebuffer.clone())
        };
        self.compares_still = false;
        if let (Mode::Difference, [first, second, ..]) = (self.mode, &self.panes[..])
            && let (Some(a), Some(b)) = (full(first), full(second))
        {
            self.compares_still |= !self.difference.compare([&a, &b], first.channel, ctx);
        }
        let Some(truth) = self.truth.as_ref().filter(|_| !self.truth_waits).and_then(full) else { return };
        for pane in &mut self.panes {
            if let Some(picture) = full(pane) {
                self.compares_still |= !pane.error.compare([&picture, &truth], Channel::Color, ctx);
            }
        }
    }

    /// Lists what all panes show at the place under the mouse.
    fn show_values(&self, ui: &mut egui::Ui) {
        egui::Panel::bottom("values").show(ui, |ui| {
            let Some(place) = self.pointed else {
                ui.label("Point at a picture: here are the values of all panes at that place.");
                return;
            };
            egui::Grid::new("values of panes").striped(true).show(ui, |ui| {
                for pane in &self.panes {
                    ui.strong(&pane.backend);
                    let picture = pane.painting().map(|painting| &painting.framebuffer);
                    for (channel, value) in
                        picture.map(|p| probe::values(p, &self.scene, place)).unwrap_or_default()
                    {
                        ui.label(format!("{} {value}", channel.name()));
                    }
                    ui.end_row();
                }
            });
        });
    }

    /// Starts or stops holding all panes against the reference.
    fn set_truth(&mut self, wanted: bool, ctx: &egui::Context) {
        self.truth = wanted.then(|| Pane::new("reference".to_owned(), Channel::Color, self.painter(ctx)));
    }

    fn painter(&self, ctx: &egui::Context) -> Painter {
        let wake = ctx.clone();
        let (registry, pool, converter) = (self.registry.clone(), self.pool.clone(), self.converter.clone());
        Painter::new(registry, pool, converter, move || wake.request_repaint())
    }

    /// Opens as many panes as asked for, or closes the last ones.
    fn set_count(&mut self, count: usize, ctx: &egui::Context) {
        let count = count.clamp(1, MOST);
        self.panes.truncate(count);
        while self.panes.len() < count {
            let index = self.panes.len();
            let wanted = FIRST.get(index).copied().unwrap_or_default();
            let fallback = self.backends.get(index % self.backends.len().max(1));
            let known = self.backends.iter().find(|id| *id == wanted).or(fallback);
            let Some(backend) = known.cloned() else { return };
            let painter = self.painter(ctx);
            self.panes.push(Pane::new(backend, Channel::Color, painter));
        }
        self.active = self.active.min(count - 1);
    }

    fn order(&self, pane: &Pane) {
        let [width, height] = pane.size;
        if width == 0 || height == 0 {
            return;
        }
        let settings = self.settings(&pane.backend);
        let held_together = self.shows_values || self.truth.is_some() || self.mode == Mode::Difference;
        let mut channels = if held_together { Channels::ALL } else { Channels::of(&[pane.channel]) };
        if self.shows_scene {
            // A click chooses what is there.
            channels = channels.with(Channel::Id);
        }
        let need = Need { settings, channels, ..Need::new(self.navigation.camera.clone(), width, height) };
        pane.painter.order(Order {
            backend: pane.backend.clone(),
            scene: self.scene.clone(),
            need,
            channel: pane.channel,
        });
    }

    fn take_files(&mut self, ctx: &egui::Context) {
        let dropped = ctx.input(|i| i.raw.dropped_files.first().map(|f| f.path().to_owned()));
        if let Some(path) = dropped {
            self.open(&path.to_string_lossy(), ctx);
        }
    }

    /// Takes over a scene that was read. Tells whether there is one.
    fn take_scene(&mut self) -> bool {
        let Some(result) = self.loading.as_ref().and_then(Loading::poll) else { return false };
        self.loading = None;
        match result {
            Ok(mut scene) => {
                add_default_view(&mut scene);
                self.navigation = Navigation::new(scene.cameras[0].1.clone(), scene.bounds());
                self.message = format!("{}: {} objects", scene.name, scene.objects.len());
                self.scene = Arc::new(scene);
                (self.chosen, self.history) = (None, History::default());
                true
            }
            Err(why) => {
                self.message = why;
                false
            }
        }
    }

    /// Does what the keys say. Tells whether pictures change.
    fn take_keys(&mut self, ctx: &egui::Context) -> bool {
        if ctx.text_edit_focused() {
            return false;
        }
        const DIGITS: [Key; 9] = [
            Key::Num1,
            Key::Num2,
            Key::Num3,
            Key::Num4,
            Key::Num5,
            Key::Num6,
            Key::Num7,
            Key::Num8,
            Key::Num9,
        ];
        let (digit, frame, next) = ctx.input(|i| {
            let digit = DIGITS.iter().position(|key| i.key_pressed(*key));
            (digit, i.key_pressed(Key::F), i.key_pressed(Key::C))
        });
        let mut changed = ctx.input(|i| self.navigation.follow_keys(i));
        if changed {
            ctx.request_repaint();
        }
        if let (Some(id), Some(pane)) =
            (digit.and_then(|d| self.backends.get(d)), self.panes.get_mut(self.active))
        {
            changed |= pane.backend != *id;
            pane.backend.clone_from(id);
            // The panel shows other parameters now: none of them is to take the next key.
            ctx.memory_mut(|memory| {
                if let Some(focused) = memory.focused() {
                    memory.surrender_focus(focused);
                }
            });
        }
        if frame {
            let [width, height] = self.panes.get(self.active).map_or([1, 1], |pane| pane.size);
            self.navigation.frame(f64::from(width.max(1)) / f64::from(height.max(1)));
            changed = true;
        }
        if let (true, Some(pane)) = (next, self.panes.get_mut(self.active)) {
            let at = Channel::ALL.iter().position(|c| *c == pane.channel).unwrap_or(0);
            pane.channel = Channel::ALL[(at + 1) % Channel::ALL.len()];
            changed = true;
        }
        let pressed = |key: Key| ctx.input_mut(|i| i.consume_key(egui::Modifiers::COMMAND, key));
        let (undo, redo) = (pressed(Key::Z), pressed(Key::Y));
        changed |= self.step_back(undo) | self.step_forward(redo);
        for (key, mode) in [(Key::X, Mode::Wipe), (Key::Z, Mode::Flip), (Key::G, Mode::Difference)] {
            if ctx.input(|i| i.key_pressed(key)) {
                self.mode = if self.mode == mode { Mode::SideBySide } else { mode };
                changed = true;
            }
        }
        if ctx.input(|i| i.key_pressed(Key::V)) {
            self.shows_values = !self.shows_values;
            changed = true;
        }
        changed
    }

    /// Shows the bar at the top. Tells whether pictures change.
    fn show_bar(&mut self, ui: &mut egui::Ui, ctx: &egui::Context) -> bool {
        let mut changed = false;
        egui::Panel::top("bar").show(ui, |ui| {
            ui.horizontal_wrapped(|ui| {
                let scenes = ui.menu_button("Scene", |ui| {
                    let names = polyptych::builtin::NAMES.map(|name| format!("builtin:{name}"));
                    names.into_iter().find(|name| ui.button(name).clicked())
                });
                if let Some(name) = scenes.inner.flatten() {
                    self.open(&name, ctx);
                }
                let cameras: Vec<_> = self.scene.cameras.clone();
                let chosen = ui.menu_button("Camera", |ui| {
                    cameras.into_iter().find(|(name, _)| ui.button(name).clicked())
                });
                if let Some((_, camera)) = chosen.inner.flatten() {
                    self.navigation = Navigation::new(camera, self.scene.bounds());
                    changed = true;
                }
                ui.separator();
                ui.label("Panes");
                for count in 1..=4 {
                    if ui.selectable_label(self.panes.len() == count, count.to_string()).clicked() {
                        self.set_count(count, ctx);
                        changed = true;
                    }
                }
                ui.separator();
                for (mode, name) in Mode::ALL {
                    changed |= ui.selectable_value(&mut self.mode, mode, name).changed();
                }
                ui.separator();
                changed |= ui.toggle_value(&mut self.shows_scene, "Objects").changed();
                ui.toggle_value(&mut self.shows_settings, "Settings");
                changed |= ui.toggle_value(&mut self.shows_values, "Values").changed();
                let mut wanted = self.truth.is_some();
                if ui.toggle_value(&mut wanted, "Errors").changed() {
                    self.set_truth(wanted, ctx);
                    changed = true;
                }
                ui.separator();
                ui.label(&self.message);
            });
            ui.small(
                "Drag: orbit. Shift-drag: pan. Scroll: nearer. WASD QE: fly. F: show all. 1-9: back end of the \
                 chosen pane. C: channel. X: wipe. Z: flip. G: difference. V: values. Drop a file: open it.",
            );
        });
        changed
    }

    /// Shows what is in the scene. Tells whether it was changed.
    fn show_scene(&mut self, ui: &mut egui::Ui) -> bool {
        let center = self.navigation.pivot();
        let panel = egui::Panel::left("scene").exact_size(310.0).show(ui, |ui| {
            let step = ui.horizontal(|ui| {
                let [undo, redo] = self.history.can();
                let undo = ui.add_enabled(undo, egui::Button::new("Undo")).on_hover_text("Ctrl-Z").clicked();
                let redo = ui.add_enabled(redo, egui::Button::new("Redo")).on_hover_text("Ctrl-Y").clicked();
                (undo, redo)
            });
            (step.inner, scene_panel::show(ui, &self.scene, &mut self.chosen, center))
        });
        let ((undo, redo), edit) = panel.inner;
        if let Some(edit) = edit {
            self.history.keep(&self.scene, &edit.what, ui.input(|i| i.time));
            self.scene = Arc::new(edit.scene);
            return true;
        }
        self.step_back(undo) | self.step_forward(redo)
    }

    fn step_back(&mut self, wanted: bool) -> bool {
        let scene = wanted.then(|| self.history.undo(&self.scene)).flatten();
        scene.map(|scene| self.scene = scene).is_some()
    }

    fn step_forward(&mut self, wanted: bool) -> bool {
        let scene = wanted.then(|| self.history.redo(&self.scene)).flatten();
        scene.map(|scene| self.scene = scene).is_some()
    }

    /// Chooses what a picture shows at the place under the mouse.
    pub(crate) fn choose_at(&mut self, pane: usize) {
        let (Some([x, y]), Some(painting)) = (self.pointed, self.panes.get(pane).and_then(Pane::painting))
        else {
            return;
        };
        let id = probe::id_at(&painting.framebuffer, [x, y]);
        self.chosen = id.map(|id| Chosen::Object(id as usize - 1));
    }

    /// Shows the parameters of the active pane's back end. Tells whether one was changed.
    fn show_settings(&mut self, ui: &mut egui::Ui) -> bool {
        let Some(id) = self.panes.get(self.active).map(|pane| pane.backend.clone()) else { return false };
        let Ok(info) = self.registry.info(&id) else { return false };
        let settings = self.settings.entry(id).or_default();
        let panel = egui::Panel::right("settings").show(ui, |ui| {
            ui.heading(&info.name);
            egui::ScrollArea::vertical().show(ui, |ui| settings::panel(ui, info, settings)).inner
        });
        panel.inner
    }
}

impl eframe::App for Viewer {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        Self::ui(self, ui);
    }
}
