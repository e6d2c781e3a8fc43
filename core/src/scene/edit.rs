//! How are cells of a grid changed, and changed back?
//!
//! An edit touches the chunks that its region reaches, and of these only cells that become something else. What it
//! returns says which, so that it can be undone; clones of the grid, among them the one that a frame is being drawn
//! of, keep what they have.

use super::voxels::{CHUNK, Chunk, Voxels, cell_index};
use glam::DVec3;

/// Where cells are changed. What lies outside of the grid is passed over.
#[derive(Clone, Copy)]
pub enum Region<'a> {
    /// One cell.
    Cell([u32; 3]),
    /// Cells from one corner up to, and without, another.
    Box {
        /// The first cell.
        from: [u32; 3],
        /// The cell behind the last one along each axis.
        to: [u32; 3],
    },
    /// Cells whose middles lie in a ball.
    Sphere {
        /// Its middle, in the grid's space.
        center: DVec3,
        /// Its radius in cells.
        radius: f64,
    },
    /// Cells of a box that are wanted.
    Where {
        /// The first cell.
        from: [u32; 3],
        /// The cell behind the last one along each axis.
        to: [u32; 3],
        /// Tells by place and byte.
        wanted: &'a dyn Fn([u32; 3], u8) -> bool,
    },
}

/// What becomes of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Brush {
    /// All hold this byte; 0 digs.
    Set(u8),
    /// Empty ones hold it.
    Fill(u8),
    /// Filled ones hold it.
    Paint(u8),
}

/// What an edit changed.
#[derive(Clone, Debug, Default)]
pub struct Edit {
    parts: Vec<Part>,
    cells: u64,
}

#[derive(Clone, Debug)]
struct Part {
    chunk: usize,
    change: Change,
}

#[derive(Clone, Debug)]
enum Change {
    /// Index in the chunk, byte before and after.
    Cells(Vec<(u32, u8, u8)>),
    /// Before and after.
    Whole(Chunk, Chunk),
}

/// More changed cells of a chunk are noted by keeping the chunk as it was.
const MANY: usize = (CHUNK * CHUNK * CHUNK / 8) as usize;

impl Region<'_> {
    /// Returns the first cell and the one behind the last, within a grid.
    fn bounds(&self, size: [u32; 3]) -> ([u32; 3], [u32; 3]) {
        let (from, to) = match *self {
            Self::Cell(cell) => (cell, cell.map(|c| c.saturating_add(1))),
            Self::Box { from, to } | Self::Where { from, to, .. } => (from, to),
            Self::Sphere { center, radius } => {
                // A cast holds what is no number, or too large, within the range.
                let low = |a: usize| (center[a] - radius - 0.5).ceil().max(0.0) as u32;
                let high = |a: usize| (center[a] + radius + 0.5).floor().max(0.0) as u32;
                ([low(0), low(1), low(2)], [high(0), high(1), high(2)])
            }
        };
        let to: [u32; 3] = std::array::from_fn(|a| to[a].min(size[a]));
        (std::array::from_fn(|a| from[a].min(to[a])), to)
    }

    fn has(&self, cell: [u32; 3], byte: u8) -> bool {
        match self {
            Self::Cell(_) | Self::Box { .. } => true,
            Self::Sphere { center, radius } => {
                let middle = DVec3::from_array(cell.map(f64::from)) + 0.5;
                middle.distance_squared(*center) <= radius * radius
            }
            Self::Where { wanted, .. } => wanted(cell, byte),
        }
    }
}

impl Brush {
    fn paint(self, byte: u8) -> u8 {
        match self {
            Self::Set(new) => new,
            Self::Fill(new) => {
                if byte == 0 {
                    new
                } else {
                    byte
                }
            }
            Self::Paint(new) => {
                if byte == 0 {
                    0
                } else {
                    new
                }
            }
        }
    }
}

