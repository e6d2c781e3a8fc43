//! Where in a chunk is nothing? A tree of 64-bit masks over 64^3 cells.

use polyptych_core::scene::{CHUNK, Chunk};

/// A set of palette bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Values([u64; 4]);

impl Values {
    /// Collects the bytes that are wanted; the empty byte 0 never is.
    pub(crate) fn of(wanted: impl Fn(u8) -> bool) -> Self {
        let mut set = Self::default();
        for value in (1..=255).filter(|&v| wanted(v)) {
            set.0[usize::from(value >> 6)] |= 1 << (value & 63);
        }
        set
    }

    /// Tells whether a byte is in the set.
    pub(crate) fn has(&self, value: u8) -> bool {
        self.0[usize::from(value >> 6)] >> (value & 63) & 1 == 1
    }
}

/// Which cells of a chunk hold one of some values: one bit a cell, and one for each block of 4^3 and 16^3 cells
/// that is not empty.
///
/// Invariant: a bit above is set if and only if a bit below it is. The dense form costs 33 KB a chunk and finds
/// every mask by index alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Occupancy {
    pub(crate) top: [u32; Self::TOP],
    pub(crate) middle: [u32; Self::MIDDLE],
    pub(crate) bottom: [u32; Self::BOTTOM],
}

/// The same, wherever it is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Nodes<'a> {
    pub(crate) top: &'a [u32; Occupancy::TOP],
    pub(crate) middle: &'a [u32; Occupancy::MIDDLE],
    pub(crate) bottom: &'a [u32; Occupancy::BOTTOM],
}

/// The same, to be changed.
#[derive(Debug)]
pub(crate) struct NodesMut<'a> {
    pub(crate) top: &'a mut [u32; Occupancy::TOP],
    pub(crate) middle: &'a mut [u32; Occupancy::MIDDLE],
    pub(crate) bottom: &'a mut [u32; Occupancy::BOTTOM],
}

/// Returns the number of a cell's block of `4^n` cells within the node above it, `shift` = 2n: x fastest, then y.
/// A node's mask is two words: the fifth bit of the number says which.
#[inline(always)]
fn child([x, y, z]: [u32; 3], shift: u32) -> usize {
    ((x >> shift & 3) | (y >> shift & 3) << 2 | (z >> shift & 3) << 4) as usize
}

/// Tells whether a node's word has the bit of a child.
#[inline(always)]
fn has(word: u32, child: usize) -> bool {
    word >> (child & 31) & 1 == 1
}

/// Returns the exponent of the empty block around an empty child: its own, or one more where all of its octet is
/// empty.
#[inline(always)]
fn empty(word: u32, child: usize, exponent: u32) -> u32 {
    exponent + u32::from(word >> (child & 0b0_1010) & Occupancy::OCTET == 0)
}

/// Tells whether all bytes are one.
fn are_alike(bytes: &[u8]) -> bool {
    let first = bytes[0];
    bytes.iter().fold(0, |other, &byte| other | (byte ^ first)) == 0
}

impl Occupancy {
    /// Bits of the 2^3 children around the first, in the order of [`child`].
    pub(crate) const OCTET: u32 = 0x0033_0033;

    /// Words of each level.
    pub(crate) const TOP: usize = 2;
    pub(crate) const MIDDLE: usize = 2 * 64;
    pub(crate) const BOTTOM: usize = 2 * 4096;

    /// Nothing is marked.
    pub(crate) const EMPTY: Self =
        Self { top: [0; Self::TOP], middle: [0; Self::MIDDLE], bottom: [0; Self::BOTTOM] };

    /// Edge of everything it describes, as an exponent of two.
    pub(crate) const EXPONENT: u32 = CHUNK.trailing_zeros();

    /// Marks the cells of a chunk that hold a wanted value; cells from `end` on lie outside of the grid and are
    /// empty. Nothing where no cell is marked.
    pub(crate) fn of(chunk: &Chunk, end: [u32; 3], wanted: &Values) -> Option<Box<Self>> {
        let mut marks = Box::new(Self::EMPTY);
        match chunk {
            Chunk::Uniform(value) => {
                if !wanted.has(*value) {
                    return None;
                }
                marks.mark_rows(end, |_| u64::MAX);
            }
            Chunk::Cells(cells) => {
                const ROW: usize = CHUNK as usize;
                let wanted: [bool; 256] = std::array::from_fn(|v| wanted.has(v as u8));
                let all = |bytes: &[u8]| {
                    let is_wanted = if wanted[usize::from(bytes[0])] { u64::MAX } else { 0 };
                    are_alike(bytes).then_some(is_wanted)
                };
                // Most slabs, and most rows, are air or stone alone: that is told many bytes at once.
                let slabs: [Option<u64>; ROW] =
                    std::array::from_fn(|z| all(&cells[z * ROW * ROW..(z + 1) * ROW * ROW]));
                marks.mark_rows(end, |row| {
                    let bytes = &cells[row * ROW..(row + 1) * ROW];
                    if let Some(bits) = slabs[row / ROW].or_else(|| all(bytes)) {
                        return bits;
                    }
                    let bit = |(x, &v): (usize, &u8)| u64::from(wanted[usize::from(v)]) << x;
                    bytes.iter().enumerate().map(bit).fold(0, |row, bit| row | bit)
                });
            }
        }
        (marks.top != [0; 2]).then_some(marks)
    }

