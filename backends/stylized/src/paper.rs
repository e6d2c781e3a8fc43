//! What is under a drawing?

use crate::bake::noise;
use crate::style::Paper;
use glam::Vec3;
use polyptych_core::lanes::{F32x8, LANES};

/// Pixels along the edge of the grain, which repeats.
const EDGE: usize = 256;
/// Every so many lines of a grid one is stronger.
const STRONG: i64 = 5;

/// The roughness of paper, from 0 in its valleys to 1.
pub(crate) struct Grain {
    heights: Vec<f32>,
}

impl Grain {
    /// Makes paper: noise in three sizes, spread over the whole range.
    pub(crate) fn new() -> Self {
        let white = |x: usize, y: usize, seed: u32| noise((y % EDGE * EDGE + x % EDGE) as u32, seed);
        let smooth = |x: usize, y: usize, cell: usize, seed: u32| {
            let (cx, cy) = (x / cell * cell, y / cell * cell);
            let ease = |f: f32| f * f * (3.0 - 2.0 * f);
            let (fx, fy) = (ease((x - cx) as f32 / cell as f32), ease((y - cy) as f32 / cell as f32));
            let at = |dx: usize, dy: usize| white(cx + dx * cell, cy + dy * cell, seed);
            let (upper, lower) =
                (at(0, 0) + (at(1, 0) - at(0, 0)) * fx, at(0, 1) + (at(1, 1) - at(0, 1)) * fx);
            upper + (lower - upper) * fy
        };
        let height = |i: usize| {
            let (x, y) = (i % EDGE, i / EDGE);
            let sum = 0.45 * white(x, y, 11) + 0.35 * smooth(x, y, 2, 12) + 0.2 * smooth(x, y, 8, 13);
            ((sum - 0.5) * 1.8 + 0.5).clamp(0.0, 1.0)
        };
        Self { heights: (0..EDGE * EDGE).map(height).collect() }
    }

    /// Returns the heights of eight pixels; the first one's column is a multiple of eight.
    #[inline(always)]
    pub(crate) fn at(&self, x: u32, y: u32) -> F32x8 {
        F32x8::load(&self.heights[y as usize % EDGE * EDGE + x as usize % EDGE..])
    }

    /// Fills a part of a row with paper.
    #[inline(always)]
    pub(crate) fn paper(&self, paper: &Paper, first: u32, y: u32, colors: &mut [Vec3]) {
        let (row, strength) = (y as usize % EDGE * EDGE, paper.grain * 0.22);
        for (x, color) in (first as usize..).zip(&mut *colors) {
            let height = self.heights[row + x % EDGE];
            *color = paper.color * (1.0 + (height - 0.6) * strength);
        }
        if paper.grid >= 2.0 {
            grid(paper.grid, first, y, colors);
        }
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.heights.len() * 4) as u64
    }
}

/// Prints the lines of a grid over a part of a row.
fn grid(spacing: f32, first: u32, y: u32, colors: &mut [Vec3]) {
    let share = |coordinate: u32| -> f32 {
        let number = (f64::from(coordinate) / f64::from(spacing)).floor() as i64;
        let begins = (number as f64 * f64::from(spacing)).ceil() as i64 == i64::from(coordinate);
        if !begins {
            0.0
        } else if number % STRONG == 0 {
            0.2
        } else {
            0.09
        }
    };
    let own = share(y);
    for (x, color) in (first..).zip(colors) {
        let printed = share(x).max(own);
        if printed > 0.0 {
            *color = color.lerp(Vec3::ONE, printed);
        }
    }
}

const _: () = assert!(EDGE.is_multiple_of(LANES), "eight pixels never cross the edge of the grain");
