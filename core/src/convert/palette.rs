//! Which few materials stand for the many colors of a surface?
//!
//! Source: P. Heckbert, *Color image quantization for frame buffer display*, SIGGRAPH 1982 (median cut).

use crate::scene::{Material, Object, Scene};
use glam::{Vec2, Vec3};
use std::collections::{BTreeMap, HashMap};

/// Most materials of a palette: one byte a voxel, 0 is empty.
const MOST: usize = 255;

/// A color of a material slot, cut to 5 bits a channel on a scale that is even to the eye.
pub(super) type ColorKey = (u16, [u8; 3]);

/// Collects the colors of a surface, then chooses a palette.
#[derive(Default)]
pub(super) struct ColorCollector {
    /// Sum and number of the colors with the same key, in a fixed order.
    seen: BTreeMap<ColorKey, (Vec3, u32)>,
}

/// The materials that were chosen.
pub(super) struct Palette {
    pub(super) materials: Vec<Material>,
    byte_of: HashMap<ColorKey, u8>,
}

struct ColorBox {
    members: Vec<(ColorKey, Vec3, u32)>,
}

impl ColorCollector {
    /// Returns the key of a color.
    pub(super) fn key(slot: u16, color: Vec3) -> ColorKey {
        let step = |c: f32| (crate::shade::srgb_from_linear(c) * 31.0).round() as u8;
        (slot, color.to_array().map(step))
    }

    /// Notes colors with one key: their sum and number.
    pub(super) fn note(&mut self, key: ColorKey, sum: Vec3, count: u32) {
        let entry = self.seen.entry(key).or_insert((Vec3::ZERO, 0));
        entry.0 += sum;
        entry.1 += count;
    }

    /// Adds what another has seen.
    pub(super) fn merge(&mut self, other: &Self) {
        for (&key, &(sum, count)) in &other.seen {
            self.note(key, sum, count);
        }
    }

    /// Chooses at most 255 materials: first one for each slot, then the boxes with the widest colors are cut.
    /// Slots beyond the 255th share materials with earlier ones.
    pub(super) fn choose(self, scene: &Scene, object: &Object) -> Palette {
        let mut by_slot: BTreeMap<u16, Vec<(ColorKey, Vec3, u32)>> = BTreeMap::new();
        for (key, (sum, count)) in self.seen {
            by_slot.entry(key.0 % MOST as u16).or_default().push((key, sum / count as f32, count));
        }
        let mut boxes: Vec<ColorBox> = by_slot.into_values().map(|members| ColorBox { members }).collect();
        while boxes.len() < MOST {
            let widest = (0..boxes.len()).max_by(|&a, &b| boxes[a].weight().total_cmp(&boxes[b].weight()));
            let Some(other) = widest.and_then(|i| boxes[i].cut()) else { break };
            boxes.push(other);
        }
        let mut palette = Palette { materials: Vec::new(), byte_of: HashMap::new() };
        for part in &boxes {
            palette.materials.push(part.material(scene, object));
            let byte = palette.materials.len() as u8;
            palette.byte_of.extend(part.members.iter().map(|m| (m.0, byte)));
        }
        palette
    }
}

impl Palette {
    /// Returns the byte of a color that was noted.
    pub(super) fn byte(&self, key: ColorKey) -> u8 {
        self.byte_of.get(&key).copied().unwrap_or(1)
    }
}

impl ColorBox {
    fn extent(&self) -> Vec3 {
        let colors = || self.members.iter().map(|m| m.1);
        colors().fold(Vec3::NEG_INFINITY, Vec3::max) - colors().fold(Vec3::INFINITY, Vec3::min)
    }

    /// Returns how much a cut would gain; nothing for boxes of one color.
    fn weight(&self) -> f32 {
        let count: u32 = self.members.iter().map(|m| m.2).sum();
        if self.members.len() < 2 { 0.0 } else { self.extent().max_element() * (count as f32).sqrt() }
    }

