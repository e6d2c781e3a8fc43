//! The free-form quadric caster: quadrics, perturbations, set operations, height fields and volumes, drawn
//! without turning them into polygons.
//!
//! - [`Freeform`] draws primitives, free forms, height fields and volumes as given. Meshes and voxels are drawn
//!   as the zero level of a grid of signed distances.
//! - Roots are found by interval bounds along packets of rays ([`roots`](self)), so that the first one is never
//!   missed except where a solid is thinner than a millionth of the ray's stretch through its bounds.
//! - One sample a pixel, through its middle; mirrors are drawn as if they were not (and the report says so).
//!
//! Source: S. I. Vyatkin, *Complex surface modeling using perturbation functions*, Optoelectronics,
//! Instrumentation and Data Processing 43(3), 2007; we bound each function by intervals on screen tiles instead of
//! subdividing the whole space.

mod bundle;
mod field;
mod form;
mod frame;
mod heights;
mod light;
mod program;
mod renderer;
mod roots;
mod volume;
mod world;

pub use renderer::{Factory, Freeform};
