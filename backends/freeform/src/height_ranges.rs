//! Between which heights is the surface over a block of cells?

use polyptych_core::lanes::{I32x8, LANES};
use polyptych_core::scene::HeightField;

/// Most levels there may be: an edge has less than 2^32 cells.
const LEVELS: usize = 32;

/// Steps in which heights are counted: so many from the lowest to the highest.
const STEPS: f64 = 65_000.0;

/// Steps below the lowest height, so that rays a little lower can be told from it.
const BELOW: f64 = 100.0;

/// By how many steps each range is wider than the heights in it: more than rounding moves the height of a ray, even
/// of one from 10^9 times as far as the field is high.
const MARGIN: f64 = 1.0 / 64.0;

/// The lowest and the highest heights of blocks of 2x2 cells, of 2x2 of those, and so on up to the whole field.
///
/// They are counted in steps and rounded outward, two to a word: the lowest in the lower half. Half the memory is half
/// the time to read it.
#[derive(Debug)]
pub(crate) struct Ranges {
    words: Vec<u32>,
    /// Where each level begins, and how many blocks it has along x. Level 0, the cells, has none.
    levels: Box<[Level; LEVELS]>,
    top: usize,
    /// The field's cells along x and z.
    columns: u32,
    rows: u32,
    lowest: f64,
    /// Steps in a unit of height.
    steps: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Level {
    first: u32,
    columns: u32,
}

impl Ranges {
    pub(crate) fn new(field: &HeightField) -> Self {
        let bounds = field.bounds();
        let (lowest, size) = (bounds.min.y, bounds.max.y - bounds.min.y);
        let steps = if size > 0.0 { STEPS / size } else { 1.0 };
        let mut all = Self {
            words: Vec::new(),
            levels: Box::new([Level::default(); LEVELS]),
            top: 0,
            columns: field.columns() - 1,
            rows: field.rows() - 1,
            lowest,
            steps,
        };
        all.words.reserve_exact(planned(field) as usize);
        all.add_cells(field);
        while all.size(all.top) != [1, 1] {
            all.add_level();
        }
        all
    }

    /// Returns what [`Ranges::bytes`] will be.
    pub(crate) fn planned_bytes(field: &HeightField) -> u64 {
        planned(field) * 4
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.words.len() as u64 * 4
    }

    /// Returns the level of the one block that is the whole field.
    pub(crate) fn top(&self) -> usize {
        self.top
    }

    /// Returns how many blocks a level has along x and z.
    pub(crate) fn size(&self, level: usize) -> [u32; 2] {
        [self.columns, self.rows].map(|cells| cells.div_ceil(1 << level))
    }

    /// Returns how many steps there are in a unit of height, and at how many the height 0 is.
    pub(crate) fn scale(&self) -> [f64; 2] {
        [self.steps, BELOW - self.lowest * self.steps]
    }

    /// Returns the lowest and the highest height in a block of a level above the cells, in steps.
    pub(crate) fn of_block(&self, [column, row]: [u32; 2], level: usize) -> [f64; 2] {
        let Level { first, columns, .. } = self.levels[level];
        let word = self.words[(first + row * columns + column) as usize];
        [f64::from(word & 0xFFFF), f64::from(word >> 16)]
    }

    /// Reads the words of the blocks of eight levels in which eight cells are; of cells themselves, what holds any.
    #[inline(always)]
    pub(crate) fn words(&self, x: I32x8, z: I32x8, level: I32x8) -> I32x8 {
        let (across, along) = (x.down(level), z.down(level));
        let mut words = I32x8::splat(-0x1_0000);
        for i in 0..LANES {
            let Level { first, columns, .. } = self.levels[level.0[i] as usize % LEVELS];
            let at = first.wrapping_add((along.0[i] as u32).wrapping_mul(columns));
            if let Some(word) = self.words.get(at.wrapping_add(across.0[i] as u32) as usize) {
                words.0[i] = *word as i32;
            }
        }
        words
    }

