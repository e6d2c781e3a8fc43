//! How does a ray meet a height field?
//!
//! The rays of a tile are bounded together first: stretches in which all of them are above the highest or below the
//! lowest of the heights there are jumped, for the tile and then for each of its blocks. From there each ray walks
//! the cells of a pyramid of lowest and highest heights: a cell that it passes above or below is jumped in one step,
//! else its four children are looked at; at the bottom the ray meets a bilinear patch, a quadratic equation. Source:
//! A. Tevs, I. Ihrke, H.-P. Seidel, *Maximum mipmaps for fast, accurate, and scalable dynamic height field
//! rendering*, I3D 2008.

use crate::bundle::{COLUMNS, Hits, OCTETS, Rays};
use crate::pyramid::{Pyramid, clip};
use glam::{DAffine3, DVec2, DVec3};
use polyptych_core::lanes::{DVec3x8, F64x8, LANES, Mask8};
use polyptych_core::math::Aabb;
use polyptych_core::scene::HeightField;

/// Rows of a block of rays that is bounded by itself.
const BLOCK_ROWS: usize = 4;

/// Level at which a ray begins to walk where a block of rays was stopped.
const FIRST_LEVEL: usize = 2;

/// Most cells along an edge of the box around a stretch of rays that are looked at.
const CELLS: i64 = 3;

/// A height field with its pyramid.
#[derive(Debug)]
pub(crate) struct HeightBody {
    /// Level 1 has one entry for 2x2 cells; each next level one for 2x2 of those. The single cells' heights are read
    /// from the field.
    levels: Vec<Level>,
    bounds: Aabb,
}

#[derive(Debug)]
struct Level {
    columns: u32,
    rows: u32,
    ranges: Vec<[f32; 2]>,
}

/// Scratch memory of one worker: the rays of a tile in object space.
#[derive(Default)]
pub(crate) struct HeightScratch {
    rays: Vec<Local>,
}

/// Eight rays in object space with the stretch in which they may meet something.
#[derive(Clone, Copy)]
struct Local {
    origin: DVec3x8,
    direction: DVec3x8,
    near: F64x8,
    far: F64x8,
    open: Mask8,
}

impl HeightBody {
    pub(crate) fn new(field: &HeightField) -> Self {
        let mut levels = vec![Level::first(field)];
        while let Some(next) = levels.last().and_then(Level::halved) {
            levels.push(next);
        }
        Self { levels, bounds: field.bounds() }
    }

    /// Returns what [`HeightBody::bytes`] will be: ranges of blocks of four cells, of four of those, and so on.
    pub(crate) fn planned_bytes(field: &HeightField) -> u64 {
        let halved = |n: u64| n.div_ceil(2);
        let (mut columns, mut rows) =
            (halved(u64::from(field.columns() - 1)), halved(u64::from(field.rows() - 1)));
        let mut ranges = columns * rows;
        while columns * rows > 1 {
            (columns, rows) = (halved(columns), halved(rows));
            ranges += columns * rows;
        }
        ranges * 8
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.levels.iter().map(|l| l.ranges.len() as u64 * 8).sum()
    }

    polyptych_core::for_registers! {
        /// Improves `hits` where a ray of a tile meets the surface sooner.
        pub(crate) fn cast(
            &self,
            field: &HeightField,
            object_from_world: &DAffine3,
            body: u32,
            rays: &[Rays],
            hits: &mut [Hits],
            scratch: &mut HeightScratch,
        ) = cast_512, cast_256, cast_here;
    }

    #[inline(always)]
    fn cast_here(
        &self,
        field: &HeightField,
        object_from_world: &DAffine3,
        body: u32,
        rays: &[Rays],
        hits: &mut [Hits],
        scratch: &mut HeightScratch,
    ) {
        self.enter(object_from_world, rays, hits, &mut scratch.rays);
        let Some(start) = self.first_near(field, &scratch.rays, 0.0, 1.0) else { return };
        // Blocks of the same columns and a few rows: as wide as high.
        for first in (0..OCTETS).step_by(BLOCK_ROWS * COLUMNS) {
            for column in 0..COLUMNS {
                let octets: [usize; BLOCK_ROWS] = std::array::from_fn(|row| first + row * COLUMNS + column);
                let block = octets.map(|octet| scratch.rays[octet]);
                let Some(start) = self.first_near(field, &block, start, 0.25) else { continue };
                for octet in octets {
                    self.walk(field, &scratch.rays[octet], start, body, &mut hits[octet]);
                }
            }
        }
    }

