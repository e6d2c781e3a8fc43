//! Which cases are about what must not show: threads, order, size, an edit in the middle of a frame?

use super::super::count::Count;
use super::super::scenes::{self, Setup, front, look, setup, studio};
use super::{ALL, Case, EVERY, base, powers};
use crate::camera::{Camera, Projection};
use crate::prelude::{DVec3, Light, Object, Primitive, Scene, Shape, Voxels};
use std::sync::Arc;

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case {
            id: "threads",
            title: "A still life, drawn by more and more threads",
            parameter: "threads",
            values: vec![2.0, 3.0, 8.0],
            is_logarithmic: false,
            limit: 0.0,
            counted: "share of pixels that differ from the picture of one thread",
            is_promise: true,
            backends: EVERY,
            build: |threads| Setup { load: threads, ..scenes::motion(1.0) },
            count: Count::Threads,
            ..base()
        },
        Case {
            id: "triangle-order",
            title: "The same ball with its triangles in another order",
            parameter: "shuffle",
            values: (0..5).map(f64::from).collect(),
            is_logarithmic: false,
            // A triangle that begins at another corner is interpolated from there: the last bit of single precision.
            limit: 1e-6,
            counted: "color difference to the picture of the first order",
            is_promise: true,
            backends: ALL,
            build: shuffled_ball,
            count: Count::Change,
            ..base()
        },
        Case {
            id: "edits-midway",
            title: "Hills of voxels, edited when more and more of a frame is drawn, which then ends or is stopped",
            parameter: "finished bands before the edit",
            values: vec![1.0, 3.0, 8.0],
            is_logarithmic: false,
            limit: 0.0,
            counted: "share of pixels of that frame that differ from the scene as it was, or of the next from it as it is",
            is_promise: true,
            backends: EVERY,
            build: edited_hills,
            count: Count::EditedMidway,
            ..base()
        },
        Case {
            id: "strips",
            is_method: true,
            title: "A still life in pictures of one row",
            parameter: "pixels",
            values: vec![1.0, 2.0, 3.0, 17.0, 97.0, 1021.0, 20_001.0],
            limit: 0.02,
            counted: "1 - silhouette IoU, or share of false shadows",
            build: strip,
            count: Count::Silhouette,
            ..base()
        },
        Case {
            id: "specks",
            title: "A field of balls, smaller and smaller",
            parameter: "size, pixels",
            values: vec![8.0, 4.0, 2.0, 1.5, 1.0, 0.7, 0.5, 0.35],
            limit: 0.1,
            counted: "share of the balls that the reference sees and the back end does not",
            backends: &["raster", "voxel", "freeform", "stylized"],
            build: specks,
            count: Count::Missing,
            ..base()
        },
        Case {
            id: "light-leaks",
            is_method: true,
            title: "A closed room in the sun, its walls thinner and thinner",
            parameter: "thickness, m",
            values: powers(-1, -6),
            limit: 0.02,
            counted: "share of shadows and lights that are false",
            build: closed_room,
            count: Count::Shadow,
            ..base()
        },
    ]
}

/// A ball whose triangles are shuffled and begin at another corner.
fn shuffled_ball(shuffle: f64) -> Setup {
    let mut mesh = crate::chart::ball(24);
    let count = mesh.triangles.len();
    let shuffle = shuffle as usize;
    // A stride that has no divisor in common with the count passes each once.
    let stride = (0..shuffle).fold(1, |stride, _| {
        let is_prime_to =
            |n: usize| (2..=n.min(count)).all(|d| !(n.is_multiple_of(d) && count.is_multiple_of(d)));
        (stride + 2..).find(|&n| is_prime_to(n)).unwrap_or(1)
    });
    mesh.triangles = (0..count)
        .map(|t| {
            let mut triangle = mesh.triangles[t * stride % count];
            triangle.rotate_left(shuffle % 3);
            triangle
        })
        .collect();
    let mut scene = studio();
    scene.objects.push(Object::new("ball", Shape::Mesh(mesh), 0));
    setup(scene, look(DVec3::new(1.0, 2.0, 5.0), DVec3::ZERO, 0.6))
}

/// Hills of voxels, and a box that is dug out of them when so many bands are finished.
fn edited_hills(bands: f64) -> Setup {
    // Both the hills and the hole reach into a second chunk of 64 cells.
    const SIZE: [u32; 3] = [72, 42, 40];
    let mut scene = studio();
    let hills = Voxels::from_fn(SIZE, |x, y, z| {
        let height = 24.0 + 8.0 * (f64::from(x) * 0.15).sin() + 8.0 * (f64::from(z) * 0.11).cos();
        u8::from(f64::from(y) < height)
    });
    scene.objects.push(Object { materials: vec![0, 1], ..Object::new("hills", Shape::Voxels(hills), 0) });
    let view = look(DVec3::new(100.0, 80.0, 114.0), DVec3::new(36.0, 18.0, 20.0), 0.6);
    Setup { load: bands, edit: dig, ..setup(scene, view) }
}

fn dig(scene: &mut Scene) {
    let Some(object) = scene.objects.first_mut() else { return };
    if let Shape::Voxels(voxels) = Arc::make_mut(&mut object.shape) {
        for i in 0..24 * 40 * 24 {
            let [x, y, z] = [i % 24, i / 24 % 40, i / 960];
            voxels.set(44 + x, y, 14 + z, if y < 3 { 2 } else { 0 });
        }
    }
}

/// A row of so many pixels through the still life.
fn strip(pixels: f64) -> Setup {
    let scene = scenes::motion(1.0).scene;
    let across = scene.bounds().radius() * 2.0;
    let view = Projection::Orthographic { height: across / pixels };
    let mut camera = front(&scene);
    camera.projection = view;
    let mut setup = setup((*scene).clone(), camera);
    (setup.need.width, setup.need.height) = (pixels as u32, 1);
    setup
}

/// Balls so many pixels large, each at another place in its pixel.
fn specks(size: f64) -> Setup {
    let mut scene = studio();
    let camera =
        Camera::look_at(DVec3::Z * 9.0, DVec3::ZERO, DVec3::Y, Projection::Orthographic { height: 7.2 });
    let pixel = camera.view(scenes::WIDTH, scenes::HEIGHT).pixel_size(9.0);
    let shape = Arc::new(Shape::Primitive(Primitive::Sphere { radius: size * 0.5 * pixel }));
    for i in 0..63 {
        let [column, row] = [i % 9, i / 9].map(f64::from);
        let place = DVec3::new(column - 4.0 + row * 0.013, row - 3.0 + column * 0.017, 0.0);
        let ball = Object::new("speck", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), 0).at(place);
        scene.objects.push(Object { shape: shape.clone(), ..ball });
    }
    setup(scene, camera)
}

/// A room of six walls, seen from within; the sun is outside.
fn closed_room(thickness: f64) -> Setup {
    let mut scene = studio();
    scene.lights = vec![Light::directional(DVec3::new(-0.5, -0.8, -0.6))];
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut size = DVec3::splat(4.0 + 2.0 * thickness);
            size[axis] = thickness;
            let mut place = DVec3::ZERO;
            place[axis] = side * (2.0 + thickness * 0.5);
            let wall = Shape::Primitive(Primitive::Box { size });
            scene.objects.push(Object::new("wall", wall, axis % 2).at(place));
        }
    }
    setup(scene, look(DVec3::new(1.6, 0.7, 1.7), DVec3::new(-1.0, -1.2, -1.0), 1.2))
}
