//! A grid of palette bytes in copy-on-write chunks.

use crate::math::Aabb;
use glam::DVec3;
use std::sync::Arc;

/// Edge of a chunk in cells.
pub const CHUNK: u32 = 64;

/// A grid of any size; cell `(x, y, z)` fills `[x, x+1] x [y, y+1] x [z, z+1]` in object space.
///
/// Byte 0 is empty; byte `v` has the material of slot `v - 1`. Cells live in chunks of 64^3 that clones
/// share until one of them is edited, and these in groups that clones share as well: an edit of a large grid copies
/// what it touches.
#[derive(Clone, Debug)]
pub struct Voxels {
    size: [u32; 3],
    chunks_per_axis: [u32; 3],
    /// All but the last are full.
    groups: Vec<Arc<[Chunk]>>,
}

impl Chunk {
    /// Tells whether two chunks are one: the same byte throughout, or the same cells in memory.
    #[must_use]
    #[inline]
    pub fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Uniform(a), Self::Uniform(b)) => a == b,
            (Self::Cells(a), Self::Cells(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

/// 64^3 cells.
#[derive(Clone, Debug)]
pub enum Chunk {
    /// All cells hold this byte.
    Uniform(u8),
    /// One byte a cell, x fastest, then y, then z.
    Cells(Arc<[u8]>),
}

const CHUNK_CELLS: usize = (CHUNK * CHUNK * CHUNK) as usize;
/// Chunks in a group.
const GROUP: usize = 64;

impl Voxels {
    /// Builds an empty grid.
    ///
    /// # Panics
    /// When the number of chunks does not fit into memory's address range; loaders check sizes before.
    #[must_use]
    pub fn new(size: [u32; 3]) -> Self {
        let count = size.iter().map(|s| s.div_ceil(CHUNK) as usize).product();
        Self::of(size, &vec![Chunk::Uniform(0); count])
    }

    fn of(size: [u32; 3], chunks: &[Chunk]) -> Self {
        let groups = chunks.chunks(GROUP).map(Arc::from).collect();
        Self { size, chunks_per_axis: size.map(|s| s.div_ceil(CHUNK)), groups }
    }

    /// Builds a grid from bytes, x fastest, then y, then z.
    ///
    /// # Panics
    /// When the number of bytes is not the product of the sizes.
    #[must_use]
    pub fn from_bytes(size: [u32; 3], bytes: &[u8]) -> Self {
        let [nx, ny, nz] = size.map(|s| s as usize);
        assert_eq!(bytes.len(), nx * ny * nz, "bytes of a {nx}x{ny}x{nz} grid");
        let mut grid = Self::new(size);
        for index in 0..grid.chunk_count() {
            let first = grid.chunk_origin(index);
            let end: [u32; 3] = std::array::from_fn(|a| CHUNK.min(size[a] - first[a]));
            let mut cells = vec![0u8; CHUNK_CELLS];
            for z in 0..end[2] {
                for y in 0..end[1] {
                    let from = ((first[2] + z) as usize * ny + (first[1] + y) as usize) * nx;
                    let row = &bytes[from + first[0] as usize..][..end[0] as usize];
                    cells[cell_index(0, y, z)..][..row.len()].copy_from_slice(row);
                }
            }
            // Cells beyond the grid are empty: only whole chunks are one value.
            let is_one = cells.iter().all(|&b| b == cells[0]);
            *grid.chunk_mut(index) =
                if is_one { Chunk::Uniform(cells[0]) } else { Chunk::Cells(cells.into()) };
        }
        grid
    }

    /// Builds a grid by asking for each cell's byte.
    #[must_use]
    pub fn from_fn(size: [u32; 3], cell: impl Fn(u32, u32, u32) -> u8) -> Self {
        let mut grid = Self::new(size);
        for index in 0..grid.chunk_count() {
            let first = grid.chunk_origin(index);
            let mut bytes = vec![0u8; CHUNK_CELLS];
            for z in 0..CHUNK.min(size[2] - first[2]) {
                for y in 0..CHUNK.min(size[1] - first[1]) {
                    for x in 0..CHUNK.min(size[0] - first[0]) {
                        bytes[cell_index(x, y, z)] = cell(first[0] + x, first[1] + y, first[2] + z);
                    }
                }
            }
            *grid.chunk_mut(index) =
                if bytes.iter().all(|&b| b == 0) { Chunk::Uniform(0) } else { Chunk::Cells(bytes.into()) };
        }
        grid
    }

    /// Puts a grid together from [`Voxels::chunks`].
    ///
    /// # Errors
    /// When the number of chunks, or of cells in one, does not fit.
    pub fn from_chunks(size: [u32; 3], chunks: &[Chunk]) -> Result<Self, String> {
        let count = size.iter().map(|s| u128::from(s.div_ceil(CHUNK))).product::<u128>();
        if chunks.len() as u128 != count {
            return Err(format!("{} chunks where {count} are needed", chunks.len()));
        }
        if chunks.iter().any(|c| matches!(c, Chunk::Cells(cells) if cells.len() != CHUNK_CELLS)) {
            return Err(format!("a chunk without its {CHUNK_CELLS} cells"));
        }
        Ok(Self::of(size, chunks))
    }

    /// Returns the number of cells along each axis.
    #[must_use]
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Returns the number of chunks along each axis.
    #[must_use]
    pub fn chunks_per_axis(&self) -> [u32; 3] {
        self.chunks_per_axis
    }

    /// Returns the number of chunks.
    #[must_use]
    pub fn chunk_count(&self) -> usize {
        self.chunks_per_axis.iter().map(|&c| c as usize).product()
    }

    /// Returns the chunks, x fastest, then y, then z.
    pub fn chunks(&self) -> impl Iterator<Item = &Chunk> {
        self.groups.iter().flat_map(|group| group.iter())
    }

    /// Returns a chunk by its number among [`Voxels::chunks`].
    ///
    /// # Panics
    /// When there are less.
    #[must_use]
    #[inline]
    pub fn chunk(&self, index: usize) -> &Chunk {
        &self.groups[index / GROUP][index % GROUP]
    }

    fn chunk_mut(&mut self, index: usize) -> &mut Chunk {
        &mut Arc::make_mut(&mut self.groups[index / GROUP])[index % GROUP]
    }

    /// Lists the numbers of the chunks that are not those of another grid of this size.
    pub fn changed_from<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = usize> + 'a {
        let groups = self.groups.iter().zip(&other.groups).enumerate();
        groups.filter(|(_, (new, old))| !Arc::ptr_eq(new, old)).flat_map(|(group, (new, old))| {
            let chunks = new.iter().zip(old.iter()).enumerate();
            chunks.filter(|(_, (new, old))| !new.is_same(old)).map(move |(i, _)| group * GROUP + i)
        })
    }

    /// Returns the first cell of a chunk.
    #[must_use]
    pub fn chunk_origin(&self, index: usize) -> [u32; 3] {
        let (cx, cy) = (self.chunks_per_axis[0] as usize, self.chunks_per_axis[1] as usize);
        [index % cx, index / cx % cy, index / (cx * cy)].map(|c| c as u32 * CHUNK)
    }

    /// Returns the byte of a cell; cells outside are empty.
    #[must_use]
    #[inline]
    pub fn get(&self, x: u32, y: u32, z: u32) -> u8 {
        if x >= self.size[0] || y >= self.size[1] || z >= self.size[2] {
            return 0;
        }
        match self.chunk(self.index_of_chunk([x, y, z].map(|c| c / CHUNK))) {
            Chunk::Uniform(value) => *value,
            Chunk::Cells(cells) => cells[cell_index(x % CHUNK, y % CHUNK, z % CHUNK)],
        }
    }

    /// Sets the byte of a cell; cells outside are left alone.
    pub fn set(&mut self, x: u32, y: u32, z: u32, value: u8) {
        if x >= self.size[0] || y >= self.size[1] || z >= self.size[2] || self.get(x, y, z) == value {
            return;
        }
        self.cells_mut(self.index_of_chunk([x, y, z].map(|c| c / CHUNK)))
            [cell_index(x % CHUNK, y % CHUNK, z % CHUNK)] = value;
    }

    /// Returns the cells of a chunk to be changed: a copy, where a clone of the grid holds them, too.
    pub(super) fn cells_mut(&mut self, index: usize) -> &mut [u8] {
        let chunk = self.chunk_mut(index);
        if let Chunk::Uniform(all) = *chunk {
            *chunk = Chunk::Cells(std::iter::repeat_n(all, CHUNK_CELLS).collect());
        }
        let Chunk::Cells(cells) = chunk else { unreachable!("the chunk was just given cells") };
        Arc::make_mut(cells)
    }

    /// Returns the number of a chunk among [`Voxels::chunks`] by its place among them.
    #[must_use]
    #[inline]
    pub fn index_of_chunk(&self, [x, y, z]: [u32; 3]) -> usize {
        let (cx, cy) = (self.chunks_per_axis[0] as usize, self.chunks_per_axis[1] as usize);
        (z as usize * cy + y as usize) * cx + x as usize
    }

    /// Puts a chunk in the place of another.
    ///
    /// # Panics
    /// When there is no such chunk, or it has not as many cells as a chunk has.
    pub fn put_chunk(&mut self, index: usize, chunk: Chunk) {
        assert!(
            matches!(&chunk, Chunk::Uniform(_))
                || matches!(&chunk, Chunk::Cells(cells) if cells.len() == CHUNK_CELLS),
            "a chunk has {CHUNK_CELLS} cells"
        );
        *self.chunk_mut(index) = chunk;
    }

    /// Bounds the whole grid, empty cells included.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        if self.size.contains(&0) {
            return Aabb::EMPTY;
        }
        Aabb::new(DVec3::ZERO, DVec3::from_array(self.size.map(f64::from)))
    }

    /// Calls `visit` for every filled cell, chunk by chunk.
    pub fn for_each_filled(&self, mut visit: impl FnMut([u32; 3], u8)) {
        for (index, chunk) in self.chunks().enumerate() {
            if matches!(chunk, Chunk::Uniform(0)) {
                continue;
            }
            let first = self.chunk_origin(index);
            let end: [u32; 3] = std::array::from_fn(|a| CHUNK.min(self.size[a] - first[a]));
            for z in 0..end[2] {
                for y in 0..end[1] {
                    for x in 0..end[0] {
                        let value = match chunk {
                            Chunk::Uniform(value) => *value,
                            Chunk::Cells(cells) => cells[cell_index(x, y, z)],
                        };
                        if value != 0 {
                            visit([first[0] + x, first[1] + y, first[2] + z], value);
                        }
                    }
                }
            }
        }
    }

    /// Returns the number of filled cells.
    #[must_use]
    pub fn filled(&self) -> u64 {
        let mut count = 0;
        self.for_each_filled(|_, _| count += 1);
        count
    }

    /// Lists the filled cells whose byte is wanted and that have at least one empty neighbor.
    pub fn exposed_where(&self, wanted: impl Fn(u8) -> bool) -> Vec<([u32; 3], u8)> {
        let wanted: [bool; 256] = std::array::from_fn(|v| v != 0 && wanted(v as u8));
        let mut cells = Vec::new();
        if wanted.contains(&true) {
            self.for_each_filled(|[x, y, z], value| {
                let open = |dx: i32, dy: i32, dz: i32| {
                    self.get(x.wrapping_add_signed(dx), y.wrapping_add_signed(dy), z.wrapping_add_signed(dz))
                        == 0
                };
                if wanted[usize::from(value)]
                    && (open(1, 0, 0)
                        || open(-1, 0, 0)
                        || open(0, 1, 0)
                        || open(0, -1, 0)
                        || open(0, 0, 1)
                        || open(0, 0, -1))
                {
                    cells.push(([x, y, z], value));
                }
            });
        }
        cells
    }

    /// Returns the box around the cells that hold something, one meter to a cell; empty where there is none.
    #[must_use]
    pub fn filled_bounds(&self) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for (index, chunk) in self.chunks().enumerate() {
            let first = self.chunk_origin(index);
            let end: [u32; 3] = std::array::from_fn(|a| CHUNK.min(self.size[a] - first[a]));
            let place =
                |cell: [u32; 3]| DVec3::from_array(std::array::from_fn(|a| f64::from(first[a] + cell[a])));
            let whole = Aabb::new(place([0; 3]), place(end));
            match chunk {
                Chunk::Uniform(0) => {}
                // What lies within the box already cannot make it larger.
                _ if bounds.with(whole.min).with(whole.max) == bounds => {}
                Chunk::Uniform(_) => bounds = bounds.with(whole.min).with(whole.max),
                Chunk::Cells(cells) => {
                    for z in 0..end[2] {
                        for y in 0..end[1] {
                            let row = &cells[cell_index(0, y, z)..][..end[0] as usize];
                            let Some(from) = row.iter().position(|&b| b != 0) else { continue };
                            let to = row.iter().rposition(|&b| b != 0).unwrap_or(from);
                            bounds = bounds.with(place([from as u32, y, z])).with(place([
                                to as u32 + 1,
                                y + 1,
                                z + 1,
                            ]));
                        }
                    }
                }
            }
        }
        bounds
    }

    /// Returns the bytes held, chunks shared with clones counted in full.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.chunks()
            .map(|c| match c {
                Chunk::Uniform(_) => 16,
                Chunk::Cells(cells) => cells.len() as u64 + 16,
            })
            .sum()
    }
}

