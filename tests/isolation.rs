//! Does a plugin in a process of its own draw the same, and does nothing that it does take this process down?

#![cfg(target_os = "linux")]

#[path = "common/mod.rs"]
mod common;
#[path = "common/plugins.rs"]
mod libraries;

use common::{builtin, need};
use libraries::{built, compiled, folder};
use polyptych::convert::Converter;
use polyptych::framebuffer::{Band, Framebuffer};
use polyptych::plugins::{Isolation, Limits, LogLine, Options};
use polyptych::prelude::*;
use polyptych::seam::{Control, RenderError, Watcher};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const ZOO: &str = "plugins/fixtures/zoo/zoo.c";

fn options() -> Options {
    Options {
        isolation: Isolation::Child { program: env!("CARGO_BIN_EXE_polyptych").into() },
        limits: Limits { silence: Duration::from_millis(400), stopping: Duration::from_millis(60) },
        ..Options::default()
    }
}

fn registry_with(library: &Path, options: &Options) -> Registry {
    let mut registry = Registry::builtin();
    registry.load_with(library, options).unwrap_or_else(|e| panic!("{e}"));
    registry
}

fn animal(name: &str) -> Option<PathBuf> {
    let library = folder(name).join("libanimal.so");
    compiled(ZOO, &library, &[])?;
    Some(library)
}

#[test]
fn a_plugin_in_a_child_draws_the_same_bytes() {
    let slow = Options { limits: Limits::default(), ..options() };
    let mut linked = Studio::new(Registry::builtin(), 2).unwrap();
    let mut child = Studio::new(registry_with(&built("polyptych_raster_as_plugin"), &slow), 2).unwrap();
    for name in ["atelier", "figure", "quadrics", "terrain", "cloud"] {
        let scene = builtin(name);
        let mut need = Need { tolerance_px: 2.0, ..need(&scene, 97, 61) };
        let mut moved = (*scene).clone();
        moved.objects[0].world_from_object.translation.y += 0.125;
        for (scene, bent) in [(scene.clone(), false), (moved.into(), false), (scene, true)] {
            if bent {
                need.camera.projection = Projection::Cylindrical { fov_x: 3.0, fov_y: 1.0 };
            }
            let one = linked.draw("raster", &scene, &need).unwrap();
            let other = child.draw("raster", &scene, &need).unwrap();
            assert!(one.framebuffer.same_bits(&other.framebuffer), "{name}");
            assert_eq!(one.report.objects, other.report.objects);
            assert_eq!(one.report.counters, other.report.counters);
            let plans = [&mut linked, &mut child].map(|s| s.renderer("raster").unwrap().plan(&scene, &need));
            assert_eq!(plans[0], plans[1]);
        }
    }
}

#[test]
fn two_pictures_at_once_have_memory_of_their_own() {
    let Some(library) = animal("pictures") else { return };
    let mut studio = Studio::new(registry_with(&library, &options()), 1).unwrap();
    let scene = builtin("polyhedra");
    let parameters = studio.registry().info("animal").unwrap().parameters.clone();
    let mut need = need(&scene, 33, 17);
    need.settings.set("animal", &parameters, "fault", "flicker").unwrap();
    // The n-th frame has the color n.
    let first = studio.draw("animal", &scene, &need).unwrap().framebuffer;
    let mut second = studio.draw("animal", &scene, &need).unwrap().framebuffer;
    assert!(first.color().iter().all(|c| c.x == 1.0) && second.color().iter().all(|c| c.x == 2.0));
    studio.render("animal", &need.frame(), &mut second).unwrap();
    assert!(first.color().iter().all(|c| c.x == 1.0) && second.color().iter().all(|c| c.x == 3.0));
    drop(studio);
    assert!(first.color().iter().all(|c| c.x == 1.0), "a picture outlives its renderer");
}

/// Remembers which rows were shown.
#[derive(Default)]
struct Shown(Mutex<Vec<(u32, u32)>>);

