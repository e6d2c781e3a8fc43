//! Are the pictures the same pictures? Back ends against the reference, in one table.

mod common;

use common::{builtin, model, models, need, studio};
use polyptych::metrics::{Errors, Gate};
use polyptych::prelude::*;
use std::sync::Arc;

/// Size of the pictures. The reference reads textures at one point a pixel: much smaller pictures would compare its
/// aliasing with the mip levels of others.
const SIZE: [u32; 2] = [640, 360];

/// Draws a scene with a back end and the reference and returns the errors; the gate must hold.
fn agree(backend: &str, scene: &Arc<Scene>, name: &str) -> Errors {
    let mut studio = studio(2);
    let need = need(scene, SIZE[0], SIZE[1]);
    let reference = studio.draw("reference", scene, &need).unwrap_or_else(|e| panic!("{e}")).framebuffer;
    let picture = studio.draw(backend, scene, &need).unwrap_or_else(|e| panic!("{e}")).framebuffer;
    let errors = Errors::between(&picture, &reference);
    let verdict = Gate::EDGE_TOLERANT.judge(&errors, u64::from(SIZE[0] * SIZE[1]));
    if !verdict.passed {
        // A failing picture is left with its reference.
        let folder = std::env::temp_dir().join("polyptych-agreement");
        for (which, picture) in [("reference", &reference), (backend, &picture)] {
            let file = folder.join(format!("{}-{which}.png", name.replace(['/', '.'], "-")));
            polyptych::picture::save(picture, Channel::Color, &file).unwrap_or_else(|e| panic!("{e}"));
        }
        panic!(
            "{backend} on {name}: {}; pictures in {}; again: polyptych compare {name} -b {backend} --size 640x360 --gate",
            verdict.failed.join(", "),
            folder.display()
        );
    }
    errors
}

/// Distances of a back end on its own kind of shape; the bound of each with its reason.
fn assert_distances(errors: &Errors, relative: f64, name: &str) {
    let distance = errors.distance.unwrap_or_default();
    assert!(distance.relative <= relative, "{name}: relative distance error {:e}", distance.relative);
}

#[test]
fn built_in_scenes_agree_with_the_reference() {
    // Distances in a picture are right to 6e-8 of themselves (single precision). The rasterizer's ball and ring are
    // tessellated to half a pixel: 0.5 * 2 tan(0.35) / 360 of the distance.
    for (backend, scene, relative) in [
        ("raster", "polyhedra", 1.1e-3),
        ("voxel", "figure", 1e-7),
        ("freeform", "polyhedra", 1e-6),
        ("freeform", "quadrics", 1e-6),
        ("freeform", "terrain", 1e-6),
        ("freeform", "cloud", 1e-3),
    ] {
        let errors = agree(backend, &builtin(scene), &format!("builtin:{scene}"));
        assert_distances(&errors, relative, scene);
    }
}

#[test]
fn models_agree_with_the_reference() {
    let Some(folder) = models() else { return };
    for (backend, path) in [
        ("raster", "mesh/stanford-bunny.obj"),
        ("raster", "mesh/spot/spot.obj"),
        ("raster", "mesh/suzanne.obj"),
        ("raster", "gltf/trimesh/Duck.glb"),
        ("voxel", "vox/ogt_test_groups.vox"),
        ("voxel", "vox/monu10.vox"),
        ("freeform", "height/maunga_whau_volcano_16.png"),
    ] {
        agree(backend, &model(&folder.join(path)), path);
    }
}

#[test]
fn the_voxel_walk_has_no_error_of_its_own() {
    let Some(folder) = models() else { return };
    for path in ["vox/chr_knight.vox", "vox/menger.vox", "vox/teapot.vox"] {
        let errors = agree("voxel", &model(&folder.join(path)), path);
        assert_eq!(errors.id_agreement, Some(1.0), "{path}");
        assert_distances(&errors, 1e-7, path);
        assert!(errors.color.is_some_and(|c| c.rmse < 1e-3), "{path}: {:?}", errors.color);
    }
}

/// Off a band of one pixel along edges of cells, every pixel of every model shows the same face at the same distance.
#[test]
fn every_voxel_model_is_seen_as_the_reference_sees_it() {
    let Some(folder) = models() else { return };
    let mut files: Vec<_> =
        std::fs::read_dir(folder.join("vox")).unwrap().map(|f| f.unwrap().path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "vox"));
    files.sort();
    assert!(files.len() > 30, "{} models", files.len());
    let (mut studio, [width, height]) = (studio(2), [240usize, 135]);
    let mut seen = 0;
    for file in files {
        let scene = model(&file);
        let need = need(&scene, width as u32, height as u32);
        let reference = studio.draw("reference", &scene, &need).unwrap_or_else(|e| panic!("{e}")).framebuffer;
        let picture = studio.draw("voxel", &scene, &need).unwrap_or_else(|e| panic!("{e}")).framebuffer;
        let face = |i: usize| (reference.id()[i], reference.normal()[i].to_array().map(f32::to_bits));
        let mut different = Vec::new();
        for y in 1..height - 1 {
            for x in 1..width - 1 {
                let i = y * width + x;
                let is_edge = (0..9).any(|k| face(i + k / 3 * width + k % 3 - width - 1) != face(i));
                let (a, b) = (picture.distance()[i], reference.distance()[i]);
                let same = (a == b || (a - b).abs() <= 1e-6 * b)
                    && picture.id()[i] == reference.id()[i]
                    && (picture.normal()[i] - reference.normal()[i]).length() < 1e-6
                    && picture.albedo()[i] == reference.albedo()[i];
                if !same && !is_edge {
                    different.push((x, y));
                }
                seen += u32::from(reference.id()[i] != 0);
            }
        }
        assert!(different.is_empty(), "{}: {different:?}", file.display());
    }
    assert!(seen > 100_000, "{seen} pixels show something");
}

#[test]
fn a_camera_given_as_a_table_of_directions_is_drawn_by_every_back_end() {
    // A curved screen: a turn of 2 radians from left to right, bent upward in the middle.
    let (columns, rows) = (17u32, 9u32);
    let directions = (0..columns * rows).map(|i| {
        let [u, v] = [f64::from(i % columns) / 16.0 - 0.5, f64::from(i / columns) / 8.0 - 0.5];
        DVec3::new((2.0 * u).sin(), -v - 0.3 * u * u, -(2.0 * u).cos())
    });
    let table = polyptych::camera::WarpTable::new(columns, rows, directions.collect()).unwrap();
    let mut scene = (*builtin("polyhedra")).clone();
    scene.cameras[0].1.projection = Projection::Warp(Arc::new(table));
    // Raster copies the nearest pixel of a face of a cube, at most a third of a pixel away.
    let scene = Arc::new(scene);
    let need = need(&scene, 320, 180);
    let mut studio = studio(2);
    let reference = studio.draw("reference", &scene, &need).unwrap_or_else(|e| panic!("{e}")).framebuffer;
    let drawn = reference.id().iter().filter(|id| **id != 0).count();
    assert!(drawn > 1500 && drawn < 320 * 180, "{drawn} pixels show something");
    for (backend, least) in [("raster", 0.98), ("freeform", 0.995), ("stylized", 0.98)] {
        let picture = studio.draw(backend, &scene, &need).unwrap_or_else(|e| panic!("{e}")).framebuffer;
        let agreement = Errors::between(&picture, &reference).id_agreement.unwrap_or(0.0);
        assert!(agreement >= least, "{backend}: {agreement} of the pixels show the same object");
    }
}
