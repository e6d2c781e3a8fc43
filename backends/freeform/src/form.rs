//! How do rays meet a free form?
//!
//! A tile's rays are bounded by a box for each of a few slices in depth. Slices where the bounds of the form do
//! not hold zero are skipped; for the rest the program is pruned to what matters there, and the rays are searched
//! in packets.

use crate::bundle::{Bundle, Crossing, Hit};
use crate::lanes::{LANES, Lanes, Mask};
use crate::program::{Active, Program, Step, value_and_gradient};
use crate::roots::{RayQuadric, Stack, first_roots};
use glam::{DAffine3, DVec3};
use polyptych_core::math::Aabb;
use polyptych_core::scene::{FreeForm, Quadric};

/// Slices in depth. Four cost less than they save on any figure with a dozen functions; more do not pay.
const SLICES: u32 = 4;

/// A free form, ready to be cast.
#[derive(Debug)]
pub(crate) struct FormBody {
    program: Program,
    /// The form's bounds with a margin, so that rays enter it from outside of the solid.
    bounds: Aabb,
}

/// Scratch memory of one worker.
#[derive(Default)]
pub(crate) struct FormScratch {
    active: Active,
    leaves: Vec<RayQuadric>,
    stack: Stack,
    values: Vec<(f64, DVec3)>,
    alive: Vec<Alive>,
}

/// A ray in object space that meets the bounds; `t` stays the distance in the world.
#[derive(Clone, Copy)]
struct Alive {
    ray: usize,
    origin: DVec3,
    direction: DVec3,
    near: f64,
    far: f64,
}

