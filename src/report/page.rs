//! The comparison as one self-contained page.

use super::{numbers, panel_json};
use crate::compare::{Comparison, Panel};
use crate::framebuffer::Channel;
use crate::picture::{displayed, encode};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::time::{SystemTime, UNIX_EPOCH};

/// The page without its numbers; the comment is replaced.
const TEMPLATE: &str = include_str!("page.html");
const PLACEHOLDER: &str = "/*DATA*/null";

/// Fills the page.
pub(super) fn fill(comparison: &Comparison, command: &str) -> String {
    let mut data = numbers(comparison);
    data["title"] = json!(format!("{}: {} panels", comparison.scene, comparison.panels.len()));
    data["machine"] = json!(machine());
    data["date"] = json!(today());
    data["command"] = json!(command);
    data["object_names"] = json!(comparison.objects.iter().map(|(name, _)| name).collect::<Vec<_>>());
    data["panels"] = comparison.panels.iter().map(|p| panel(comparison, p)).collect();
    // Nothing in a name may end the script or begin a comment in it.
    TEMPLATE.replacen(PLACEHOLDER, &data.to_string().replace('<', "\\u003c"), 1)
}

fn panel(comparison: &Comparison, panel: &Panel) -> Value {
    let mut value = panel_json(comparison, panel);
    let picture = &panel.picture;
    let mut images = serde_json::Map::new();
    for channel in picture.channels().iter() {
        if let Ok(png) = encode(&displayed(picture, channel), picture.width(), picture.height(), "png") {
            let url = format!("data:image/png;base64,{}", STANDARD.encode(png));
            images.insert(channel.name().to_owned(), json!(url));
        }
    }
    value["images"] = Value::Object(images);
    let words = |bytes: Vec<u8>| json!(STANDARD.encode(bytes));
    let mut raw = serde_json::Map::new();
    if picture.channels().has(Channel::Distance) {
        raw.insert(
            "distance".into(),
            words(picture.distance().iter().flat_map(|d| d.to_le_bytes()).collect()),
        );
    }
    if picture.channels().has(Channel::Id) {
        raw.insert("id".into(), words(picture.id().iter().flat_map(|d| d.to_le_bytes()).collect()));
    }
    value["values"] = Value::Object(raw);
    value["split"]["split_note"] = json!(
        "root mean square color error: model = the reference on the back end's own model \
                                 against the reference on the scene; method = the back end against the \
                                 reference on the same model"
    );
    value
}

/// Names the processor.
pub(crate) fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info
        .lines()
        .find_map(|l| l.strip_prefix("model name"))
        .and_then(|l| l.split(':').nth(1))
        .map_or(std::env::consts::ARCH, str::trim);
    format!("{model}, {cores} cores, {}", std::env::consts::OS)
}

/// Returns the date as year-month-day, UTC.
///
/// Source: H. Hinnant, *chrono-compatible low-level date algorithms*, 2013 (civil_from_days).
pub(super) fn today() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    let days = (seconds / 86_400) as i64 + 719_468;
    let (era, day_of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted + 2) / 5 + 1;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}
