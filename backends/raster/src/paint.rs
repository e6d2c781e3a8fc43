//! From triangles in tiles to pixels: visibility, then the surfaces that are seen, then their light.

use crate::bin::Bins;
use crate::layers::{Fragment, collect, sort, take_pixel};
use crate::lens::{Lens, PixelRay};
use crate::light::{Illumination, Lit, Wants};
use crate::resolve::{Ask, Point, Resolver};
use crate::tile::{NO_TRIANGLE, TILE_HEIGHT, TILE_WIDTH, TileArea, TileBuffer, TileGrid};
use glam::Vec3;
use polyptych_core::framebuffer::{Band, Channel, Channels, Framebuffer, Pixel};
use polyptych_core::seam::{Cancelled, Control};
use polyptych_core::shade::fogged;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Behind layers that let less than this share of light through nothing is drawn.
const OPAQUE: f32 = 1.0 / 1024.0;

/// Draws a picture from filled bins.
pub(crate) struct Painter<'a> {
    pub(crate) light: Illumination<'a>,
    pub(crate) lens: &'a Lens,
    pub(crate) bins: &'a Bins,
    wants: Wants,
    ask: Ask,
}

/// Whether finished bands are shown to the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Announce {
    Yes,
    No,
}

impl<'a> Painter<'a> {
    pub(crate) fn new(light: Illumination<'a>, lens: &'a Lens, bins: &'a Bins, channels: Channels) -> Self {
        let wants = Wants { color: channels.has(Channel::Color), shadow: channels.has(Channel::Shadow) };
        // Opacity decides what is seen first, so it is asked for wherever there are layers.
        let ask = if wants.color || channels.has(Channel::Albedo) { Ask::Color } else { Ask::Geometry };
        Self { light, lens, bins, wants, ask }
    }

    /// Draws all bands; `layers` is scratch for each band. Returns how many pixels were shaded.
    pub(crate) fn paint(
        &self,
        target: &mut Framebuffer,
        layers: &mut Vec<Mutex<Vec<Fragment>>>,
        announce: Announce,
        control: &Control<'_>,
    ) -> Result<u64, Cancelled> {
        let grid = TileGrid::new(target.width(), target.height());
        if layers.len() < grid.rows as usize {
            layers.resize_with(grid.rows as usize, Mutex::default);
        }
        let (layers, shaded, stopped) = (&*layers, AtomicU64::new(0), AtomicBool::new(false));
        target.for_each_band(control.threads, TILE_HEIGHT, &|mut band| {
            let row = band.first_row / TILE_HEIGHT;
            let mut fragments = layers[row as usize].lock().unwrap_or_else(PoisonError::into_inner);
            for column in 0..grid.columns {
                if control.is_cancelled() {
                    stopped.store(true, Ordering::Relaxed);
                    return;
                }
                let tile = row as usize * grid.columns as usize + column as usize;
                let count = self.paint_tile(&grid, tile, &mut band, &mut fragments);
                shaded.fetch_add(count, Ordering::Relaxed);
            }
            if announce == Announce::Yes {
                control.finished(&band);
            }
        });
        if stopped.into_inner() { Err(Cancelled) } else { Ok(shaded.into_inner()) }
    }

    fn paint_tile(
        &self,
        grid: &TileGrid,
        tile: usize,
        band: &mut Band<'_>,
        fragments: &mut Vec<Fragment>,
    ) -> u64 {
        let area = grid.area(tile);
        // 1. Visibility: the nearest solid triangle of each pixel.
        let mut buffer = TileBuffer::new();
        for record in self.bins.solid(tile) {
            buffer.draw(record, &area);
        }
        // 2. What light may pass through, in front of it.
        fragments.clear();
        for record in self.bins.layers(tile) {
            collect(fragments, record, &area, &buffer);
        }
        sort(fragments);
        // 3. Resolve: surfaces and their light, for what is visible only.
        let mut surfaces = Resolver::new(self.light.scene, self.light.model, self.lens);
        let mut behind_layers = Resolver::new(self.light.scene, self.light.model, self.lens);
        let (mut waiting, mut shaded) = (&fragments[..], 0);
        let empty = self.bins.solid(tile).next().is_none() && waiting.is_empty();
        for row in 0..area.height as u32 {
            self.background_row(&area, row, band);
            if empty {
                continue;
            }
            for column in 0..area.width as u32 {
                let solid = buffer.id[(row * TILE_WIDTH + column) as usize];
                if solid == NO_TRIANGLE && waiting.is_empty() {
                    continue;
                }
                let (x, y) = (area.x as u32 + column, area.y as u32 + row);
                let ray = self.lens.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let of_pixel = take_pixel(&mut waiting, column, row);
                let pixel = if !of_pixel.is_empty() {
                    self.through_layers(&ray, of_pixel, solid, &mut behind_layers)
                } else if solid != NO_TRIANGLE {
                    self.of_surface(&ray, &surfaces.resolve(solid, &ray, self.ask))
                } else {
                    Pixel::background(self.background(&ray))
                };
                shaded += u64::from(pixel.id != 0);
                band.put(x, row, &pixel);
            }
        }
        shaded
    }

