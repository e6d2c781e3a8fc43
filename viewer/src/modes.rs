//! How do panes share the window: side by side, over one another, or as what differs between them?

use crate::pane::{Pane, grid};
use crate::viewer::Viewer;
use eframe::egui::{self, Align2, Color32, FontId, Key, Pos2, Rect, Sense, Stroke, Vec2};

/// How panes share the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Beside one another.
    SideBySide,
    /// The first two over one another, with a line between them that can be dragged.
    Wipe,
    /// The first one; the second in its place while the space bar is held.
    Flip,
    /// How far the first two are apart, pixel by pixel.
    Difference,
    /// Beside one another, how far each is from the reference, pixel by pixel.
    ErrorMaps,
}

impl Mode {
    /// All modes with their names.
    pub(crate) const ALL: [(Self, &str); 5] = [
        (Self::SideBySide, "Side by side"),
        (Self::Wipe, "Wipe"),
        (Self::Flip, "Flip"),
        (Self::Difference, "Difference"),
        (Self::ErrorMaps, "Error maps"),
    ];

    /// Returns its name.
    pub(crate) fn name(self) -> &'static str {
        Self::ALL.iter().find(|(mode, _)| *mode == self).map_or("", |(_, name)| name)
    }
}

impl Viewer {
    /// Shows the panes.
    pub(crate) fn show_panes(&mut self, ui: &mut egui::Ui, rect: Rect) {
        match self.mode {
            _ if self.panes.len() < 2 => self.show_grid(ui, rect),
            Mode::SideBySide | Mode::ErrorMaps => self.show_grid(ui, rect),
            Mode::Wipe => self.show_wipe(ui, rect),
            Mode::Flip | Mode::Difference => self.show_two(ui, rect),
        }
    }

    /// Shows the panes beside one another.
    fn show_grid(&mut self, ui: &mut egui::Ui, rect: Rect) {
        for (index, cell) in grid(rect, self.panes.len()).into_iter().enumerate() {
            self.show_pane(ui, index, cell.shrink(2.0));
        }
    }

    fn show_pane(&mut self, ui: &mut egui::Ui, index: usize, cell: Rect) {
        let bottom = self.show_header(ui, index, cell);
        let picture = Rect::from_min_max(Pos2::new(cell.left(), bottom.min(cell.bottom())), cell.max);
        let response = self.interact(ui, picture, ("picture", index));
        let pane = &mut self.panes[index];
        if self.mode == Mode::ErrorMaps {
            pane.error.draw(ui.painter(), picture);
        } else {
            pane.draw(ui.painter(), picture, picture);
        }
        resize(pane, picture, ui.ctx().pixels_per_point());
        // A mouse that rests does not take the keys from the pane that was chosen by one.
        let is_pointed = response.hovered() && ui.input(|i| i.pointer.is_moving() || i.pointer.any_down());
        if is_pointed || response.dragged() || response.has_focus() {
            self.active = index;
        }
        if self.active == index && self.panes.len() > 1 {
            let stroke = Stroke::new(1.0, ui.visuals().selection.bg_fill);
            ui.painter().rect_stroke(picture, 0.0, stroke, egui::StrokeKind::Outside);
        }
        self.follow_pointer(ui, picture, &response, index);
    }

