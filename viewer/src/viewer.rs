//! The window: which panes, which mode, which scene, and what the keys do.

use crate::ViewerError;
use crate::loading::Loading;
use crate::navigation::Navigation;
use crate::painter::{Order, Painter};
use crate::pane::{Pane, grid};
use crate::settings;
use eframe::egui::{self, Color32, Key, Pos2, Rect, Sense, Stroke, Vec2};
use polyptych::convert::Converter;
use polyptych::framebuffer::Channel;
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

/// How panes share the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Beside one another.
    SideBySide,
    /// The first two over one another, with a line between them that can be dragged.
    Wipe,
}

/// The viewer: back ends side by side, with one camera.
pub struct Viewer {
    registry: Registry,
    backends: Vec<String>,
    /// Why plugins are not among them.
    refused: Vec<String>,
    pool: Pool,
    converter: Arc<Converter>,
    scene: Arc<Scene>,
    navigation: Navigation,
    panes: Vec<Pane>,
    /// The pane that keys act on.
    active: usize,
    mode: Mode,
    /// Where the line of a wipe is, as a share of the width.
    line: f32,
    /// What was set for each back end, kept while another one is shown.
    settings: BTreeMap<String, Settings>,
    loading: Option<Loading>,
    message: String,
    shows_settings: bool,
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
            && self.panes.iter().all(|pane| {
                let full = pane.painting().is_some_and(|p| p.is_full && p.backend == pane.backend);
                !pane.painter.is_busy() && (full || pane.failure.is_some())
            })
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
        if self.shows_settings {
            changed |= self.show_settings(ui);
        }
        egui::CentralPanel::no_frame().show(ui, |ui| {
            let rect = ui.available_rect_before_wrap();
            changed |= match self.mode {
                Mode::Wipe if self.panes.len() >= 2 => self.show_wipe(ui, rect),
                Mode::SideBySide | Mode::Wipe => self.show_grid(ui, rect),
            };
        });
        for pane in &mut self.panes {
            pane.update(&ctx);
        }
        if changed {
            self.order_all();
        }
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
            let wake = ctx.clone();
            let painter =
                Painter::new(self.registry.clone(), self.pool.clone(), self.converter.clone(), move || {
                    wake.request_repaint();
                });
            self.panes.push(Pane::new(backend, Channel::Color, painter));
        }
        self.active = self.active.min(count - 1);
    }

    /// Orders the pictures of all panes anew.
    fn order_all(&self) {
        self.panes.iter().for_each(|pane| self.order(pane));
    }

    fn order(&self, pane: &Pane) {
        let [width, height] = pane.size;
        if width == 0 || height == 0 {
            return;
        }
        let settings = self.settings(&pane.backend);
        let need = Need { settings, ..Need::new(self.navigation.camera.clone(), width, height) };
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
        let (digit, frame, next, wipe) = ctx.input(|i| {
            let digit = DIGITS.iter().position(|key| i.key_pressed(*key));
            (digit, i.key_pressed(Key::F), i.key_pressed(Key::C), i.key_pressed(Key::X))
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
        if wipe {
            self.mode = if self.mode == Mode::Wipe { Mode::SideBySide } else { Mode::Wipe };
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
                ui.selectable_value(&mut self.mode, Mode::SideBySide, "Side by side");
                ui.selectable_value(&mut self.mode, Mode::Wipe, "Wipe");
                ui.toggle_value(&mut self.shows_settings, "Settings");
                ui.separator();
                ui.label(&self.message);
            });
            ui.small(
                "Drag: orbit. Shift-drag: pan. Scroll: nearer. WASD QE: fly. F: show all. 1-9: back end of the \
                 chosen pane. C: channel. X: wipe. Drop a file: open it.",
            );
        });
        changed
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

    /// Shows the panes beside one another. Tells whether pictures change.
    fn show_grid(&mut self, ui: &mut egui::Ui, rect: Rect) -> bool {
        let mut changed = false;
        let cells = grid(rect, self.panes.len());
        for (index, cell) in cells.into_iter().enumerate() {
            changed |= self.show_pane(ui, index, cell.shrink(2.0));
        }
        changed
    }

    fn show_pane(&mut self, ui: &mut egui::Ui, index: usize, cell: Rect) -> bool {
        let mut changed = false;
        let (scene, backends, refused) = (self.scene.clone(), &self.backends, &self.refused);
        let pane = &mut self.panes[index];
        let header = ui.scope_builder(egui::UiBuilder::new().max_rect(cell), |ui| {
            changed |= pane.header(ui, (backends, refused), index, &scene);
        });
        let top = header.response.rect.bottom() + 2.0;
        let picture = Rect::from_min_max(Pos2::new(cell.left(), top.min(cell.bottom())), cell.max);
        let response = ui.interact(picture, ui.scope_id().with(("picture", index)), Sense::click_and_drag());
        pane.draw(ui.painter(), picture, picture);
        changed |= resize(pane, picture, ui.ctx().pixels_per_point());
        if response.hovered() || response.dragged() {
            self.active = index;
        }
        if self.active == index && self.panes.len() > 1 {
            let stroke = Stroke::new(1.0, ui.visuals().selection.bg_fill);
            ui.painter().rect_stroke(picture, 0.0, stroke, egui::StrokeKind::Outside);
        }
        changed | self.navigation.follow(ui, &response)
    }

    /// Shows the first two panes over one another. Tells whether pictures change.
    fn show_wipe(&mut self, ui: &mut egui::Ui, rect: Rect) -> bool {
        let mut changed = false;
        let scene = self.scene.clone();
        let halves = grid(rect, 2);
        let mut top = rect.top();
        for (index, half) in halves.into_iter().enumerate() {
            let header = ui.scope_builder(egui::UiBuilder::new().max_rect(half), |ui| {
                changed |= self.panes[index].header(ui, (&self.backends, &self.refused), index, &scene);
            });
            top = top.max(header.response.rect.bottom() + 2.0);
        }
        let picture = Rect::from_min_max(Pos2::new(rect.left(), top.min(rect.bottom())), rect.max);
        let response = ui.interact(picture, ui.scope_id().with("wipe"), Sense::click_and_drag());
        let x = picture.left() + picture.width() * self.line;
        let handle =
            Rect::from_center_size(Pos2::new(x, picture.center().y), Vec2::new(9.0, picture.height()));
        let grip = ui.interact(handle, ui.scope_id().with("line"), Sense::drag());
        if let Some(pointer) = grip.interact_pointer_pos().filter(|_| grip.dragged()) {
            self.line = ((pointer.x - picture.left()) / picture.width().max(1.0)).clamp(0.0, 1.0);
        }
        if grip.hovered() || grip.dragged() {
            ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
        }
        for index in 0..2 {
            let (mut clip, pixels) = (picture, ui.ctx().pixels_per_point());
            if index == 0 {
                clip.max.x = x;
            } else {
                clip.min.x = x;
            }
            changed |= resize(&mut self.panes[index], picture, pixels);
            self.panes[index].draw(ui.painter(), picture, clip);
        }
        ui.painter().vline(x, picture.y_range(), Stroke::new(1.5, Color32::WHITE));
        if let Some(pointer) = response.hover_pos() {
            self.active = usize::from(pointer.x > x);
        }
        changed | (!grip.dragged() && self.navigation.follow(ui, &response))
    }
}

/// Fits a pane's picture to its place on the screen. Tells whether its size changed.
fn resize(pane: &mut Pane, picture: Rect, pixels_per_point: f32) -> bool {
    let pixels = |points: f32| (points * pixels_per_point).round().clamp(0.0, 16384.0) as u32;
    let size = [pixels(picture.width()), pixels(picture.height())];
    let changed = pane.size != size;
    pane.size = size;
    changed
}

impl eframe::App for Viewer {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        Self::ui(self, ui);
    }
}
