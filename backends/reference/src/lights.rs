//! Which lights shine, and how far does a shadow ray to each of them go?

use glam::{DAffine3, DVec3};
use polyptych_core::math::{Aabb, Ray};
use polyptych_core::scene::{Light, Scene, Shape};

/// A light, and the voxel cell that gives it off if there is one.
#[derive(Clone, Debug)]
pub(crate) struct Lamp {
    pub(crate) light: Light,
    cell: Option<(DAffine3, DVec3)>,
}

impl Lamp {
    /// Lists all lights of a scene.
    pub(crate) fn all(scene: &Scene) -> Vec<Self> {
        let lights = scene.all_lights();
        // The lights of voxels stand behind those of the scene, in the order of objects and cells.
        let mut cells = Vec::new();
        if lights.len() > scene.lights.len() {
            for object in scene.objects.iter().filter(|o| o.is_drawable()) {
                let Shape::Voxels(voxels) = &*object.shape else { continue };
                let shines = |v: u8| scene.material(object, usize::from(v) - 1).emission.max_element() > 0.0;
                let object_from_world = object.world_from_object.inverse();
                for (cell, _) in voxels.exposed_where(shines) {
                    cells.push((object_from_world, DVec3::from_array(cell.map(f64::from))));
                }
            }
        }
        let mut cells = cells.into_iter();
        let own = scene.lights.len();
        let with_cell = |(i, light)| Self { light, cell: if i < own { None } else { cells.next() } };
        lights.into_iter().enumerate().map(with_cell).collect()
    }

    /// Returns how far a shadow ray to the light goes: to the light, or to the cell that gives it off.
    pub(crate) fn shadow_end(&self, ray: &Ray, distance: f64) -> f64 {
        let Some((object_from_world, min)) = self.cell else { return distance };
        let (origin, direction) = (
            object_from_world.transform_point3(ray.origin),
            object_from_world.transform_vector3(ray.direction),
        );
        // The face of entry is the cell's own: stop before it.
        let cell = Aabb::new(min, min + 1.0);
        cell.clip(origin, direction).map_or(distance, |(near, _)| near * (1.0 - 1e-9))
    }
}
