//! A picture, tile by tile: what can the rays of a tile meet, what do they meet, and what color is it?

use crate::beam::Bundle;
use crate::levels::Footprint;
use crate::octet::{Bytes, NOTHING, Octet, Rays};
use crate::trace::{Shadows, Tracer, Wants, finite};
use crate::world::{LIFT, Reach, World};
use glam::{DVec2, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection, View};
use polyptych_core::framebuffer::{Band, Channel, Channels, Framebuffer, Pixel};
use polyptych_core::lanes::{DVec3x8, F64x8, I32x8, LANES, Mask8};
use polyptych_core::math::{Aabb, Ray};
use polyptych_core::seam::Control;

/// Edge of a tile in pixels, and rows of a band: rays of a tile meet the same chunks.
pub(crate) const TILE: u32 = 16;
const TILE_RAYS: usize = (TILE * TILE) as usize;
/// Lamps whose shadow rays are bounded together, the first of a scene.
const BOUNDED_LAMPS: usize = 4;

/// Draws bands of a picture.
#[derive(Clone, Copy)]
pub(crate) struct Painter<'a> {
    view: View<'a>,
    /// Whether the rays of a tile lie between those of its corners.
    is_straight: bool,
    wants: Wants,
    channels: Channels,
    pattern: Pattern,
    /// Where in a pixel its ray goes through.
    place: DVec2,
    /// How many rays a pixel's color is the mean of.
    samples: u32,
    /// How large pixels are, where blocks of cells may stand for them.
    footprint: Footprint,
}

/// Which pixels are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pattern {
    /// All of them.
    Whole,
    /// Every other one, as the black fields of a board, or the white ones: those whose row and column and `first` sum up
    /// to an even number.
    Half {
        first: u32,
        /// Whether the others are filled in from their neighbors, or left as they are.
        fills: bool,
    },
}

/// Pixels of a band that are drawn together.
#[derive(Clone, Copy)]
struct Tile {
    first_column: u32,
    columns: u32,
    first_row: u32,
    rows: u32,
}

/// Where a tile's pixels are drawn eight at a time.
struct Places {
    list: [(u32, u32); TILE_RAYS / LANES],
    count: usize,
    stride: u32,
}

impl Tile {
    /// Lists first columns and rows of pixels that are drawn eight at a time, and how far apart they are: two rows at
    /// once, so that two in sequence are neighbors.
    #[inline(always)]
    fn octets(self, pattern: Pattern) -> Places {
        let mut places = Places { list: [(0, 0); TILE_RAYS / LANES], count: 0, stride: 1 };
        if pattern != Pattern::Whole {
            places.stride = 2;
        }
        for upper in (0..self.rows).step_by(2) {
            for column in (0..self.columns).step_by(LANES * places.stride as usize) {
                for row in upper..self.rows.min(upper + 2) {
                    let offset = match pattern {
                        Pattern::Whole => 0,
                        Pattern::Half { first, .. } => (self.first_column + self.first_row + row + first) & 1,
                    };
                    if column + offset < self.columns {
                        places.list[places.count] = (column + offset, row);
                        places.count += 1;
                    }
                }
            }
        }
        places
    }

    /// Tells whether a pixel is drawn.
    fn has(self, pattern: Pattern, x: u32, row: u32) -> bool {
        match pattern {
            Pattern::Whole => true,
            Pattern::Half { first, .. } => (x + self.first_row + row + first).is_multiple_of(2),
        }
    }

    /// Lists the pixels by rows: index in the tile, column in the picture, row in the band.
    fn pixels(self) -> impl Iterator<Item = (usize, u32, u32)> {
        (0..self.rows).flat_map(move |row| {
            (0..self.columns).map(move |x| ((row * TILE + x) as usize, self.first_column + x, row))
        })
    }
}

/// A box around the surfaces that a tile sees.
struct Sites {
    least: DVec3x8,
    most: DVec3x8,
    farthest: F64x8,
    radius: f64,
}

impl Default for Sites {
    fn default() -> Self {
        Self {
            least: DVec3x8::splat(DVec3::INFINITY),
            most: DVec3x8::splat(DVec3::NEG_INFINITY),
            farthest: F64x8::ZERO,
            radius: 0.0,
        }
    }
}

impl Sites {
    #[inline(always)]
    fn add(&mut self, world: &World, octet: &Octet) {
        let (position, seen) = (octet.position(), octet.seen());
        let take = |on: bool, yes: F64x8, no: F64x8| {
            F64x8::pick(seen, if on { yes.min(no) } else { yes.max(no) }, no)
        };
        self.least.x = take(true, position.x, self.least.x);
        self.least.y = take(true, position.y, self.least.y);
        self.least.z = take(true, position.z, self.least.z);
        self.most.x = take(false, position.x, self.most.x);
        self.most.y = take(false, position.y, self.most.y);
        self.most.z = take(false, position.z, self.most.z);
        self.farthest = take(false, octet.t, self.farthest);
        let mut last = NOTHING;
        for item in octet.item {
            if item != NOTHING && item != last {
                self.radius = self.radius.max(world.items[item as usize].radius);
                last = item;
            }
        }
    }

