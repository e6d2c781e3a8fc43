//! How do lines get onto the picture: edges tile by tile, and those at which bodies cross when all tiles are done?

use crate::crossings::Seen;
use crate::grid::{TILE_HEIGHT, TILE_PIXELS, TILE_WIDTH, TileArea};
use crate::light::Illumination;
use crate::lines::Lines;
use crate::paint::{Painter, Scratch};
use crate::strokes::Strokes;
use glam::Vec3;
use polyptych_core::framebuffer::{Band, Channel, Framebuffer};
use polyptych_core::seam::Control;
use std::sync::atomic::Ordering;

/// A drawing of lines.
#[derive(Clone, Copy)]
pub(crate) struct Drawing<'a> {
    pub(crate) lines: &'a Lines,
    pub(crate) strokes: &'a Strokes,
    /// Whether surfaces hide what lies behind them.
    pub(crate) hides: bool,
}

impl Painter<'_> {
    /// Draws the lines at which bodies cross each other over a picture whose visible lines are drawn, if the mode
    /// shows them.
    pub(crate) fn paint_crossings(&self, target: &mut Framebuffer, control: &Control<'_>) -> bool {
        let (width, height) = (target.width(), target.height());
        let Some(drawing) = self.drawing.filter(|d| d.hides && self.channels.has(Channel::Color)) else {
            return false;
        };
        let seen = Seen { triangles: &drawing.strokes.seen, width, height };
        let Illumination { scene, model, .. } = self.light;
        target.for_each_band(control.threads, TILE_HEIGHT, &|band| {
            for i in 0..band.width * band.rows {
                let (x, y) = (i % band.width, band.first_row + i / band.width);
                if let Some((share, part)) = seen.crossing(model, self.lens, x, y) {
                    let (_, direction) = self.lens.line(f64::from(x) + 0.5, f64::from(y) + 0.5);
                    let paper = scene.environment.background.color(direction.normalize_or_zero());
                    let color = &mut band.color[i as usize];
                    *color = color.lerp(ink_on(paper, self.base_color(part, 0)), share);
                }
            }
        });
        true
    }

    /// Returns the base color of a slot of a part.
    fn base_color(&self, part: usize, slot: usize) -> Vec3 {
        let Illumination { scene, model, .. } = self.light;
        scene.material(&scene.objects[model.parts[part].object], slot).base_color
    }

    /// Draws the lines of a tile over its surfaces.
    #[inline(never)]
    pub(crate) fn draw_lines(
        &self,
        drawing: &Drawing<'_>,
        tile: usize,
        area: &TileArea,
        seen: &[u32; TILE_PIXELS],
        band: &mut Band<'_>,
        scratch: &mut Scratch,
    ) {
        let place = |pixel: usize| (pixel as u32 % TILE_WIDTH, pixel as u32 / TILE_WIDTH);
        let index = |(x, y): (u32, u32)| (y * band.width + area.x as u32 + x) as usize;
        if drawing.hides {
            for (y, row) in (0..area.height as u32).zip(seen.chunks_exact(TILE_WIDTH as usize)) {
                let to = (area.y as u32 + y) as usize * band.width as usize + area.x as usize;
                let places = &drawing.strokes.seen[to..to + area.width as usize];
                places.iter().zip(row).for_each(|(place, id)| place.store(*id, Ordering::Relaxed));
            }
        }
        let model = self.light.model;
        let of = (model, self.lens, drawing.lines);
        let Scratch { faces, ink, .. } = scratch;
        if !drawing.strokes.draw(tile, area, seen, of, faces, ink) {
            return;
        }
        let Some(ink) = ink else { return };
        for pixel in (0..TILE_PIXELS).filter(|&pixel| ink.share[pixel] > 0.0) {
            let (at, share, part) = (index(place(pixel)), ink.share[pixel], ink.part[pixel] as usize);
            let slot = ink.slot(pixel, model, drawing.lines);
            if let Some(color) = band.color.get_mut(at) {
                *color = color.lerp(ink_on(*color, self.base_color(part, slot)), share);
            }
            if drawing.hides {
                continue;
            }
            if let Some(coverage) = band.coverage.get_mut(at) {
                *coverage = share;
            }
            let (x, y) = place(pixel);
            let (x, y) = (f64::from(area.x as u32 + x) + 0.5, f64::from(area.y as u32 + y) + 0.5);
            let distance = ink.ahead[pixel] * self.lens.line(x, y).1.length();
            if share >= 0.5 {
                fn put<T>(plane: &mut [T], at: usize, value: T) {
                    if let Some(place) = plane.get_mut(at) {
                        *place = value;
                    }
                }
                put(band.distance, at, distance as f32);
                put(band.id, at, model.parts[part].object as u32 + 1);
                put(band.albedo, at, self.base_color(part, slot));
            }
        }
    }
}

/// Least contrast of lines, the ratio of luminances with 0.05 added: what the Web Content Accessibility Guidelines
/// 2.1 ask of drawings.
const CONTRAST: f32 = 3.0;

/// Returns the color of a line on a ground: its own, made darker or lighter until it can be told from the ground.
fn ink_on(ground: Vec3, own: Vec3) -> Vec3 {
    let luminance = |c: Vec3| c.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    let (paper, line) = (luminance(ground) + 0.05, luminance(own) + 0.05);
    if paper.max(line) >= CONTRAST * paper.min(line) {
        return own;
    }
    let (darker, lighter) = (paper / CONTRAST - 0.05, paper * CONTRAST - 0.05);
    if darker >= 0.0 {
        own * (darker / (line - 0.05).max(darker))
    } else {
        own.lerp(Vec3::ONE, ((lighter - line + 0.05) / (1.05 - line).max(0.05)).clamp(0.0, 1.0))
    }
}
