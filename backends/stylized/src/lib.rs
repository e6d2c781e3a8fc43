//! The stylized shader: two-color tone, steps and contours over the visible surfaces of another back end.
//!
//! [`Stylized`] is a renderer over a renderer: the registry hands it the back end named by the parameter
//! `visibility`, and it reads that one's distances, normals, ids, albedo and shadows. So a voxel castle can be
//! drawn in two tones as well as a mesh.
//!
//! Source: A. Gooch, B. Gooch, P. Shirley, E. Cohen, *A non-photorealistic lighting model for automatic technical
//! illustration*, SIGGRAPH 1998, generalized to any two colors.

mod contour;
mod renderer;
mod tone;

pub use renderer::{Factory, Stylized};
pub use tone::Tone;
