//! Does the command keep its contract: words, fields, exit codes, refusals?

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn polyptych(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_polyptych"));
    // What it keeps of this machine is no matter of the user's.
    command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
    command.args(arguments).output().expect("the command starts")
}

/// Makes an empty folder for a test.
fn folder(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("polyptych-cli-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a temporary folder");
    path
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

fn json(output: &Output) -> Value {
    let printed = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&printed)
        .unwrap_or_else(|e| panic!("{e}: {printed}{}", String::from_utf8_lossy(&output.stderr)))
}

/// Asserts that a value has all of these fields.
fn assert_fields(value: &Value, fields: &[&str]) {
    for field in fields {
        assert!(value.get(field).is_some(), "no `{field}` in {value}");
    }
}

#[test]
fn compare_writes_the_sheet_the_page_and_the_numbers() {
    let out = folder("compare");
    let done = polyptych(&["compare", "builtin:polyhedra", "--size", "96x54", "-o", text(&out)]);
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    let table = String::from_utf8_lossy(&done.stdout);
    for row in ["reference", "raster", "voxel", "freeform", "stylized"] {
        assert!(table.lines().any(|l| l.starts_with(row)), "no row {row} in\n{table}");
        assert!(out.join(format!("{row}.png")).exists());
    }
    assert!(image::open(out.join("sheet.png")).is_ok());
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    assert!(!page.contains("/*DATA*/null") && !page.contains("http://") && !page.contains("https://"));
    let numbers: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("compare.json")).unwrap()).unwrap();
    assert_fields(&numbers, &["scene", "width", "height", "reference", "panels"]);
    let raster = &numbers["panels"][0];
    assert_fields(
        raster,
        &["backend", "settings", "prepare_ms", "frame_ms", "bytes", "objects", "errors", "split", "gate"],
    );
    assert_fields(&raster["objects"], &["exact", "converted", "approximated", "skipped"]);
    let errors = &raster["errors"];
    assert_fields(
        errors,
        &["distance", "normal_deg", "id_agreement", "silhouette_iou", "shadow_agreement", "color"],
    );
    assert_fields(&errors["distance"], &["mean", "p99", "max", "relative"]);
    let color = ["rmse", "psnr", "ssim", "flip", "bias", "worst_tile", "outliers", "largest_blob"];
    assert_fields(&errors["color"], &color);
    assert_fields(&raster["gate"], &["passed", "failed"]);
    let left: Vec<_> =
        std::fs::read_dir(&out).unwrap().filter_map(Result::ok).map(|e| e.file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().ends_with(".part")), "{left:?}");
}

#[test]
fn a_gate_that_does_not_hold_is_exit_code_four() {
    let out = folder("gate");
    // Sixteen samples along a body are too coarse for a gate.
    let coarse = ["--set", "voxel.detail.resolution=16"];
    let base =
        ["compare", "builtin:polyhedra", "-b", "voxel", "--size", "160x90", "--gate", "-o", text(&out)];
    let failed = polyptych(&[&base[..], &coarse[..]].concat());
    assert_eq!(failed.status.code(), Some(4));
    assert!(String::from_utf8_lossy(&failed.stderr).contains("gate: voxel failed: "));
}

