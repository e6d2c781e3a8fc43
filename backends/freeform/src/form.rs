//! How do rays meet a free form?
//!
//! The rays of a tile between two distances are held by a box. Where the bounds of the form over it do not hold
//! zero, it is left out; else the program is pruned to what matters there, and the stretch is halved until it is
//! about as long as the tile is wide. What is left is searched ray by ray, eight at once, the near part first,
//! until every ray has met something.

use crate::bundle::{Crossing, Hits, NOWHERE, Rays};
use crate::program::{Active, Program, Step, values_and_gradients};
use crate::roots::{RayQuadric, Stack, first_roots};
use glam::{DAffine3, DVec3};
use polyptych_core::lanes::{DVec3x8, F64x8, Mask8};
use polyptych_core::math::Aabb;
use polyptych_core::scene::FreeForm;

/// How often a stretch is halved at most.
const LEVELS: usize = 6;

/// By how much of their length the halves of a stretch overlap, so that a root on the border, which rounding may
/// put on either side, is inside of one.
const OVERLAP: f64 = 1e-4;

/// A stretch is halved while it is so much longer than the tile is wide.
const SLENDER: f64 = 3.0;

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
    /// What matters at each level of halving.
    active: [Active; LEVELS],
    leaves: Vec<RayQuadric>,
    stack: Stack,
    values: Vec<(F64x8, DVec3x8)>,
    alive: Vec<Alive>,
}

/// Rays in object space that meet the bounds; distances stay those of the world.
#[derive(Clone, Copy)]
struct Alive {
    octet: usize,
    origin: DVec3x8,
    direction: DVec3x8,
    near: F64x8,
    far: F64x8,
    /// Those that have met nothing yet.
    open: Mask8,
}

/// Bounds of all rays of a tile.
pub(crate) struct Pyramid {
    origins: Aabb,
    directions: Aabb,
}