    /// Makes a picture something to point at, named for screen readers.
    fn interact(
        &self,
        ui: &egui::Ui,
        picture: Rect,
        salt: impl std::hash::Hash + std::fmt::Debug,
    ) -> egui::Response {
        let response = ui.interact(picture, ui.scope_id().with(salt), Sense::click_and_drag());
        let name = format!("{} of {}", self.mode.name(), self.shown().collect::<Vec<_>>().join(", "));
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, &name));
        response
    }

    /// Shows the line above a picture. Returns where it ends.
    fn show_header(&mut self, ui: &mut egui::Ui, index: usize, cell: Rect) -> f32 {
        let (scene, lists) = (self.document.scene.clone(), (&self.backends[..], &self.refused[..]));
        let (pane, shows_error) = (&mut self.panes[index], self.truth.is_some());
        let before = pane.backend.clone();
        let header = ui.scope_builder(egui::UiBuilder::new().max_rect(cell), |ui| {
            ui.shrink_clip_rect(cell);
            pane.header(ui, lists, index, &scene, shows_error);
        });
        if pane.backend != before {
            let chosen = std::mem::replace(&mut pane.backend, before);
            self.set_backend(index, chosen);
        }
        header.response.rect.bottom() + 2.0
    }

    /// Shows the lines above two pictures that lie over one another. Returns the place of the pictures.
    fn show_headers(&mut self, ui: &mut egui::Ui, rect: Rect) -> Rect {
        let mut top = rect.top();
        for (index, half) in grid(rect, 2).into_iter().enumerate() {
            top = top.max(self.show_header(ui, index, half));
        }
        let picture = Rect::from_min_max(Pos2::new(rect.left(), top.min(rect.bottom())), rect.max);
        for pane in &mut self.panes[..2] {
            resize(pane, picture, ui.ctx().pixels_per_point());
        }
        picture
    }

    /// Shows the first two panes over one another.
    fn show_wipe(&mut self, ui: &mut egui::Ui, rect: Rect) {
        let picture = self.show_headers(ui, rect);
        let response = self.interact(ui, picture, "wipe");
        let x = picture.left() + picture.width() * self.line;
        let handle =
            Rect::from_center_size(Pos2::new(x, picture.center().y), Vec2::new(9.0, picture.height()));
        let grip = ui.interact(handle, ui.scope_id().with("line"), Sense::drag());
        grip.widget_info(|| egui::WidgetInfo::slider(true, f64::from(self.line), "line of the wipe"));
        if let Some(pointer) = grip.interact_pointer_pos().filter(|_| grip.dragged()) {
            self.line = ((pointer.x - picture.left()) / picture.width().max(1.0)).clamp(0.0, 1.0);
        }
        if grip.has_focus() {
            let step = |key| ui.input(|i| i.num_presses(key)) as f32 * 0.02;
            self.line = (self.line + step(Key::ArrowRight) - step(Key::ArrowLeft)).clamp(0.0, 1.0);
        }
        if grip.hovered() || grip.dragged() {
            ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
        }
        let (mut left, mut right) = (picture, picture);
        (left.max.x, right.min.x) = (x, x);
        self.panes[0].draw(ui.painter(), picture, left);
        self.panes[1].draw(ui.painter(), picture, right);
        ui.painter().vline(x, picture.y_range(), Stroke::new(1.5, Color32::WHITE));
        if let Some(pointer) = response.hover_pos() {
            self.active = usize::from(pointer.x > x);
        }
        if !grip.dragged() {
            self.follow_pointer(ui, picture, &response, self.active.min(1));
        }
    }

    /// Shows one of the first two panes, or what differs between them.
    fn show_two(&mut self, ui: &mut egui::Ui, rect: Rect) {
        let picture = self.show_headers(ui, rect);
        let response = self.interact(ui, picture, "two");
        let text = if self.mode == Mode::Flip {
            self.active = usize::from(ui.input(|i| i.key_down(Key::Space)));
            let pane = &self.panes[self.active];
            pane.draw(ui.painter(), picture, picture);
            format!("{} (hold space for the other)", pane.backend)
        } else {
            self.difference.draw(ui.painter(), picture);
            let summary = self.difference.summary().unwrap_or_else(|| "comparing".to_owned());
            format!("{summary}. Black: less than 1/10,000; violet, red, orange; white: all of the scale")
        };
        caption(ui, picture, &text);
        self.follow_pointer(ui, picture, &response, self.active.min(1));
    }

    /// Does what the mouse says over a picture: a tool at work, or else the camera.
    fn follow_pointer(&mut self, ui: &egui::Ui, picture: Rect, response: &egui::Response, index: usize) {
        self.point_at(ui, picture, response);
        if self.use_tool(ui, picture, response, index) {
            return;
        }
        if response.clicked() {
            self.choose_at(index);
        }
        self.navigation.follow(ui, response);
    }

    /// Remembers the place under the mouse, and marks it in a picture while values are shown.
    fn point_at(&mut self, ui: &egui::Ui, picture: Rect, response: &egui::Response) {
        if let Some(pointer) = response.hover_pos() {
            let share = (pointer - picture.min) / picture.size();
            self.pointed = Some([share.x.clamp(0.0, 1.0), share.y.clamp(0.0, 1.0)]);
        }
        if let (true, Some([x, y])) = (self.panels.values, self.pointed) {
            let center = picture.min + picture.size() * Vec2::new(x, y);
            for (width, color) in [(3.0, Color32::from_black_alpha(160)), (1.0, Color32::WHITE)] {
                ui.painter().circle_stroke(center, 6.0, Stroke::new(width, color));
            }
        }
    }
}

/// Writes a line into a picture's corner.
fn caption(ui: &egui::Ui, picture: Rect, text: &str) {
    let place = picture.left_bottom() + Vec2::new(8.0, -8.0);
    let layout = ui.painter().layout_no_wrap(text.to_owned(), FontId::proportional(13.0), Color32::WHITE);
    let rect = Align2::LEFT_BOTTOM.anchor_size(place, layout.size());
    ui.painter().rect_filled(rect.expand(3.0), 3.0, Color32::from_black_alpha(190));
    ui.painter().galley(rect.min, layout, Color32::WHITE);
}

/// Fits a pane's picture to its place on the screen.
fn resize(pane: &mut Pane, picture: Rect, pixels_per_point: f32) {
    let pixels = |points: f32| (points * pixels_per_point).round().clamp(0.0, 16384.0) as u32;
    pane.size = [pixels(picture.width()), pixels(picture.height())];
}
