//! What does a stability run leave on disk: numbers, curves, a page, and LIMITS.md?

mod limits;

pub use limits::{check, limits};

use super::page::{machine, today};
use super::plot::{
    Mark, Place, Plot, PlotAxis, Scale, Series, document, escape, log_range, mark_shape, number,
};
use crate::picture::{PictureError, write_whole};
use crate::stability::{Case, Outcome};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;

const TEMPLATE: &str = include_str!("page.html");
const PLACEHOLDER: &str = "<!--CASES-->";

/// Built-in back ends in the order of their colors.
const COLORS: [&str; 5] = ["reference", "raster", "voxel", "freeform", "stylized"];

/// Writes `stability.json`, `index.html`, `LIMITS.md` and one SVG for each case into a folder.
///
/// # Errors
/// When a file cannot be written; it is named.
pub fn write(cases: &[Case], outcomes: &[Outcome], folder: &Path, command: &str) -> Result<(), PictureError> {
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        write_whole(&path, text.as_bytes()).map_err(|e| PictureError::Write { path, error: e.to_string() })
    };
    write("stability.json", &serde_json::to_string_pretty(&numbers(outcomes)).unwrap_or_default())?;
    let mut body = String::new();
    for case in cases {
        let own: Vec<&Outcome> = outcomes.iter().filter(|o| o.case == case.id).collect();
        if own.is_empty() {
            continue;
        }
        let drawing = svg(case, &own);
        write(&format!("{}.svg", case.id), &drawing)?;
        body.push_str(&section(case, &own, &drawing));
    }
    let page = TEMPLATE
        .replacen("<!--FACTS-->", &escape(&format!("{}, {}: {command}", machine(), today())), 1)
        .replacen(PLACEHOLDER, &body, 1);
    write("index.html", &page)?;
    write("LIMITS.md", &limits(cases, outcomes))
}

/// Returns the outcomes in the shape that the command's contract gives.
#[must_use]
pub fn numbers(outcomes: &[Outcome]) -> Value {
    outcomes.iter().map(|o| json!(o)).collect()
}

/// Returns the command that draws one value of an outcome again.
#[must_use]
pub fn command_of(outcome: &Outcome, value: f64) -> String {
    let better = if outcome.method.is_some() { " --better" } else { "" };
    format!("polyptych stability {} -b {} --at {value:e}{better}", outcome.case, outcome.backend)
}

/// Draws the curves of a case.
fn svg(case: &Case, outcomes: &[&Outcome]) -> String {
    let values = || outcomes.iter().flat_map(|o| o.values.iter().copied());
    let is_logarithmic = case.is_logarithmic;
    // A logarithmic axis has no zero: it lies at a tenth of the smallest value, and the axis says so.
    let least = values().filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
    let place = |v: f64| if is_logarithmic && v <= 0.0 { least * 0.1 } else { v };
    let falls = case.values.first() > case.values.last();
    let range = if is_logarithmic {
        let [low, high] = log_range(values().map(place));
        [low, high]
    } else {
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        [low, if high > low { high } else { low + 1.0 }]
    };
    let errors = || outcomes.iter().flat_map(|o| o.error.iter().copied()).filter(|e| e.is_finite());
    let [low, high] = log_range(errors().chain([case.limit]));
    let series = outcomes.iter().map(|o| {
        let marks = o.values.iter().zip(&o.error).map(|(&v, &e)| Mark {
            x: place(v),
            y: if e.is_finite() { e } else { high },
            spread: None,
            is_solid: o.method.is_none(),
            text: format!("{}: at {} the error is {}", name(o), number(v), number(e)),
            index: None,
        });
        let marks: Vec<Mark> = marks.collect();
        let color = COLORS.iter().position(|c| *c == o.backend).unwrap_or(6);
        Series {
            color,
            line: marks.iter().map(|m| [m.x, m.y]).collect(),
            marks,
            line_class: if o.method.is_none() { "front" } else { "thin" },
        }
    });
    let direction = if falls { ", harder to the left" } else { "" };
    let plot = Plot {
        title: String::new(),
        x: PlotAxis {
            label: format!("{}{direction}", case.parameter),
            scale: if is_logarithmic { Scale::Log } else { Scale::Linear },
            range,
            zero: None,
        },
        y: PlotAxis {
            label: case.counted.to_owned(),
            scale: Scale::Log,
            range: [low, high],
            zero: Some("none"),
        },
        series: series.collect(),
        guides: Vec::new(),
        levels: if case.limit > 0.0 { vec![(case.limit, "limit".to_owned())] } else { Vec::new() },
    };
    let mut body = String::new();
    plot.draw(&mut body, Place { left: 0.0, top: 14.0, width: 720.0, height: 360.0 });
    let mut x = 66.0;
    for outcome in outcomes {
        let color = COLORS.iter().position(|c| *c == outcome.backend).unwrap_or(6);
        let fill = if outcome.method.is_none() { "solid" } else { "hollow" };
        let text = if outcome.method.is_none() { outcome.backend.clone() } else { "better".to_owned() };
        let _ = write!(
            body,
            "<g class=\"c{color}\">{}</g><text x=\"{:.0}\" y=\"20\">{}</text>",
            mark_shape(color, x, 16.0, 4.4, fill),
            x + 10.0,
            escape(&text)
        );
        x += 34.0 + text.len() as f64 * 6.4;
    }
    document(720.0, 380.0, case.title, &body)
}

/// Names a back end with its way.
fn name(outcome: &Outcome) -> String {
    outcome.method.map_or(outcome.backend.clone(), |m| format!("{}, {m}", outcome.backend))
}

/// Writes the part of the page about a case: curves, table, pictures around the break.
fn section(case: &Case, outcomes: &[&Outcome], drawing: &str) -> String {
    let mut rows = String::new();
    let mut pictures = String::new();
    for outcome in outcomes {
        let at = outcome.breaks_at.or(outcome.values.last().copied()).unwrap_or(0.0);
        let _ = write!(
            rows,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td><code>{}</code></td></tr>",
            escape(&name(outcome)),
            breaks(outcome),
            limits::price(outcome, outcomes),
            escape(&command_of(outcome, at))
        );
        if outcome.method.is_some() {
            continue;
        }
        // Two pictures a value: the back end's and the reference's.
        for (i, (value, jpeg)) in outcome.pictures.iter().enumerate() {
            let who = if i % 2 == 0 { outcome.backend.as_str() } else { "held against" };
            let _ = write!(
                pictures,
                "<figure><img alt=\"{0} at {1}\" src=\"data:image/jpeg;base64,{2}\"><figcaption>{0} at {1}</figcaption></figure>",
                escape(who),
                number(*value),
                STANDARD.encode(jpeg)
            );
        }
    }
    format!(
        "<section id=\"{id}\"><h2>{title} <small>{id}</small></h2><p>Counted: {counted}. Limit {limit}.</p>\
         <div class=\"two\"><div class=\"drawing\">{drawing}</div><div class=\"scroll\"><table><thead><tr><th>back end</th>\
         <th>breaks at</th><th>price</th><th>draws it again</th></tr></thead><tbody>{rows}</tbody></table></div></div>\
         <div class=\"sheet\">{pictures}</div></section>",
        id = case.id,
        title = escape(case.title),
        counted = escape(case.counted),
        limit = number(case.limit),
    )
}

/// Says where an outcome breaks.
fn breaks(outcome: &Outcome) -> String {
    match (outcome.breaks_at, &outcome.failure) {
        (Some(at), Some(failure)) => format!("{} ({})", number(at), escape(failure)),
        (Some(at), None) => number(at),
        (None, _) => "never".to_owned(),
    }
}
