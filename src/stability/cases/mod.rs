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
//! | thin things, small things | `thin`, `thin-flicker`, `specks` |
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
//! | conversion: watertight for 6 and 26 neighbors | `floods` (what stops water at corners stops it at faces) |
//! | conversion: open, turned over, needles, another order | `open-meshes`, `turned-triangles`, `warped-quads`, `triangle-order` |
//! | conversion: volume to the closed form | `core/src/convert/voxelize.rs`: no back end draws a volume in cubic meters |
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
//! | lines | case |
//! |---|---|
//! | flicker | `contour-flicker` |
//! | false lines, missing lines | `false-lines`, `missing-lines` |
//! | bands that crawl | `band-crawl` |
//! | small objects | `specks` |

mod forms;
mod lines;
mod loads;
mod promises;
mod surfaces;
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
    let mut all = distances();
    all.extend(surfaces());
    all.extend(shadows_and_views());
    all.extend(shapes());
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

fn distances() -> Vec<Case> {
    vec![
        Case {
            id: "far-camera",
            is_method: true,
            title: "A ball from far away, as large in the picture",
            parameter: "distance over radius",
            values: [vec![2.0], powers(1, 8)].concat(),
            limit: 0.02,
            counted: "1 - silhouette IoU, or share of false shadows",
            build: scenes::far_camera,
            count: Count::Silhouette,
            better: Some(("as if from infinity", scenes::from_infinity)),
            ..base()
        },
        Case {
            id: "far-voxels",
            is_method: true,
            title: "A grid of voxels from far away",
            parameter: "distance in cells",
            values: [vec![20.0], powers(2, 9)].concat(),
            limit: 0.02,
            counted: "1 - silhouette IoU, or share of false shadows",
            build: scenes::far_voxels,
            count: Count::Silhouette,
            ..base()
        },
        Case {
            id: "tiny-scenes",
            title: "The same still life, smaller and smaller",
            parameter: "scale",
            values: powers(0, -8),
            limit: 0.002,
            counted: "color difference to the picture at scale 1",
            backends: EVERY,
            build: scenes::scaled,
            count: Count::Change,
            ..base()
        },
        Case {
            id: "huge-scenes",
            title: "The same still life, larger and larger",
            parameter: "scale",
            values: powers(0, 8),
            limit: 0.002,
            counted: "color difference to the picture at scale 1",
            backends: EVERY,
            build: scenes::scaled,
            count: Count::Change,
            ..base()
        },
        Case {
            id: "far-from-origin",
            is_method: true,
            title: "The same still life, moved away from the origin with its camera",
            parameter: "offset, m",
            values: [vec![0.0], powers(0, 8)].concat(),
            limit: 0.02,
            counted: "wrong objects, or distance error p99 over the distance",
            build: scenes::moved,
            count: Count::Distance,
            better: Some(("eye brought to the origin", scenes::re_origined)),
            ..base()
        },
        Case {
            id: "trembling",
            title: "Far from the origin, under a camera that moves by 1/16 pixel",
            parameter: "offset, m",
            values: [vec![0.0], powers(1, 8)].concat(),
            limit: 0.5,
            counted: "toggling pixels beyond the reference's own, over those",
            build: scenes::trembling,
            count: Count::Toggles,
            better: Some(("eye brought to the origin", scenes::re_origined)),
            ..base()
        },
        Case {
            id: "depth-resolution",
            title: "Two quads 0.1 mm apart, from farther and farther, as large in the picture",
            parameter: "distance, m",
            values: powers(0, 7),
            counted: "share of wrong owners",
            build: scenes::depth,
            better: Some(("as if from infinity", scenes::flat_from_infinity)),
            ..base()
        },
    ]
}

fn surfaces() -> Vec<Case> {
    vec![
        Case {
            id: "grazing",
            is_method: true,
            title: "A floor from lower and lower",
            parameter: "angle, degrees",
            values: powers(1, -6),
            counted: "holes, or distance error p99 over the distance",
            build: scenes::grazing,
            count: Count::Distance,
            ..base()
        },
        Case {
            id: "coplanar",
            title: "One quad before another, nearer and nearer",
            parameter: "separation, m",
            values: powers(-1, -9),
            counted: "share of wrong owners",
            build: scenes::coplanar,
            ..base()
        },
        Case {
            id: "thin",
            title: "A glowing rod, thinner and thinner",
            parameter: "thickness, pixels",
            values: vec![10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01],
            limit: 0.25,
            counted: "light that is missing or too much, as a share",
            build: scenes::thin,
            count: Count::Energy,
            better: Some(("4 x 4 samples a pixel in the host", scenes::supersampled)),
            ..base()
        },
        Case {
            id: "near",
            is_method: true,
            title: "The eye before a ball, on it, and inside",
            parameter: "eye to surface, m",
            values: vec![1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-6, 0.0, -1e-6, -1e-3, -0.1, -0.5, -0.9, -1.0],
            is_logarithmic: false,
            limit: 0.03,
            counted: "wrong objects, or distance error p99 over the distance",
            build: scenes::near,
            count: Count::Distance,
            ..base()
        },
        Case {
            id: "shared-edges",
            title: "Fans of triangles that fill the picture",
            parameter: "triangles",
            values: vec![3.0, 7.0, 32.0, 100.0, 317.0, 1000.0, 3163.0, 10_000.0, 32_768.0],
            limit: 0.0,
            counted: "share of holes",
            is_promise: true,
            backends: &["raster"],
            build: scenes::fan,
            ..base()
        },
        Case {
            id: "huge-triangles",
            title: "A floor of two triangles, under somebody who stands on it",
            parameter: "half edge, m",
            values: [powers(1, 12), vec![1e15, 1e18, 1e24, 1e30]].concat(),
            counted: "share of wrong objects",
            build: scenes::huge_triangles,
            backends: &["raster", "freeform"],
            ..base()
        },
    ]
}