    /// Cuts off the upper half of the colors along the widest channel.
    fn cut(&mut self) -> Option<Self> {
        let extent = self.extent();
        if self.members.len() < 2 || extent.max_element() <= 0.0 {
            return None;
        }
        let axis = extent.max_position();
        self.members.sort_by(|a, b| a.1[axis].total_cmp(&b.1[axis]).then(a.0.cmp(&b.0)));
        let half = self.members.iter().map(|m| m.2).sum::<u32>() / 2;
        let mut below = 0;
        let at = self.members.iter().position(|m| {
            below += m.2;
            below > half
        });
        let at = at.unwrap_or(0).clamp(1, self.members.len() - 1);
        Some(Self { members: self.members.split_off(at) })
    }

    fn material(&self, scene: &Scene, object: &Object) -> Material {
        let count: u32 = self.members.iter().map(|m| m.2).sum();
        let sum: Vec3 = self.members.iter().map(|m| m.1 * m.2 as f32).sum();
        let slot = self.members.first().map_or(0, |m| usize::from(m.0.0));
        Material {
            base_color: sum / count.max(1) as f32,
            texture: None,
            normal_map: None,
            alpha: crate::scene::AlphaMode::Opaque,
            ..scene.material(object, slot).clone()
        }
    }
}

/// Returns the color of a triangle of a mesh at barycentric coordinates, nothing where the texture has a hole.
pub(super) fn triangle_color(
    scene: &Scene,
    object: &Object,
    mesh: &crate::scene::Mesh,
    triangle: usize,
    weights: Vec3,
) -> Option<Vec3> {
    let corners = mesh.triangles[triangle].map(|i| i as usize);
    let blend = |pick: &dyn Fn(usize) -> Vec3| {
        pick(corners[0]) * weights.x + pick(corners[1]) * weights.y + pick(corners[2]) * weights.z
    };
    let position = blend(&|i| mesh.positions[i]);
    let uv = (!mesh.uvs.is_empty()).then(|| {
        let uv = blend(&|i| mesh.uvs[i].extend(0.0));
        Vec2::new(uv.x, uv.y).to_array()
    });
    let [a, b, c] = mesh.corners(triangle);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let material = scene.material(object, mesh.slot(triangle));
    let (color, opacity) = scene.base_color(material, uv, position, normal, 0.0);
    let tint = if mesh.colors.is_empty() { Vec3::ONE } else { blend(&|i| mesh.colors[i]) };
    (material.effective_opacity(opacity) > 0.0).then_some(color * tint)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Primitive, Shape};

    fn note(colors: &mut ColorCollector, color: Vec3) -> ColorKey {
        let key = ColorCollector::key(0, color);
        colors.note(key, color, 1);
        key
    }

    #[test]
    fn few_colors_are_kept_exactly_and_many_are_cut_to_255() {
        let mut scene = Scene::default();
        let slot = scene.add_material(Material::default());
        let object = Object::new("o", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), slot);

        let mut few = ColorCollector::default();
        let red = note(&mut few, Vec3::X);
        let green = note(&mut few, Vec3::Y);
        let palette = few.choose(&scene, &object);
        assert_eq!(palette.materials[usize::from(palette.byte(red)) - 1].base_color, Vec3::X);
        assert_eq!(palette.materials[usize::from(palette.byte(green)) - 1].base_color, Vec3::Y);

        let mut many = ColorCollector::default();
        let keys: Vec<_> = (0..4096)
            .map(|i| {
                let color = Vec3::new((i % 16) as f32, (i / 16 % 16) as f32, (i / 256) as f32) / 15.0;
                (note(&mut many, color), color)
            })
            .collect();
        let palette = many.choose(&scene, &object);
        assert_eq!(palette.materials.len(), 255);
        let worst = keys
            .iter()
            .map(|(key, color)| {
                (palette.materials[usize::from(palette.byte(*key)) - 1].base_color - color)
                    .abs()
                    .max_element()
            })
            .fold(0.0, f32::max);
        assert!(worst < 0.35, "{worst}");
    }
}
