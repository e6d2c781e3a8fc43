//! Is nothing lost: scenes that are saved, files that are wrong, sessions that are killed?

use crate::harness::{rest, window, window_of};
use egui_kittest::kittest::Queryable;
use polyptych::BuiltinBackends;
use polyptych::scene::Shape;
use polyptych::seam::Registry;
use polyptych_viewer::{Action, Viewer};
use std::path::PathBuf;
use std::time::{Duration, Instant};

fn folder(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("polyptych-viewer-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&path).unwrap();
    path
}

#[test]
fn a_scene_is_saved_opened_and_followed() {
    let folder = folder("save");
    let file = folder.join("mine.ron");
    let mut harness = window("polyhedra");
    let ctx = harness.ctx.clone();
    harness.state_mut().perform(Action::Front, &ctx);
    let count = harness.state().scene().objects.len();
    harness.state_mut().save_to(file.clone(), &ctx);
    rest(&mut harness);
    assert!(harness.state().message().starts_with("saved "), "{}", harness.state().message());
    harness.state_mut().open(&file.to_string_lossy(), &ctx);
    rest(&mut harness);
    assert_eq!(harness.state().scene().objects.len(), count);
    // Another program writes it: it is read again, seen as before, and undo leads back.
    harness.state_mut().perform(Action::Watch, &ctx);
    harness.state_mut().perform(Action::Top, &ctx);
    let eye = harness.state().camera().eye;
    std::thread::sleep(Duration::from_millis(50));
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replacen("name: \"polyhedra\"", "name: \"other\"", 1)).unwrap();
    let begin = Instant::now();
    while harness.state().scene().name != "other" {
        assert!(begin.elapsed() < Duration::from_secs(20), "the change is never seen");
        std::thread::sleep(Duration::from_millis(20));
        harness.step();
    }
    assert_eq!(harness.state().camera().eye, eye);
    harness.state_mut().perform(Action::Undo, &ctx);
    assert_eq!(harness.state().scene().name, "polyhedra");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn what_cannot_be_opened_is_said_and_nothing_is_lost() {
    let folder = folder("wrong");
    let mut harness = window("polyhedra");
    let (ctx, name) = (harness.ctx.clone(), harness.state().scene().name.clone());
    let broken = folder.join("broken.glb");
    std::fs::write(&broken, b"glTF but not really").unwrap();
    for file in ["/nowhere/nothing.obj", &broken.to_string_lossy()] {
        harness.state_mut().open(file, &ctx);
        rest(&mut harness);
        assert_eq!(harness.state().scene().name, name);
        assert!(harness.query_by_label_contains(file).is_some(), "the reason is shown");
    }
    harness.state_mut().save_to(PathBuf::from("/nowhere/scene.ron"), &ctx);
    rest(&mut harness);
    assert!(harness.state().message().contains("/nowhere/scene.ron"), "{}", harness.state().message());
    harness.state_mut().open("builtin:quadrics", &ctx);
    rest(&mut harness);
    assert_eq!(harness.state().scene().name, "quadrics");
    std::fs::remove_dir_all(folder).unwrap();
}

/// A file that somebody let go over the window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl eframe::egui::DroppedFile for Dropped {
    fn path(&self) -> &std::path::Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

#[test]
fn what_is_dropped_is_opened() {
    let folder = folder("drop");
    let (roof, floor, broken) =
        (folder.join("roof.obj"), folder.join("floor.ply"), folder.join("broken.glb"));
    std::fs::write(&roof, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0\n1 0 0\n0 0 1\n3 0 1 2\n";
    std::fs::write(&floor, ply).unwrap();
    std::fs::write(&broken, b"glTF but not really").unwrap();
    let mut harness = window("polyhedra");
    let drop = |harness: &mut egui_kittest::Harness<'_, Viewer>, files: &[&PathBuf]| {
        let files = files.iter().map(|file| {
            let file: std::sync::Arc<dyn eframe::egui::DroppedFile + Send + Sync> =
                std::sync::Arc::new(Dropped((*file).clone()));
            file
        });
        harness.input_mut().dropped_files = files.collect();
        harness.step();
        rest(harness);
    };
    for (file, name) in [(&roof, "roof"), (&floor, "floor")] {
        drop(&mut harness, &[file]);
        assert_eq!(harness.state().scene().name, name, "{}", harness.state().message());
    }
    drop(&mut harness, &[&broken]);
    assert_eq!(harness.state().scene().name, "floor");
    assert!(harness.state().message().contains("broken.glb"), "{}", harness.state().message());
    drop(&mut harness, &[&roof, &floor]);
    assert_eq!(harness.state().scene().name, "floor");
    assert_eq!(harness.state().message(), "2 files were dropped: drop one at a time");
    std::fs::remove_dir_all(folder).unwrap();
}

fn kept(folder: &std::path::Path) -> Viewer {
    let scene = polyptych::builtin::scene("polyhedra").unwrap();
    let mut viewer = Viewer::new(Registry::builtin(), scene).unwrap();
    viewer.keep_in(folder.to_owned());
    viewer
}

#[test]
fn settings_and_panes_persist() {
    let folder = folder("keep");
    let mut harness = window_of(kept(&folder));
    let ctx = harness.ctx.clone();
    assert!(harness.query_by_label("Begin").is_some(), "the first start says how");
    harness.get_by_label("Begin").click();
    for action in [
        Action::Backend(2),
        Action::AddPane,
        Action::Wipe,
        Action::Values,
        Action::Theme,
        Action::NextChannel,
    ] {
        harness.state_mut().perform(action, &ctx);
    }
    rest(&mut harness);
    let shown: Vec<_> = harness.state().shown().map(str::to_owned).collect();
    drop(harness);
    let harness = window_of(kept(&folder));
    assert_eq!(harness.state().shown().collect::<Vec<_>>(), shown);
    assert_eq!(harness.state().is_on(Action::Wipe), Some(true));
    assert_eq!(harness.state().is_on(Action::Values), Some(true));
    assert!(harness.query_by_label("Begin").is_none(), "only the first");
    std::fs::remove_dir_all(folder).unwrap();
}

/// Edits a scene and is killed: run by the test below, in a process of its own.
#[test]
#[ignore = "run by the test that kills it"]
fn edits_until_it_is_killed() {
    let Some(folder) = std::env::var_os("POLYPTYCH_TEST_FOLDER") else { return };
    let mut harness = window_of(kept(&PathBuf::from(folder)));
    let ctx = harness.ctx.clone();
    harness.state_mut().name_scene("builtin:polyhedra");
    harness.state_mut().choose(0);
    harness.state_mut().perform(Action::Duplicate, &ctx);
    loop {
        harness.step();
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn what_a_killed_session_did_not_save_is_offered_again() {
    let folder = folder("killed");
    let mut child = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "files::edits_until_it_is_killed", "--ignored"])
        .env("POLYPTYCH_TEST_FOLDER", &folder)
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let file = folder.join(format!("unsaved-{}.ron", child.id()));
    let begin = Instant::now();
    while !file.exists() {
        assert!(begin.elapsed() < Duration::from_secs(60), "nothing was kept");
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let mut harness = window_of(kept(&folder));
    let count = harness.state().scene().objects.len();
    harness.get_by_label("Restore them").click();
    rest(&mut harness);
    let scene = harness.state().scene().clone();
    assert_eq!(scene.objects.len(), count + 1);
    assert!(scene.objects[count].name.ends_with("(copy)"));
    assert!(matches!(&*scene.objects[count].shape, Shape::Primitive(_)));
    assert!(harness.query_by_label("Restore them").is_none());
    assert!(harness.query_by_label_contains("unsaved changes").is_some(), "it still is not saved");
    assert!(!file.exists(), "now this session keeps it");
    std::fs::remove_dir_all(folder).unwrap();
}
