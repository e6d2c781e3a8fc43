//! What does the window hold, and in which order is it shown?

use crate::ViewerError;
use crate::brush::Brush;
use crate::chart::LiveChart;
use crate::dialog::Dialog;
use crate::difference::Comparer;
use crate::document::{Document, Errand};
use crate::equal::Equal;
use crate::keeper::{Keeper, Memory};
use crate::live::Program;
use crate::measure::Times;
use crate::modes::Mode;
use crate::navigation::Navigation;
use crate::painter::Crew;
use crate::palette::Palette;
use crate::pane::Pane;
use crate::scene_panel::Chosen;
use crate::script::Script;
use crate::tools::Tool;
use crate::watch::Watch;
use eframe::egui;
use polyptych::convert::Converter;
use polyptych::scene::Scene;
use polyptych::seam::{Registry, Settings};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Panels that are shown beside the pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Panels {
    pub(crate) objects: bool,
    pub(crate) settings: bool,
    pub(crate) values: bool,
    pub(crate) chart: bool,
    /// The first screen, which says how to begin.
    pub(crate) welcome: bool,
}

/// The viewer: back ends side by side, with one camera.
pub struct Viewer {
    pub(crate) registry: Registry,
    pub(crate) backends: Vec<String>,
    /// Why plugins are not among them.
    pub(crate) refused: Vec<String>,
    pub(crate) converter: Arc<Converter>,
    /// The painters of all panes.
    pub(crate) crew: Crew,
    pub(crate) document: Document,
    pub(crate) loading: Option<Errand<Scene>>,
    /// Whether what is being read takes the place of the same file, seen as before.
    pub(crate) is_reloading: bool,
    pub(crate) saving: Option<Errand<Arc<Scene>>>,
    pub(crate) watch: Option<Watch>,
    pub(crate) navigation: Navigation,
    pub(crate) is_turning: bool,
    pub(crate) panes: Vec<Pane>,
    /// The pane that keys act on.
    pub(crate) active: usize,
    pub(crate) mode: Mode,
    /// Where the line of a wipe is, as a share of the width.
    pub(crate) line: f32,
    /// What was set for each back end, kept while another one is shown.
    pub(crate) settings: BTreeMap<String, Settings>,
    pub(crate) equal: Equal,
    /// What is to be said in the bar.
    pub(crate) message: String,
    pub(crate) panels: Panels,
    pub(crate) dialog: Option<Dialog>,
    pub(crate) palette: Option<Palette>,
    pub(crate) tool: Tool,
    pub(crate) brush: Brush,
    /// What is chosen in the scene.
    pub(crate) chosen: Option<Chosen>,
    /// The place under the mouse, as shares of a picture's width and height.
    pub(crate) pointed: Option<[f32; 2]>,
    /// What differs between the first two panes.
    pub(crate) difference: Comparer,
    /// The reference that all panes are held against, while that is wanted.
    pub(crate) truth: Option<Pane>,
    /// Whether pictures are shown whose comparison is not done yet.
    pub(crate) compares_still: bool,
    pub(crate) chart: LiveChart,
    pub(crate) keeper: Option<Keeper>,
    pub(crate) memory: Memory,
    /// Scenes that earlier sessions left unsaved.
    pub(crate) left_over: Vec<PathBuf>,
    pub(crate) script: Option<Script>,
    pub(crate) program: Option<Program>,
    /// How long the window's thread took for each frame, and with laying out and painting all of it.
    pub(crate) frames: Times,
    pub(crate) whole_frames: Times,
    /// Pictures that are being written.
    pub(crate) writing: Option<Errand<()>>,
}

impl Viewer {
    /// Makes a viewer with two panes.
    ///
    /// # Errors
    /// When no threads can be started.
    pub fn new(registry: Registry, scene: Scene) -> Result<Self, ViewerError> {
        let document = Document::new(scene, None);
        let scene = &document.scene;
        let navigation = Navigation::new(scene.cameras[0].1.clone(), scene.bounds());
        Ok(Self {
            backends: registry.ids().map(str::to_owned).collect(),
            registry,
            refused: Vec::new(),
            converter: Arc::default(),
            crew: Crew::default(),
            document,
            loading: None,
            is_reloading: false,
            saving: None,
            watch: None,
            navigation,
            is_turning: false,
            panes: Vec::new(),
            active: 0,
            mode: Mode::SideBySide,
            line: 0.5,
            settings: BTreeMap::new(),
            equal: Equal::default(),
            message: String::new(),
            panels: Panels::default(),
            dialog: None,
            palette: None,
            tool: Tool::default(),
            brush: Brush::default(),
            chosen: None,
            pointed: None,
            difference: Comparer::default(),
            truth: None,
            compares_still: false,
            chart: LiveChart::default(),
            keeper: None,
            memory: Memory::default(),
            left_over: Vec::new(),
            script: None,
            program: None,
            frames: Times::default(),
            whole_frames: Times::default(),
            writing: None,
        })
    }

