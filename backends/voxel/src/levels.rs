//! What do blocks of cells look like from where they are no larger than a pixel?
//!
//! Blocks of 4^3 and of 16^3 cells are cells of coarser grids: marked where any of theirs is, of the mean color of those
//! that have an open side. A ray goes through the cells as they are up to where a block of 4 is as small as a pixel, then
//! through blocks of 4, then of 16. Each level begins a block's diagonal before the finer one ends, so that nothing lies
//! between them; the block in which it begins was seen through by the finer level and is passed over.

use crate::grid::{Chunks, Grid};
use crate::occupancy::Values;
use glam::Vec3;
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::scene::{CHUNK, Chunk, Object, Scene, Voxels};
use polyptych_core::seam::{Cancelled, Control};
use std::sync::Arc;

/// Cells of a finer level along the edge of a block.
pub(crate) const BLOCK: u32 = 4;
/// Blocks along the edge of a chunk of the finest grid.
const BLOCKS: u32 = CHUNK / BLOCK;

/// How large a pixel is in space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    /// Meters at the eye, and for each meter of distance.
    at_eye: f64,
    by_distance: f64,
}

impl Footprint {
    /// Nothing is ever as small as a pixel.
    pub(crate) const NONE: Self = Self { at_eye: 0.0, by_distance: 0.0 };

    /// Returns the footprint in the middle of a picture; that of cameras that bend lines is not told.
    pub(crate) fn of(camera: &Camera, height: u32) -> Self {
        let rows = f64::from(height.max(1));
        match camera.projection {
            Projection::Perspective { fov_y } => {
                Self { at_eye: 0.0, by_distance: 2.0 * (fov_y * 0.5).tan() / rows }
            }
            Projection::Orthographic { height } => Self { at_eye: height / rows, by_distance: 0.0 },
            _ => Self::NONE,
        }
    }

    /// Returns from which distance on an edge is no longer than a pixel.
    pub(crate) fn distance(&self, edge: f64) -> f64 {
        if edge <= self.at_eye {
            0.0
        } else if self.by_distance > 0.0 {
            edge / self.by_distance
        } else {
            f64::INFINITY
        }
    }
}

/// A coarser grid.
#[derive(Clone, Debug)]
pub(crate) struct Coarse {
    /// Its bytes are those that most of a block's visible cells have.
    pub(crate) grid: Arc<Grid>,
    /// The mean color of each block, x fastest.
    pub(crate) colors: Arc<[Vec3]>,
}

/// A block while it is collected.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    byte: u8,
    color: Vec3,
    /// Cells that the color is the mean of.
    weight: f32,
}

/// Tells whether blocks of an object's cells may stand for them: a mean of colors says nothing about textures, holes,
/// glass and mirrors.
pub(crate) fn is_plain(scene: &Scene, object: &Object) -> bool {
    (0..255).all(|slot| {
        let m = scene.material(object, slot);
        m.texture.is_none() && m.reflectivity <= 0.0 && m.effective_opacity(m.opacity) >= 1.0
    })
}

/// Makes the levels of a grid: blocks of 4^3 cells and of 16^3.
pub(crate) fn of(
    scene: &Scene,
    object: &Object,
    grid: &Grid,
    voxels: &Voxels,
    control: &Control<'_>,
) -> Result<[Coarse; 2], Cancelled> {
    let colors: Vec<Vec3> =
        (0..256usize).map(|v| scene.material(object, v.saturating_sub(1)).base_color).collect();
    let mut chunks: Vec<Vec<Block>> = vec![Vec::new(); voxels.chunk_count()];
    control.for_each_mut(&mut chunks, 1, &|index, blocks| {
        *blocks = blocks_of(grid, voxels, index, &colors);
    })?;
    let size = voxels.size().map(|s| s.div_ceil(BLOCK));
    let at =
        |[x, y, z]: [u32; 3], size: [u32; 3]| ((z * size[1] + y) as usize) * size[0] as usize + x as usize;
    let mut fine = vec![Block::default(); size.iter().map(|&s| s as usize).product()];
    for (index, blocks) in chunks.iter().enumerate() {
        control.check()?;
        let first = voxels.chunk_origin(index).map(|c| c / BLOCK);
        for (i, block) in blocks.iter().enumerate() {
            let i = i as u32;
            let place = [i % BLOCKS, i / BLOCKS % BLOCKS, i / (BLOCKS * BLOCKS)];
            let place: [u32; 3] = std::array::from_fn(|a| first[a] + place[a]);
            if (0..3).all(|a| place[a] < size[a]) {
                fine[at(place, size)] = *block;
            }
        }
    }
    let wide = size.map(|s| s.div_ceil(BLOCK));
    let mut coarse = vec![Block::default(); wide.iter().map(|&s| s as usize).product()];
    for z in 0..size[2] {
        for y in 0..size[1] {
            control.check()?;
            for x in 0..size[0] {
                let own = fine[at([x, y, z], size)];
                if own.byte == 0 {
                    continue;
                }
                let block = &mut coarse[at([x, y, z].map(|c| c / BLOCK), wide)];
                // What nobody sees counts as next to nothing.
                let weight = own.weight.max(1e-3);
                if block.byte == 0 || weight > block.weight {
                    block.byte = own.byte;
                }
                block.weight += weight;
                block.color += (own.color - block.color) * (weight / block.weight);
            }
        }
    }
    let level = |size: [u32; 3], blocks: &[Block]| {
        let bytes: Vec<u8> = blocks.iter().map(|block| block.byte).collect();
        let all = Values::of(|_| true);
        let grid = Chunks::default().grid(&Voxels::from_bytes(size, &bytes), all, all, control)?;
        Ok(Coarse { grid, colors: blocks.iter().map(|block| block.color).collect() })
    };
    Ok([level(size, &fine)?, level(wide, &coarse)?])
}

