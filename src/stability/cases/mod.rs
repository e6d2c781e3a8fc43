//! Which cases are there?
//!
//! What is known to break methods of each kind, and the case that draws it. What no picture can show stands with the test
//! that counts it; what nothing here can draw says why.
//!
//! | any back end | case |
//! |---|---|
//! | a camera far away, tiny and huge scenes | `far-camera`, `tiny-scenes`, `huge-scenes` |
//! | far from the origin, trembling there | `far-from-origin`, `trembling` |
//! | grazing views | `grazing`, `texture-grazing` |
//! | coplanar and nearly coplanar faces, flicker | `coplanar`, `coplanar-flicker` |
//! | thin things, small things | `thin`, `thin-edges`, `thin-flicker`, `specks` |
//! | the near plane, the eye inside | `near`, `near-voxels`, `under-heights` |
//! | shadows: contact and slope | `shadow-contact`, `shadow-slope` |
//! | wide lenses | `field-of-view`, `fisheye` |
//! | motion | `motion` |
//! | input that is no number, no area, no scene | `degenerate` |
//! | load | `load-objects`, `load-triangles`, `load-lights`, `load-pixels` |
//! | threads | `threads`; lanes: `src/conformance/pictures.rs` |
//!
//! | triangles | case |
//! |---|---|
//! | shared edges, pixel centers, slivers, T-junctions | `shared-edges`, `slivers`, `t-junctions` |
//! | a floor from behind the eye, huge coordinates | `huge-triangles` |
//! | no numbers, infinite ones, w below zero | `degenerate`, `near` |
//! | targets of 1 to 20001 pixels | `strips` |
//! | resolution of depth | `depth-resolution` |
//! | order of triangles | `triangle-order` |
//! | shadows: acne, gaps, leaks, swimming | `shadow-slope`, `shadow-contact`, `light-leaks`, `shadow-swim` |
//! | early or hierarchical tests of depth on and off | none: the rasterizer has no such switch, so there is nothing to compare |
//!
//! | voxels | case |
//! |---|---|
//! | rays along edges and through corners, diagonal walls | `voxel-edges`, `voxel-corners` |
//! | rays without direction, denormal ones, reversed ones; order, neighbors and number of steps | `backends/voxel/src/walk/tests.rs`: they have no picture |
//! | the eye on a face, an edge, inside | `near-voxels` |
//! | far away, long ways, caps on steps | `far-voxels`, `long-grids` |
//! | edits, also in the middle of a frame | `edits`, `edits-midway` |
//! | reflections cut off | `mirrors` |
//! | conversion: watertight for 6 and 26 neighbors | `floods` (what stops water at corners stops it at faces), `thin-floods` |
//! | conversion: open, turned over, needles, another order | `open-meshes`, `turned-triangles`, `warped-quads`, `triangle-order` |
//! | conversion: volume to the closed form | `core/src/convert/voxelize/tests.rs`: no back end draws a volume in cubic meters |
//!
//! | free forms | case |
//! |---|---|
//! | tangent rays, silhouettes | `tangent` |
//! | quadrics that are none, coefficients by powers of ten | `degenerate-quadrics`, `small-coefficients`, `large-coefficients` |
//! | double roots and close pairs, thin walls | `close-roots`, `shell` |
//! | the first of many roots, held against Sturm's count | `first-roots` |
//! | the rim of a support, recursion, many functions | `rim`, `recursion`, `functions` |
//! | bounds of intervals | `core/src/math.rs`, `core/src/scene/form.rs`: they have no picture |
//! | heights: vertical rays, below, spikes, odd sizes | `vertical-heights`, `under-heights`, `spike`, `height-sizes` |
//! | volumes: steps, even fog, rays along faces | `volume-step`, `volume-slabs` |
//! | volumes: borders of bricks | `volume-borders` |
//! | volumes: skipping of what is empty on and off | none: it is no switch; `volume-borders` moves what is skipped |
//!
//! | lines, bands and strokes | case |
//! |---|---|
//! | outlines that flicker | `contour-flicker`, `backends/stylized/tests/lines.rs::lines_toggle_no_more_pixels_than_those_of_an_antialiased_reference` |
//! | stair steps | `backends/stylized/tests/tone.rs::edges_of_steps_are_smooth_and_as_wide_as_a_pixel` |
//! | false lines on smooth or grazing surfaces | `false-lines`, `backends/stylized/tests/lines.rs::a_smooth_ball_has_one_closed_silhouette_and_no_line_within` |
//! | missing lines at hard edges | `missing-lines`, `backends/stylized/tests/lines.rs::a_cube_shows_nine_edges_from_a_hundred_directions_and_no_more` |
//! | flat-shaded, non-manifold and crossing bodies; a face that hides its own silhouette | `backends/stylized/tests/lines.rs::lines_of_flat_crowded_and_crossing_bodies_have_no_gaps` |
//! | strokes that swim, or pop between maps | `backends/stylized/tests/strokes.rs::strokes_stick_to_a_body_that_turns_and_screens_do_not`, `backends/stylized/tests/strokes.rs::strokes_do_not_pop_on_the_way_from_map_to_map` |
//! | bands that crawl | `band-crawl` |
//! | meshes of 10^6 edges | `load-triangles` |
//! | objects of a pixel | `specks`, `backends/stylized/tests/seen.rs::a_body_within_a_pixel_is_a_dot_as_wide_as_its_line` |

