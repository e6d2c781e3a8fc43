//! How does a ray meet a height field?
//!
//! The ray walks the cells of a pyramid of lowest and highest heights: a cell that the ray passes above or below
//! is jumped in one step, else its four children are looked at; at the bottom the ray meets a bilinear patch, a
//! quadratic equation. Source: A. Tevs, I. Ihrke, H.-P. Seidel, *Maximum mipmaps for fast, accurate, and scalable
//! dynamic height field rendering*, I3D 2008.

use glam::{DVec2, DVec3};
use polyptych_core::scene::HeightField;

/// A height field with its pyramid.
#[derive(Debug)]
pub(crate) struct HeightBody {
    /// Level 0 has one entry a cell; each next level one for 2x2.
    levels: Vec<Level>,
}

#[derive(Debug)]
struct Level {
    columns: u32,
    rows: u32,
    ranges: Vec<[f32; 2]>,
}

impl HeightBody {
    pub(crate) fn new(field: &HeightField) -> Self {
        let (columns, rows) = (field.columns() - 1, field.rows() - 1);
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
        let ranges = cells
            .map(|(column, row)| {
                // All four corners: a bilinear patch stays between them.
                let h = field.cell(column, row).map(|h| h as f32);
                [h[0].min(h[1]).min(h[2].min(h[3])), h[0].max(h[1]).max(h[2].max(h[3]))]
            })
            .collect();
        let mut levels = vec![Level { columns, rows, ranges }];
        while let Some(next) = levels.last().and_then(Level::halved) {
            levels.push(next);
        }
        Self { levels }
    }

    /// Returns what [`HeightBody::bytes`] will be: ranges of cells, of blocks of four cells, and so on.
    pub(crate) fn planned_bytes(field: &HeightField) -> u64 {
        let (mut columns, mut rows) = (u64::from(field.columns() - 1), u64::from(field.rows() - 1));
        let mut ranges = columns * rows;
        while columns * rows > 1 {
            (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
            ranges += columns * rows;
        }
        ranges * 8
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.levels.iter().map(|l| l.ranges.len() as u64 * 8).sum()
    }

    /// Finds the first distance in `[near, far]` at which a ray in object space meets the surface, from above or
    /// from below.
    pub(crate) fn cast(
        &self,
        field: &HeightField,
        origin: DVec3,
        direction: DVec3,
        near: f64,
        far: f64,
    ) -> Option<f64> {
        let size = field.cell_size();
        let start = field.grid_from_plane(origin.x, origin.z);
        let ray = GridRay {
            start,
            slope: DVec2::new(direction.x, direction.z) / size,
            height: origin.y,
            rise: direction.y,
        };
        let mut level = self.levels.len() - 1;
        let (mut t, mut cell) = (near, [0u32; 2]);
        loop {
            let exit = ray.exit(cell, level, far);
            let (y0, y1) = (ray.height + ray.rise * t, ray.height + ray.rise * exit);
            let [low, high] = self.levels[level].range(cell).map(f64::from);
            // A hair of margin, so that rounding of `t` does not open a slit between cells.
            let margin = 1e-12 * (y0.abs() + y1.abs() + high.abs() + low.abs());
            let passes = y0.min(y1) > high + margin || y0.max(y1) < low - margin;
            if !passes && level > 0 {
                level -= 1;
                cell = ray.child(cell, level, t, &self.levels[level]);
                continue;
            }
            if !passes && let Some(hit) = ray.meet_patch(field.cell(cell[0], cell[1]), cell, t, exit) {
                return Some(hit);
            }
            if exit >= far {
                return None;
            }
            let axis;
            (cell, axis) = ray.next(cell, level, &self.levels[level])?;
            t = exit;
            // Go up as long as the parent was entered just now, across the same plane: seen from there the
            // ray is never in doubt which child it is in.
            while level + 1 < self.levels.len() && ray.enters_parent(cell, axis) {
                level += 1;
                cell = cell.map(|c| c / 2);
            }
        }
    }
}

impl Level {
    fn range(&self, cell: [u32; 2]) -> [f32; 2] {
        self.ranges[(cell[1] * self.columns + cell[0]) as usize]
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
    height: f64,
    rise: f64,
}

impl GridRay {
    /// Returns where the ray leaves a cell, from the planes of the cell alone.
    fn exit(&self, cell: [u32; 2], level: usize, far: f64) -> f64 {
        let axis = |i: usize| self.plane(cell, level, i).unwrap_or(f64::INFINITY);
        axis(0).min(axis(1)).min(far)
    }

    /// Returns where the ray crosses the far plane of a cell along an axis.
    fn plane(&self, cell: [u32; 2], level: usize, axis: usize) -> Option<f64> {
        let slope = self.slope[axis];
        let index = u64::from(cell[axis]) + u64::from(slope > 0.0);
        (slope != 0.0).then(|| ((index << level) as f64 - self.start[axis]) / slope)
    }

    /// Returns the cell that follows, and the axis across which it is entered.
    fn next(&self, cell: [u32; 2], level: usize, size: &Level) -> Option<([u32; 2], usize)> {
        let along = |i: usize| self.plane(cell, level, i).unwrap_or(f64::INFINITY);
        let axis = usize::from(along(1) < along(0));
        let mut next = cell;
        next[axis] =
            if self.slope[axis] > 0.0 { cell[axis].checked_add(1)? } else { cell[axis].checked_sub(1)? };
        (next[0] < size.columns && next[1] < size.rows).then_some((next, axis))
    }

    /// Returns which child of a cell the ray is in at `t`.
    fn child(&self, cell: [u32; 2], level: usize, t: f64, size: &Level) -> [u32; 2] {
        let last = [size.columns - 1, size.rows - 1];
        std::array::from_fn(|i| {
            let middle = ((u64::from(cell[i]) * 2 + 1) << level) as f64;
            let place = self.start[i] + self.slope[i] * t;
            let upper = if place == middle { self.slope[i] > 0.0 } else { place > middle };
            (cell[i] * 2 + u32::from(upper)).min(last[i])
        })
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
            let found = body.cast(&field, origin, direction, near, far);
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
