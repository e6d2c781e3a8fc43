//! What does a chart leave on disk: a drawing, a table, numbers, and a page?

mod drawing;

pub use drawing::svg;

use super::page::{machine, today};
use crate::chart::{Chart, Measure, Point, TOLERANCE, best_within, fastest_under, front};
use crate::picture::{PictureError, write_whole};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use drawing::{color_of, growth_svg, threads_text};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;

const TEMPLATE: &str = include_str!("page.html");
const PLACEHOLDER: &str = "/*DATA*/null";

/// The frame time of 60 pictures a second, for the equal-time sheet.
pub const FRAME_MS: f64 = 16.0;

/// Errors of the equal-error table.
const LEVELS: [f64; 6] = [0.1, 0.05, 0.02, 0.01, 0.005, 0.002];

/// Writes `chart.svg`, `chart.csv`, `chart.json` and `index.html` into a folder.
///
/// `command` is what reproduces the chart.
///
/// # Errors
/// When a file cannot be written; it is named.
pub fn write(chart: &Chart, folder: &Path, command: &str) -> Result<(), PictureError> {
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        write_whole(&path, text.as_bytes()).map_err(|e| PictureError::Write { path, error: e.to_string() })
    };
    write("chart.svg", &svg(chart, Measure::Color))?;
    write("chart.csv", &csv(chart))?;
    write("chart.json", &serde_json::to_string_pretty(&numbers(chart)).unwrap_or_default())?;
    write("index.html", &page(chart, command))
}

/// Returns the numbers of a chart.
#[must_use]
pub fn numbers(chart: &Chart) -> Value {
    let fronts = fronts(chart, Measure::Color);
    let points: Vec<Value> = chart
        .points
        .iter()
        .enumerate()
        .map(|(i, p)| {
            json!({
                "scene": p.scene, "backend": p.backend, "settings": p.settings, "prepare_ms": p.prepare_ms,
                "ms_median": p.ms.median, "ms_min": p.ms.low, "ms_max": p.ms.high, "frames": p.ms.count,
                "bytes": p.bytes, "errors": p.errors, "on_front": fronts.contains(&i),
                "objects": {"exact": p.objects[0], "converted": p.objects[1], "approximated": p.objects[2],
                            "skipped": p.objects[3]},
                "command": command_of(chart, p),
            })
        })
        .collect();
    json!({
        "machine": machine(), "date": today(), "threads": chart.threads, "pinned": chart.pinned, "width": chart.width,
        "height": chart.height, "scenes": chart.scenes, "ruler_samples": chart.ruler_samples,
        "points": points, "axes": chart.walks, "growth": chart.growth,
        "equal_time": equal_time(chart), "equal_error": equal_error(chart),
    })
}

/// Returns the points as comma-separated values, one line each.
#[must_use]
pub fn csv(chart: &Chart) -> String {
    let fronts = fronts(chart, Measure::Color);
    let mut text =
        "scene,backend,settings,prepare_ms,ms_median,ms_min,ms_max,frames,bytes,color,antialiased,\
                    distance,normal_deg,silhouette,on_front\n"
            .to_owned();
    for (i, p) in chart.points.iter().enumerate() {
        let errors: Vec<String> =
            Measure::ALL.iter().map(|m| m.of(p).map_or(String::new(), |e| format!("{e:.6e}"))).collect();
        let _ = writeln!(
            text,
            "\"{}\",{},\"{}\",{:.3},{:.4},{:.4},{:.4},{},{},{},{}",
            p.scene.replace('"', "\"\""),
            p.backend,
            settings_text(p).replace('"', "\"\""),
            p.prepare_ms,
            p.ms.median,
            p.ms.low,
            p.ms.high,
            p.ms.count,
            p.bytes,
            errors.join(","),
            fronts.contains(&i)
        );
    }
    text
}

/// Lists the indices of points on the front of their scene, over all back ends but the ruler's own zero.
fn fronts(chart: &Chart, measure: Measure) -> Vec<usize> {
    let mut all = Vec::new();
    for scene in &chart.scenes {
        let members: Vec<usize> = (0..chart.points.len())
            .filter(|&i| chart.points[i].scene == *scene && is_comparable(&chart.points[i]))
            .collect();
        let points: Vec<&Point> = members.iter().map(|&i| &chart.points[i]).collect();
        all.extend(front(&points, measure).into_iter().map(|i| members[i]));
    }
    all
}

