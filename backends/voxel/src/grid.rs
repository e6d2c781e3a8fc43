//! Which chunks make a grid, and which of them must be built anew after an edit?

use crate::occupancy::{Occupancy, Values};
use polyptych_core::parallel::{Threads, for_each_mut};
use polyptych_core::scene::{CHUNK, Chunk, Voxels};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Cells of a grid that hold one of some values.
#[derive(Clone, Debug)]
pub(crate) struct Layer {
    pub(crate) size: [i32; 3],
    /// Chunks in a row along x, and in a slab of x and y.
    pub(crate) row: usize,
    pub(crate) slab: usize,
    /// Empty chunks share the masks of one.
    pub(crate) chunks: Vec<Arc<Occupancy>>,
}

impl Layer {
    /// Returns the exponent of an empty block around a cell of the grid, or nothing when the cell is marked.
    #[inline(always)]
    pub(crate) fn empty_around(&self, cell: [i32; 3]) -> Option<u32> {
        let [x, y, z] = [cell[0] as u32, cell[1] as u32, cell[2] as u32];
        let chunk = |c: u32| (c / CHUNK) as usize;
        self.chunks[chunk(z) * self.slab + chunk(y) * self.row + chunk(x)].empty_around([x, y, z])
    }

    /// Tells whether anything is marked in the aligned block of 2^2, 2^4 or 2^6 cells at a cell; false beyond the
    /// grid.
    pub(crate) fn has_block(&self, cell: [i32; 3], exponent: u32) -> bool {
        if (0..3).any(|a| cell[a] >= self.size[a]) {
            return false;
        }
        let [x, y, z] = [cell[0] as u32, cell[1] as u32, cell[2] as u32];
        let chunk = |c: u32| (c / CHUNK) as usize;
        self.chunks[chunk(z) * self.slab + chunk(y) * self.row + chunk(x)].has_block([x, y, z], exponent)
    }

    fn bytes(&self) -> u64 {
        (self.chunks.len() * size_of::<Arc<Occupancy>>()) as u64
    }
}

/// A grid made ready to be walked.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    /// Cells that may be seen.
    pub(crate) seen: Layer,
    /// Cells that may block light.
    pub(crate) blocking: Layer,
    /// Which bytes may be seen, and which may block light.
    values: [Values; 2],
    voxels: Voxels,
    /// How many masks of chunks there are; chunks may share them.
    masks: u64,
}

impl Grid {
    /// Longest edge in cells: whole numbers and their halves must fit coordinates of 32 bits.
    pub(crate) const LONGEST: u32 = 1 << 30;

    /// Returns the byte of a cell.
    #[inline(always)]
    pub(crate) fn value(&self, cell: [i32; 3]) -> u8 {
        let [x, y, z] = [cell[0] as u32, cell[1] as u32, cell[2] as u32];
        self.voxels.get(x, y, z)
    }

    /// Returns the bytes held, chunks that are shared not counted.
    pub(crate) fn bytes(&self) -> u64 {
        self.seen.bytes() + self.blocking.bytes() + self.voxels.chunks().len() as u64 * 16
    }

    /// Counts the masks that a chunk shares with no other.
    fn own_masks(&self, index: usize) -> u64 {
        let [seen, blocking] = [&self.seen.chunks[index], &self.blocking.chunks[index]];
        let is_one = Arc::ptr_eq(seen, blocking);
        let is_own =
            |masks: &Arc<Occupancy>| !masks.is_empty() && Arc::strong_count(masks) == 1 + usize::from(is_one);
        u64::from(is_own(seen)) + u64::from(!is_one && is_own(blocking))
    }

    /// Returns how many cells of a chunk lie in the grid along each axis.
    fn end(voxels: &Voxels, index: usize) -> [u32; 3] {
        let first = voxels.chunk_origin(index);
        std::array::from_fn(|a| CHUNK.min(voxels.size()[a] - first[a]))
    }

    /// Takes over a chunk that became another.
    fn update(&mut self, index: usize, chunk: &Chunk, nothing: &Arc<Occupancy>) {
        let end = Self::end(&self.voxels, index);
        let own = self.own_masks(index);
        let is_one = Arc::ptr_eq(&self.seen.chunks[index], &self.blocking.chunks[index]);
        let [seen, blocking] = self.values;
        let old = self.voxels.chunks()[index].clone();
        // What lets light through may come in with the edit: then both layers part.
        let differs = seen != blocking && !is_one;
        let renew = |layer: &mut Layer, values: &Values| {
            let masks = &mut layer.chunks[index];
            if let (Chunk::Cells(old), Chunk::Cells(new)) = (&old, chunk) {
                Arc::make_mut(masks).renew((old, new), end, values);
            } else {
                *masks = Occupancy::of(chunk, end, values).map_or_else(|| nothing.clone(), Arc::from);
            }
            if masks.is_empty() {
                *masks = nothing.clone();
            }
        };
        renew(&mut self.seen, &seen);
        if seen == blocking {
            self.blocking.chunks[index] = self.seen.chunks[index].clone();
        } else if differs {
            renew(&mut self.blocking, &blocking);
        } else {
            let masks = Occupancy::of(chunk, end, &blocking).map_or_else(|| nothing.clone(), Arc::from);
            let same = masks == self.seen.chunks[index];
            self.blocking.chunks[index] = if same { self.seen.chunks[index].clone() } else { masks };
        }
        self.voxels.put_chunk(index, chunk.clone());
        self.masks = (self.masks + self.own_masks(index)).saturating_sub(own);
    }
}

