//! Which cases are about the lines and bands of the stylized shader?

use super::super::count::Count;
use super::super::scenes::{self, Setup, look, setup, studio};
use super::{Case, base, powers};
use crate::prelude::{DVec3, Mesh, Object, Primitive, Shape, Vec3};
use std::sync::Arc;

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case {
            id: "false-lines",
            title: "A floor and a ball from lower and lower: no line belongs on either",
            parameter: "angle, degrees",
            values: powers(1, -4),
            limit: 0.0,
            counted: "share of the pixels amid surfaces that have a line",
            backends: &["stylized"],
            build: smooth,
            count: Count::FalseLines,
            ..base()
        },
        Case {
            id: "missing-lines",
            title: "A step within one body, lower and lower: its edge wants a line",
            parameter: "height over distance",
            values: vec![0.3, 0.1, 0.03, 0.02, 0.015, 0.01, 0.005, 0.001],
            limit: 0.1,
            counted: "share of the lines that two bodies in its place would have",
            backends: &["stylized"],
            build: step,
            count: Count::MissingLines,
            ..base()
        },
        Case {
            id: "band-crawl",
            title: "More and more bands of tone under a camera that moves by 1/16 pixel",
            parameter: "bands",
            values: vec![1.0, 2.0, 4.0, 8.0, 16.0, 32.0],
            limit: 0.5,
            counted: "pixels that jump beyond those of the same style over the reference, over those",
            backends: &["stylized"],
            build: bands,
            count: Count::Crawl,
            ..base()
        },
    ]
}

/// A floor and a ball on it, each smooth, from so many degrees above.
fn smooth(degrees: f64) -> Setup {
    let mut scene = studio();
    let floor = Shape::Primitive(Primitive::Plane { width: 60.0, depth: 60.0 });
    scene.objects.push(Object::new("floor", floor, 0));
    let ball = Shape::Primitive(Primitive::Sphere { radius: 1.0 });
    scene.objects.push(Object::new("ball", ball, 1).at(DVec3::Y));
    let angle = degrees.to_radians();
    let eye = DVec3::new(0.3, angle.sin() * 8.0, angle.cos() * 8.0);
    setup(scene, look(eye, DVec3::Y * 0.5, 0.6))
}

/// A slab with a raised half: as one mesh, and for the truth as two.
fn step(height: f64) -> Setup {
    let distance = 4.0;
    let slab = |x0: f32, x1: f32, z: f32| Mesh {
        positions: [[x0, -1.0], [x1, -1.0], [x1, 1.0], [x0, 1.0]].map(|[x, y]| Vec3::new(x, y, z)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let (low, high) = (slab(-1.0, 1.0, 0.0), slab(-0.8, 0.1, (height * distance) as f32));
    let mut both = low.clone();
    both.positions.extend(&high.positions);
    both.triangles.extend(high.triangles.iter().map(|t| t.map(|i| i + 4)));
    let (mut one, mut two) = (studio(), studio());
    one.objects.push(Object::new("slab", Shape::Mesh(both), 0));
    two.objects.push(Object::new("low", Shape::Mesh(low), 0));
    two.objects.push(Object::new("high", Shape::Mesh(high), 0));
    let mut setup = setup(one, look(DVec3::new(0.0, 0.0, distance), DVec3::ZERO, 0.6));
    setup.history = vec![Arc::new(two)];
    setup
}

/// The still life without lines, in so many bands.
fn bands(count: f64) -> Setup {
    let mut setup = scenes::motion(1.0 / 16.0);
    setup.settings.push(("contours", "false".to_owned()));
    setup.settings.push(("tone.steps", format!("{count:.0}")));
    setup
}
