//! `polyptych chart`: error against time, each back end along its quality axes.

use super::arguments::ChartArguments;
use super::{Failure, input, print};
use indicatif::{ProgressBar, ProgressStyle};
use polyptych::chart::{Chart, Point, Request, Step, Subject, chart};
use polyptych::report::chart as report;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

/// Points of a chart that is not finished, one JSON value a line; the first line says what chart it is.
const UNFINISHED: &str = "unfinished.jsonl";

pub(super) fn run(arguments: &ChartArguments) -> Result<(), Failure> {
    let mut studio =
        input::measuring_studio(usize::from(arguments.draw.threads.unwrap_or(0)), &arguments.draw.plugins)?;
    let default = ["reference", "raster", "voxel", "freeform", "stylized"];
    let backends = input::backends(&arguments.draw, studio.registry(), &default)?;
    let [width, height] = arguments.draw.size.unwrap_or([256, 144]);
    let mut subjects = Vec::new();
    let named: Vec<String> = if arguments.scenes.is_empty() {
        polyptych::builtin::NAMES.iter().map(|name| format!("builtin:{name}")).collect()
    } else {
        arguments.scenes.clone()
    };
    for name in named {
        let scene = input::named_scene(&name, &arguments.reading)?;
        let draw = input::need_of(&arguments.draw, &scene, [width, height])?;
        subjects.push(Subject { name, scene, camera: draw.camera });
    }
    let settings = input::settings(&arguments.draw, studio.registry(), &backends)?;
    let mut request = Request { width, height, settings, ..Request::new(subjects, backends) };
    request.growth = !arguments.no_growth;
    fs::create_dir_all(&arguments.output)
        .map_err(|e| Failure::running(format!("{}: {e}", arguments.output.display())))?;
    let unfinished = arguments.output.join(UNFINISHED);
    let threads = polyptych::parallel::Threads::count(studio.pool());
    let what = describe(&request, threads);
    request.known = known(&unfinished, &what);
    let mut log = open(&unfinished, &what, &request.known)
        .map_err(|e| Failure::running(format!("{}: {e}", unfinished.display())))?;
    if !request.known.is_empty() && !arguments.draw.quiet {
        eprintln!("goes on with the {} points of {}", request.known.len(), unfinished.display());
    }
    let measured = measure(&mut studio, &request, &mut log)?;
    let command = std::env::args().collect::<Vec<_>>().join(" ");
    report::write(&measured, &arguments.output, &command).map_err(Failure::running)?;
    // What is finished is not resumed: the next chart measures anew.
    let _ = fs::remove_file(&unfinished);
    if arguments.draw.json {
        print(&format!("{}\n", report::numbers(&measured)));
    } else if !arguments.draw.quiet {
        let folder = arguments.output.display();
        print(&format!(
            "{} points; wrote {folder}/index.html, {folder}/chart.svg, {folder}/chart.csv, {folder}/chart.json\n",
            measured.points.len()
        ));
    }
    Ok(())
}

fn measure(studio: &mut polyptych::Studio, request: &Request, log: &mut File) -> Result<Chart, Failure> {
    let bar = ProgressBar::new(1);
    bar.set_style(
        ProgressStyle::with_template("{spinner} {pos}/{len} {wide_msg} {elapsed}")
            .unwrap_or(ProgressStyle::default_bar()),
    );
    bar.enable_steady_tick(Duration::from_millis(100));
    let (mut part, mut points, begin) = (String::new(), 0u32, Instant::now());
    let result = chart(studio, request, &mut |step| match step {
        Step::Begun { done, all, what } => {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
            what.clone_into(&mut part);
            bar.set_message(format!("{what}, {points} points"));
        }
        Step::Measured(point) => {
            points += 1;
            bar.set_message(format!("{part}, {points} points in {:.0} s", begin.elapsed().as_secs_f64()));
            // A chart that cannot be resumed is still a chart.
            if !request.known.contains(point)
                && let Ok(line) = serde_json::to_string(point)
            {
                let _ = writeln!(log, "{line}");
            }
        }
    });
    bar.finish_and_clear();
    result.map_err(Failure::running)
}

/// Says what a chart is of: another one's points are not taken.
fn describe(request: &Request, threads: usize) -> String {
    let scenes: Vec<&str> = request.subjects.iter().map(|s| s.name.as_str()).collect();
    let cameras: Vec<String> = request.subjects.iter().map(|s| format!("{:?}", s.camera.eye)).collect();
    serde_json::json!({
        "version": env!("CARGO_PKG_VERSION"), "scenes": scenes, "cameras": cameras, "backends": request.backends,
        "size": [request.width, request.height], "threads": threads, "settings": request.settings,
    })
    .to_string()
}

/// Reads the points of a chart that was stopped; a line that was cut off ends them.
fn known(path: &Path, what: &str) -> Vec<Point> {
    let text = fs::read_to_string(path).unwrap_or_default();
    let mut lines = text.lines();
    if lines.next() != Some(what) {
        return Vec::new();
    }
    lines.map_while(|line| serde_json::from_str(line).ok()).collect()
}

/// Begins the file anew with what is known, so that a cut line does not stay in it.
fn open(path: &Path, what: &str, known: &[Point]) -> std::io::Result<File> {
    let mut file = File::create(path)?;
    writeln!(file, "{what}")?;
    for point in known {
        writeln!(file, "{}", serde_json::to_string(point)?)?;
    }
    Ok(file)
}