impl FormBody {
    pub(crate) fn new(form: &FreeForm) -> Self {
        let bounds = form.bounds();
        Self { program: Program::new(form.form()), bounds: bounds.grown(bounds.radius() * 1e-4) }
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.program.steps.len() * 24 + self.program.leaves.len() * 80) as u64
    }

    /// Improves `hits` where a ray meets the form sooner.
    pub(crate) fn cast(
        &self,
        object_from_world: &DAffine3,
        body: u32,
        crossing: Crossing,
        rays: &[Rays],
        hits: &mut [Hits],
        scratch: &mut FormScratch,
    ) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            #[expect(
                unsafe_code,
                reason = "a kernel compiled for a processor feature can only be called so"
            )]
            // SAFETY: the processor has the feature that the kernel was compiled for; it was just asked.
            return unsafe { self.cast_avx2(object_from_world, body, crossing, rays, hits, scratch) };
        }
        self.cast_plain(object_from_world, body, crossing, rays, hits, scratch);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn cast_avx2(
        &self,
        object_from_world: &DAffine3,
        body: u32,
        crossing: Crossing,
        rays: &[Rays],
        hits: &mut [Hits],
        scratch: &mut FormScratch,
    ) {
        self.cast_plain(object_from_world, body, crossing, rays, hits, scratch);
    }

    #[inline(always)]
    fn cast_plain(
        &self,
        object_from_world: &DAffine3,
        body: u32,
        crossing: Crossing,
        rays: &[Rays],
        hits: &mut [Hits],
        scratch: &mut FormScratch,
    ) {
        self.enter(object_from_world, rays, hits, &mut scratch.alive);
        let bounded = scratch.alive.iter().map(|a| (a.open, a.origin, a.direction, a.near, a.far));
        let Some((pyramid, near, far)) = Pyramid::around(bounded) else { return };
        scratch.leaves.resize(self.program.leaves.len(), RayQuadric::ZERO);
        let mut waiting = [(0.0, 0.0, 0); LEVELS + 1];
        waiting[0] = (near, far, 0);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (begin, end, level) = waiting[count];
            let part = pyramid.between(begin, end).intersection(self.bounds);
            if part.is_empty() {
                continue;
            }
            let (above, below) = scratch.active.split_at_mut(level);
            let from = above.last().map_or(&self.program.steps, |a| &a.steps);
            if !below[0].prune(&self.program, from, &part).contains(0.0) {
                continue;
            }
            if level + 1 < LEVELS && below[0].steps.len() > 1 && pyramid.is_slender(begin, end) {
                let (middle, overlap) = (0.5 * (begin + end), OVERLAP * (end - begin));
                waiting[count] = (middle - overlap, end, level + 1);
                waiting[count + 1] = (begin, middle + overlap, level + 1);
                count += 2;
            } else if !self.search((begin, end), level, body, crossing, hits, scratch) {
                return;
            }
        }
    }

    /// Lists the rays that meet the bounds before what they met already.
    #[inline(always)]
    fn enter(&self, object_from_world: &DAffine3, rays: &[Rays], hits: &[Hits], alive: &mut Vec<Alive>) {
        alive.clear();
        let shift = DVec3x8::splat(object_from_world.translation);
        for (octet, (r, hits)) in rays.iter().zip(hits).enumerate() {
            let open = r.open();
            if !open.any() {
                continue;
            }
            let origin = r.origin.turned(&object_from_world.matrix3) + shift;
            let direction = r.direction.turned(&object_from_world.matrix3);
            let (enter, leave) = clip(&self.bounds, &origin, &direction);
            let (near, far) = (enter.max(r.near), leave.min(r.far).min(hits.t));
            let open = open & far.above(near);
            if open.any() {
                alive.push(Alive { octet, origin, direction, near, far, open });
            }
        }
    }

    /// Searches all rays between two distances; tells whether some are still open.
    #[inline(always)]
    fn search(
        &self,
        (begin, end): (f64, f64),
        level: usize,
        body: u32,
        crossing: Crossing,
        hits: &mut [Hits],
        scratch: &mut FormScratch,
    ) -> bool {
        let FormScratch { active, leaves, stack, alive, values } = scratch;
        let steps = &active[level].steps;
        let mut left = false;
        for alive in alive {
            let (from, to) = (alive.near.max(F64x8::splat(begin)), alive.far.min(F64x8::splat(end)));
            let open = alive.open & to.above(from);
            left |= alive.open.any();
            if !open.any() {
                continue;
            }
            let half = F64x8::splat(0.5);
            let (around, reach) = ((from + to) * half, (to - from) * half);
            let rays =
                Line { point: alive.origin + alive.direction.scaled(around), direction: alive.direction };
            let (found, t) = if let [Step::Leaf(leaf)] = **steps {
                let along = rays.quadric(&self.program.leaves[leaf as usize].0);
                let (found, root) = along.first_root(reach, crossing);
                (found & open, around + root)
            } else {
                for step in steps {
                    if let Step::Leaf(leaf) | Step::Bump { leaf, .. } = *step {
                        let along = rays.quadric(&self.program.leaves[leaf as usize].0);
                        leaves[leaf as usize] = RayQuadric::new(&along, reach);
                    }
                }
                let reach = reach.round();
                let (found, root) = first_roots(steps, leaves, -reach, reach, open, crossing, stack);
                (found, around + root.to_f64())
            };
            if !found.any() {
                continue;
            }
            let (t, normal) = match crossing {
                Crossing::Any => self.polish(alive, t, steps, values),
                // What blocks light is not looked at.
                Crossing::Entry => (t, NOWHERE),
            };
            hits[alive.octet].improve(found, t, body, normal);
            alive.open = alive.open & !found;
        }
        left
    }

    /// Improves distances along rays by a step of Newton's method in double precision and returns them with the
    /// outward normals, in object space.
    #[inline(always)]
    fn polish(
        &self,
        rays: &Alive,
        t: F64x8,
        steps: &[Step],
        values: &mut Vec<(F64x8, DVec3x8)>,
    ) -> (F64x8, DVec3x8) {
        let p = rays.origin + rays.direction.scaled(t);
        let (value, gradient) = values_and_gradients(&self.program, steps, p, values);
        let step = value / gradient.dot(rays.direction);
        // Near a tangent or a crease a step may lead away: single precision was right to 1e-5 of the size.
        let small = F64x8::splat(self.bounds.radius() * 1e-4).above((step * rays.direction.length()).abs());
        (F64x8::pick(small, t - step, t), NOWHERE - gradient)
    }
}

