//! Where do two pictures differ, and by how much? Reckoned on a thread of its own, the newest pictures last.

use crate::pane::Poster;
use eframe::egui::{self, Color32, ColorImage, Rect, TextureOptions};
use polyptych::framebuffer::{Channel, Framebuffer};
use polyptych::metrics::{Errors, display_colors};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// The pictures of a comparison, and the channel that is looked at.
#[derive(Clone)]
struct Subject {
    pictures: [Arc<Framebuffer>; 2],
    channel: Channel,
}

/// What was found.
struct Finding {
    subject: Subject,
    errors: Errors,
    map: Arc<ColorImage>,
}

/// Compares pictures as they come.
#[derive(Default)]
pub(crate) struct Comparer {
    finding: Option<Finding>,
    running: Option<Receiver<Finding>>,
    poster: Poster,
    /// How many comparisons were done.
    count: usize,
}

impl Subject {
    fn is(&self, other: &Self) -> bool {
        self.channel == other.channel
            && self.pictures.iter().zip(&other.pictures).all(|(a, b)| Arc::ptr_eq(a, b))
    }

    fn find(self) -> Finding {
        let [a, b] = &self.pictures;
        let colors = errors_of(a, b, self.channel).into_iter().map(heat);
        let pixels = colors.map(|[r, g, b]| Color32::from_rgb(r, g, b)).collect();
        let map = Arc::new(ColorImage::new([a.width() as usize, a.height() as usize], pixels));
        Finding { errors: Errors::between(a, b), map, subject: self }
    }
}

impl Comparer {
    /// Compares two pictures, unless that is done or another comparison still runs. Nothing is to be said of pictures
    /// of different sizes or channels. Tells whether there is nothing left to do.
    pub(crate) fn compare(
        &mut self,
        [a, b]: [&Arc<Framebuffer>; 2],
        channel_shown: Channel,
        ctx: &egui::Context,
    ) -> bool {
        let sizes = [a, b].map(|p| (p.width(), p.height(), p.channels().has(channel_shown)));
        if sizes[0] != sizes[1] || !sizes[0].2 {
            self.finding = None;
            return true;
        }
        let subject = Subject { pictures: [a.clone(), b.clone()], channel: channel_shown };
        if let Some(running) = &self.running {
            match running.try_recv() {
                Ok(finding) => {
                    self.poster.show(finding.map.clone(), TextureOptions::NEAREST, ctx);
                    (self.finding, self.running) = (Some(finding), None);
                    self.count += 1;
                }
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => self.running = None,
            }
        }
        if self.finding.as_ref().is_some_and(|f| f.subject.is(&subject)) {
            return true;
        }
        if self.running.is_none() {
            let ((sender, receiver), wake) = (channel(), ctx.clone());
            self.running = Some(receiver);
            std::thread::spawn(move || {
                // Nobody listens any more when the window was closed.
                let _ = sender.send(subject.find());
                wake.request_repaint();
            });
        }
        false
    }

    /// Draws the map of errors.
    pub(crate) fn draw(&self, painter: &egui::Painter, rect: Rect) {
        self.poster.draw(painter, rect);
    }

    /// Returns the map of errors, row by row.
    pub(crate) fn pixels(&self) -> Option<Vec<[u8; 3]>> {
        let map = &self.finding.as_ref()?.map;
        Some(map.pixels.iter().map(|p| [p.r(), p.g(), p.b()]).collect())
    }

    /// Returns how many comparisons were done.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Returns the root mean square error of the color, full scale 1.
    pub(crate) fn rmse(&self) -> Option<f64> {
        self.finding.as_ref()?.errors.color.as_ref().map(|color| color.rmse)
    }

