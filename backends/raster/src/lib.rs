//! A z-buffer rasterizer with shadow maps.
//!
//! A frame runs down one page of steps; each has a file of that name:
//!
//! ```text
//!  model      meshes at their places, given or converted            (prepare)
//!  shadow     what each light sees, drawn by the steps below        (prepare, when lights or things moved)
//!  lens       camera -> rows that take points to pixels, and rays back
//!  affine     the functions that these rows and rays are made of
//!  transform  every vertex once -> column, row, depth
//!  clip       what reaches behind the eye or beyond the guard band
//!  sieve      eight triangles at once: which of them cover no pixel
//!  setup      corners snapped to 24.8 bits, exact edges, depth plane
//!  bin        records sorted into tiles of 64x16 pixels
//!  grid       which tiles something touches
//!  edges      which pixels of a tile a triangle covers
//!  tile       the nearest triangle of each pixel: the visibility buffer
//!  layers     fragments of see-through triangles, sorted per pixel
//!  face       a visible triangle set up once a tile: where rays meet it, normals, texture with its mip level
//!  octet      the same in lanes for pixels that show a triangle each
//!  color      colors and opacities of eight points, by material
//!  texels     what eight pixels see of a texture
//!  batch      eight visible pixels at once: distances, places, unit normals
//!  light      the lighting equation of the core over a batch, with shadows
//!  lookup     what stands between eight points and a light, by triangles that a map names
//!  plain      the same by depths in a map
//!  exact      the same by all triangles on the way
//!  smooth     edges: triangles that share a pixel, by several places in it
//!  paint      the steps of a tile, and the pixel's channels
//!  surfaces   samples into batches, and batches into pixels
//!  lines      edges of faces, and free segments                   (prepare, for modes that draw them)
//!  strokes    lines on the picture: which of their pixels nothing hides
//!  crossings  where bodies cross, from the triangles of neighboring pixels
//!  drawing    lines onto the picture
//!  gouraud    light at corners, for that shading
//!  faces      cameras that bend straight lines: faces of a cube, looked up
//! ```
//!
//! **Accuracy.** Coverage is exact on corners snapped to 1/256 pixel: a pixel on a shared edge belongs to one
//! triangle. Distances come from the triangle's plane in double precision (1e-6 relative against closed forms).
//! Of equal depths (`1/w`, rounded to `f32`) the lower triangle of the lower object wins, so pictures do not
//! depend on the order of drawing. Shadow edges are exact where triangles are larger than a texel of the map.
//!
//! **Color** of more than one sample is multisampled: each triangle of a pixel is shaded once, at the pixel's center,
//! and weighs as many of the places in the pixel as show it. Edges are smooth; what is finer within a triangle
//! (highlights, edges of shadows) is not. Coverage is the share of places that show something.

mod affine;
mod batch;
mod bin;
mod blank;
mod casters;
mod clip;
mod color;
mod conversion;
mod crossings;
mod decide;
mod drawing;
mod edges;
mod exact;
mod face;
mod faces;
mod frame;
mod gouraud;
mod grid;
mod info;
mod layers;
mod lens;
mod light;
mod lines;
mod lookup;
mod model;
mod octet;
mod paint;
mod plain;
mod plan;
mod ready;
mod renderer;
mod setup;
mod shadow;
mod sieve;
mod smooth;
mod strokes;
mod surfaces;
#[cfg(test)]
mod tests;
mod texels;
mod tile;
mod transform;

pub use renderer::{Factory, Raster};
