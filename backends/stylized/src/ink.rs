//! How do lines become shares of pixels?

use crate::spans::SPAN;
use crate::stroke::{Kind, Stroke};
use crate::style::Styles;
use glam::Vec3;
use polyptych_core::lanes::{F32x8, I32x8, LANES};

/// Length of a dash and of the gap after it, pixels.
const DASH: [f32; 2] = [5.0, 4.0];

/// Shares of the pixels of some rows, with the line that covers each most.
///
/// A pixel is a word: its share in the upper byte, then style and kind. The larger word stays, so the order in which
/// lines come does not show.
#[derive(Default)]
pub(crate) struct Ink {
    words: Vec<u16>,
    /// Which rows have any.
    touched: Vec<bool>,
    /// Words of a row: those of its pixels, and some more that are never shown, so that eight fit anywhere.
    stride: usize,
}

impl Ink {
    /// Wipes some rows.
    pub(crate) fn clear(&mut self, width: u32, rows: u32) {
        let (stride, rows) = (width as usize + LANES, rows as usize);
        if self.stride != stride || self.touched.len() < rows {
            self.words.clear();
            self.words.resize(stride * rows, 0);
            self.touched.clear();
            self.touched.resize(rows, false);
            self.stride = stride;
        }
        for (row, touched) in self.touched.iter_mut().enumerate().filter(|(_, touched)| **touched) {
            self.words[row * stride..(row + 1) * stride].fill(0);
            *touched = false;
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.words.capacity() * 2
    }

    /// Draws a line into rows that begin at a row of the picture.
    #[inline(always)]
    pub(crate) fn draw(&mut self, stroke: &Stroke, styles: &Styles, first_row: u32, rows: u32) {
        let pen = styles.all[usize::from(stroke.style)].pen(stroke.kind);
        let half = pen.width * 0.5;
        // Thinner than a pixel is as much lighter.
        let most = pen.width.min(1.0) * 255.0;
        let key = i32::from(u16::from(stroke.style) << 3 | stroke.kind as u16);
        let ([ax, ay], [bx, by]) = (stroke.from, stroke.to);
        let (dx, dy) = (bx - ax, by - ay);
        let square = dx * dx + dy * dy;
        let scale = if square > 0.0 { 1.0 / square } else { 0.0 };
        let reach = half.max(0.5) + 0.5;
        let top = (ay.min(by) - reach).floor().max(first_row as f32) as u32;
        let bottom = (ay.max(by) + reach).ceil().clamp(0.0, (first_row + rows) as f32) as u32;
        let width = self.stride - LANES;
        let is_level = dy.abs() <= 1e-6;
        let inverse = 1.0 / dy;
        for y in top..bottom {
            let center = y as f32 + 0.5;
            // The part of the line that is near this row.
            let (near, far) = if is_level {
                (0.0, 1.0)
            } else {
                let p = ((center - reach - ay) * inverse).clamp(0.0, 1.0);
                let q = ((center + reach - ay) * inverse).clamp(0.0, 1.0);
                (p.min(q), p.max(q))
            };
            let (p, q) = (ax + dx * near, ax + dx * far);
            let left = (p.min(q) - reach).floor().max(0.0) as usize;
            let right = ((p.max(q) + reach).ceil().max(0.0) as usize).min(width);
            if left >= right {
                continue;
            }
            let row = (y - first_row) as usize;
            self.touched[row] = true;
            let begin = row * self.stride;
            let words = &mut self.words[begin..begin + self.stride];
            // Eight pixels at a time; those that are too many are out of reach, or not shown.
            let mut x = left;
            while x < right {
                let own: &mut [u16; LANES] =
                    (&mut words[x..x + LANES]).try_into().expect("a row ends with eight more words");
                let column = I32x8::count_from(x as i32).to_f64().round() + F32x8::splat(0.5);
                let (px, py) = (column - F32x8::splat(ax), F32x8::splat(center - ay));
                let (along_x, along_y) = (F32x8::splat(dx), F32x8::splat(dy));
                let (zero, one) = (F32x8::ZERO, F32x8::splat(1.0));
                let part = ((px * along_x + py * along_y) * F32x8::splat(scale)).max(zero).min(one);
                let (ox, oy) = (px - along_x * part, py - along_y * part);
                let away = (ox * ox + oy * oy).sqrt();
                let mut share = (F32x8::splat(reach) - away).max(zero).min(one) * F32x8::splat(most);
                if stroke.is_hidden {
                    let is_steep = dy.abs() > dx.abs();
                    for lane in 0..LANES {
                        let along = if is_steep { center } else { column.0[lane] };
                        let gap = ((DASH[0] - along.rem_euclid(DASH[0] + DASH[1])) + 0.5).clamp(0.0, 1.0);
                        share.0[lane] *= gap * 0.7;
                    }
                }
                for (word, share) in own.iter_mut().zip(share.nearest_below().0) {
                    let new = if share > 0 { share << 8 | key } else { 0 };
                    *word = (*word).max(new as u16);
                }
                x += LANES;
            }
        }
    }

    /// Lays the lines of a row over its colors. Stretches with lines hold no mere background.
    #[inline(always)]
    pub(crate) fn blend(&self, row: u32, styles: &Styles, grounded: &mut [bool], colors: &mut [Vec3]) {
        let row = row as usize;
        if !self.touched[row] {
            return;
        }
        let words = &self.words[row * self.stride..][..colors.len()];
        for (at, (words, colors)) in words.chunks(LANES).zip(colors.chunks_mut(LANES)).enumerate() {
            if words.iter().fold(0, |any, w| any | w) == 0 {
                continue;
            }
            grounded[at * LANES / SPAN] = false;
            for (word, color) in words.iter().zip(colors).filter(|(word, _)| **word != 0) {
                let kind = Kind::ALL[usize::from(word & 7).min(Kind::ALL.len() - 1)];
                let pen = styles.all[usize::from(word >> 3 & 31)].pen(kind);
                *color = color.lerp(pen.color, f32::from(word >> 8) / 255.0);
            }
        }
    }
}

/// Lines sorted by the bands that they touch.
#[derive(Default)]
pub(crate) struct Sheaf {
    pub(crate) strokes: Vec<Stroke>,
    /// Indices of the lines, band by band.
    order: Vec<u32>,
    /// Where those of each band end.
    ends: Vec<u32>,
}

impl Sheaf {
    /// Sorts what was put into `strokes`.
    pub(crate) fn sort(&mut self, styles: &Styles, height: u32, rows: u32) {
        let bands = height.div_ceil(rows) as usize;
        let range = |s: &Stroke| {
            let pen = styles.all[usize::from(s.style)].pen(s.kind);
            let reach = pen.width * 0.5 + 1.0;
            let top = (s.from[1].min(s.to[1]) - reach).max(0.0) as usize / rows as usize;
            let bottom = (s.from[1].max(s.to[1]) + reach).max(0.0) as usize / rows as usize;
            top.min(bands)..(bottom + 1).min(bands)
        };
        self.ends.clear();
        self.ends.resize(bands + 1, 0);
        for stroke in &self.strokes {
            range(stroke).for_each(|band| self.ends[band + 1] += 1);
        }
        for band in 0..bands {
            self.ends[band + 1] += self.ends[band];
        }
        self.order.clear();
        self.order.resize(self.ends[bands] as usize, 0);
        // The beginning of each band moves on to its end, which is the beginning of the next.
        for (i, stroke) in self.strokes.iter().enumerate() {
            for band in range(stroke) {
                self.order[self.ends[band] as usize] = i as u32;
                self.ends[band] += 1;
            }
        }
    }

    /// Lists the lines of a band.
    pub(crate) fn of_band(&self, band: usize) -> impl Iterator<Item = &Stroke> {
        let begin = if band == 0 { 0 } else { self.ends[band - 1] };
        let own = &self.order[begin as usize..self.ends[band] as usize];
        own.iter().map(|&i| &self.strokes[i as usize])
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.strokes.capacity() * size_of::<Stroke>() + self.order.capacity() * 4) as u64
    }
}
