//! Do the same shapes as mesh, volume and voxels agree with closed forms, within the bounds that are stated?

mod common;

use common::{model, models};
use polyptych::convert::{Converter, Detail, Filling};
use polyptych::prelude::*;
use polyptych::seam::Control;
use std::f64::consts::PI;

/// Volumes and areas of the truth set.
const SPHERE: (f64, f64) = (4.0 / 3.0 * PI, 4.0 * PI);
const TORUS: (f64, f64) = (2.0 * PI * PI * 0.7 * 0.09, 4.0 * PI * PI * 0.7 * 0.3);

#[test]
fn meshes_of_the_truth_set_enclose_the_volume_within_a_layer_of_their_error() {
    let Some(folder) = models() else { return };
    // The chord error of the coarsest ring bounds the distance from the true surface.
    let sagitta = |radius: f64, steps: f64| radius * (1.0 - (PI / steps).cos());
    for (file, (volume, area), bound) in [
        ("sphere_8x16.obj", SPHERE, sagitta(1.0, 16.0) * 2.0),
        ("sphere_32x64.obj", SPHERE, sagitta(1.0, 64.0) * 2.0),
        ("torus_24.obj", TORUS, sagitta(1.0, 24.0) + sagitta(0.3, 12.0)),
        ("torus_96.obj", TORUS, sagitta(1.0, 96.0) + sagitta(0.3, 48.0)),
    ] {
        let scene = model(&folder.join("mesh/truth").join(file));
        let Shape::Mesh(mesh) = &*scene.objects[0].shape else { panic!("{file} is a mesh") };
        assert!((mesh.volume() - volume).abs() <= area * bound, "{file}: {} for {volume}", mesh.volume());
    }
}

#[test]
fn conversions_agree_with_closed_forms_within_their_bounds() {
    let scene = Scene::default();
    let converter = Converter::default();
    for (primitive, (volume, area)) in [
        (Primitive::Sphere { radius: 1.0 }, SPHERE),
        (Primitive::Torus { major: 0.7, minor: 0.3 }, TORUS),
        (Primitive::Box { size: DVec3::splat(1.6) }, (1.6f64.powi(3), 6.0 * 1.6 * 1.6)),
    ] {
        let form = FreeForm::from_primitive(&primitive).expect("a solid");
        for shape in [Shape::Primitive(primitive), Shape::FreeForm(form)] {
            let object = Object::new("truth", shape, 0);
            let detail = Detail { tolerance: 0.004, max_resolution: 256 };
            let mesh = converter.mesh(&scene, &object, detail, &Control::simple()).unwrap();
            let error = (mesh.mesh.volume() - volume).abs();
            assert!(
                error <= area * mesh.bound + 1e-5,
                "{primitive:?}: mesh off by {error}, bound {}",
                mesh.bound
            );

            let voxels = converter
                .voxels(&scene, &object, Detail { max_resolution: 128, ..detail }, &Control::simple())
                .unwrap();
            let cell = voxels.object_from_voxels.matrix3.determinant();
            let error = (voxels.voxels.filled() as f64 * cell - volume).abs();
            assert!(
                error <= area * voxels.bound,
                "{primitive:?}: voxels off by {error}, bound {}",
                voxels.bound
            );

            let field = converter
                .distance(&scene, &object, Detail { max_resolution: 64, ..detail }, &Control::simple())
                .unwrap();
            let inside = field.distances.iter().filter(|d| **d >= 0.0).count() as f64 * field.step.powi(3);
            let error = (inside - volume).abs();
            assert!(
                error <= area * field.bound,
                "{primitive:?}: distances off by {error}, bound {}",
                field.bound
            );
        }
    }
}

#[test]
fn voxel_models_of_the_truth_set_show_the_sphere_and_the_torus() {
    let Some(folder) = models() else { return };
    let scene = model(&folder.join("vox/truth_sphere_64_solid.vox"));
    let Shape::Voxels(voxels) = &*scene.objects[0].shape else { panic!("voxels") };
    let cell = 2.4 / 64.0;
    let volume = voxels.filled() as f64 * f64::powi(cell, 3);
    assert!((volume - SPHERE.0).abs() < SPHERE.1 * cell * 0.1, "{volume}");
}

#[test]
fn volumes_of_the_truth_set_have_their_surface_at_the_level() {
    let Some(folder) = models() else { return };
    for (file, (volume, area)) in [("sphere_64_u8.nrrd", SPHERE), ("torus_96_u8.nrrd", TORUS)] {
        let mut scene = (*model(&folder.join("volume/truth").join(file))).clone();
        let Shape::Volume(field) = &*scene.objects[0].shape else { panic!("{file} is a volume") };
        let mut field = field.clone();
        let point =
            |value: f32, opacity: f32| polyptych::scene::TransferPoint { value, color: Vec3::ONE, opacity };
        field.transfer.points = vec![point(127.0, 0.0), point(129.0, 1.0)];
        scene.objects[0].shape = std::sync::Arc::new(Shape::Volume(field));
        let detail = Detail { tolerance: 0.01, max_resolution: 128 };
        let mesh = Converter::default().mesh(&scene, &scene.objects[0], detail, &Control::simple()).unwrap();
        let error = (mesh.mesh.volume() - volume).abs();
        assert!(error <= area * mesh.bound * 0.25, "{file}: off by {error}, bound {}", mesh.bound);
    }
}

