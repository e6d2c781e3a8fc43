//! The voxel back end: a ray caster that walks grids cell by cell in exact order.
//!
//! The question of the method is: which cells does a ray cross, in order (Amanatides and Woo 1987)? The answer
//! here is the same, bit for bit, as that of a walk that looks at every single cell, but empty blocks of 2^3 to
//! 64^3 cells are crossed in one stride. On a grid as given the method has no error of its own; shapes that
//! are no grids are turned into ones first, and the report says how far their surface moved.
//!
//! - [`Voxel`] is the renderer, [`Factory`] makes it for a registry.
//! - `occupancy` answers where in a chunk is nothing, `grid` puts chunks together and keeps them over edits.
//! - `beam` finds where the rays of a tile can meet anything; `paint` draws the tiles.
//! - `walk` follows one ray through one grid; `world` finds what a ray meets among many; `trace` colors it.
//!
//! Colors are drawn with one sample a pixel, through its middle, whatever number is needed.

mod beam;
mod grid;
mod lamps;
mod light;
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
