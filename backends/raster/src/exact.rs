//! Does anything stand between a point and a light, of all triangles that could?
//!
//! The picture of a light is cut into cells. Each lists every triangle that touches it, also those behind others, and
//! the way to the light from a point in a cell can cross no other one. So shadows have the edges of the triangles
//! themselves, at any distance: what an irregular z-buffer finds (T. Aila, S. Laine, *Alias-free shadow maps*, EGSR
//! 2004; G. S. Johnson et al., *The irregular z-buffer*, ACM Transactions on Graphics 24(4), 2005). There points are
//! listed and triangles drawn over them; listing triangles is ours, and serves until the light or a caster moves.

use crate::bin::Bins;
use crate::grid::{TILE_HEIGHT, TILE_WIDTH, TileGrid};
use crate::lens::{Lens, cube_face};
use crate::lookup::{Blocker, Sight, Sights};
use crate::model::Model;
use crate::shadow::Shadows;
use glam::DVec3;
use polyptych_core::lanes::{LANES, Mask8};
use polyptych_core::scene::Scene;

/// Most cells along the picture of a light.
const MOST_CELLS: u32 = 256;
/// Fewest.
const LEAST_CELLS: u32 = 16;

/// The triangles of a light's picture by cell.
pub(crate) struct Cells {
    /// Relative to the origin of the shadows. A tile of its picture is a cell.
    pub(crate) lens: Lens,
    grid: TileGrid,
    /// Where the casters of a cell end; they begin where those of the cell before end.
    ends: Vec<u32>,
    casters: Vec<Caster>,
}

/// A triangle in a cell.
#[derive(Clone, Copy)]
struct Caster {
    /// Depth of the corner nearest to the light.
    nearest: f32,
    id: u32,
}

/// Returns how many pixels a picture with a sensible number of cells has on an edge.
pub(crate) fn edge_for(triangles: u32) -> u32 {
    (triangles / 8).isqrt().clamp(LEAST_CELLS, MOST_CELLS) * TILE_WIDTH
}

impl Cells {
    /// Lists what bins that were filled for places around pixels' centers hold of each tile.
    pub(crate) fn of(lens: Lens, grid: TileGrid, bins: &Bins) -> Self {
        let (mut ends, mut casters) = (Vec::with_capacity(grid.count()), Vec::new());
        for tile in 0..grid.count() {
            for run in bins.runs() {
                let all =
                    run.facing.of_tile(tile).chain(run.averted.of_tile(tile)).chain(run.layers.of_tile(tile));
                casters.extend(all.map(|record| Caster { nearest: record.nearest, id: record.id }));
            }
            ends.push(casters.len() as u32);
        }
        Self { lens, grid, ends, casters }
    }

    /// Lists the triangles in front of a point that the way from it to the light may cross.
    fn before(&self, place: DVec3) -> impl Iterator<Item = u32> {
        let (x, y, ahead) = self.lens.place(place - self.lens.origin);
        let (width, height) = (f64::from(self.lens.width), f64::from(self.lens.height));
        let sees = (ahead > 0.0) & (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height);
        let (column, row) = (x as u32 / TILE_WIDTH, y as u32 / TILE_HEIGHT);
        let cell = if sees { (row * self.grid.columns + column) as usize } else { 0 };
        let begin = if cell == 0 { 0 } else { self.ends[cell - 1] };
        let casters = if sees { begin as usize..self.ends[cell] as usize } else { 0..0 };
        let depth = self.lens.depth(ahead) as f32;
        self.casters[casters].iter().filter(move |caster| caster.nearest >= depth).map(|caster| caster.id)
    }

    /// Returns the bytes of so many cells, each triangle in two of them on the average.
    pub(crate) fn planned_bytes(cells: u64, triangles: u64) -> u64 {
        cells * 4 + 2 * triangles * size_of::<Caster>() as u64
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.ends.len() * 4 + self.casters.len() * size_of::<Caster>()) as u64
    }
}

impl Shadows {
    /// Tells at which of the wanted points any triangle stands between it and the light.
    pub(crate) fn blocked_exactly(
        &self,
        (scene, model): (&Scene, &Model),
        cells: &[Cells],
        sights: &Sights,
        wanted: Mask8,
    ) -> Mask8 {
        let mut blocked = Mask8::NONE;
        let Some(first) = cells.first() else { return blocked };
        for i in (0..LANES).filter(|&i| wanted.has(i)) {
            let sight = sights.of(i);
            let cells =
                if cells.len() == 1 { first } else { &cells[cube_face(sight.place - first.lens.origin)] };
            let blocks = |id: u32| self.blocks((scene, model), id, &sight);
            if cells.before(sight.place).any(blocks) {
                blocked.0[i] = u32::MAX;
            }
        }
        blocked
    }

    fn blocks(&self, (scene, model): (&Scene, &Model), id: u32, sight: &Sight) -> bool {
        if id == sight.triangle {
            return false;
        }
        let blocker = Blocker::of(self, id, sight.place);
        blocker.is_crossed(sight.to_light)
            && blocker.is_before(sight, self.tolerance)
            && self.is_solid(scene, model, id, sight)
    }
}
