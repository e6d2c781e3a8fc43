//! Do back ends in libraries draw what they would draw linked in, and is what does not fit refused?

#[path = "common/mod.rs"]
mod common;
#[path = "common/plugins.rs"]
mod libraries;

use common::{builtin, need};
use libraries::{built, compiled, folder, source};
use polyptych::framebuffer::Framebuffer;
use polyptych::plugins::{Manifest, Refusal, discover, open};
use polyptych::prelude::*;
use polyptych::scene::Scene;
use polyptych::seam::{Decision, Origin};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const ZOO: &str = "plugins/fixtures/zoo/zoo.c";
const FACETS: &str = "plugins/examples/facets/facets.c";

fn library_file(name: &str) -> String {
    format!("{}{name}{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX)
}

/// Opens a studio with one library besides the built-in back ends.
fn studio_with(library: &Path) -> Studio {
    let mut registry = Registry::builtin();
    registry.load(library).unwrap_or_else(|e| panic!("{e}"));
    Studio::new(registry, 2).expect("threads start")
}

/// The same scene, moved a little: an edit of one object.
fn edited(scene: &Scene) -> Arc<Scene> {
    let mut scene = scene.clone();
    scene.objects[3].world_from_object.translation.y += 0.1;
    Arc::new(scene)
}

#[test]
fn the_rasterizer_as_a_plugin_draws_the_same_bytes() {
    let mut linked = Studio::new(Registry::builtin(), 2).unwrap();
    let mut registry = Registry::default();
    assert_eq!(registry.load(built("polyptych_raster_as_plugin")).unwrap(), "raster");
    for threads in [1, 2] {
        let mut loaded = Studio::new(registry.clone(), threads).unwrap();
        for name in ["atelier", "figure", "quadrics", "terrain", "cloud"] {
            let scene = builtin(name);
            let mut need = Need { tolerance_px: 2.0, ..need(&scene, 97, 61) };
            for (scene, fisheye) in
                [(scene.clone(), false), (edited(&scene_of(&scene)), false), (scene, true)]
            {
                if fisheye {
                    need.camera.projection = Projection::Fisheye { fov: 3.0 };
                }
                let one = linked.draw("raster", &scene, &need).unwrap();
                let other = loaded.draw("raster", &scene, &need).unwrap();
                assert!(one.framebuffer.same_bits(&other.framebuffer), "{name} with {threads} threads");
                assert_eq!(one.prepared.objects, other.prepared.objects);
                assert_eq!(one.report.objects, other.report.objects);
                assert_eq!(one.report.counters, other.report.counters);
                let plans =
                    [&mut linked, &mut loaded].map(|s| s.renderer("raster").unwrap().plan(&scene, &need));
                assert_eq!(plans[0], plans[1]);
            }
        }
    }
    let infos = [linked.registry().info("raster").unwrap(), registry.info("raster").unwrap()];
    assert_eq!(infos[0].parameters, infos[1].parameters);
    assert_eq!((infos[0].channels, &infos[0].native), (infos[1].channels, &infos[1].native));
}

/// A scene with enough objects to edit the fourth.
fn scene_of(scene: &Arc<Scene>) -> Scene {
    let mut scene = (**scene).clone();
    while scene.objects.len() < 4 {
        scene.objects.push(scene.objects[0].clone());
    }
    scene
}

#[test]
fn a_plugin_that_takes_triangles_draws_every_scene_with_bounds() {
    let mut studio = studio_with(&built("polyptych_occlusion"));
    for name in ["atelier", "polyhedra", "figure", "quadrics", "terrain", "cloud"] {
        let scene = builtin(name);
        let need = Need { tolerance_px: 2.0, ..need(&scene, 64, 36) };
        let drawing = studio.draw("occlusion", &scene, &need).unwrap();
        assert_eq!(drawing.prepared.objects.len(), scene.objects.len());
        for (object, decision) in scene.objects.iter().zip(drawing.prepared.objects.iter()) {
            let fits = match (&*object.shape, decision) {
                (Shape::Mesh(_), Decision::Exact) => true,
                (Shape::Volume(_), Decision::Approximated { why }) => why.contains("triangles"),
                (_, Decision::Converted { bound, .. }) => bound.is_finite(),
                (_, Decision::Approximated { why }) => why.contains("m off") || why.contains("opaque"),
                _ => false,
            };
            assert!(fits, "{name}: {}: {decision:?}", object.name);
        }
        let reference = studio.draw("reference", &scene, &need).unwrap().framebuffer;
        let same = drawing.framebuffer.id().iter().zip(reference.id()).filter(|(a, b)| a == b).count();
        assert!(same * 100 >= reference.id().len() * 95, "{name}: {same} of {}", reference.id().len());
        assert_eq!(drawing.framebuffer.count_not_finite(), 0);
        let model = studio.renderer("occlusion").unwrap().model();
        assert!(model.is_none_or(|m| {
            m.objects.iter().all(|o| matches!(&*o.shape, Shape::Mesh(_)) || !o.is_drawable())
        }));
    }
}

#[test]
fn a_plugin_in_c_draws_what_the_reference_sees() {
    let folder = folder("facets");
    let library = folder.join(library_file("facets"));
    let Some(()) = compiled(FACETS, &library, &["-std=c99", "-Wpedantic"]) else { return };
    let mut studio = studio_with(&library);
    let scene = builtin("atelier");
    let need = Need { tolerance_px: 2.0, ..need(&scene, 96, 54) };
    let drawn = studio.draw("facets", &scene, &need).unwrap();
    let reference = studio.draw("reference", &scene, &need).unwrap().framebuffer;
    let same = drawn.framebuffer.id().iter().zip(reference.id()).filter(|(a, b)| a == b).count();
    assert!(same * 100 >= reference.id().len() * 97, "{same} of {}", reference.id().len());
    let close = drawn.framebuffer.distance().iter().zip(reference.distance());
    let close = close.filter(|(a, b)| a == b || (*a - *b).abs() < 0.02 * **b).count();
    assert!(close * 100 >= reference.id().len() * 97, "{close} of {}", reference.id().len());
    let planned = studio.renderer("facets").unwrap().plan(&scene, &need);
    for (plan, done) in planned.objects.iter().zip(drawn.prepared.objects.iter()) {
        assert_eq!(plan.decision.word(), done.word(), "{}", plan.name);
    }
    let one = Studio::new(studio.registry().clone(), 1).unwrap().draw("facets", &scene, &need).unwrap();
    assert!(one.framebuffer.same_bits(&drawn.framebuffer), "one thread differs from two");
    assert_eq!(Manifest::of(open(&library).unwrap()), manifest("facets", "facets"));
}

fn manifest(example: &str, file: &str) -> Manifest {
    Manifest::read(&source(&format!("plugins/examples/{example}/{file}.toml"))).unwrap()
}

#[test]
fn manifests_of_the_examples_say_what_the_libraries_say() {
    for (example, file) in [("template", "polyptych_template"), ("occlusion", "polyptych_occlusion")] {
        let loaded = open(&built(file)).unwrap();
        let said = Manifest::of(loaded);
        assert_eq!(manifest(example, file), said, "{example}");
        assert_eq!(toml_of(&said), said);
    }
}

fn toml_of(manifest: &Manifest) -> Manifest {
    let file = folder("toml").join("a.toml");
    std::fs::write(&file, manifest.to_text()).unwrap();
    Manifest::read(&file).unwrap()
}

#[test]
fn what_is_no_fitting_plugin_is_refused_in_one_line() {
    let folder = folder("misfits");
    let cases = [
        ("NULL_TABLE", "returned nothing"),
        ("SHORT_TABLE", "has 40 bytes, at least"),
        ("WRONG_MAGIC", "begins with 0x12345678"),
        ("OTHER_MAJOR", "of the interface, this program 1."),
        ("MISSING_CPU", "needs a processor with feature 40"),
        ("NO_ENTRY", "has no function `polyptych_plugin`"),
        ("NO_RENDER", "has no `render`"),
        ("NO_INSTANCE", "has no `create`"),
        ("NO_INFO", "there is nothing"),
        ("BAD_ID", "`Not an id!` is no id"),
        ("SHORT_INFO", "has 8 bytes, at least 56 are needed"),
        ("SHORT_PARAMETER", "parameter 0: has 12 bytes, at least"),
    ];
    for (option, words) in cases {
        let library = folder.join(library_file(option));
        let Some(()) = compiled(ZOO, &library, &[&format!("-D{option}")]) else { return };
        let line = open(&library).unwrap_err().to_string();
        assert!(line.contains(words) && line.contains(option) && !line.contains('\n'), "{line}");
    }
    let fits = folder.join(library_file("FUTURE_MINOR"));
    compiled(ZOO, &fits, &["-DFUTURE_MINOR"]);
    assert_eq!(open(&fits).unwrap().abi, [1, 9]);

    let whole = std::fs::read(&fits).unwrap();
    for (name, bytes, words) in [
        ("cut", &whole[..whole.len() / 2], "is cut off"),
        ("short", &whole[..20], "it has 20 bytes"),
        (
            "text",
            &b"#!/bin/sh\necho this is a script and no library, whatever its name says\n"[..],
            "does not begin like one",
        ),
    ] {
        let library = folder.join(library_file(name));
        std::fs::write(&library, bytes).unwrap();
        let line = open(&library).unwrap_err().to_string();
        assert!(line.contains(words), "{line}");
    }
    assert!(matches!(open(&folder.join("none.so")), Err(Refusal::Unreadable { .. })));
    assert!(matches!(open(&folder), Err(Refusal::NotALibrary { .. })));
}

#[test]
fn a_plugin_of_a_later_minor_version_draws() {
    let library = folder("minor").join(library_file("animal"));
    let Some(()) = compiled(ZOO, &library, &["-DFUTURE_MINOR"]) else { return };
    let scene = builtin("polyhedra");
    let drawing = studio_with(&library).draw("animal", &scene, &need(&scene, 9, 9)).unwrap();
    assert!(drawing.framebuffer.color().iter().all(|c| *c == Vec3::splat(0.25)));
    assert!(drawing.prepared.objects.iter().all(|d| d.word() == "skipped"));
}

#[test]
fn a_plugin_built_with_the_first_header_draws() {
    // The header of version 1.0 stays as it was released, whatever the next ones add.
    let library = folder("older").join(library_file("animal"));
    let headers = format!("-I{}", source("plugins/fixtures/zoo").display());
    let Some(()) = compiled(ZOO, &library, &["-DHEADER=\"polyptych_1_0.h\"", &headers]) else { return };
    assert_eq!(open(&library).unwrap().abi, [1, 0]);
    let scene = builtin("polyhedra");
    let drawing = studio_with(&library).draw("animal", &scene, &need(&scene, 9, 9)).unwrap();
    assert!(drawing.framebuffer.color().iter().all(|c| *c == Vec3::splat(0.25)));
}

/// Puts a library and its manifest into a folder.
fn install(folder: &Path, name: &str) -> PathBuf {
    let library = folder.join(library_file(name));
    std::fs::copy(built(name), &library).unwrap();
    let manifest = Manifest::of(open(&built(name)).unwrap());
    std::fs::write(folder.join(format!("{name}.toml")), manifest.to_text()).unwrap();
    library
}

#[test]
fn folders_are_listed_by_manifests() {
    let folder = folder("listed");
    let library = install(&folder, "polyptych_template");
    std::fs::copy(&library, folder.join(library_file("alone"))).unwrap();
    std::fs::write(
        folder.join(library_file("text")),
        "no library, but long enough to have the head of one, as it were",
    )
    .unwrap();
    std::fs::write(folder.join("broken.toml"), "id = 3\n").unwrap();
    std::fs::write(folder.join("notes.txt"), "not looked at").unwrap();
    let found = discover(std::slice::from_ref(&folder)).unwrap();
    let lines: Vec<String> = found
        .iter()
        .map(|f| f.manifest.as_ref().map_or_else(ToString::to_string, |m| m.id.clone()))
        .collect();
    assert_eq!(lines.len(), 4, "{lines:?}");
    assert!(lines[0].contains("broken.toml: line 1: "), "{}", lines[0]);
    assert_eq!(lines[1], "template");
    assert!(
        lines.iter().any(|l| l.contains("alone") && l.contains("has no manifest beside it")),
        "{lines:?}"
    );
    assert!(lines.iter().any(|l| l.contains("text") && l.contains("is not a library")), "{lines:?}");

    let registry = Registry::builtin().with_plugins(&folder);
    let (info, origin) = registry.iter().last().unwrap();
    assert_eq!((info.id.as_str(), origin), ("template", &Origin::Library(library)));
    assert_eq!(info.parameters[0].name, "brightness");
    let scene = builtin("polyhedra");
    let mut need = need(&scene, 8, 8);
    need.settings.set("template", &info.parameters, "brightness", "2").unwrap();
    let drawn = Studio::new(registry, 1).unwrap().draw("template", &scene, &need).unwrap();
    let ray = need.camera.view(8, 8).ray(0.5, 0.5).unwrap();
    assert_eq!(drawn.framebuffer.color()[0], scene.environment.background.color(ray.direction) * 2.0);
}

#[test]
fn a_hundred_plugins_are_listed_without_being_opened() {
    let folder = folder("hundred");
    // Libraries that would end the program if any of their code ran.
    let whole = std::fs::read(built("polyptych_template")).unwrap();
    let manifest = manifest("template", "polyptych_template");
    for i in 0..100 {
        let name = format!("plugin{i}");
        std::fs::write(folder.join(library_file(&name)), &whole[..64]).unwrap();
        let file = std::fs::File::options().write(true).open(folder.join(library_file(&name))).unwrap();
        file.set_len(whole.len() as u64).unwrap();
        let listed = Manifest { id: name.clone(), library: name.clone(), ..manifest.clone() };
        std::fs::write(folder.join(format!("{name}.toml")), listed.to_text()).unwrap();
    }
    let begin = std::time::Instant::now();
    let found = discover(std::slice::from_ref(&folder)).unwrap();
    eprintln!("100 plugins listed in {:?}", begin.elapsed());
    assert_eq!(found.iter().filter(|f| f.manifest.is_ok()).count(), 100);
}

#[test]
fn a_manifest_that_lies_and_an_id_that_is_taken_are_refused() {
    let folder = folder("lies");
    install(&folder, "polyptych_template");
    let path = folder.join("polyptych_template.toml");
    let honest = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, honest.replace("max = 10.0", "max = 20.0")).unwrap();
    let scene = builtin("polyhedra");
    let mut studio = Studio::new(Registry::builtin().with_plugins(&folder), 1).unwrap();
    let error = studio.draw("template", &scene, &need(&scene, 8, 8)).unwrap_err().to_string();
    assert!(error.contains("says something else about the parameters"), "{error}");

    std::fs::write(&path, honest.replace("id = \"template\"", "id = \"raster\"")).unwrap();
    let mut registry = Registry::builtin();
    let refused = registry.add_plugins(&[folder], &Default::default()).unwrap();
    assert!(matches!(&refused[..], [Refusal::IdTaken { id, .. }] if id == "raster"), "{refused:?}");
    assert_eq!(registry.iter().count(), 5);
}

