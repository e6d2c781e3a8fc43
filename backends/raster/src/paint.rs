//! From triangles in tiles to pixels: visibility, then the surfaces that are seen, then their light.

use crate::batch::{Ask, Batch, Manner, NO_FACE};
use crate::bin::Bins;
use crate::blank::{Blank, Stays};
use crate::drawing::Drawing;
use crate::face::Faces;
use crate::gouraud::Gouraud;
use crate::grid::{TILE_HEIGHT, TILE_WIDTH, TileArea, TileGrid};
use crate::info::Shading;
use crate::layers::{Fragment, collect, sort};
use crate::lens::Lens;
use crate::light::{Illumination, Wants};
use crate::smooth::Smooth;
use crate::strokes::Ink;
use crate::surfaces::{LAYER, Layers, Samples, TilePainter};
use crate::tile::{NO_TRIANGLE, TileBuffer};
use glam::Vec3;
use polyptych_core::camera::RowDirections;
use polyptych_core::framebuffer::{Band, Channel, Channels, Framebuffer, Pixel};
use polyptych_core::seam::{Cancelled, Control};
use polyptych_core::shade::fogged;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Behind layers that let less than this share of light through nothing is drawn.
pub(crate) const OPAQUE: f32 = 1.0 / 1024.0;

/// Draws a picture from filled bins.
pub(crate) struct Painter<'a> {
    pub(crate) light: Illumination<'a>,
    pub(crate) lens: &'a Lens,
    pub(crate) bins: &'a Bins,
    blank: &'a Blank,
    /// The lines to draw instead of light.
    pub(crate) drawing: Option<Drawing<'a>>,
    pub(crate) places: &'a [[i32; 2]],
    pub(crate) wants: Wants,
    manner: Manner,
    pub(crate) channels: Channels,
}

/// How a picture is to look.
#[derive(Clone, Copy)]
pub(crate) struct Look<'a> {
    pub(crate) shading: Shading,
    /// Places in a pixel, in steps from its center.
    pub(crate) places: &'a [[i32; 2]],
    pub(crate) drawing: Option<Drawing<'a>>,
}

/// Scratch memory of a band.
#[derive(Default)]
pub(crate) struct Scratch {
    fragments: Vec<Fragment>,
    pub(crate) faces: Faces,
    pub(crate) corners: Gouraud,
    pub(crate) smooth: Smooth,
    pub(crate) ink: Option<Box<Ink>>,
}

impl Scratch {
    /// Returns the bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.fragments.capacity() * size_of::<Fragment>()
            + self.faces.bytes()
            + self.corners.bytes()
            + self.smooth.bytes()
            + self.ink.as_ref().map_or(0, |_| size_of::<Ink>())
    }
}

/// Whether finished bands are shown to the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Announce {
    Yes,
    No,
}

impl<'a> Painter<'a> {
    pub(crate) fn new(
        light: Illumination<'a>,
        look: Look<'a>,
        lens: &'a Lens,
        bins: &'a Bins,
        blank: &'a Blank,
        channels: Channels,
    ) -> Self {
        let Look { shading, places, drawing } = look;
        let lit = drawing.is_none();
        let wants = Wants {
            color: lit && channels.has(Channel::Color),
            shadow: lit && channels.has(Channel::Shadow),
        };
        // Opacity decides what is seen first, so it is asked for wherever there are layers.
        let ask = if wants.color || channels.has(Channel::Albedo) { Ask::Color } else { Ask::Geometry };
        let turns = shading == Shading::Phong
            && (wants.color || channels.has(Channel::Normal))
            && light.scene.materials.iter().any(|material| material.normal_map.is_some());
        let manner = Manner { ask, shading, turns };
        Self { light, lens, bins, blank, drawing, places, wants, manner, channels }
    }

    /// Draws all bands, each with scratch memory of its own. Returns how many pixels were shaded.
    pub(crate) fn paint(
        &self,
        target: &mut Framebuffer,
        scratch: &mut Vec<Mutex<Scratch>>,
        announce: Announce,
        control: &Control<'_>,
    ) -> Result<u64, Cancelled> {
        let grid = TileGrid::new(target.width(), target.height());
        if scratch.len() < grid.rows as usize {
            scratch.resize_with(grid.rows as usize, Mutex::default);
        }
        let (scratch, shaded, stopped) = (&*scratch, AtomicU64::new(0), AtomicBool::new(false));
        target.for_each_band(control.threads, TILE_HEIGHT, &|mut band| {
            let row = band.first_row / TILE_HEIGHT;
            let mut scratch = scratch[row as usize].lock().unwrap_or_else(PoisonError::into_inner);
            for column in 0..grid.columns {
                if control.is_cancelled() {
                    stopped.store(true, Ordering::Relaxed);
                    return;
                }
                let tile = row as usize * grid.columns as usize + column as usize;
                let count = self.paint_tile(&grid, tile, &mut band, &mut scratch);
                shaded.fetch_add(count, Ordering::Relaxed);
            }
            if announce == Announce::Yes {
                control.finished(&band);
            }
        });
        if stopped.into_inner() { Err(Cancelled) } else { Ok(shaded.into_inner()) }
    }