/// Returns where a cell lies in [`Chunk::Cells`]; coordinates are within the chunk.
pub(super) fn cell_index(x: u32, y: u32, z: u32) -> usize {
    ((z * CHUNK + y) * CHUNK + x) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_around_what_is_there_is_no_larger() {
        let mut grid = Voxels::new([130, 70, 66]);
        assert!(grid.filled_bounds().is_empty());
        let low = DVec3::new(3.0, 5.0, 7.0);
        grid.set(3, 5, 7, 9);
        assert_eq!(grid.filled_bounds(), Aabb::new(low, low + 1.0));
        grid.set(129, 69, 64, 1);
        assert_eq!(grid.filled_bounds(), Aabb::new(low, DVec3::new(130.0, 70.0, 65.0)));
        let full = Voxels::from_bytes([64; 3], &[4; 64 * 64 * 64]);
        assert_eq!(full.bytes(), 16, "a chunk of one value is that value");
        assert_eq!(full.filled_bounds(), Aabb::new(DVec3::ZERO, DVec3::splat(64.0)));
    }

    #[test]
    fn cells_read_back_over_chunk_borders() {
        let size = [65, 3, 130];
        let value = |x: u32, y: u32, z: u32| ((x * 7 + y * 5 + z * 3) % 251) as u8;
        let grid = Voxels::from_fn(size, value);
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    assert_eq!(grid.get(x, y, z), value(x, y, z));
                }
            }
        }
        assert_eq!(grid.get(65, 0, 0), 0);
    }

    #[test]
    fn an_edit_leaves_the_clone_alone_and_shares_the_rest() {
        let before = Voxels::from_fn([128, 64, 64], |_, _, _| 1);
        let mut after = before.clone();
        after.set(3, 4, 5, 9);
        assert_eq!((before.get(3, 4, 5), after.get(3, 4, 5)), (1, 9));
        assert!(before.chunk(1).is_same(after.chunk(1)), "the chunk that was not edited is shared");
    }

    #[test]
    fn an_edit_of_a_large_grid_leaves_the_other_groups_shared() {
        let before = Voxels::new([1024, 64, 1024]);
        let mut after = before.clone();
        assert_eq!(after.changed_from(&before).count(), 0);
        after.set(1000, 4, 5, 9);
        after.set(3, 4, 700, 9);
        assert_eq!(after.changed_from(&before).collect::<Vec<_>>(), [15, 160]);
        let shared = before.groups.iter().zip(&after.groups).filter(|(a, b)| Arc::ptr_eq(a, b)).count();
        assert_eq!((before.groups.len(), shared), (4, 2), "groups of {GROUP} chunks");
        assert_eq!(before.chunk_count(), before.chunks().count());
    }
}
