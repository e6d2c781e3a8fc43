//! `polyptych bench`: how long does a frame take?

use super::arguments::BenchArguments;
use super::{Failure, auto, input, print};
use polyptych::animate::turned;
use polyptych::framebuffer::Framebuffer;
use polyptych::parallel::Threads;
use polyptych::seam::{Frame, Need, Report};
use serde_json::{Value, json};

pub(super) fn run(arguments: &BenchArguments) -> Result<(), Failure> {
    let scene = input::scene(&arguments.scene)?;
    let mut studio =
        input::studio(usize::from(arguments.draw.threads.unwrap_or(0)), &arguments.draw.plugins)?;
    let default = ["raster", "voxel", "freeform", "stylized"];
    let mut base = input::need(&arguments.draw, &scene)?;
    let choice = auto::resolve(&arguments.draw, &mut studio, &scene, &base)?;
    let backends = match &choice {
        Some(choice) => vec![choice.chosen.backend.clone()],
        None => input::backends(&arguments.draw, studio.registry(), &default)?,
    };
    base.tolerance_px = choice.as_ref().map_or(base.tolerance_px, |c| c.chosen.tolerance_px);
    let mut settings = input::settings(&arguments.draw, studio.registry(), &backends)?;
    let threads = studio.pool().count();
    let mut rows = Vec::new();
    for backend in &backends {
        let need = Need { settings: settings.remove(backend).unwrap_or_default(), ..base.clone() };
        let (prepared, prepare_ms) = studio.prepare(backend, &scene, &need).map_err(Failure::running)?;
        let mut target = Framebuffer::new(need.width, need.height, need.channels);
        let mut times = Vec::new();
        let mut last = Report::default();
        for i in 0..arguments.warmup + arguments.frames {
            let angle = if arguments.orbit { f64::from(i) * std::f64::consts::TAU / 90.0 } else { 0.0 };
            let frame = Frame { camera: turned(&need.camera, scene.bounds().center(), angle) };
            let (report, time) = studio.render(backend, &frame, &mut target).map_err(Failure::running)?;
            last = report;
            if i >= arguments.warmup {
                times.push(time);
            }
        }
        times.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize];
        let phases: serde_json::Map<String, Value> = last
            .phases
            .iter()
            .map(|(name, time)| (name.to_owned(), json!(time.as_secs_f64() * 1e3)))
            .collect();
        let each = |of: &dyn Fn(u64) -> Value| -> serde_json::Map<String, Value> {
            last.counters.iter().flatten().map(|c| (c.name.to_owned(), of(c.count))).collect()
        };
        let counters = each(&|count| json!(count));
        let per_second = each(&|count| json!(count as f64 * 1e3 / at(0.5)));
        rows.push(json!({
            "backend": backend, "scene": scene.name, "width": need.width, "height": need.height,
            "threads": threads, "prepare_ms": prepare_ms, "frames": times.len(),
            "ms_median": at(0.5), "ms_min": at(0.0), "ms_p95": at(0.95),
            "bytes": prepared.bytes, "settings": need.settings, "phases": phases, "counters": counters,
            "per_second": per_second, "auto": choice,
        }));
    }
    if arguments.draw.json {
        print(&format!("{}\n", Value::Array(rows)));
    } else {
        print(&table(&rows));
    }
    Ok(())
}

fn table(rows: &[Value]) -> String {
    let mut text = format!(
        "{:<12} {:>11} {:>10} {:>10} {:>10} {:>14}\n",
        "back end", "prepare ms", "median ms", "min ms", "p95 ms", "bytes"
    );
    for row in rows {
        let number = |key: &str| row[key].as_f64().unwrap_or(0.0);
        text.push_str(&format!(
            "{:<12} {:>11.1} {:>10.2} {:>10.2} {:>10.2} {:>14}\n",
            row["backend"].as_str().unwrap_or(""),
            number("prepare_ms"),
            number("ms_median"),
            number("ms_min"),
            number("ms_p95"),
            row["bytes"]
        ));
        for (name, rate) in row["per_second"].as_object().into_iter().flatten() {
            let rate = rate.as_f64().unwrap_or(0.0) * 1e-6;
            text.push_str(&format!(
                "{:<12} {} {name}, {rate:.2} million a second\n",
                "", row["counters"][name]
            ));
        }
    }
    text
}