fn shadows_and_views() -> Vec<Case> {
    vec![
        Case {
            id: "shadow-slope",
            is_method: true,
            title: "A ball and a post on a floor, the light lower and lower",
            parameter: "light from the vertical, degrees",
            values: vec![0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 80.0, 85.0, 88.0, 89.0, 89.5, 89.9],
            is_logarithmic: false,
            limit: 0.02,
            counted: "share of shadows and lights that are false",
            build: scenes::shadow_slope,
            count: Count::Shadow,
            better: Some(("finest shadow map", scenes::fine_shadow)),
            ..base()
        },
        Case {
            id: "shadow-contact",
            is_method: true,
            title: "A ball and a post over a floor, nearer and nearer",
            parameter: "gap, m",
            values: powers(0, -6),
            limit: 0.02,
            counted: "share of shadows and lights that are false",
            build: scenes::shadow_contact,
            count: Count::Shadow,
            better: Some(("finest shadow map", scenes::fine_shadow)),
            ..base()
        },
        Case {
            id: "field-of-view",
            is_method: true,
            title: "A ring of blocks around the eye, through a wider and wider lens",
            parameter: "field of view, degrees",
            values: vec![1.0, 10.0, 30.0, 60.0, 90.0, 120.0, 150.0, 165.0, 175.0, 178.0, 179.0],
            is_logarithmic: false,
            limit: 0.1,
            counted: "1 - silhouette IoU, or share of false shadows",
            build: scenes::field_of_view,
            count: Count::Silhouette,
            ..base()
        },
        Case {
            id: "fisheye",
            is_method: true,
            title: "A ring of blocks around the eye, through a fisheye",
            parameter: "field of view, degrees",
            values: vec![60.0, 120.0, 180.0, 240.0, 300.0, 340.0, 360.0],
            is_logarithmic: false,
            limit: 0.1,
            counted: "1 - silhouette IoU, or share of false shadows",
            build: scenes::fisheye,
            count: Count::Silhouette,
            ..base()
        },
        Case {
            id: "motion",
            title: "A still life under a camera that moves by smaller and smaller steps",
            parameter: "step, pixels",
            values: vec![1.0, 0.5, 0.25, 0.125, 0.0625],
            limit: 0.5,
            counted: "toggling pixels beyond the reference's own, over those",
            build: scenes::motion,
            count: Count::Toggles,
            better: Some(("conversion to 1/20 pixel", scenes::finer)),
            ..base()
        },
        Case {
            id: "contour-flicker",
            title: "Lines around a still life under a camera that moves by smaller and smaller steps",
            parameter: "step, pixels",
            values: vec![1.0, 0.5, 0.25, 0.125, 0.0625],
            limit: 0.5,
            counted: "pixels that jump beyond those of the same style over the reference, over those",
            backends: &["stylized"],
            build: scenes::motion,
            count: Count::Flicker,
            better: Some(("conversion to 1/20 pixel", scenes::finer)),
            ..base()
        },
    ]
}

fn shapes() -> Vec<Case> {
    vec![
        Case {
            id: "degenerate",
            title: "No numbers, infinite ones, no area, no volume, no light, no scene, no pixel",
            parameter: "which",
            values: (0..12).map(f64::from).collect(),
            is_logarithmic: false,
            limit: 0.0,
            counted: "pixels that are not finite; a panic counts as infinite",
            is_promise: true,
            backends: EVERY,
            build: scenes::degenerate,
            count: Count::NotFinite,
            ..base()
        },
        Case {
            id: "shell",
            title: "A hollow ball with a thinner and thinner wall, cut open",
            parameter: "thickness over radius",
            values: powers(-1, -7),
            limit: 0.02,
            counted: "wrong objects, or distance error p99 over the distance",
            build: scenes::shell,
            count: Count::Distance,
            better: Some(("conversion to 1/20 pixel", scenes::finer)),
            ..base()
        },
        Case {
            id: "small-coefficients",
            title: "The same ball as a quadric with smaller and smaller coefficients",
            parameter: "power of ten",
            values: (0..=10).map(|i| f64::from(i) * -2.0).collect(),
            is_logarithmic: false,
            limit: 0.02,
            counted: "color difference to the picture at power 0",
            build: scenes::coefficients,
            count: Count::Change,
            ..base()
        },
        Case {
            id: "large-coefficients",
            title: "The same ball as a quadric with larger and larger coefficients",
            parameter: "power of ten",
            values: (0..=10).map(|i| f64::from(i) * 2.0).collect(),
            is_logarithmic: false,
            limit: 0.02,
            counted: "color difference to the picture at power 0",
            build: scenes::coefficients,
            count: Count::Change,
            ..base()
        },
        Case {
            id: "spike",
            is_method: true,
            title: "A plain with one spike, on a finer and finer grid",
            parameter: "columns",
            values: vec![4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0],
            limit: 0.02,
            counted: "wrong objects, or distance error p99 over the distance",
            build: scenes::spike,
            count: Count::Distance,
            ..base()
        },
    ]
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
        let paths = table.iter().flat_map(|l| l.split('`').skip(1).step_by(2)).filter(|n| n.contains('/'));
        for path in paths {
            assert!(std::path::Path::new(path).exists(), "{path}");
        }
    }
}
