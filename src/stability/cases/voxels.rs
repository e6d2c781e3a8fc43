//! Which cases are about grids of voxels, and about what is turned into grids?

use super::super::count::{Count, Way};
use super::super::scenes::{HEIGHT, Setup, look, perspective, setup, studio};
use super::{Case, base, powers};
use crate::camera::{Camera, Projection};
use crate::prelude::{DAffine3, DQuat, DVec3, Material, Mesh, Object, Primitive, Shape, Vec3, Voxels};
use std::sync::Arc;

pub(super) fn cases() -> Vec<Case> {
    let offsets = || vec![0.1, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 0.0];
    vec![
        Case {
            id: "voxel-edges",
            title: "A wall of voxels, seen straight, with rays nearer and nearer to the edges between cells",
            parameter: "distance of rays from an edge, cells",
            values: offsets(),
            is_logarithmic: false,
            limit: 0.0,
            counted: "share of holes",
            is_promise: true,
            backends: &["raster", "voxel"],
            build: voxel_edges,
            count: Count::Hole,
            ..base()
        },
        Case {
            id: "voxel-corners",
            title: "Steps of voxels, seen from 45 degrees, with rays nearer and nearer to their corners",
            parameter: "distance of rays from a corner, cells",
            values: offsets(),
            is_logarithmic: false,
            limit: 0.0,
            counted: "share of holes",
            is_promise: true,
            backends: &["raster", "voxel"],
            build: voxel_corners,
            count: Count::Hole,
            ..base()
        },
        Case {
            id: "near-voxels",
            is_method: true,
            title: "The eye before a corner of voxels, on it, and inside",
            parameter: "eye to face, cells",
            values: vec![4.0, 1.0, 0.1, 1e-3, 1e-6, 1e-9, 0.0, -1e-9, -1e-6, -1e-3, -0.1, -1.0, -4.0],
            is_logarithmic: false,
            limit: 0.02,
            counted: "wrong objects, or distance error p99 over the distance",
            build: near_voxels,
            count: Count::Distance,
            ..base()
        },
        Case {
            id: "edits",
            title: "A grid of voxels after more and more edits, each made ready by itself",
            parameter: "edits",
            values: vec![1.0, 4.0, 16.0, 64.0],
            limit: 0.0,
            counted: "share of pixels that differ from the same grid built afresh",
            is_promise: true,
            backends: &["reference", "raster", "voxel"],
            build: edits,
            count: Count::Edited,
            ..base()
        },
        Case {
            id: "long-grids",
            title: "A tunnel of voxels, longer and longer, with a wall at its end",
            parameter: "cells",
            values: vec![100.0, 316.0, 1000.0, 3162.0, 10_000.0],
            limit: 0.0,
            counted: "share of holes",
            is_promise: true,
            backends: &["raster", "voxel"],
            build: tunnel,
            count: Count::Hole,
            ..base()
        },
        Case {
            id: "floods",
            title: "A hollow ball of triangles as finer and finer voxels, with water around it",
            parameter: "cells along an edge",
            values: vec![16.0, 23.0, 32.0, 47.0, 64.0, 97.0, 128.0],
            limit: 0.0,
            counted: "share of the cells inside that water reaches through faces, edges and corners of cells",
            is_promise: true,
            backends: &["voxel"],
            build: hollow_ball,
            count: Count::Flood(Way::Corners),
            ..base()
        },
        Case {
            id: "thin-floods",
            title: "The same ball as the fewest voxels that stop water over faces",
            parameter: "cells along an edge",
            values: vec![16.0, 23.0, 32.0, 47.0, 64.0, 97.0, 128.0],
            limit: 0.0,
            counted: "share of the cells inside that water reaches through faces of cells",
            is_promise: true,
            backends: &["voxel"],
            build: thin_ball,
            count: Count::Flood(Way::Faces),
            ..base()
        },
        Case {
            id: "mirrors",
            is_method: true,
            title: "A ball between two mirrors of voxels, with fewer and fewer reflections",
            parameter: "reflections",
            values: vec![8.0, 6.0, 4.0, 3.0, 2.0, 1.0, 0.0],
            is_logarithmic: false,
            limit: 0.02,
            counted: "color error (RMSE) to sixteen reflections",
            backends: &["reference", "voxel"],
            build: mirrors,
            count: Count::Color,
            ..base()
        },
        Case {
            id: "open-meshes",
            title: "A ball of which more and more triangles are missing",
            parameter: "share of triangles missing",
            values: vec![0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5],
            is_logarithmic: false,
            limit: 0.05,
            counted: "1 - silhouette IoU, or share of false shadows",
            build: |share| broken_ball(share, |mesh, t| mesh.triangles[t] = [0; 3]),
            count: Count::Silhouette,
            ..base()
        },
        Case {
            id: "turned-triangles",
            title: "A ball of which more and more triangles are turned over",
            parameter: "share of triangles turned",
            values: vec![0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5],
            is_logarithmic: false,
            limit: 0.05,
            counted: "1 - silhouette IoU, or share of false shadows",
            build: |share| broken_ball(share, |mesh, t| mesh.triangles[t].swap(1, 2)),
            count: Count::Silhouette,
            ..base()
        },
        Case {
            id: "warped-quads",
            title: "A box with corners of its walls nearer and nearer together",
            parameter: "width over length of triangles",
            values: powers(-1, -9),
            limit: 0.05,
            counted: "1 - silhouette IoU, or share of false shadows",
            build: needle_box,
            count: Count::Silhouette,
            ..base()
        },
    ]
}

