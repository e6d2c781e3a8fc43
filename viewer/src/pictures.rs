//! Which pictures are ordered, and which are held against one another?

use crate::modes::Mode;
use crate::painter::{Order, Painter};
use crate::pane::Pane;
use crate::settings;
use crate::viewer::Viewer;
use eframe::egui::Context;
use polyptych::framebuffer::{Channel, Channels};
use polyptych::seam::Need;

/// Back ends of the first panes: a method beside the ruler.
const FIRST: [&str; 4] = ["raster", "reference", "voxel", "freeform"];
/// Most panes at once.
const MOST: usize = 9;
/// Tolerance of edges where nothing else is asked for, pixels.
const TOLERANCE: f64 = 0.5;

impl Viewer {
    /// Opens the panes of the session before, or two.
    pub(crate) fn open_first_panes(&mut self, ctx: &Context) {
        let kept = std::mem::take(&mut self.memory.panes);
        for (backend, channel) in kept.iter().filter(|(id, _)| self.backends.contains(id)).take(MOST) {
            let channel = Channel::ALL.into_iter().find(|c| c.name() == channel).unwrap_or(Channel::Color);
            let pane = Pane::new(backend.clone(), channel, self.painter(ctx));
            self.panes.push(pane);
        }
        if self.panes.is_empty() {
            self.set_count(2, ctx);
        }
    }

    /// Opens as many panes as asked for, or closes the last ones.
    pub(crate) fn set_count(&mut self, count: usize, ctx: &Context) {
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

    fn painter(&self, ctx: &Context) -> Painter {
        let wake = ctx.clone();
        let crew = self.crew.clone();
        Painter::new(self.registry.clone(), self.converter.clone(), crew, move || wake.request_repaint())
    }

    /// Has a pane drawn by another back end. What was set by meaning for the one before is taken along.
    pub(crate) fn set_backend(&mut self, pane: usize, backend: String) {
        let Some(pane) = self.panes.get_mut(pane) else { return };
        let before = std::mem::replace(&mut pane.backend, backend);
        let (from, to) = (self.registry.info(&before), self.registry.info(&pane.backend));
        if let (Ok(from), Ok(to)) = (from, to) {
            let set = self.settings.get(&before).cloned().unwrap_or_default();
            let own = self.settings.entry(pane.backend.clone()).or_default();
            settings::carry(&set, from, own, to);
        }
    }

    /// Starts or stops holding all panes against the reference.
    pub(crate) fn set_truth(&mut self, wanted: bool, ctx: &Context) {
        if wanted != self.truth.is_some() {
            self.truth = wanted.then(|| Pane::new("reference".to_owned(), Channel::Color, self.painter(ctx)));
        }
        if !wanted && self.mode == Mode::ErrorMaps {
            self.mode = Mode::SideBySide;
        }
    }

    /// Orders the pictures that are to be seen where they are not those that were ordered last.
    pub(crate) fn order_pictures(&mut self) {
        let orders: Vec<_> = self.panes.iter().map(|pane| self.order(pane)).collect();
        for (pane, order) in self.panes.iter_mut().zip(orders) {
            order.into_iter().for_each(|order| pane.want(order));
        }
        let Some(mut truth) = self.truth.take() else { return };
        if let Some(first) = self.panes.first() {
            (truth.size, truth.channel) = (first.size, first.channel);
        }
        let order = self.order(&truth).filter(|order| !truth.has_ordered(order));
        // The ruler is slow: it waits until all others are done, and does not keep them from their cores.
        truth.waits = order.is_some() && !self.panes.iter().all(Pane::is_at_rest);
        match order {
            Some(_) if truth.waits => truth.leave(),
            Some(order) => truth.want(order),
            None => {}
        }
        self.truth = Some(truth);
    }

    /// Returns what a pane is to show; nothing where there is no room for a picture.
    fn order(&self, pane: &Pane) -> Option<Order> {
        let [width, height] = pane.size;
        let is_truth = self.truth.is_none() && !self.panes.iter().any(|other| std::ptr::eq(other, pane));
        let held_together = self.panels.values
            || is_truth
            || self.truth.is_some()
            || matches!(self.mode, Mode::Difference | Mode::ErrorMaps);
        let mut channels = if held_together { Channels::ALL } else { Channels::of(&[pane.channel]) };
        if self.panels.objects || self.tool.needs_a_place() {
            // A click chooses what is there.
            channels = channels.with(Channel::Id).with(Channel::Distance);
        }
        let need = Need {
            settings: self.settings(&pane.backend),
            channels,
            tolerance_px: self.equal.tolerance(&pane.backend).unwrap_or(TOLERANCE),
            ..Need::new(self.navigation.camera.clone(), width, height)
        };
        let pace = if is_truth { Default::default() } else { self.equal.pace() };
        (width > 0 && height > 0).then(|| Order {
            backend: pane.backend.clone(),
            scene: self.document.scene.clone(),
            need,
            channel: pane.channel,
            pace,
        })
    }

    /// Holds full pictures against one another where that is shown.
    pub(crate) fn compare(&mut self, ctx: &Context) {
        let full = |pane: &Pane| {
            pane.painting().filter(|p| p.is_full && !pane.painter.is_busy()).map(|p| p.framebuffer.clone())
        };
        self.compares_still = false;
        if let (Mode::Difference, [first, second, ..]) = (self.mode, &self.panes[..])
            && let (Some(a), Some(b)) = (full(first), full(second))
        {
            self.compares_still |= !self.difference.compare([&a, &b], first.channel, ctx);
        }
        let Some(truth) = self.truth.as_ref().filter(|truth| !truth.waits).and_then(full) else { return };
        for pane in &mut self.panes {
            let Some(picture) = full(pane) else { continue };
            let before = pane.error.count();
            self.compares_still |= !pane.error.compare([&picture, &truth], Channel::Color, ctx);
            if let (true, Some(painting), Some(error)) =
                (pane.error.count() > before, &pane.painting(), pane.error.rmse())
            {
                self.chart.add(&pane.backend, painting.frame, error);
            }
        }
    }

    /// Moves the camera as keys that are held and the turntable say.
    pub(crate) fn move_camera(&mut self, ctx: &Context) {
        let flies = !ctx.text_edit_focused() && ctx.input(|i| self.navigation.follow_keys(i));
        if self.is_turning {
            let time = ctx.input(|i| i.stable_dt.min(0.1));
            self.navigation.orbit(f64::from(time) * 0.5, 0.0);
        }
        if flies || self.is_turning {
            ctx.request_repaint();
        }
    }
}