    /// Turns rays into object space and cuts them to the bounds and to what they met already.
    #[inline(always)]
    fn enter(&self, object_from_world: &DAffine3, rays: &[Rays], hits: &[Hits], locals: &mut Vec<Local>) {
        locals.clear();
        let shift = DVec3x8::splat(object_from_world.translation);
        for (r, hits) in rays.iter().zip(hits) {
            let origin = r.origin.turned(&object_from_world.matrix3) + shift;
            let direction = r.direction.turned(&object_from_world.matrix3);
            let (enter, leave) = clip(&self.bounds, &origin, &direction);
            let (near, far) = (enter.max(r.near), leave.min(r.far).min(hits.t));
            let open = r.open() & far.at_least(near);
            locals.push(Local { origin, direction, near, far, open });
        }
    }

    /// Returns a distance before which none of some rays meets anything: where the stretches that can be jumped get
    /// shorter than a share of the width of the rays. Nothing where they meet nothing at all.
    #[inline(always)]
    fn first_near(&self, field: &HeightField, rays: &[Local], start: f64, share: f64) -> Option<f64> {
        let bounded = rays.iter().map(|r| (r.open, r.origin, r.direction, r.near, r.far));
        let (pyramid, near, far) = Pyramid::around(bounded)?;
        let mut begin = near.max(start);
        let mut length = (far - begin) * 0.125;
        // Rays that go all ways get no further than their longest: the loop ends, as the stretch is halved each time.
        while begin < far {
            let end = (begin + length).min(far);
            if self.is_clear(field, &pyramid.between(begin, end)) {
                begin = end;
                length += length;
            } else {
                length *= 0.5;
                if length <= share * pyramid.width(begin) || length <= 1e-6 * (far - near) {
                    return Some(begin);
                }
            }
        }
        None
    }

    /// Tells whether a box is above or below all heights under it.
    #[inline(always)]
    fn is_clear(&self, field: &HeightField, part: &Aabb) -> bool {
        let low = field.grid_from_plane(part.min.x, part.min.z);
        let high = field.grid_from_plane(part.max.x, part.max.z);
        let cells = (high - low).max_element();
        let mut level = 0;
        while level + 1 < self.levels.len() && cells > f64::from(2u32 << level) * (CELLS - 1) as f64 {
            level += 1;
        }
        let size = f64::from(2u32 << level);
        let at = &self.levels[level];
        let inside = |v: f64, count: u32| (v / size).floor().clamp(0.0, f64::from(count - 1)) as u32;
        let margin = 1e-9 * (part.min.y.abs() + part.max.y.abs());
        for row in inside(low.y, at.rows)..=inside(high.y, at.rows) {
            for column in inside(low.x, at.columns)..=inside(high.x, at.columns) {
                let [lowest, highest] = at.range([column, row]).map(f64::from);
                if part.min.y - margin <= highest && part.max.y + margin >= lowest {
                    return false;
                }
            }
        }
        true
    }

    /// Follows eight rays from a distance on, one by one.
    #[inline(always)]
    fn walk(&self, field: &HeightField, rays: &Local, start: f64, body: u32, hits: &mut Hits) {
        for i in 0..LANES {
            if !rays.open.has(i) {
                continue;
            }
            let (near, far) = (rays.near.0[i].max(start), rays.far.0[i]);
            let ray = GridRay::new(field, rays.origin.get(i), rays.direction.get(i));
            if let Some(t) = self.meet(field, &ray, near, far)
                && t < hits.t.0[i]
            {
                (hits.t.0[i], hits.body.0[i]) = (t, body);
            }
        }
    }

    /// Finds the first distance in `[near, far]` at which a ray in object space meets the surface, from above or
    /// from below.
    #[inline(always)]
    fn meet(&self, field: &HeightField, ray: &GridRay, near: f64, far: f64) -> Option<f64> {
        if near > far {
            return None;
        }
        let last = [field.columns() - 2, field.rows() - 2];
        let mut level = FIRST_LEVEL.min(self.levels.len());
        let (mut t, mut cell) = (near, ray.cell(near, level, last));
        let mut y = ray.height + ray.rise * t;
        // A hair of margin, so that rounding of `t` does not open a slit between cells.
        let [lowest, highest] = [self.bounds.min.y, self.bounds.max.y];
        let margin = 1e-12 * (lowest.abs() + highest.abs() + y.abs() + (ray.rise * far).abs());
        loop {
            let (across, along) = (ray.plane(cell, level, 0), ray.plane(cell, level, 1));
            let (axis, border) = if along < across { (1, along) } else { (0, across) };
            let exit = least(border, far);
            let after = ray.height + ray.rise * exit;
            let mut corners = [0.0; 4];
            let [low, high] = if level > 0 {
                self.levels[level - 1].range(cell).map(f64::from)
            } else {
                corners = field.cell(cell[0], cell[1]);
                // All four: a bilinear patch stays between them.
                let [a, b, c, d] = corners;
                [least(least(a, b), least(c, d)), -least(least(-a, -b), least(-c, -d))]
            };
            let (bottom, top) = if ray.rise < 0.0 { (after, y) } else { (y, after) };
            let passes = bottom > high + margin || top < low - margin;
            if !passes && level > 0 {
                level -= 1;
                cell = ray.child(cell, level, t, last);
                continue;
            }
            if !passes && let Some(hit) = ray.meet_patch(corners, cell, t, exit) {
                return Some(hit);
            }
            if exit >= far {
                return None;
            }
            cell = ray.next(cell, axis, last[axis] >> level)?;
            (t, y) = (exit, after);
            // Go up as long as the parent was entered just now, across the same plane: seen from there the
            // ray is never in doubt which child it is in.
            while level < self.levels.len() && ray.enters_parent(cell, axis) {
                level += 1;
                cell = cell.map(|c| c / 2);
            }
        }
    }
}

