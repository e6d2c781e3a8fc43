//! How is a number asked for, and what if it will not do? It stays as it was, and the reason stands below.

use eframe::egui::{self, DragValue, Id, RichText, Ui, WidgetInfo};
use std::cell::Cell;
use std::ops::RangeInclusive;

/// Any number.
pub(crate) const ANY: RangeInclusive<f64> = -1e9..=1e9;
/// A length.
pub(crate) const POSITIVE: RangeInclusive<f64> = 1e-6..=1e9;

/// Decimals of numbers that are not whole.
pub(crate) const DECIMALS: usize = 4;

/// Shows a number by its name. Tells whether it was changed to something in the range.
pub(crate) fn number(
    ui: &mut Ui,
    name: &str,
    value: &mut f64,
    range: &RangeInclusive<f64>,
    (unit, decimals): (&str, usize),
) -> bool {
    let (mut shown, is_nonsense) = (*value, Cell::new(None));
    let read = |text: &str| {
        let number = text.trim().trim_end_matches(unit.trim()).trim().parse::<f64>().ok();
        is_nonsense.set(Some(number.is_none()));
        number
    };
    let speed = (value.abs() * 0.01).max(0.005 * (range.end() - range.start()).min(1.0));
    let speed = if decimals == 0 { speed.max(0.1) } else { speed };
    let drag =
        DragValue::new(&mut shown).speed(speed).max_decimals(decimals).suffix(unit).custom_parser(read);
    let response = ui.add(drag);
    response.widget_info(|| WidgetInfo {
        value: Some(*value),
        ..WidgetInfo::labeled(egui::Role::SpinButton, true, name)
    });
    let place = response.id.with("refusal");
    if is_nonsense.get() == Some(true) {
        refuse(ui, place, "a number is written like 1.5");
    } else if shown != *value {
        if range.contains(&shown) {
            accept(ui, place);
            *value = shown;
            return true;
        }
        let (low, high) = (range.start(), range.end());
        let words = match (*low > -1e9, *high < 1e9) {
            (_, true) => format!("{name} must be {low} to {high}, got {shown}"),
            (true, false) => format!("{name} must be at least {low}, got {shown}"),
            (false, false) => format!("{name} cannot be {shown}"),
        };
        refuse(ui, place, &words);
    }
    show_refusal(ui, place);
    false
}

/// Shows numbers in a row of a grid, under one name. Tells whether one was changed.
pub(crate) fn numbers<const N: usize>(
    ui: &mut Ui,
    name: &str,
    values: [&mut f64; N],
    range: &RangeInclusive<f64>,
) -> bool {
    let mut is_changed = false;
    ui.label(name);
    ui.horizontal_wrapped(|ui| {
        for (i, value) in values.into_iter().enumerate() {
            let own = if N == 1 { name.to_owned() } else { format!("{name} {i}") };
            is_changed |= number(ui, &own, value, range, ("", DECIMALS));
        }
    });
    ui.end_row();
    is_changed
}

/// Remembers why something was refused.
pub(crate) fn refuse(ui: &Ui, place: Id, why: &str) {
    ui.data_mut(|data| data.insert_temp(place, why.to_owned()));
}

/// Forgets that something was refused.
pub(crate) fn accept(ui: &Ui, place: Id) {
    ui.data_mut(|data| data.remove::<String>(place));
}

/// Says why something was refused.
pub(crate) fn show_refusal(ui: &mut Ui, place: Id) {
    if let Some(why) = ui.data(|data| data.get_temp::<String>(place)) {
        ui.label(RichText::new(why).color(ui.visuals().error_fg_color).small());
    }
}

/// Takes over what a field made, or says below it why that will not do.
pub(crate) fn checked<T>(ui: &mut Ui, salt: &str, made: Option<Result<T, String>>) -> Option<T> {
    let place = ui.scope_id().with(salt);
    let taken = match made {
        Some(Ok(value)) => {
            accept(ui, place);
            Some(value)
        }
        Some(Err(why)) => {
            refuse(ui, place, &why);
            None
        }
        None => None,
    };
    show_refusal(ui, place);
    taken
}

/// Shows a color by its name.
pub(crate) fn color(ui: &mut Ui, name: &str, color: &mut glam::Vec3) -> bool {
    let label = ui.label(name).id;
    let mut rgb = color.to_array();
    let is_changed = ui.color_edit_button_rgb(&mut rgb).labelled_by(label).changed();
    *color = glam::Vec3::from_array(rgb);
    ui.end_row();
    is_changed
}

/// Shows a number as a slider by its name.
pub(crate) fn slider(ui: &mut Ui, name: &str, value: &mut f32, range: RangeInclusive<f32>) -> bool {
    let label = ui.label(name).id;
    let is_changed = ui.add(egui::Slider::new(value, range)).labelled_by(label).changed();
    ui.end_row();
    is_changed
}
