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
}

impl Mode {
    /// All modes with their names.
    pub(crate) const ALL: [(Self, &str); 4] = [
        (Self::SideBySide, "Side by side"),
        (Self::Wipe, "Wipe"),
        (Self::Flip, "Flip"),
        (Self::Difference, "Difference"),
    ];
}

impl Viewer {
    /// Shows the panes. Tells whether pictures change.
    pub(crate) fn show_panes(&mut self, ui: &mut egui::Ui, rect: Rect) -> bool {
        match self.mode {
            _ if self.panes.len() < 2 => self.show_grid(ui, rect),
            Mode::SideBySide => self.show_grid(ui, rect),
            Mode::Wipe => self.show_wipe(ui, rect),
            Mode::Flip | Mode::Difference => self.show_two(ui, rect),
        }
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
        let (bottom, mut changed) = self.show_header(ui, index, cell);
        let picture = Rect::from_min_max(Pos2::new(cell.left(), bottom.min(cell.bottom())), cell.max);
        let response = ui.interact(picture, ui.scope_id().with(("picture", index)), Sense::click_and_drag());
        let pane = &mut self.panes[index];
        pane.draw(ui.painter(), picture, picture);
        changed |= resize(pane, picture, ui.ctx().pixels_per_point());
        if response.hovered() || response.dragged() {
            self.active = index;
        }
        if self.active == index && self.panes.len() > 1 {
            let stroke = Stroke::new(1.0, ui.visuals().selection.bg_fill);
            ui.painter().rect_stroke(picture, 0.0, stroke, egui::StrokeKind::Outside);
        }
        self.point_at(ui, picture, &response);
        if response.clicked() {
            self.choose_at(index);
        }
        changed | self.navigation.follow(ui, &response)
    }

    /// Shows the line above a picture. Returns where it ends, and whether something was chosen.
    fn show_header(&mut self, ui: &mut egui::Ui, index: usize, cell: Rect) -> (f32, bool) {
        let mut changed = false;
        let (scene, lists) = (self.scene.clone(), (&self.backends[..], &self.refused[..]));
        let (pane, shows_error) = (&mut self.panes[index], self.truth.is_some());
        let header = ui.scope_builder(egui::UiBuilder::new().max_rect(cell), |ui| {
            ui.shrink_clip_rect(cell);
            changed |= pane.header(ui, lists, index, &scene, shows_error);
        });
        (header.response.rect.bottom() + 2.0, changed)
    }

    /// Shows the lines above two pictures that lie over one another. Returns the place of the pictures.
    fn show_headers(&mut self, ui: &mut egui::Ui, rect: Rect, changed: &mut bool) -> Rect {
        let mut top = rect.top();
        for (index, half) in grid(rect, 2).into_iter().enumerate() {
            let (bottom, chosen) = self.show_header(ui, index, half);
            *changed |= chosen;
            top = top.max(bottom);
        }
        let picture = Rect::from_min_max(Pos2::new(rect.left(), top.min(rect.bottom())), rect.max);
        for pane in &mut self.panes[..2] {
            *changed |= resize(pane, picture, ui.ctx().pixels_per_point());
        }
        picture
    }

    /// Shows the first two panes over one another. Tells whether pictures change.
    fn show_wipe(&mut self, ui: &mut egui::Ui, rect: Rect) -> bool {
        let mut changed = false;
        let picture = self.show_headers(ui, rect, &mut changed);
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
        let (mut left, mut right) = (picture, picture);
        (left.max.x, right.min.x) = (x, x);
        self.panes[0].draw(ui.painter(), picture, left);
        self.panes[1].draw(ui.painter(), picture, right);
        ui.painter().vline(x, picture.y_range(), Stroke::new(1.5, Color32::WHITE));
        if let Some(pointer) = response.hover_pos() {
            self.active = usize::from(pointer.x > x);
        }
        self.point_at(ui, picture, &response);
        changed | (!grip.dragged() && self.navigation.follow(ui, &response))
    }

    /// Shows one of the first two panes, or what differs between them. Tells whether pictures change.
    fn show_two(&mut self, ui: &mut egui::Ui, rect: Rect) -> bool {
        let mut changed = false;
        let picture = self.show_headers(ui, rect, &mut changed);
        let response = ui.interact(picture, ui.scope_id().with("two"), Sense::click_and_drag());
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
        let place = picture.left_bottom() + Vec2::new(8.0, -8.0);
        let font = FontId::proportional(13.0);
        let shadow = ui.painter().text(
            place + Vec2::splat(1.0),
            Align2::LEFT_BOTTOM,
            &text,
            font.clone(),
            Color32::BLACK,
        );
        ui.painter().rect_filled(shadow.expand(3.0), 3.0, Color32::from_black_alpha(150));
        ui.painter().text(place, Align2::LEFT_BOTTOM, text, font, Color32::WHITE);
        self.point_at(ui, picture, &response);
        changed | self.navigation.follow(ui, &response)
    }

    /// Remembers the place under the mouse, and marks it in a picture while values are shown.
    fn point_at(&mut self, ui: &egui::Ui, picture: Rect, response: &egui::Response) {
        if let Some(pointer) = response.hover_pos() {
            let share = (pointer - picture.min) / picture.size();
            self.pointed = Some([share.x.clamp(0.0, 1.0), share.y.clamp(0.0, 1.0)]);
        }
        if let (true, Some([x, y])) = (self.shows_values, self.pointed) {
            let center = picture.min + picture.size() * Vec2::new(x, y);
            for (width, color) in [(3.0, Color32::from_black_alpha(160)), (1.0, Color32::WHITE)] {
                ui.painter().circle_stroke(center, 6.0, Stroke::new(width, color));
            }
        }
    }
}

/// Fits a pane's picture to its place on the screen. Tells whether its size changed.
pub(crate) fn resize(pane: &mut Pane, picture: Rect, pixels_per_point: f32) -> bool {
    let pixels = |points: f32| (points * pixels_per_point).round().clamp(0.0, 16384.0) as u32;
    let size = [pixels(picture.width()), pixels(picture.height())];
    let changed = pane.size != size;
    pane.size = size;
    changed
}
