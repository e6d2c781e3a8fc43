//! Which triangle is nearest on each pixel of a tile?

use crate::bin::Bins;
use crate::edges::{BLOCK, BLOCKS, Blocks, Pixels, STRIP, Spans};
use crate::grid::{TILE_HEIGHT, TILE_PIXELS, TILE_WIDTH, TileArea};
use crate::setup::Record;
use polyptych_core::lanes::{F32x8, F64x8, I32x8, LANES, Mask8};
use std::cell::Cell;

/// The id of no triangle.
pub(crate) const NO_TRIANGLE: u32 = u32::MAX;

/// The nearest triangle on every pixel of a tile, and its depth: what one may call visible. No block of pixels lies
/// across the border of two of the processor's lines of memory.
#[repr(align(64))]
pub(crate) struct TileBuffer {
    pub(crate) depth: [f32; TILE_PIXELS],
    pub(crate) id: [u32; TILE_PIXELS],
}

/// A row of it.
struct Line<'a> {
    depth: &'a mut [f32; TILE_WIDTH as usize],
    id: &'a mut [u32; TILE_WIDTH as usize],
}

/// The depth of pixels that a triangle does not cover: it is not above any, nor equal to one.
const OUTSIDE: F32x8 = F32x8::new([f32::NAN; LANES]);

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
            None => self.draw_spans::<TIES>(record, area, apart),
        }
    }

    /// Draws a triangle some rows at a time. What columns add to depths is found once for them.
    #[inline(always)]
    fn draw_spans<const TIES: bool>(&mut self, record: &Record, area: &TileArea, apart: usize) {
        let (depths, ids) = (in_blocks(&mut self.depth), in_blocks(&mut self.id));
        let spans = Spans::of(record, area);
        for strip in 0..spans.strips() {
            let strip = spans.strip(strip);
            let mut rows = [F64x8::ZERO; STRIP];
            for (row, y) in rows.iter_mut().zip(strip.y..) {
                *row = F64x8::splat(record.depth_of_row(y));
            }
            let old = (strip_of(depths, strip.row), strip_of(ids, strip.row));
            let new = (strip_of(depths, strip.row + apart), strip_of(ids, strip.row + apart));
            let first = (strip.blocks[0] * BLOCK) as i32;
            let (mut place, mut offset) =
                (I32x8::count_from(first), record.offset_of_columns(area.x + first));
            for block in strip.blocks[0]..strip.blocks[1].min(BLOCKS) {
                let column = record.depth_of_columns(offset);
                for (row, depth_of_row) in rows.iter().enumerate() {
                    let inside = (place - I32x8::splat(strip.begin[row])).is_index_below(strip.length[row]);
                    let depth = inside.pick(record.hold_all(*depth_of_row + column), OUTSIDE);
                    let seen = (F32x8::new(old.0[row][block].get()), Mask8::new(old.1[row][block].get()));
                    let (depth, ids) = nearer::<TIES>((depth, record.id), seen);
                    new.0[row][block].set(depth.0.values());
                    new.1[row][block].set(ids.0.values());
                }
                place = place + I32x8::splat(BLOCK as i32);
                offset = offset + F64x8::splat(BLOCK as f64);
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
            let columns = record.depth_of_columns(record.offset_of_columns(x));
            for y in pixels.y0..=pixels.y1 {
                let depth = record.hold_all(F64x8::splat(record.depth_of_row(y)) + columns);
                let depth = (a | b | c | within).is_negative().pick(OUTSIDE, depth);
                let mut to = self.line(((y - area.y) * TILE_WIDTH as i32) as usize);
                to.draw_block::<TIES>((x - area.x) as usize, apart, depth, record.id);
                (a, b, c) = (a + down_a, b + down_b, c + down_c);
            }
            first += BLOCK as i32;
        }
    }

    /// Returns the row of pixels that begins at one of them.
    #[inline(always)]
    fn line(&mut self, first: usize) -> Line<'_> {
        const WIDTH: usize = TILE_WIDTH as usize;
        let depth = self.depth[first..].first_chunk_mut::<WIDTH>();
        let id = self.id[first..].first_chunk_mut::<WIDTH>();
        let (Some(depth), Some(id)) = (depth, id) else { unreachable!("rows of a tile are full") };
        Line { depth, id }
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

impl Line<'_> {
    /// Draws eight pixels of a triangle where it is nearer than what is there. `apart` is zero; see
    /// [`TileBuffer::fill`].
    #[inline(always)]
    fn draw_block<const TIES: bool>(&mut self, at: usize, apart: usize, depth: F32x8, id: u32) {
        const LAST: usize = TILE_WIDTH as usize - BLOCK;
        // As the compiler cannot know, but neither place is beyond the last block's.
        let (at, to) = (at.min(LAST), (at + apart).min(LAST));
        let old = (F32x8::load(&self.depth[at..at + BLOCK]), Mask8::load(&self.id[at..at + BLOCK]));
        let (depth, ids) = nearer::<TIES>((depth, id), old);
        depth.store(&mut self.depth[to..to + BLOCK]);
        self.id[to..to + BLOCK].copy_from_slice(&*ids.0);
    }
}

/// Rows of blocks of pixels.
type Rows<T> = [[Cell<[T; BLOCK]>; BLOCKS]];

/// Returns the pixels of a tile by blocks, which may be read in one place while they are written in another.
#[inline(always)]
fn in_blocks<T>(pixels: &mut [T; TILE_PIXELS]) -> &Rows<T> {
    Cell::from_mut(pixels.as_chunks_mut().0).as_slice_of_cells().as_chunks().0
}

/// Returns some rows from one on.
#[inline(always)]
fn strip_of<T>(rows: &Rows<T>, first: usize) -> &[[Cell<[T; BLOCK]>; BLOCKS]; STRIP] {
    let Some(strip) = rows.get(first..).and_then(<[_]>::first_chunk) else {
        unreachable!("the rows of a tile are whole strips")
    };
    strip
}

/// Returns what is visible on eight pixels, of a triangle and of what was there before.
#[inline(always)]
fn nearer<const TIES: bool>((depth, id): (F32x8, u32), (old, old_ids): (F32x8, Mask8)) -> (F32x8, Mask8) {
    let mut wins = depth.above(old);
    if TIES {
        wins = wins | (depth.equal(old) & are_above(old_ids, id));
    }
    (wins.pick(depth, old), wins.pick_bits(Mask8::new([id; BLOCK]), old_ids))
}
