//! How are the surfaces that a tile shows put into the picture?

use crate::batch::Batch;
use crate::face::Faces;
use crate::gouraud::Gouraud;
use crate::grid::{TILE_PIXELS, TILE_WIDTH, TileArea};
use crate::layers::Fragment;
use crate::paint::{OPAQUE, Painter};
use crate::tile::NO_TRIANGLE;
use glam::Vec3;
use polyptych_core::framebuffer::{Band, Pixel};
use polyptych_core::lanes::{F32x8, LANES, Vec3x8};

/// Flags of a sample's tag, above the pixel's index in the tile.
pub(crate) const LAYER: u32 = 1 << 16;
const LAST: u32 = 1 << 17;

/// Lists what a tile shows, pixel by pixel and front to back.
pub(crate) struct Samples<'t> {
    pub(crate) solid: &'t [u32],
    /// By pixel, those before this one taken off.
    pub(crate) layers: &'t [Fragment],
    pub(crate) pixel: u32,
    pub(crate) behind_layers: bool,
}

impl Iterator for Samples<'_> {
    /// A triangle and a tag.
    type Item = (u32, u32);

    #[inline(always)]
    fn next(&mut self) -> Option<(u32, u32)> {
        while let Some(&solid) = self.solid.get(self.pixel as usize) {
            let pixel = self.pixel;
            let [layer, next] = [0, 1].map(|i| self.layers.get(i).filter(|f| f.pixel == pixel));
            if let Some(layer) = layer {
                self.layers = &self.layers[1..];
                self.behind_layers = next.is_some() || solid != NO_TRIANGLE;
                self.pixel += u32::from(!self.behind_layers);
                return Some((layer.id, pixel | LAYER | if self.behind_layers { 0 } else { LAST }));
            }
            self.pixel += 1;
            let kind = if std::mem::take(&mut self.behind_layers) { LAYER } else { 0 };
            if solid != NO_TRIANGLE {
                return Some((solid, pixel | LAST | kind));
            }
        }
        None
    }
}

/// A tile whose samples are being put into the picture.
pub(crate) struct TilePainter<'t, 'a, 'b> {
    pub(crate) painter: &'t Painter<'a>,
    pub(crate) area: TileArea,
    pub(crate) band: &'t mut Band<'b>,
    pub(crate) faces: &'t mut Faces,
    pub(crate) corners: &'t mut Gouraud,
    pub(crate) layers: Layers,
    pub(crate) shaded: u64,
}

/// What is known of the pixel whose layers are being laid over one another.
pub(crate) struct Layers {
    color: Vec3,
    clear: f32,
    first: Option<Pixel>,
}

impl Default for Layers {
    fn default() -> Self {
        Self { color: Vec3::ZERO, clear: 1.0, first: None }
    }
}

impl<'a> TilePainter<'_, 'a, '_> {
    /// Draws a tile without layers.
    #[inline(always)]
    pub(crate) fn draw_solid(&mut self, solid: &[u32; TILE_PIXELS]) {
        let (mut mixed, mut one) = (Batch::new(), Batch::new());
        for (octet, ids) in solid.chunks_exact(LANES).enumerate() {
            let first = (octet * LANES) as u32;
            if ids[0] != NO_TRIANGLE && ids.iter().all(|&id| id == ids[0]) {
                let painter = self.painter;
                let face = painter.find(self.faces, ids[0]);
                let of = &self.faces.faces[usize::from(face)];
                let (x, y) = self.place(first);
                let name = [ids[0], of.part, of.triangle];
                one.fill((f64::from(x) + 0.5, f64::from(y) + 0.5), name, face, first | LAST);
                self.finish(&mut one);
                continue;
            }
            for (pixel, &id) in (first..).zip(ids).filter(|(_, id)| **id != NO_TRIANGLE) {
                self.add(&mut mixed, id, pixel | LAST);
                if mixed.is_full() {
                    self.finish(&mut mixed);
                }
            }
        }
        self.finish(&mut mixed);
    }

    /// Adds a sample to a batch that is not full.
    #[inline(always)]
    pub(crate) fn add(&mut self, batch: &mut Batch<'a>, id: u32, tag: u32) {
        let (x, y) = self.place(tag);
        self.painter.add(batch, self.faces, (f64::from(x) + 0.5, f64::from(y) + 0.5), id, tag);
    }

    /// Returns the column and row of a sample in the picture.
    fn place(&self, tag: u32) -> (u32, u32) {
        let pixel = tag % LAYER;
        (self.area.x as u32 + pixel % TILE_WIDTH, self.area.y as u32 + pixel / TILE_WIDTH)
    }

