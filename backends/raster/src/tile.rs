//! Which triangle is nearest on each pixel of a tile?

use crate::bin::Bins;
use crate::edges::{BLOCK, BLOCKS, Blocks, Pixels, Spans};
use crate::grid::{TILE_HEIGHT, TILE_PIXELS, TILE_WIDTH, TileArea};
use crate::setup::Record;
use polyptych_core::lanes::{F32x8, F64x8, I32x8, LANES, Mask8};

/// The id of no triangle.
pub(crate) const NO_TRIANGLE: u32 = u32::MAX;

/// The nearest triangle on every pixel of a tile, and its depth: what one may call visible.
pub(crate) struct TileBuffer {
    pub(crate) depth: [f32; TILE_PIXELS],
    pub(crate) id: [u32; TILE_PIXELS],
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
        buffer.fill(bins, tile, area, place);
        buffer
    }

    polyptych_core::for_registers! {
        fn fill(&mut self, bins: &Bins, tile: usize, area: &TileArea, place: [i32; 2])
            = fill_512, fill_256, fill_here;
    }

    /// What turns its back to the viewer is mostly hidden by what does not, and most of it is told to be by a coarse
    /// look at the depths.
    #[inline(always)]
    fn fill_here(&mut self, bins: &Bins, tile: usize, area: &TileArea, place: [i32; 2]) {
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
    /// zero; see [`TileBuffer::fill`].
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
        self.id[to].copy_from_slice(&*wins.pick_bits(Mask8::new([id; BLOCK]), old_ids).0);
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