/// Returns the smaller of two numbers.
#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

impl Level {
    fn range(&self, cell: [u32; 2]) -> [f32; 2] {
        self.ranges[(cell[1] * self.columns + cell[0]) as usize]
    }

    /// Bounds blocks of 2x2 cells: of up to 3x3 heights.
    fn first(field: &HeightField) -> Self {
        let [columns, rows] = [field.columns(), field.rows()].map(|n| (n - 1).div_ceil(2));
        let heights = field.heights();
        let mut ranges = Vec::with_capacity((columns * rows) as usize);
        for row in 0..rows {
            for column in 0..columns {
                let mut range = [f32::INFINITY, f32::NEG_INFINITY];
                for y in row * 2..(row * 2 + 3).min(field.rows()) {
                    for x in column * 2..(column * 2 + 3).min(field.columns()) {
                        let h = heights[(y * field.columns() + x) as usize];
                        range = [range[0].min(h), range[1].max(h)];
                    }
                }
                ranges.push(range);
            }
        }
        Self { columns, rows, ranges }
    }

    fn halved(&self) -> Option<Self> {
        if self.columns == 1 && self.rows == 1 {
            return None;
        }
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let mut ranges = Vec::with_capacity((columns * rows) as usize);
        for row in 0..rows {
            for column in 0..columns {
                let mut range = [f32::INFINITY, f32::NEG_INFINITY];
                for y in row * 2..(row * 2 + 2).min(self.rows) {
                    for x in column * 2..(column * 2 + 2).min(self.columns) {
                        let [low, high] = self.range([x, y]);
                        range = [range[0].min(low), range[1].max(high)];
                    }
                }
                ranges.push(range);
            }
        }
        Some(Self { columns, rows, ranges })
    }
}

/// A ray over the grid: one unit a cell.
struct GridRay {
    start: DVec2,
    slope: DVec2,
    /// One over the slopes.
    pace: DVec2,
    height: f64,
    rise: f64,
}

impl GridRay {
    #[inline(always)]
    fn new(field: &HeightField, origin: DVec3, direction: DVec3) -> Self {
        let slope = DVec2::new(direction.x, direction.z) / field.cell_size();
        let start = field.grid_from_plane(origin.x, origin.z);
        Self { start, slope, pace: slope.recip(), height: origin.y, rise: direction.y }
    }

    /// Returns the cell of a level that the ray is in at a distance; `last` is the last cell of the grid.
    #[inline(always)]
    fn cell(&self, t: f64, level: usize, last: [u32; 2]) -> [u32; 2] {
        let mut cell = [0; 2];
        for i in 0..2 {
            let place = self.start[i] + self.slope[i] * t;
            cell[i] = (if place > 0.0 { place as u32 } else { 0 }).min(last[i]) >> level;
        }
        cell
    }

    /// Returns where the ray crosses the far plane of a cell along an axis; infinity where it does not.
    #[inline(always)]
    fn plane(&self, cell: [u32; 2], level: usize, axis: usize) -> f64 {
        let slope = self.slope[axis];
        // Fewer than 2^31 cells: a field of as many heights as fit into memory has less along an edge.
        let place = ((cell[axis] + u32::from(slope > 0.0)) << level) as i32;
        let t = (f64::from(place) - self.start[axis]) * self.pace[axis];
        if slope == 0.0 { f64::INFINITY } else { t }
    }

    /// Returns the cell that follows along an axis.
    #[inline(always)]
    fn next(&self, mut cell: [u32; 2], axis: usize, last: u32) -> Option<[u32; 2]> {
        let step = if self.slope[axis] > 0.0 { 1 } else { u32::MAX };
        cell[axis] = cell[axis].wrapping_add(step);
        (cell[axis] <= last).then_some(cell)
    }