#[test]
fn a_panic_is_told_with_its_place_and_the_next_frame_works() {
    let mut studio = studio_with(&built("polyptych_panics"));
    let parameters = studio.registry().info("panics").unwrap().parameters.clone();
    let scene = builtin("polyhedra");
    let plain = need(&scene, 16, 40);
    let good = studio.draw("panics", &scene, &plain).unwrap().framebuffer;
    for (place, words) in [
        ("prepare", "`prepare` panicked: a panic without words at "),
        ("render", "`render` panicked: "),
        ("thread", "`render` panicked: as it was told, in row "),
    ] {
        let mut need = plain.clone();
        need.settings.set("panics", &parameters, "where", place).unwrap();
        let error = studio.draw("panics", &scene, &need).unwrap_err().to_string();
        assert!(error.starts_with("panics: ") && error.contains(words), "{place}: {error}");
        assert!(error.contains("plugins/fixtures/panics/src/lib.rs:"), "{place}: {error}");
        if place != "prepare" {
            // What was prepared before is prepared again for the new instance, and drawn.
            let mut again = Framebuffer::new(16, 40, need.channels);
            let second = studio.render("panics", &need.frame(), &mut again);
            assert!(second.unwrap_err().to_string().contains("panicked"), "the parameter says so again");
        }
        assert!(studio.draw("panics", &scene, &plain).unwrap().framebuffer.same_bits(&good));
    }
    let mut need = plain.clone();
    need.settings.set("panics", &parameters, "where", "plan").unwrap();
    let plan = studio.renderer("panics").unwrap().plan(&scene, &need);
    assert!(plan.passes.iter().any(|p| p.why.contains("`plan` panicked")), "{plan:?}");
}

