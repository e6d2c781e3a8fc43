//! How are voxels painted and terrains raised? Where the picture shows them, within the brush's radius.

use crate::scene_panel::Edit;
use crate::tools::Tool;
use eframe::egui::{self, Pos2, Rect};
use glam::{DVec2, DVec3};
use polyptych::camera::Camera;
use polyptych::framebuffer::Framebuffer;
use polyptych::scene::{HeightField, Object, Scene, Shape, Voxels};
use std::sync::Arc;

/// Points that the mouse moves between two dabs.
const STEP: f32 = 3.0;

/// What is painted with.
pub(crate) struct Brush {
    /// Radius in cells of the grid, or samples of the terrain.
    radius: f64,
    /// Palette byte of the voxels that are painted.
    material: f64,
    /// Share of the radius that a dab raises.
    strength: f64,
    last: Option<Pos2>,
}

impl Default for Brush {
    fn default() -> Self {
        Self { radius: 2.5, material: 1.0, strength: 0.1, last: None }
    }
}

impl Brush {
    /// Shows its numbers.
    pub(crate) fn show(&mut self, ui: &mut egui::Ui) {
        for (name, value, range) in [
            ("brush radius", &mut self.radius, 0.5..=64.0),
            ("brush material", &mut self.material, 1.0..=255.0),
            ("brush strength", &mut self.strength, 0.01..=1.0),
        ] {
            let label = ui.label(name).id;
            ui.add(egui::Slider::new(value, range)).labelled_by(label);
        }
    }

    /// Ends a stroke.
    pub(crate) fn lift(&mut self) {
        self.last = None;
    }

    /// Paints at a place of a picture. Returns the changed scene.
    pub(crate) fn dab(
        &mut self,
        (scene, camera): (&Scene, &Camera),
        shown: &Framebuffer,
        (pointer, picture): (Pos2, Rect),
        tool: Tool,
    ) -> Option<Edit> {
        if self.last.is_some_and(|last| last.distance(pointer) < STEP) {
            return None;
        }
        self.last = Some(pointer);
        let (width, height) = (shown.width(), shown.height());
        let share = (pointer - picture.min) / picture.size();
        let (x, y) = (share.x * width as f32, share.y * height as f32);
        if !(0.0..width as f32).contains(&x) || !(0.0..height as f32).contains(&y) {
            return None;
        }
        let at = y as usize * width as usize + x as usize;
        let index = (*shown.id().get(at)? as usize).checked_sub(1)?;
        let distance = f64::from(*shown.distance().get(at)?);
        let (column, row) = (f64::from(x.floor()) + 0.5, f64::from(y.floor()) + 0.5);
        let ray = camera.view(width, height).ray(column, row)?;
        let object = scene.objects.get(index)?;
        let object_from_world = object.world_from_object.inverse();
        let place = object_from_world.transform_point3(ray.origin + ray.direction * distance);
        let inward = object_from_world.transform_vector3(ray.direction).normalize_or_zero();
        let shape = self.painted(object, place, inward, tool)?;
        let what = format!("{tool:?} {index}");
        Some(Edit::new(scene, what, |scene| scene.objects[index].shape = Arc::new(shape)))
    }

    fn painted(&self, object: &Object, place: DVec3, inward: DVec3, tool: Tool) -> Option<Shape> {
        match (&*object.shape, tool) {
            (Shape::Voxels(voxels), Tool::Paint) => {
                let value =
                    (self.material.round() as u8).clamp(1, object.materials.len().clamp(1, 255) as u8);
                Some(Shape::Voxels(self.filled(voxels, place - inward * 0.5, value)))
            }
            (Shape::Voxels(voxels), Tool::Erase) => {
                Some(Shape::Voxels(self.filled(voxels, place + inward * 0.5, 0)))
            }
            (Shape::HeightField(field), Tool::Raise) => self.raised(field, place, 1.0),
            (Shape::HeightField(field), Tool::Lower) => self.raised(field, place, -1.0),
            _ => None,
        }
    }

    /// Returns a grid with a ball of cells set to a byte.
    fn filled(&self, voxels: &Voxels, center: DVec3, value: u8) -> Voxels {
        let mut voxels = voxels.clone();
        let middle = center.floor() + 0.5;
        let low = (middle - self.radius).max(DVec3::ZERO).as_uvec3();
        let high = (middle + self.radius).max(DVec3::ZERO).as_uvec3();
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let cell = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) + 0.5;
                    if cell.distance(middle) <= self.radius {
                        voxels.set(x, y, z, value);
                    }
                }
            }
        }
        voxels
    }

    /// Returns a terrain with a round hill added.
    fn raised(&self, field: &HeightField, center: DVec3, sign: f64) -> Option<Shape> {
        let size = field.cell_size();
        let middle = field.grid_from_plane(center.x, center.z);
        let lift = sign * self.strength * self.radius * size.min_element();
        let heights = field.heights().iter().enumerate().map(|(i, &height)| {
            let (column, row) = (i as u32 % field.columns(), i as u32 / field.columns());
            let away = DVec2::new(f64::from(column), f64::from(row)).distance(middle) / self.radius;
            let share = (1.0 - away * away).max(0.0);
            height + (lift * share * share) as f32
        });
        let raised = HeightField::new(field.columns(), field.rows(), field.extent(), heights.collect());
        raised.ok().map(Shape::HeightField)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dab_fills_a_ball_of_cells_and_raises_a_hill() {
        let brush = Brush::default();
        let voxels = brush.filled(&Voxels::new([16, 16, 16]), DVec3::new(8.2, 8.9, 0.4), 3);
        assert_eq!((voxels.get(8, 8, 0), voxels.get(8, 8, 2), voxels.get(8, 8, 3)), (3, 3, 0));
        assert_eq!(
            voxels.filled(),
            21 + 21 + 9,
            "three layers of a ball, the rest of which is below the grid"
        );
        let flat = HeightField::new(11, 11, DVec2::splat(10.0), vec![0.0; 121]).unwrap();
        let Some(Shape::HeightField(hill)) = brush.raised(&flat, DVec3::ZERO, 1.0) else { panic!("no hill") };
        assert!((hill.height(5, 5) - 0.25).abs() < 1e-6);
        assert!(hill.height(6, 5) > 0.1 && hill.height(8, 5) == 0.0);
    }
}
