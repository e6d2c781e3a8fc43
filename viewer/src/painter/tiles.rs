//! How does a picture look while it is being drawn? Like the coarse one before it, with what is finished laid over.

use super::{Desk, News};
use eframe::egui::{Color32, ColorImage};
use polyptych::framebuffer::Band;
use polyptych::pixels::srgb_bytes;
use polyptych::seam::Watcher;
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time between two looks at a picture that is being drawn.
const LOOK: Duration = Duration::from_millis(40);

/// Collects the finished bands of a picture in color.
pub(super) struct Tiles<'a> {
    desk: &'a Desk,
    stop: &'a AtomicBool,
    /// The picture so far, and when it was shown last.
    seen: Mutex<(ColorImage, Instant)>,
}

impl<'a> Tiles<'a> {
    /// Begins with a coarser picture, drawn out to the size of the full one.
    pub(super) fn over(coarse: &ColorImage, size: [usize; 2], desk: &'a Desk, stop: &'a AtomicBool) -> Self {
        let seen = Mutex::new((stretched(coarse, size), Instant::now()));
        Self { desk, stop, seen }
    }
}

impl Watcher for Tiles<'_> {
    fn finished(&self, band: &Band<'_>) {
        let pixel = |[r, g, b]: [u8; 3]| Color32::from_rgb(r, g, b);
        let pixels: Vec<_> = band.color.iter().map(|&color| pixel(srgb_bytes(color))).collect();
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let (image, shown) = &mut *seen;
        let first = band.first_row as usize * band.width as usize;
        if let Some(place) = image.pixels.get_mut(first..first + pixels.len()) {
            place.copy_from_slice(&pixels);
        }
        if shown.elapsed() > LOOK {
            *shown = Instant::now();
            self.desk.tell(self.stop, News::Parts(image.clone()));
        }
    }
}

/// Draws a picture out to another size, pixels as squares.
fn stretched(image: &ColorImage, [width, height]: [usize; 2]) -> ColorImage {
    let [w, h] = image.size;
    let pixels = (0..width * height).map(|i| {
        let (x, y) = (i % width * w / width, i / width * h / height);
        image.pixels.get(y * w + x).copied().unwrap_or(Color32::BLACK)
    });
    ColorImage::new([width, height], pixels.collect())
}