#[test]
fn bench_plan_backends_and_render_print_their_fields() {
    let bench = json(&polyptych(&[
        "bench",
        "builtin:polyhedra",
        "-b",
        "raster",
        "--size",
        "64x36",
        "--frames",
        "3",
        "--json",
    ]));
    let fields = [
        "backend",
        "scene",
        "width",
        "height",
        "threads",
        "prepare_ms",
        "frames",
        "ms_median",
        "ms_min",
        "ms_p95",
        "bytes",
        "settings",
    ];
    assert_fields(&bench[0], &fields);
    assert_eq!(bench[0]["frames"], 3);
    let (count, rate) = (&bench[0]["counters"]["triangles"], &bench[0]["per_second"]["triangles"]);
    let expected = count.as_f64().unwrap() * 1e3 / bench[0]["ms_median"].as_f64().unwrap();
    assert!(expected > 0.0 && (rate.as_f64().unwrap() / expected - 1.0).abs() < 1e-9);

    let plan = json(&polyptych(&["plan", "builtin:quadrics", "--json"]));
    assert_eq!(plan.as_array().map(Vec::len), Some(5));
    assert_fields(&plan[0], &["backend", "objects", "passes", "bytes", "estimated_ms"]);
    assert_fields(&plan[1]["objects"][0], &["name", "shape", "decision", "builds", "bytes", "bound", "why"]);
    assert_fields(&plan[1]["passes"][0], &["name", "needed", "why"]);

    let backends = json(&polyptych(&["backends", "--json"]));
    assert_eq!(backends.as_array().map(Vec::len), Some(5));
    assert_fields(
        &backends[1],
        &["id", "name", "version", "origin", "status", "shapes", "channels", "parameters"],
    );
    let parameter =
        ["name", "type", "default", "min", "max", "choices", "unit", "help", "tag", "quality_axis"];
    assert_fields(&backends[1]["parameters"][0], &parameter);
    assert_eq!(backends[1]["origin"], "built-in");

    let file = folder("render").join("picture.png");
    let base = [
        "render",
        "builtin:quadrics",
        "-b",
        "freeform",
        "--size",
        "48x32",
        "--view",
        "-30,20",
        "--json",
        "-o",
    ];
    let render = json(&polyptych(&[&base[..], &[text(&file)]].concat()));
    assert_fields(
        &render,
        &["backend", "width", "height", "prepare_ms", "frame_ms", "bytes", "objects", "out"],
    );
    assert_eq!(image::open(file).unwrap().to_rgb8().dimensions(), (48, 32));
}

#[test]
fn convert_writes_models_that_load_again() {
    let out = folder("convert");
    for (name, resolution) in [("a.obj", "64"), ("a.glb", "64"), ("a.vox", "48"), ("a.nrrd", "32")] {
        let file = out.join(name);
        let done = polyptych(&["convert", "builtin:polyhedra", text(&file), "--resolution", resolution]);
        assert_eq!(done.status.code(), Some(0), "{name}: {}", String::from_utf8_lossy(&done.stderr));
        assert!(String::from_utf8_lossy(&done.stdout).contains("at most"), "the bound is stated");
        let scene = polyptych::load::load(&file, &polyptych::load::LoadOptions::default()).unwrap();
        let size = scene.bounds().size();
        assert!(size.min_element() > 0.0 && size.is_finite(), "{name}: {size}");
    }
}

#[test]
fn convert_fills_voxels_as_it_is_told() {
    let out = folder("filling");
    let filled = |filling: &str| {
        let file = out.join(format!("{filling}.vox"));
        let words = ["convert", "builtin:polyhedra", text(&file), "--resolution", "64", "--filling", filling];
        let done = polyptych(&words);
        assert_eq!(done.status.code(), Some(0), "{filling}: {}", String::from_utf8_lossy(&done.stderr));
        let scene = polyptych::load::load(&file, &polyptych::load::LoadOptions::default()).unwrap();
        let polyptych::scene::Shape::Voxels(voxels) = &*scene.objects[0].shape else { panic!("voxels") };
        voxels.filled()
    };
    let [thin, surface, natural, solid] = ["thin", "surface", "natural", "solid"].map(filled);
    assert!(thin < surface && surface == natural && solid > thin, "{thin} {surface} {natural} {solid}");
}

