//! Which cases are about what is far away, tiny, huge, or far from the origin?

use super::super::count::Count;
use super::super::scenes;
use super::{Case, EVERY, base, powers};

pub(super) fn cases() -> Vec<Case> {
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