/// Counts the empty cells that water from outside does not reach, through faces or through faces, edges and corners.
fn dry(voxels: &Voxels, corners: bool) -> u64 {
    let size = voxels.size().map(i64::from);
    // A layer of air around the grid.
    let edge = size.map(|s| s + 2);
    let index = |c: [i64; 3]| ((c[2] * edge[1] + c[1]) * edge[0] + c[0]) as usize;
    let mut seen = vec![false; (edge[0] * edge[1] * edge[2]) as usize];
    voxels.for_each_filled(|cell, _| seen[index(cell.map(|c| i64::from(c) + 1))] = true);
    let steps: Vec<[i64; 3]> = (0..27)
        .map(|k: i64| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1])
        .filter(|s| corners || s.iter().map(|c: &i64| c.abs()).sum::<i64>() == 1)
        .collect();
    let mut open = vec![[0; 3]];
    seen[0] = true;
    while let Some(cell) = open.pop() {
        for step in &steps {
            let next: [i64; 3] = std::array::from_fn(|a| cell[a] + step[a]);
            if (0..3).all(|a| (0..edge[a]).contains(&next[a]))
                && !std::mem::replace(&mut seen[index(next)], true)
            {
                open.push(next);
            }
        }
    }
    seen.iter().filter(|seen| !**seen).count() as u64
}

#[test]
fn shells_of_closed_meshes_stop_every_flood_and_enclose_their_volume() {
    let Some(folder) = models() else { return };
    let mut closed = 0;
    for file in [
        "truth/sphere_8x16.obj",
        "truth/sphere_32x64.obj",
        "truth/torus_24.obj",
        "truth/torus_96.obj",
        "stanford-bunny.obj",
        "armadillo.obj",
        "suzanne.obj",
    ] {
        let scene = model(&folder.join("mesh").join(file));
        let object = &scene.objects[0];
        let Shape::Mesh(mesh) = &*object.shape else { panic!("{file} is a mesh") };
        // Vertices that only texture coordinates and rounding keep apart are one.
        let fine = 1e5 / object.shape.bounds().radius() as f32;
        let place = |i: u32| mesh.positions[i as usize].to_array().map(|c| (c * fine).round() as i64);
        let mut edges = std::collections::HashMap::new();
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                if place(a) != place(b) {
                    *edges.entry((place(a).min(place(b)), place(a).max(place(b)))).or_insert(0) += 1;
                }
            }
        }
        let is_closed = edges.values().all(|&n| n == 2);
        closed += u32::from(is_closed);
        let area: f64 = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t).map(Vec3::as_dvec3);
                (b - a).cross(c - a).length() * 0.5
            })
            .sum();
        for resolution in [64, 128] {
            let detail = Detail { tolerance: 0.0, max_resolution: resolution };
            let model = Converter::default().voxels(&scene, object, detail, &Control::simple()).unwrap();
            let (through_faces, through_corners) = (dry(&model.voxels, false), dry(&model.voxels, true));
            let cell = model.object_from_voxels.matrix3.determinant();
            let bound = model.bound / object.world_from_object.matrix3.determinant().cbrt();
            let (full, shell) = (through_faces as f64 * cell, model.voxels.filled() as f64 * cell);
            if is_closed {
                assert_eq!(
                    through_faces, through_corners,
                    "{file} at {resolution}: water comes in at corners"
                );
                let volume = mesh.volume().abs();
                assert!(full <= volume && volume <= full + shell, "{file} at {resolution}: {full}, {volume}");
                let [thin, solid] = [Filling::Thin, Filling::Solid].map(|filling| {
                    let converter = Converter::default();
                    converter
                        .voxels_filled(&scene, object, detail, filling, &Control::simple())
                        .unwrap()
                        .voxels
                        .clone()
                });
                // What is thin stops water over faces only, with fewer cells.
                assert!(thin.filled() < model.voxels.filled() * 7 / 10, "{file} at {resolution}");
                assert!(
                    dry(&thin, false) > through_faces,
                    "{file} at {resolution}: water comes in over faces"
                );
                let off = (solid.filled() as f64 * cell - volume).abs();
                assert!(off < 0.03 * area * cell.cbrt(), "{file} at {resolution}: a volume off by {off}");
                assert!(shell <= 2.0 * area * bound, "{file} at {resolution}: a shell of {shell}");
            } else {
                assert!(shell > 0.0, "{file} at {resolution}: an open mesh is its surface");
            }
        }
    }
    assert!(closed >= 4, "{closed} of the meshes are closed");
}
