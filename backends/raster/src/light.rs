//! How much light leaves a point towards the eye, and how many lights reach it?

use crate::model::Model;
use crate::resolve::Point;
use crate::shadow::{Shadows, Sight};
use glam::{DAffine3, DVec3, Vec3};
use polyptych_core::math::Aabb;
use polyptych_core::scene::{Arriving, Light, LightKind, Scene, Shape};
use polyptych_core::shade::{Surface, turned_away};

/// A light, made ready.
pub(crate) struct Lamp {
    pub(crate) light: Light,
    /// Its light where that is the same everywhere.
    steady: Option<Arriving>,
    /// The voxel that gives it off.
    pub(crate) cell: Option<Cell>,
}

/// The place of an emissive voxel: its own faces do not block its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
    pub(crate) object: usize,
    pub(crate) bounds: Aabb,
    pub(crate) object_from_world: DAffine3,
}

/// What is asked of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wants {
    pub(crate) color: bool,
    pub(crate) shadow: bool,
}

/// What a point answers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lit {
    pub(crate) color: Vec3,
    /// Share of the shadow-casting lights that reach it.
    pub(crate) shadow: f32,
}

impl Lamp {
    /// Lists all lights of a scene; those of voxels stand behind its own, by object and cell.
    pub(crate) fn all(scene: &Scene) -> Vec<Self> {
        let lights = scene.all_lights();
        let own = scene.lights.len();
        let mut cells = if lights.len() > own { cells(scene) } else { Vec::new() }.into_iter();
        let lamp = |(i, light): (usize, Light)| Self {
            steady: match light.kind {
                LightKind::Directional { .. } => light.arriving(DVec3::ZERO),
                LightKind::Point { .. } | LightKind::Spot { .. } => None,
            },
            cell: if i < own { None } else { cells.next() },
            light,
        };
        lights.into_iter().enumerate().map(lamp).collect()
    }

    /// Returns the light that would arrive at a point of the world if nothing were in between.
    #[inline]
    fn arriving(&self, point: DVec3) -> Option<Arriving> {
        match self.light.kind {
            LightKind::Directional { .. } => self.steady,
            LightKind::Point { .. } | LightKind::Spot { .. } => self.light.arriving(point),
        }
    }
}

fn cells(scene: &Scene) -> Vec<Cell> {
    let mut cells = Vec::new();
    for (object, thing) in scene.objects.iter().enumerate().filter(|(_, o)| o.is_drawable()) {
        let Shape::Voxels(voxels) = &*thing.shape else { continue };
        let shines = |v: u8| scene.material(thing, usize::from(v) - 1).emission.max_element() > 0.0;
        let object_from_world = thing.world_from_object.inverse();
        for (cell, _) in voxels.exposed_where(shines) {
            let min = DVec3::from_array(cell.map(f64::from));
            cells.push(Cell { object, bounds: Aabb::new(min, min + 1.0), object_from_world });
        }
    }
    cells
}

/// Lights points of a scene.
#[derive(Clone, Copy)]
pub(crate) struct Illumination<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) model: &'a Model,
    pub(crate) lamps: &'a [Lamp],
    pub(crate) shadows: Option<&'a Shadows>,
}

impl Illumination<'_> {
    /// Lights a point; `origin` is that of the lens, `to_eye` has unit length.
    #[inline]
    pub(crate) fn light(&self, point: &Point<'_>, origin: DVec3, to_eye: DVec3, wants: Wants) -> Lit {
        let environment = &self.scene.environment;
        let surface = Surface {
            material: point.material,
            color: point.color,
            normal: point.normal,
            to_eye: to_eye.as_vec3(),
        };
        let mut color = if wants.color { surface.ambient(environment) } else { Vec3::ZERO };
        let (mut casting, mut reaching) = (0u32, 0u32);
        let position = origin + point.place;
        for (index, lamp) in self.lamps.iter().enumerate() {
            let Some(arriving) = lamp.arriving(position) else { continue };
            let casts = lamp.light.casts_shadow;
            casting += u32::from(casts);
            if turned_away(point.true_normal, arriving.to_light) {
                continue;
            }
            let share = if wants.color {
                surface.lit_by(environment.lighting, arriving.to_light.as_vec3(), arriving.radiance)
            } else {
                Vec3::ZERO
            };
            let needed = (wants.shadow && casts) || share != Vec3::ZERO;
            if !needed || (casts && self.is_blocked(index, point, origin, &arriving)) {
                continue;
            }
            color += share;
            reaching += u32::from(casts);
        }
        let shadow =
            if casting == 0 || !point.part.takes_shadow { 1.0 } else { reaching as f32 / casting as f32 };
        Lit { color, shadow }
    }

    fn is_blocked(&self, lamp: usize, point: &Point<'_>, origin: DVec3, arriving: &Arriving) -> bool {
        let Some(shadows) = self.shadows.filter(|_| point.part.takes_shadow) else { return false };
        let sight = Sight {
            place: point.place + (origin - shadows.origin),
            triangle: point.triangle,
            to_light: arriving.to_light,
            distance: arriving.distance,
        };
        shadows.is_blocked(self.scene, self.model, lamp, &sight)
    }
}