    /// Returns the box, grown by as much as rays begin above surfaces.
    fn bounds(&self) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        let mut largest = self.radius;
        for i in 0..LANES {
            if self.most.x.0[i] >= self.least.x.0[i] {
                let (least, most) = (self.least.get(i), self.most.get(i));
                bounds = bounds.with(least).with(most);
                largest = largest.max(self.farthest.0[i]).max(least.abs().max(most.abs()).max_element());
            }
        }
        if bounds.is_empty() { bounds } else { bounds.grown(largest * LIFT) }
    }
}

/// Returns what must be found out for some channels; what is not asked for is not computed.
fn wants(channels: Channels) -> Wants {
    Wants { color: channels.has(Channel::Color), shadow: channels.has(Channel::Shadow) }
}

impl<'a> Painter<'a> {
    pub(crate) fn new(
        camera: &'a Camera,
        target: &Framebuffer,
        pattern: Pattern,
        samples: u32,
        footprint: Footprint,
    ) -> Self {
        Self {
            view: camera.view(target.width(), target.height()),
            is_straight: matches!(
                camera.projection,
                Projection::Perspective { .. } | Projection::Orthographic { .. }
            ),
            wants: wants(target.channels()),
            channels: target.channels(),
            pattern,
            place: DVec2::splat(0.5),
            samples,
            footprint,
        }
    }

    /// Draws a band tile by tile; false where the host stopped it.
    pub(crate) fn paint(&self, tracer: &Tracer<'_>, band: &mut Band<'_>, control: &Control<'_>) -> bool {
        for first_column in (0..band.width).step_by(TILE as usize) {
            if control.is_cancelled() {
                return false;
            }
            let columns = TILE.min(band.width - first_column);
            let tile = Tile { first_column, columns, first_row: band.first_row, rows: band.rows };
            self.draw_tile(tracer, band, tile);
            if self.samples > 1 {
                self.smooth(tracer, band, tile);
            }
        }
        true
    }

    polyptych_core::for_registers! {
        /// Draws a tile.
        fn draw_tile(&self, tracer: &Tracer<'_>, band: &mut Band<'_>, tile: Tile) = draw_512, draw_256, draw;
    }

    #[inline(always)]
    fn draw(&self, tracer: &Tracer<'_>, band: &mut Band<'_>, tile: Tile) {
        match self.reach(tracer, tile) {
            Some(reach) if reach.is_empty() => self.empty_tile(tracer, band, tile),
            Some(reach) => self.tile(tracer, band, tile, &reach),
            None => self.wide_tile(tracer, band, tile),
        }
    }

    /// Puts the mean of many rays in the place of a tile's colors, and of its coverage. They go through places that a
    /// golden section spreads evenly over the pixel, the same in each, so that nothing flickers.
    fn smooth(&self, tracer: &Tracer<'_>, band: &mut Band<'_>, tile: Tile) {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let (mut colors, mut covers) = ([Vec3::ZERO; TILE_RAYS], [0.0f32; TILE_RAYS]);
        let (mut color, mut cover) = (colors, covers);
        let channels = Channels::NONE.with(Channel::Coverage);
        let channels = if self.wants.color { channels.with(Channel::Color) } else { channels };
        let corner = DVec2::new(f64::from(tile.first_column), f64::from(tile.first_row));
        let part = Tile { first_column: 0, first_row: 0, ..tile };
        for i in 0..self.samples {
            let along = (f64::from(i) + 0.5) / f64::from(self.samples);
            let place = corner + DVec2::new(along, ((f64::from(i) + 0.5) * GOLDEN).fract());
            let wants = Wants { shadow: false, ..self.wants };
            let sampler = Self { place, wants, channels, pattern: Pattern::Whole, samples: 1, ..*self };
            let mut sample = Band {
                width: TILE,
                first_row: 0,
                rows: tile.rows,
                color: if self.wants.color { &mut color } else { &mut [] },
                distance: &mut [],
                normal: &mut [],
                id: &mut [],
                albedo: &mut [],
                shadow: &mut [],
                coverage: &mut cover,
            };
            sampler.draw_tile(tracer, &mut sample, part);
            for (sum, sample) in colors.iter_mut().zip(color) {
                *sum += sample;
            }
            for (sum, sample) in covers.iter_mut().zip(cover) {
                *sum += sample;
            }
        }
        let share = 1.0 / self.samples as f32;
        for (i, x, row) in tile.pixels() {
            let at = (row * band.width + x) as usize;
            if let Some(color) = band.color.get_mut(at) {
                *color = finite(colors[i] * share);
            }
            if let Some(coverage) = band.coverage.get_mut(at) {
                *coverage = covers[i] * share;
            }
        }
    }

