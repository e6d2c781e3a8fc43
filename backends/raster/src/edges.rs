//! Which pixels of a tile does a triangle cover?
//!
//! Edge functions are evaluated in whole numbers on corners snapped to 24.8 bits, with the top-left rule: a
//! pixel whose center lies on an edge that two triangles share belongs to exactly one of them. A triangle is
//! convex, so a row of it is one span; its ends are found by exact division. (J. Pineda, *A parallel algorithm
//! for polygon rasterization*, SIGGRAPH 1988.)

use crate::grid::{Placed, TILE_HEIGHT, TILE_WIDTH, TileArea};
use crate::setup::{Record, STEPS};
use polyptych_core::lanes::{F64x8, I32x8, LANES};

/// A row of pixels that a triangle covers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    /// First pixel, counted within the tile.
    pub(crate) first: usize,
    pub(crate) length: usize,
    /// Place of the first pixel in the picture.
    pub(crate) x: i32,
    pub(crate) y: i32,
}

/// Rows that are drawn together: a branch that the processor guesses wrong costs as much as several blocks of pixels,
/// and so it is taken for all of them.
pub(crate) const STRIP: usize = 4;

/// The pixels of some rows that a triangle covers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Strip {
    /// The first row in the picture, and counted within the tile.
    pub(crate) y: i32,
    pub(crate) row: usize,
    /// The first column of each row, counted within the tile, and the number of columns; none where a row has none.
    pub(crate) begin: [i32; STRIP],
    pub(crate) length: [u32; STRIP],
    /// The first block of columns that any row covers, and the end of them.
    pub(crate) blocks: [usize; 2],
}

/// An edge function along the rows of a tile.
#[derive(Clone, Copy)]
struct Edge {
    /// Value at the first column of the current row; negative is outside.
    value: i64,
    by_column: i64,
    by_row: i64,
}

impl Edge {
    /// Sets up the edge between two corners at a pixel's center.
    ///
    /// One step to the next center changes the exact function by `256 by_column`, so dividing by 256 and
    /// rounding down keeps every sign.
    fn new(record: &Record, corner: usize, x: i32, y: i32) -> Self {
        let next = (corner + 1) % 3;
        let by_column = i64::from(record.y[corner] - record.y[next]);
        let by_row = i64::from(record.x[next] - record.x[corner]);
        let is_top_or_left = by_column > 0 || (by_column == 0 && by_row > 0);
        let dx = i64::from((x << 8) + STEPS / 2 - record.x[corner]);
        let dy = i64::from((y << 8) + STEPS / 2 - record.y[corner]);
        let exact = by_column * dx + by_row * dy - i64::from(!is_top_or_left);
        Self { value: exact >> 8, by_column, by_row }
    }

    /// Narrows the columns that are inside of all edges, from `before` to before `end` when both are rounded down;
    /// `rows` are counted from that of the edge, and `inverse` is `1 / |by_column|`.
    ///
    /// Adding a half before dividing keeps quotients clear of whole numbers by `inverse / 2`, more than the rounding
    /// error.
    #[inline(always)]
    fn narrow(&self, rows: F64x8, inverse: f64, before: &mut F64x8, end: &mut F64x8) {
        let value = F64x8::splat(self.value as f64 + 0.5) + F64x8::splat(self.by_row as f64) * rows;
        let column = value * F64x8::splat(inverse);
        if self.by_column > 0 {
            *before = before.max(F64x8::splat(1.0) - column);
        } else {
            *end = end.min(F64x8::splat(1.0) + column);
        }
    }
}

/// Less than a half by less than quotients of [`Edge::narrow`] are clear of whole numbers: what is left of them without
/// it is nearest to what they are rounded down.
const ALMOST_HALF: f64 = 0.5 - 1.0 / (1u64 << 34) as f64;
/// Columns that are tested at once.
pub(crate) const BLOCK: usize = LANES;
/// Blocks in a row of a tile.
pub(crate) const BLOCKS: usize = TILE_WIDTH as usize / BLOCK;
/// Triangles wider than this on a tile are drawn row by row, each as a span.
const WIDEST_IN_BLOCKS: i32 = 16;

/// The pixels of a tile whose centers a triangle can cover.
pub(crate) struct Pixels {
    pub(crate) x0: i32,
    pub(crate) x1: i32,
    pub(crate) y0: i32,
    pub(crate) y1: i32,
}

impl Pixels {
    #[inline(always)]
    pub(crate) fn of(record: &Record, area: &TileArea) -> Option<Self> {
        let ([x0, x1], [y0, y1]) = record.pixels();
        let (x0, x1) = (x0.max(area.x), x1.min(area.x + area.width - 1));
        let (y0, y1) = (y0.max(area.y), y1.min(area.y + area.height - 1));
        (x0 <= x1 && y0 <= y1).then_some(Self { x0, x1, y0, y1 })
    }
}

impl Placed for Record {
    fn pixels(&self) -> ([i32; 2], [i32; 2]) {
        self.pixels()
    }

    /// No edge has the whole box on its outside.
    fn may_cover(&self, columns: [i32; 2], rows: [i32; 2]) -> bool {
        (0..3).all(|corner| {
            let edge = Edge::new(self, corner, columns[0], rows[0]);
            let most = |by: i64, of: [i32; 2]| by.max(0) * i64::from(of[1] - of[0]);
            edge.value + most(edge.by_column, columns) + most(edge.by_row, rows) >= 0
        })
    }
}