    /// Fills a row of a tile with what is seen where nothing is: most pixels of most pictures keep it.
    fn background_row(&self, area: &TileArea, row: u32, band: &mut Band<'_>) {
        let from = (row * band.width) as usize + area.x as usize;
        let pixels = from..from + area.width as usize;
        let nothing = Pixel::background(Vec3::ZERO);
        if !band.color.is_empty() {
            // The heights of the directions alone, in the precision of colors: most pixels see nothing else.
            let place = (f64::from(area.x) + 0.5, f64::from(area.y as u32 + row) + 0.5);
            let first = self.lens.line(place.0, place.1).1;
            let step = (self.lens.line(place.0 + 1.0, place.1).1 - first).as_vec3();
            let first = first.as_vec3();
            let background = &self.light.scene.environment.background;
            for (column, color) in band.color[pixels.clone()].iter_mut().enumerate() {
                let direction = first + step * column as f32;
                *color = finite(background.color_at(direction.y / direction.length()));
            }
        }
        fn fill<T: Copy>(plane: &mut [T], pixels: std::ops::Range<usize>, value: T) {
            if !plane.is_empty() {
                plane[pixels].fill(value);
            }
        }
        fill(band.distance, pixels.clone(), nothing.distance);
        fill(band.normal, pixels.clone(), nothing.normal);
        fill(band.id, pixels.clone(), nothing.id);
        fill(band.albedo, pixels.clone(), nothing.albedo);
        fill(band.shadow, pixels.clone(), nothing.shadow);
        fill(band.coverage, pixels, nothing.coverage);
    }

    /// Returns the color of a ray that meets nothing.
    fn background(&self, ray: &PixelRay) -> Vec3 {
        if !self.wants.color {
            return Vec3::ZERO;
        }
        finite(self.light.scene.environment.background.color(ray.unit))
    }

    /// Returns what a pixel of one solid surface holds.
    fn of_surface(&self, ray: &PixelRay, point: &Point<'_>) -> Pixel {
        let lit = self.lit(ray, point, self.wants);
        Pixel { color: finite(self.fogged(point, &lit)), ..seen(point, lit.shadow) }
    }

    /// Lays the fragments of a pixel over one another, and over the solid surface behind them.
    fn through_layers(
        &self,
        ray: &PixelRay,
        fragments: &[Fragment],
        solid: u32,
        resolver: &mut Resolver<'_>,
    ) -> Pixel {
        let (mut color, mut clear) = (Vec3::ZERO, 1.0_f32);
        let mut first: Option<Pixel> = None;
        let behind = (solid != NO_TRIANGLE).then_some(solid);
        for id in fragments.iter().map(|f| f.id).chain(behind) {
            let point = resolver.resolve(id, ray, Ask::Color);
            if point.opacity <= 0.0 {
                continue;
            }
            let wants = Wants { shadow: self.wants.shadow && first.is_none(), ..self.wants };
            let lit = self.lit(ray, &point, wants);
            first = first.or(Some(seen(&point, lit.shadow)));
            if !self.wants.color {
                break;
            }
            color += self.fogged(&point, &lit) * (clear * point.opacity);
            clear *= 1.0 - point.opacity;
            if clear < OPAQUE {
                break;
            }
        }
        if clear >= OPAQUE {
            color += self.background(ray) * clear;
        }
        let color = finite(color);
        Pixel { color, ..first.unwrap_or(Pixel::background(color)) }
    }

    fn lit(&self, ray: &PixelRay, point: &Point<'_>, wants: Wants) -> Lit {
        if wants.color || wants.shadow {
            self.light.light(point, self.lens.origin, -ray.unit, wants)
        } else {
            Lit { color: Vec3::ZERO, shadow: 1.0 }
        }
    }

    fn fogged(&self, point: &Point<'_>, lit: &Lit) -> Vec3 {
        fogged(&self.light.scene.environment, lit.color, point.distance)
    }
}

/// Returns what the geometry channels hold of the surface seen first.
fn seen(point: &Point<'_>, shadow: f32) -> Pixel {
    Pixel {
        color: Vec3::ZERO,
        distance: point.distance as f32,
        normal: finite(point.normal),
        id: point.part.object as u32 + 1,
        albedo: finite(point.color),
        shadow,
        coverage: 1.0,
    }
}

fn finite(v: Vec3) -> Vec3 {
    if v.is_finite() { v } else { Vec3::ZERO }
}