/// Numbers in [0, 1), always the same.
fn noise(i: u32) -> f64 {
    let mixed = (u64::from(i) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 40) as f64 / (1u64 << 24) as f64
}

/// A wall of two colors, thick enough that no ray passes it, larger than the picture.
fn wall() -> Shape {
    Shape::Voxels(Voxels::from_fn([80, 80, 4], |x, y, _| 1 + ((x + y) % 2) as u8))
}

/// The wall, seen along z, four pixels to a cell; each fourth ray runs so far beside an edge.
fn voxel_edges(distance: f64) -> Setup {
    let mut scene = studio();
    scene.objects.push(Object { materials: vec![0, 1], ..Object::new("wall", wall(), 0) });
    let projection = Projection::Orthographic { height: f64::from(HEIGHT) / 4.0 };
    let place = DVec3::new(40.0 - 0.125 + distance, 40.0 + 0.125 + distance, 10.0);
    setup(scene, Camera::look_at(place, place - DVec3::Z, DVec3::Y, projection))
}

/// Steps of cells, seen across: each fourth ray runs so far beside the line in which cells meet.
fn voxel_corners(distance: f64) -> Setup {
    let mut scene = studio();
    // Cells that share only edges with the next: a ray between two of them is a hole.
    let steps = Voxels::from_fn([64, 80, 64], |x, _, z| u8::from(x + z == 64 || x + z == 63));
    scene.objects.push(Object::new("steps", Shape::Voxels(steps), 0));
    let pitch = std::f64::consts::FRAC_1_SQRT_2 / 4.0;
    let projection = Projection::Orthographic { height: f64::from(HEIGHT) * pitch };
    let across = DVec3::new(1.0, 0.0, -1.0).normalize_or(DVec3::X);
    let place = DVec3::new(72.0, 40.1, 72.0) - across * (0.5 * pitch - distance);
    setup(scene, Camera::look_at(place, place - DVec3::new(1.0, 0.0, 1.0), DVec3::Y, projection))
}

/// A ball of cells with the eye so far before a corner that four of them share; negative is inside.
fn near_voxels(gap: f64) -> Setup {
    let mut scene = studio();
    let ball = Voxels::from_fn([16; 3], |x, y, z| {
        let p = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - 7.5;
        u8::from(p.length() < 8.0)
    });
    scene.objects.push(Object::new("ball", Shape::Voxels(ball), 0));
    let wall = Shape::Primitive(Primitive::Box { size: DVec3::new(300.0, 300.0, 4.0) });
    scene.objects.push(Object::new("wall", wall, 1).at(DVec3::new(8.0, 8.0, -20.0)));
    let eye = DVec3::new(8.0, 8.0, 16.0 + gap);
    setup(scene, look(eye, eye + DVec3::new(0.2, 0.1, -1.0), 0.9))
}

/// Hills of cells and so many edits of them: boxes that are filled or cleared, across borders of chunks.
fn edits(count: f64) -> Setup {
    const EDGE: u32 = 72;
    let mut scene = studio();
    let mut hills = Voxels::from_fn([EDGE, EDGE, EDGE], |x, y, z| {
        let height = 20.0 + 8.0 * (f64::from(x) * 0.15).sin() + 8.0 * (f64::from(z) * 0.11).cos();
        u8::from(f64::from(y) < height)
    });
    let view = look(DVec3::new(100.0, 80.0, 130.0), DVec3::new(36.0, 20.0, 36.0), 0.6);
    scene
        .objects
        .push(Object { materials: vec![0, 1], ..Object::new("hills", Shape::Voxels(hills.clone()), 0) });
    let mut history = vec![Arc::new(scene.clone())];
    for edit in 0..count as u32 {
        let at = |k: u32| (noise(edit * 8 + k) * f64::from(EDGE - 12)) as u32;
        let (low, size) = ([at(0), at(1), at(2)], 1 + (noise(edit * 8 + 3) * 11.0) as u32);
        let value = (noise(edit * 8 + 4) * 3.0) as u8;
        for i in 0..size.pow(3) {
            let [x, y, z] = [i % size, i / size % size, i / (size * size)];
            hills.set(low[0] + x, low[1] + y, low[2] + z, value);
        }
        scene.objects[0].shape = Arc::new(Shape::Voxels(hills.clone()));
        history.push(Arc::new(scene.clone()));
    }
    Setup { history, ..setup(scene, view) }
}