/// What a chunk's masks were built from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Recipe {
    source: Source,
    end: [u32; 3],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Source {
    Uniform(u8),
    /// Address of the cells, which a grid keeps from being freed.
    Cells(usize),
}

/// Masks of what is seen, and of what blocks light.
type Built = [Arc<Occupancy>; 2];

impl Recipe {
    /// Nothing for an empty chunk.
    fn of(voxels: &Voxels, index: usize) -> Option<Self> {
        let source = match &voxels.chunks()[index] {
            Chunk::Uniform(0) => return None,
            Chunk::Uniform(value) => Source::Uniform(*value),
            Chunk::Cells(cells) => Source::Cells(cells.as_ptr().addr()),
        };
        Some(Self { source, end: Grid::end(voxels, index) })
    }
}

/// Grids with the masks of their chunks, kept from one `prepare` to the next. A grid that became another by edits is
/// changed where they are; of one whose chunks are at other places masks are found again by the identity of cells.
#[derive(Debug)]
pub(crate) struct Chunks {
    kept: Vec<Arc<Grid>>,
    used: Vec<Arc<Grid>>,
    nothing: Arc<Occupancy>,
    /// Chunks that had to be built since [`Chunks::begin`].
    pub(crate) built: u64,
}

impl Default for Chunks {
    fn default() -> Self {
        Self { kept: Vec::new(), used: Vec::new(), nothing: Arc::new(Occupancy::EMPTY), built: 0 }
    }
}

impl Chunks {
    /// Begins a new collection: what [`Chunks::grid`] does not ask for until [`Chunks::end`] is dropped.
    pub(crate) fn begin(&mut self) {
        self.kept.append(&mut self.used);
        self.built = 0;
    }

    /// Ends the collection.
    pub(crate) fn end(&mut self) {
        self.kept.clear();
    }

    /// Returns the bytes of all masks.
    pub(crate) fn bytes(&self) -> u64 {
        self.used.iter().map(|grid| grid.masks).sum::<u64>() * size_of::<Occupancy>() as u64
    }

    /// Makes a grid ready; `seen` are the values that may be seen, `blocking` those that may block light.
    pub(crate) fn grid(
        &mut self,
        voxels: &Voxels,
        seen: Values,
        blocking: Values,
        threads: &dyn Threads,
    ) -> Arc<Grid> {
        let values = [seen, blocking];
        let grid =
            self.edited(voxels, values).unwrap_or_else(|| Arc::new(self.build(voxels, values, threads)));
        self.used.push(grid.clone());
        grid
    }

    /// Changes a grid of before, if there is one that most chunks are those of.
    fn edited(&mut self, voxels: &Voxels, values: [Values; 2]) -> Option<Arc<Grid>> {
        let changed_of = |old: &Grid| -> Vec<usize> {
            let pairs = voxels.chunks().iter().zip(old.voxels.chunks()).enumerate();
            pairs.filter(|(_, (new, old))| !new.is_same(old)).map(|(i, _)| i).take(MOST_EDITED + 1).collect()
        };
        let (at, changed) = self.kept.iter().enumerate().find_map(|(at, old)| {
            let is_alike = old.voxels.size() == voxels.size() && old.values == values;
            let changed = is_alike.then(|| changed_of(old))?;
            (changed.len() <= MOST_EDITED).then_some((at, changed))
        })?;
        let mut grid = self.kept.swap_remove(at);
        if !changed.is_empty() {
            let grid = Arc::make_mut(&mut grid);
            for &index in &changed {
                grid.update(index, &voxels.chunks()[index], &self.nothing);
            }
        }
        self.built += changed.len() as u64;
        Some(grid)
    }

