//! How does cost grow with what a scene holds?
//!
//! Times depend on the machine and on what else it does; only what grows much faster than the load breaks.

use super::super::count::Count;
use super::super::scenes::{self, Setup, front, setup, studio};
use super::{Case, EVERY, base};
use crate::prelude::{Object, Shape};

pub(super) fn cases() -> Vec<Case> {
    let growth = |id, title, parameter, values, build| Case {
        id,
        title,
        parameter,
        values,
        limit: 1.6,
        counted: "exponent of the growth of time or bytes since the value before, the larger; 1 is in proportion",
        backends: EVERY,
        build,
        count: Count::Growth,
        ..base()
    };
    vec![
        growth(
            "load-objects",
            "Boxes in a field, more and more",
            "objects",
            vec![1.0, 10.0, 100.0, 1000.0, 1e4, 1e5, 1e6],
            scenes::many,
        ),
        growth(
            "load-triangles",
            "A ball of more and more triangles",
            "triangles",
            vec![1024.0, 16_384.0, 262_144.0, 1_048_576.0],
            triangles,
        ),
        growth(
            "load-lights",
            "A still life under more and more lights",
            "lights",
            vec![1.0, 4.0, 16.0, 64.0],
            scenes::lights,
        ),
        growth(
            "load-pixels",
            "A still life in a larger and larger picture",
            "rows",
            vec![135.0, 270.0, 540.0, 1080.0, 2160.0, 4320.0],
            scenes::pixels,
        ),
    ]
}

/// A ball of so many triangles.
fn triangles(count: f64) -> Setup {
    let mut scene = studio();
    let rings = (count / 4.0).sqrt().round() as u32;
    scene.objects.push(Object::new("ball", Shape::Mesh(crate::chart::ball(rings)), 0));
    let camera = front(&scene);
    Setup { load: count, ..setup(scene, camera) }
}