    /// Returns which child of a cell the ray is in at `t`.
    #[inline(always)]
    fn child(&self, mut cell: [u32; 2], level: usize, t: f64, last: [u32; 2]) -> [u32; 2] {
        for i in 0..2 {
            let middle = f64::from(((cell[i] * 2 + 1) << level) as i32);
            let place = self.start[i] + self.slope[i] * t;
            let upper = if place == middle { self.slope[i] > 0.0 } else { place > middle };
            cell[i] = (cell[i] * 2 + u32::from(upper)).min(last[i] >> level);
        }
        cell
    }

    /// Tells whether the ray, having just entered a cell across an axis, entered its parent too.
    fn enters_parent(&self, cell: [u32; 2], axis: usize) -> bool {
        cell[axis] % 2 == u32::from(self.slope[axis] < 0.0)
    }

    /// Finds the first distance within a cell at which the ray is on its patch.
    fn meet_patch(&self, h: [f64; 4], cell: [u32; 2], near: f64, far: f64) -> Option<f64> {
        // Around the entry the numbers are small. f(s) = y - h over u = u0 + du s, v = v0 + dv s.
        let entry = self.start + self.slope * near - DVec2::new(f64::from(cell[0]), f64::from(cell[1]));
        let (u, v, du, dv) = (entry.x, entry.y, self.slope.x, self.slope.y);
        let (hu, hv, twist) = (h[1] - h[0], h[2] - h[0], h[0] - h[1] - h[2] + h[3]);
        let c = self.height + self.rise * near - (h[0] + hu * u + hv * v + twist * u * v);
        let b = self.rise - hu * du - hv * dv - twist * (u * dv + v * du);
        let a = -twist * du * dv;
        let slack = 1e-9 * (far - near).abs();
        let within = |s: f64| (s >= -slack && s <= far - near + slack).then(|| near + s.max(0.0));
        if a.abs() * (far - near) <= 1e-14 * b.abs() {
            return within(-c / b);
        }
        let discriminant = b * b - 4.0 * a * c;
        if discriminant.is_nan() || discriminant < 0.0 {
            return None;
        }
        let q = -0.5 * (b + discriminant.sqrt().copysign(b));
        let (s, r) = (q / a, c / q);
        let (first, second) = if s < r { (s, r) } else { (r, s) };
        within(first).or_else(|| within(second))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hits_agree_with_dense_sampling() {
        let heights = (0..37 * 23).map(|i: i32| ((i * i * 7 + i * 13) % 29) as f32 / 29.0).collect();
        let field = HeightField::new(37, 23, DVec2::new(6.0, 4.0), heights).unwrap();
        let body = HeightBody::new(&field);
        let (mut hits, mut wrong) = (0, 0);
        for i in 0..600 {
            let place = |k: i32, m: i32| f64::from((i * k) % m) / f64::from(m) - 0.5;
            let target = DVec3::new(place(31, 101) * 5.6, 0.4, place(57, 103) * 3.6);
            let origin = target + DVec3::new(place(17, 97) * 5.0, 0.9 + place(71, 89), place(43, 83) * 5.0);
            let direction = match i % 7 {
                0 => DVec3::NEG_Y,
                1 => DVec3::new((target - origin).x, (target - origin).y, 0.0).normalize_or(DVec3::NEG_Y),
                _ => (target - origin).normalize_or(DVec3::NEG_Y),
            };
            let (near, far) = field.bounds().clip(origin, direction).unwrap_or((1.0, 0.0));
            if near >= far {
                continue;
            }
            let above = |t: f64| {
                let p = origin + direction * t;
                p.y - field.height_and_normal(p.x, p.z).0
            };
            let steps = 60_000;
            let at = |k: i32| near + (far - near) * f64::from(k) / f64::from(steps);
            let first = (1..=steps).find(|&k| (above(at(k)) > 0.0) != (above(at(0)) > 0.0)).map(at);
            let found = body.meet(&field, &GridRay::new(&field, origin, direction), near, far);
            hits += usize::from(first.is_some());
            wrong += usize::from(match (first, found) {
                (Some(a), Some(b)) => (a - b).abs() > (far - near) * 1e-4,
                (None, None) => false,
                // Entering through the side of the box exactly on the surface is a hit of the solver alone.
                (None, Some(b)) => above(b).abs() > 1e-9,
                (Some(_), None) => true,
            });
        }
        assert!(hits > 300 && wrong == 0, "{wrong} wrong of {hits}");
    }
}
