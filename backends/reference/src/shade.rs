//! How much light leaves a point towards the eye, and how many lights reach it?

use crate::line::Start;
use crate::trace::Tracer;
use crate::world::{Place, Point, Search};
use glam::{DVec3, Vec3};
use polyptych_core::math::Ray;
use polyptych_core::shade::{Surface, turned_away};

/// What is asked of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wants {
    pub(crate) color: bool,
    pub(crate) normal: bool,
    pub(crate) albedo: bool,
    pub(crate) shadow: bool,
}

/// What a point answers: its color without reflections, and the share of lights that reach it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lit {
    pub(crate) color: Vec3,
    pub(crate) shadow: f32,
}

impl Tracer<'_> {
    /// Lights a point of a surface.
    pub(crate) fn light(&self, point: &Point<'_>, to_eye: DVec3, wants: Wants) -> Lit {
        let environment = &self.world.scene.environment;
        let surface = Surface {
            material: point.material,
            color: point.color,
            normal: point.normal.as_vec3(),
            to_eye: to_eye.as_vec3(),
        };
        let mut color = if wants.color { surface.ambient(environment) } else { Vec3::ZERO };
        let (mut casting, mut reaching) = (0u32, 0u32);
        for lamp in &self.world.lamps {
            let Some(arriving) = lamp.light.arriving(point.position) else { continue };
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
            if !needed || (casts && self.is_blocked(point, lamp, arriving.to_light, arriving.distance)) {
                continue;
            }
            color += share;
            reaching += u32::from(casts);
        }
        let shadow = if casting == 0 { 1.0 } else { reaching as f32 / casting as f32 };
        Lit { color, shadow }
    }

    fn is_blocked(
        &self,
        point: &Point<'_>,
        lamp: &crate::lights::Lamp,
        to_light: DVec3,
        distance: f64,
    ) -> bool {
        self.shadow_rays.set(self.shadow_rays.get() + 1);
        let ray = Ray { origin: point.position + point.true_normal * point.lift, direction: to_light };
        let end = lamp.shadow_end(&ray, distance);
        self.world.meet(&ray, Start::Surface, Place::START, end, Search::Blocking).is_some()
    }
}
