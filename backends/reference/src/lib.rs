//! The ruler: an exact ray caster in double precision that draws every shape as it was given.
//!
//! No shape is converted; curved surfaces are found by closed forms or by guaranteed root isolation. All
//! other back ends are measured against this one, so what follows is the law for all of them.
//!
//! # What a pixel means
//! - **Geometry** (distance, normal, id, albedo, shadow) comes from one ray through the pixel's center.
//!   **Color** is the mean of N samples in N strata of equal area, jittered by a hash of column, row and sample
//!   (N = 1: the center ray itself). **Coverage** is the share of these N samples that see something.
//! - **What is seen** is the nearest surface with an effective opacity above 0 (holes of masked textures are
//!   looked through), or the point of a volume at which the opacity gathered so far reaches one half, whichever
//!   is nearer. The id is the object's index plus one. Surfaces at the same distance: the lower object, then the
//!   lower triangle wins.
//! - **Normals** face the viewer: where the true (geometric) normal points away, both it and the shading
//!   normal are turned. The channel holds the shading normal, interpolated where a mesh has normals.
//! - Pixels where the projection sees nothing (outside of a fisheye's circle) are black.
//! - An eye inside a solid sees the solid's inner side; inside a filled voxel it sees that voxel at distance 0.
//!
//! # Light
//! - The formula is [`polyptych_core::shade::Surface`]: ambient and emission, plus every light of
//!   [`Scene::all_lights`](polyptych_core::scene::Scene::all_lights) that the true normal is not
//!   [turned away](polyptych_core::shade::turned_away) from and that is not blocked.
//! - Only opaque surfaces block: opacity 1 and not blended, solid texels of masked textures. Volumes neither
//!   block nor receive shadow. A light with `casts_shadow: false` is never blocked. The light of an emissive
//!   voxel ends where the ray enters that voxel's cell, so that the cell does not block itself.
//! - **Shadow** is the share of shadow-casting lights arriving at the point that are neither turned away nor
//!   blocked; 1 where none arrives, where nothing is seen, and in volumes.
//!
//! # Layers
//! - From front to back: `color += T a c`, then `T *= 1 - a`, until `T < 1/1024`. There is no refraction.
//! - With reflectivity r a surface shows `(1 - r) c + r m`, where m is what the mirror ray sees. A surface that
//!   may not reflect any more (parameter `bounces`), or whose reflection would weigh less than 1/1024, shows c.
//! - Fog fades every layer by its distance from the origin of its ray, before it is laid over the others; a
//!   reflection is faded once on either leg, which is the fog of the whole way. The background is not faded.
//! - In a voxel grid the entry into a cell is a surface when the value changes; between equal transparent cells
//!   there is none, and the step into an empty cell is none either.
//!
//! # Volumes
//! - Between entry and exit of the box (of every stretch inside the shell, whose ends are found exactly) the ray
//!   is cut into equal steps no longer than `volume.step` times the smallest spacing in world units, and the
//!   field is read in the middle of each. Opacity is that of the transfer function for the step's length in
//!   object space. Where volumes overlap, all are read at the same places with the smaller step, in the order of
//!   the objects. What lies behind 96 stretches of one ray in volumes is left out.
//! - The color of a sample is the transfer color lit without shadows by the material of slot 0, with the
//!   gradient (falling values outward, facing the viewer) as normal. Where the gradient is below 1/1000 of
//!   the field's range a spacing, the diffuse term counts half for every light and nothing is mirrored.

#![expect(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "`!(x > 0.0)` is meant as written: what is not a number must fail the test too"
)]

mod bvh;
mod cost;
mod lights;
mod line;
mod march;
mod renderer;
mod roots;
mod sampling;
mod shade;
mod shapes;
#[cfg(test)]
mod tests;
mod trace;
mod world;

pub use renderer::{Factory, Reference};
