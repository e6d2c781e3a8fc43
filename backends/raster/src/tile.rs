//! Which pixels of a tile does a triangle cover, and which triangle is nearest on each?
//!
//! Edge functions are evaluated in whole numbers on corners snapped to 24.8 bits, with the top-left rule: a
//! pixel whose center lies on an edge that two triangles share belongs to exactly one of them. A triangle is
//! convex, so a row of it is one span; its ends are found by exact division. (J. Pineda, *A parallel algorithm
//! for polygon rasterization*, SIGGRAPH 1988.)

use crate::setup::{Record, STEPS};
use polyptych_core::lanes::{F32x8, F64x8, I32x8, LANES, Mask8};

/// Columns of a tile.
pub(crate) const TILE_WIDTH: u32 = 64;
/// Rows of a tile: those of a band, so that a band is a row of tiles.
pub(crate) const TILE_HEIGHT: u32 = 32;
/// Pixels of a tile.
pub(crate) const TILE_PIXELS: usize = (TILE_WIDTH * TILE_HEIGHT) as usize;
/// The id of no triangle.
pub(crate) const NO_TRIANGLE: u32 = u32::MAX;

/// The tiles of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TileGrid {
    width: u32,
    height: u32,
    pub(crate) columns: u32,
    pub(crate) rows: u32,
    /// Pixels around boxes that count as touched, too.
    margin: i32,
}

/// The place of a tile in the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileArea {
    pub(crate) x: i32,
    pub(crate) y: i32,
    pub(crate) width: i32,
    pub(crate) height: i32,
}

/// The nearest triangle on every pixel of a tile, and its depth: what one may call visible.
pub(crate) struct TileBuffer {
    pub(crate) depth: [f32; TILE_PIXELS],
    pub(crate) id: [u32; TILE_PIXELS],
}

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

/// What lies in a box of pixels.
pub(crate) trait Placed {
    /// Returns the first and last column and row that it can cover; maybe none.
    fn pixels(&self) -> ([i32; 2], [i32; 2]);
}

impl TileGrid {
    pub(crate) fn new(width: u32, height: u32) -> Self {
        let (columns, rows) = (width.div_ceil(TILE_WIDTH), height.div_ceil(TILE_HEIGHT));
        Self { width, height, columns, rows, margin: 0 }
    }

    /// Returns the grid for triangles that are looked at from other places than the pixels' centers.
    pub(crate) fn smooth(self, smooth: bool) -> Self {
        Self { margin: i32::from(smooth), ..self }
    }

