//! Where do bodies cross each other? Their intersection lines are edges of no mesh.
//!
//! Between two neighboring pixels that show different objects lies an intersection if the plane of each triangle is
//! the nearer one on its own pixel: the planes cross in between, and so finely is the line placed.

use crate::face::Face;
use crate::lens::Lens;
use crate::model::Model;
use crate::tile::NO_TRIANGLE;
use std::sync::atomic::{AtomicU32, Ordering};

/// The triangles that a picture shows, row by row.
pub(crate) struct Seen<'a> {
    pub(crate) triangles: &'a [AtomicU32],
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl Seen<'_> {
    fn at(&self, x: u32, y: u32) -> u32 {
        self.triangles[(y * self.width + x) as usize].load(Ordering::Relaxed)
    }

    /// Returns which share of a pixel intersection lines take, and the part whose color they have.
    pub(crate) fn crossing(&self, model: &Model, lens: &Lens, x: u32, y: u32) -> Option<(f32, usize)> {
        let own = self.at(x, y);
        if own == NO_TRIANGLE {
            return None;
        }
        let part = model.find(own).0;
        let mut best = None::<(f32, usize)>;
        for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
            let (Some(u), Some(v)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else { continue };
            if u >= self.width || v >= self.height {
                continue;
            }
            let other = self.at(u, v);
            if other == NO_TRIANGLE || other == own {
                continue;
            }
            let other_part = model.find(other).0;
            if other_part == part {
                continue;
            }
            let [own, other] = [own, other].map(|id| Face::new(model, lens, id));
            // How much nearer is the triangle of this pixel, here and there?
            let gap = |x: u32, y: u32| {
                let [x, y] = [x, y].map(|v| f64::from(v) + 0.5);
                other.ahead(lens, x, y) - own.ahead(lens, x, y)
            };
            let (here, there) = (gap(x, y), gap(u, v));
            if here >= 0.0 && there <= 0.0 && here - there > 0.0 {
                let share = 1.0 - (here / (here - there)) as f32;
                if best.is_none_or(|(most, _)| share > most) {
                    best = Some((share, part.min(other_part)));
                }
            }
        }
        best
    }
}
