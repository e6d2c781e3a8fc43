//! Does a chart measure what it says, go on where it was stopped, and show itself in a browser?

mod common;

use common::{builtin, studio};
use polyptych::chart::{Measure, Request, Step, Subject, TOLERANCE, chart};
use polyptych::seam::Value;
use std::process::{Command, Stdio};

fn request(backends: &[&str]) -> Request {
    let scene = builtin("polyhedra");
    let camera = scene.cameras[0].1.clone();
    let subjects = vec![Subject { name: "builtin:polyhedra".to_owned(), scene, camera }];
    let backends = backends.iter().map(|b| (*b).to_owned()).collect();
    Request { width: 64, height: 36, ..Request::new(subjects, backends) }
}

#[test]
fn points_lie_along_the_axes_and_known_ones_are_not_drawn_again() {
    let mut request = request(&["reference", "raster"]);
    let first = chart(&mut studio(2), &request, &mut |_| {}).expect("it is measured");
    let raster = |name: &str| first.walks.iter().find(|w| w.backend == "raster" && w.axis == name).unwrap();
    assert!(raster(TOLERANCE).values.len() >= 4);
    let maps = raster("shadow.map_size");
    assert!(maps.values.len() >= 4 || maps.note.starts_with("changes nothing"), "{maps:?}");
    assert!(raster(TOLERANCE).errors[0] > *raster(TOLERANCE).errors.last().unwrap());
    let coarse = first.points.iter().find(|p| p.settings.get(TOLERANCE) == Some(&Value::Float(8.0))).unwrap();
    assert!(coarse.errors.distance > Some(0.0) && coarse.ms.low <= coarse.ms.median);
    let exact = first.points.iter().find(|p| p.backend == "reference" && p.settings.is_empty()).unwrap();
    assert_eq!((exact.errors.color, exact.errors.distance), (Some(0.0), Some(0.0)));
    assert!(Measure::Antialiased.of(exact) > Some(0.0), "one sample a pixel is jagged");
    // As if an earlier run had taken 5 s for each of them.
    request.known = first.points.clone();
    request.known.iter_mut().for_each(|p| p.ms.median = 5000.0);
    let mut measured = 0;
    let again = chart(&mut studio(2), &request, &mut |step| {
        measured += u32::from(matches!(step, Step::Measured(p) if p.ms.median == 5000.0));
    });
    assert!(measured as usize >= 4 && again.is_ok_and(|c| c.points.iter().all(|p| p.ms.median == 5000.0)));
}

#[test]
fn a_stopped_chart_goes_on_and_its_page_works_in_headless_chromium() {
    let out = std::env::temp_dir().join(format!("polyptych-chart-{}", std::process::id()));
    let command = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_polyptych"));
        command.args([
            "chart",
            "builtin:polyhedra",
            "-b",
            "reference,raster,voxel,stylized",
            "--size",
            "64x36",
        ]);
        command
            .args(["--threads", "2", "--no-growth", "--set", "voxel.detail.resolution=64", "-o"])
            .arg(&out);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    let mut stopped = command().spawn().expect("the command starts");
    let unfinished = out.join("unfinished.jsonl");
    while std::fs::read_to_string(&unfinished).unwrap_or_default().lines().count() < 4 {
        assert!(stopped.try_wait().unwrap().is_none(), "it ended before it could be stopped");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    stopped.kill().and_then(|()| stopped.wait()).expect("it is stopped");
    let done = command().output().expect("the command starts");
    let told = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success() && told.contains("goes on with the "), "{told}");
    assert!(!unfinished.exists());
    let csv = std::fs::read_to_string(out.join("chart.csv")).unwrap();
    assert!(csv.starts_with("scene,backend,settings,") && csv.lines().count() > 15, "{csv}");
    let svg = std::fs::read_to_string(out.join("chart.svg")).unwrap();
    assert!(svg.contains("builtin:polyhedra") && svg.contains("time of a frame (median), ms"));
    let numbers: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("chart.json")).unwrap()).unwrap();
    for field in ["machine", "date", "threads", "points", "axes", "equal_time", "equal_error"] {
        assert!(numbers.get(field).is_some(), "no {field}");
    }

    let present =
        |program: &str| Command::new(program).arg("--version").output().is_ok_and(|o| o.status.success());
    if present("python3") && present("chromedriver") {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/chart_page.py");
        let checked = Command::new("python3").arg(script).arg(out.join("index.html")).output().unwrap();
        assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stdout));
    } else {
        assert!(std::env::var_os("CI").is_none(), "CI needs python3 and chromedriver");
        eprintln!("skipped: python3 and chromedriver are needed");
    }
    std::fs::remove_dir_all(out).expect("the chart is removed");
}
