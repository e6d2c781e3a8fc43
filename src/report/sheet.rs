//! All panels in one picture, with captions.

use crate::compare::{Comparison, Panel};
use crate::framebuffer::Channel;
use crate::picture::displayed;
use font8x8::UnicodeFonts;

/// A picture in 8-bit sRGB.
pub(super) struct Sheet {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pixels: Vec<[u8; 3]>,
}

const GAP: u32 = 12;
const CAPTION: u32 = 40;
const PAPER: [u8; 3] = [24, 26, 30];
const INK: [u8; 3] = [232, 234, 238];
const FAINT: [u8; 3] = [150, 156, 166];

/// Draws the panels in rows of up to three; large pictures are halved until a panel is at most 720 wide.
pub(super) fn draw(comparison: &Comparison) -> Sheet {
    let mut shrink = 1;
    while comparison.width / shrink > 720 {
        shrink += 1;
    }
    let (width, height) = ((comparison.width / shrink).max(1), (comparison.height / shrink).max(1));
    let columns = (comparison.panels.len() as u32).clamp(1, 3);
    let rows = (comparison.panels.len() as u32).div_ceil(columns);
    let cell = (width.max(220) + GAP, height + CAPTION + GAP);
    let mut sheet = Sheet { width: GAP + columns * cell.0, height: GAP + rows * cell.1, pixels: Vec::new() };
    sheet.pixels = vec![PAPER; sheet.width as usize * sheet.height as usize];
    for (i, panel) in comparison.panels.iter().enumerate() {
        let (x, y) = (GAP + i as u32 % columns * cell.0, GAP + i as u32 / columns * cell.1);
        sheet.text(x, y, &panel.name, INK);
        sheet.text(x, y + 18, &caption(panel), FAINT);
        sheet.picture(x, y + CAPTION, panel, width, height, shrink);
    }
    sheet
}

fn caption(panel: &Panel) -> String {
    let mut text = format!("{:.1} ms", panel.frame_ms);
    if let Some(color) = panel.errors.and_then(|e| e.color) {
        text.push_str(&format!("  {:.1} dB", color.psnr));
    }
    let changed = panel.decisions.iter().filter(|d| d.word() != "exact").count();
    if changed > 0 {
        text.push_str(&format!("  {changed} not as given"));
    }
    text
}

impl Sheet {
    fn put(&mut self, x: u32, y: u32, color: [u8; 3]) {
        if x < self.width && y < self.height {
            self.pixels[(y * self.width + x) as usize] = color;
        }
    }

    /// Writes a line in an 8x8 font, doubled in height so that it reads well.
    fn text(&mut self, x: u32, y: u32, text: &str, color: [u8; 3]) {
        for (i, letter) in text.chars().enumerate() {
            let glyph = font8x8::BASIC_FONTS.get(letter).unwrap_or([0; 8]);
            for (row, bits) in glyph.iter().enumerate() {
                for column in (0..8).filter(|c| bits >> c & 1 == 1) {
                    let (px, py) = (x + i as u32 * 8 + column, y + row as u32 * 2);
                    self.put(px, py, color);
                    self.put(px, py + 1, color);
                }
            }
        }
    }

    /// Lays in a picture, each pixel the mean of `shrink` x `shrink`.
    fn picture(&mut self, x: u32, y: u32, panel: &Panel, width: u32, height: u32, shrink: u32) {
        let pixels = displayed(&panel.picture, Channel::Color);
        let stride = panel.picture.width();
        if pixels.is_empty() {
            return;
        }
        for v in 0..height {
            for u in 0..width {
                let mut sum = [0u32; 3];
                for k in 0..shrink * shrink {
                    let i = (v * shrink + k / shrink) * stride + u * shrink + k % shrink;
                    (0..3).for_each(|c| sum[c] += u32::from(pixels[i as usize][c]));
                }
                self.put(x + u, y + v, sum.map(|s| (s / (shrink * shrink)) as u8));
            }
        }
    }
}
