//! What does one ray see: its color, and the first surface or volume on its way?

use crate::line::Start;
use crate::march::{Haze, March, Stretches};
use crate::shade::{Lit, Wants};
use crate::world::{Met, Place, Point, Search, World};
use glam::{DVec3, Vec3};
use polyptych_core::framebuffer::Pixel;
use polyptych_core::math::Ray;
use polyptych_core::shade::fogged;
use std::cell::Cell;

/// Behind layers that let less than this share of light through nothing is drawn.
pub(crate) const OPAQUE: f64 = 1.0 / 1024.0;

/// Follows rays through a world. One for each band; counts what it does.
pub(crate) struct Tracer<'a> {
    pub(crate) world: &'a World,
    pub(crate) bounces: u32,
    pub(crate) volume_step: f64,
    pub(crate) rays: Cell<u64>,
    pub(crate) shadow_rays: Cell<u64>,
}

/// Light gathered so far along a ray, and the share of what lies behind that still comes through.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layers {
    pub(crate) color: DVec3,
    pub(crate) clear: f64,
}

impl Tracer<'_> {
    /// Follows a ray from the eye: returns its color, and what geometry channels hold of the first thing seen.
    pub(crate) fn look(&self, ray: &Ray, wants: Wants) -> Pixel {
        self.follow(ray, Start::Eye, wants, self.bounces, 1.0)
    }

    /// Follows a ray through all layers; `weight` is the share of the picture that depends on it.
    fn follow(&self, ray: &Ray, start: Start, wants: Wants, bounces: u32, weight: f64) -> Pixel {
        self.rays.set(self.rays.get() + 1);
        let world = self.world;
        let march = March { world, ray, step: self.volume_step, shaded: wants.color };
        let stretches = (!world.clouds.is_empty()).then(|| Stretches::of(world, ray));
        let mut layers = Layers { color: DVec3::ZERO, clear: 1.0 };
        let mut first: Option<Pixel> = None;
        let (mut after, mut from) = (Place::START, 0.0);
        loop {
            let met = world.meet(ray, start, after, f64::INFINITY, Search::Visible);
            let to = met.map_or(f64::INFINITY, |m| m.hit.t);
            if let Some(stretches) = &stretches
                && let Some(haze) = march.run(stretches, from, to, &mut layers)
            {
                first = first.or(Some(seen_haze(&haze)));
            }
            if layers.clear < OPAQUE || (first.is_some() && !wants.color) {
                break;
            }
            let Some(met) = met else {
                let background = world.scene.environment.background.color(ray.direction);
                layers.color += background.as_dvec3() * layers.clear;
                break;
            };
            let point = world.point(ray, start, &met, wants);
            let asked = Wants { shadow: wants.shadow && first.is_none(), ..wants };
            let lit = if asked.color || asked.shadow {
                self.light(&point, -ray.direction, asked)
            } else {
                Lit { color: Vec3::ZERO, shadow: 1.0 }
            };
            first = first.or(Some(seen_surface(&met, &point, lit.shadow)));
            if !wants.color {
                break;
            }
            let share = layers.clear * f64::from(point.opacity);
            let color = self.mirrored(ray, &point, lit.color, bounces, weight * share);
            layers.color += fogged(&world.scene.environment, color, to).as_dvec3() * share;
            layers.clear -= share;
            if layers.clear < OPAQUE {
                break;
            }
            (after, from) = (met.place(), to);
        }
        let color = layers.color.as_vec3();
        let color = if color.is_finite() { color } else { Vec3::ZERO };
        let pixel = first.unwrap_or(Pixel::background(color));
        Pixel { color, ..pixel }
    }

    /// Mixes in what the mirror direction sees, where that can be told.
    fn mirrored(&self, ray: &Ray, point: &Point<'_>, color: Vec3, bounces: u32, weight: f64) -> Vec3 {
        let share = point.material.reflectivity.clamp(0.0, 1.0);
        let weight = weight * f64::from(share);
        if bounces == 0 || !(weight >= OPAQUE) {
            return color;
        }
        let incoming = ray.direction.dot(point.normal);
        let direction = (ray.direction - point.normal * (2.0 * incoming)).normalize_or(point.true_normal);
        let mirror = Ray { origin: point.position + point.true_normal * point.lift, direction };
        let wants = Wants { color: true, normal: false, albedo: false, shadow: false };
        let seen = self.follow(&mirror, Start::Surface, wants, bounces - 1, weight);
        color.lerp(seen.color, share)
    }
}

fn seen_surface(met: &Met<'_>, point: &Point<'_>, shadow: f32) -> Pixel {
    Pixel {
        color: Vec3::ZERO,
        distance: met.hit.t as f32,
        normal: finite(point.normal.as_vec3()),
        id: met.item.object as u32 + 1,
        albedo: finite(point.color),
        shadow,
        coverage: 1.0,
    }
}

fn seen_haze(haze: &Haze) -> Pixel {
    Pixel {
        color: Vec3::ZERO,
        distance: haze.distance as f32,
        normal: finite(haze.normal.as_vec3()),
        id: haze.object as u32 + 1,
        albedo: finite(haze.color),
        shadow: 1.0,
        coverage: 1.0,
    }
}

fn finite(v: Vec3) -> Vec3 {
    if v.is_finite() { v } else { Vec3::ZERO }
}
