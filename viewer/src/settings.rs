//! How are the parameters of a back end set? By a panel that is made from what it declares.

use crate::pane::name;
use eframe::egui;
use polyptych::seam::{BackendInfo, Parameter, ParameterKind, Settings, Value};

/// Shows all parameters of a back end. Tells whether one was changed; a value that is refused changes nothing.
pub(crate) fn panel(ui: &mut egui::Ui, info: &BackendInfo, settings: &mut Settings) -> bool {
    let mut changed = false;
    if info.parameters.is_empty() {
        ui.label("no parameters");
    }
    for parameter in &info.parameters {
        let current = settings.get(&info.parameters, parameter.name).clone();
        let label = ui.label(parameter.name).on_hover_text(parameter.help);
        ui.push_id((&info.id, parameter.name), |ui| {
            if let Some(text) = field(ui, parameter, &current, label.id) {
                changed |= settings.set(&info.id, &info.parameters, parameter.name, &text).is_ok();
            }
        });
    }
    changed
}

/// Shows one parameter, and returns its new value as text when it was changed.
fn field(ui: &mut egui::Ui, parameter: &Parameter, current: &Value, label: egui::Id) -> Option<String> {
    let unit = if parameter.unit.is_empty() { String::new() } else { format!(" {}", parameter.unit) };
    match (parameter.kind, current) {
        (ParameterKind::Bool, Value::Bool(value)) => {
            let mut value = *value;
            let changed = ui.checkbox(&mut value, "on").labelled_by(label).changed();
            changed.then(|| value.to_string())
        }
        (ParameterKind::Int { min, max }, Value::Int(value)) => {
            let mut value = *value;
            let widget = egui::DragValue::new(&mut value).range(min..=max).suffix(unit);
            ui.add(widget).labelled_by(label).changed().then(|| value.to_string())
        }
        (ParameterKind::Float { min, max }, Value::Float(_) | Value::Int(_)) => {
            let mut value = match current {
                Value::Int(value) => *value as f64,
                Value::Float(value) => *value,
                Value::Bool(_) | Value::Text(_) => min,
            };
            let speed = ((max - min) * 1e-3).clamp(1e-6, 1.0);
            let widget = egui::DragValue::new(&mut value).range(min..=max).speed(speed).suffix(unit);
            ui.add(widget).labelled_by(label).changed().then(|| value.to_string())
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