/// The edges of a small triangle in numbers of 32 bits.
pub(crate) struct Blocks {
    value: [i32; 3],
    by_column: [i32; 3],
    pub(crate) by_row: [i32; 3],
}

impl Blocks {
    /// Values beyond this keep their sign over a whole tile: what a triangle of [`Blocks::LONGEST`] changes by is
    /// less.
    const FAR: i64 = 1 << 30;
    /// Longest edge, in steps.
    const LONGEST: i64 = 1 << 22;

    /// Sets up the edges at the first pixel; nothing for triangles that are better drawn in spans.
    #[inline(always)]
    pub(crate) fn new(record: &Record, area: &TileArea, pixels: &Pixels) -> Option<Self> {
        if pixels.x1 - pixels.x0 >= WIDEST_IN_BLOCKS || area.width < BLOCK as i32 {
            return None;
        }
        let mut blocks = Self { value: [0; 3], by_column: [0; 3], by_row: [0; 3] };
        for corner in 0..3 {
            let edge = Edge::new(record, corner, pixels.x0, pixels.y0);
            if edge.by_column.abs().max(edge.by_row.abs()) > Self::LONGEST {
                return None;
            }
            blocks.value[corner] = edge.value.clamp(-Self::FAR, Self::FAR) as i32;
            (blocks.by_column[corner], blocks.by_row[corner]) = (edge.by_column as i32, edge.by_row as i32);
        }
        Some(blocks)
    }

    /// Returns the values of the edges in the first row, from a column on.
    #[inline(always)]
    pub(crate) fn at(&self, column: i32) -> [I32x8; 3] {
        let columns = I32x8::count_from(column);
        let edge = |k: usize| I32x8::splat(self.value[k]) + I32x8::splat(self.by_column[k]) * columns;
        [edge(0), edge(1), edge(2)]
    }
}

/// The rows of pixels of a tile that a triangle covers, exactly.
pub(crate) struct Spans {
    area: TileArea,
    x0: i32,
    y0: i32,
    y1: i32,
    /// For each row how many columns from `x0` on lie before what is covered, and before its end.
    before: [i32; TILE_HEIGHT as usize],
    end: [i32; TILE_HEIGHT as usize],
}

impl Spans {
    #[inline(always)]
    pub(crate) fn of(record: &Record, area: &TileArea) -> Self {
        const ROWS: usize = TILE_HEIGHT as usize;
        let mut spans = Self { area: *area, x0: 0, y0: 0, y1: -1, before: [0; ROWS], end: [0; ROWS] };
        let Some(Pixels { x0, x1, y0, y1 }) = Pixels::of(record, area) else { return spans };
        // Rows that are added in front are not covered.
        let y0 = y0 - (y0 - area.y) % STRIP as i32;
        (spans.x0, spans.y0, spans.y1) = (x0, y0, y1);
        let edge = |corner| Edge::new(record, corner, x0, y0);
        let edges = [edge(0), edge(1), edge(2)];
        // Where all columns of a row are inside of an edge that runs along it, its quotient is infinite.
        let inverses = edges.map(|edge| 1.0 / edge.by_column.abs() as f64);
        let widest = F64x8::splat(f64::from(x1 - x0 + 1));
        let half = F64x8::splat(ALMOST_HALF);
        for first in (0..(y1 - y0 + 1) as usize).step_by(LANES) {
            let rows = I32x8::count_from(first as i32).to_f64();
            let (mut before, mut end) = (F64x8::ZERO, widest);
            for k in 0..3 {
                edges[k].narrow(rows, inverses[k], &mut before, &mut end);
            }
            (before.min(widest) - half).nearest().store(&mut spans.before[first..]);
            (end.max(F64x8::ZERO) - half).nearest().store(&mut spans.end[first..]);
        }
        spans
    }

    /// Returns a strip from its first row on, counted in strips.
    #[inline(always)]
    pub(crate) fn strip(&self, index: usize) -> Strip {
        let (first, x) = (index * STRIP, self.x0 - self.area.x);
        let y = self.y0 + first as i32;
        let mut strip = Strip { y, row: (y - self.area.y) as usize, ..Strip::default() };
        let (mut from, mut to) = (TILE_WIDTH as i32, 0);
        for row in 0..STRIP {
            let (before, end) = (self.before[first + row], self.end[first + row]);
            // Beyond the picture's last row a triangle may go on.
            let is_empty = before >= end || y + row as i32 > self.y1;
            strip.begin[row] = x + before;
            strip.length[row] = if is_empty { 0 } else { (end - before) as u32 };
            from = from.min(if is_empty { from } else { x + before });
            to = to.max(if is_empty { to } else { x + end });
        }
        strip.blocks = [from as usize / BLOCK, (to as usize).div_ceil(BLOCK)];
        strip
    }

    /// Counts the strips.
    #[inline(always)]
    pub(crate) fn strips(&self) -> usize {
        ((self.y1 + 1 - self.y0) as usize).div_ceil(STRIP)
    }

    /// Lists those that are not empty.
    #[inline(always)]
    pub(crate) fn iter(&self) -> impl Iterator<Item = Span> {
        (self.y0..=self.y1).filter_map(|y| {
            let row = (y - self.y0) as usize;
            let (before, end) = (self.before[row], self.end[row]);
            let x = self.x0 + before;
            let first = ((y - self.area.y) * TILE_WIDTH as i32 + x - self.area.x) as usize;
            (before < end).then(|| Span { first, length: (end - before) as usize, x, y })
        })
    }
}
