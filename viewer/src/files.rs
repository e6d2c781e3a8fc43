//! How do scenes and pictures come from files and go to files, and what is kept of them?

use crate::document::{Document, Errand};
use crate::export::{sheet, unused, write_picture};
use crate::keeper::{Keeper, Memory};
use crate::modes::Mode;
use crate::navigation::Navigation;
use crate::scene_panel::Edit;
use crate::viewer::{Panels, Viewer};
use crate::watch::Watch;
use eframe::egui::{ColorImage, Context, ScreenshotCallback, ViewportCommand};
use polyptych::scene::Scene;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::channel;

impl Viewer {
    /// Begins to open a scene file, a model, or `builtin:NAME`; what is shown stays until it is read.
    pub fn open(&mut self, name: &str, ctx: &Context) {
        let wake = ctx.clone();
        self.message = format!("opening {name}");
        self.is_reloading = false;
        self.loading = Some(Errand::open(name.to_owned(), move || wake.request_repaint()));
    }

    pub(crate) fn reload(&mut self, ctx: &Context) {
        if let Some(file) = self.document.file() {
            self.open(&file.to_string_lossy(), ctx);
            self.is_reloading = true;
        }
    }

    pub(crate) fn set_watch(&mut self, wanted: bool, ctx: &Context) {
        let wake = ctx.clone();
        let file = self.document.file().filter(|_| wanted);
        self.watch = file.map(|file| Watch::new(file, move || wake.request_repaint()));
    }

    /// Writes the scene to its file; one that has none is asked for.
    pub(crate) fn save(&mut self, ctx: &Context) {
        match self.document.scene_file() {
            Some(file) => self.save_to(file, ctx),
            None => self.dialog = Some(crate::dialog::Dialog::save(&self.document)),
        }
    }

    /// Begins to write the scene to a file, `.ron` or `.json`.
    pub fn save_to(&mut self, file: PathBuf, ctx: &Context) {
        let wake = ctx.clone();
        self.message = format!("saving {}", file.display());
        self.saving = Some(Errand::save(self.document.scene.clone(), file, move || wake.request_repaint()));
    }

    /// Puts an edited scene in the place of the one that is shown.
    pub(crate) fn edit(&mut self, edit: Option<Edit>, ctx: &Context) {
        if let Some(edit) = edit {
            self.document.edit(edit.scene, &edit.what, ctx.input(|i| i.time));
        }
    }

    /// Takes over what was dropped on the window, read, written, or changed on disk.
    pub(crate) fn take_files(&mut self, ctx: &Context) {
        let dropped: Vec<_> =
            ctx.input(|i| i.raw.dropped_files.iter().map(|f| f.path().to_owned()).collect());
        match &dropped[..] {
            [] => {}
            [path] => self.open(&path.to_string_lossy(), ctx),
            several => self.message = format!("{} files were dropped: drop one at a time", several.len()),
        }
        if self.watch.as_ref().is_some_and(Watch::take) && self.saving.is_none() {
            self.reload(ctx);
        }
        if let Some(result) = self.loading.as_ref().and_then(Errand::poll) {
            let name = self.loading.take().map(|l| l.name).unwrap_or_default();
            match result {
                Ok(scene) => self.take_scene(scene, name, ctx),
                Err(why) => self.message = why,
            }
        }
        if let Some(result) = self.saving.as_ref().and_then(Errand::poll) {
            let name = self.saving.take().map(|s| s.name).unwrap_or_default();
            match result {
                Ok(scene) => self.was_saved(scene, &name, ctx),
                Err(why) => self.message = why,
            }
        }
        if let Some(result) = self.writing.as_ref().and_then(Errand::poll) {
            let name = self.writing.take().map(|w| w.name).unwrap_or_default();
            self.message = result.map_or_else(|why| why, |()| format!("wrote {name}"));
        }
    }

    fn take_scene(&mut self, scene: Scene, name: String, ctx: &Context) {
        self.message = format!("{}: {} objects", scene.name, scene.objects.len());
        let is_left_over = self.left_over.iter().any(|path| path.to_string_lossy() == name);
        if self.is_reloading {
            // The same scene, changed elsewhere: the view stays, and undo leads back.
            let scene = Document::new(scene, None).scene;
            self.document.edit(scene.clone(), "reload", ctx.input(|i| i.time));
            self.document.was_saved(scene, Path::new(&name));
            self.is_reloading = false;
            return;
        }
        self.document = Document::new(scene, (!is_left_over).then(|| name.clone()));
        let scene = &self.document.scene;
        self.navigation = Navigation::new(scene.cameras[0].1.clone(), scene.bounds());
        self.chosen = None;
        self.set_watch(self.watch.is_some(), ctx);
        if is_left_over {
            // It has no file of its own yet.
            self.document.mark_changed();
            self.left_over.retain(|path| path.to_string_lossy() != name);
            self.keep(ctx);
            if self.keeper.as_ref().is_some_and(Keeper::holds_a_scene) {
                let _ = std::fs::remove_file(name);
            }
        } else {
            self.memory.opened(&name);
        }
    }

