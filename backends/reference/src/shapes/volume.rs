//! Which parts of a volume are surely empty, so that no sample needs to be read there?

use glam::DVec3;
use polyptych_core::scene::{TransferFunction, Volume};

/// Edge of a block in cells.
const BLOCK: usize = 8;

/// A bit for each block of 8^3 cells between samples, set where the transfer function is clear for every value
/// that interpolation can give there. Skipping such samples changes nothing.
#[derive(Debug)]
pub(crate) struct EmptyBlocks {
    blocks: [usize; 3],
    empty: Vec<bool>,
}

impl EmptyBlocks {
    pub(crate) fn new(volume: &Volume) -> Self {
        let size = volume.size().map(|s| s as usize);
        let blocks = size.map(|s| s.div_ceil(BLOCK));
        let mut empty = Vec::with_capacity(blocks.iter().product());
        for z in 0..blocks[2] {
            for y in 0..blocks[1] {
                for x in 0..blocks[0] {
                    let [lo, hi] = range(volume, [x, y, z].map(|b| b * BLOCK), size);
                    empty.push(!(lo <= hi) || is_clear(&volume.transfer, lo, hi));
                }
            }
        }
        Self { blocks, empty }
    }

    /// Returns what [`EmptyBlocks::bytes`] will be.
    pub(crate) fn planned_bytes(volume: &Volume) -> u64 {
        volume.size().map(|s| u64::from(s.div_ceil(BLOCK as u32))).iter().product()
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.empty.len() as u64
    }

    /// Tells whether a place on the grid, in cells from the first sample, lies in an empty block.
    pub(crate) fn at(&self, grid: DVec3) -> bool {
        let [x, y, z]: [usize; 3] =
            std::array::from_fn(|a| (grid[a].max(0.0) as usize / BLOCK).min(self.blocks[a] - 1));
        self.empty[(z * self.blocks[1] + y) * self.blocks[0] + x]
    }
}

/// Returns the range of the finite samples that interpolation reads for cells of a block.
fn range(volume: &Volume, first: [usize; 3], size: [usize; 3]) -> [f32; 2] {
    let mut range = [f32::INFINITY, f32::NEG_INFINITY];
    let end: [usize; 3] = std::array::from_fn(|a| (first[a] + BLOCK).min(size[a] - 1));
    for z in first[2]..=end[2] {
        for y in first[1]..=end[1] {
            let row = (z * size[1] + y) * size[0];
            for x in first[0]..=end[0] {
                let value = volume.samples().get(row + x);
                range = [range[0].min(value), range[1].max(value)];
            }
        }
    }
    range
}

fn is_clear(transfer: &TransferFunction, lo: f32, hi: f32) -> bool {
    // Interpolation in other precision may leave the range by its rounding.
    let slack = (lo.abs().max(hi.abs())) * 1e-5;
    let (lo, hi) = (lo - slack, hi + slack);
    let clear = |opacity: f32| opacity <= 0.0;
    clear(transfer.at(lo).1)
        && clear(transfer.at(hi).1)
        && transfer.points.iter().all(|p| p.value < lo || p.value > hi || clear(p.opacity))
}
