//! From visible surfaces to colors: tone, highlights, strokes, paper, and lines on top, row by row.

use crate::eight::{Eight, Few, Seen, lacks, sorted, steepness, union};
use crate::ink::{Ink, Sheaf};
use crate::light::Lighting;
use crate::look::Look;
use crate::paper::Grain;
use crate::spans::{SPAN, Spans, Stretch};
use crate::style::{Highlight, Show, Style, Styles};
use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection, RowDirections, View};
use polyptych_core::framebuffer::{Band, Framebuffer};
use polyptych_core::lanes::{F32x8, F64x8, I32x8, LANES, Vec3x8};
use polyptych_core::scene::Scene;
use polyptych_core::shade::fogged;

/// Rows drawn by one worker at a time.
pub(crate) const ROWS: u32 = 32;

/// Buffers of a band.
#[derive(Default)]
pub(crate) struct Scratch {
    /// Cosines to the light of a row and of its neighbors: a row's are where its number divided by three leaves.
    facing: Vec<f32>,
    pub(crate) ink: Ink,
    /// Which stretches of its rows hold the background, and nothing else.
    grounded: Vec<bool>,
}

impl Scratch {
    pub(crate) fn bytes(&self) -> usize {
        self.facing.capacity() * 4 + self.ink.bytes() + self.grounded.capacity()
    }
}

/// What one frame is painted with.
pub(crate) struct Painting<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) styles: &'a Styles,
    pub(crate) looks: &'a [Look],
    pub(crate) view: View<'a>,
    pub(crate) camera: &'a Camera,
    pub(crate) visible: &'a Framebuffer,
    pub(crate) light: Lighting<'a>,
    pub(crate) grain: &'a Grain,
    pub(crate) lines: &'a Sheaf,
    pub(crate) spans: &'a Spans,
    /// Whether stretches that hold the background may keep it.
    pub(crate) ground_stays: bool,
    /// Nearest and farthest distance of the scene, to show depth.
    pub(crate) depths: [f32; 2],
    pub(crate) any_coded: bool,
}