    /// Adds the ranges of blocks of 2x2 cells: of up to 3x3 heights.
    fn add_cells(&mut self, field: &HeightField) {
        let [columns, rows] = [field.columns(), field.rows()].map(|n| (n - 1).div_ceil(2));
        (self.top, self.levels[1]) = (1, Level { first: 0, columns });
        let (heights, wide) = (field.heights(), field.columns());
        for row in 0..rows {
            for column in 0..columns {
                let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
                for y in row * 2..(row * 2 + 3).min(field.rows()) {
                    for x in column * 2..(column * 2 + 3).min(wide) {
                        let h = heights[y as usize * wide as usize + x as usize];
                        (low, high) = (low.min(h), high.max(h));
                    }
                }
                let [low, high] = [low, high].map(|h| (f64::from(h) - self.lowest) * self.steps + BELOW);
                let (low, high) = ((low - MARGIN).floor() as u32, (high + MARGIN).ceil() as u32);
                self.words.push(low | high << 16);
            }
        }
    }

    /// Adds the ranges of blocks of 2x2 blocks of the last level.
    fn add_level(&mut self) {
        let (below, [across, along]) = (self.levels[self.top], self.size(self.top));
        self.top += 1;
        let [columns, rows] = self.size(self.top);
        self.levels[self.top] = Level { first: self.words.len() as u32, columns };
        for row in 0..rows {
            for column in 0..columns {
                let (mut low, mut high) = (0xFFFF, 0);
                for y in row * 2..(row * 2 + 2).min(along) {
                    for x in column * 2..(column * 2 + 2).min(across) {
                        let word = self.words[(below.first + y * below.columns + x) as usize];
                        (low, high) = (low.min(word & 0xFFFF), high.max(word >> 16));
                    }
                }
                self.words.push(low | high << 16);
            }
        }
    }
}

/// Counts the blocks of all levels.
fn planned(field: &HeightField) -> u64 {
    let halved = |n: u64| n.div_ceil(2);
    let (mut columns, mut rows) =
        (halved(u64::from(field.columns() - 1)), halved(u64::from(field.rows() - 1)));
    let mut blocks = columns * rows;
    while columns * rows > 1 {
        (columns, rows) = (halved(columns), halved(rows));
        blocks += columns * rows;
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    #[test]
    fn ranges_hold_all_heights_of_their_blocks() {
        let (columns, rows) = (23, 8);
        let heights: Vec<f32> = (0..columns * rows).map(|i: u32| (i * i * 7 % 31) as f32 - 40.0).collect();
        let field = HeightField::new(columns, rows, DVec2::ONE, heights).unwrap();
        let ranges = Ranges::new(&field);
        assert_eq!((ranges.size(1), ranges.size(ranges.top())), ([11, 4], [1, 1]));
        assert_eq!(ranges.bytes(), Ranges::planned_bytes(&field));
        let [steps, zero] = ranges.scale();
        for level in 1..=ranges.top() {
            for (x, z) in (0..rows - 1).flat_map(|z| (0..columns - 1).map(move |x| (x, z))) {
                let [low, high] = ranges.of_block([x >> level, z >> level], level);
                let lanes = [x, z, level as u32].map(|v| I32x8::splat(v as i32));
                let word = ranges.words(lanes[0], lanes[1], lanes[2]).0[5] as u32;
                assert_eq!([low, high], [f64::from(word & 0xFFFF), f64::from(word >> 16)]);
                for h in field.cell(x, z).map(|h| h * steps + zero) {
                    assert!(low < h && h < high, "{low} {h} {high} at {x} {z} of level {level}");
                }
            }
        }
        // The whole field, and no more than rounding beyond.
        assert_eq!(ranges.of_block([0, 0], ranges.top()), [BELOW - 1.0, BELOW + STEPS + 1.0]);
    }
}
