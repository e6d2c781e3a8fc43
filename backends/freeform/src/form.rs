//! How do rays meet a free form?
//!
//! A tile's rays are bounded by a box for each of a few slices in depth. Slices where the bounds of the form do
//! not hold zero are skipped; for the rest the program is pruned to what matters there, and the rays are searched
//! in packets.

use crate::bundle::{Bundle, Crossing, Hit};
use crate::program::{Active, Program, Step, value_and_gradient};
use crate::roots::{RayQuadric, Stack, first_roots};
use glam::{DAffine3, DVec3};
use polyptych_core::lanes::{F32x8, LANES, Mask8};
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
        let zero = RayQuadric { a: F32x8::ZERO, b: F32x8::ZERO, c: F32x8::ZERO, error: F32x8::ZERO };
        if scratch.leaves.len() < self.program.leaves.len() {
            scratch.leaves.resize(self.program.leaves.len(), zero);
        }
        let FormScratch { active, leaves, stack, alive, values } = scratch;
        let center = self.bounds.center();
        for packet in alive.chunks(LANES) {
            let rays = RayPacket::new(packet, center, near, far);
            for &step in &active.steps {
                if let Step::Leaf(leaf) = step {
                    leaves[leaf as usize] = rays.quadric(&self.program.leaves[leaf as usize]);
                }
            }
            let (from, to) = rays.stretch();
            let (found, root) = first_roots(&active.steps, leaves, from, to, rays.open, crossing, stack);
            for (i, alive) in packet.iter().enumerate() {
                if !found.has(i) {
                    continue;
                }
                let t = rays.around[i] + f64::from(root.0[i]);
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

/// Eight rays in double precision, one array for each number.
pub(crate) struct RayPacket {
    /// Points around which polynomials are taken.
    points: [[f64; LANES]; 3],
    directions: [[f64; LANES]; 3],
    /// Distances of those points.
    around: [f64; LANES],
    from: [f64; LANES],
    to: [f64; LANES],
    /// How far from the points the polynomials are looked at.
    reach: [f64; LANES],
    open: Mask8,
}

impl RayPacket {
    /// Gathers up to eight rays between two distances; lanes beyond the last repeat it and are closed.
    #[inline]
    fn new(packet: &[Alive], center: DVec3, near: f64, far: f64) -> Self {
        let mut out = Self::EMPTY;
        for i in 0..LANES {
            let ray = &packet[i.min(packet.len() - 1)];
            let (near, far) = (ray.near.max(near), ray.far.min(far));
            // Around the point nearest to the form's middle the polynomials have small coefficients.
            let nearest = (center - ray.origin).dot(ray.direction) / ray.direction.length_squared();
            let around = nearest.max(near).min(far);
            out.set(i, ray.origin, ray.direction, around, near - around, far - around);
            out.open.0[i] = if i < packet.len() && near <= far { u32::MAX } else { 0 };
        }
        out
    }

    const EMPTY: Self = Self {
        points: [[0.0; LANES]; 3],
        directions: [[0.0; LANES]; 3],
        around: [0.0; LANES],
        from: [0.0; LANES],
        to: [0.0; LANES],
        reach: [0.0; LANES],
        open: Mask8::NONE,
    };

    #[inline]
    fn set(&mut self, i: usize, origin: DVec3, direction: DVec3, around: f64, from: f64, to: f64) {
        let p = origin + direction * around;
        for a in 0..3 {
            self.points[a][i] = p[a];
            self.directions[a][i] = direction[a];
        }
        (self.around[i], self.from[i], self.to[i]) = (around, from, to);
        self.reach[i] = from.abs().max(to.abs());
    }

    /// Gathers rays that are looked at up to `reach` around one distance.
    #[cfg(test)]
    pub(crate) fn around(rays: &[(DVec3, DVec3); LANES], around: f64, reach: f64) -> Self {
        let mut out = Self::EMPTY;
        for (i, &(origin, direction)) in rays.iter().enumerate() {
            out.set(i, origin, direction, around, -reach, reach);
        }
        out
    }

    fn stretch(&self) -> (F32x8, F32x8) {
        let (mut from, mut to) = (F32x8::ZERO, F32x8::ZERO);
        for i in 0..LANES {
            (from.0[i], to.0[i]) = (self.from[i] as f32, self.to[i] as f32);
        }
        (from, to)
    }

    /// Returns a quadric along the rays, as polynomials in the distance from their points, with bounds on the
    /// rounding error of evaluating them.
    pub(crate) fn quadric(&self, q: &Quadric) -> RayQuadric {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            #[expect(
                unsafe_code,
                reason = "a kernel compiled for a processor feature can only be called so"
            )]
            // SAFETY: the processor has the feature that the kernel was compiled for; it was just asked.
            return unsafe { self.quadric_avx2(q) };
        }
        self.quadric_along(q)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn quadric_avx2(&self, q: &Quadric) -> RayQuadric {
        self.quadric_along(q)
    }

    #[inline(always)]
    fn quadric_along(&self, q: &Quadric) -> RayQuadric {
        let [qa, qb, qc, qd, qe, qf, qg, qh, qi, qk] = q.0;
        let mut out = RayQuadric { a: F32x8::ZERO, b: F32x8::ZERO, c: F32x8::ZERO, error: F32x8::ZERO };
        let ([px, py, pz], [dx, dy, dz]) = (&self.points, &self.directions);
        for i in 0..LANES {
            let (x, y, z, u, v, w) = (px[i], py[i], pz[i], dx[i], dy[i], dz[i]);
            let a = u * (qa * u + qd * v + qe * w) + v * (qb * v + qf * w) + qc * w * w;
            let b = (2.0 * qa * x + qd * y + qe * z + qg) * u
                + (2.0 * qb * y + qd * x + qf * z + qh) * v
                + (2.0 * qc * z + qe * x + qf * y + qi) * w;
            let c = x * (qa * x + qd * y + qe * z + qg) + y * (qb * y + qf * z + qh) + z * (qc * z + qi) + qk;
            // Three roundings of single precision on each term, doubled.
            let reach = self.reach[i];
            let error = (a.abs() * reach * reach + b.abs() * reach + c.abs()) * 6.0 * f64::from(f32::EPSILON);
            out.a.0[i] = a as f32;
            out.b.0[i] = b as f32;
            out.c.0[i] = c as f32;
            out.error.0[i] = error as f32;
        }
        out
    }
}
