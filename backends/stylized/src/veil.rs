//! How far does one see, at most, in a part of the picture?
//!
//! Most edges of a large model lie behind walls. One that is farther than all that is seen in the tiles it crosses is hidden
//! as a whole, and not walked along.

use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::lanes::{F32x8, LANES};
use polyptych_core::seam::{Cancelled, Control};

/// Edge of a tile in pixels.
const TILE: usize = 16;
/// Edges that cross more tiles are walked along: few are so long.
const MOST_TILES: usize = 48;

/// The largest distance seen in each tile.
#[derive(Default)]
pub(crate) struct Veil {
    farthest: Vec<f32>,
    columns: usize,
    rows: usize,
}

impl Veil {
    /// Looks at a picture.
    pub(crate) fn fill(&mut self, visible: &Framebuffer, control: &Control<'_>) -> Result<(), Cancelled> {
        let (width, height) = (visible.width() as usize, visible.height() as usize);
        (self.columns, self.rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
        self.farthest.resize(self.columns * self.rows, 0.0);
        let (columns, distances) = (self.columns, visible.distance());
        control.for_each_mut(&mut self.farthest, columns.max(1), &|tile, farthest| {
            let (left, top) = (tile % columns * TILE, tile / columns * TILE);
            let right = (left + TILE).min(width);
            let mut most = F32x8::ZERO;
            for y in top..(top + TILE).min(height) {
                let (eights, rest) = distances[y * width + left..y * width + right].as_chunks::<LANES>();
                for eight in eights {
                    most = most.max(F32x8::new(*eight));
                }
                for distance in rest {
                    most.0[0] = most.0[0].max(*distance);
                }
                // Nothing is farther than the background.
                if most.at_least(F32x8::splat(f32::INFINITY)).any() {
                    break;
                }
            }
            *farthest = most.0.into_iter().fold(0.0, f32::max);
        })
    }

    /// Tells whether all that is seen around a line is nearer than a distance.
    pub(crate) fn hides(&self, from: [f64; 2], to: [f64; 2], distance: f64) -> bool {
        // Pixels next to those that a line crosses tell about it, too.
        const MARGIN: f64 = 2.0;
        let tiles = |a: f64, b: f64, count: usize| {
            let first = ((a.min(b) - MARGIN).max(0.0) as usize / TILE).min(count.saturating_sub(1));
            let last = ((a.max(b) + MARGIN).max(0.0) as usize / TILE).min(count.saturating_sub(1));
            first..last + 1
        };
        let (across, down) = (tiles(from[0], to[0], self.columns), tiles(from[1], to[1], self.rows));
        if self.farthest.is_empty() || across.len() * down.len() > MOST_TILES {
            return false;
        }
        let nearest = distance as f32;
        for y in down {
            for &farthest in &self.farthest[y * self.columns + across.start..y * self.columns + across.end] {
                if farthest >= nearest {
                    return false;
                }
            }
        }
        true
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.farthest.capacity() as u64 * 4
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use polyptych_core::framebuffer::{Channel, Channels};
    use polyptych_core::parallel::OneThread;

    #[test]
    fn what_is_behind_all_that_is_seen_around_is_hidden() {
        let mut picture = Framebuffer::new(70, 40, Channels::of(&[Channel::Distance]));
        picture.for_each_band(&OneThread, 40, &|band| band.distance.fill(5.0));
        let mut veil = Veil::default();
        veil.fill(&picture, &Control::simple()).unwrap();
        assert!(veil.hides([3.0, 3.0], [60.0, 30.0], 5.1));
        assert!(!veil.hides([3.0, 3.0], [60.0, 30.0], 4.9));
        picture.for_each_band(&OneThread, 40, &|band| band.distance[20 * 70 + 69] = f32::INFINITY);
        veil.fill(&picture, &Control::simple()).unwrap();
        assert!(!veil.hides([66.0, 10.0], [67.0, 15.0], 5.1), "the next tile is within the margin");
        assert!(veil.hides([3.0, 3.0], [40.0, 30.0], 5.1) && veil.hides([66.0, 3.0], [-9.0, -9.0], 5.1));
    }
}