    /// Fills the tree from rows of 64 cells along x; `row` counts y first, then z.
    fn mark_rows(&mut self, end: [u32; 3], row: impl Fn(usize) -> u64) {
        let within = u64::MAX >> (CHUNK - end[0].clamp(1, CHUNK));
        for z in 0..end[2] {
            for y in 0..end[1] {
                let row = row((z * CHUNK + y) as usize) & within;
                if row == 0 {
                    continue;
                }
                for x in (0..CHUNK).step_by(4) {
                    let four = row >> x & 0xf;
                    if four != 0 {
                        let cell = [x, y, z];
                        let (high, low) = (child(cell, 4), child(cell, 2));
                        let bit = child(cell, 0);
                        self.bottom[(high << 6 | low) << 1 | bit >> 5] |= (four as u32) << (bit & 31);
                        self.middle[high << 1 | low >> 5] |= 1 << (low & 31);
                        self.top[high >> 5] |= 1 << (high & 31);
                    }
                }
            }
        }
    }

    /// Returns its masks as those of a table are.
    pub(crate) fn nodes(&self) -> Nodes<'_> {
        Nodes { top: &self.top, middle: &self.middle, bottom: &self.bottom }
    }
}

impl NodesMut<'_> {
    /// Marks anew what became another byte: blocks of 4^3 cells in which something did.
    pub(crate) fn renew(&mut self, (old, new): (&[u8], &[u8]), end: [u32; 3], wanted: &Values) {
        const ROW: usize = CHUNK as usize;
        let wanted: [bool; 256] = std::array::from_fn(|v| wanted.has(v as u8));
        // Slabs of a layer first: most are as they were, and comparing is as fast as reading.
        for z in 0..end[2] as usize {
            let slab = z * ROW * ROW..(z + 1) * ROW * ROW;
            if old[slab.clone()] == new[slab.clone()] {
                continue;
            }
            for y in 0..end[1] as usize {
                let row = slab.start + y * ROW..slab.start + (y + 1) * ROW;
                if old[row.clone()] == new[row.clone()] {
                    continue;
                }
                for x in (0..ROW).step_by(4) {
                    let four = row.start + x..row.start + x + 4;
                    if old[four.clone()] != new[four.clone()] {
                        let bits = new[four]
                            .iter()
                            .enumerate()
                            .filter(|(i, v)| x + i < end[0] as usize && wanted[usize::from(**v)]);
                        let bits = bits.fold(0, |bits, (i, _)| bits | 1u32 << i);
                        self.put_four([x as u32, y as u32, z as u32], bits);
                    }
                }
            }
        }
    }

    /// Marks four cells along x as their bits say, and what lies above them.
    fn put_four(&mut self, cell: [u32; 3], bits: u32) {
        let (high, low, bit) = (child(cell, 4), child(cell, 2), child(cell, 0));
        let put = |word: &mut u32, child: usize, is_set: bool| {
            *word = *word & !(1 << (child & 31)) | u32::from(is_set) << (child & 31);
        };
        let node = (high << 6 | low) << 1;
        let word = &mut self.bottom[node | bit >> 5];
        *word = *word & !(0xf << (bit & 31)) | bits << (bit & 31);
        let is_set = self.bottom[node] | self.bottom[node | 1] != 0;
        put(&mut self.middle[high << 1 | low >> 5], low, is_set);
        let is_set = self.middle[high << 1] | self.middle[high << 1 | 1] != 0;
        put(&mut self.top[high >> 5], high, is_set);
    }
}

