//! A picture, tile by tile: what is met first, then what is seen through, then the light on it.

use crate::bundle::{COLUMNS, Cone, Crossing, Hits, OCTETS, Rays, Sides, TILE};
use crate::edges::Fine;
use crate::layers;
use crate::light::{Illumination, Lit};
use crate::march::Gathered;
use crate::world::{Body, CastScratch, World};
use glam::Vec3;
use polyptych_core::camera::View;
use polyptych_core::framebuffer::{Band, Channel, Channels};
use polyptych_core::lanes::{F32x8, F64x8, LANES, Mask8, Vec3x8};
use polyptych_core::seam::Control;
use polyptych_core::shade::fogged;

/// Scratch memory for one band.
#[derive(Default)]
pub(crate) struct Scratch {
    pub(crate) rays: Vec<Rays>,
    pub(crate) opaque: Vec<Hits>,
    /// Rays that are followed through see-through surfaces, and what they met last.
    pub(crate) through: Vec<Rays>,
    pub(crate) layer: Vec<Hits>,
    pub(crate) gathered: Vec<Gathered>,
    pub(crate) pixels: Vec<Pixels>,
    /// Bodies that the rays of the tile may meet.
    pub(crate) bodies: Vec<u32>,
    pub(crate) light: crate::light::Scratch,
    pub(crate) form: CastScratch,
    /// Parts of rays in volumes.
    pub(crate) inside: layers::Scratch,
    pub(crate) fine: Fine,
    pub(crate) traced: u64,
}

/// What one frame is drawn with.
pub(crate) struct FrameDrawing<'a> {
    pub(crate) world: &'a World,
    pub(crate) view: View<'a>,
    pub(crate) channels: Channels,
    /// Where in the view the first pixel of a band that begins at row 0 is.
    pub(crate) corner: [u32; 2],
}

