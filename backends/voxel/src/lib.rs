//! The voxel back end: a ray caster that walks grids cell by cell in exact order.
//!
//! The question of the method is: which cells does a ray cross, in order (Amanatides and Woo 1987)? The answer
//! here is the same, bit for bit, as that of a walk that looks at every single cell, but empty blocks of 2^3 to
//! 64^3 cells are crossed in one stride. On a grid as given the method has no error of its own; shapes that
//! are no grids are turned into ones first, and the report says how far their surface moved.
//!
//! - [`Voxel`] is the renderer, [`Factory`] makes it for a registry.
//! - `occupancy` answers where in a chunk is nothing, `masks` keeps those answers in tables, `grid` puts chunks together
//!   and keeps them over edits.
//! - `beam` finds where the rays of a tile can meet anything; `paint` draws the tiles.
//! - `walk` follows one ray through one grid, or eight at once; `world` and `octet` find what they meet among many;
//!   `trace` and `light` color it.
//!
//! Rays of the eye and those toward lights go in packets of eight neighbors, two packets at once where the processor has
//! AVX-512: in single precision with the steps that it leaves in doubt taken in double. What goes on through glass, or
//! comes from a mirror, goes alone. The parameter `walk` chooses other numbers.
//!
//! Where it is asked for, blocks of cells that are no larger than a pixel are drawn as one; see `levels`.
//!
//! Colors are the mean of as many samples as are needed; all else is that of the ray through a pixel's middle.

mod beam;
mod grid;
mod lamps;
mod levels;
mod light;
mod masks;
mod model;
mod occupancy;
mod octet;
mod paint;
mod plan;
mod renderer;
mod trace;
mod tree;
mod walk;
mod world;

#[cfg(test)]
mod tests;

pub use renderer::{Factory, Voxel};