    /// Draws all samples of the batch into the picture.
    #[inline(always)]
    pub(crate) fn finish(&mut self, batch: &mut Batch<'a>) {
        self.painter.light(batch, self.faces, self.corners);
        let mut index = [0; LANES];
        for (index, tag) in index.iter_mut().zip(&batch.tag[..batch.count]) {
            let (x, y) = self.place(*tag);
            *index = ((y - self.band.first_row) * self.band.width + x) as usize;
        }
        if batch.tag[..batch.count].iter().any(|tag| tag & LAYER != 0) {
            for (i, &index) in index[..batch.count].iter().enumerate() {
                self.lay(batch, i, index);
            }
        } else {
            self.write(batch, &index[..batch.count]);
        }
        batch.clear();
        if self.faces.is_full() {
            self.faces.clear();
            self.corners.clear();
        }
    }

    /// Writes samples of solid surfaces, plane by plane.
    #[inline(always)]
    fn write(&mut self, batch: &Batch<'_>, index: &[usize]) {
        #[inline(always)]
        fn fill<T: Copy>(plane: &mut [T], index: &[usize], values: &[T; LANES]) {
            if plane.is_empty() {
                return;
            }
            // Mostly eight pixels in a row: places only grow.
            if let &[first, _, _, _, _, _, _, last] = index
                && last - first == LANES - 1
            {
                plane[first..first + LANES].copy_from_slice(values);
                return;
            }
            for (&at, value) in index.iter().zip(values) {
                plane[at] = *value;
            }
        }
        let parts = &self.painter.light.model.parts;
        let mut ids = [0; LANES];
        for (id, part) in ids.iter_mut().zip(&batch.names.part[..batch.count]) {
            *id = parts[*part as usize].object as u32 + 1;
        }
        let band = &mut *self.band;
        fill(band.color, index, &in_a_row(batch.lit));
        fill(band.distance, index, &batch.distance.round().0.values());
        fill(band.normal, index, &in_a_row(batch.normal));
        fill(band.id, index, &ids);
        fill(band.albedo, index, &in_a_row(batch.color));
        fill(band.shadow, index, &batch.shadow.0.values());
        fill(band.coverage, index, &[1.0; LANES]);
        self.shaded += index.len() as u64;
    }

    /// Lays a sample behind those of its pixel that came before; the last one writes the pixel.
    fn lay(&mut self, batch: &Batch<'_>, i: usize, index: usize) {
        if batch.tag[i] & LAYER == 0 {
            // A solid surface without layers may stand in a batch with layers of others.
            self.layers = Layers { color: batch.lit.get(i), clear: 0.0, first: Some(self.seen(batch, i)) };
        } else if batch.opacity[i] > 0.0 && self.layers.clear >= OPAQUE {
            let layers = &mut self.layers;
            layers.color += batch.lit.get(i) * (layers.clear * batch.opacity[i]);
            layers.clear *= 1.0 - batch.opacity[i];
            if layers.first.is_none() {
                self.layers.first = Some(self.seen(batch, i));
            }
        }
        if batch.tag[i] & LAST == 0 {
            return;
        }
        let Layers { mut color, clear, first } = std::mem::take(&mut self.layers);
        let painter = self.painter;
        if clear >= OPAQUE && painter.wants.color {
            let direction = -batch.to_eye.get(i);
            color += finite(painter.light.scene.environment.background.color(direction.as_dvec3())) * clear;
        }
        let color = finite(color);
        let pixel = Pixel { color, ..first.unwrap_or(Pixel::background(color)) };
        self.shaded += u64::from(pixel.id != 0);
        self.band.put(index as u32 % self.band.width, index as u32 / self.band.width, &pixel);
    }

    /// Returns what the geometry channels hold of the surface seen first.
    fn seen(&self, batch: &Batch<'_>, i: usize) -> Pixel {
        Pixel {
            color: Vec3::ZERO,
            distance: batch.distance.0[i] as f32,
            normal: finite(batch.normal.get(i)),
            id: self.painter.light.model.parts[batch.names.part[i] as usize].object as u32 + 1,
            albedo: finite(batch.color.get(i)),
            shadow: batch.shadow.0[i],
            coverage: 1.0,
        }
    }
}

/// Returns eight vectors one by one; what is not finite is zero.
#[inline(always)]
fn in_a_row(v: Vec3x8) -> [Vec3; LANES] {
    let most = F32x8::splat(f32::INFINITY);
    let is_finite = most.above(v.x.abs()) & most.above(v.y.abs()) & most.above(v.z.abs());
    let v = Vec3x8::pick(is_finite, v, Vec3x8::splat(Vec3::ZERO));
    let mut row = [Vec3::ZERO; LANES];
    for (lane, one) in row.iter_mut().enumerate() {
        *one = v.get(lane);
    }
    row
}

pub(crate) fn finite(v: Vec3) -> Vec3 {
    if v.is_finite() { v } else { Vec3::ZERO }
}