impl FormBody {
    pub(crate) fn new(form: &FreeForm) -> Self {
        let bounds = form.bounds();
        Self { program: Program::new(form.form()), bounds: bounds.grown(bounds.radius() * 1e-4) }
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.program.steps.len() * 24 + self.program.leaves.len() * 80) as u64
    }

    /// Improves `hits` where a ray of the bundle meets the form sooner.
    pub(crate) fn cast(
        &self,
        object_from_world: &DAffine3,
        body: u32,
        crossing: Crossing,
        bundle: &Bundle,
        hits: &mut [Hit],
        scratch: &mut FormScratch,
    ) {
        self.enter(object_from_world, bundle, hits, &mut scratch.alive);
        let Some((near, far)) = self.slice(scratch) else { return };
        let zero = RayQuadric { a: Lanes::ZERO, b: Lanes::ZERO, c: Lanes::ZERO, error: Lanes::ZERO };
        if scratch.leaves.len() < self.program.leaves.len() {
            scratch.leaves.resize(self.program.leaves.len(), zero);
        }
        let FormScratch { active, leaves, stack, alive, values } = scratch;
        let center = self.bounds.center();
        for packet in alive.chunks(LANES) {
            let lane = |i: usize| packet[i.min(packet.len() - 1)];
            let rays = std::array::from_fn(|i| (lane(i).origin, lane(i).direction));
            // Around the point nearest to the form's middle the polynomials have small coefficients.
            let stretch: [(f64, f64); LANES] =
                std::array::from_fn(|i| (lane(i).near.max(near), lane(i).far.min(far)));
            let around: [f64; LANES] = std::array::from_fn(|i| {
                let (o, d) = rays[i];
                let t = (center - o).dot(d) / d.length_squared();
                t.max(stretch[i].0).min(stretch[i].1)
            });
            let from: [f64; LANES] = std::array::from_fn(|i| stretch[i].0 - around[i]);
            let to: [f64; LANES] = std::array::from_fn(|i| stretch[i].1 - around[i]);
            let reach = std::array::from_fn(|i| from[i].abs().max(to[i].abs()));
            for &step in &active.steps {
                if let Step::Leaf(leaf) = step {
                    let quadric = &self.program.leaves[leaf as usize];
                    leaves[leaf as usize] = ray_quadric(quadric, &rays, &around, &reach);
                }
            }
            let open =
                Mask(std::array::from_fn(
                    |i| {
                        if i < packet.len() && from[i] <= to[i] { u32::MAX } else { 0 }
                    },
                ));
            let (from, to) = (Lanes(from.map(|v| v as f32)), Lanes(to.map(|v| v as f32)));
            let (found, root) = first_roots(&active.steps, leaves, from, to, open, crossing, stack);
            for (i, alive) in packet.iter().enumerate() {
                if !found.has(i) {
                    continue;
                }
                let t = around[i] + f64::from(root.0[i]);
                let (t, normal) = match crossing {
                    Crossing::Any => self.polish(alive, t, &active.steps, values),
                    // What blocks light is not looked at.
                    Crossing::Entry => (t, DVec3::ZERO),
                };
                if t < hits[alive.ray].t {
                    hits[alive.ray] = Hit { t, body, normal };
                }
            }
        }
    }

    /// Lists the rays that meet the bounds before what they met already.
    fn enter(&self, object_from_world: &DAffine3, bundle: &Bundle, hits: &[Hit], alive: &mut Vec<Alive>) {
        alive.clear();
        for (ray, stretch) in bundle.rays.iter().enumerate() {
            let origin = object_from_world.transform_point3(stretch.origin);
            let direction = object_from_world.transform_vector3(stretch.direction);
            if let Some((near, far)) = self.bounds.clip(origin, direction) {
                let (near, far) = (near.max(stretch.near), far.min(stretch.far).min(hits[ray].t));
                if near < far {
                    alive.push(Alive { ray, origin, direction, near, far });
                }
            }
        }
    }

    /// Finds the range of distances in which any ray may meet the form, and prunes the program to it.
    fn slice(&self, scratch: &mut FormScratch) -> Option<(f64, f64)> {
        let alive = &scratch.alive;
        let origins = Aabb::of_points(alive.iter().map(|a| a.origin));
        let directions = Aabb::of_points(alive.iter().map(|a| a.direction));
        let near = alive.iter().map(|a| a.near).fold(f64::INFINITY, f64::min);
        let far = alive.iter().map(|a| a.far).fold(0.0, f64::max);
        if origins.is_empty() || near >= far {
            return None;
        }
        let reached = |a: f64, b: f64| {
            let ends = [directions.min * a, directions.min * b, directions.max * a, directions.max * b];
            let low = ends.iter().fold(DVec3::INFINITY, |m, e| m.min(*e));
            let high = ends.iter().fold(DVec3::NEG_INFINITY, |m, e| m.max(*e));
            Aabb::new(origins.min + low, origins.max + high).intersection(self.bounds)
        };
        let mut range: Option<(f64, f64)> = None;
        let step = (far - near) / f64::from(SLICES);
        for i in 0..SLICES {
            let (a, b) = (near + step * f64::from(i), near + step * f64::from(i + 1));
            let part = reached(a, b);
            if part.is_empty() {
                continue;
            }
            let bounds = scratch.active.prune(&self.program, &self.program.steps, &part);
            if bounds.contains(0.0) {
                range = Some((range.map_or(a, |r| r.0), b));
            }
        }
        let (a, b) = range?;
        scratch.active.prune(&self.program, &self.program.steps, &reached(a, b));
        Some((a, b))
    }

    /// Improves a distance along a ray by a step of Newton's method in double precision and returns it with the
    /// outward normal, in object space.
    fn polish(&self, ray: &Alive, t: f64, steps: &[Step], values: &mut Vec<(f64, DVec3)>) -> (f64, DVec3) {
        let p = ray.origin + ray.direction * t;
        let (value, gradient) = value_and_gradient(&self.program, steps, p, values);
        let step = value / gradient.dot(ray.direction);
        // Near a tangent or a crease a step may lead away: single precision was right to 1e-5 of the size.
        let small = step.is_finite() && step.abs() * ray.direction.length() < self.bounds.radius() * 1e-4;
        (if small { t - step } else { t }, -gradient)
    }
}

/// Returns a quadric along eight rays, as a polynomial in the distance from `around`, and a bound on the rounding
/// error of evaluating it up to `reach` away.
pub(crate) fn ray_quadric(
    q: &Quadric,
    rays: &[(DVec3, DVec3); LANES],
    around: &[f64; LANES],
    reach: &[f64; LANES],
) -> RayQuadric {
    let [qa, qb, qc, qd, qe, qf, ..] = q.0;
    let mut out = RayQuadric { a: Lanes::ZERO, b: Lanes::ZERO, c: Lanes::ZERO, error: Lanes::ZERO };
    for i in 0..LANES {
        let (o, d) = rays[i];
        let p = o + d * around[i];
        let a = d.x * (qa * d.x + qd * d.y + qe * d.z) + d.y * (qb * d.y + qf * d.z) + qc * d.z * d.z;
        let b = q.gradient(p).dot(d);
        let c = q.value(p);
        // Three roundings of single precision on each term, doubled.
        let error =
            (a.abs() * reach[i] * reach[i] + b.abs() * reach[i] + c.abs()) * 6.0 * f64::from(f32::EPSILON);
        out.a.0[i] = a as f32;
        out.b.0[i] = b as f32;
        out.c.0[i] = c as f32;
        out.error.0[i] = error as f32;
    }
    out
}
