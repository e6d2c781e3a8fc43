//! The free-form quadric caster: quadrics, perturbations, set operations, height fields and volumes, drawn
//! without turning them into polygons.
//!
//! - [`Freeform`] draws primitives, free forms, height fields and volumes as given. Meshes and voxels are drawn
//!   as the zero level of a grid of signed distances.
//! - Tiles beside a body's box are left alone. The rays of a tile are bounded together between two distances, which are
//!   halved while that is much longer than the tile is wide; functions that cannot matter there are left out. A part that
//!   holds one quadric is solved in closed form in double precision. Elsewhere roots are found by interval bounds along
//!   eight rays at once, so that the first one is never missed except where a solid is thinner than a millionth of the
//!   stretch: in single precision around the middle of the part, with a bound on what rounding changes, and then a step
//!   in double precision; or in double precision throughout (`roots.precision`). Perspective is taken by intervals along
//!   the rays as they are, not by a projective form of the space: set up at the middle of each part they are as exact
//!   for a far eye as for a near one.
//! - Height fields are walked from where the rays of a tile, and then of its blocks, come near them.
//! - Volumes: eight rays look for samples that add light, and those that found one are lit together; what is transparent
//!   is jumped without a change of the picture. In a shell samples begin where a ray enters it. Where volumes overlap,
//!   their samples are taken in the order of depth. Gradients are found for each sample or kept (`volume.gradients`),
//!   coarser samples are there by choice (`volume.levels`), and so is the surface alone (`volume.surface`).
//! - One sample a pixel, through its middle, or where edges or thin things may be as many as asked (`edge.rays`); mirrors are drawn as if they were not (and the report says so).
//!
//! Source: S. I. Vyatkin, *Complex surface modeling using perturbation functions*, Optoelectronics,
//! Instrumentation and Data Processing 43(3), 2007; we subdivide screen tiles in depth, in perspective as it is,
//! instead of a projected space.

mod bundle;
mod edges;
mod field;
mod form;
mod frame;
mod height_ranges;
#[cfg(test)]
mod height_truth;
mod height_walk;
mod heights;
mod layers;
mod light;
mod march;
mod plan;
mod program;
mod pyramid;
mod renderer;
mod roots;
mod surface;
#[cfg(test)]
mod truth;
mod volume;
mod world;

pub use renderer::{Factory, Freeform};