    pub(crate) fn count(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    pub(crate) fn area(&self, tile: usize) -> TileArea {
        let (column, row) = (tile as u32 % self.columns, tile as u32 / self.columns);
        let (x, y) = (column * TILE_WIDTH, row * TILE_HEIGHT);
        TileArea {
            x: x as i32,
            y: y as i32,
            width: TILE_WIDTH.min(self.width - x) as i32,
            height: TILE_HEIGHT.min(self.height - y) as i32,
        }
    }

    /// Calls `touch` for the tiles under a box.
    pub(crate) fn for_each_touched(&self, record: &impl Placed, mut touch: impl FnMut(usize)) {
        let ([x0, x1], [y0, y1]) = record.pixels();
        let m = self.margin;
        let (x0, x1) = ((x0 - m).max(0), (x1 + m).min(self.width as i32 - 1));
        let (y0, y1) = ((y0 - m).max(0), (y1 + m).min(self.height as i32 - 1));
        if x0 > x1 || y0 > y1 {
            return;
        }
        for row in y0 as u32 / TILE_HEIGHT..=y1 as u32 / TILE_HEIGHT {
            for column in x0 as u32 / TILE_WIDTH..=x1 as u32 / TILE_WIDTH {
                touch((row * self.columns + column) as usize);
            }
        }
    }
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

    /// Narrows a span `first..=last` of columns to the inside of the edge; `inverse` is `1 / |by_column|`.
    ///
    /// Adding a half before dividing keeps quotients clear of whole numbers by more than the rounding error.
    fn narrow(&self, inverse: f64, first: &mut i32, last: &mut i32) {
        if self.by_column > 0 {
            if self.value < 0 {
                let steps = ((-self.value) as f64 - 0.5) * inverse;
                *first = (*first).max((steps as i32).saturating_add(1));
            }
        } else if self.value < 0 {
            *last = -1;
        } else if self.by_column < 0 {
            *last = (*last).min(((self.value as f64 + 0.5) * inverse) as i32);
        }
    }
}

/// Columns that are tested at once.
const BLOCK: usize = LANES;
/// Triangles wider than this on a tile are drawn row by row, each as a span.
const WIDEST_IN_BLOCKS: i32 = 16;

/// The pixels of a tile whose centers a triangle can cover.
struct Pixels {
    x0: i32,
    x1: i32,
    y0: i32,
    y1: i32,
}

impl Pixels {
    #[inline(always)]
    fn of(record: &Record, area: &TileArea) -> Option<Self> {
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
}

/// The edges of a small triangle in numbers of 32 bits.
struct Blocks {
    value: [i32; 3],
    by_column: [i32; 3],
    by_row: [i32; 3],
}

impl Blocks {
    /// Values beyond this keep their sign over a whole tile: what a triangle of [`Blocks::LONGEST`] changes by is
    /// less.
    const FAR: i64 = 1 << 30;
    /// Longest edge, in steps.
    const LONGEST: i64 = 1 << 22;

    /// Sets up the edges at the first pixel; nothing for triangles that are better drawn in spans.
    #[inline(always)]
    fn new(record: &Record, area: &TileArea, pixels: &Pixels) -> Option<Self> {
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
    fn at(&self, column: i32) -> [I32x8; 3] {
        let columns = I32x8::count_from(column);
        let edge = |k: usize| I32x8::splat(self.value[k]) + I32x8::splat(self.by_column[k]) * columns;
        [edge(0), edge(1), edge(2)]
    }
}

/// Calls `visit` for every row of pixels of a tile that a triangle covers, exactly.
pub(crate) fn for_each_span(record: &Record, area: &TileArea, mut visit: impl FnMut(Span)) {
    let Some(Pixels { x0, x1, y0, y1 }) = Pixels::of(record, area) else { return };
    let edge = |corner| Edge::new(record, corner, x0, y0);
    let mut edges = [edge(0), edge(1), edge(2)];
    let inverses = edges.map(|edge| 1.0 / edge.by_column.abs() as f64);
    for y in y0..=y1 {
        let (mut first, mut last) = (0, x1 - x0);
        for (edge, inverse) in edges.iter_mut().zip(inverses) {
            edge.narrow(inverse, &mut first, &mut last);
            edge.value += edge.by_row;
        }
        if first <= last {
            let x = x0 + first;
            visit(Span {
                first: ((y - area.y) * TILE_WIDTH as i32 + x - area.x) as usize,
                length: (last - first + 1) as usize,
                x,
                y,
            });
        }
    }
}

impl TileBuffer {
    pub(crate) fn new() -> Self {
        Self { depth: [f32::NEG_INFINITY; TILE_PIXELS], id: [NO_TRIANGLE; TILE_PIXELS] }
    }

