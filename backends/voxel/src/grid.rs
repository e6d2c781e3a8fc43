//! Which chunks make a grid, and which of them must be built anew after an edit?

use crate::occupancy::{Occupancy, Values};
use polyptych_core::parallel::{Threads, for_each_mut};
use polyptych_core::scene::{CHUNK, Chunk, Voxels};
use std::collections::HashMap;
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
    voxels: Voxels,
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
}

/// What a chunk's masks were built from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Recipe {
    source: Source,
    end: [u32; 3],
    seen: Values,
    blocking: Values,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Source {
    Uniform(u8),
    /// Address of the cells, which the entry keeps from being freed.
    Cells(usize),
}

#[derive(Clone, Debug)]
struct Built {
    seen: Option<Arc<Occupancy>>,
    blocking: Option<Arc<Occupancy>>,
    /// Keeps the address in the recipe from being used again.
    _cells: Chunk,
}

/// Masks of all chunks, kept from one `prepare` to the next by the identity of their cells, so that an edit costs
/// only the chunks that it touched.
#[derive(Debug, Default)]
pub(crate) struct Chunks {
    kept: HashMap<Recipe, Built>,
    used: HashMap<Recipe, Built>,
    nothing: Nothing,
    /// Chunks that had to be built since [`Chunks::begin`].
    pub(crate) built: u64,
}

/// The masks of every empty chunk.
#[derive(Debug)]
struct Nothing(Arc<Occupancy>);

impl Default for Nothing {
    fn default() -> Self {
        Self(Arc::new(Occupancy::EMPTY))
    }
}

impl Chunks {
    /// Begins a new collection: what [`Chunks::grid`] does not ask for until [`Chunks::end`] is dropped.
    pub(crate) fn begin(&mut self) {
        self.kept.extend(self.used.drain());
        self.built = 0;
    }

    /// Ends the collection.
    pub(crate) fn end(&mut self) {
        self.kept.clear();
    }

    /// Returns the bytes held by all chunks.
    pub(crate) fn bytes(&self) -> u64 {
        let masks = self.used.values().map(|b| match (&b.seen, &b.blocking) {
            (Some(a), Some(b)) if !Arc::ptr_eq(a, b) => 2,
            (None, None) => 0,
            _ => 1,
        });
        masks.sum::<u64>() * size_of::<Occupancy>() as u64
    }

    /// Makes a grid ready; `seen` are the values that may be seen, `blocking` those that may block light.
    pub(crate) fn grid(
        &mut self,
        voxels: &Voxels,
        seen: Values,
        blocking: Values,
        threads: &dyn Threads,
    ) -> Grid {
        let recipes: Vec<Option<Recipe>> = (0..voxels.chunks().len())
            .map(|index| {
                let first = voxels.chunk_origin(index);
                let source = match &voxels.chunks()[index] {
                    Chunk::Uniform(0) => return None,
                    Chunk::Uniform(value) => Source::Uniform(*value),
                    Chunk::Cells(cells) => Source::Cells(cells.as_ptr().addr()),
                };
                let end = std::array::from_fn(|a| CHUNK.min(voxels.size()[a] - first[a]));
                Some(Recipe { source, end, seen, blocking })
            })
            .collect();
        self.build(voxels, &recipes, threads);
        let [cx, cy, _] = voxels.chunks_per_axis().map(|c| c as usize);
        let layer = |pick: fn(&Built) -> &Option<Arc<Occupancy>>| Layer {
            size: voxels.size().map(|s| s as i32),
            row: cx,
            slab: cx * cy,
            chunks: recipes
                .iter()
                .map(|r| pick(self.used.get(r.as_ref()?)?).clone())
                .map(|masks| masks.unwrap_or_else(|| self.nothing.0.clone()))
                .collect(),
        };
        Grid { seen: layer(|b| &b.seen), blocking: layer(|b| &b.blocking), voxels: voxels.clone() }
    }

    /// Builds what is not there yet.
    fn build(&mut self, voxels: &Voxels, recipes: &[Option<Recipe>], threads: &dyn Threads) {
        let mut missing: Vec<(Recipe, &Chunk, Option<Built>)> = Vec::new();
        let mut asked = std::collections::HashSet::new();
        for (recipe, chunk) in recipes.iter().zip(voxels.chunks()) {
            let Some(recipe) = recipe else { continue };
            if self.used.contains_key(recipe) || !asked.insert(*recipe) {
                continue;
            }
            match self.kept.remove(recipe) {
                Some(built) => drop(self.used.insert(*recipe, built)),
                None => missing.push((*recipe, chunk, None)),
            }
        }
        self.built += missing.len() as u64;
        for_each_mut(threads, &mut missing, 1, &|_, (recipe, chunk, built)| {
            *built = Some(Built::new(recipe, chunk));
        });
        self.used.extend(missing.into_iter().filter_map(|(recipe, _, built)| Some((recipe, built?))));
    }
}

impl Built {
    fn new(recipe: &Recipe, chunk: &Chunk) -> Self {
        let marks = |values| Occupancy::of(chunk, recipe.end, values).map(Arc::from);
        let seen: Option<Arc<Occupancy>> = marks(&recipe.seen);
        // Most chunks hold nothing that is seen but lets light through: then both are one.
        let blocking = if recipe.seen == recipe.blocking { seen.clone() } else { marks(&recipe.blocking) };
        let blocking = if blocking == seen { seen.clone() } else { blocking };
        Self { seen, blocking, _cells: chunk.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use polyptych_core::parallel::OneThread;

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