    polyptych_core::for_registers! {
        fn paint_tile(&self, grid: &TileGrid, tile: usize, band: &mut Band<'_>, scratch: &mut Scratch) -> u64
            = paint_tile_512, paint_tile_256, paint_tile_here;
    }

    #[inline(always)]
    fn paint_tile_here(
        &self,
        grid: &TileGrid,
        tile: usize,
        band: &mut Band<'_>,
        scratch: &mut Scratch,
    ) -> u64 {
        let area = grid.area(tile);
        let is_blank = self.drawing.is_none() && self.bins.is_empty(tile);
        let stays = self.blank.note(tile, is_blank);
        if is_blank {
            // No closure: it would be compiled for the plain processor.
            for row in 0..area.height as u32 {
                self.background_row(&area, row, stays, band);
            }
            return 0;
        }
        // 1. Visibility: the nearest solid triangle of each pixel.
        let hides = self.drawing.is_none_or(|drawing| drawing.hides);
        let buffer = if hides { TileBuffer::of(self.bins, tile, &area, [0; 2]) } else { TileBuffer::new() };
        // 2. What light may pass through, in front of it. It hides no line.
        scratch.fragments.clear();
        for run in self.bins.runs().iter().take_while(|_| self.drawing.is_none()) {
            for record in run.layers.of_tile(tile) {
                collect(&mut scratch.fragments, record, &area, &buffer);
            }
        }
        sort(&mut scratch.fragments);
        for row in 0..area.height as u32 {
            let ids = &buffer.id[(row * TILE_WIDTH) as usize..][..area.width as usize];
            if ids.contains(&NO_TRIANGLE) {
                self.background_row(&area, row, stays, band);
            }
        }
        let shaded = self.resolve(&area, &buffer, band, scratch);
        let smooths = self.wants.color || self.channels.has(Channel::Coverage);
        if self.places.len() > 1 && smooths && self.drawing.is_none() {
            return shaded + self.smooth(tile, &area, &buffer.id, band, scratch);
        }
        if let Some(drawing) = self.drawing {
            self.draw_lines(&drawing, tile, &area, &buffer.id, band, scratch);
        }
        shaded
    }

    /// Puts the visible surfaces of a tile into the picture and returns the number of pixels that they take.
    #[inline(always)]
    fn resolve(
        &self,
        area: &TileArea,
        buffer: &TileBuffer,
        band: &mut Band<'_>,
        scratch: &mut Scratch,
    ) -> u64 {
        let Scratch { fragments, faces, corners, .. } = scratch;
        faces.clear();
        corners.clear();
        if fragments.is_empty() && buffer.id.iter().all(|&id| id == NO_TRIANGLE) {
            return 0;
        }
        // 3. Resolve: surfaces and their light, for what is visible only.
        if fragments.is_empty() && self.names_only() {
            return self.name(area, buffer, band);
        }
        let layers = Layers::default();
        let mut tile = TilePainter { painter: self, area: *area, band, faces, corners, layers, shaded: 0 };
        if fragments.is_empty() {
            tile.draw_solid(&buffer.id);
            return tile.shaded;
        }
        let mut samples = Samples { solid: &buffer.id, layers: fragments, pixel: 0, behind_layers: false };
        let (mut batch, mut more) = (Batch::new(), true);
        while more {
            match samples.next() {
                Some((id, tag)) => tile.add(&mut batch, id, tag),
                None => more = false,
            }
            if batch.is_full() || tile.faces.is_full() || !more {
                tile.finish(&mut batch);
            }
        }
        tile.shaded
    }

    /// Tells whether nothing is asked but which objects are seen.
    fn names_only(&self) -> bool {
        let asked = [Channel::Color, Channel::Distance, Channel::Normal, Channel::Albedo, Channel::Shadow];
        !asked.into_iter().any(|channel| self.channels.has(channel)) && self.drawing.is_none()
    }

    /// Names the objects of a tile and returns the number of pixels that they take.
    fn name(&self, area: &TileArea, buffer: &TileBuffer, band: &mut Band<'_>) -> u64 {
        let (model, mut shaded) = (self.light.model, 0);
        let (mut known, mut object) = (NO_TRIANGLE..NO_TRIANGLE, 0);
        for row in 0..area.height as usize {
            let at =
                (area.y as usize + row - band.first_row as usize) * band.width as usize + area.x as usize;
            let ids = &buffer.id[row * TILE_WIDTH as usize..][..area.width as usize];
            let pixels = at..at + ids.len();
            if !band.id.is_empty() {
                for (name, &id) in band.id[pixels.clone()].iter_mut().zip(ids) {
                    if id != NO_TRIANGLE {
                        if !known.contains(&id) {
                            let part = model.find(id).0;
                            known = model.triangles_of(part);
                            object = model.parts[part].object as u32 + 1;
                        }
                        *name = object;
                    }
                }
            }
            if !band.coverage.is_empty() {
                for (coverage, &id) in band.coverage[pixels].iter_mut().zip(ids) {
                    *coverage = if id == NO_TRIANGLE { *coverage } else { 1.0 };
                }
            }
            shaded += ids.iter().filter(|&&id| id != NO_TRIANGLE).count() as u64;
        }
        shaded
    }

    /// Fills a row of a tile with what is seen where nothing is: most pixels of most pictures keep it.
    #[inline(always)]
    fn background_row(&self, area: &TileArea, row: u32, stays: Stays, band: &mut Band<'_>) {
        let from = (row * band.width) as usize + area.x as usize;
        let pixels = from..from + area.width as usize;
        let nothing = Pixel::background(Vec3::ZERO);
        if !band.color.is_empty() && !stays.color {
            let place = (f64::from(area.x) + 0.5, f64::from(area.y as u32 + row) + 0.5);
            let first = self.lens.line(place.0, place.1).1;
            let step = (self.lens.line(place.0 + 1.0, place.1).1 - first).as_vec3();
            let directions = RowDirections { first: first.as_vec3(), step };
            let background = &self.light.scene.environment.background;
            directions.fill(background, 0, &mut band.color[pixels.clone()]);
        }
        if stays.nothing {
            return;
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

    /// Returns the index of a triangle in the table of a tile.
    #[inline(always)]
    pub(crate) fn find(&self, faces: &mut Faces, id: u32) -> u16 {
        faces.find(self.light.model, self.lens, id)
    }

    /// Adds a sample to a batch that is not full. A triangle whose corners' light is to be found gets a face.
    #[inline(always)]
    pub(crate) fn add(&self, batch: &mut Batch<'a>, faces: &mut Faces, place: (f64, f64), id: u32, tag: u32) {
        let model = self.light.model;
        let part = model.part_near(batch.last_part(), id);
        let face = if self.manner.shading == Shading::Gouraud { self.find(faces, id) } else { NO_FACE };
        batch.push(place, [id, part as u32, id - model.parts[part].first_triangle], face, tag);
    }

    polyptych_core::for_registers! {
        /// Finds and lights the surfaces of a batch. This is where most time goes: one kernel, called from everywhere.
        pub(crate) fn light(&self, batch: &mut Batch<'a>, faces: &Faces, corners: &mut Gouraud)
            = light_512, light_256, light_here;
    }

    #[inline(always)]
    fn light_here(&self, batch: &mut Batch<'a>, faces: &Faces, corners: &mut Gouraud) {
        let light = &self.light;
        // Opacity decides what is seen first.
        let layered = batch.tag[..batch.count].iter().any(|tag| tag & LAYER != 0);
        let ask = if layered { Ask::Color } else { self.manner.ask };
        let manner = Manner { ask, ..self.manner };
        batch.resolve(light.scene, light.model, self.lens, &faces.faces, manner);
        if self.drawing.is_some() {
            // Surfaces have the color of the paper.
            let background = &light.scene.environment.background;
            for i in 0..batch.count {
                let direction = -batch.to_eye.get(i).as_dvec3();
                batch.lit.set(i, background.color(direction));
            }
            return;
        }
        if self.wants.color || self.wants.shadow {
            let interpolated = self.wants.color && self.manner.shading == Shading::Gouraud;
            if interpolated {
                corners.light(light, self.lens, faces);
            }
            light.light(batch, interpolated.then_some(&*corners), self.lens.origin, self.wants);
        }
        if light.scene.environment.fog.is_some() {
            for i in 0..batch.count {
                let color = fogged(&light.scene.environment, batch.lit.get(i), batch.distance.0[i]);
                batch.lit.set(i, color);
            }
        }
    }
}