#[test]
fn refusals_are_one_line_with_the_code_of_their_kind() {
    let cases: [(&[&str], i32, &str); 11] = [
        (&["convert", "builtin:atelier", "x.obj", "--filling", "solid"], 2, "only voxels are filled"),
        (&["render", "no/such/file.obj", "-o", "x.png"], 3, "no/such/file.obj"),
        (&["render", "builtin:nothing", "-o", "x.png"], 3, "atelier, polyhedra"),
        (&["render", "Cargo.toml", "-o", "x.png"], 3, "Cargo.toml"),
        (&["render", "-b", "rastre", "-o", "x.png"], 2, "the nearest is `raster`"),
        (&["render", "-b", "raster,voxel", "-o", "x.png"], 2, "use `compare`"),
        (&["render", "--set", "shadow.mapsize=3", "-o", "x.png"], 2, "the nearest is `shadow.map_size`"),
        (&["render", "--set", "raster.shadow.map_size=3", "-o", "x.png"], 2, "a whole number from"),
        (&["render", "--camera", "back", "-o", "x.png"], 2, "front, bird, close"),
        (&["render", "--tolerance", "0", "-o", "x.png"], 2, "positive"),
        (
            &["render", "builtin:polyhedra", "--size", "8x8", "-o", "x.gifx"],
            1,
            "use .png, .jpg, .exr or .pfm",
        ),
    ];
    for (arguments, code, hint) in cases {
        let refused = polyptych(arguments);
        let message = String::from_utf8_lossy(&refused.stderr);
        assert_eq!(refused.status.code(), Some(code), "{arguments:?}: {message}");
        assert!(message.contains(hint), "{arguments:?}: {message}");
        assert!(
            message.starts_with("error: ") && message.trim_end().lines().count() == 1,
            "{arguments:?}: {message}"
        );
        assert!(refused.stdout.is_empty());
    }
    for wrong in [&["render", "--size", "0x5", "-o", "x.png"][..], &["paint"], &["bench", "--frames", "0"]] {
        assert_eq!(polyptych(wrong).status.code(), Some(2), "{wrong:?}");
    }
}

#[test]
fn height_maps_are_read_from_tiff_as_from_png() {
    let out = folder("tiff");
    let heights = image::ImageBuffer::from_fn(24, 16, |x, y| {
        let hill = 9000.0 * ((f64::from(x) * 0.4).sin() + (f64::from(y) * 0.3).cos() + 2.0);
        image::Luma([hill as u16])
    });
    let pictures = ["map.png", "map.tif"].map(|name| {
        let (map, picture) = (out.join(name), out.join(format!("{name}.pfm")));
        heights.save(&map).unwrap();
        let done = polyptych(&[
            "render",
            text(&map),
            "--height-map",
            "-b",
            "freeform",
            "--size",
            "64x36",
            "-o",
            text(&picture),
        ]);
        assert_eq!(done.status.code(), Some(0), "{name}: {}", String::from_utf8_lossy(&done.stderr));
        std::fs::read(picture).unwrap()
    });
    assert!(pictures[0] == pictures[1] && pictures[0].len() > 64 * 36 * 12);
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_the_program_and_leaves_whole_files_only() {
    let out = folder("interrupt");
    let mut running = Command::new(env!("CARGO_BIN_EXE_polyptych"))
        .args(["compare", "--size", "3840x2160", "-o", text(&out)])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let sent = std::time::Instant::now();
    assert!(Command::new("kill").args(["-INT", &running.id().to_string()]).status().unwrap().success());
    running.wait().unwrap();
    eprintln!("stopped {:.1} ms after the interrupt", sent.elapsed().as_secs_f64() * 1e3);
    let output = running.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.trim_end().ends_with("error: interrupted"), "{message}");
    assert!(output.stdout.is_empty());
    assert_eq!(
        std::fs::read_dir(&out).map_or(0, Iterator::count),
        0,
        "something was left in {}",
        out.display()
    );
}

#[test]
fn view_says_where_the_viewer_comes_from_when_it_is_not_there() {
    // A copy of the command in a folder of its own has no viewer beside it.
    let out = folder("view");
    let alone = out.join("polyptych");
    std::fs::copy(env!("CARGO_BIN_EXE_polyptych"), &alone).unwrap();
    let refused = Command::new(&alone).args(["view", "builtin:polyhedra"]).output().unwrap();
    let message = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{message}");
    assert!(message.contains("cargo build --release -p polyptych-viewer"), "{message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
}