    /// Draws solid triangles. Of equal depths the lower id wins, so their order does not matter.
    pub(crate) fn draw<'r>(&mut self, records: impl Iterator<Item = &'r Record>, area: &TileArea) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            #[expect(
                unsafe_code,
                reason = "a kernel compiled for a processor feature can only be called so"
            )]
            // SAFETY: the processor has the feature that the kernel was compiled for; it was just asked.
            return unsafe { self.draw_avx2(records, area) };
        }
        self.draw_here(records, area);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn draw_avx2<'r>(&mut self, records: impl Iterator<Item = &'r Record>, area: &TileArea) {
        self.draw_here(records, area);
    }

    /// The same in the caller's instructions.
    #[inline(always)]
    pub(crate) fn draw_here<'r>(&mut self, records: impl Iterator<Item = &'r Record>, area: &TileArea) {
        for record in records {
            self.draw_record(record, area);
        }
    }

    /// Draws a solid triangle.
    #[inline(always)]
    pub(crate) fn draw_record(&mut self, record: &Record, area: &TileArea) {
        let Some(pixels) = Pixels::of(record, area) else { return };
        match Blocks::new(record, area, &pixels) {
            Some(blocks) => self.draw_blocks(record, area, &pixels, &blocks),
            None => for_each_span(record, area, |span| self.draw_span(record, &span)),
        }
    }

    #[inline(always)]
    fn draw_span(&mut self, record: &Record, span: &Span) {
        let pixels = span.first..span.first + span.length;
        let row = record.depth_of_row(span.y);
        let targets = self.depth[pixels.clone()].iter_mut().zip(&mut self.id[pixels]);
        for (i, (depth, id)) in targets.enumerate() {
            let new = record.hold(row + record.depth_of_column(span.x + i as i32));
            let wins = (new > *depth) | ((new == *depth) & (record.id < *id));
            *depth = if wins { new } else { *depth };
            *id = if wins { record.id } else { *id };
        }
    }

    /// Draws a small triangle by testing all pixels of a few columns at once.
    #[inline(always)]
    fn draw_blocks(&mut self, record: &Record, area: &TileArea, pixels: &Pixels, blocks: &Blocks) {
        let mut first = pixels.x0;
        while first <= pixels.x1 {
            // A block that would pass the tile's end begins earlier: drawing a pixel twice changes nothing.
            let x = first.min(area.x + (TILE_WIDTH as usize - BLOCK) as i32);
            let [mut a, mut b, mut c] = blocks.at(x - pixels.x0);
            let down = |k: usize| I32x8::splat(blocks.by_row[k]);
            let (down_a, down_b, down_c) = (down(0), down(1), down(2));
            let within = I32x8::splat(pixels.x1) - I32x8::count_from(x);
            let columns = record.depth_of_columns(x);
            for y in pixels.y0..=pixels.y1 {
                let at = ((y - area.y) * TILE_WIDTH as i32 + x - area.x) as usize;
                let (depths, ids) = (&mut self.depth[at..at + BLOCK], &mut self.id[at..at + BLOCK]);
                let new = record.hold_all(F64x8::splat(record.depth_of_row(y)) + columns);
                let old = F32x8::load(depths);
                let old_ids = Mask8::load(ids);
                let first = old_ids.above(record.id);
                let nearer = new.above(old) | (new.equal(old) & first);
                let wins = nearer & (a | b | c | within).not_negative();
                wins.pick(new, old).store(depths);
                ids.copy_from_slice(&wins.pick_bits(Mask8([record.id; BLOCK]), old_ids).0);
                (a, b, c) = (a + down_a, b + down_b, c + down_c);
            }
            first += BLOCK as i32;
        }
    }

    /// Draws a triangle with holes; `is_solid` tells for a place of the picture, asked only where it would win.
    pub(crate) fn draw_where(
        &mut self,
        record: &Record,
        area: &TileArea,
        mut is_solid: impl FnMut(f64, f64) -> bool,
    ) {
        for_each_span(record, area, |span| {
            let row = record.depth_of_row(span.y);
            for i in 0..span.length {
                let new = record.hold(row + record.depth_of_column(span.x + i as i32));
                let (depth, id) = (&mut self.depth[span.first + i], &mut self.id[span.first + i]);
                let wins = new > *depth || (new == *depth && record.id < *id);
                if wins && is_solid(f64::from(span.x + i as i32) + 0.5, f64::from(span.y) + 0.5) {
                    (*depth, *id) = (new, record.id);
                }
            }
        });
    }
}