/// Returns where rays enter and leave a box, as [`Aabb::clip`]; rays in a face plane are inside.
#[inline(always)]
pub(crate) fn clip(bounds: &Aabb, origin: &DVec3x8, direction: &DVec3x8) -> (F64x8, F64x8) {
    let infinity = F64x8::splat(f64::INFINITY);
    let (mut near, mut far) = (F64x8::ZERO, infinity);
    let axes = [
        (origin.x, direction.x, bounds.min.x, bounds.max.x),
        (origin.y, direction.y, bounds.min.y, bounds.max.y),
        (origin.z, direction.z, bounds.min.z, bounds.max.z),
    ];
    for (o, d, min, max) in axes {
        let (min, max) = (F64x8::splat(min) - o, F64x8::splat(max) - o);
        let (a, b) = (min / d, max / d);
        let flat = d.equal(F64x8::ZERO);
        let outside = flat & (min.above(F64x8::ZERO) | F64x8::ZERO.above(max));
        let (low, high) = (a.min(b), a.max(b));
        near = F64x8::pick(flat, near, near.max(low));
        far = F64x8::pick(outside, -infinity, F64x8::pick(flat, far, far.min(high)));
    }
    (near, far)
}

impl Pyramid {
    /// Bounds rays of which some are open, with the range of their distances; nothing if there are none.
    #[inline(always)]
    pub(crate) fn around(
        rays: impl Iterator<Item = (Mask8, DVec3x8, DVec3x8, F64x8, F64x8)>,
    ) -> Option<(Self, f64, f64)> {
        let (top, bottom) = (F64x8::splat(f64::INFINITY), F64x8::splat(f64::NEG_INFINITY));
        let (mut low, mut high) = ([top; 7], [bottom; 7]);
        for (open, o, d, near, far) in rays {
            let numbers = [o.x, o.y, o.z, d.x, d.y, d.z];
            for i in 0..6 {
                low[i] = low[i].min(F64x8::pick(open, numbers[i], top));
                high[i] = high[i].max(F64x8::pick(open, numbers[i], bottom));
            }
            low[6] = low[6].min(F64x8::pick(open, near, top));
            high[6] = high[6].max(F64x8::pick(open, far, bottom));
        }
        let low = low.map(|v| v.0.into_iter().fold(f64::INFINITY, f64::min));
        let high = high.map(|v| v.0.into_iter().fold(f64::NEG_INFINITY, f64::max));
        let boxed = |i: usize| {
            let [from, to] = [&low, &high].map(|v| DVec3::new(v[i], v[i + 1], v[i + 2]));
            Aabb::new(from, to)
        };
        (low[6] <= high[6]).then(|| (Self { origins: boxed(0), directions: boxed(3) }, low[6], high[6]))
    }

    /// Returns how wide all rays together are at a distance.
    #[inline(always)]
    pub(crate) fn width(&self, t: f64) -> f64 {
        (self.origins.size() + self.directions.size() * t).max_element()
    }

    /// Bounds the places of all rays between two distances.
    #[inline(always)]
    pub(crate) fn between(&self, a: f64, b: f64) -> Aabb {
        let (d, o) = (&self.directions, &self.origins);
        let (low, high) = ((d.min * a).min(d.min * b), (d.max * a).max(d.max * b));
        Aabb::new(o.min + low, o.max + high)
    }

    /// Tells whether the rays between two distances are much longer than all of them together are wide.
    fn is_slender(&self, a: f64, b: f64) -> bool {
        self.directions.center().length() * (b - a) > SLENDER * self.width(b)
    }
}

/// Eight rays around points on them.
struct Line {
    point: DVec3x8,
    direction: DVec3x8,
}

/// A quadric along eight rays: `a u^2 + b u + c`.
pub(crate) struct Parabola {
    pub(crate) a: F64x8,
    pub(crate) b: F64x8,
    pub(crate) c: F64x8,
}