    /// Says in a few words how far apart the pictures are.
    pub(crate) fn summary(&self) -> Option<String> {
        let errors = &self.finding.as_ref()?.errors;
        let mut words = Vec::new();
        if let Some(color) = &errors.color {
            words.push(if color.rmse > 0.0 {
                format!("{:.1} dB", color.psnr)
            } else {
                "same color".to_owned()
            });
        }
        if let Some(ids) = errors.id_agreement {
            words.push(format!("ids {:.2} %", ids * 100.0));
        }
        if let Some(distance) = &errors.distance {
            words.push(format!("distance {:.1e}", distance.relative));
        }
        Some(words.join(", "))
    }
}

/// Returns the error of each pixel in a channel, full scale 1: differences of displayed color, relative ones of
/// distance, angles of normals over half a turn, 0 or 1 for ids.
fn errors_of(a: &Framebuffer, b: &Framebuffer, channel: Channel) -> Vec<f32> {
    fn of<T: Copy>(a: &[T], b: &[T], error: impl Fn(T, T) -> f32) -> Vec<f32> {
        a.iter().zip(b).map(|(a, b)| error(*a, *b)).collect()
    }
    let absolute = |a: f32, b: f32| (a - b).abs();
    match channel {
        Channel::Color => of(&display_colors(a), &display_colors(b), |a, b| {
            (0..3).map(|c| absolute(a[c], b[c])).fold(0.0, f32::max)
        }),
        Channel::Albedo => of(a.albedo(), b.albedo(), |a, b| (a - b).abs().max_element()),
        Channel::Distance => of(a.distance(), b.distance(), |a, b| match (a.is_finite(), b.is_finite()) {
            (true, true) => absolute(a, b) / a.min(b).max(f32::MIN_POSITIVE),
            (false, false) => 0.0,
            _ => 1.0,
        }),
        Channel::Normal => of(a.normal(), b.normal(), |a, b| a.angle_between(b) / std::f32::consts::PI)
            .into_iter()
            .map(|angle| if angle.is_finite() { angle } else { 0.0 })
            .collect(),
        Channel::Id => of(a.id(), b.id(), |a, b| f32::from(u8::from(a != b))),
        Channel::Shadow => of(a.shadow(), b.shadow(), absolute),
        Channel::Coverage => of(a.coverage(), b.coverage(), absolute),
    }
}

/// Smallest error that is not black.
const LEAST: f32 = 1e-4;
/// Colors of errors from [`LEAST`] to 1, evenly by their logarithm.
const COLORS: [[f32; 3]; 5] = [
    [12.0, 8.0, 40.0],
    [84.0, 16.0, 125.0],
    [200.0, 50.0, 70.0],
    [250.0, 160.0, 30.0],
    [255.0, 255.0, 210.0],
];

/// Returns the color of an error: black below 1/10,000, then violet, red, orange, and white at 1.
fn heat(error: f32) -> [u8; 3] {
    if error.is_nan() || error < LEAST {
        return if error.is_nan() { [255, 0, 255] } else { [0, 0, 0] };
    }
    let place = (1.0 - error.min(1.0).log10() / LEAST.log10()) * (COLORS.len() - 1) as f32;
    let (below, share) = ((place as usize).min(COLORS.len() - 2), place.fract());
    let share = if place as usize > below { 1.0 } else { share };
    std::array::from_fn(|c| {
        (COLORS[below][c] + (COLORS[below + 1][c] - COLORS[below][c]) * share).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_of_errors_rise_from_black_to_white() {
        assert_eq!(heat(0.0), [0, 0, 0]);
        assert_eq!(heat(LEAST), [12, 8, 40]);
        assert_eq!(heat(0.01), [200, 50, 70]);
        assert_eq!(heat(1.0), [255, 255, 210]);
        assert_eq!(heat(f32::INFINITY), [255, 255, 210]);
        let brightness = |e: f32| heat(e).iter().map(|&c| i32::from(c)).sum::<i32>();
        let steps: Vec<_> = (0..40).map(|i| brightness(10f32.powf(-4.0 + 0.1 * i as f32))).collect();
        assert!(steps.windows(2).all(|pair| pair[1] >= pair[0] - 8), "{steps:?}");
    }
}