impl FrameDrawing<'_> {
    /// Draws all tiles of a band.
    pub(crate) fn draw(&self, band: &mut Band<'_>, scratch: &mut Scratch) {
        let mut lit = [Lit::NOTHING; OCTETS];
        for first in (0..band.width).step_by(TILE as usize) {
            self.draw_tile(band, first, &mut lit, scratch);
        }
    }

    /// Draws a band, tile by tile; stops between tiles when the host wants to.
    pub(crate) fn band(&self, band: &mut Band<'_>, scratch: &mut Scratch, control: &Control<'_>) {
        scratch.traced = 0;
        let mut lit = [Lit::NOTHING; OCTETS];
        for first in (0..band.width).step_by(TILE as usize) {
            if control.is_cancelled() {
                return;
            }
            self.draw_tile(band, first, &mut lit, scratch);
        }
    }

    polyptych_core::for_registers! {
        fn draw_tile<'a>(
            &'a self,
            band: &mut Band<'_>,
            first: u32,
            lit: &mut [Lit<'a>; OCTETS],
            scratch: &mut Scratch,
        ) = tile_512, tile_256, tile;
    }

    #[inline(always)]
    fn tile<'a>(
        &'a self,
        band: &mut Band<'_>,
        first: u32,
        lit: &mut [Lit<'a>; OCTETS],
        scratch: &mut Scratch,
    ) {
        // Where straight lines stay straight the corners bound all rays, which need not be known.
        let straight = self.view.row(band.first_row + self.corner[1]).is_some();
        let (cone, sides) = if straight {
            let corners = self.corners(band, first);
            let around = [1, 0, 2, 3].map(|i| (corners.origin.get(i), corners.direction.get(i)));
            (Cone::around(&[corners]), Some(Sides::between(around)))
        } else {
            self.aim(band, first, scratch);
            (Cone::around(&scratch.rays), None)
        };
        let touched = |body: &Body| {
            cone.is_none_or(|c| c.touches(body.center, body.radius))
                && !sides.is_some_and(|s| s.exclude(&body.corners))
        };
        let bodies = self.world.bodies.iter().enumerate().filter(|(_, b)| touched(b)).map(|(i, _)| i as u32);
        scratch.bodies.clear();
        scratch.bodies.extend(bodies);
        if straight {
            if scratch.bodies.is_empty() {
                self.leave_empty(band, first, scratch);
                return;
            }
            self.aim(band, first, scratch);
        }
        scratch.opaque.clear();
        scratch.opaque.extend(scratch.rays.iter().map(Hits::nothing));
        let has = |wanted: fn(&Body) -> bool| {
            scratch.bodies.iter().any(|&i| wanted(&self.world.bodies[i as usize]))
        };
        let (layered, volumes) = (has(|b| b.see_through && !b.is_volume()), has(Body::is_volume));
        self.nearest(
            |b| !b.see_through,
            &scratch.bodies,
            &scratch.rays,
            &mut scratch.opaque,
            &mut scratch.form,
        );
        let through = layered || volumes;
        if !through && !self.reads_surfaces() {
            for (octet, hits) in scratch.opaque.iter().enumerate() {
                let (row, column) = ((octet / COLUMNS) as u32, first + (octet % COLUMNS * LANES) as u32);
                if row < band.rows && column < band.width {
                    self.put_place(band, column, row, hits);
                }
            }
            return;
        }
        scratch.pixels.clear();
        scratch.pixels.resize(OCTETS, Pixels::NOTHING);
        if through {
            scratch.gathered.clear();
            scratch.gathered.resize(OCTETS, Gathered::NOTHING);
            self.look_through(layered, volumes, lit, scratch);
        }
        self.finish((first, band.first_row), through, lit, scratch);
        for (octet, pixels) in scratch.pixels.iter().enumerate() {
            let (row, column) = ((octet / COLUMNS) as u32, first + (octet % COLUMNS * LANES) as u32);
            if row < band.rows && column < band.width {
                pixels.put(band, column, row);
            }
        }
    }

    /// Returns the rays through the corners of a tile of a view that keeps straight lines straight.
    #[inline(always)]
    fn corners(&self, band: &Band<'_>, first: u32) -> Rays {
        let [left, top] = self.corner;
        let mut x = F64x8::splat(f64::from(left + first));
        (0..LANES).step_by(2).for_each(|i| x.0[i] = f64::from(left + band.width.min(first + TILE)));
        let row = f64::from(top + band.first_row);
        let (mut origin, mut direction, _) = self.view.rays(x, row);
        let lower = self.view.rays(x, row + f64::from(band.rows));
        for i in 0..2 {
            origin.set(i, lower.0.get(i));
            direction.set(i, lower.1.get(i));
        }
        Rays { origin, direction, near: F64x8::ZERO, far: F64x8::splat(f64::INFINITY) }
    }

    /// Fills a tile in which nothing is met.
    #[inline(always)]
    fn leave_empty(&self, band: &mut Band<'_>, first: u32, scratch: &mut Scratch) {
        let columns = TILE.min(band.width - first);
        scratch.traced += u64::from(columns * band.rows);
        for row in 0..band.rows {
            for column in (first..first + columns).step_by(LANES) {
                Pixels::NOTHING.put(band, column, row);
            }
            let begin = (row * band.width + first) as usize;
            let directions = self.view.row(self.corner[1] + band.first_row + row);
            if let (Some(colors), Some(directions)) =
                (band.color.get_mut(begin..begin + columns as usize), directions)
            {
                directions.fill(&self.world.scene.environment.background, self.corner[0] + first, colors);
            }
        }
    }

    /// Returns what is seen of the background behind eight pixels.
    #[inline(always)]
    fn background(&self, column: u32, row: u32, rays: &Rays) -> Vec3x8 {
        let background = &self.world.scene.environment.background;
        let Some(directions) = self.view.row(self.corner[1] + row) else {
            return background.gradient().colors(rays.direction.y.round()).finite();
        };
        let mut colors = [Vec3::ZERO; LANES];
        directions.fill(background, self.corner[0] + column, &mut colors);
        let mut all = Pixels::BLACK;
        for (lane, color) in colors.into_iter().enumerate() {
            all.set(lane, color);
        }
        all
    }

    /// Sets up the rays through the middles of the pixels.
    #[inline(always)]
    fn aim(&self, band: &Band<'_>, first: u32, scratch: &mut Scratch) {
        scratch.rays.clear();
        for octet in 0..OCTETS {
            let (row, column) = ((octet / COLUMNS) as u32, first + (octet % COLUMNS * LANES) as u32);
            let mut x = F64x8::ZERO;
            (0..LANES).for_each(|i| x.0[i] = f64::from(self.corner[0] + column + i as u32) + 0.5);
            let y = f64::from(self.corner[1] + band.first_row + row) + 0.5;
            let (origin, direction, there) = self.view.rays(x, y);
            let left = band.width.saturating_sub(column) as usize;
            let there = there & Mask8::first(if row < band.rows { left } else { 0 });
            let far = F64x8::pick(there, F64x8::splat(f64::INFINITY), F64x8::splat(-1.0));
            scratch.rays.push(Rays { origin, direction, near: F64x8::ZERO, far });
            scratch.traced += u64::from(there.count());
        }
    }

    /// Finds what each ray meets first among some bodies, or nothing nearer than before.
    #[inline(always)]
    pub(crate) fn nearest(
        &self,
        wanted: impl Fn(&Body) -> bool,
        bodies: &[u32],
        rays: &[Rays],
        hits: &mut [Hits],
        form: &mut CastScratch,
    ) {
        for &index in bodies {
            let body = &self.world.bodies[index as usize];
            if wanted(body) {
                body.cast(index, Crossing::Any, rays, hits, form);
            }
        }
    }

    /// Tells whether more is asked of surfaces than which they are and where.
    fn reads_surfaces(&self) -> bool {
        [Channel::Color, Channel::Shadow, Channel::Normal, Channel::Albedo]
            .iter()
            .any(|&c| self.channels.has(c))
    }

    /// Writes what eight rays met, and where.
    #[inline(always)]
    fn put_place(&self, band: &mut Band<'_>, column: u32, row: u32, hits: &Hits) {
        let count = LANES.min((band.width - column) as usize);
        let first = row as usize * band.width as usize + column as usize;
        let met = hits.any();
        let distance = met.pick(hits.t.round(), F32x8::splat(f32::INFINITY));
        put(band.distance, first, count, |i| distance.0[i]);
        put(band.coverage, first, count, |i| if met.has(i) { 1.0 } else { 0.0 });
        put(band.id, first, count, |i| {
            self.world.bodies.get(hits.body.0[i] as usize).map_or(0, |b| b.object as u32 + 1)
        });
    }

    pub(crate) fn illumination(&self) -> Illumination<'_> {
        let wanted = self.channels.has(Channel::Color) || self.channels.has(Channel::Shadow);
        let reads_color = self.channels.has(Channel::Color) || self.channels.has(Channel::Albedo);
        Illumination { world: self.world, wanted, reads_color }
    }

    /// Lights the opaque surfaces, lays what was gathered over them, and fills the pixels.
    #[inline(always)]
    fn finish<'a>(
        &'a self,
        (first, first_row): (u32, u32),
        through: bool,
        lit: &mut [Lit<'a>; OCTETS],
        scratch: &mut Scratch,
    ) {
        let Scratch { rays, opaque, light, form, traced, .. } = &mut *scratch;
        let reads_color = self.channels.has(Channel::Color);
        if self.reads_surfaces() && opaque.iter().any(|hits| hits.any().any()) {
            self.illumination().light(rays, opaque, lit, (light, form), traced);
        }
        for octet in 0..OCTETS {
            let (hits, met) = (&scratch.opaque[octet], scratch.opaque[octet].any());
            let pixels = &mut scratch.pixels[octet];
            if reads_color {
                let (row, column) = ((octet / COLUMNS) as u32, (octet % COLUMNS * LANES) as u32);
                pixels.color = self.background(first + column, first_row + row, &scratch.rays[octet]);
            }
            if met.any() {
                let lit = &lit[octet];
                self.first_surface(pixels, lit, hits, met);
                let mut seen = lit.color;
                if self.world.scene.environment.fog.is_some() {
                    (0..LANES).for_each(|i| seen.set(i, self.seen(seen.get(i), hits.t.0[i])));
                }
                pixels.color = Vec3x8::pick(met, seen, pixels.color);
            }
            if through {
                let gathered = &scratch.gathered[octet];
                pixels.color = gathered.color + pixels.color.scaled(gathered.transparency);
            }
        }
    }

    #[inline(always)]
    pub(crate) fn seen(&self, color: Vec3, t: f64) -> Vec3 {
        fogged(&self.world.scene.environment, color, t)
    }

    /// Fills the geometry channels of pixels that show nothing yet.
    #[inline(always)]
    pub(crate) fn first_surface(&self, pixels: &mut Pixels, lit: &Lit<'_>, hits: &Hits, met: Mask8) {
        let (mut free, mut ids) = (met, Mask8::NONE);
        for i in 0..LANES {
            free.0[i] &= if pixels.id.0[i] == 0 { u32::MAX } else { 0 };
            ids.0[i] = self.world.bodies.get(hits.body.0[i] as usize).map_or(0, |b| b.object as u32 + 1);
        }
        pixels.id = free.pick_bits(ids, pixels.id);
        if self.channels.has(Channel::Shadow) {
            for i in 0..LANES {
                if free.has(i) && lit.casting.0[i] > 0 {
                    pixels.shadow.0[i] = 1.0 - lit.dark.0[i] as f32 / lit.casting.0[i] as f32;
                }
            }
        }
        pixels.distance = free.pick(hits.t.round(), pixels.distance);
        pixels.normal = Vec3x8::pick(free, lit.points.normal.round(), pixels.normal);
        pixels.albedo = Vec3x8::pick(free, lit.points.color, pixels.albedo);
    }
}