impl Painting<'_> {
    polyptych_core::for_registers! {
        /// Paints a band.
        pub(crate) fn draw(&self, band: &mut Band<'_>, scratch: &mut Scratch) = band_512, band_256, band;
    }

    #[inline(always)]
    fn band(&self, band: &mut Band<'_>, scratch: &mut Scratch) {
        let (width, first) = (band.width, band.first_row);
        let Scratch { facing, ink, grounded } = scratch;
        let columns = (width as usize).div_ceil(SPAN);
        grounded.resize(columns * band.rows as usize, false);
        let stride = width as usize + 2 * LANES;
        facing.resize(stride * 3, 0.0);
        // From one row up on: the first of the picture has a neighbor, too.
        let place = |row_below: u32| (row_below % 3) as usize * stride;
        let lines = self.styles.draw_lines();
        if lines {
            ink.clear(width, band.rows);
            for stroke in self.lines.of_band((first / ROWS) as usize) {
                ink.draw(stroke, self.styles, first, band.rows);
            }
        }
        let (shades, height) = (self.styles.all[0].show == Show::Style, self.visible.height());
        // Edges of steps are as wide as the rows around say.
        let around = u32::from(self.styles.all.iter().any(|s| s.tone.steps > 1));
        let mut next = first.saturating_sub(around);
        for row in 0..band.rows {
            let y = first + row;
            // No sooner than they are asked for: what they are reckoned from is read again when the row is painted, and
            // should still be near.
            while shades && next <= (y + around).min(height - 1) {
                let begin = place(next + 1);
                self.face(next, &mut facing[begin..begin + stride]);
                next += 1;
            }
            let [above, own, below] = [0, 1, 2].map(|row| place(y + row));
            // Beyond the picture it goes on as it is.
            if y == 0 {
                facing.copy_within(own..own + stride, above);
            }
            if y + 1 == height {
                facing.copy_within(own..own + stride, below);
            }
            let colors = &mut band.color[(row * width) as usize..((row + 1) * width) as usize];
            let grounded = &mut grounded[row as usize * columns..][..columns];
            self.row(y, [above, own, below], facing, grounded, colors);
            if lines {
                ink.blend(row, self.styles, grounded, colors);
            }
        }
    }

    /// Reckons the cosines to the light of a row, shadows included, with a margin at its ends.
    #[inline(always)]
    fn face(&self, y: u32, facing: &mut [f32]) {
        let width = self.visible.width() as usize;
        let row = y as usize * width;
        let directions = self.view.row(y);
        let (mut x, mut few) = (0, Few::default());
        for stretch in self.spans.row(y) {
            let end = width.min(x + SPAN);
            if *stretch == Stretch::Empty {
                facing[LANES + x..LANES + end.next_multiple_of(LANES)].fill(0.0);
                x = end;
            }
            let is_full = *stretch == Stretch::Full;
            while x < end {
                let count = (width - x).min(LANES);
                let out = &mut facing[LANES + x..LANES + x + LANES];
                let seen = Seen::at(self.visible, row + x, count, &mut few);
                if !is_full && union::<LANES>(seen.ids) == 0 {
                    out.fill(0.0);
                } else {
                    self.cosines(x, y, &seen, directions.as_ref()).store(out);
                }
                x += LANES;
            }
        }
        facing[LANES - 1] = facing[LANES];
        facing[LANES + width] = facing[LANES + width - 1];
    }

    /// Reckons the cosines to the light of eight pixels, shadows included.
    #[inline(always)]
    fn cosines(&self, x: usize, y: u32, seen: &Seen<'_>, directions: Option<&RowDirections>) -> F32x8 {
        let toward = self.toward(x, y, seen, directions);
        let bounded = sorted(seen.normal).dot(toward).max(F32x8::splat(-1.0)).min(F32x8::splat(1.0));
        if self.visible.shadow().is_empty() {
            return bounded.finite();
        }
        // A style without shadows has them where nothing is darker.
        let depth_of = |s: &Style| if s.shadow { s.shadow_depth } else { f32::INFINITY };
        let mut depth = F32x8::splat(depth_of(&self.styles.all[0]));
        if self.styles.all.len() > 1 {
            for (depth, id) in depth.0.iter_mut().zip(seen.ids) {
                *depth = depth_of(&self.styles.all[usize::from(self.styles.index(*id))]);
            }
        }
        let lit = F32x8::new(*seen.shadow);
        bounded.above(depth).pick(depth + (bounded - depth) * lit, bounded).finite()
    }

    /// Returns the directions to the light of eight pixels.
    #[inline(always)]
    pub(crate) fn toward(
        &self,
        x: usize,
        y: u32,
        seen: &Seen<'_>,
        directions: Option<&RowDirections>,
    ) -> Vec3x8 {
        if let Some(uniform) = self.light.uniform {
            return Vec3x8::splat(uniform);
        }
        let mut all = Vec3x8::splat(Vec3::Y);
        for (lane, &distance) in seen.distance.iter().enumerate() {
            let column = (x + lane) as u32;
            let ray = || self.view.ray(f64::from(column) + 0.5, f64::from(y) + 0.5);
            let to_eye = || match directions {
                Some(directions) => -directions.at(column),
                None => ray().map_or(Vec3::Y, |r| -r.direction.as_vec3()),
            };
            let position = || match self.visible.distance().is_empty() {
                false => ray().map_or(DVec3::ZERO, |r| r.at(f64::from(distance))),
                true => DVec3::ZERO,
            };
            all.set(lane, self.light.toward(position, to_eye));
        }
        all
    }

    /// Paints a row without its lines. `around` is where the cosines of the row above, its own, and those below begin.
    #[inline(always)]
    fn row(&self, y: u32, around: [usize; 3], facing: &[f32], grounded: &mut [bool], colors: &mut [Vec3]) {
        let width = colors.len();
        let directions = self.view.row(y);
        let row = y as usize * width;
        let (mut x, mut few) = (0, Few::default());
        for (stretch, grounded) in self.spans.row(y).iter().zip(grounded) {
            let end = width.min(x + SPAN);
            let (is_empty, is_full) = (*stretch == Stretch::Empty, *stretch == Stretch::Full);
            let stays = self.ground_stays && *grounded && is_empty;
            if !is_full && !stays {
                self.ground(x as u32, y, directions.as_ref(), &mut colors[x..end]);
            }
            *grounded = is_empty;
            if is_empty {
                x = end;
            }
            while x < end {
                let count = (width - x).min(LANES);
                let seen = Seen::at(self.visible, row + x, count, &mut few);
                if is_full || union::<LANES>(seen.ids) != 0 {
                    let (direction, origin) = self.rays(x, y, directions.as_ref());
                    let eight = Eight { x: x as u32, y, count, seen, direction };
                    let around = [0, 1, 2].map(|i: usize| around[i] + LANES + x);
                    self.paint(&eight, is_full, origin, around, facing, &mut colors[x..x + count]);
                }
                x += LANES;
            }
        }
    }

    /// Paints eight pixels, each in its style. `is_full` tells that there is something in each.
    #[inline(always)]
    fn paint(
        &self,
        eight: &Eight<'_>,
        is_full: bool,
        origin: Vec3x8,
        around: [usize; 3],
        facing: &[f32],
        out: &mut [Vec3],
    ) {
        // Mostly one style paints all; where there are several, each paints its own pixels.
        let is_whole = self.styles.all.len() == 1 && (is_full || !lacks::<LANES>(eight.seen.ids));
        for (index, style) in (0u8..).zip(&self.styles.all) {
            let is_own = |id: u32| id != 0 && self.styles.index(id) == index;
            if !is_whole && !eight.seen.ids.iter().copied().any(is_own) {
                continue;
            }
            let result = self.eight(style, eight, origin, around, facing);
            if let (true, Ok(out)) = (is_whole, <&mut [Vec3; LANES]>::try_from(&mut *out)) {
                for (lane, color) in out.iter_mut().enumerate() {
                    *color = result.get(lane);
                }
            } else {
                for (lane, (color, id)) in out.iter_mut().zip(eight.seen.ids).enumerate() {
                    if is_own(*id) {
                        *color = result.get(lane);
                    }
                }
            }
        }
    }

    /// Returns the directions of eight rays, and where they begin as seen from the eye.
    #[inline(always)]
    fn rays(&self, x: usize, y: u32, directions: Option<&RowDirections>) -> (Vec3x8, Vec3x8) {
        let columns = I32x8::count_from(x as i32).to_f64();
        if let (Projection::Perspective { .. }, Some(row)) = (&self.camera.projection, directions) {
            let direction = Vec3x8::splat(row.first) + Vec3x8::splat(row.step).scaled(columns.round());
            let length = F32x8::splat(1.0) / direction.length();
            return (direction.scaled(length), Vec3x8::splat(Vec3::ZERO));
        }
        let (origin, direction, _) = self.view.rays(columns + F64x8::splat(0.5), f64::from(y) + 0.5);
        let eye = polyptych_core::lanes::DVec3x8::splat(self.camera.eye);
        (direction.round().finite(), (origin - eye).round().finite())
    }

    /// Paints eight pixels in one style.
    #[inline(always)]
    fn eight(
        &self,
        style: &Style,
        eight: &Eight<'_>,
        origin: Vec3x8,
        [above, at, below]: [usize; 3],
        facing: &[f32],
    ) -> Vec3x8 {
        if style.show != Show::Style {
            return self.study(style.show, eight);
        }
        let coded = sorted(eight.seen.albedo);
        let is_coded = self.any_coded && eight.seen.ids.iter().any(|&id| self.look(id).is_coded);
        let own = if is_coded { self.decode(eight) } else { coded };
        let cosine = F32x8::load(&facing[at..]);
        let slope = if style.tone.steps > 1 {
            // On the smooth side: next to another surface or a shadow the other difference says nothing.
            let across = steepness(cosine, facing, at - 1, at + 1);
            let down = steepness(cosine, facing, above, below);
            (across * across + down * down).sqrt()
        } else {
            F32x8::ZERO
        };
        let mut color = style.tone.colors(own, cosine, slope);
        let takes_normal = style.highlight != Highlight::Off || style.hatching.is_some();
        let normal = if takes_normal { sorted(eight.seen.normal) } else { Vec3x8::splat(Vec3::ZERO) };
        if style.highlight != Highlight::Off {
            color = self.shine(style, eight, normal, cosine, color);
        }
        if let Some(hatching) = &style.hatching {
            color = self.hatch(hatching, style, eight, origin, (own, coded, normal, cosine), color);
        }
        if style.paper.grain > 0.0 {
            let grain = self.grain.at(eight.x, eight.y);
            let shade =
                F32x8::splat(1.0) + (grain - F32x8::splat(0.5)) * F32x8::splat(0.3 * style.paper.grain);
            color = color.scaled(shade);
        }
        if self.scene.environment.fog.is_some() {
            for (lane, &distance) in eight.seen.distance.iter().enumerate() {
                color.set(lane, fogged(&self.scene.environment, color.get(lane), f64::from(distance)));
            }
        }
        color.finite()
    }

    /// Shows distance or normal.
    #[inline(always)]
    fn study(&self, show: Show, eight: &Eight<'_>) -> Vec3x8 {
        let half = Vec3x8::splat(Vec3::splat(0.5));
        if show == Show::Normals {
            return sorted(eight.seen.normal).scaled(F32x8::splat(0.5)) + half;
        }
        let [near, far] = self.depths;
        let distance = F32x8::new(*eight.seen.distance);
        let part = (distance - F32x8::splat(near)) / F32x8::splat((far - near).max(f32::MIN_POSITIVE));
        let light = F32x8::splat(1.0) - part.max(F32x8::ZERO).min(F32x8::splat(1.0)) * F32x8::splat(0.9);
        Vec3x8 { x: light, y: light, z: light }.finite()
    }

    #[inline(always)]
    pub(crate) fn look(&self, id: u32) -> Look {
        self.looks.get(id.wrapping_sub(1) as usize).copied().unwrap_or_default()
    }

    /// Reads the colors of surfaces whose color channel holds texture coordinates.
    fn decode(&self, eight: &Eight<'_>) -> Vec3x8 {
        let coordinates = sorted(eight.seen.albedo);
        let mut own = coordinates;
        for lane in 0..eight.count {
            let id = eight.seen.ids[lane];
            if !self.look(id).is_coded {
                continue;
            }
            let here = coordinates.get(lane);
            let object = &self.scene.objects[id as usize - 1];
            let material = self.scene.material(object, here.z.round().max(0.0) as usize);
            // How much of the texture a pixel covers, as far as its neighbor in the row tells.
            let beside = if lane > 0 { lane - 1 } else { (lane + 1).min(eight.count - 1) };
            let texture = material.texture.and_then(|t| self.scene.textures.get(t));
            let change = (coordinates.get(beside) - here).truncate().abs();
            let lod =
                if change.max_element() < 0.1 { texture.map_or(0.0, |t| t.lod(change, change)) } else { 0.0 };
            let color = self.scene.base_color(material, Some([here.x, here.y]), Vec3::ZERO, Vec3::Y, lod).0;
            own.set(lane, color);
        }
        own
    }
}