#[test]
fn failures_of_a_plugin_in_c_are_told() {
    let library = folder("fails").join(library_file("animal"));
    let Some(()) = compiled(ZOO, &library, &[]) else { return };
    let mut studio = studio_with(&library);
    let parameters = studio.registry().info("animal").unwrap().parameters.clone();
    let scene = builtin("polyhedra");
    let with = |fault: &str| {
        let mut need = need(&scene, 16, 9);
        need.settings.set("animal", &parameters, "fault", fault).unwrap();
        need
    };
    for (fault, words) in [
        ("fail", "animal: it does not say why"),
        ("refuse", "animal: object `hexagonal prism`: no mood today"),
        ("garbage-status", "animal: `render` returned 4711, which means nothing"),
    ] {
        assert_eq!(studio.draw("animal", &scene, &with(fault)).unwrap_err().to_string(), words);
    }
    let lied = studio.draw("animal", &scene, &with("lie")).unwrap();
    assert!(lied.prepared.objects.iter().all(|d| d.why().contains("does not say how it is drawn")));
    let not_a_number = studio.draw("animal", &scene, &with("nan")).unwrap();
    assert_eq!(not_a_number.framebuffer.count_not_finite(), 16 * 9);
    let mut required = (*scene).clone();
    required.objects[1].required = true;
    let error = studio.draw("animal", &required.into(), &with("none")).unwrap_err().to_string();
    assert!(error.contains("is required but an animal draws nothing"), "{error}");
}

