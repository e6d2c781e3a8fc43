//! Does a plugin that takes triangles, and nothing else, draw every model there is, with the bounds of its conversions?

#[path = "common/mod.rs"]
mod common;
#[path = "common/plugins.rs"]
mod libraries;

use common::need;
use libraries::{compiled, folder};
use polyptych::load::{LoadOptions, add_default_view, load};
use polyptych::prelude::*;

use polyptych::seam::Decision;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Lists the files below a folder that are models by their extension.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files(&path, found);
            continue;
        }
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let is_height = extension == "png" && path.to_string_lossy().contains("/height/");
        if is_height
            || ["obj", "gltf", "glb", "vox", "stl", "ply", "nrrd", "nii", "gz"].contains(&extension.as_str())
        {
            found.push(path);
        }
    }
}

/// Models of fewer bytes are quickly drawn.
const SMALL: u64 = 1 << 20;

#[test]
fn every_small_model_is_drawn_from_triangles() {
    draw_all("small", SMALL, 170);
}

#[test]
#[ignore = "takes a minute: 254 models, some of a million triangles"]
fn every_model_is_drawn_from_triangles() {
    draw_all("all", u64::MAX, 250);
}

/// Draws all models of up to so many bytes, of which there are at least so many.
fn draw_all(name: &str, most_bytes: u64, least: usize) {
    let Some(models) = common::models() else { return };
    let library = folder(name).join("libfacets.so");
    let Some(()) = compiled("plugins/examples/facets/facets.c", &library, &["-std=c99"]) else { return };
    let mut registry = Registry::default();
    registry
        .load_with(
            &library,
            &polyptych::plugins::Options {
                isolation: polyptych::plugins::Isolation::InProcess,
                ..Default::default()
            },
        )
        .unwrap();
    let mut studio = Studio::new(registry, 2).unwrap();
    let mut all = Vec::new();
    for kind in ["mesh", "gltf", "vox", "height", "volume"] {
        files(&models.join(kind), &mut all);
    }
    all.retain(|path| path.metadata().is_ok_and(|m| m.len() <= most_bytes));
    let (mut drawn, mut converted, mut refused) = (0, 0, 0);
    for path in &all {
        let height_map = path.extension().is_some_and(|e| e == "png");
        let options = LoadOptions { height_map, ..LoadOptions::default() };
        // What the loaders refuse is the matter of their own tests.
        let Ok(mut scene) = load(path, &options) else {
            refused += 1;
            continue;
        };
        add_default_view(&mut scene);
        let scene = Arc::new(scene);
        let need = Need {
            tolerance_px: 2.0,
            channels: Channels::of(&[Channel::Color, Channel::Distance]),
            ..need(&scene, 32, 18)
        };
        let drawing =
            studio.draw("facets", &scene, &need).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        for (object, decision) in scene.objects.iter().zip(drawing.prepared.objects.iter()) {
            let fits = match (&*object.shape, decision) {
                (_, Decision::Skipped { why }) => !object.is_drawable() && !why.is_empty(),
                (Shape::Mesh(_), Decision::Exact | Decision::Approximated { .. }) => true,
                (Shape::Volume(_), Decision::Approximated { why }) => why.contains("triangles"),
                (_, Decision::Converted { bound, .. }) => bound.is_finite(),
                (_, Decision::Approximated { why }) => why.contains("m off"),
                _ => false,
            };
            assert!(fits, "{}: {}: {decision:?}", path.display(), object.name);
            converted += usize::from(!matches!(*object.shape, Shape::Mesh(_)));
        }
        assert_eq!(drawing.framebuffer.count_not_finite(), 0, "{}", path.display());
        drawn += 1;
    }
    eprintln!(
        "{drawn} of {} models drawn, {converted} objects converted, {refused} refused by loaders",
        all.len()
    );
    assert!(drawn >= least && converted > 40, "{drawn} drawn, {converted} converted");
}
