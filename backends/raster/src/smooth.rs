//! How are edges smoothed? Several places in a pixel tell which triangles share it, and each is shaded once.
//!
//! A pixel whose places all show what its center shows keeps the center's color: only edges cost more. Visibility is
//! found at each place exactly as at the center, on triangles moved by whole steps; what a triangle looks like comes
//! from the pixel's center, held to the triangle. Geometry channels stay those of the center.
//!
//! The places are J. M. Hammersley's points (*Monte Carlo methods for solving multivariable problems*, Annals of the
//! New York Academy of Sciences 86, 1960): every row and every column of `N` strips holds one.

use crate::batch::Batch;
use crate::bin::Bins;
use crate::grid::{TILE_PIXELS, TILE_WIDTH, TileArea};
use crate::layers::{Fragment, collect, sort};
use crate::paint::{OPAQUE, Painter, Scratch};
use crate::setup::STEPS;
use crate::surfaces::{LAYER, finite};
use crate::tile::{NO_TRIANGLE, TileBuffer};
use glam::Vec3;
use polyptych_core::framebuffer::Band;

/// Most places: beyond, steps of a 256th of a pixel would lie too close together.
pub(crate) const MOST: u32 = 256;

/// Returns how far each place is from the pixel's center, in steps.
pub(crate) fn places(count: u32) -> Vec<[i32; 2]> {
    let step = |share: f64| (share * f64::from(STEPS)).round() as i32 - STEPS / 2;
    let halves = |i: u32| f64::from(i.reverse_bits()) / f64::from(u32::MAX) + 0.5 / f64::from(count);
    let place = |i| [step((f64::from(i) + 0.5) / f64::from(count)), step(halves(i).fract())];
    (0..count).map(place).collect()
}

/// What the places of a tile's pixels show.
#[derive(Default)]
pub(crate) struct Smooth {
    seen: Vec<[u32; TILE_PIXELS]>,
    layers: Vec<Vec<Fragment>>,
    /// Triangles that share a pixel with others: pixel above id.
    shared: Vec<u64>,
    /// Color and opacity of each of them.
    looks: Vec<(Vec3, f32)>,
}

impl Smooth {
    pub(crate) fn bytes(&self) -> usize {
        let layers: usize = self.layers.iter().map(Vec::capacity).sum();
        self.seen.capacity() * TILE_PIXELS * 4
            + layers * size_of::<Fragment>()
            + self.shared.capacity() * 8
            + self.looks.capacity() * size_of::<(Vec3, f32)>()
    }

    /// Finds out what each place of each pixel shows, and lists the triangles of pixels that show several.
    #[inline(always)]
    fn look(
        &mut self,
        places: &[[i32; 2]],
        area: &TileArea,
        center: &[u32; TILE_PIXELS],
        (bins, tile): (&Bins, usize),
    ) {
        self.seen.resize(places.len(), [NO_TRIANGLE; TILE_PIXELS]);
        self.layers.resize_with(places.len(), Vec::new);
        let mut mixed = [false; TILE_PIXELS];
        for (i, place) in places.iter().enumerate() {
            let buffer = TileBuffer::of(bins, tile, area, *place);
            let of_place = &mut self.layers[i];
            of_place.clear();
            for record in bins.runs().iter().flat_map(|run| run.layers.of_tile(tile)) {
                collect(of_place, &record.seen_from(*place), area, &buffer);
            }
            sort(of_place);
            of_place.iter().for_each(|fragment| mixed[fragment.pixel as usize] = true);
            for (mixed, (id, center)) in mixed.iter_mut().zip(buffer.id.iter().zip(center)) {
                *mixed |= id != center;
            }
            self.seen[i] = buffer.id;
        }
        self.shared.clear();
        let key = |pixel: usize, id: u32| (pixel as u64) << 32 | u64::from(id);
        for pixel in (0..TILE_PIXELS).filter(|&pixel| mixed[pixel]) {
            self.shared.extend(self.seen.iter().map(|seen| key(pixel, seen[pixel])));
        }
        let fragments = self.layers.iter().flatten();
        self.shared.extend(fragments.map(|fragment| key(fragment.pixel as usize, fragment.id)));
        self.shared.sort_unstable();
        self.shared.dedup();
    }

    /// Returns the color and opacity of a triangle among those of a pixel.
    fn look_of(&self, of_pixel: std::ops::Range<usize>, id: u32) -> (Vec3, f32) {
        let at = self.shared[of_pixel.clone()].iter().position(|key| *key as u32 == id);
        at.map_or((Vec3::ZERO, 0.0), |at| self.looks[of_pixel.start + at])
    }
}