    /// Sets up the rays of all pixels of a tile.
    #[inline(always)]
    fn rays(&self, tile: Tile, rays: &mut [Option<Ray>; TILE_RAYS]) {
        for row in 0..tile.rows {
            let y = f64::from(tile.first_row + row) + self.place.y;
            for column in (0..tile.columns).step_by(LANES) {
                let x = I32x8::count_from((tile.first_column + column) as i32).to_f64()
                    + F64x8::splat(self.place.x);
                let (origin, direction, there) = self.view.rays(x, y);
                for i in 0..LANES {
                    let ray = Ray { origin: origin.get(i), direction: direction.get(i) };
                    rays[(row * TILE + column) as usize + i] = there.has(i).then_some(ray);
                }
            }
        }
    }

    #[inline(always)]
    fn ray(&self, tile: Tile, x: u32, row: u32) -> Option<Ray> {
        self.view.ray(f64::from(x) + self.place.x, f64::from(tile.first_row + row) + self.place.y)
    }

    /// Finds what the rays of a tile may meet.
    fn reach(&self, tracer: &Tracer<'_>, tile: Tile) -> Option<Reach> {
        let mut origins = Aabb::EMPTY;
        let mut directions = [DVec3::ZERO; TILE_RAYS];
        let mut count = 0;
        let mut add = |ray: Ray| {
            origins = origins.with(ray.origin);
            directions[count] = ray.direction;
            count += 1;
        };
        if self.is_straight {
            for row in [0, tile.rows - 1] {
                for x in [0, tile.columns - 1] {
                    add(self.ray(tile, tile.first_column + x, row)?);
                }
            }
        } else {
            tile.pixels().filter_map(|(_, x, row)| self.ray(tile, x, row)).for_each(&mut add);
        }
        let bundle = Bundle { origins, directions: &directions[..count] };
        tracer.world.reach(&bundle, |grid| &grid.seen, &self.footprint)
    }

    /// Draws a tile that sees nothing but background.
    #[inline(always)]
    fn empty_tile(&self, tracer: &Tracer<'_>, band: &mut Band<'_>, tile: Tile) {
        let background = tracer.world.scene.environment.background.gradient();
        let mut rays = [None; TILE_RAYS];
        self.rays(tile, &mut rays);
        let nothing = Pixel::background(Vec3::ZERO);
        for row in 0..tile.rows {
            let first = (row * band.width + tile.first_column) as usize;
            let pixels = first..first + tile.columns as usize;
            if self.wants.color {
                let rays = &rays[(row * TILE) as usize..];
                for (ray, color) in rays.iter().zip(&mut band.color[pixels.clone()]) {
                    // Adding to zero drops the sign of -0, as adding up layers does.
                    *color = ray.map_or(Vec3::ZERO, |ray| {
                        finite(Vec3::ZERO + background.color(ray.direction.y as f32))
                    });
                }
            }
            fill(band.distance, pixels.clone(), nothing.distance);
            fill(band.normal, pixels.clone(), nothing.normal);
            fill(band.id, pixels.clone(), nothing.id);
            fill(band.albedo, pixels.clone(), nothing.albedo);
            fill(band.shadow, pixels.clone(), nothing.shadow);
            fill(band.coverage, pixels, nothing.coverage);
        }
        let rays = u64::from(tile.rows) * u64::from(tile.columns);
        tracer.counts.rays.set(tracer.counts.rays.get() + rays);
    }

