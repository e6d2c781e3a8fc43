//! How much light leaves the points that the rays of a tile met, and which lights are blocked there?

use crate::bundle::{Cone, Crossing, Hits, NOWHERE, OCTETS, Rays};
use crate::world::{CastScratch, Points, World};
use glam::DVec3;
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, LANES, Mask8, Vec3x8};
use polyptych_core::scene::{Light, LightKind};
use polyptych_core::shade::lit_by_material;

/// Eight points with the light that leaves them.
#[derive(Clone, Copy)]
pub(crate) struct Lit<'a> {
    pub(crate) points: Points<'a>,
    pub(crate) color: Vec3x8,
    /// How many lights cast and arrive, and how many of them are blocked.
    pub(crate) casting: Mask8,
    pub(crate) dark: Mask8,
}

/// Scratch memory of one worker.
#[derive(Default)]
pub(crate) struct Scratch {
    rays: Vec<Rays>,
    blocked: Vec<Hits>,
}

/// Lights points of a world.
#[derive(Clone, Copy)]
pub(crate) struct Illumination<'a> {
    pub(crate) world: &'a World,
    /// Whether light is asked for at all.
    pub(crate) wanted: bool,
    /// Whether the colors of surfaces are.
    pub(crate) reads_color: bool,
}

impl Lit<'_> {
    pub(crate) const NOTHING: Self =
        Self { points: Points::NONE, color: BLACK, casting: Mask8::NONE, dark: Mask8::NONE };
}

const BLACK: Vec3x8 = Vec3x8 { x: F32x8::ZERO, y: F32x8::ZERO, z: F32x8::ZERO };

