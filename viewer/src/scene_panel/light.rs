//! Which numbers make a light?

use super::Edit;
use crate::field::{ANY, color, numbers, slider};
use eframe::egui;
use polyptych::scene::{LightKind, Scene};

/// Shows the fields of a light. Returns the scene with it changed.
pub(super) fn show(ui: &mut egui::Ui, scene: &Scene, index: usize) -> Option<Edit> {
    let (mut light, mut is_changed) = (scene.lights[index].clone(), false);
    egui::Grid::new(("light", index)).num_columns(2).show(ui, |ui| {
        let (place, direction, cone) = match &mut light.kind {
            LightKind::Directional { direction } => (None, Some(direction), None),
            LightKind::Point { position } => (Some(position), None, None),
            LightKind::Spot { position, direction, inner, outer } => {
                (Some(position), Some(direction), Some((inner, outer)))
            }
        };
        for (name, vector) in [("place", place), ("direction", direction)] {
            if let Some(v) = vector {
                is_changed |= numbers(ui, name, [&mut v.x, &mut v.y, &mut v.z], &ANY);
            }
        }
        if let Some((inner, outer)) = cone {
            let mut degrees = [inner.to_degrees(), outer.to_degrees()];
            let [full, none] = &mut degrees;
            if numbers(ui, "full light within, degrees", [full], &(0.0..=*none))
                | numbers(ui, "no light beyond, degrees", [none], &(*full..=90.0))
            {
                (*inner, *outer) = (degrees[0].to_radians(), degrees[1].to_radians());
                is_changed = true;
            }
        }
        is_changed |= color(ui, "color", &mut light.color);
        is_changed |= slider(ui, "intensity", &mut light.intensity, 0.0..=20.0);
        is_changed |= ui.checkbox(&mut light.casts_shadow, "casts shadows").changed();
    });
    is_changed.then(|| Edit::new(scene, format!("light {index}"), |scene| scene.lights[index] = light))
}
