//! Colors and materials of `.vox` files.

use super::chunks::{Chunks, Dict};
use crate::scene::Material;
use crate::shade::linear_from_srgb;
use glam::Vec3;

/// Returns the material of a color index, 1 to 255.
pub(super) fn material(chunks: &Chunks<'_>, index: u8) -> Material {
    let [r, g, b] = color(chunks, index).map(|c| linear_from_srgb(f32::from(c) / 255.0));
    let mut material = Material { name: format!("color {index}"), ..Material::new(Vec3::new(r, g, b)) };
    material.specular = 0.0;
    if let Some(entry) = chunks.materials.get(&i32::from(index)) {
        apply(entry, &mut material);
    } else if let Some(&(kind, weight)) = chunks.old_materials.get(&i32::from(index)) {
        let weight = if weight.is_finite() { weight.clamp(0.0, 1.0) } else { 0.0 };
        match kind {
            1 => make_metal(&mut material, weight, 0.1),
            2 => material.opacity = 1.0 - weight,
            3 => material.emission = material.base_color * weight,
            _ => {}
        }
    }
    material
}

/// Applies a MATL chunk. `_flux` 0 to 4 is the power of the light: each step doubles it here.
fn apply(entry: &Dict<'_>, material: &mut Material) {
    let share = |key: &str| entry.number(key).map(|v| v.clamp(0.0, 1.0));
    let weight = share("_weight").unwrap_or(1.0);
    let rough = share("_rough").unwrap_or(0.1);
    match entry.get("_type") {
        Some(b"_metal") => make_metal(material, share("_metal").unwrap_or(weight), rough),
        Some(b"_emit") => {
            let power = entry.number("_flux").unwrap_or(0.0).clamp(0.0, 8.0).exp2();
            material.emission = material.base_color * share("_emit").unwrap_or(weight) * power;
        }
        Some(b"_glass") => {
            material.opacity = 1.0 - share("_trans").or(share("_alpha")).unwrap_or(weight);
            material.specular = 0.4;
            material.shininess = 128.0;
        }
        Some(b"_blend" | b"_media") => {
            make_metal(material, share("_metal").unwrap_or(0.0), rough);
            material.opacity = 1.0 - share("_trans").or(share("_alpha")).unwrap_or(0.0);
        }
        _ => {}
    }
}

fn make_metal(material: &mut Material, metal: f32, rough: f32) {
    material.reflectivity = 0.6 * metal * (1.0 - rough);
    material.specular = 0.6 * metal;
    material.shininess = (2.0 / rough.powi(4).max(1e-6) - 2.0).clamp(4.0, 1024.0);
}

/// Entry `i` of the palette chunk is color `i + 1`.
fn color(chunks: &Chunks<'_>, index: u8) -> [u8; 3] {
    let at = (usize::from(index) - 1) * 4;
    match chunks.palette.and_then(|p| p.get(at..at + 3)) {
        Some(rgb) => [rgb[0], rgb[1], rgb[2]],
        None => default_color(index),
    }
}

/// The editor's palette of files that bring none: a cube of six steps from white down without black, then ramps of
/// blue, green, red and gray.
fn default_color(index: u8) -> [u8; 3] {
    const RAMP: [u8; 10] = [0xee, 0xdd, 0xbb, 0xaa, 0x88, 0x77, 0x55, 0x44, 0x22, 0x11];
    let i = usize::from(index) - 1;
    if i < 215 {
        let step = |s: usize| (5 - s % 6) as u8 * 51;
        return [step(i / 36), step(i / 6), step(i)];
    }
    let level = RAMP[(i - 215) % 10];
    match (i - 215) / 10 {
        0 => [level, 0, 0],
        1 => [0, level, 0],
        2 => [0, 0, level],
        _ => [level; 3],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_palette_is_the_editors() {
        for index in 1..=255u8 {
            let known = dot_vox::DEFAULT_PALETTE[usize::from(index) - 1];
            assert_eq!(default_color(index), [known.r, known.g, known.b], "color {index}");
        }
    }
}