#[test]
fn a_replaced_file_is_opened_anew() {
    let folder = folder("replaced");
    let library = folder.join(library_file("animal"));
    let scene = builtin("polyhedra");
    let color = |library: &Path| {
        let drawn = studio_with(library).draw("animal", &scene, &need(&scene, 4, 4)).unwrap();
        drawn.framebuffer.color()[0].x
    };
    let Some(()) = compiled(ZOO, &library, &["-DCOLOR=0.5f"]) else { return };
    assert_eq!(color(&library), 0.5);
    std::fs::remove_file(&library).unwrap();
    compiled(ZOO, &library, &["-DCOLOR=0.75f", "-DMORE_BYTES"]);
    assert_eq!(color(&library), 0.75);
}

#[test]
fn the_command_lists_and_uses_plugins() {
    let folder = folder("command");
    install(&folder, "polyptych_occlusion");
    std::fs::write(
        folder.join(library_file("text")),
        "not a library, though it has a name like one; long enough for a head",
    )
    .unwrap();
    let polyptych = |arguments: &[&str], variable: Option<&Path>| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_polyptych"));
        command.args(arguments).env_remove("POLYPTYCH_PLUGIN_PATH").env("XDG_DATA_HOME", "/nowhere");
        if let Some(path) = variable {
            command.env("POLYPTYCH_PLUGIN_PATH", path);
        }
        let output = command.current_dir(&folder).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    // Neither the current folder by itself nor a relative one in the variable is looked into.
    for (_, listed, _) in [polyptych(&["backends"], None), polyptych(&["backends"], Some(Path::new(".")))] {
        assert!(!listed.contains("occlusion"), "{listed}");
    }
    let dir = folder.to_str().unwrap();
    let (code, listed, _) = polyptych(&["backends", "--plugin-dir", dir, "--json"], None);
    let list: serde_json::Value = serde_json::from_str(&listed).unwrap();
    assert_eq!((code, list.as_array().map(Vec::len)), (Some(0), Some(7)));
    assert_eq!((&list[5]["id"], &list[5]["status"]), (&"occlusion".into(), &"ready".into()));
    assert!(list[6]["status"].as_str().unwrap().starts_with("refused: "), "{}", list[6]);
    let (code, out, error) = polyptych(
        &[
            "render",
            "builtin:polyhedra",
            "-b",
            "occlusion",
            "--set",
            "samples=4",
            "--size",
            "32x18",
            "-o",
            "a.png",
            "--json",
        ],
        Some(&folder),
    );
    assert_eq!(code, Some(0), "{error}");
    assert!(error.contains("plugin refused") && error.contains("is not a library"), "{error}");
    assert!(out.contains("\"backend\":\"occlusion\""), "{out}");
    let (code, _, error) = polyptych(&["render", "--plugin-dir", "no/such", "-o", "a.png"], None);
    assert_eq!((code, error.lines().count()), (Some(2), 1), "{error}");
}
