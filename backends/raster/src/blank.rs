//! Which tiles of a picture show nothing, as they did in the frame before?
//!
//! Most pictures show bodies before a background. Where a tile had no triangle and has none again, its planes hold what
//! they should: it need not be written, which costs more than anything else there.

use crate::affine::Linear;
use crate::lens::Lens;
use polyptych_core::framebuffer::{Channel, Framebuffer};
use polyptych_core::scene::Background;
use std::sync::atomic::{AtomicBool, Ordering};

/// The tiles that showed nothing when they were drawn.
#[derive(Default)]
pub(crate) struct Blank {
    tiles: Vec<AtomicBool>,
    drawn: Option<Drawn>,
    stays: Stays,
}

/// What blank tiles were filled with, and where.
struct Drawn {
    /// See [`Framebuffer::written`].
    written: [u64; 7],
    directions: Linear,
    background: Background,
}

/// What of a blank tile need not be written again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Stays {
    /// The color of the background.
    pub(crate) color: bool,
    /// All that says that nothing is there.
    pub(crate) nothing: bool,
}

impl Blank {
    /// Begins a frame of so many tiles.
    pub(crate) fn begin(&mut self, target: &Framebuffer, tiles: usize, lens: &Lens, background: &Background) {
        self.stays = Stays::default();
        if let (Some(drawn), Some(now)) = (self.drawn.take(), target.written()) {
            let is_kept = |channel: &Channel| now[*channel as usize] == drawn.written[*channel as usize];
            let nothing = Channel::ALL.iter().filter(|c| **c != Channel::Color).all(is_kept);
            let is_same = drawn.directions == lens.direction && drawn.background == *background;
            self.stays = Stays { nothing, color: is_kept(&Channel::Color) && is_same };
        }
        if self.tiles.len() != tiles {
            self.tiles.resize_with(tiles, AtomicBool::default);
            self.stays = Stays::default();
        }
    }

    /// Notes whether a tile is blank now, and returns what stays of it if it is.
    pub(crate) fn note(&self, tile: usize, is_blank: bool) -> Stays {
        let was_blank = self.tiles[tile].swap(is_blank, Ordering::Relaxed);
        if was_blank && is_blank { self.stays } else { Stays::default() }
    }

    /// Ends a frame that was drawn whole.
    pub(crate) fn end(&mut self, target: &Framebuffer, lens: &Lens, background: &Background) {
        self.drawn = target.written().map(|written| Drawn {
            written,
            directions: lens.direction,
            background: background.clone(),
        });
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.tiles.capacity() as u64
    }
}