/// Eight pixels.
#[derive(Clone, Copy)]
pub(crate) struct Pixels {
    color: Vec3x8,
    pub(crate) distance: F32x8,
    pub(crate) normal: Vec3x8,
    /// 0 where there is nothing.
    pub(crate) id: Mask8,
    pub(crate) albedo: Vec3x8,
    shadow: F32x8,
}

impl Pixels {
    const BLACK: Vec3x8 = Vec3x8 { x: F32x8::ZERO, y: F32x8::ZERO, z: F32x8::ZERO };

    const NOTHING: Self = Self {
        color: Self::BLACK,
        distance: F32x8::new([f32::INFINITY; LANES]),
        normal: Self::BLACK,
        id: Mask8::NONE,
        albedo: Self::BLACK,
        shadow: F32x8::new([1.0; LANES]),
    };

    /// Writes them into all planes that are there, as many as the row has.
    #[inline(always)]
    fn put(&self, band: &mut Band<'_>, column: u32, row: u32) {
        let count = LANES.min((band.width - column) as usize);
        let first = row as usize * band.width as usize + column as usize;
        put(band.color, first, count, |i| self.color.get(i));
        put(band.distance, first, count, |i| self.distance.0[i]);
        put(band.normal, first, count, |i| self.normal.get(i));
        put(band.id, first, count, |i| self.id.0[i]);
        put(band.albedo, first, count, |i| self.albedo.get(i));
        put(band.shadow, first, count, |i| self.shadow.0[i]);
        put(band.coverage, first, count, |i| if self.id.0[i] != 0 { 1.0 } else { 0.0 });
    }
}

#[inline(always)]
fn put<T>(plane: &mut [T], first: usize, count: usize, value: impl Fn(usize) -> T) {
    let Some(row) = plane.get_mut(first..first + count) else { return };
    for (i, v) in row.iter_mut().enumerate() {
        *v = value(i);
    }
}