    /// Lists plugins that were refused, a line each, below the back ends that can be chosen.
    pub fn list_refused(&mut self, lines: impl IntoIterator<Item = String>) {
        self.refused.extend(lines);
    }

    /// Says where the scene comes from: a file, or `builtin:NAME`.
    pub fn name_scene(&mut self, name: &str) {
        self.document.name = Some(name.to_owned());
        self.memory.opened(name);
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
        &self.document.scene
    }

    /// Chooses an object, as a click on it does.
    pub fn choose(&mut self, object: usize) {
        self.chosen = Some(Chosen::Object(object));
    }

    /// Tells whether there is a change to take back.
    #[must_use]
    pub fn can_undo(&self) -> bool {
        self.document.can()[0]
    }

    /// Returns what was set for a back end.
    #[must_use]
    pub fn settings(&self, backend: &str) -> Settings {
        self.settings.get(backend).cloned().unwrap_or_default()
    }

    /// Tells whether all panes show their full picture of what was ordered last, and nothing else is under way.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.under_way().is_none()
    }

    /// Says what is still under way.
    #[must_use]
    pub fn under_way(&self) -> Option<&'static str> {
        let truth_is_drawn = self.truth.as_ref().is_some_and(|truth| !truth.is_at_rest() || truth.waits);
        [
            (self.loading.is_some(), "reading a scene"),
            (self.saving.is_some(), "saving the scene"),
            (self.writing.is_some(), "writing a picture"),
            (self.equal.is_busy(), "trying tolerances"),
            (!self.panes.iter().all(Pane::is_at_rest), "drawing"),
            (truth_is_drawn, "drawing the reference"),
            (self.compares_still, "comparing"),
        ]
        .into_iter()
        .find_map(|(is_so, what)| is_so.then_some(what))
    }

    /// Returns the map of what differs between the first two panes, row by row, in the mode that shows it.
    #[must_use]
    pub fn difference(&self) -> Option<Vec<[u8; 3]>> {
        self.difference.pixels().filter(|_| self.mode == Mode::Difference)
    }

    /// Returns how far a pane is from the reference, in words, while that is shown.
    #[must_use]
    pub fn error(&self, pane: usize) -> Option<String> {
        self.panes.get(pane)?.error.summary().filter(|_| self.truth.is_some())
    }

    /// Returns the pixels that a pane shows, row by row, with width and height.
    #[must_use]
    pub fn picture(&self, pane: usize) -> Option<(Vec<[u8; 3]>, [usize; 2])> {
        let image = &self.panes.get(pane)?.painting()?.image;
        Some((image.pixels.iter().map(|p| [p.r(), p.g(), p.b()]).collect(), image.size))
    }

    /// Returns what the bar says.
    #[must_use]
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Returns the times from stopping a picture until its painter was free, of all panes.
    #[must_use]
    pub fn stops(&self) -> Times {
        let mut all = Times::default();
        self.panes.iter().chain(&self.truth).for_each(|pane| all.extend(&pane.painter.stops()));
        all
    }

    /// Returns how long the window's thread took for each frame.
    #[must_use]
    pub fn frames(&self) -> &Times {
        &self.frames
    }

    /// Shows everything.
    pub fn ui(&mut self, ui: &mut egui::Ui) {
        let begin = Instant::now();
        let ctx = ui.ctx().clone();
        if self.panes.is_empty() {
            self.open_first_panes(&ctx);
        }
        self.take_files(&ctx);
        self.follow_script(&ctx);
        self.run_program(&ctx);
        self.follow_keys(&ctx);
        self.move_camera(&ctx);

        self.show_bar(ui);
        self.show_panels(ui);
        let frame = egui::Frame::NONE.fill(ui.visuals().panel_fill);
        egui::CentralPanel::no_frame().frame(frame).show(ui, |ui| {
            let rect = ui.available_rect_before_wrap();
            self.show_panes(ui, rect);
        });
        self.show_dialogs(&ctx);

        for pane in self.panes.iter_mut().chain(&mut self.truth) {
            pane.update(&ctx);
        }
        self.balance(&ctx);
        self.order_pictures();
        self.compare(&ctx);
        self.keep(&ctx);
        self.frames.add(begin.elapsed());
    }

    /// Shows the panels around the pictures that are open.
    fn show_panels(&mut self, ui: &mut egui::Ui) {
        if self.panels.objects {
            self.show_scene(ui);
        }
        if self.panels.settings {
            self.show_settings(ui);
        }
        if self.panels.values {
            self.show_values(ui);
        }
        if self.panels.chart {
            self.show_chart(ui);
        }
    }
}

impl eframe::App for Viewer {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        let before = frame.info().cpu_usage;
        before.into_iter().for_each(|time| self.whole_frames.add(Duration::from_secs_f32(time)));
        Self::ui(self, ui);
    }

    fn on_exit(&mut self, _gl: Option<&eframe::glow::Context>) {
        // What was kept a moment ago may not be written yet.
        self.keeper = None;
    }
}