impl<'a> Painter<'a> {
    /// Mixes the colors of pixels that several surfaces share.
    #[inline(always)]
    pub(crate) fn smooth(
        &self,
        tile: usize,
        area: &TileArea,
        center: &[u32; TILE_PIXELS],
        band: &mut Band<'_>,
        scratch: &mut Scratch,
    ) -> u64 {
        let places = self.places;
        scratch.smooth.look(places, area, center, (self.bins, tile));
        self.shade_shared(area, scratch);
        let smooth = &scratch.smooth;
        let mut cursors = [0; MOST as usize];
        let (mut first, mut pixels) = (0, 0);
        while let Some(pixel) = smooth.shared.get(first).map(|key| (key >> 32) as u32) {
            let count = smooth.shared[first..].iter().take_while(|key| (*key >> 32) as u32 == pixel).count();
            let of_pixel = first..first + count;
            let (mut sum, mut hits) = (Vec3::ZERO, 0);
            for (i, cursor) in cursors[..places.len()].iter_mut().enumerate() {
                let (mut color, mut clear, mut is_hit) = (Vec3::ZERO, 1.0, false);
                let layers = &smooth.layers[i];
                while let Some(layer) = layers.get(*cursor).filter(|layer| layer.pixel <= pixel) {
                    let (lit, opacity) = smooth.look_of(of_pixel.clone(), layer.id);
                    if opacity > 0.0 && clear >= OPAQUE {
                        (color, clear, is_hit) =
                            (color + lit * (clear * opacity), clear * (1.0 - opacity), true);
                    }
                    *cursor += 1;
                }
                let solid = smooth.seen[i][pixel as usize];
                color +=
                    smooth.look_of(of_pixel.clone(), solid).0 * if clear >= OPAQUE { clear } else { 0.0 };
                sum += color;
                hits += u32::from(is_hit || solid != NO_TRIANGLE);
            }
            let (x, y) = (area.x as u32 + pixel % TILE_WIDTH, pixel / TILE_WIDTH);
            let at = (y * band.width + x) as usize;
            if let Some(color) = band.color.get_mut(at) {
                *color = finite(sum / places.len() as f32);
            }
            if let Some(coverage) = band.coverage.get_mut(at) {
                *coverage = hits as f32 / places.len() as f32;
            }
            first += count;
            pixels += 1;
        }
        pixels
    }

    /// Finds color and opacity of all triangles that share a pixel.
    #[inline(always)]
    fn shade_shared(&self, area: &TileArea, scratch: &mut Scratch) {
        let Scratch { faces, corners, smooth, .. } = scratch;
        let Smooth { shared, looks, .. } = smooth;
        looks.clear();
        looks.resize(shared.len(), (Vec3::ZERO, 1.0));
        let mut batch: Batch<'a> = Batch::new();
        for (i, &key) in shared.iter().enumerate() {
            let (pixel, id) = ((key >> 32) as u32, key as u32);
            let (x, y) = (area.x as u32 + pixel % TILE_WIDTH, area.y as u32 + pixel / TILE_WIDTH);
            let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
            if id == NO_TRIANGLE {
                let direction = self.lens.line(x, y).1.normalize_or_zero();
                looks[i].0 = self.light.scene.environment.background.color(direction);
            } else {
                // As a layer, so that its opacity is found.
                self.add(&mut batch, faces, (x, y), id, LAYER);
            }
            if batch.is_full() || faces.is_full() || i + 1 == shared.len() {
                self.light(&mut batch, faces, corners);
                let mut sample = batch.count;
                for k in (0..=i).rev().filter(|&k| shared[k] as u32 != NO_TRIANGLE) {
                    if sample == 0 {
                        break;
                    }
                    sample -= 1;
                    looks[k] = (batch.lit.get(sample), batch.opacity[sample]);
                }
                batch.clear();
                if faces.is_full() {
                    faces.clear();
                    corners.clear();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_strip_holds_one_place_and_their_mean_is_the_center() {
        for count in [2, 4, 8, 16, 64] {
            let places = places(count);
            for axis in 0..2 {
                let mut strips: Vec<i32> =
                    places.iter().map(|p| (p[axis] + STEPS / 2) * count as i32 / STEPS).collect();
                strips.sort_unstable();
                assert!(strips.iter().enumerate().all(|(i, &strip)| strip == i as i32), "{strips:?}");
                let mean = places.iter().map(|p| f64::from(p[axis])).sum::<f64>() / f64::from(count);
                assert!(mean.abs() <= 1.0, "{count} places lean by {mean} steps");
            }
        }
        assert_eq!(places(1), [[0, 0]]);
    }
}
