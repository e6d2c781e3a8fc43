//! How is the picture of one back end shown, with its name, its time, and what it did to the scene?

use crate::difference::Comparer;
use crate::painter::{News, Order, Painter, Painting};
use eframe::egui::{self, Color32, ColorImage, Pos2, Rect, RichText, TextureHandle, TextureOptions, Vec2};
use polyptych::framebuffer::Channel;
use polyptych::scene::Scene;
use polyptych::seam::Decision;
use std::sync::Arc;

/// A picture on the graphics card.
#[derive(Default)]
pub(crate) struct Poster {
    /// Kept to be handed over again where the card loses it.
    image: Option<Arc<ColorImage>>,
    texture: Option<TextureHandle>,
}

impl Poster {
    pub(crate) fn show(&mut self, image: Arc<ColorImage>, options: TextureOptions, ctx: &egui::Context) {
        self.image = Some(image.clone());
        match &mut self.texture {
            Some(texture) => texture.set(image, options),
            None => self.texture = Some(ctx.load_texture("picture", image, options)),
        }
    }

    /// Hands the picture over again if the card does not have it any more.
    fn restore(&mut self, ctx: &egui::Context) {
        let is_lost = self.texture.as_ref().is_some_and(|t| ctx.tex_manager().read().meta(t.id()).is_none());
        if let (true, Some(image)) = (is_lost, self.image.clone()) {
            // Nobody else has that name: it must not be given back.
            self.texture.take().into_iter().for_each(std::mem::forget);
            self.show(image, TextureOptions::LINEAR, ctx);
        }
    }

    /// Draws the picture into a rectangle.
    pub(crate) fn draw(&self, painter: &egui::Painter, rect: Rect) {
        let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
        match &self.texture {
            Some(texture) => drop(painter.image(texture.id(), rect, whole, Color32::WHITE)),
            None => drop(painter.rect_filled(rect, 0.0, Color32::from_gray(32))),
        }
    }
}

/// A back end's place in the window.
pub(crate) struct Pane {
    pub(crate) backend: String,
    pub(crate) channel: Channel,
    pub(crate) painter: Painter,
    /// Size of the picture that is shown, in pixels of the screen.
    pub(crate) size: [u32; 2],
    /// What was ordered last.
    ordered: Option<Order>,
    /// Whether there is something to order as soon as the other panes are done.
    pub(crate) waits: bool,
    shown: Option<Painting>,
    poster: Poster,
    pub(crate) failure: Option<String>,
    /// The picture held against the reference's.
    pub(crate) error: Comparer,
}

impl Pane {
    pub(crate) fn new(backend: String, channel: Channel, painter: Painter) -> Self {
        Self {
            backend,
            channel,
            painter,
            size: [0, 0],
            ordered: None,
            waits: false,
            shown: None,
            poster: Poster::default(),
            failure: None,
            error: Comparer::default(),
        }
    }

    /// Orders a picture, unless it is the one that was ordered last.
    pub(crate) fn want(&mut self, order: Order) {
        if !self.has_ordered(&order) {
            self.ordered = Some(order.clone());
            self.painter.order(order);
        }
    }

    /// Tells whether the same picture was ordered last.
    pub(crate) fn has_ordered(&self, order: &Order) -> bool {
        self.ordered.as_ref().is_some_and(|ordered| ordered.is(order))
    }

    /// Stops what is being drawn, and forgets that it was ordered.
    pub(crate) fn leave(&mut self) {
        self.ordered = None;
        self.painter.stop();
    }

    /// Orders the same picture anew: after a failure.
    pub(crate) fn try_again(&mut self) {
        (self.ordered, self.failure) = (None, None);
    }

    /// Takes what the painter has finished since the last time.
    pub(crate) fn update(&mut self, ctx: &egui::Context) {
        self.poster.restore(ctx);
        match self.painter.take() {
            None => {}
            Some(News::Failure(why)) => self.failure = Some(why),
            Some(News::Parts(image)) => self.poster.show(Arc::new(image), TextureOptions::LINEAR, ctx),
            Some(News::Painting(painting)) => {
                self.failure = None;
                self.poster.show(painting.image.clone(), TextureOptions::LINEAR, ctx);
                self.shown = Some(painting);
            }
        }
    }

    /// Returns what is shown.
    pub(crate) fn painting(&self) -> Option<&Painting> {
        self.shown.as_ref()
    }

    /// Tells whether the full picture of what was ordered last is shown, or why there is none.
    pub(crate) fn is_at_rest(&self) -> bool {
        let full = self.shown.as_ref().is_some_and(|p| p.is_full && p.backend == self.backend);
        let has_room = !self.size.contains(&0);
        !self.painter.is_busy() && (full || self.failure.is_some() || !has_room)
    }

    /// Draws the picture into a rectangle, or the part of it inside `clip`.
    pub(crate) fn draw(&self, painter: &egui::Painter, rect: Rect, clip: Rect) {
        self.poster.draw(&painter.with_clip_rect(clip.intersect(painter.clip_rect())), rect);
    }

