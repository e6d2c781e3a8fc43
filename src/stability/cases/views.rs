//! Which cases are about shadows, wide lenses and cameras that move?

use super::super::count::Count;
use super::super::scenes;
use super::{Case, base, powers};

pub(super) fn cases() -> Vec<Case> {
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