impl Line {
    /// Returns a quadric along the rays, as polynomials in the distance from their points.
    #[inline(always)]
    fn quadric(&self, q: &[f64; 10]) -> Parabola {
        let [qa, qb, qc, qd, qe, qf, qg, qh, qi, qk] = q.map(F64x8::splat);
        let DVec3x8 { x, y, z } = self.point;
        let DVec3x8 { x: u, y: v, z: w } = self.direction;
        let (ax, by, cz) = (qa * x, qb * y, qc * z);
        let (dx, dy, ex, ez, fy, fz) = (qd * x, qd * y, qe * x, qe * z, qf * y, qf * z);
        Parabola {
            a: u * (qa * u + qd * v + qe * w) + v * (qb * v + qf * w) + qc * w * w,
            b: (ax + ax + dy + ez + qg) * u + (by + by + dx + fz + qh) * v + (cz + cz + ex + fy + qi) * w,
            c: x * (ax + dy + ez + qg) + y * (by + fz + qh) + z * (cz + qi) + qk,
        }
    }
}

impl Parabola {
    /// Finds the first roots in `[-reach, reach]`, in closed form: without cancellation, as in *Numerical
    /// Recipes* 5.6.
    #[inline(always)]
    fn first_root(&self, reach: F64x8, crossing: Crossing) -> (Mask8, F64x8) {
        let Self { a, b, c } = *self;
        let under = b * b - F64x8::splat(4.0) * a * c;
        let root = under.max(F64x8::ZERO).sqrt();
        let half = F64x8::splat(-0.5);
        let q = F64x8::pick(b.at_least(F64x8::ZERO), half * (b + root), half * (b - root));
        let (r, s) = (q / a, c / q);
        // Of a line only one root is a number.
        let infinity = F64x8::splat(f64::INFINITY);
        let r = F64x8::pick(infinity.above(r.abs()), r, s);
        let s = F64x8::pick(infinity.above(s.abs()), s, r);
        let (low, high) = (r.min(s), r.max(s));
        let counts = |t: F64x8| {
            let within = reach.at_least(t.abs()) & under.above(F64x8::ZERO);
            match crossing {
                Crossing::Any => within,
                Crossing::Entry => within & ((a + a) * t + b).above(F64x8::ZERO),
            }
        };
        let (first, second) = (counts(low), counts(high));
        (first | second, F64x8::pick(first, low, high))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use polyptych_core::lanes::LANES;

    /// Returns quadrics along rays, looked at up to `reach` around one distance.
    pub(crate) fn along(
        program: &Program,
        rays: &[(DVec3, DVec3); LANES],
        around: f64,
        reach: f64,
    ) -> Vec<RayQuadric> {
        let (mut point, mut direction) = (NOWHERE, NOWHERE);
        for (i, &(o, d)) in rays.iter().enumerate() {
            point.set(i, o + d * around);
            direction.set(i, d);
        }
        let line = Line { point, direction };
        let reach = F64x8::splat(reach);
        program.leaves.iter().map(|q| RayQuadric::new(&line.quadric(&q.0), reach)).collect()
    }

    /// Casts rays at the figure that uses every step, with the widest registers and with the plainest.
    #[cfg(target_arch = "x86_64")]
    #[test]
    fn bytes_do_not_depend_on_the_registers() {
        if !std::arch::is_x86_feature_detected!("avx2") {
            return;
        }
        let form = FreeForm::new(crate::program::tests::everything()).unwrap();
        let body = FormBody::new(&form);
        let mut rays = Vec::new();
        for octet in 0..32 {
            let (mut origin, mut direction) = (NOWHERE, NOWHERE);
            for lane in 0..LANES {
                let (x, y) = (f64::from(lane as u32) * 0.5 - 1.8, f64::from(octet) * 0.1 - 1.6);
                let from = DVec3::new(0.4, 0.3, 4.0);
                origin.set(lane, from);
                direction.set(lane, (DVec3::new(x, y, 0.0) - from).normalize_or(DVec3::Z));
            }
            rays.push(Rays { origin, direction, near: F64x8::ZERO, far: F64x8::splat(9.0) });
        }
        let bits = |wide: bool, crossing: Crossing| {
            let mut hits: Vec<Hits> = rays.iter().map(Hits::nothing).collect();
            let mut scratch = FormScratch::default();
            let place = DAffine3::from_rotation_y(0.3);
            if wide {
                body.cast(&place, 7, crossing, &rays, &mut hits, &mut scratch);
            } else {
                body.cast_plain(&place, 7, crossing, &rays, &mut hits, &mut scratch);
            }
            let numbers = |h: &Hits| {
                let normal = h.normal;
                (h.body.0, [h.t, normal.x, normal.y, normal.z].map(|v| v.0.map(f64::to_bits)))
            };
            hits.iter().map(numbers).collect::<Vec<_>>()
        };
        for crossing in [Crossing::Any, Crossing::Entry] {
            let (wide, plain) = (bits(true, crossing), bits(false, crossing));
            let met = wide.iter().flat_map(|h| h.0).filter(|b| *b == 7).count();
            assert!(wide == plain, "{crossing:?}");
            assert!((60..240).contains(&met), "{met} of 256");
        }
    }

    #[test]
    fn parabolas_have_their_first_roots() {
        // Coefficients, and the first root of any kind and of those where the function rises.
        type Case = (f64, f64, f64, Option<f64>, Option<f64>);
        let cases: [Case; LANES] = [
            (-1.0, 0.0, 1.0, Some(-1.0), Some(-1.0)),
            (1.0, 0.0, -1.0, Some(-1.0), Some(1.0)),
            (0.0, 2.0, 1.0, Some(-0.5), Some(-0.5)),
            (0.0, -2.0, 1.0, Some(0.5), None),
            (1.0, 0.0, 1.0, None, None),
            (-1.0, 6.0, -5.0, Some(1.0), Some(1.0)),
            (1.0, -6.0, 5.0, Some(1.0), None),
            (0.0, 0.0, 1.0, None, None),
        ];
        let of = |pick: &dyn Fn(usize) -> f64| F64x8(std::array::from_fn(pick));
        let parabola = Parabola { a: of(&|i| cases[i].0), b: of(&|i| cases[i].1), c: of(&|i| cases[i].2) };
        for (crossing, entry) in [(Crossing::Any, false), (Crossing::Entry, true)] {
            let (found, root) = parabola.first_root(F64x8::splat(2.0), crossing);
            for (i, case) in cases.iter().enumerate() {
                let truth = if entry { case.4 } else { case.3 };
                assert_eq!(found.has(i).then_some(root.0[i]), truth, "{i} {crossing:?}");
            }
        }
    }

    #[test]
    fn eight_rays_are_clipped_as_one() {
        let bounds = Aabb::new(DVec3::new(-1.0, 0.0, 2.0), DVec3::new(1.0, 3.0, 5.0));
        let rays: [(DVec3, DVec3); LANES] = [
            (DVec3::ZERO, DVec3::Z),
            (DVec3::new(2.0, 0.0, 0.0), DVec3::Z),
            (DVec3::new(1.0, 1.0, 0.0), DVec3::Z),
            (DVec3::new(0.0, 1.0, 3.0), DVec3::new(0.6, 0.0, -0.8)),
            (DVec3::new(-5.0, 1.0, 3.0), DVec3::X),
            (DVec3::new(-5.0, 1.0, 3.0), DVec3::NEG_X),
            (DVec3::new(-3.0, -3.0, 0.0), DVec3::splat(0.577)),
            (DVec3::new(0.0, 9.0, 3.0), DVec3::new(0.1, -1.0, 0.05)),
        ];
        let (mut origin, mut direction) = (NOWHERE, NOWHERE);
        for (i, &(o, d)) in rays.iter().enumerate() {
            origin.set(i, o);
            direction.set(i, d);
        }
        let (near, far) = clip(&bounds, &origin, &direction);
        for (i, &(o, d)) in rays.iter().enumerate() {
            let many = (near.0[i] <= far.0[i]).then_some((near.0[i], far.0[i]));
            assert_eq!(many, bounds.clip(o, d), "{i}");
        }
    }
}