    /// Says in a line what is shown: for sheets.
    pub(crate) fn caption(&self, shows_error: bool) -> String {
        let error = self.error.summary().filter(|_| shows_error).map_or(String::new(), |e| format!(", {e}"));
        format!("{}, {}, {}{error}", self.backend, self.channel.name(), self.status())
    }

    /// Says how long the picture took, or why there is none.
    pub(crate) fn status(&self) -> String {
        if let Some(why) = &self.failure {
            return why.clone();
        }
        let Some(painting) = &self.shown else { return "drawing".to_owned() };
        let busy = if self.painter.is_busy() || !painting.is_full { " ..." } else { "" };
        let coarse = if painting.coarse > 1 { format!(", 1/{}", painting.coarse) } else { String::new() };
        format!("{:.1} ms{coarse}{busy}", painting.frame.as_secs_f64() * 1e3)
    }

    /// Shows the line above the picture: back end, channel, time, and the badge with what was not drawn exactly.
    pub(crate) fn header(
        &mut self,
        ui: &mut egui::Ui,
        (backends, refused): (&[String], &[String]),
        number: usize,
        scene: &Scene,
        shows_error: bool,
    ) {
        // On one line: pictures of panes with headers of different heights would have different sizes.
        ui.horizontal(|ui| {
            let chosen = egui::ComboBox::from_id_salt(("back end", number))
                .selected_text(&self.backend)
                .show_ui(ui, |ui| {
                    for id in backends {
                        ui.selectable_value(&mut self.backend, id.clone(), id);
                    }
                    for line in refused {
                        ui.add_enabled(false, egui::Button::new(line).wrap());
                    }
                });
            name(&chosen.response, &format!("back end of pane {}", number + 1));
            let chosen = egui::ComboBox::from_id_salt(("channel", number))
                .selected_text(self.channel.name())
                .show_ui(ui, |ui| {
                    for channel in Channel::ALL {
                        ui.selectable_value(&mut self.channel, channel, channel.name());
                    }
                });
            name(&chosen.response, &format!("channel of pane {}", number + 1));
            let color =
                if self.failure.is_some() { ui.visuals().error_fg_color } else { ui.visuals().text_color() };
            let status = ui.label(RichText::new(self.status()).color(color));
            if let Some(painting) = &self.shown {
                let (prepare, megabytes) = (painting.prepare.as_secs_f64() * 1e3, painting.bytes as f64 * 1e-6);
                status.on_hover_text(format!("prepared in {prepare:.1} ms, holds {megabytes:.1} MB"));
            }
            if let Some(error) = self.error.summary().filter(|_| shows_error) {
                let first = error.split(", ").next().unwrap_or_default().to_owned();
                ui.label(first).on_hover_text(format!(
                    "Against the exact reference: {error}. (Peak signal-to-noise ratio of the color; pixels off edges \
                     that show the same object; mean error of the distance over the distance.)"
                ));
            }
            if self.failure.is_some() && ui.button("Try again").clicked() {
                self.try_again();
            }
            self.badge(ui, number, scene);
        });
    }

    /// Shows how many objects were not drawn as given; a click lists them.
    fn badge(&self, ui: &mut egui::Ui, number: usize, scene: &Scene) {
        let Some(painting) = self.shown.as_ref().filter(|p| p.backend == self.backend) else { return };
        let other: Vec<_> = scene
            .objects
            .iter()
            .zip(painting.decisions.iter())
            .filter(|(_, decision)| !matches!(decision, Decision::Exact))
            .collect();
        if other.is_empty() {
            return;
        }
        let text = format!("{}/{} changed", other.len(), scene.objects.len());
        ui.push_id(("decisions", number), |ui| {
            ui.menu_button(text, |ui| {
                ui.strong("Not drawn as they were given:");
                egui::ScrollArea::vertical().max_height(300.0).show(ui, |ui| {
                    for (object, decision) in other {
                        ui.label(format!("{}: {}: {}", object.name, decision.word(), decision.why()));
                    }
                });
            });
        });
    }
}

/// Names a list to choose from for screen readers.
pub(crate) fn name(list: &egui::Response, name: &str) {
    list.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, name));
}

/// Divides a rectangle among panes, as square as can be.
pub(crate) fn grid(rect: Rect, count: usize) -> Vec<Rect> {
    let columns = (1..=count).find(|c| c * c >= count).unwrap_or(1);
    let rows = count.div_ceil(columns);
    let cell = Vec2::new(rect.width() / columns as f32, rect.height() / rows as f32);
    (0..count)
        .map(|i| {
            let place = Vec2::new((i % columns) as f32 * cell.x, (i / columns) as f32 * cell.y);
            Rect::from_min_size(rect.min + place, cell)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panes_share_the_window_without_overlap() {
        let rect = Rect::from_min_size(Pos2::new(10.0, 20.0), Vec2::new(900.0, 600.0));
        for count in 1..=9 {
            let cells = grid(rect, count);
            assert_eq!(cells.len(), count);
            for (i, cell) in cells.iter().enumerate() {
                assert!(rect.expand(0.1).contains_rect(*cell));
                assert!(cells[..i].iter().all(|other| other.intersect(*cell).area() < 1.0));
            }
        }
    }
}
