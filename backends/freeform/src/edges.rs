//! How much of a pixel do thin things and edges cover?
//!
//! A pixel is drawn by one ray through its middle. Blocks of pixels in which that may not tell all, because something
//! is only near or what is seen changes, are drawn again by as many rays as asked in each pixel: their mean is the color,
//! and the share of them that met something the coverage. All else stays what the ray through the middle met.

use crate::bundle::{Cone, Crossing, Hits, NOWHERE, Rays, TILE};
use crate::form::LEVELS;
use crate::frame::{FrameDrawing, Scratch};
use crate::program::Active;
use crate::pyramid::Pyramid;
use crate::world::{Body, CastScratch, Geometry, World};
use glam::Vec3;
use polyptych_core::camera::View;
use polyptych_core::framebuffer::{Band, Channel, Channels};
use polyptych_core::lanes::{DVec3x8, F64x8, LANES};
use std::ops::Range;

/// Pixels of a small tile.
const PIXELS: usize = (TILE * TILE) as usize;

/// Cosine between normals next to one another from which on they are an edge.
const CREASE: f32 = 0.8;

/// Share by which distances next to one another differ at an edge.
const GAP: f32 = 0.02;

/// What is known of a band, with a row above and one below, and what a block of its pixels is drawn into, finer.
#[derive(Default)]
pub(crate) struct Fine {
    id: Vec<u32>,
    distance: Vec<f32>,
    normal: Vec<Vec3>,
    fine_color: Vec<Vec3>,
    fine_id: Vec<u32>,
    active: [Active; LEVELS],
    scratch: Option<Box<Scratch>>,
}

/// What is drawn finer, and how fine.
pub(crate) struct Edges<'a> {
    pub(crate) world: &'a World,
    /// The view of the picture, and the same with so many more pixels.
    pub(crate) view: View<'a>,
    pub(crate) fine_view: View<'a>,
    /// Rows of the picture.
    pub(crate) height: u32,
    /// Rays along each edge of a pixel: a divisor of a tile's edge.
    pub(crate) rays: u32,
}

/// Pixels of a band, as an area of its columns and rows.
struct Block {
    columns: Range<u32>,
    rows: Range<u32>,
}

