//! Where do lines through the middles of cells cross a triangle?
//!
//! In the space of cells middles lie at whole numbers. Which lines a triangle covers is told edge by edge, each edge
//! with its ends in one order: so of two triangles that share an edge exactly one has a line beside it, and a closed
//! mesh is left as often as it is entered, however numbers are rounded.

use glam::DVec3;
use std::ops::Range;

/// A place at which a line along an axis crosses a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// The middle of a cell in the line, but for `along`.
    line: [f64; 3],
    axis: usize,
    /// How far along the axis.
    pub(super) along: f64,
    /// 1 where the line comes through the back of the triangle, -1 through its front.
    pub(super) sign: i32,
}

impl Crossing {
    /// Returns the place, in the space of cells.
    pub(super) fn place(&self) -> DVec3 {
        let mut place = self.line;
        place[self.axis] = self.along;
        DVec3::from_array(place)
    }

    /// Returns the cell of the line with a number along its axis, which may lie outside of the grid.
    pub(super) fn cell(&self, along: i64) -> [i64; 3] {
        let mut cell = self.line.map(|c| c as i64);
        cell[self.axis] = along;
        cell
    }
}

/// Calls `visit` for each line along an axis through cells of a box that crosses a triangle, or misses it by less than a
/// margin, in cells: with one, corners that only rounding keeps apart leave no crack.
pub(super) fn for_each_crossing(
    corners: [DVec3; 3],
    axis: usize,
    cells: &[Range<u32>; 3],
    margin: f64,
    visit: &mut impl FnMut(Crossing),
) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let least = |a: usize| corners[0][a].min(corners[1][a]).min(corners[2][a]);
    let most = |a: usize| corners[0][a].max(corners[1][a]).max(corners[2][a]);
    // Lines from `low` on, up to but not including `high`.
    let span = |a: usize, low: f64, high: f64| {
        let from = (low - margin).ceil().max(f64::from(cells[a].start)) as u32;
        from..((high + margin).ceil().clamp(0.0, f64::from(cells[a].end)) as u32).max(from)
    };
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    for row in span(v, least(v), most(v)) {
        let height = f64::from(row).min(most(v).next_down()).max(least(v));
        let (mut rising, mut falling) = (None, None);
        for i in 0..3 {
            let (from, to) = (corners[i], corners[(i + 1) % 3]);
            let (is_up, was_up) = (to[v] > height, from[v] > height);
            if is_up == was_up {
                continue;
            }
            let (low, high) = if is_up { (from, to) } else { (to, from) };
            let place = low[u] + (height - low[v]) * ((high[u] - low[u]) / (high[v] - low[v]));
            *(if is_up { &mut rising } else { &mut falling }) = Some(place);
        }
        let (Some(rising), Some(falling)) = (rising, falling) else { continue };
        let sign = if rising > falling { 1 } else { -1 };
        for column in span(u, rising.min(falling), rising.max(falling)) {
            let across = f64::from(column);
            let away = normal[u] * (across - corners[0][u]) + normal[v] * (height - corners[0][v]);
            let along = corners[0][axis] - away / normal[axis];
            // A sliver may be seen from its edge, where rounding tells.
            let along = if along.is_finite() { along.clamp(least(axis), most(axis)) } else { least(axis) };
            let mut line = [0.0; 3];
            (line[u], line[v]) = (across, f64::from(row));
            visit(Crossing { line, axis, along, sign });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles whose common edge, on the very lines, is a rounding apart.
    #[test]
    fn a_margin_closes_cracks() {
        let cells = [0..9, 0..9, 0..9];
        let at = |x: f64, y: f64| DVec3::new(x, y, 4.25);
        let apart = 1e-12;
        let halves = [
            [at(1.0 + apart, 1.0), at(7.0, 1.0), at(7.0, 7.0 - apart)],
            [at(1.0, 1.0), at(7.0, 7.0), at(1.0, 7.0)],
        ];
        for (margin, whole) in [(0.0, false), (1e-9, true)] {
            let mut found = [0; 9];
            for half in halves {
                for_each_crossing(half, 2, &cells, margin, &mut |crossing| {
                    let [x, y, _] = crossing.cell(0);
                    found[x as usize] += i32::from(x == y);
                });
            }
            assert_eq!((2..7).all(|i| found[i] > 0), whole, "{margin}: {found:?}");
        }
    }

    /// Whichever way a square of corners on the very lines is cut, each line crosses it once.
    #[test]
    fn lines_through_edges_and_corners_cross_once() {
        let cells = [0..9, 0..9, 0..9];
        for axis in 0..3 {
            for cut in 0..2 {
                let place = |x: f64, y: f64| {
                    let mut p = [0.0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (4.25, x, y);
                    DVec3::from_array(p)
                };
                let square = [place(1.0, 2.0), place(6.0, 2.0), place(6.0, 7.0), place(1.0, 7.0)];
                let mut found = [[0; 9]; 9];
                for [a, b, c] in [[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]][cut] {
                    for_each_crossing(
                        [square[a], square[b], square[c]],
                        axis,
                        &cells,
                        0.0,
                        &mut |crossing| {
                            let cell = crossing.cell(0);
                            assert_eq!((crossing.along, crossing.sign), (4.25, 1));
                            found[cell[(axis + 1) % 3] as usize][cell[(axis + 2) % 3] as usize] += 1;
                        },
                    );
                }
                for (x, column) in found.iter().enumerate() {
                    for (y, &count) in column.iter().enumerate() {
                        let is_within = (1..6).contains(&x) && (2..7).contains(&y);
                        assert_eq!(count, i32::from(is_within), "{x} {y} along {axis}");
                    }
                }
            }
        }
    }
}