    fn was_saved(&mut self, scene: Arc<Scene>, name: &str, ctx: &Context) {
        self.message = format!("saved {name}");
        let is_newest = Arc::ptr_eq(&scene, &self.document.scene);
        self.document.was_saved(scene, Path::new(name));
        self.memory.opened(name);
        if self.watch.as_ref().is_some_and(|watch| watch.file != Path::new(name)) {
            self.set_watch(true, ctx);
        }
        if let Some(keeper) = self.keeper.as_ref().filter(|_| is_newest) {
            keeper.forget();
        }
    }

    /// Keeps settings and unsaved scenes in a folder, and takes up what was kept there before.
    pub fn keep_in(&mut self, folder: PathBuf) {
        let keeper = Keeper::new(folder);
        let recent = std::mem::take(&mut self.memory.recent);
        self.memory = keeper.memory();
        recent.iter().rev().for_each(|name| self.memory.opened(name));
        // Values may stem from another version: those that are none any more are left out.
        for (id, values) in &self.memory.settings {
            let Ok(info) = self.registry.info(id) else { continue };
            let settings = self.settings.entry(id.clone()).or_default();
            for (name, value) in values {
                let _ = settings.set(id, &info.parameters, name, value);
            }
        }
        let mode = Mode::ALL.into_iter().find(|(_, name)| *name == self.memory.mode);
        self.mode = mode.map_or(Mode::SideBySide, |(mode, _)| mode);
        let has = |name: &str| self.memory.panels.iter().any(|panel| panel == name);
        self.panels = Panels {
            objects: has("objects"),
            settings: has("settings"),
            values: has("values"),
            chart: false,
            welcome: !self.memory.is_welcomed,
        };
        self.left_over = keeper.left_over();
        self.keeper = Some(keeper);
    }

    /// Returns the window's size of the session before, points.
    #[must_use]
    pub fn window_size(&self) -> Option<[f32; 2]> {
        let [width, height] = self.memory.window;
        (width >= 200.0 && height >= 150.0).then_some([width.min(16_384.0), height.min(16_384.0)])
    }

    /// Has the looks of the session before.
    pub(crate) fn dress(&mut self, ctx: &Context) {
        self.set_theme(self.memory.is_light, ctx);
        if self.memory.zoom > 0.0 {
            self.set_zoom(self.memory.zoom, ctx);
        }
    }

    /// Keeps what is to be found again after this session, whatever ends it.
    pub(crate) fn keep(&mut self, ctx: &Context) {
        let Some(keeper) = &self.keeper else { return };
        if let Some(why) = keeper.failure() {
            self.message = why;
        }
        if self.document.is_changed() {
            keeper.keep(&self.document.scene);
        }
        let mut memory = Memory { window: ctx.content_rect().size().into(), ..self.memory.clone() };
        memory.remember(&self.settings);
        memory.panes = self.panes.iter().map(|p| (p.backend.clone(), p.channel.name().to_owned())).collect();
        memory.mode = self.mode.name().to_owned();
        let panels = [
            ("objects", self.panels.objects),
            ("settings", self.panels.settings),
            ("values", self.panels.values),
        ];
        memory.panels = panels.iter().filter(|(_, is_open)| *is_open).map(|(n, _)| (*n).to_owned()).collect();
        memory.is_welcomed |= !self.panels.welcome;
        if memory != self.memory {
            self.memory = memory.clone();
            keeper.remember(memory);
        }
    }

    /// Begins to write a picture of the window, to a file of that name or one that is found.
    pub(crate) fn save_screenshot(&mut self, file: Option<PathBuf>, ctx: &Context) {
        let file = file.unwrap_or_else(|| unused("screenshot"));
        let (sender, receiver) = channel::<Arc<ColorImage>>();
        let wake = ctx.clone();
        let callback = ScreenshotCallback::new(move |image| {
            // The window may be gone by now.
            let _ = sender.send(image);
            wake.request_repaint();
        });
        ctx.send_viewport_cmd(ViewportCommand::Screenshot(callback));
        let (name, wake) = (file.display().to_string(), ctx.clone());
        let work = move || {
            let wait = std::time::Duration::from_secs(5);
            let image = receiver.recv_timeout(wait).map_err(|_| "the window gave no picture".to_owned())?;
            write_picture(&image, &file)
        };
        self.writing = Some(Errand::start(name, work, move || wake.request_repaint()));
    }

    /// Begins to write the pictures of all panes beside one another.
    pub(crate) fn save_sheet(&mut self, ctx: &Context) {
        let (file, wake) = (unused("sheet"), ctx.clone());
        let name = file.display().to_string();
        let panes: Vec<_> = self
            .panes
            .iter()
            .filter_map(|pane| Some((pane.caption(self.truth.is_some()), pane.painting()?.image.clone())))
            .collect();
        let work = move || write_picture(&sheet(&panes), &file);
        self.writing = Some(Errand::start(name, work, move || wake.request_repaint()));
    }
}
