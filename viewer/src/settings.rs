//! How are the parameters of a back end set? By a panel that is made from what it declares.

use crate::field;
use crate::pane::name;
use crate::style;
use crate::viewer::Viewer;
use eframe::egui;
use polyptych::seam::{BackendInfo, Origin, Parameter, ParameterKind, Settings, Value};

impl Viewer {
    /// Shows the parameters of the active pane's back end, and which back ends there are.
    pub(crate) fn show_settings(&mut self, ui: &mut egui::Ui) {
        let Some(id) = self.panes.get(self.active).map(|pane| pane.backend.clone()) else { return };
        let Ok(info) = self.registry.info(&id).cloned() else { return };
        let mut settings = self.settings(&id);
        egui::Panel::right("settings").default_size(280.0).show(ui, |ui| {
            ui.heading(&info.name);
            egui::ScrollArea::vertical().show(ui, |ui| {
                if id == "stylized" {
                    style::show(ui, &info, &mut settings, &mut self.message);
                }
                panel(ui, &info, &mut settings);
                if ui.button("Back to what it comes with").clicked() {
                    settings = Settings::default();
                }
                ui.separator();
                ui.collapsing("All back ends", |ui| self.show_backends(ui));
            });
        });
        self.settings.insert(id, settings);
    }

    /// Lists the back ends with where they come from, how they fare, and those that were refused.
    fn show_backends(&mut self, ui: &mut egui::Ui) {
        for (info, origin) in self.registry.iter() {
            let failed = self.panes.iter().find(|p| p.backend == info.id).and_then(|p| p.failure.as_ref());
            let from = match origin {
                Origin::BuiltIn => "comes along".to_owned(),
                Origin::Library(path) => path.display().to_string(),
            };
            let color = failed.map_or(ui.visuals().text_color(), |_| ui.visuals().error_fg_color);
            ui.colored_label(color, format!("{} {}", info.id, info.version)).on_hover_text(from);
            failed.into_iter().for_each(|why| drop(ui.weak(why)));
        }
        self.refused.iter().for_each(|line| drop(ui.add_enabled(false, egui::Label::new(line))));
        if self.panes.iter().any(|p| p.failure.is_some())
            && ui.button("Start those that failed anew").clicked()
        {
            self.panes.iter_mut().filter(|p| p.failure.is_some()).for_each(crate::pane::Pane::try_again);
        }
    }
}

/// Takes along what has the same meaning for another back end, where nothing was set for that one itself.
pub(crate) fn carry(set: &Settings, from: &BackendInfo, own: &mut Settings, to: &BackendInfo) {
    for (name, value) in set.iter() {
        let Some(source) = from.parameters.iter().find(|p| p.name == name && !p.tag.is_empty()) else {
            continue;
        };
        let same = |p: &&Parameter| p.tag == source.tag && p.quality_axis == source.quality_axis;
        let Some(target) = to.parameters.iter().find(same) else { continue };
        if own.iter().all(|(name, _)| name != target.name) {
            // Another range, or other words: then its own default is right.
            let _ = own.set(&to.id, &to.parameters, target.name, &value.to_string());
        }
    }
}

/// Shows all parameters of a back end, those that belong together under one heading.
fn panel(ui: &mut egui::Ui, info: &BackendInfo, settings: &mut Settings) {
    if info.parameters.is_empty() {
        ui.label("no parameters");
    }
    let drawn_with = style::effective(info, settings);
    let group = |parameter: &Parameter| parameter.name.split('.').next().unwrap_or_default();
    let mut groups: Vec<&str> = Vec::new();
    for parameter in &info.parameters {
        if !groups.contains(&group(parameter)) {
            groups.push(group(parameter));
        }
    }
    let mut is_first = true;
    for name in groups {
        let members: Vec<_> = info.parameters.iter().filter(|p| group(p) == name).collect();
        let mut show = |ui: &mut egui::Ui| {
            for parameter in &members {
                let current = drawn_with.get(&info.parameters, parameter.name);
                let label = ui.label(parameter.name).on_hover_text(parameter.help);
                ui.push_id((&info.id, parameter.name), |ui| {
                    let text = control(ui, parameter, current, label.id);
                    let set = text.map(|text| set(info, settings, parameter, &text));
                    field::checked(ui, "value", set);
                });
            }
        };
        if members.len() > 2 {
            let is_open = groups_are_few(info) || std::mem::take(&mut is_first);
            egui::CollapsingHeader::new(name).default_open(is_open).show(ui, show);
        } else {
            show(ui);
        }
    }
}

/// Tells whether all groups may be open at first.
fn groups_are_few(info: &BackendInfo) -> bool {
    info.parameters.len() < 16
}

fn set(info: &BackendInfo, settings: &mut Settings, parameter: &Parameter, text: &str) -> Result<(), String> {
    if parameter.name == "preset" {
        // Another style: its own numbers count, not those set for the one before.
        *settings = style::without_values(info, settings);
    }
    settings.set(&info.id, &info.parameters, parameter.name, text).map_err(|error| error.to_string())
}

/// Shows one parameter, and returns its new value as text when it was changed.
fn control(ui: &mut egui::Ui, parameter: &Parameter, current: &Value, label: egui::Id) -> Option<String> {
    let unit = if parameter.unit.is_empty() { String::new() } else { format!(" {}", parameter.unit) };
    match (parameter.kind, current) {
        (ParameterKind::Bool, Value::Bool(value)) => {
            let mut value = *value;
            let changed = ui.checkbox(&mut value, "on").labelled_by(label).changed();
            changed.then(|| value.to_string())
        }
        (ParameterKind::Int { min, max }, Value::Int(value)) => {
            let mut number = *value as f64;
            let range = min as f64..=max as f64;
            let changed = field::number(ui, parameter.name, &mut number, &range, (&unit, 0));
            changed.then(|| (number.round() as i64).to_string())
        }
        (ParameterKind::Float { min, max }, Value::Float(_) | Value::Int(_)) => {
            let mut number = match current {
                Value::Int(value) => *value as f64,
                Value::Float(value) => *value,
                Value::Bool(_) | Value::Text(_) => min,
            };
            field::number(ui, parameter.name, &mut number, &(min..=max), (&unit, field::DECIMALS))
                .then(|| number.to_string())
        }
        (ParameterKind::Choice { choices }, Value::Text(value)) => {
            let mut chosen = value.as_str();
            let list = egui::ComboBox::from_id_salt("choice").selected_text(chosen).show_ui(ui, |ui| {
                for choice in choices {
                    ui.selectable_value(&mut chosen, *choice, *choice);
                }
            });
            name(&list.response, parameter.name);
            (chosen != value).then(|| chosen.to_owned())
        }
        (ParameterKind::Color, Value::Text(value)) => {
            let mut color = egui::Color32::from_hex(value).unwrap_or(egui::Color32::BLACK);
            let changed = ui.color_edit_button_srgba(&mut color).labelled_by(label).changed();
            changed.then(|| format!("#{:02x}{:02x}{:02x}", color.r(), color.g(), color.b()))
        }
        (ParameterKind::Text, Value::Text(value)) => {
            let mut text = value.clone();
            let field = egui::TextEdit::singleline(&mut text).desired_width(140.0);
            ui.add(field).labelled_by(label).changed().then_some(text)
        }
        // A default of another type than declared is a bug of the back end: shown, not edited.
        _ => {
            ui.label(current.to_string());
            None
        }
    }
}
