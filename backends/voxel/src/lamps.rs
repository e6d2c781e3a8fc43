//! Which lights shine, and how far does a shadow ray to each of them go?

use glam::{DAffine3, DVec3};
use polyptych_core::math::{Aabb, Ray};
use polyptych_core::scene::{Arriving, Light, LightKind, Scene, Shape};

/// A light, and the emissive cell that it stands for if there is one.
#[derive(Clone, Debug)]
pub(crate) struct Lamp {
    pub(crate) casts_shadow: bool,
    /// Whether anything can stand between it and a surface, so that shadow rays are cast.
    pub(crate) is_blocked: bool,
    light: Light,
    /// What arrives everywhere, for light that is parallel.
    everywhere: Option<Option<Arriving>>,
    cell: Option<(DAffine3, DVec3)>,
}

impl Lamp {
    /// Lists all lights of a scene.
    pub(crate) fn all(scene: &Scene) -> Vec<Self> {
        let lights = scene.all_lights();
        // Those of emissive voxels come after the scene's own, in the order of objects and cells.
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
        let own = scene.lights.len();
        let cell = |i: usize| i.checked_sub(own).and_then(|i| cells.get(i).copied());
        lights.into_iter().enumerate().map(|(i, light)| Self::new(light, cell(i))).collect()
    }

    fn new(light: Light, cell: Option<(DAffine3, DVec3)>) -> Self {
        let parallel = matches!(light.kind, LightKind::Directional { .. });
        let everywhere = parallel.then(|| light.arriving(DVec3::ZERO));
        Self { casts_shadow: light.casts_shadow, is_blocked: light.casts_shadow, light, everywhere, cell }
    }

    /// Lists the lights themselves.
    pub(crate) fn lights(lamps: &[Self]) -> Vec<Light> {
        lamps.iter().map(|lamp| lamp.light.clone()).collect()
    }

    /// Returns the light that would arrive at a point if nothing were in between.
    pub(crate) fn arriving(&self, point: DVec3) -> Option<Arriving> {
        match self.everywhere {
            Some(arriving) => arriving,
            None => self.light.arriving(point),
        }
    }

    /// Returns what arrives everywhere, for light that is parallel.
    pub(crate) fn everywhere(&self) -> Option<Option<Arriving>> {
        self.everywhere
    }

    /// Tells whether an emissive cell gives off the light.
    pub(crate) fn is_cell(&self) -> bool {
        self.cell.is_some()
    }

    /// Returns the direction to a light that is parallel.
    pub(crate) fn direction(&self) -> Option<DVec3> {
        self.everywhere.flatten().map(|arriving| arriving.to_light)
    }

    /// Returns how far a shadow ray goes: to the light, or to the cell that gives it off, which does not block
    /// its own light.
    pub(crate) fn shadow_end(&self, ray: &Ray, distance: f64) -> f64 {
        let Some((object_from_world, low)) = self.cell else { return distance };
        let origin = object_from_world.transform_point3(ray.origin);
        let direction = object_from_world.transform_vector3(ray.direction);
        // The cell's own face must not count, however its distance is rounded.
        Aabb::new(low, low + 1.0).clip(origin, direction).map_or(distance, |(near, _)| near * (1.0 - 1e-9))
    }
}