impl Watcher for Shown {
    fn finished(&self, band: &Band<'_>) {
        self.0.lock().unwrap().push((band.first_row, band.rows));
    }
}

#[test]
fn nothing_that_a_plugin_does_ends_this_process() {
    let Some(library) = animal("faults") else { return };
    let registry = registry_with(&library, &options());
    let parameters = registry.info("animal").unwrap().parameters.clone();
    let scene = builtin("polyhedra");
    let mut renderer = registry.create("animal").unwrap();
    let converter = Converter::default();
    let with = |fault: &str| {
        let mut need = need(&scene, 64, 40);
        need.settings.set("animal", &parameters, "fault", fault).unwrap();
        need
    };
    let control = Control::simple();
    for (fault, words) in [
        (
            "segfault",
            "`render` crashed: it touched memory that is not its own (signal 11), in row 20 or after it (20 of 40",
        ),
        ("abort", "`render` crashed: it aborted (signal 6), in row 20"),
        ("exit", "`render` crashed: it ended its process with code 0, in row 20"),
        ("overflow", "`render` crashed: it overflowed its stack, in row 20"),
        ("hang", "`render` crashed: it gave no sign for 0.4 s and was ended, in row 20"),
        ("out-of-bounds", "`render` crashed: it touched memory that is not its own (signal 11), in row 20"),
        ("prepare-segfault", "`prepare` crashed: it touched memory that is not its own (signal 11)"),
        ("prepare-hang", "`prepare` crashed: it gave no sign for 0.4 s and was ended"),
        ("fail", "it does not say why"),
        ("garbage-status", "`render` returned 4711, which means nothing"),
    ] {
        let (need, shown) = (with(fault), Shown::default());
        let mut target = Framebuffer::new(64, 40, need.channels);
        let begin = Instant::now();
        let prepared = renderer.prepare(&scene, &need, &converter, &control).map(|_| ());
        let watched = Control::simple().watched_by(&shown);
        let result =
            prepared.and_then(|()| renderer.render(&need.frame(), &mut target, &watched).map(|_| ()));
        eprintln!("{fault}: noticed after {:?}", begin.elapsed());
        let line = result.unwrap_err().to_string();
        assert!(line.starts_with(words) && !line.contains('\n'), "{fault}: {line}");
        if words.contains("in row 20") {
            assert_eq!(*shown.0.lock().unwrap(), [(0, 20)], "{fault}");
            let (done, rest) = target.color().split_at(64 * 20);
            assert!(done.iter().all(|c| c.x == 0.25) && rest.iter().all(|c| c.x == 0.0), "{fault}");
            assert!(target.distance().iter().all(|d| *d == f32::INFINITY));
        }
        // The next picture is drawn.
        let good = with("none");
        let begin = Instant::now();
        renderer.prepare(&scene, &good, &converter, &control).unwrap();
        eprintln!("{fault}: again after {:?}", begin.elapsed());
        renderer.render(&good.frame(), &mut target, &control).unwrap();
        assert!(target.color().iter().all(|c| c.x == 0.25), "{fault}");
    }
    // A renderer whose child died in `render` prepares again by itself.
    let need = with("segfault");
    let mut target = Framebuffer::new(64, 40, need.channels);
    renderer.prepare(&scene, &need, &converter, &control).unwrap();
    for _ in 0..2 {
        let line = renderer.render(&need.frame(), &mut target, &control).unwrap_err().to_string();
        assert!(line.contains("signal 11"), "{line}");
    }
}

#[test]
fn threads_that_a_plugin_leaves_behind_do_no_harm() {
    let Some(library) = animal("threads") else { return };
    let registry = registry_with(&library, &Options { limits: Limits::default(), ..options() });
    let parameters = registry.info("animal").unwrap().parameters.clone();
    let scene = builtin("polyhedra");
    let mut studio = Studio::new(registry, 2).unwrap();
    for fault in ["threads", "threads", "none"] {
        let mut need = need(&scene, 64, 40);
        need.settings.set("animal", &parameters, "fault", fault).unwrap();
        let picture = studio.draw("animal", &scene, &need).unwrap().framebuffer;
        // One number is written by those threads, now or later; all others are the plugin's.
        assert!(picture.color()[1..].iter().all(|c| c.x == 0.25), "{fault}");
    }
}