    /// Builds a grid; masks of chunks that grids of before had, too, are theirs.
    fn build(&mut self, voxels: &Voxels, values: [Values; 2], threads: &dyn Threads) -> Grid {
        let mut known: HashMap<Recipe, Built> = HashMap::new();
        for old in self.kept.iter().chain(&self.used).filter(|old| old.values == values) {
            for index in 0..old.voxels.chunks().len() {
                if let Some(recipe) = Recipe::of(&old.voxels, index) {
                    let masks = [old.seen.chunks[index].clone(), old.blocking.chunks[index].clone()];
                    known.insert(recipe, masks);
                }
            }
        }
        let recipes: Vec<Option<Recipe>> =
            (0..voxels.chunks().len()).map(|index| Recipe::of(voxels, index)).collect();
        let mut missing: Vec<(Recipe, &Chunk, Option<Built>)> = Vec::new();
        let mut asked = HashSet::new();
        for (recipe, chunk) in recipes.iter().zip(voxels.chunks()) {
            if let Some(recipe) = recipe
                && !known.contains_key(recipe)
                && asked.insert(*recipe)
            {
                missing.push((*recipe, chunk, None));
            }
        }
        self.built += missing.len() as u64;
        let nothing = &self.nothing;
        for_each_mut(threads, &mut missing, 1, &|_, (recipe, chunk, built)| {
            let marks =
                |values| Occupancy::of(chunk, recipe.end, values).map_or_else(|| nothing.clone(), Arc::from);
            let seen: Arc<Occupancy> = marks(&values[0]);
            // Most chunks hold nothing that is seen but lets light through: then both are one.
            let blocking = if values[0] == values[1] { seen.clone() } else { marks(&values[1]) };
            let blocking = if blocking == seen { seen.clone() } else { blocking };
            *built = Some([seen, blocking]);
        });
        known.extend(missing.into_iter().filter_map(|(recipe, _, built)| Some((recipe, built?))));
        let [cx, cy, _] = voxels.chunks_per_axis().map(|c| c as usize);
        let layer = |which: usize| Layer {
            size: voxels.size().map(|s| s as i32),
            row: cx,
            slab: cx * cy,
            chunks: recipes
                .iter()
                .map(|r| r.as_ref().and_then(|r| known.get(r)).map_or(&self.nothing, |b| &b[which]).clone())
                .collect(),
        };
        let (seen, blocking) = (layer(0), layer(1));
        let masks = seen.chunks.iter().chain(&blocking.chunks).filter(|masks| !masks.is_empty());
        let masks: HashSet<usize> = masks.map(|masks| Arc::as_ptr(masks).addr()).collect();
        Grid { seen, blocking, values, voxels: voxels.clone(), masks: masks.len() as u64 }
    }
}

/// A grid of which more chunks became others is built anew, by many threads.
const MOST_EDITED: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use polyptych_core::parallel::OneThread;
    use polyptych_core::scene::{Brush, Region};

    #[test]
    fn an_edit_builds_one_chunk() {
        let all = Values::of(|_| true);
        let mut voxels = Voxels::from_fn([130, 70, 65], |x, y, z| u8::from((x + y + z) % 7 == 0));
        let mut chunks = Chunks::default();
        let mut prepare = |voxels: &Voxels| {
            chunks.begin();
            let grid = chunks.grid(voxels, all, all, &OneThread);
            chunks.end();
            (chunks.built, grid)
        };
        assert_eq!(prepare(&voxels).0, 12);
        assert_eq!(prepare(&voxels).0, 0);
        voxels.set(129, 69, 64, 5);
        let (built, grid) = prepare(&voxels);
        assert_eq!((built, grid.value([129, 69, 64])), (1, 5));
        assert_eq!(grid.seen.empty_around([129, 69, 64]), None);
    }

    /// A grid that was edited is the grid that is built of the edited cells.
    #[test]
    fn edits_leave_the_masks_that_building_anew_gives() {
        let (all, solid) = (Values::of(|_| true), Values::of(|v| v != 3));
        let size = [130, 70, 65];
        let mut voxels =
            Voxels::from_fn(size, |x, y, z| u8::from((x * y + z) % 97 == 0) * (1 + (x % 3) as u8));
        let mut chunks = Chunks::default();
        let mut state = 5u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        for round in 0..60 {
            chunks.begin();
            let grid = chunks.grid(&voxels, all, solid, &OneThread);
            chunks.end();
            let anew = Chunks::default().grid(&voxels, all, solid, &OneThread);
            for (layer, other) in [(&grid.seen, &anew.seen), (&grid.blocking, &anew.blocking)] {
                assert!(layer.chunks == other.chunks, "round {round}");
            }
            drop(grid);
            let from = [random(130), random(70), random(65)];
            let region =
                Region::Box { from, to: from.map(|c| c + 1 + random(if round % 9 == 0 { 70 } else { 5 })) };
            let brush = [Brush::Set(random(5) as u8), Brush::Paint(3), Brush::Fill(1), Brush::Set(0)];
            voxels.edit(&region, brush[round as usize % 4]);
        }
    }

    #[test]
    fn both_layers_share_masks_where_nothing_is_clear() {
        let voxels = Voxels::from_fn([128, 4, 4], |x, _, _| if x < 64 { 1 } else { 2 });
        let mut chunks = Chunks::default();
        let grid = chunks.grid(&voxels, Values::of(|_| true), Values::of(|v| v == 1), &OneThread);
        let same = |i: usize| Arc::ptr_eq(&grid.seen.chunks[i], &grid.blocking.chunks[i]);
        assert_eq!((same(0), same(1)), (true, false));
        assert_eq!(*grid.blocking.chunks[1], Occupancy::EMPTY);
    }
}