impl Edges<'_> {
    /// Draws the blocks of a band again that need it; returns how many rays that took.
    pub(crate) fn refine(&self, band: &mut Band<'_>, fine: &mut Fine) -> u64 {
        fine.scratch.get_or_insert_default().traced = 0;
        self.survey(band, fine);
        let edge = TILE / self.rays;
        for row in (0..band.rows).step_by(edge as usize) {
            for column in (0..band.width).step_by(edge as usize) {
                let block = Block {
                    columns: column..band.width.min(column + edge),
                    rows: row..band.rows.min(row + edge),
                };
                if self.is_doubtful(band, &block, fine) {
                    self.draw(band, &block, fine);
                }
            }
        }
        fine.scratch.as_ref().map_or(0, |s| s.traced)
    }

    /// Finds what the pixels' middles meet, also in the rows above and below the band.
    fn survey(&self, band: &Band<'_>, fine: &mut Fine) {
        let Fine { id, distance, normal, scratch: Some(scratch), .. } = fine else { return };
        let width = band.width as usize;
        let size = width * (band.rows as usize + 2);
        id.resize(size, 0);
        distance.resize(size, f32::INFINITY);
        normal.resize(size, Vec3::ZERO);
        let channels = Channels::NONE.with(Channel::Id).with(Channel::Distance).with(Channel::Normal);
        let (last, below) = (band.rows as usize, band.first_row + band.rows);
        // Beyond the picture there is what is at its border.
        let above = band.first_row.saturating_sub(1);
        let parts =
            [(0, above, 1), (1, band.first_row, band.rows), (last + 1, below.min(self.height - 1), 1)];
        for (row, first_row, rows) in parts {
            let own = row * width..(row + rows as usize) * width;
            let mut part = Band {
                width: band.width,
                first_row: 0,
                rows,
                color: &mut [],
                distance: &mut distance[own.clone()],
                normal: &mut normal[own.clone()],
                id: &mut id[own],
                albedo: &mut [],
                shadow: &mut [],
                coverage: &mut [],
            };
            let drawing =
                FrameDrawing { world: self.world, view: self.view, channels, corner: [0, first_row] };
            drawing.draw(&mut part, scratch);
        }
    }

    /// Tells whether rays through the middles of a block's pixels may not tell what is in it.
    fn is_doubtful(&self, band: &Band<'_>, block: &Block, fine: &mut Fine) -> bool {
        // The pixels around belong to it: an edge between two blocks is in one of them.
        let rows = block.rows.start..block.rows.end + 2;
        let columns = block.columns.start.saturating_sub(1)..(block.columns.end + 1).min(band.width);
        let middle = ((block.rows.start + 1) * band.width + block.columns.start) as usize;
        let (id, distance, normal) = (fine.id[middle], fine.distance[middle], fine.normal[middle]);
        for row in rows {
            for at in (row * band.width + columns.start) as usize..(row * band.width + columns.end) as usize {
                let is_beside = (fine.distance[at] - distance).abs() > GAP * distance;
                if fine.id[at] != id || (id != 0 && (is_beside || fine.normal[at].dot(normal) < CREASE)) {
                    return true;
                }
            }
        }
        // Nothing else may be before it, however thin.
        let rays = self.around(band, block, f64::from(distance) * (1.0 + f64::from(GAP)));
        let cone = Cone::around(&rays);
        self.world.bodies.iter().any(|body| {
            body.object as u32 + 1 != id
                && cone.is_none_or(|c| c.touches(body.center, body.radius))
                && body.may_meet(&rays, &mut fine.active)
        })
    }

    /// Returns rays along the upper and lower sides of a block.
    fn around(&self, band: &Band<'_>, block: &Block, far: f64) -> [Rays; 2] {
        let mut all = [Rays { origin: NOWHERE, direction: NOWHERE, near: F64x8::ZERO, far: F64x8::ZERO }; 2];
        for (rays, row) in all.iter_mut().zip([block.rows.start, block.rows.end]) {
            let mut x = F64x8::splat(f64::from(block.columns.start));
            for lane in 0..LANES {
                x.0[lane] += block.columns.len() as f64 * lane as f64 / (LANES - 1) as f64;
            }
            let (origin, direction, there) = self.view.rays(x, f64::from(band.first_row + row));
            let far = F64x8::pick(there, F64x8::splat(far), F64x8::splat(-1.0));
            *rays = Rays { origin, direction, near: F64x8::ZERO, far };
        }
        all
    }

    fn draw(&self, band: &mut Band<'_>, block: &Block, fine: &mut Fine) {
        let Fine { fine_color, fine_id, scratch: Some(scratch), .. } = fine else { return };
        fine_color.resize(PIXELS, Vec3::ZERO);
        fine_id.resize(PIXELS, 0);
        let rays = self.rays;
        let mut small = Band {
            width: block.columns.len() as u32 * rays,
            first_row: 0,
            rows: block.rows.len() as u32 * rays,
            color: fine_color,
            distance: &mut [],
            normal: &mut [],
            id: fine_id,
            albedo: &mut [],
            shadow: &mut [],
            coverage: &mut [],
        };
        let drawing = FrameDrawing {
            world: self.world,
            view: self.fine_view,
            channels: Channels::COLOR.with(Channel::Id),
            corner: [block.columns.start * rays, (band.first_row + block.rows.start) * rays],
        };
        drawing.draw(&mut small, scratch);
        let width = small.width;
        for (y, row) in block.rows.clone().enumerate() {
            for (x, column) in block.columns.clone().enumerate() {
                let (mut sum, mut met) = (Vec3::ZERO, 0);
                for i in 0..rays * rays {
                    let at = (y as u32 * rays + i / rays) * width + x as u32 * rays + i % rays;
                    sum += fine_color[at as usize];
                    met += u32::from(fine_id[at as usize] != 0);
                }
                let share = 1.0 / (rays * rays) as f32;
                let at = (row * band.width + column) as usize;
                if let Some(color) = band.color.get_mut(at) {
                    *color = sum * share;
                }
                if let Some(coverage) = band.coverage.get_mut(at) {
                    *coverage = met as f32 * share;
                }
            }
        }
    }
}

impl Body {
    /// Tells whether anything of the body may be among rays that bound a block of pixels. Forms are never missed,
    /// however thin; of others it is enough that the rays themselves meet none, as they are not thin.
    fn may_meet(&self, rays: &[Rays; 2], active: &mut [Active; LEVELS]) -> bool {
        let Geometry::Form(form) = &*self.geometry else {
            let Geometry::Plane { .. } = &*self.geometry else { return false };
            let mut hits = [Hits::nothing(&rays[0]), Hits::nothing(&rays[1])];
            self.cast(0, Crossing::Any, rays, &mut hits, &mut CastScratch::default());
            return hits.iter().any(|h| h.any().any());
        };
        let (matrix, shift) = (&self.object_from_world.matrix3, self.object_from_world.translation);
        let away = (self.center - rays[0].origin.get(0)).length();
        let (least, most) = ((away - self.radius).max(0.0), away + self.radius);
        let bounded = rays.iter().map(|r| {
            let (origin, direction) =
                (r.origin.turned(matrix) + DVec3x8::splat(shift), r.direction.turned(matrix));
            let (near, far) = (F64x8::splat(least), r.far.min(F64x8::splat(most)));
            (r.open() & far.above(near), origin, direction, near, far)
        });
        let Some((pyramid, near, far)) = Pyramid::around(bounded) else { return false };
        let mut waiting = [(0.0, 0.0, 0); LEVELS + 1];
        waiting[0] = (near, far, 0);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (begin, end, level) = waiting[count];
            let part = pyramid.between(begin, end).intersection(form.bounds);
            if part.is_empty() {
                continue;
            }
            let (above, below) = active.split_at_mut(level);
            let from = above.last().map_or(&form.program.steps, |a| &a.steps);
            if !below[0].prune(&form.program, from, &part).contains(0.0) {
                continue;
            }
            if level + 1 == LEVELS || !pyramid.is_slender(begin, end) {
                return true;
            }
            let middle = 0.5 * (begin + end);
            waiting[count] = (middle, end, level + 1);
            waiting[count + 1] = (begin, middle, level + 1);
            count += 2;
        }
        false
    }
}
