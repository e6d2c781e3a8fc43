//! Which pixels of a tile does a triangle cover, and which triangle is nearest on each?
//!
//! Edge functions are evaluated in whole numbers on corners snapped to 24.8 bits, with the top-left rule: a
//! pixel whose center lies on an edge that two triangles share belongs to exactly one of them. A triangle is
//! convex, so a row of it is one span; its ends are found by exact division. (J. Pineda, *A parallel algorithm
//! for polygon rasterization*, SIGGRAPH 1988.)

use crate::bin::Bins;
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

    /// Tells whether it may cover pixels of a box that it was found to reach into; asked where it reaches into many.
    fn may_cover(&self, columns: [i32; 2], rows: [i32; 2]) -> bool;
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
        let (rows, columns) = (
            y0 as u32 / TILE_HEIGHT..=y1 as u32 / TILE_HEIGHT,
            x0 as u32 / TILE_WIDTH..=x1 as u32 / TILE_WIDTH,
        );
        let is_one_line = columns.start() == columns.end() || rows.start() == rows.end();
        for row in rows {
            for column in columns.clone() {
                let tile = (row * self.columns + column) as usize;
                if is_one_line || self.may_touch(record, tile) {
                    touch(tile);
                }
            }
        }
    }
}

impl TileGrid {
    fn may_touch(&self, record: &impl Placed, tile: usize) -> bool {
        let (area, m) = (self.area(tile), self.margin);
        let columns = [area.x - m, area.x + area.width - 1 + m];
        record.may_cover(columns, [area.y - m, area.y + area.height - 1 + m])
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
const BLOCK: usize = LANES;
/// Blocks in a row of a tile.
const BLOCKS: usize = TILE_WIDTH as usize / BLOCK;
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

/// The least depths of blocks of a tile.
struct Coarse([f32; COARSE_COLUMNS * COARSE_ROWS]);

/// Pixels of an edge of a coarse block.
const COARSE: i32 = 8;
const COARSE_COLUMNS: usize = TILE_WIDTH as usize / COARSE as usize;
const COARSE_ROWS: usize = TILE_HEIGHT as usize / COARSE as usize;

impl Coarse {
    #[inline(always)]
    fn of(buffer: &TileBuffer) -> Self {
        let mut coarse = Self([0.0; COARSE_COLUMNS * COARSE_ROWS]);
        for (i, least) in coarse.0.iter_mut().enumerate() {
            let (row, column) = (i / COARSE_COLUMNS * COARSE as usize, i % COARSE_COLUMNS * COARSE as usize);
            let line = |y: usize| F32x8::load(&buffer.depth[(row + y) * TILE_WIDTH as usize + column..]);
            let mut all = line(0);
            for y in 1..COARSE as usize {
                all = all.min(line(y));
            }
            *least = all.0.iter().fold(f32::INFINITY, |a, &b| a.min(b));
        }
        coarse
    }

    /// Tells whether a triangle is behind all depths around it.
    #[inline(always)]
    fn hides(&self, record: &Record, area: &TileArea) -> bool {
        let Some(pixels) = Pixels::of(record, area) else { return true };
        let (first, last) = ((pixels.x0 - area.x) / COARSE, (pixels.x1 - area.x) / COARSE);
        let rows = (pixels.y0 - area.y) / COARSE..=(pixels.y1 - area.y) / COARSE;
        rows.flat_map(|row| (first..=last).map(move |column| (row as usize, column as usize)))
            .all(|(row, column)| record.nearest < self.0[row * COARSE_COLUMNS + column])
    }
}

/// Tells which ids are above one.
#[inline(always)]
fn are_above(ids: Mask8, id: u32) -> Mask8 {
    let mut above = Mask8::NONE;
    for lane in 0..LANES {
        above.0[lane] = if ids.0[lane] > id { u32::MAX } else { 0 };
    }
    above
}

impl TileBuffer {
    /// Nothing is visible.
    pub(crate) fn new() -> Self {
        Self { depth: [f32::NEG_INFINITY; TILE_PIXELS], id: [NO_TRIANGLE; TILE_PIXELS] }
    }

    /// Draws the solid triangles of a tile as they are seen from places that lie so many steps from the pixels'
    /// centers. Of equal depths the lowest id wins.
    pub(crate) fn of(bins: &Bins, tile: usize, area: &TileArea, place: [i32; 2]) -> Self {
        let mut buffer = Self::new();
        #[cfg(target_arch = "x86_64")]
        if crate::wide::has_avx2() {
            #[expect(unsafe_code, reason = "a kernel compiled for a processor feature can only be called so")]
            // SAFETY: the processor has the feature that the kernel was compiled for; it was just asked.
            unsafe {
                buffer.fill_avx2(bins, tile, area, place);
            }
            return buffer;
        }
        buffer.fill(bins, tile, area, place);
        buffer
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn fill_avx2(&mut self, bins: &Bins, tile: usize, area: &TileArea, place: [i32; 2]) {
        self.fill(bins, tile, area, place);
    }

    /// The same in the caller's instructions. What turns its back to the viewer is mostly hidden by what does not, and
    /// most of it is told to be by a coarse look at the depths.
    #[inline(always)]
    fn fill(&mut self, bins: &Bins, tile: usize, area: &TileArea, place: [i32; 2]) {
        // The compiler would make masked stores where something is kept or put back, and these take some processors
        // a dozen cycles each. It cannot where it does not know that both places are the same.
        let apart = std::hint::black_box(0);
        let mut last = 0;
        for run in bins.runs() {
            for record in run.facing.of_tile(tile) {
                debug_assert!(record.id >= last, "of equal depths the first drawn wins: ids must rise");
                last = record.id;
                self.draw::<false>(&record.seen_from(place), area, apart);
            }
        }
        if bins.runs().iter().all(|run| run.averted.is_empty(tile)) {
            return;
        }
        let coarse = Coarse::of(self);
        for run in bins.runs() {
            for record in run.averted.of_tile(tile) {
                let record = record.seen_from(place);
                if !coarse.hides(&record, area) {
                    self.draw::<true>(&record, area, apart);
                }
            }
        }
    }

    /// Draws a solid triangle. `TIES` tells whether triangles of higher ids may have been drawn before.
    #[inline(always)]
    fn draw<const TIES: bool>(&mut self, record: &Record, area: &TileArea, apart: usize) {
        let Some(pixels) = Pixels::of(record, area) else { return };
        match Blocks::new(record, area, &pixels) {
            Some(blocks) => self.draw_blocks::<TIES>(record, area, &pixels, &blocks, apart),
            None => self.draw_spans::<TIES>(record, area, &pixels, apart),
        }
    }

    /// Draws a triangle row by row. What columns add to depths is found once for all rows.
    #[inline(always)]
    fn draw_spans<const TIES: bool>(
        &mut self,
        record: &Record,
        area: &TileArea,
        pixels: &Pixels,
        apart: usize,
    ) {
        let mut columns = [F64x8::ZERO; BLOCKS];
        let block = |x: i32| (x - area.x) as usize / BLOCK;
        let first = block(pixels.x0);
        for (i, columns) in columns[first..=block(pixels.x1)].iter_mut().enumerate() {
            *columns = record.depth_of_columns(area.x + ((first + i) * BLOCK) as i32);
        }
        for span in Spans::of(record, area).iter() {
            let row = F64x8::splat(record.depth_of_row(span.y));
            let begin = span.first % TILE_WIDTH as usize;
            let (line, end) = (span.first - begin, begin + span.length);
            let blocks = begin / BLOCK..end.div_ceil(BLOCK);
            for (i, columns) in columns[blocks.clone()].iter().enumerate() {
                let first = (blocks.start + i) * BLOCK;
                let at = line + first;
                let depth = record.hold_all(row + *columns);
                let mut outside = Mask8::NONE;
                if first < begin || first + BLOCK > end {
                    let past = I32x8::count_from(first as i32) - I32x8::splat(begin as i32);
                    let before = I32x8::splat(end as i32 - 1) - I32x8::count_from(first as i32);
                    outside = (past | before).is_negative();
                }
                self.draw_block::<TIES>(at, apart, depth, outside, record.id);
            }
        }
    }

    /// Draws a small triangle by testing all pixels of a few columns at once.
    #[inline(always)]
    fn draw_blocks<const TIES: bool>(
        &mut self,
        record: &Record,
        area: &TileArea,
        pixels: &Pixels,
        blocks: &Blocks,
        apart: usize,
    ) {
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
                let depth = record.hold_all(F64x8::splat(record.depth_of_row(y)) + columns);
                self.draw_block::<TIES>(at, apart, depth, (a | b | c | within).is_negative(), record.id);
                (a, b, c) = (a + down_a, b + down_b, c + down_c);
            }
            first += BLOCK as i32;
        }
    }

    /// Draws eight pixels of a triangle where they are not outside of it, and nearer than what is there. `apart` is
    /// zero; see [`TileBuffer::of_here`].
    #[inline(always)]
    fn draw_block<const TIES: bool>(
        &mut self,
        at: usize,
        apart: usize,
        depth: F32x8,
        outside: Mask8,
        id: u32,
    ) {
        let (old, old_ids) = (F32x8::load(&self.depth[at..]), Mask8::load(&self.id[at..]));
        let mut wins = depth.above(old);
        if TIES {
            wins = wins | (depth.equal(old) & are_above(old_ids, id));
        }
        let wins = wins & !outside;
        let to = at + apart..at + apart + BLOCK;
        wins.pick(depth, old).store(&mut self.depth[to.clone()]);
        self.id[to].copy_from_slice(&wins.pick_bits(Mask8([id; BLOCK]), old_ids).0);
    }

    /// Draws a triangle with holes; `is_solid` tells for a place of the picture, asked only where it would win.
    pub(crate) fn draw_where(
        &mut self,
        record: &Record,
        area: &TileArea,
        mut is_solid: impl FnMut(f64, f64) -> bool,
    ) {
        for span in Spans::of(record, area).iter() {
            let row = record.depth_of_row(span.y);
            for i in 0..span.length {
                let new = record.hold(row + record.depth_of_column(span.x + i as i32));
                let (depth, id) = (&mut self.depth[span.first + i], &mut self.id[span.first + i]);
                let wins = new > *depth || (new == *depth && record.id < *id);
                if wins && is_solid(f64::from(span.x + i as i32) + 0.5, f64::from(span.y) + 0.5) {
                    (*depth, *id) = (new, record.id);
                }
            }
        }
    }
}