    /// Draws a tile whose rays may meet a few grids in known places.
    #[inline(always)]
    fn tile(&self, tracer: &Tracer<'_>, band: &mut Band<'_>, tile: Tile, reach: &Reach) {
        let bytes = if self.wants.color || self.wants.shadow || self.channels.has(Channel::Albedo) {
            Bytes::Read
        } else {
            Bytes::Unread
        };
        let nothing = Rays {
            origin: DVec3x8::splat(DVec3::ZERO),
            direction: DVec3x8::splat(DVec3::ZERO),
            there: Mask8::NONE,
        };
        let mut octets = [Octet::nothing(nothing); TILE_RAYS / LANES];
        let mut sites = Sites::default();
        let mut seen = 0;
        // A tile of one column has no neighbors to be filled in from.
        let pattern = if tile.columns > 1 { self.pattern } else { Pattern::Whole };
        let places = tile.octets(pattern);
        let stride = places.stride;
        let (pairs, _) = octets.as_chunks_mut::<2>();
        for (pair, list) in pairs.iter_mut().zip(places.list[..places.count].chunks(2)) {
            for (octet, &(column, row)) in pair.iter_mut().zip(list) {
                let y = f64::from(tile.first_row + row) + self.place.y;
                let first = I32x8::splat((tile.first_column + column) as i32);
                let x = (first + I32x8::count_from(0) * I32x8::splat(stride as i32)).to_f64()
                    + F64x8::splat(self.place.x);
                let (origin, direction, there) = self.view.rays(x, y);
                let there = there & Mask8::first((tile.columns - column).div_ceil(stride) as usize);
                seen += u64::from(there.count());
                octet.rays = Rays { origin, direction, there };
            }
            tracer.world.meet_octets(pair, reach, (bytes, &self.footprint), &tracer.counts);
            if bytes == Bytes::Read {
                for octet in pair {
                    sites.add(tracer.world, octet);
                }
            }
        }
        let lights = self.lights(tracer, sites.bounds());
        for (pair, list) in pairs.iter().zip(places.list[..places.count].chunks(2)) {
            let rows = list.iter().map(|&(column, row)| {
                let count = (tile.columns - column).div_ceil(stride).min(LANES as u32);
                Row { x: tile.first_column + column, row, stride, count }
            });
            let mut all = [Row { x: 0, row: 0, stride, count: 0 }; 2];
            for (place, row) in all.iter_mut().zip(rows) {
                *place = row;
            }
            tracer.write(pair, &lights, self.wants, band, self.channels, all);
        }
        fill_in(band, tile, pattern);
        tracer.counts.rays.set(tracer.counts.rays.get() + seen);
    }

    /// Finds what shadow rays from a part of space to parallel lights may meet.
    fn lights(&self, tracer: &Tracer<'_>, sites: Aabb) -> [Option<Reach>; BOUNDED_LAMPS] {
        let is_lit = self.wants.color || self.wants.shadow;
        let mut lights = [None; BOUNDED_LAMPS];
        if sites.is_empty() || !is_lit || tracer.shadows == Shadows::Off {
            return lights;
        }
        for (light, lamp) in lights.iter_mut().zip(&tracer.world.lamps) {
            let Some(direction) = lamp.direction().filter(|_| lamp.is_blocked) else { continue };
            let bundle = Bundle { origins: sites, directions: &[direction] };
            *light = tracer.world.reach(&bundle, |grid| &grid.blocking, &Footprint::NONE);
        }
        lights
    }

    /// Draws a tile whose rays go too far apart to be bounded together, or that sees many grids.
    fn wide_tile(&self, tracer: &Tracer<'_>, band: &mut Band<'_>, tile: Tile) {
        let pattern = if tile.columns > 1 { self.pattern } else { Pattern::Whole };
        for (_, x, row) in tile.pixels().filter(|&(_, x, row)| tile.has(pattern, x, row)) {
            // Outside of a fisheye's circle there is nothing to see, not even a background.
            let nothing = Pixel::background(Vec3::ZERO);
            let pixel = self.ray(tile, x, row).map_or(nothing, |ray| tracer.look(&ray, self.wants));
            band.put(x, row, &pixel);
        }
        fill_in(band, tile, pattern);
    }
}

/// Pixels of a row of a band: the first column, how far they are apart, and how many there are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) x: u32,
    pub(crate) row: u32,
    pub(crate) stride: u32,
    pub(crate) count: u32,
}

/// Fills in what was not drawn: the mean of the colors on both sides, and all else from one of them. Nothing is taken
/// from frames before, so that nothing is seen where it is no more.
fn fill_in(band: &mut Band<'_>, tile: Tile, pattern: Pattern) {
    let Pattern::Half { fills: true, .. } = pattern else { return };
    for (_, x, row) in tile.pixels().filter(|&(_, x, row)| !tile.has(pattern, x, row)) {
        let at = (row * band.width + x) as usize;
        let left = if x > tile.first_column { at - 1 } else { at + 1 };
        let right = if x + 1 < tile.first_column + tile.columns { at + 1 } else { at - 1 };
        if let Some(color) = band.color.get(left).zip(band.color.get(right)).map(|(a, b)| (*a + *b) * 0.5) {
            band.color[at] = color;
        }
        copy(band.distance, left, at);
        copy(band.normal, left, at);
        copy(band.id, left, at);
        copy(band.albedo, left, at);
        copy(band.shadow, left, at);
        copy(band.coverage, left, at);
    }
}

fn copy<T: Copy>(plane: &mut [T], from: usize, to: usize) {
    if let Some(&value) = plane.get(from) {
        plane[to] = value;
    }
}

/// Fills pixels of a plane, if the picture has it.
fn fill<T: Copy>(plane: &mut [T], pixels: std::ops::Range<usize>, value: T) {
    if !plane.is_empty() {
        plane[pixels].fill(value);
    }
}