/// Collects the blocks of a chunk; none where it is empty.
fn blocks_of(grid: &Grid, voxels: &Voxels, index: usize, colors: &[Vec3]) -> Vec<Block> {
    let first = voxels.chunk_origin(index);
    let whole = match voxels.chunk(index) {
        Chunk::Uniform(0) => return Vec::new(),
        Chunk::Uniform(value) if is_buried(voxels, first) => Some(*value),
        _ => None,
    };
    let mut blocks = vec![Block::default(); BLOCKS.pow(3) as usize];
    for (i, block) in (0..).zip(&mut blocks) {
        if let Some(byte) = whole {
            *block = Block { byte, color: colors[usize::from(byte)], weight: 0.0 };
            continue;
        }
        let place = [i % BLOCKS, i / BLOCKS % BLOCKS, i / (BLOCKS * BLOCKS)];
        let corner: [u32; 3] = std::array::from_fn(|a| first[a] + place[a] * BLOCK);
        if (0..3).all(|a| corner[a] < voxels.size()[a]) && grid.seen.has_block(corner.map(|c| c as i32), 2) {
            *block = block_at(voxels, corner, colors);
        }
    }
    blocks
}

/// Tells whether a chunk lies amid chunks that are full.
fn is_buried(voxels: &Voxels, first: [u32; 3]) -> bool {
    let per_axis = voxels.chunks_per_axis();
    let place = first.map(|c| c / CHUNK);
    (0..3).all(|a| {
        [place[a].wrapping_sub(1), place[a] + 1].into_iter().all(|to| {
            let mut next = place;
            next[a] = to;
            let [cx, cy, cz] = per_axis;
            let is_there = next[0] < cx && next[1] < cy && next[2] < cz;
            is_there
                && !matches!(voxels.chunk(voxels.index_of_chunk(next)), Chunk::Uniform(0) | Chunk::Cells(_))
        })
    })
}

fn block_at(voxels: &Voxels, corner: [u32; 3], colors: &[Vec3]) -> Block {
    let mut open = Block::default();
    let mut any = Block::default();
    // The byte of most of what is open, found as its votes outlast those of others.
    let mut votes = 0i32;
    for i in 0..BLOCK.pow(3) {
        let [x, y, z] = [i % BLOCK, i / BLOCK % BLOCK, i / (BLOCK * BLOCK)];
        let [x, y, z] = [corner[0] + x, corner[1] + y, corner[2] + z];
        let byte = voxels.get(x, y, z);
        if byte == 0 {
            continue;
        }
        any = Block { byte, color: colors[usize::from(byte)], weight: 0.0 };
        let next = |dx: i32, dy: i32, dz: i32| {
            voxels.get(x.wrapping_add_signed(dx), y.wrapping_add_signed(dy), z.wrapping_add_signed(dz))
        };
        let sides =
            [next(1, 0, 0), next(-1, 0, 0), next(0, 1, 0), next(0, -1, 0), next(0, 0, 1), next(0, 0, -1)];
        if !sides.contains(&0) {
            continue;
        }
        open.weight += 1.0;
        open.color += (any.color - open.color) / open.weight;
        if votes == 0 {
            open.byte = byte;
        }
        votes += if byte == open.byte { 1 } else { -1 };
    }
    if open.weight > 0.0 { open } else { any }
}