impl<'a> Illumination<'a> {
    /// Finds the points that rays met and the light on them; `traced` counts the shadow rays.
    #[inline(always)]
    pub(crate) fn light(
        &self,
        rays: &[Rays],
        hits: &[Hits],
        lit: &mut [Lit<'a>; OCTETS],
        (scratch, form): (&mut Scratch, &mut CastScratch),
        traced: &mut u64,
    ) {
        let scene = &self.world.scene;
        let ambient = scene.environment.ambient;
        for ((rays, hits), lit) in rays.iter().zip(hits).zip(&mut *lit) {
            let met = hits.any();
            if met.any() || lit.points.there.any() {
                *lit = Lit::NOTHING;
            }
            for i in (0..LANES).filter(|&i| met.has(i)) {
                let body = hits.body.0[i];
                if lit.points.material[i].is_none() {
                    let body_of = &self.world.bodies[body as usize];
                    body_of.fill(scene, rays, hits, hits.of(body), self.reads_color, &mut lit.points);
                }
                if let Some(m) = lit.points.material[i] {
                    lit.color.set(i, m.emission + ambient * lit.points.color.get(i) * m.ambient);
                }
            }
        }
        let lights = self.world.lights.iter().zip(&self.world.blocked);
        for (light, &is_blocked) in lights.filter(|_| self.wanted) {
            self.add(light, is_blocked, rays, lit, (scratch, form), traced);
        }
    }

    /// Adds one light.
    #[inline(always)]
    fn add(
        &self,
        light: &Light,
        is_blocked: bool,
        rays: &[Rays],
        lit: &mut [Lit<'_>; OCTETS],
        (scratch, form): (&mut Scratch, &mut CastScratch),
        traced: &mut u64,
    ) {
        let mut arrivals = [Arrival::steady(light); OCTETS];
        scratch.rays.clear();
        for (arrival, lit) in arrivals.iter_mut().zip(&mut *lit) {
            arrival.reach(light, &lit.points);
            let Points { position, normal, hair, .. } = lit.points;
            let toward = normal.dot(arrival.to_light).above(F64x8::ZERO);
            if light.casts_shadow {
                lit.casting = counted(lit.casting, arrival.there);
                lit.dark = counted(lit.dark, arrival.there & !toward);
            }
            let far = F64x8::pick(arrival.there & toward, arrival.distance, F64x8::splat(-1.0));
            scratch.rays.push(Rays { origin: position, direction: arrival.to_light, near: hair, far });
        }
        scratch.blocked.clear();
        scratch.blocked.extend(scratch.rays.iter().map(Hits::nothing));
        if is_blocked {
            *traced += scratch.rays.iter().map(|r| u64::from(r.open().count())).sum::<u64>();
            self.block(scratch, form);
        }
        let model = self.world.scene.environment.lighting;
        for (octet, lit) in lit.iter_mut().enumerate() {
            let arrival = &arrivals[octet];
            if !arrival.there.any() {
                continue;
            }
            let blocked = scratch.blocked[octet].any();
            lit.dark = counted(lit.dark, blocked);
            let points = &lit.points;
            let shines = arrival.there & !blocked;
            let mut materials = points.material;
            (0..LANES).filter(|&i| !shines.has(i)).for_each(|i| materials[i] = None);
            let to_eye = (NOWHERE - rays[octet].direction).round();
            let (to_light, radiance) = (arrival.to_light.round(), arrival.radiance);
            let surface = (points.color, points.normal.round(), to_eye);
            let added = lit_by_material(materials, surface, model, to_light, radiance);
            // A light behind the true surface is dark whatever the formula says.
            let toward = points.normal.dot(arrival.to_light).above(F64x8::ZERO);
            lit.color = lit.color + Vec3x8::pick(toward, added, BLACK);
        }
    }

    /// Finds which shadow rays meet something opaque.
    #[inline(always)]
    fn block(&self, scratch: &mut Scratch, form: &mut CastScratch) {
        let Some(cone) = Cone::around(&scratch.rays).map_or(
            // Rays that go all ways, or none at all.
            scratch.rays.iter().any(|r| r.open().any()).then_some(None),
            |cone| Some(Some(cone)),
        ) else {
            return;
        };
        for (i, body) in self.world.bodies.iter().enumerate() {
            if !body.see_through && cone.is_none_or(|c| c.touches(body.center, body.radius)) {
                body.cast(i as u32, Crossing::Entry, &scratch.rays, &mut scratch.blocked, form);
                // One thing in the way is enough: blocked rays are not followed further.
                for (rays, hits) in scratch.rays.iter_mut().zip(&scratch.blocked) {
                    rays.far = F64x8::pick(hits.any(), F64x8::splat(-1.0), rays.far);
                }
            }
        }
    }
}

/// Adds one to the numbers of which the mask is set.
#[inline(always)]
fn counted(mut numbers: Mask8, mask: Mask8) -> Mask8 {
    for i in 0..LANES {
        numbers.0[i] += mask.0[i] & 1;
    }
    numbers
}

/// The light of a lamp at eight points.
#[derive(Clone, Copy)]
struct Arrival {
    /// Where there are a point and light.
    there: Mask8,
    to_light: DVec3x8,
    distance: F64x8,
    radiance: Vec3x8,
}

impl Arrival {
    /// The light of a lamp that shines everywhere alike; nothing yet of the others.
    fn steady(light: &Light) -> Self {
        let there = matches!(light.kind, LightKind::Directional { .. });
        match light.arriving(DVec3::ZERO).filter(|_| there) {
            Some(arriving) => Self {
                there: Mask8::ALL,
                to_light: DVec3x8::splat(arriving.to_light),
                distance: F64x8::splat(arriving.distance),
                radiance: Vec3x8::splat(arriving.radiance),
            },
            None => Self { there: Mask8::NONE, to_light: NOWHERE, distance: F64x8::ZERO, radiance: BLACK },
        }
    }

    #[inline(always)]
    fn reach(&mut self, light: &Light, points: &Points<'_>) {
        self.there = self.there & points.there;
        if let LightKind::Directional { .. } = light.kind {
            return;
        }
        for i in (0..LANES).filter(|&i| points.there.has(i)) {
            if let Some(arriving) = light.arriving(points.position.get(i)) {
                self.there.0[i] = u32::MAX;
                self.to_light.set(i, arriving.to_light);
                self.distance.0[i] = arriving.distance;
                self.radiance.set(i, arriving.radiance);
            }
        }
    }
}