/// A floor of so many cells with a wall at its end, seen from just above the other end: no ray can jump far.
fn tunnel(cells: f64) -> Setup {
    let length = cells as u32;
    let tunnel = Voxels::from_fn([8, 8, length], |_, y, z| u8::from(y == 0 || z == 0));
    let mut scene = studio();
    scene.objects.push(Object::new("tunnel", Shape::Voxels(tunnel), 0));
    let eye = DVec3::new(4.0, 2.0, cells + 1.0);
    setup(scene, look(eye, DVec3::new(4.0, 4.0, 0.0), 4.0 / cells))
}

/// A hollow ball of triangles, turned so that none lies along the grid, in so many cells.
fn hollow_ball(cells: f64) -> Setup {
    let mut scene = studio();
    let turned = DAffine3::from_quat(DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(0.7));
    scene.objects.push(Object::new("ball", Shape::Mesh(crate::chart::ball(48)), 0).placed(turned));
    let mut setup = setup(scene, look(DVec3::new(1.0, 1.5, 4.0), DVec3::ZERO, 0.7));
    setup.need.tolerance_px = 1e-3;
    setup.settings.push(("detail.resolution", format!("{cells:.0}")));
    setup
}

fn thin_ball(cells: f64) -> Setup {
    let mut setup = hollow_ball(cells);
    setup.settings.push(("detail.filling", "thin".to_owned()));
    setup
}

/// A room of two mirrors that face each other, with a ball between them.
fn mirrors(reflections: f64) -> Setup {
    let mut scene = studio();
    scene.add_material(Material { reflectivity: 0.8, ..Material::new(Vec3::splat(0.1)) });
    let room = Voxels::from_fn([24, 12, 24], |x, y, z| {
        let p = DVec3::new(f64::from(x) - 11.5, f64::from(y) - 5.0, f64::from(z) - 12.0);
        match () {
            () if z == 0 || z == 23 => 3,
            () if y == 0 => 1 + ((x / 3 + z / 3) % 2) as u8,
            () if p.length() < 3.5 => 2,
            () => 0,
        }
    });
    scene.objects.push(Object { materials: vec![0, 1, 2], ..Object::new("room", Shape::Voxels(room), 0) });
    let mut setup = setup(scene, look(DVec3::new(2.0, 8.0, 21.5), DVec3::new(12.0, 5.0, 1.0), 1.0));
    setup.settings.push(("bounces", format!("{reflections:.0}")));
    setup.ruler_settings.push(("bounces", "16".to_owned()));
    setup
}

/// A ball of which a share of the triangles is changed.
fn broken_ball(share: f64, change: fn(&mut Mesh, usize)) -> Setup {
    let mut mesh = crate::chart::ball(24);
    for t in (0..mesh.triangles.len()).filter(|&t| noise(t as u32) < share) {
        change(&mut mesh, t);
    }
    let mut scene = studio();
    scene.objects.push(Object::new("ball", Shape::Mesh(mesh), 0));
    let floor = Shape::Primitive(Primitive::Box { size: DVec3::new(8.0, 0.4, 8.0) });
    scene.objects.push(Object::new("floor", floor, 1).at(DVec3::Y * -1.3));
    let eye = DVec3::new(1.0, 2.0, 5.0);
    setup(scene, Camera::look_at(eye, DVec3::ZERO, DVec3::Y, perspective(0.7)))
}

/// A closed box whose walls are cut so near to their edges that triangles become needles.
fn needle_box(width: f64) -> Setup {
    let w = width as f32;
    // A prism over a square with an extra corner beside each of its own.
    let ring = [
        [-1.0, -1.0],
        [-1.0 + w, -1.0],
        [1.0, -1.0],
        [1.0, -1.0 + w],
        [1.0, 1.0],
        [1.0 - w, 1.0],
        [-1.0, 1.0],
    ];
    let n = ring.len() as u32;
    let mut mesh = Mesh::default();
    for y in [-1.0, 1.0] {
        mesh.positions.extend(ring.iter().map(|&[x, z]| Vec3::new(x, y, z)));
    }
    for i in 0..n {
        let j = (i + 1) % n;
        mesh.triangles.extend([[i, n + i, j], [j, n + i, n + j]]);
    }
    mesh.triangles.extend((1..n - 1).flat_map(|i| [[0, i, i + 1], [n, n + i + 1, n + i]]));
    let mut scene = studio();
    scene.objects.push(Object::new("box", Shape::Mesh(mesh), 0));
    setup(scene, look(DVec3::new(2.5, 2.0, 4.0), DVec3::ZERO, 0.7))
}