impl Voxels {
    /// Changes cells, and returns what changed.
    ///
    /// **Cost** is that of the cells of the region, and of copying each touched chunk that a clone of the grid holds, too.
    pub fn edit(&mut self, region: &Region<'_>, brush: Brush) -> Edit {
        let mut edit = Edit::default();
        let (from, to) = region.bounds(self.size());
        if (0..3).any(|a| from[a] >= to[a]) {
            return edit;
        }
        let [first, last] = [from.map(|c| c / CHUNK), to.map(|c| (c - 1) / CHUNK)];
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    self.edit_chunk([x, y, z], (from, to), region, brush, &mut edit);
                }
            }
        }
        edit
    }

    fn edit_chunk(
        &mut self,
        place: [u32; 3],
        (from, to): ([u32; 3], [u32; 3]),
        region: &Region<'_>,
        brush: Brush,
        edit: &mut Edit,
    ) {
        let origin = place.map(|c| c * CHUNK);
        let index = self.index_of_chunk(place);
        let low: [u32; 3] = std::array::from_fn(|a| from[a].saturating_sub(origin[a]));
        let high: [u32; 3] = std::array::from_fn(|a| CHUNK.min(to[a] - origin[a]));
        let chunk = self.chunk(index);
        let mut changes = Vec::new();
        if let Chunk::Uniform(byte) = *chunk {
            let is_whole = matches!(region, Region::Box { .. }) && low == [0; 3] && high == [CHUNK; 3];
            if brush.paint(byte) == byte {
                return;
            }
            if is_whole {
                edit.cells += u64::from(CHUNK).pow(3);
                let change = Change::Whole(chunk.clone(), Chunk::Uniform(brush.paint(byte)));
                let part = Part { chunk: index, change };
                part.apply(self, Side::After);
                edit.parts.push(part);
                return;
            }
        }
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                for x in low[0]..high[0] {
                    let i = cell_index(x, y, z);
                    let byte = match chunk {
                        Chunk::Uniform(byte) => *byte,
                        Chunk::Cells(cells) => cells[i],
                    };
                    let new = brush.paint(byte);
                    if new != byte && region.has([origin[0] + x, origin[1] + y, origin[2] + z], byte) {
                        changes.push((i as u32, byte, new));
                    }
                }
            }
        }
        if changes.is_empty() {
            return;
        }
        edit.cells += changes.len() as u64;
        let before = (changes.len() > MANY || matches!(chunk, Chunk::Uniform(_))).then(|| chunk.clone());
        let mut part = Part { chunk: index, change: Change::Cells(changes) };
        part.apply(self, Side::After);
        if let Some(before) = before {
            part.change = Change::Whole(before, self.chunk(index).clone());
        }
        edit.parts.push(part);
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Side {
    Before,
    After,
}

impl Part {
    fn apply(&self, voxels: &mut Voxels, side: Side) {
        match &self.change {
            Change::Whole(before, after) => {
                let chunk = if side == Side::Before { before } else { after };
                voxels.put_chunk(self.chunk, chunk.clone());
            }
            Change::Cells(changes) => {
                let cells = voxels.cells_mut(self.chunk);
                for &(i, before, after) in changes {
                    cells[i as usize] = if side == Side::Before { before } else { after };
                }
            }
        }
    }
}

impl Edit {
    /// Returns how many cells changed.
    #[must_use]
    pub fn cells(&self) -> u64 {
        self.cells
    }

    /// Changes back what the edit changed; of several the last must go first.
    pub fn undo(&self, voxels: &mut Voxels) {
        self.parts.iter().rev().for_each(|part| part.apply(voxels, Side::Before));
    }

    /// Makes the edit once more.
    pub fn redo(&self, voxels: &mut Voxels) {
        self.parts.iter().for_each(|part| part.apply(voxels, Side::After));
    }
}

/// Edits that were made, and those that were taken back.
#[derive(Clone, Debug, Default)]
pub struct History {
    done: Vec<Edit>,
    undone: Vec<Edit>,
}

impl History {
    /// Changes cells, see [`Voxels::edit`]; what was taken back before is then lost. Returns how many changed.
    pub fn edit(&mut self, voxels: &mut Voxels, region: &Region<'_>, brush: Brush) -> u64 {
        let edit = voxels.edit(region, brush);
        let cells = edit.cells();
        if cells > 0 {
            self.undone.clear();
            self.done.push(edit);
        }
        cells
    }

    /// Takes the last edit back; false where there is none.
    pub fn undo(&mut self, voxels: &mut Voxels) -> bool {
        let Some(edit) = self.done.pop() else { return false };
        edit.undo(voxels);
        self.undone.push(edit);
        true
    }

