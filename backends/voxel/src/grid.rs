//! Which chunks make a grid, and which of them must be built anew after an edit?

use crate::masks::Masks;
use crate::occupancy::{Nodes, Occupancy, Values};
use polyptych_core::scene::{CHUNK, Chunk, Voxels};
use polyptych_core::seam::{Cancelled, Control};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Cells of a grid that hold one of some values.
#[derive(Clone, Debug)]
pub(crate) struct Layer {
    pub(crate) size: [i32; 3],
    /// Chunks in a row along x, and in a slab of x and y.
    pub(crate) row: usize,
    pub(crate) slab: usize,
    /// Where the masks of each chunk are; empty ones show [`Masks::NOTHING`].
    pub(crate) slots: Vec<u32>,
    /// Those of all layers of a grid.
    pub(crate) masks: Arc<Masks>,
}

impl Layer {
    /// Returns the exponent of an empty block around a cell of the grid, or nothing when the cell is marked.
    #[inline(always)]
    pub(crate) fn empty_around(&self, cell: [i32; 3]) -> Option<u32> {
        let [x, y, z] = [cell[0] as u32, cell[1] as u32, cell[2] as u32];
        let chunk = |c: u32| (c / CHUNK) as usize;
        self.nodes(chunk(z) * self.slab + chunk(y) * self.row + chunk(x)).empty_around([x, y, z])
    }

    /// Tells whether anything is marked in the aligned block of 2^2, 2^4 or 2^6 cells at a cell; false beyond the
    /// grid.
    pub(crate) fn has_block(&self, cell: [i32; 3], exponent: u32) -> bool {
        if (0..3).any(|a| cell[a] >= self.size[a]) {
            return false;
        }
        let [x, y, z] = [cell[0] as u32, cell[1] as u32, cell[2] as u32];
        let chunk = |c: u32| (c / CHUNK) as usize;
        self.nodes(chunk(z) * self.slab + chunk(y) * self.row + chunk(x)).has_block([x, y, z], exponent)
    }

