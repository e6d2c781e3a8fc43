//! Where does a ray meet a bilinear height field?
//!
//! A tree of blocks with their lowest and highest sample sorts out where the ray cannot meet the field; in a
//! cell that is left the height along the ray is a parabola and the crossing its root.

use crate::line::{Hit, Line, Span};
use glam::{DVec2, DVec3};
use polyptych_core::math::Aabb;
use polyptych_core::scene::HeightField;

/// Cells along the edge of the smallest block.
const BLOCK: u32 = 4;
const STACK: usize = 3 * 32 + 1;
/// Roots this far outside of a cell still belong to it, so that none falls between neighbors.
const OVERLAP: f64 = 1e-12;

/// Lowest and highest samples of blocks of 4x4 cells, of 2x2 such blocks, and so on.
#[derive(Debug)]
pub(crate) struct Blocks {
    levels: Vec<Level>,
}

#[derive(Debug)]
struct Level {
    columns: u32,
    rows: u32,
    ranges: Vec<[f32; 2]>,
}

impl Blocks {
    pub(crate) fn new(field: &HeightField) -> Self {
        let (cells_x, cells_z) = (field.columns() - 1, field.rows() - 1);
        let (columns, rows) = (cells_x.div_ceil(BLOCK), cells_z.div_ceil(BLOCK));
        let mut ranges = Vec::with_capacity(columns as usize * rows as usize);
        for j in 0..rows {
            for i in 0..columns {
                let mut range = [f32::INFINITY, f32::NEG_INFINITY];
                // The samples on the far border belong to the neighbors too.
                for row in j * BLOCK..=((j + 1) * BLOCK).min(cells_z) {
                    for column in i * BLOCK..=((i + 1) * BLOCK).min(cells_x) {
                        let h = field.heights()[(row * field.columns() + column) as usize];
                        range = [range[0].min(h), range[1].max(h)];
                    }
                }
                ranges.push(range);
            }
        }
        let mut levels = vec![Level { columns, rows, ranges }];
        while let Some(next) = levels.last().and_then(Level::halved) {
            levels.push(next);
        }
        Self { levels }
    }

    /// Returns what [`Blocks::bytes`] will be.
    pub(crate) fn planned_bytes(field: &HeightField) -> u64 {
        let blocks = |samples: u32| u64::from((samples - 1).div_ceil(BLOCK));
        let (mut columns, mut rows) = (blocks(field.columns()), blocks(field.rows()));
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

    pub(crate) fn first(
        &self,
        field: &HeightField,
        line: &Line,
        mut span: Span,
        accept: &mut impl FnMut(&Hit) -> bool,
    ) -> Option<Hit> {
        let mut best = None;
        let top = self.levels.len() - 1;
        let mut stack = [(0usize, 0u32, 0u32, 0.0f64); STACK];
        let mut height = 0;
        if let Some(near) = self.enter(field, line, top, 0, 0) {
            stack[0] = (top, 0, 0, near);
            height = 1;
        }
        while height > 0 {
            height -= 1;
            let (level, i, j, near) = stack[height];
            if near > span.before {
                continue;
            }
            if level == 0 {
                search_block(field, line, (i, j), &mut span, &mut best, accept);
                continue;
            }
            let below = &self.levels[level - 1];
            let mut children = [(f64::INFINITY, 0, 0); 4];
            let mut count = 0;
            for (ci, cj) in [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, z)| (i * 2 + x, j * 2 + z)) {
                if ci < below.columns
                    && cj < below.rows
                    && let Some(near) = self.enter(field, line, level - 1, ci, cj)
                {
                    children[count] = (near, ci, cj);
                    count += 1;
                }
            }
            children[..count].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
            for &(near, ci, cj) in &children[..count] {
                stack[height] = (level - 1, ci, cj, near);
                height += 1;
            }
        }
        best
    }

    /// Returns where the line enters a block, not after the true place.
    fn enter(&self, field: &HeightField, line: &Line, level: usize, i: u32, j: u32) -> Option<f64> {
        let at = &self.levels[level];
        let [lo, hi] = at.ranges[(j * at.columns + i) as usize].map(f64::from);
        let (edge, size, half) = (f64::from(BLOCK << level), field.cell_size(), field.extent() * 0.5);
        let (x, z) = (f64::from(i) * edge * size.x - half.x, f64::from(j) * edge * size.y - half.y);
        let bounds = Aabb::new(DVec3::new(x, lo, z), DVec3::new(x + edge * size.x, hi, z + edge * size.y));
        let slack = (half.max_element() + lo.abs().max(hi.abs()) + line.origin.abs().max_element()) * 1e-13;
        let (near, _) = bounds.grown(slack).clip(line.origin, line.direction)?;
        Some(near)
    }
}