#[test]
fn a_plugin_that_goes_on_when_it_was_stopped_is_ended() {
    let Some(library) = animal("stop") else { return };
    let registry = registry_with(&library, &options());
    let parameters = registry.info("animal").unwrap().parameters.clone();
    let scene = builtin("polyhedra");
    let mut renderer = registry.create("animal").unwrap();
    for (fault, ends) in [("sleep", false), ("ignore-cancel", true)] {
        let mut need = need(&scene, 64, 40);
        need.settings.set("animal", &parameters, "fault", fault).unwrap();
        renderer.prepare(&scene, &need, &Converter::default(), &Control::simple()).unwrap();
        let (flag, mut target) = (Arc::new(AtomicBool::new(false)), Framebuffer::new(64, 40, need.channels));
        let setter = flag.clone();
        let thread = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(20));
            setter.store(true, Ordering::Relaxed);
        });
        let begin = Instant::now();
        let result = renderer.render(&need.frame(), &mut target, &Control::simple().cancelled_by(&flag));
        eprintln!("{fault}: stopped after {:?}, ended: {ends}", begin.elapsed());
        thread.join().unwrap();
        assert_eq!(result.err(), Some(RenderError::Cancelled), "{fault}");
        need.settings.set("animal", &parameters, "fault", "none").unwrap();
        renderer.prepare(&scene, &need, &Converter::default(), &Control::simple()).unwrap();
        renderer.render(&need.frame(), &mut target, &Control::simple()).unwrap();
    }
}

#[test]
fn refusals_and_crashes_while_opening_are_told() {
    let folder = folder("opening");
    for (option, words) in [
        ("NULL_TABLE", "returned nothing"),
        ("OTHER_MAJOR", "speaks version 2."),
        ("CRASH_IN_ENTRY", "while it was opened: it touched memory that is not its own"),
    ] {
        let library = folder.join(format!("lib{option}.so"));
        let Some(()) = compiled(ZOO, &library, &[&format!("-D{option}")]) else { return };
        let line = Registry::default().load_with(&library, &options()).unwrap_err().to_string();
        assert!(line.contains(words) && line.contains(option) && !line.contains('\n'), "{line}");
    }
    let nobody = Options { isolation: Isolation::Child { program: "/no/such/program".into() }, ..options() };
    let line = Registry::default().load_with(built("polyptych_template"), &nobody).unwrap_err().to_string();
    assert!(line.contains("cannot run in a process of its own"), "{line}");
}

#[test]
fn panics_and_log_lines_come_through() {
    let lines: Arc<Mutex<Vec<LogLine>>> = Arc::default();
    let to = lines.clone();
    let options = Options { log: Arc::new(move |line| to.lock().unwrap().push(line)), ..options() };
    let registry = registry_with(&built("polyptych_panics"), &options);
    let parameters = registry.info("panics").unwrap().parameters.clone();
    let mut studio = Studio::new(registry, 2).unwrap();
    let scene = builtin("polyhedra");
    let mut need = need(&scene, 16, 40);
    need.settings.set("panics", &parameters, "where", "thread").unwrap();
    let error = studio.draw("panics", &scene, &need).unwrap_err().to_string();
    assert!(error.contains("`render` panicked: as it was told, in row "), "{error}");
    assert!(error.contains("plugins/fixtures/panics/src/lib.rs:"), "{error}");
    need.settings.set("panics", &parameters, "where", "nowhere").unwrap();
    studio.draw("panics", &scene, &need).unwrap();
    let lines = lines.lock().unwrap();
    assert_eq!(lines.len(), 2);
    assert_eq!((lines[0].text.as_str(), lines[0].object), ("prepared", Some(0)));
}

