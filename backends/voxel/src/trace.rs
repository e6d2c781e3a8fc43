//! What color does a ray see, and what is the first surface on its way?

use crate::tree::WorldRay;
use crate::world::{Counts, Place, Point, Start, World};
use glam::{DVec3, Vec3};
use polyptych_core::framebuffer::Pixel;
use polyptych_core::math::Ray;
use polyptych_core::shade::{Surface, fogged, turned_away};

/// Behind layers that let less than this share of light through nothing is drawn.
const OPAQUE: f64 = 1.0 / 1024.0;

/// What is asked of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wants {
    pub(crate) color: bool,
    pub(crate) shadow: bool,
}

/// Whether things block light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shadows {
    /// Nothing does.
    Off,
    /// Opaque things do.
    Hard,
}

/// Follows rays through a world. One for each band; counts what it does.
pub(crate) struct Tracer<'a> {
    pub(crate) world: &'a World,
    pub(crate) bounces: u32,
    pub(crate) shadows: Shadows,
    pub(crate) counts: Counts,
}

/// Color of a point without reflections, and the share of lights that reach it.
struct Lit {
    color: Vec3,
    shadow: f32,
}

impl Tracer<'_> {
    /// Follows a ray from the eye: returns its color, and what geometry channels hold of the first surface.
    pub(crate) fn look(&self, ray: Ray, wants: Wants) -> Pixel {
        self.follow(ray, Start::Eye, wants, self.bounces, 1.0)
    }

    /// Follows a ray through all layers; `weight` is the share of the picture that depends on it.
    fn follow(&self, ray: Ray, start: Start<'_>, wants: Wants, bounces: u32, weight: f64) -> Pixel {
        self.counts.rays.set(self.counts.rays.get() + 1);
        let environment = &self.world.scene.environment;
        let ray = WorldRay::new(ray);
        let (mut color, mut clear) = (DVec3::ZERO, 1.0);
        let mut first: Option<Pixel> = None;
        let mut after = Place::START;
        loop {
            let Some(met) = self.world.meet(&ray, start, after, &self.counts) else {
                color += environment.background.color(ray.ray.direction).as_dvec3() * clear;
                break;
            };
            let point = self.world.point(&ray.ray, &met);
            let asked = Wants { shadow: wants.shadow && first.is_none(), ..wants };
            let lit = self.light(&point, -ray.ray.direction, asked);
            if first.is_none() {
                first = Some(seen(&point, met.place.t, lit.shadow));
            }
            if !wants.color {
                break;
            }
            let share = clear * f64::from(point.opacity);
            let shaded = self.mirrored(&ray.ray, &point, lit.color, bounces, weight * share);
            color += fogged(environment, shaded, met.place.t).as_dvec3() * share;
            clear -= share;
            if clear < OPAQUE {
                break;
            }
            after = met.place;
        }
        let color = finite(color.as_vec3());
        Pixel { color, ..first.unwrap_or(Pixel::background(color)) }
    }

    /// Mixes in what the mirror direction sees, where that can be told.
    fn mirrored(&self, ray: &Ray, point: &Point<'_>, color: Vec3, bounces: u32, weight: f64) -> Vec3 {
        let share = point.material.reflectivity.clamp(0.0, 1.0);
        let weight = weight * f64::from(share);
        if bounces == 0 || weight < OPAQUE || weight.is_nan() {
            return color;
        }
        let incoming = ray.direction.dot(point.normal);
        let direction = (ray.direction - point.normal * (2.0 * incoming)).normalize_or(point.normal);
        let mirror = Ray { origin: point.lifted, direction };
        let wants = Wants { color: true, shadow: false };
        let seen = self.follow(mirror, Start::Surface(&point.site), wants, bounces - 1, weight);
        color.lerp(seen.color, share)
    }

    /// Lights a point of a surface.
    fn light(&self, point: &Point<'_>, to_eye: DVec3, wants: Wants) -> Lit {
        if !wants.color && !wants.shadow {
            return Lit { color: Vec3::ZERO, shadow: 1.0 };
        }
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
            let Some(arriving) = lamp.arriving(point.position) else { continue };
            casting += u32::from(lamp.casts_shadow);
            if turned_away(point.normal, arriving.to_light) {
                continue;
            }
            let share = if wants.color {
                surface.lit_by(environment.lighting, arriving.to_light.as_vec3(), arriving.radiance)
            } else {
                Vec3::ZERO
            };
            let is_needed = (wants.shadow && lamp.casts_shadow) || share != Vec3::ZERO;
            if !is_needed {
                continue;
            }
            if lamp.casts_shadow && self.shadows == Shadows::Hard {
                self.counts.shadow_rays.set(self.counts.shadow_rays.get() + 1);
                let ray = WorldRay::new(Ray { origin: point.lifted, direction: arriving.to_light });
                let end = lamp.shadow_end(&ray.ray, arriving.distance);
                if self.world.is_blocked(&ray, &point.site, end, &self.counts) {
                    continue;
                }
            }
            color += share;
            reaching += u32::from(lamp.casts_shadow);
        }
        let shadow = if casting == 0 { 1.0 } else { reaching as f32 / casting as f32 };
        Lit { color, shadow }
    }
}

fn seen(point: &Point<'_>, distance: f64, shadow: f32) -> Pixel {
    Pixel {
        color: Vec3::ZERO,
        distance: distance as f32,
        normal: finite(point.normal.as_vec3()),
        id: point.object as u32 + 1,
        albedo: finite(point.color),
        shadow,
        coverage: 1.0,
    }
}

fn finite(v: Vec3) -> Vec3 {
    if v.is_finite() { v } else { Vec3::ZERO }
}
