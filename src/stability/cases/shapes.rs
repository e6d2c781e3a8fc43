//! Which cases are about one shape at its limits: no number, no thickness, coefficients of any size, a spike?

use super::super::count::Count;
use super::super::scenes;
use super::{Case, EVERY, base, powers};

pub(super) fn cases() -> Vec<Case> {
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