#[test]
fn the_command_survives_a_plugin_that_crashes() {
    let Some(library) = animal("command") else { return };
    let dir = library.parent().unwrap();
    let manifest = polyptych::plugins::Manifest::of(polyptych::plugins::open(&library).unwrap()).to_text();
    std::fs::write(dir.join("animal.toml"), manifest).unwrap();
    let out = dir.join("a.png");
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_polyptych"));
    command.args([
        "render",
        "builtin:polyhedra",
        "-b",
        "animal",
        "--set",
        "fault=segfault",
        "--size",
        "32x32",
        "-o",
    ]);
    let done = command.arg(&out).arg("--plugin-dir").arg(dir).output().unwrap();
    let error = String::from_utf8_lossy(&done.stderr);
    assert_eq!((done.status.code(), error.lines().count()), (Some(1), 1), "{error}");
    assert!(
        error.contains("error: animal: `render` crashed: it touched memory that is not its own"),
        "{error}"
    );
    assert!(!out.exists());
    // A comparison keeps the other panels.
    let out = dir.join("compare");
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_polyptych"));
    command.args(["compare", "builtin:polyhedra", "-b", "animal,raster", "--set", "animal.fault=overflow"]);
    let done =
        command.args(["--size", "32x32", "-o"]).arg(&out).arg("--plugin-dir").arg(dir).output().unwrap();
    let error = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(1), "{error}");
    assert!(error.contains("error: animal: `render` crashed: it overflowed its stack, in row 16"), "{error}");
    assert!(error.contains("left out: animal"), "{error}");
    let numbers = std::fs::read_to_string(out.join("compare.json")).unwrap();
    let numbers: serde_json::Value = serde_json::from_str(&numbers).unwrap();
    assert_eq!(
        (&numbers["panels"][0]["backend"], numbers["panels"].as_array().map(Vec::len)),
        (&"raster".into(), Some(1))
    );
}

#[test]
fn the_command_goes_on_after_every_misbehavior() {
    let Some(library) = animal("every") else { return };
    let dir = library.parent().unwrap();
    let manifest = polyptych::plugins::Manifest::of(polyptych::plugins::open(&library).unwrap()).to_text();
    std::fs::write(dir.join("animal.toml"), manifest).unwrap();
    let run = |command: &str, backends: &str, fault: &str| {
        let out = dir.join(if command == "render" { "a.png" } else { "compare" });
        let set = format!("animal.fault={fault}");
        let mut process = std::process::Command::new(env!("CARGO_BIN_EXE_polyptych"));
        process.args([command, "builtin:polyhedra", "-b", backends, "--set", &set, "--size", "24x16"]);
        process.args(["--plugin-limit", "1", "-o"]).arg(out).arg("--plugin-dir").arg(dir);
        let done = process.output().unwrap();
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let panels = || {
        let text = std::fs::read_to_string(dir.join("compare/compare.json")).unwrap();
        let numbers: serde_json::Value = serde_json::from_str(&text).unwrap();
        let panels = numbers["panels"].as_array().unwrap().clone();
        panels.iter().map(|p| p["backend"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    // What fails is told in a line; what only draws nonsense is drawn.
    let failing = "segfault abort exit overflow hang out-of-bounds prepare-segfault prepare-hang fail refuse \
                   garbage-status";
    let drawing = "nan leak sleep lie flicker unwritten threads";
    for (faults, code) in [(failing, Some(1)), (drawing, Some(0))] {
        for fault in faults.split_whitespace() {
            let (ended, said) = run("render", "animal", fault);
            assert_eq!(ended, code, "{fault}: {said}");
            assert!(code == Some(0) || said.starts_with("error: animal: "), "{fault}: {said}");
            let (ended, said) = run("compare", "raster,animal", fault);
            assert_eq!(ended, code, "{fault}: {said}");
            let expected: &[&str] = if code == Some(0) { &["raster", "animal"] } else { &["raster"] };
            assert_eq!(panels(), expected, "{fault}: {said}");
            assert_eq!(run("render", "animal", "none"), (Some(0), String::new()), "after {fault}");
        }
    }
}
