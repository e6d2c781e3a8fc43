//! Which style does the stylized back end draw in, and how is one's own kept?

use crate::field;
use eframe::egui;
use polyptych::picture::write_whole;
use polyptych::seam::{BackendInfo, Settings};
use polyptych::stylized::{Preset, STYLES};
use std::path::Path;

/// Parameters that are no part of a style.
const NOT_STYLE: [&str; 4] = ["visibility", "visibility.other", "styles", "cull"];

/// Returns the values that a picture is drawn with: those that were set, over those of the style.
pub(crate) fn effective(info: &BackendInfo, settings: &Settings) -> Settings {
    let mut all = settings.clone();
    let Some(style) = (info.id == "stylized").then(|| Preset::of(settings, "").ok()).flatten() else {
        return all;
    };
    for (name, value) in &style.settings {
        // What a style holds was checked when it was read.
        let _ = all.set(&info.id, &info.parameters, name, &value.to_string());
    }
    all
}

/// Returns the settings without what belongs to a style.
pub(crate) fn without_values(info: &BackendInfo, settings: &Settings) -> Settings {
    let mut rest = Settings::default();
    for (name, value) in settings.iter().filter(|(name, _)| NOT_STYLE.contains(name)) {
        let _ = rest.set(&info.id, &info.parameters, name, &value.to_string());
    }
    rest
}

/// Shows the styles to choose from, and a field to keep one's own.
pub(crate) fn show(ui: &mut egui::Ui, info: &BackendInfo, settings: &mut Settings, message: &mut String) {
    let file = settings.text(&info.parameters, "style").to_owned();
    let chosen = settings.text(&info.parameters, "preset").to_owned();
    ui.horizontal_wrapped(|ui| {
        for style in STYLES {
            let evokes = Preset::builtin(style).map(|p| p.evokes).unwrap_or_default();
            let is_chosen = file.is_empty() && chosen == *style;
            if ui.selectable_label(is_chosen, *style).on_hover_text(evokes).clicked() {
                *settings = without_values(info, settings);
                let _ = settings.set(&info.id, &info.parameters, "preset", style);
            }
        }
    });
    let place = ui.scope_id().with("style file");
    let mut path = ui.data(|d| d.get_temp::<String>(place)).unwrap_or_else(|| "my_style.ron".to_owned());
    // What is refused goes on in the next line: the panel stays as wide as it is.
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("file").id;
        ui.add(egui::TextEdit::singleline(&mut path).desired_width(120.0)).labelled_by(label);
        let saved = ui.button("Save style").clicked().then(|| save(settings, &path));
        if let Some(()) = field::checked(ui, "save", saved) {
            *message = format!("wrote {path}");
        }
        if ui.button("Use").on_hover_text("Draws in the style of this file").clicked() {
            let used = Preset::load(Path::new(&path)).map_err(|e| e.to_string()).map(|_| {
                *settings = without_values(info, settings);
                let _ = settings.set(&info.id, &info.parameters, "style", &path);
            });
            field::checked(ui, "use", Some(used));
        }
    });
    ui.data_mut(|d| d.insert_temp(place, path));
    ui.separator();
}

fn save(settings: &Settings, path: &str) -> Result<(), String> {
    if !path.ends_with(".ron") {
        return Err("styles are written as .ron".to_owned());
    }
    let style = Preset::of(settings, "A style of one's own.").map_err(|error| error.to_string())?;
    write_whole(Path::new(path), style.to_ron().as_bytes()).map_err(|error| format!("{path}: {error}"))
}
