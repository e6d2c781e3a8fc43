//! Which cases are about faces seen at a slant, near each other, near the eye, thin or huge?

use super::super::count::Count;
use super::super::scenes::{self, Setup};
use super::{Case, base, powers};

pub(super) fn cases() -> Vec<Case> {
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
            id: "thin-edges",
            title: "A glowing rod, thinner and thinner, with 8 x 8 rays where edges or thin things may be",
            parameter: "thickness, pixels",
            values: vec![10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01],
            limit: 0.25,
            counted: "light that is missing or too much, as a share",
            backends: &["freeform"],
            build: thin_edges,
            count: Count::Energy,
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

fn thin_edges(pixels: f64) -> Setup {
    let mut setup = scenes::thin(pixels);
    setup.settings.push(("edge.rays", "8".to_owned()));
    setup
}
