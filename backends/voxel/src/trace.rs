//! What color does a ray see, and what is the first surface on its way?

use crate::world::{Counts, Met, Place, Point, Reach, Start, World};
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
    pub(crate) fn look(&self, ray: &Ray, wants: Wants) -> Pixel {
        self.counts.rays.set(self.counts.rays.get() + 1);
        let met = self.world.meet(ray, Start::Eye, Place::START, &self.counts);
        self.color(ray, met, &[], wants)
    }

    /// Does the same where the first surface is known; `lights` tell for some lamps what shadow rays may meet.
    pub(crate) fn color(&self, ray: &Ray, met: Option<Met>, lights: &[Option<Reach>], wants: Wants) -> Pixel {
        if let Some(met) = met {
            let point = self.world.point(ray, &met);
            // Most rays are done with one opaque surface that is no mirror.
            if point.opacity >= 1.0 && (self.bounces == 0 || point.material.reflectivity <= 0.0) {
                let lit = self.light(&point, -ray.direction, lights, wants);
                let color = if wants.color { lit.color } else { Vec3::ZERO };
                let color = fogged(&self.world.scene.environment, color, met.place.t);
                return Pixel { color: finite(Vec3::ZERO + color), ..seen(&point, met.place.t, lit.shadow) };
            }
        }
        self.follow(ray, Start::Eye, met, lights, wants, self.bounces, 1.0)
    }

    /// Follows a ray from its first surface through all layers; `weight` is the share of the picture that depends
    /// on it.
    fn follow(
        &self,
        ray: &Ray,
        start: Start<'_>,
        met: Option<Met>,
        lights: &[Option<Reach>],
        wants: Wants,
        bounces: u32,
        weight: f64,
    ) -> Pixel {
        let environment = &self.world.scene.environment;
        let (mut color, mut clear) = (DVec3::ZERO, 1.0);
        let mut first: Option<Pixel> = None;
        let mut next = met;
        loop {
            let Some(met) = next else {
                color += environment.background.color(ray.direction).as_dvec3() * clear;
                break;
            };
            let point = self.world.point(ray, &met);
            let asked = Wants { shadow: wants.shadow && first.is_none(), ..wants };
            let lights = if first.is_none() { lights } else { &[] };
            let lit = self.light(&point, -ray.direction, lights, asked);
            if first.is_none() {
                first = Some(seen(&point, met.place.t, lit.shadow));
            }
            if !wants.color {
                break;
            }
            let share = clear * f64::from(point.opacity);
            let shaded = self.mirrored(ray, &point, lit.color, bounces, weight * share);
            color += fogged(environment, shaded, met.place.t).as_dvec3() * share;
            clear -= share;
            if clear < OPAQUE {
                break;
            }
            next = self.world.meet(ray, start, met.place, &self.counts);
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
        let start = Start::Surface(&point.site);
        self.counts.rays.set(self.counts.rays.get() + 1);
        let met = self.world.meet(&mirror, start, Place::START, &self.counts);
        let seen = self.follow(&mirror, start, met, &[], wants, bounces - 1, weight);
        color.lerp(seen.color, share)
    }

    /// Lights a point of a surface.
    #[inline(always)]
    fn light(&self, point: &Point<'_>, to_eye: DVec3, lights: &[Option<Reach>], wants: Wants) -> Lit {
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
        for (index, lamp) in self.world.lamps.iter().enumerate() {
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
            if lamp.is_blocked && self.shadows == Shadows::Hard {
                self.counts.shadow_rays.set(self.counts.shadow_rays.get() + 1);
                let ray = Ray { origin: point.lifted, direction: arriving.to_light };
                let end = lamp.shadow_end(&ray, arriving.distance);
                let reach = lights.get(index).and_then(Option::as_ref);
                if self.world.is_blocked(&ray, &point.site, end, reach, &self.counts) {
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

#[inline(always)]
pub(crate) fn finite(v: Vec3) -> Vec3 {
    if v.is_finite() { v } else { Vec3::ZERO }
}