impl Level {
    fn halved(&self) -> Option<Self> {
        if self.columns == 1 && self.rows == 1 {
            return None;
        }
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let mut ranges = vec![[f32::INFINITY, f32::NEG_INFINITY]; columns as usize * rows as usize];
        for j in 0..self.rows {
            for i in 0..self.columns {
                let from = self.ranges[(j * self.columns + i) as usize];
                let to = &mut ranges[((j / 2) * columns + i / 2) as usize];
                *to = [to[0].min(from[0]), to[1].max(from[1])];
            }
        }
        Some(Self { columns, rows, ranges })
    }
}

fn search_block(
    field: &HeightField,
    line: &Line,
    (i, j): (u32, u32),
    span: &mut Span,
    best: &mut Option<Hit>,
    accept: &mut impl FnMut(&Hit) -> bool,
) {
    let size = field.cell_size();
    let origin = field.grid_from_plane(line.origin.x, line.origin.z);
    let direction = DVec2::new(line.direction.x, line.direction.z) / size;
    for row in j * BLOCK..((j + 1) * BLOCK).min(field.rows() - 1) {
        let Some(rows) = stretch(origin.y, direction.y, row) else { continue };
        for column in i * BLOCK..((i + 1) * BLOCK).min(field.columns() - 1) {
            let Some(columns) = stretch(origin.x, direction.x, column) else { continue };
            let (near, far) = (rows.0.max(columns.0), rows.1.min(columns.1));
            if !(near <= far && far >= span.after && near <= span.before) {
                continue;
            }
            let start = origin + direction * near.max(0.0) - DVec2::new(f64::from(column), f64::from(row));
            let cell = Cell { heights: field.cell(column, row), size, start, direction };
            let part = i64::from(row) * i64::from(field.columns()) + i64::from(column);
            for root in cell.roots(line.at(near.max(0.0)).y, line.direction.y).into_iter().flatten() {
                let t = near.max(0.0) + root;
                let slack = OVERLAP * t.abs().max(far - near);
                if !(t >= near - slack && t <= far + slack && span.holds(t, part)) {
                    continue;
                }
                let hit = Hit::plain(t, part, cell.normal(root));
                if accept(&hit) {
                    *best = Some(hit);
                    span.end_before(&hit);
                }
            }
        }
    }
}

