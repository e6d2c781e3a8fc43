//! Which numbers make a free form? Those of its functions, one within another.

use crate::field::{ANY, numbers};
use eframe::egui;
use glam::DVec3;
use polyptych::scene::{Form, Perturbation, Power};

/// Names of the ten coefficients.
const COEFFICIENTS: [&str; 10] = ["x²", "y²", "z²", "xy", "xz", "yz", "x", "y", "z", "1"];
/// Deepest function that is shown.
const DEEPEST: usize = 12;

/// Shows a form and what is in it. Tells whether a number was changed, or a part added or taken away.
pub(super) fn fields(ui: &mut egui::Ui, name: &str, form: &mut Form, depth: usize) -> bool {
    if depth > DEEPEST {
        ui.weak("deeper functions are not shown");
        return false;
    }
    let title = format!("{name}: {}", kind(form));
    let header = egui::CollapsingHeader::new(title).id_salt((name, depth)).default_open(depth < 2);
    header.show(ui, |ui| numbers_of(ui, form) | parts_of(ui, form, depth)).body_returned.unwrap_or(false)
}

fn kind(form: &Form) -> &'static str {
    match form {
        Form::Quadric(_) => "quadric",
        Form::Ellipsoid { .. } => "ellipsoid",
        Form::HalfSpace { .. } => "half space",
        Form::Cylinder { .. } => "cylinder",
        Form::Torus { .. } => "ring",
        Form::Perturbed { .. } => "perturbed",
        Form::Union(_) => "union",
        Form::Intersection(_) => "intersection",
        Form::Difference(..) => "difference",
        Form::SmoothUnion { .. } => "smooth union",
        Form::Offset { .. } => "offset",
        Form::Morph { .. } => "morph",
    }
}

fn vector(ui: &mut egui::Ui, name: &str, v: &mut DVec3) -> bool {
    numbers(ui, name, [&mut v.x, &mut v.y, &mut v.z], &ANY)
}

/// Shows the numbers of the function itself.
fn numbers_of(ui: &mut egui::Ui, form: &mut Form) -> bool {
    let grid = egui::Grid::new("numbers").num_columns(2);
    grid.show(ui, |ui| match form {
        Form::Quadric(quadric) => {
            let mut is_changed = false;
            for (name, value) in COEFFICIENTS.iter().zip(&mut quadric.0) {
                is_changed |= numbers(ui, &format!("coefficient of {name}"), [value], &ANY);
            }
            is_changed
        }
        Form::Ellipsoid { center, radii } => vector(ui, "center", center) | vector(ui, "radii", radii),
        Form::HalfSpace { normal, offset } => {
            vector(ui, "normal", normal) | numbers(ui, "offset", [offset], &ANY)
        }
        Form::Cylinder { center, axis, radius } => {
            vector(ui, "center", center) | vector(ui, "axis", axis) | numbers(ui, "radius", [radius], &ANY)
        }
        Form::Torus { major, minor } => {
            numbers(ui, "ring radius", [major], &ANY) | numbers(ui, "tube radius", [minor], &ANY)
        }
        Form::SmoothUnion { k, .. } => numbers(ui, "fillet", [k], &(1e-6..=1e9)),
        Form::Offset { amount, .. } => numbers(ui, "amount", [amount], &ANY),
        Form::Morph { t, .. } => numbers(ui, "share of the second", [t], &(0.0..=1.0)),
        Form::Perturbed { .. } | Form::Union(_) | Form::Intersection(_) | Form::Difference(..) => false,
    })
    .inner
}

/// Shows the functions that it is made from.
fn parts_of(ui: &mut egui::Ui, form: &mut Form, depth: usize) -> bool {
    let show = |ui: &mut egui::Ui, name: &str, part: &mut Form| fields(ui, name, part, depth + 1);
    match form {
        Form::Perturbed { base, terms } => {
            let is_changed = show(ui, "base", base);
            is_changed | terms_of(ui, terms, depth)
        }
        Form::Union(parts) | Form::Intersection(parts) => {
            let parts = parts.iter_mut().enumerate();
            parts.fold(false, |changed, (i, part)| changed | show(ui, &format!("part {i}"), part))
        }
        Form::Difference(a, b) => show(ui, "body", a) | show(ui, "cut away", b),
        Form::SmoothUnion { a, b, .. } => show(ui, "first", a) | show(ui, "second", b),
        Form::Offset { form, .. } => show(ui, "body", form),
        Form::Morph { from, to, .. } => show(ui, "from", from) | show(ui, "to", to),
        _ => perturb(ui, form),
    }
}

fn terms_of(ui: &mut egui::Ui, terms: &mut Vec<Perturbation>, depth: usize) -> bool {
    let (mut is_changed, mut gone) = (false, None);
    for (index, term) in terms.iter_mut().enumerate() {
        ui.push_id(("term", index), |ui| {
            ui.horizontal(|ui| {
                is_changed |= numbers(ui, &format!("weight {index}"), [&mut term.weight], &ANY);
                for (power, name) in [(Power::Square, "square"), (Power::Cube, "cube")] {
                    is_changed |= ui.selectable_value(&mut term.power, power, name).changed();
                }
                if ui.small_button("Remove").clicked() {
                    gone = Some(index);
                }
            });
            is_changed |= fields(ui, &format!("bends it {index}"), &mut term.function, depth + 1);
        });
    }
    if let Some(index) = gone {
        terms.remove(index);
    }
    let adds = ui.small_button("Add a perturbation").clicked();
    if adds {
        terms.push(bump());
    }
    is_changed | adds | gone.is_some()
}

/// Offers to bend a function that is not bent yet.
fn perturb(ui: &mut egui::Ui, form: &mut Form) -> bool {
    let wanted = ui.small_button("Perturb it").clicked();
    if wanted {
        let base = Box::new(form.clone());
        *form = Form::Perturbed { base, terms: vec![bump()] };
    }
    wanted
}

fn bump() -> Perturbation {
    let function = Form::Ellipsoid { center: DVec3::new(0.3, 0.3, 0.0), radii: DVec3::splat(0.3) };
    Perturbation { weight: 0.5, power: Power::Square, function }
}