    /// Returns the masks of a chunk.
    #[inline(always)]
    pub(crate) fn nodes(&self, chunk: usize) -> Nodes<'_> {
        self.masks.nodes(self.slots[chunk])
    }

    fn bytes(&self) -> u64 {
        (self.slots.len() * size_of::<u32>()) as u64
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
        self.seen.bytes() + self.blocking.bytes() + self.voxels.chunk_count() as u64 * 16
    }

    /// Returns how many cells of a chunk lie in the grid along each axis.
    fn end(voxels: &Voxels, index: usize) -> [u32; 3] {
        let first = voxels.chunk_origin(index);
        std::array::from_fn(|a| CHUNK.min(voxels.size()[a] - first[a]))
    }

    /// Takes over chunks that became others.
    fn update(&mut self, changed: &[usize], voxels: &Voxels) {
        // Both layers hold the table: only who holds it alone may change it where it is.
        self.blocking.masks = Arc::new(Masks::NONE);
        let masks = Arc::make_mut(&mut self.seen.masks);
        let [seen, blocking] = self.values;
        for &index in changed {
            let (old, chunk) = (self.voxels.chunk(index), voxels.chunk(index));
            let end = Self::end(&self.voxels, index);
            let renew = |masks: &mut Masks, slot: u32, values: &Values| {
                if let (Chunk::Cells(old), Chunk::Cells(new)) = (old, chunk) {
                    return masks.change(slot, |nodes| nodes.renew((old, new), end, values));
                }
                masks.hide(slot);
                let slot = masks.put(Occupancy::of(chunk, end, values).as_deref());
                masks.show(slot);
                slot
            };
            let (slot, other) = (&mut self.seen.slots[index], &mut self.blocking.slots[index]);
            let is_one = slot == other;
            if is_one {
                masks.hide(*other);
            }
            *slot = renew(masks, *slot, &seen);
            if seen == blocking {
                *other = *slot;
                masks.show(*other);
            } else if is_one {
                // What lets light through may come in with the edit: then both layers part.
                let marks = Occupancy::of(chunk, end, &blocking);
                let is_same = marks.as_ref().is_some_and(|marks| masks.nodes(*slot) == marks.nodes());
                *other = if is_same { *slot } else { masks.put(marks.as_deref()) };
                masks.show(*other);
            } else {
                *other = renew(masks, *other, &blocking);
            }
        }
        // What is compared next time is then the same in memory.
        self.voxels = voxels.clone();
        self.blocking.masks = self.seen.masks.clone();
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

/// Masks of what is seen, and of what blocks light where that is something else.
type Built = [Option<Box<Occupancy>>; 2];

/// How many chunks are built before their masks are put in place: what is built is there twice for a while.
const BUILT_AT_ONCE: usize = 256;

impl Recipe {
    /// Nothing for an empty chunk.
    fn of(voxels: &Voxels, index: usize) -> Option<Self> {
        let source = match voxels.chunk(index) {
            Chunk::Uniform(0) => return None,
            Chunk::Uniform(value) => Source::Uniform(*value),
            Chunk::Cells(cells) => Source::Cells(cells.as_ptr().addr()),
        };
        Some(Self { source, end: Grid::end(voxels, index) })
    }
}

/// Grids with the masks of their chunks, kept from one `prepare` to the next. A grid that became another by edits is
/// changed where they are; of one whose chunks are at other places masks are found again by the identity of cells.
#[derive(Debug, Default)]
pub(crate) struct Chunks {
    kept: Vec<Arc<Grid>>,
    used: Vec<Arc<Grid>>,
    /// Chunks that had to be built since [`Chunks::begin`].
    pub(crate) built: u64,
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
        self.used.iter().map(|grid| grid.seen.masks.used()).sum::<u64>() * size_of::<Occupancy>() as u64
    }

    /// Makes a grid ready; `seen` are the values that may be seen, `blocking` those that may block light.
    pub(crate) fn grid(
        &mut self,
        voxels: &Voxels,
        seen: Values,
        blocking: Values,
        control: &Control<'_>,
    ) -> Result<Arc<Grid>, Cancelled> {
        let values = [seen, blocking];
        let grid = match self.edited(voxels, values) {
            Some(grid) => grid,
            None => Arc::new(self.build(voxels, values, control)?),
        };
        self.used.push(grid.clone());
        Ok(grid)
    }

    /// Changes a grid of before, if there is one that most chunks are those of.
    fn edited(&mut self, voxels: &Voxels, values: [Values; 2]) -> Option<Arc<Grid>> {
        let changed_of =
            |old: &Grid| -> Vec<usize> { voxels.changed_from(&old.voxels).take(MOST_EDITED + 1).collect() };
        let (at, changed) = self.kept.iter().enumerate().find_map(|(at, old)| {
            let is_alike = old.voxels.size() == voxels.size() && old.values == values;
            let changed = is_alike.then(|| changed_of(old))?;
            (changed.len() <= MOST_EDITED).then_some((at, changed))
        })?;
        let mut grid = self.kept.swap_remove(at);
        if !changed.is_empty() {
            Arc::make_mut(&mut grid).update(&changed, voxels);
        }
        self.built += changed.len() as u64;
        Some(grid)
    }

    /// Builds a grid. One of before that has chunks of it gives it its masks.
    fn build(
        &mut self,
        voxels: &Voxels,
        values: [Values; 2],
        control: &Control<'_>,
    ) -> Result<Grid, Cancelled> {
        let recipes: Vec<Option<Recipe>> =
            (0..voxels.chunk_count()).map(|index| Recipe::of(voxels, index)).collect();
        let wanted: HashSet<Recipe> = recipes.iter().flatten().copied().collect();
        let shared = |old: &Arc<Grid>| {
            let recipes = (0..old.voxels.chunk_count()).filter_map(|index| Recipe::of(&old.voxels, index));
            if old.values == values { recipes.filter(|recipe| wanted.contains(recipe)).count() } else { 0 }
        };
        let most = (0..self.kept.len()).max_by_key(|&at| shared(&self.kept[at]));
        let old = most.filter(|&at| shared(&self.kept[at]) > 0).map(|at| self.kept.swap_remove(at));
        let mut known: HashMap<Recipe, [u32; 2]> = HashMap::new();
        let mut masks = Masks::default();
        if let Some(old) = old {
            for index in 0..old.voxels.chunk_count() {
                if let Some(recipe) = Recipe::of(&old.voxels, index).filter(|recipe| wanted.contains(recipe))
                {
                    known.insert(recipe, [old.seen.slots[index], old.blocking.slots[index]]);
                }
            }
            let Grid { seen, blocking, .. } = Arc::unwrap_or_clone(old);
            drop(blocking);
            masks = Arc::unwrap_or_clone(seen.masks);
            let [first, second]: [Vec<u32>; 2] =
                [0, 1].map(|i| known.values().map(|slots| slots[i]).collect());
            masks.count([&first, &second]);
        }
        let mut missing: Vec<(Recipe, &Chunk, Built)> = Vec::new();
        let mut asked = HashSet::new();
        for (recipe, chunk) in recipes.iter().zip(voxels.chunks()) {
            if let Some(recipe) = recipe
                && !known.contains_key(recipe)
                && asked.insert(*recipe)
            {
                missing.push((*recipe, chunk, [None, None]));
            }
        }
        self.built += missing.len() as u64;
        masks.reserve(missing.len());
        for missing in missing.chunks_mut(BUILT_AT_ONCE) {
            control.for_each_mut(missing, 1, &|_, (recipe, chunk, built)| {
                let marks = |values| Occupancy::of(chunk, recipe.end, values);
                built[0] = marks(&values[0]);
                // Most chunks hold nothing that is seen but lets light through: then both are one.
                built[1] = if values[0] == values[1] { None } else { marks(&values[1]) };
            })?;
            for (recipe, _, built) in missing {
                let [seen, blocking] = std::mem::take(built);
                let slot = masks.put(seen.as_deref());
                let is_one = values[0] == values[1] || seen == blocking;
                known.insert(*recipe, [slot, if is_one { slot } else { masks.put(blocking.as_deref()) }]);
            }
        }
        let slots_of = |which: usize| -> Vec<u32> {
            let slots = recipes.iter().map(|r| r.as_ref().and_then(|r| known.get(r)));
            slots.map(|slots| slots.map_or(Masks::NOTHING, |slots| slots[which])).collect()
        };
        let (seen, blocking) = (slots_of(0), slots_of(1));
        masks.count([&seen, &blocking]);
        let masks = Arc::new(masks);
        let [cx, cy, _] = voxels.chunks_per_axis().map(|c| c as usize);
        let size = voxels.size().map(|s| s as i32);
        let layer = |slots| Layer { size, row: cx, slab: cx * cy, slots, masks: masks.clone() };
        Ok(Grid { seen: layer(seen), blocking: layer(blocking), values, voxels: voxels.clone() })
    }
}

