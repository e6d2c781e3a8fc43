//! The stylized shader: two-color tone, steps, highlights, strokes and contours over the visible surfaces of another
//! back end.
//!
//! [`Stylized`] is a renderer over a renderer: the registry hands it the back end named by the parameter
//! `visibility`, and it reads that one's distances, normals, ids, albedo and shadows. So a voxel castle can be
//! drawn in pencil as well as a mesh. A style is data: a [`Preset`].
//!
//! ```text
//!  info       what can be set
//!  preset     named styles, and those in files
//!  style      what values mean for a picture
//!  prepare    edges of meshes, texture coordinates as colors         (prepare)
//!  edges      what lies on both sides of each edge of a mesh         (prepare)
//!  bake       maps of strokes                                        (prepare)
//!  spans      where nothing is seen
//!  outline    lines of meshes, from their edges
//!  cracks     lines of everything else, between pixels
//!  veil       how far one sees in a part of the picture
//!  ink        lines as shares of pixels
//!  light      how much a surface faces the light
//!  tone       two colors, and steps
//!  hatch      strokes on dark tones
//!  paper      what is under a drawing
//!  ground     what is there where nothing is seen
//!  look       how an object takes paint
//!  eight      what is at eight pixels
//!  lay        highlights and strokes on eight pixels
//!  paint      a row of the picture
//!  frame      lines and paint, one after the other
//!  svg        lines as a file of vectors
//! ```
//!
//! Source of the tone: A. Gooch, B. Gooch, P. Shirley, E. Cohen, *A non-photorealistic lighting model for automatic
//! technical illustration*, SIGGRAPH 1998, generalized to any two colors.

mod bake;
mod cracks;
mod crossings;
mod edges;
mod eight;
mod frame;
mod ground;
mod hatch;
mod info;
mod ink;
mod lay;
mod light;
mod look;
mod outline;
mod paint;
mod paper;
mod prepare;
mod preset;
mod renderer;
mod spans;
mod stroke;
mod style;
mod svg;
mod tone;
mod veil;

pub use preset::{Preset, STYLES, StyleError};
pub use renderer::{Factory, Stylized};
pub use stroke::{Kind, Stroke};
pub use tone::Tone;
