//! What does a comparison leave on disk: a sheet, a page, numbers, and a picture for each panel?

pub mod chart;
mod page;
pub(crate) mod plot;
mod sheet;
pub mod stability;

pub(crate) use page::machine;

use crate::compare::{Comparison, Panel};
use crate::framebuffer::Channel;
use crate::picture::{self, PictureError, write_whole};
use crate::seam::Decision;
use serde_json::{Value, json};
use std::path::Path;

/// Writes `sheet.png`, `index.html`, `compare.json` and one PNG for each panel into a folder.
///
/// `command` is what reproduces the comparison.
///
/// # Errors
/// When a file cannot be written; it is named.
pub fn write(comparison: &Comparison, folder: &Path, command: &str) -> Result<(), PictureError> {
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        write_whole(&path, bytes).map_err(|e| PictureError::Write { path, error: e.to_string() })
    };
    for panel in &comparison.panels {
        picture::save(&panel.picture, Channel::Color, &folder.join(format!("{}.png", panel.backend)))?;
    }
    let sheet = sheet::draw(comparison);
    let png = picture::encode(&sheet.pixels, sheet.width, sheet.height, "png")
        .map_err(|error| PictureError::Write { path: folder.join("sheet.png"), error })?;
    write("sheet.png", &png)?;
    write("index.html", page::fill(comparison, command).as_bytes())?;
    let text = serde_json::to_string_pretty(&numbers(comparison)).unwrap_or_default();
    write("compare.json", text.as_bytes())
}

/// Returns the comparison's numbers in the shape that the command's contract gives.
#[must_use]
pub fn numbers(comparison: &Comparison) -> Value {
    let (reference, others) = comparison.panels.split_at(comparison.panels.len().min(1));
    json!({
        "scene": comparison.scene,
        "width": comparison.width,
        "height": comparison.height,
        "threads": comparison.threads,
        "notes": comparison.notes,
        "reference": reference.first().map(|p| panel_json(comparison, p)),
        "panels": others.iter().map(|p| panel_json(comparison, p)).collect::<Vec<_>>(),
    })
}

/// Counts how many objects were drawn in which way.
#[must_use]
pub fn count_decisions(decisions: &[Decision]) -> Value {
    let count = |word: &str| decisions.iter().filter(|d| d.word() == word).count();
    json!({
        "exact": count("exact"), "converted": count("converted"),
        "approximated": count("approximated"), "skipped": count("skipped"),
    })
}

fn panel_json(comparison: &Comparison, panel: &Panel) -> Value {
    let decisions: Vec<Value> = comparison
        .objects
        .iter()
        .zip(panel.decisions.iter())
        .map(|((name, shape), d)| {
            json!({"name": name, "shape": shape, "decision": d.word(), "bound": d.bound(), "why": d.why()})
        })
        .collect();
    json!({
        "backend": panel.backend,
        "name": panel.name,
        "settings": panel.settings,
        "prepare_ms": panel.prepare_ms,
        "frame_ms": panel.frame_ms,
        "bytes": panel.bytes,
        "objects": count_decisions(&panel.decisions),
        "decisions": decisions,
        "errors": panel.errors,
        "split": panel.split,
        "gate": panel.gate,
    })
}

/// Writes a comparison as a table for a terminal.
#[must_use]
pub fn table(comparison: &Comparison) -> String {
    let mut rows = vec![
        [
            "back end",
            "prepare ms",
            "frame ms",
            "bytes",
            "exact/conv/approx/skip",
            "PSNR dB",
            "FLIP",
            "distance",
            "ids",
            "gate",
        ]
        .map(str::to_owned),
    ];
    for panel in &comparison.panels {
        let count = |word: &str| panel.decisions.iter().filter(|d| d.word() == word).count();
        let counts =
            ["exact", "converted", "approximated", "skipped"].map(|w| count(w).to_string()).join("/");
        let errors = panel.errors.unwrap_or_default();
        let number = |v: Option<f64>, digits: usize| v.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
        let gate = match &panel.gate {
            Some(verdict) if verdict.passed => "passed".to_owned(),
            Some(verdict) => format!("FAILED: {}", verdict.failed.join(", ")),
            None => "-".to_owned(),
        };
        rows.push([
            panel.backend.clone(),
            format!("{:.1}", panel.prepare_ms),
            format!("{:.2}", panel.frame_ms),
            panel.bytes.to_string(),
            counts,
            number(errors.color.map(|c| c.psnr), 2),
            number(errors.color.map(|c| c.flip), 4),
            errors.distance.map_or("-".to_owned(), |d| format!("{:.1e}", d.mean)),
            number(errors.id_agreement, 5),
            gate,
        ]);
    }
    let widths: Vec<usize> =
        (0..rows[0].len()).map(|c| rows.iter().map(|r| r[c].len()).max().unwrap_or(0)).collect();
    let line = |row: &[String; 10]| {
        let cells = row.iter().zip(&widths).enumerate().map(|(i, (cell, &w))| {
            if i == 0 || i == 9 { format!("{cell:<w$}") } else { format!("{cell:>w$}") }
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}