impl Nodes<'_> {
    /// Tells whether anything is marked in the aligned block of 2^2, 2^4 or 2^6 cells around a cell.
    pub(crate) fn has_block(&self, cell: [u32; 3], exponent: u32) -> bool {
        let (high, low) = (child(cell, 4), child(cell, 2));
        match exponent {
            2 => has(self.middle[high << 1 | low >> 5], low),
            4 => has(self.top[high >> 5], high),
            _ => *self.top != [0; 2],
        }
    }

    /// Returns the exponent `e` of an aligned block of `2^e` cells around a cell that is empty, or nothing when
    /// the cell is marked. Only the six lowest bits of the coordinates count.
    #[inline(always)]
    pub(crate) fn empty_around(&self, cell: [u32; 3]) -> Option<u32> {
        let high = child(cell, 4);
        let word = self.top[high >> 5];
        if !has(word, high) {
            return Some(if *self.top == [0; 2] { Occupancy::EXPONENT } else { empty(word, high, 4) });
        }
        let low = child(cell, 2);
        let word = self.middle[high << 1 | low >> 5];
        if !has(word, low) {
            return Some(empty(word, low, 2));
        }
        let bit = child(cell, 0);
        let word = self.bottom[(high << 6 | low) << 1 | bit >> 5];
        if has(word, bit) { None } else { Some(empty(word, bit, 0)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hash(i: u32) -> u32 {
        let h = (i ^ i >> 15).wrapping_mul(0x2c1b_3c6d);
        let h = (h ^ h >> 12).wrapping_mul(0x297a_2d39);
        h ^ h >> 15
    }

    #[test]
    fn every_block_that_is_called_empty_is_empty() {
        let cells: Vec<u8> =
            (0..64 * 64 * 64u32).map(|i| if hash(i).is_multiple_of(700) { 3 } else { 1 }).collect();
        let chunk = Chunk::Cells(cells.clone().into());
        let marks = Occupancy::of(&chunk, [64; 3], &Values::of(|v| v == 3)).unwrap();
        let marks = marks.nodes();
        let at = |x: u32, y: u32, z: u32| cells[((z * 64 + y) * 64 + x) as usize];
        let mut sizes = [0u32; 7];
        for i in 0..64 * 64 * 64u32 {
            let [x, y, z] = [i % 64, i / 64 % 64, i / 4096];
            match marks.empty_around([x, y, z]) {
                None => assert_eq!(at(x, y, z), 3),
                Some(e) => {
                    sizes[e as usize] += 1;
                    let low = |c: u32| c >> e << e;
                    for dz in 0..1 << e {
                        for dy in 0..1 << e {
                            for dx in 0..1 << e {
                                assert_ne!(at(low(x) + dx, low(y) + dy, low(z) + dz), 3);
                            }
                        }
                    }
                }
            }
        }
        assert!(sizes[..4].iter().all(|&n| n > 0), "{sizes:?}");
    }

    #[test]
    fn slabs_and_rows_of_one_byte_are_marked_as_their_cells_are() {
        // Slabs of one byte, slabs of rows of one byte each, and slabs in which a cell of a row is another one.
        let byte = |x: u32, y: u32, z: u32| match z % 4 {
            0 => (z / 4 % 4) as u8,
            1 => (y % 4) as u8,
            _ if [x, y] == [z, z] => 3,
            _ => (y / 16) as u8,
        };
        let cells: Vec<u8> = (0..64 * 64 * 64u32).map(|i| byte(i % 64, i / 64 % 64, i / 4096)).collect();
        let chunk = Chunk::Cells(cells.into());
        for end in [[64; 3], [61, 64, 63], [1, 5, 64]] {
            let marks = Occupancy::of(&chunk, end, &Values::of(|v| v == 3 || v == 1)).unwrap();
            for i in 0..64 * 64 * 64u32 {
                let cell = [i % 64, i / 64 % 64, i / 4096];
                let is_wanted = byte(cell[0], cell[1], cell[2]) % 2 == 1;
                let is_within = (0..3).all(|a| cell[a] < end[a]);
                assert_eq!(marks.nodes().empty_around(cell).is_none(), is_wanted && is_within, "{cell:?}");
            }
        }
    }

    #[test]
    fn cells_beyond_the_grid_are_empty() {
        let marks = Occupancy::of(&Chunk::Uniform(9), [3, 64, 1], &Values::of(|v| v == 9)).unwrap();
        let marks = marks.nodes();
        assert_eq!(marks.empty_around([2, 63, 0]), None);
        assert_eq!(marks.empty_around([3, 63, 0]), Some(0));
        assert_eq!(marks.empty_around([2, 63, 1]), Some(0));
        assert_eq!(marks.empty_around([2, 63, 2]), Some(1));
        assert_eq!(marks.empty_around([33, 1, 33]), Some(5));
        assert!(Occupancy::of(&Chunk::Uniform(0), [64; 3], &Values::of(|_| true)).is_none());
    }
}