/// A back end with a look of its own is held against a ruler of its own, and compares with itself alone.
fn is_comparable(point: &Point) -> bool {
    point.backend != "stylized"
}

/// Returns what was set, for people.
fn settings_text(point: &Point) -> String {
    let parts: Vec<String> = point
        .settings
        .iter()
        .map(
            |(name, value)| {
                if name == TOLERANCE { format!("tolerance={value} px") } else { format!("{name}={value}") }
            },
        )
        .collect();
    if parts.is_empty() { "defaults".to_owned() } else { parts.join(", ") }
}

/// Returns the command that times a point again.
fn command_of(chart: &Chart, point: &Point) -> String {
    let mut command = format!(
        "polyptych bench {} -b {} --size {}x{} --threads {}",
        point.scene, point.backend, chart.width, chart.height, chart.threads
    );
    for (name, value) in &point.settings {
        if name == TOLERANCE {
            let _ = write!(command, " --tolerance {value}");
        } else {
            let _ = write!(command, " --set {name}={value}");
        }
    }
    command
}

/// Returns the best picture of each back end within a frame of 60 Hz, scene by scene.
fn equal_time(chart: &Chart) -> Value {
    let best = |scene: &str, backend: &str| {
        let (members, points) = of(chart, scene, backend);
        let index = best_within(&points, Measure::Color, FRAME_MS)?;
        Some(json!({"point": members[index], "backend": backend, "ms": points[index].ms.median,
                    "error": points[index].errors.color, "settings": settings_text(points[index])}))
    };
    chart
        .scenes
        .iter()
        .map(|scene| {
            let all: Vec<Value> = chart
                .backends
                .iter()
                .map(|(b, _)| best(scene, b).unwrap_or_else(|| json!({"backend": b, "point": null})))
                .collect();
            json!({"scene": scene, "within_ms": FRAME_MS, "best": all})
        })
        .collect()
}

/// Returns the time that each back end needs to reach an error, scene by scene.
fn equal_error(chart: &Chart) -> Value {
    let fastest = |scene: &str, backend: &str, level: f64| {
        let (members, points) = of(chart, scene, backend);
        let index = fastest_under(&points, Measure::Color, level)?;
        Some(json!({"point": members[index], "ms": points[index].ms.median}))
    };
    let row = |scene: &str, level: f64| -> Value {
        let all: serde_json::Map<String, Value> =
            chart.backends.iter().map(|(b, _)| (b.clone(), json!(fastest(scene, b, level)))).collect();
        json!({"error": level, "ms": all})
    };
    chart.scenes.iter().map(|scene| json!({"scene": scene, "rows": LEVELS.map(|l| row(scene, l))})).collect()
}

/// Returns the points of a back end in a scene with their indices.
fn of<'a>(chart: &'a Chart, scene: &str, backend: &str) -> (Vec<usize>, Vec<&'a Point>) {
    let all = chart.points.iter().enumerate();
    all.filter(|(_, p)| p.scene == scene && p.backend == backend).unzip()
}

/// Fills the page.
fn page(chart: &Chart, command: &str) -> String {
    let mut data = numbers(chart);
    let url = |bytes: &[u8]| format!("data:image/jpeg;base64,{}", STANDARD.encode(bytes));
    data["command"] = json!(command);
    let spread = if chart.pinned {
        ""
    } else {
        ": this system does not keep them on a core, or has fewer cores, so that times spread more"
    };
    data["threads_text"] = json!(format!("{}{spread}", threads_text(chart)));
    data["backends"] = json!(chart.backends);
    data["colors"] = (0..chart.backends.len()).map(|i| color_of(chart, i)).collect();
    data["rulers"] = chart.rulers.iter().map(|r| url(r)).collect();
    for (value, point) in data["points"].as_array_mut().into_iter().flatten().zip(&chart.points) {
        value["picture"] = json!(url(&point.picture));
        value["text"] = json!(settings_text(point));
    }
    data["measures"] = Measure::ALL
        .iter()
        .filter(|m| chart.points.iter().any(|p| m.of(p).is_some()))
        .map(|m| json!({"name": m.name(), "label": m.label(), "svg": svg(chart, *m)}))
        .collect();
    if !chart.growth.is_empty() {
        data["growth_svg"] = json!([growth_svg(chart, false), growth_svg(chart, true)]);
    }
    // Nothing in a name may end the script or begin a comment in it.
    TEMPLATE.replacen(PLACEHOLDER, &data.to_string().replace('<', "\\u003c"), 1)
}
