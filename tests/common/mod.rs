//! What the integration tests share: a studio, and where the model collection is.

#![allow(dead_code, reason = "each test uses its own part")]

use polyptych::prelude::*;
use polyptych::scene::Scene;
use std::path::PathBuf;
use std::sync::Arc;

/// Opens a studio with all built-in back ends.
pub(crate) fn studio(threads: usize) -> Studio {
    Studio::new(Registry::builtin(), threads).expect("threads start")
}

/// Returns a built-in scene.
pub(crate) fn builtin(name: &str) -> Arc<Scene> {
    Arc::new(polyptych::builtin::scene(name).expect("a built-in scene"))
}

/// Returns the need of a picture through a scene's first camera.
pub(crate) fn need(scene: &Scene, width: u32, height: u32) -> Need {
    Need { channels: Channels::ALL, ..Need::new(scene.cameras[0].1.clone(), width, height) }
}

/// Finds the collection of models: `POLYPTYCH_MODELS`, or `shared/models` beside the checkout.
///
/// Without it a test says that it is skipped; in CI it fails.
pub(crate) fn models() -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/models");
    let folder = std::env::var_os("POLYPTYCH_MODELS").map_or(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(std::env::var_os("CI").is_none(), "{} is missing: CI needs the models", folder.display());
    eprintln!("skipped: {} is missing (set POLYPTYCH_MODELS)", folder.display());
    None
}

/// Loads a model of the collection.
pub(crate) fn model(path: &std::path::Path) -> Arc<Scene> {
    let options = polyptych::load::LoadOptions {
        height_map: path.extension().is_some_and(|e| e == "png"),
        ..polyptych::load::LoadOptions::default()
    };
    Arc::new(polyptych::load::load(path, &options).unwrap_or_else(|e| panic!("{e}")))
}