/// Returns the part of a line between two neighboring grid lines.
fn stretch(origin: f64, direction: f64, cell: u32) -> Option<(f64, f64)> {
    let (lo, hi) = (f64::from(cell), f64::from(cell + 1));
    if direction == 0.0 {
        return (lo <= origin && origin <= hi).then_some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let (a, b) = ((lo - origin) / direction, (hi - origin) / direction);
    Some((a.min(b), a.max(b)))
}

/// A cell, and the line over it in units of the cell.
struct Cell {
    heights: [f64; 4],
    size: DVec2,
    start: DVec2,
    direction: DVec2,
}

impl Cell {
    /// Solves `y + dy s = h(u + du s, v + dv s)`.
    fn roots(&self, y: f64, dy: f64) -> [Option<f64>; 2] {
        let [h00, h10, h01, h11] = self.heights;
        let (along, across, twist) = (h10 - h00, h01 - h00, h11 - h10 - h01 + h00);
        let (p, d) = (self.start, self.direction);
        let c = y - (h00 + p.x * along + p.y * across + p.x * p.y * twist);
        let b = dy - (d.x * along + d.y * across + (p.x * d.y + p.y * d.x) * twist);
        let a = -d.x * d.y * twist;
        if a == 0.0 {
            let root = -c / b;
            return [root.is_finite().then_some(root), None];
        }
        let rest = b * b - 4.0 * a * c;
        if !(rest >= 0.0) {
            return [None, None];
        }
        let q = -0.5 * (b + rest.sqrt().copysign(b));
        let (r, s) = (q / a, if q == 0.0 { 0.0 } else { c / q });
        [r.min(s), r.max(s)].map(|x| x.is_finite().then_some(x))
    }

    fn normal(&self, s: f64) -> DVec3 {
        let [h00, h10, h01, h11] = self.heights;
        let p = self.start + self.direction * s;
        let along = (h10 - h00) * (1.0 - p.y) + (h11 - h01) * p.y;
        let across = (h01 - h00) * (1.0 - p.x) + (h11 - h10) * p.x;
        DVec3::new(-along / self.size.x, 1.0, -across / self.size.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line::Start;

    fn random(state: &mut u64) -> f64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }

    fn field() -> HeightField {
        let (columns, rows) = (37, 22);
        let mut s = 5;
        let heights = (0..columns * rows).map(|_| random(&mut s) as f32 * 0.4).collect();
        HeightField::new(columns, rows, DVec2::new(6.0, 5.0), heights).unwrap()
    }

    #[test]
    fn hits_agree_with_dense_sampling_from_both_sides() {
        let field = field();
        let blocks = Blocks::new(&field);
        let mut s = 17;
        let mut hits = 0;
        for _ in 0..500 {
            let mut v = || DVec3::new(random(&mut s), random(&mut s), random(&mut s));
            let origin = v() * DVec3::new(4.0, 2.0, 4.0);
            let target = v() * DVec3::new(2.9, 0.3, 2.4);
            let line =
                Line { origin, direction: (target - origin).normalize_or(DVec3::X), start: Start::Eye };
            let found = blocks.first(&field, &line, Span::WHOLE, &mut |_| true);
            let above = |t: f64| {
                let p = line.at(t);
                let inside = p.x.abs() <= 3.0 && p.z.abs() <= 2.5;
                inside.then(|| p.y - field.height_and_normal(p.x, p.z).0)
            };
            let step = 1e-3;
            let crossed = (0..12_000).map(|i| f64::from(i) * step).find(
                |&t| matches!((above(t), above(t + step)), (Some(a), Some(b)) if (a >= 0.0) != (b >= 0.0)),
            );
            if let Some(hit) = found {
                assert!(above(hit.t).is_none_or(|h| h.abs() < 1e-12), "off the surface: {line:?}");
                let p = line.at(hit.t);
                let normal = field.height_and_normal(p.x, p.z).1;
                assert!((normal - hit.normal).length() < 1e-6 * normal.length() || near_border(&field, p));
            }
            if let Some(t) = crossed {
                let hit = found.unwrap_or_else(|| panic!("missed a crossing at {t}: {line:?}"));
                assert!(hit.t <= t + step, "{} after {t}", hit.t);
                hits += 1;
            }
        }
        assert!(hits > 250, "{hits}");
    }

    fn near_border(field: &HeightField, p: DVec3) -> bool {
        let grid = field.grid_from_plane(p.x, p.z);
        (grid - grid.round()).abs().min_element() < 1e-9
    }

    #[test]
    fn vertical_rays_and_rays_along_rows_never_fall_through() {
        let field = field();
        let blocks = Blocks::new(&field);
        let size = field.cell_size();
        for column in 0..=72 {
            for row in 0..=42 {
                let (x, z) = (f64::from(column) * 0.5 * size.x - 3.0, f64::from(row) * 0.5 * size.y - 2.5);
                for y in [5.0, -5.0] {
                    let line = Line {
                        origin: DVec3::new(x, y, z),
                        direction: DVec3::new(0.0, -y.signum(), -0.0),
                        start: Start::Eye,
                    };
                    let inside = x <= 3.0 && z <= 2.5;
                    let hit = blocks.first(&field, &line, Span::WHOLE, &mut |_| true);
                    assert!(hit.is_some() || !inside, "{line:?} fell through");
                }
            }
        }
        // Along a row of vertices, from inside the range of heights.
        for row in 0..22 {
            let z = f64::from(row) * size.y - 2.5;
            let line = Line { origin: DVec3::new(-3.5, 0.0, z), direction: DVec3::X, start: Start::Eye };
            let changes = (0..36).any(|c| (field.height(c, row) >= 0.0) != (field.height(c + 1, row) >= 0.0));
            assert_eq!(
                blocks.first(&field, &line, Span::WHOLE, &mut |_| true).is_some(),
                changes,
                "row {row}"
            );
        }
    }
}