/// A grid of which more chunks became others is built anew, by many threads.
const MOST_EDITED: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use polyptych_core::scene::{Brush, Region};

    #[test]
    fn an_edit_builds_one_chunk() {
        let all = Values::of(|_| true);
        let mut voxels = Voxels::from_fn([130, 70, 65], |x, y, z| u8::from((x + y + z) % 7 == 0));
        let mut chunks = Chunks::default();
        let mut prepare = |voxels: &Voxels| {
            chunks.begin();
            let grid = chunks.grid(voxels, all, all, &Control::simple()).unwrap();
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
            let grid = chunks.grid(&voxels, all, solid, &Control::simple()).unwrap();
            chunks.end();
            let anew = Chunks::default().grid(&voxels, all, solid, &Control::simple()).unwrap();
            for (layer, other) in [(&grid.seen, &anew.seen), (&grid.blocking, &anew.blocking)] {
                for chunk in 0..layer.slots.len() {
                    assert!(layer.nodes(chunk) == other.nodes(chunk), "round {round}");
                }
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
        let grid =
            chunks.grid(&voxels, Values::of(|_| true), Values::of(|v| v == 1), &Control::simple()).unwrap();
        let same = |i: usize| grid.seen.slots[i] == grid.blocking.slots[i];
        assert_eq!((same(0), same(1)), (true, false));
        assert_eq!(grid.blocking.slots[1], Masks::NOTHING);
    }
}