mod distances;
mod forms;
mod lines;
mod loads;
mod near;
mod promises;
mod shapes;
mod surfaces;
mod views;
mod voxels;

use super::count::Count;
use super::{Case, scenes};

/// Back ends that see with a method of their own.
const ALL: &[&str] = &["raster", "voxel", "freeform"];
/// And the others: the ruler, and the shader over another back end.
const EVERY: &[&str] = &["reference", "raster", "voxel", "freeform", "stylized"];

/// Powers of ten from one exponent to another.
fn powers(from: i32, to: i32) -> Vec<f64> {
    let step = if to > from { 1 } else { -1 };
    (0..=(to - from).abs()).map(|i| 10f64.powi(from + step * i)).collect()
}

/// Returns all cases.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut all = distances::cases();
    all.extend(near::cases());
    all.extend(views::cases());
    all.extend(shapes::cases());
    all.extend(surfaces::cases());
    all.extend(voxels::cases());
    all.extend(forms::cases());
    all.extend(promises::cases());
    all.extend(lines::cases());
    all.extend(loads::cases());
    all
}

/// What a case is unless it says otherwise.
fn base() -> Case {
    Case {
        id: "",
        title: "",
        parameter: "",
        values: Vec::new(),
        is_logarithmic: true,
        limit: 0.01,
        counted: "",
        is_method: false,
        is_promise: false,
        backends: ALL,
        build: scenes::motion,
        count: Count::WrongObject,
        better: None,
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_case_stands_in_the_table_and_what_stands_there_is_one() {
        let own = include_str!("mod.rs");
        let table: Vec<&str> = own.lines().filter(|l| l.starts_with("//! |")).collect();
        let mut named: Vec<&str> = table.iter().flat_map(|l| l.split('`').skip(1).step_by(2)).collect();
        named.retain(|n| !n.contains('/'));
        let ids: Vec<&str> = super::cases().iter().map(|c| c.id).collect();
        let missing: Vec<_> = ids.iter().filter(|id| !named.contains(id)).collect();
        let unknown: Vec<_> = named.iter().filter(|n| !ids.contains(n)).collect();
        assert!(missing.is_empty() && unknown.is_empty(), "missing {missing:?}, unknown {unknown:?}");
        let tests = table.iter().flat_map(|l| l.split('`').skip(1).step_by(2)).filter(|n| n.contains('/'));
        for test in tests {
            let (path, name) = test.split_once("::").unwrap_or((test, ""));
            let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{path}: {e}"));
            assert!(text.contains(&format!("fn {name}")), "{test}");
        }
    }
}