    /// Makes the edit that was taken back last once more; false where there is none.
    pub fn redo(&mut self, voxels: &mut Voxels) -> bool {
        let Some(edit) = self.undone.pop() else { return false };
        edit.redo(voxels);
        self.done.push(edit);
        true
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

    fn bytes(voxels: &Voxels) -> Vec<u8> {
        let [x, y, z] = voxels.size();
        (0..x * y * z).map(|i| voxels.get(i % x, i / x % y, i / (x * y))).collect()
    }

    #[test]
    fn edits_change_what_they_say_and_undo_gives_the_first_bytes_back() {
        let size = [100, 70, 130];
        let mut voxels = Voxels::from_fn(size, |x, y, z| u8::from((x + y + z) % 3 == 0) * 2);
        let first = (bytes(&voxels), voxels.clone());
        let mut expected = first.0.clone();
        let mut history = History::default();
        let mut later = Vec::new();
        for i in 0..300 {
            let place = |k: u32| std::array::from_fn(|a| hash(i * 16 + k + a as u32) % (size[a] + 10));
            let (from, to): ([u32; 3], [u32; 3]) = (place(0), place(4));
            let byte = (hash(i) % 4) as u8;
            let brush = [Brush::Set(byte), Brush::Fill(byte), Brush::Paint(byte)][i as usize % 3];
            let (center, radius) = (DVec3::from_array(from.map(f64::from)), f64::from(i % 13) * 0.7);
            let odd = |cell: [u32; 3], byte: u8| (cell[0] ^ cell[2]) % 2 == 1 && byte != 3;
            let region = match i % 4 {
                0 => Region::Cell(from),
                1 => Region::Box { from, to: std::array::from_fn(|a| from[a] + to[a] % 20) },
                2 => Region::Sphere { center, radius },
                _ => Region::Where { from: [0; 3], to, wanted: &odd },
            };
            let mut changed = 0;
            for (k, byte) in expected.iter_mut().enumerate() {
                let k = k as u32;
                let cell = [k % size[0], k / size[0] % size[1], k / (size[0] * size[1])];
                let within =
                    |from: [u32; 3], to: [u32; 3]| (0..3).all(|a| (from[a]..to[a]).contains(&cell[a]));
                let is_in = match region {
                    Region::Cell(at) => cell == at,
                    Region::Box { from, to } => within(from, to),
                    Region::Sphere { center, radius } => {
                        (DVec3::from_array(cell.map(f64::from)) + 0.5).distance(center) <= radius
                    }
                    Region::Where { from, to, .. } => within(from, to) && odd(cell, *byte),
                };
                if is_in && brush.paint(*byte) != *byte {
                    *byte = brush.paint(*byte);
                    changed += 1;
                }
            }
            assert_eq!(history.edit(&mut voxels, &region, brush), changed, "edit {i}");
            later.push(changed);
        }
        assert!(bytes(&voxels) == expected && later.iter().filter(|&&n| n > 0).count() > 150);
        let last = bytes(&voxels);
        while history.undo(&mut voxels) {}
        assert!(bytes(&voxels) == first.0);
        while history.redo(&mut voxels) {}
        assert!(bytes(&voxels) == last);
        assert!(bytes(&first.1) == first.0, "a clone keeps what it had");
    }

    #[test]
    fn wild_regions_change_what_lies_in_the_grid() {
        let mut voxels = Voxels::new([70, 5, 5]);
        let box_ = |from, to| Region::Box { from, to };
        assert_eq!(voxels.edit(&box_([60, 0, 0], [u32::MAX; 3]), Brush::Set(1)).cells(), 10 * 25);
        assert_eq!(voxels.edit(&box_([9, 0, 0], [3, 9, 9]), Brush::Set(1)).cells(), 0);
        assert_eq!(voxels.edit(&Region::Cell([u32::MAX; 3]), Brush::Set(1)).cells(), 0);
        for radius in [f64::NAN, f64::NEG_INFINITY, -1.0] {
            let region = Region::Sphere { center: DVec3::ZERO, radius };
            assert_eq!(voxels.edit(&region, Brush::Set(7)).cells(), 0);
        }
        let all = Region::Sphere { center: DVec3::ZERO, radius: f64::INFINITY };
        assert_eq!(voxels.edit(&all, Brush::Fill(7)).cells(), 60 * 25);
        assert_eq!(
            voxels.edit(&Region::Sphere { center: DVec3::NAN, radius: 9.0 }, Brush::Set(0)).cells(),
            0
        );
    }
}
