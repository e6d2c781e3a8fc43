//! How do rays meet a free form?
//!
//! The rays of a tile between two distances are held by a box. Where the bounds of the form over it do not hold
//! zero, it is left out; else the program is pruned to what matters there, and the stretch is halved until it is
//! about as long as the tile is wide. What is left is searched ray by ray, eight at once, the near part first,
//! until every ray has met something.

use crate::bundle::{Crossing, Hits, NOWHERE, Rays};
use crate::program::{Active, Program, Step, values_and_gradients};
use crate::pyramid::Pyramid;
use crate::roots::{RayQuadric, Stack, first_roots};
use glam::{DAffine3, DVec3, Vec3};
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, Mask8, Vec3x8};
use polyptych_core::math::Aabb;
use polyptych_core::scene::{FreeForm, Quadric};

/// How often a stretch is halved at most.
pub(crate) const LEVELS: usize = 6;

/// By how much of their length the halves of a stretch overlap, so that a root on the border, which rounding may
/// put on either side, is inside of one.
const OVERLAP: f64 = 1e-4;

/// In which numbers roots are searched for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Precision {
    /// Single precision around a point of the solid, then a step of Newton's method in double precision.
    #[default]
    Single,
    /// Double precision throughout.
    Double,
}

/// A free form, ready to be cast.
#[derive(Debug)]
pub(crate) struct FormBody {
    pub(crate) program: Program,
    /// The form's bounds with a margin, so that rays enter it from outside of the solid.
    pub(crate) bounds: Aabb,
}

/// Scratch memory of one worker.
#[derive(Default)]
pub(crate) struct FormScratch {
    /// What matters at each level of halving.
    pub(crate) active: [Active; LEVELS],
    /// The quadrics around the middle of a part.
    near: Vec<NearQuadric>,
    /// What matters to eight rays, and the quadrics along them.
    steps: Vec<Step>,
    single: Along<F32x8>,
    double: Along<F64x8>,
    values: Vec<(F64x8, DVec3x8)>,
    alive: Vec<Alive>,
}

/// Quadrics along eight rays, by leaf, with the stack to reckon with them.
struct Along<N> {
    leaves: Vec<RayQuadric<N>>,
    stack: Stack<N>,
}

impl<N> Default for Along<N> {
    fn default() -> Self {
        Self { leaves: Vec::new(), stack: Stack::default() }
    }
}

/// Rays in object space that meet the bounds. Distances are those of the world, counted from where each ray is
/// nearest to the middle of the bounds, so that they and the places there are small numbers however far the eye is.
#[derive(Clone, Copy)]
struct Alive {
    octet: usize,
    origin: DVec3x8,
    direction: DVec3x8,
    /// From where distances are counted.
    around: F64x8,
    /// Where that is, from the middle of the bounds.
    offset: Vec3x8,
    toward: Vec3x8,
    near: F32x8,
    far: F32x8,
    /// Those that have met nothing yet.
    open: Mask8,
}

/// A quadric around the middle of a part of space, in single precision.
#[derive(Clone, Copy, Debug)]
struct NearQuadric {
    /// Those of `x^2, y^2, z^2` and half of those of `xy, xz, yz`.
    square: [f32; 6],
    gradient: Vec3,
    value: f32,
    /// Bound on what rounding of places and coefficients changes in the part.
    slack: f32,
}

impl NearQuadric {
    const ZERO: Self = Self { square: [0.0; 6], gradient: Vec3::ZERO, value: 0.0, slack: 0.0 };

    /// Turns a quadric around a point, for places up to `reach` from it that are known to `drift`.
    fn new(q: &Quadric, point: DVec3, reach: f64, drift: f64) -> Self {
        let [a, b, c, d, e, f, ..] = q.0;
        let (value, gradient) = (q.value(point), q.gradient(point));
        let bend = a.abs() + b.abs() + c.abs() + d.abs() + e.abs() + f.abs();
        let slope = gradient.abs().element_sum() + 2.0 * bend * reach;
        let size = value.abs() + (gradient.abs().element_sum() + bend * reach) * reach;
        let slack = slope * drift + size * 8.0 * f64::from(f32::EPSILON);
        Self {
            square: [a, b, c, 0.5 * d, 0.5 * e, 0.5 * f].map(|v| v as f32),
            gradient: gradient.as_vec3(),
            value: value as f32,
            slack: (slack * 1.001) as f32,
        }
    }

    /// Returns the quadric along rays through places near the point, looked at up to `reach` from them.
    #[inline(always)]
    fn along(&self, place: Vec3x8, toward: Vec3x8, reach: F32x8) -> RayQuadric<F32x8> {
        let [qa, qb, qc, qd, qe, qf] = self.square.map(F32x8::splat);
        let g = self.gradient;
        let Vec3x8 { x, y, z } = place;
        let Vec3x8 { x: u, y: v, z: w } = toward;
        let (mx, my, mz) = (qa * x + qd * y + qe * z, qd * x + qb * y + qf * z, qe * x + qf * y + qc * z);
        let (gx, gy, gz) = (F32x8::splat(g.x) + mx, F32x8::splat(g.y) + my, F32x8::splat(g.z) + mz);
        let c = F32x8::splat(self.value) + x * gx + y * gy + z * gz;
        let b = u * (gx + mx) + v * (gy + my) + w * (gz + mz);
        let (du, dv) = (qd * v + qe * w, qf * w);
        let a = u * (qa * u + du + du) + v * (qb * v + dv + dv) + qc * w * w;
        let rounding = F32x8::splat(8.0 * f32::EPSILON);
        let error = ((a.abs() * reach + b.abs()) * reach + c.abs()) * rounding + F32x8::splat(self.slack);
        RayQuadric { a, b, c, error }
    }
}

/// What rays are cast for: the body whose hits they improve, and which roots count.
#[derive(Clone, Copy)]
pub(crate) struct Cast<'a> {
    pub(crate) object_from_world: &'a DAffine3,
    pub(crate) body: u32,
    pub(crate) crossing: Crossing,
    pub(crate) precision: Precision,
}

impl FormBody {
    pub(crate) fn new(form: &FreeForm) -> Self {
        let bounds = form.bounds();
        Self { program: Program::new(form.form()), bounds: bounds.grown(bounds.radius() * 1e-4) }
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.program.steps.len() * 24 + self.program.leaves.len() * 80) as u64
    }

    polyptych_core::for_registers! {
        /// Improves `hits` where a ray meets the form sooner.
        pub(crate) fn cast(&self, cast: Cast<'_>, rays: &[Rays], hits: &mut [Hits], scratch: &mut FormScratch)
            = cast_256, cast_here;
    }

    #[inline(always)]
    fn cast_here(&self, cast: Cast<'_>, rays: &[Rays], hits: &mut [Hits], scratch: &mut FormScratch) {
        self.enter(cast.object_from_world, rays, hits, &mut scratch.alive);
        let bounded = scratch
            .alive
            .iter()
            .map(|a| (a.open, a.origin, a.direction, a.around + a.near.to_f64(), a.around + a.far.to_f64()));
        let Some((pyramid, near, far)) = Pyramid::around(bounded) else { return };
        scratch.near.resize(self.program.leaves.len(), NearQuadric::ZERO);
        scratch.single.leaves.resize(self.program.leaves.len(), RayQuadric::ZERO);
        scratch.double.leaves.resize(self.program.leaves.len(), RayQuadric::ZERO);
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
            } else if !self.search((begin, end), &part, level, cast, hits, scratch) {
                return;
            }
        }
    }

    /// Lists the rays that meet the bounds before what they met already.
    #[inline(always)]
    fn enter(&self, object_from_world: &DAffine3, rays: &[Rays], hits: &[Hits], alive: &mut Vec<Alive>) {
        alive.clear();
        let shift = DVec3x8::splat(object_from_world.translation);
        let center = self.bounds.center();
        let half = (self.bounds.size() * 0.5).as_vec3();
        for (octet, (r, hits)) in rays.iter().zip(hits).enumerate() {
            let open = r.open();
            if !open.any() {
                continue;
            }
            let origin = r.origin.turned(&object_from_world.matrix3) + shift;
            let direction = r.direction.turned(&object_from_world.matrix3);
            let away = DVec3x8::splat(center) - origin;
            let around = away.dot(direction) / direction.dot(direction);
            let offset = (direction.scaled(around) - away).round();
            let toward = direction.round();
            let (enter, leave) = clip_near(half, offset, toward);
            let near = enter.max((r.near - around).round());
            let far = leave.min((r.far.min(hits.t) - around).round());
            let open = open & far.above(near);
            if open.any() {
                alive.push(Alive { octet, origin, direction, around, offset, toward, near, far, open });
            }
        }
    }

    /// Searches all rays between two distances; tells whether some are still open.
    #[inline(always)]
    fn search(
        &self,
        (begin, end): (f64, f64),
        part: &Aabb,
        level: usize,
        cast: Cast<'_>,
        hits: &mut [Hits],
        scratch: &mut FormScratch,
    ) -> bool {
        let FormScratch { active, near, steps: own, single, double, alive, values } = scratch;
        let steps = &active[level].steps;
        let middle = self.set_up(part, steps, near);
        let mut left = false;
        for alive in alive {
            let since = |t: f64| (F64x8::splat(t) - alive.around).round();
            let (from, to) = (alive.near.max(since(begin)), alive.far.min(since(end)));
            let open = alive.open & to.above(from);
            left |= alive.open.any();
            if !open.any() {
                continue;
            }
            let half = F32x8::splat(0.5);
            let (at, reach) = ((from + to) * half, (to - from) * half);
            let place = alive.offset + alive.toward.scaled(at) - Vec3x8::splat(middle);
            let (found, t) = if let [Step::Leaf(leaf)] = **steps {
                let rough = near[leaf as usize].along(place, alive.toward, reach);
                let open = open & !rough.is_nowhere_zero(reach);
                if !open.any() {
                    continue;
                }
                let start = alive.around + at.to_f64();
                let along = alive.line(start).quadric(&self.program.leaves[leaf as usize].0);
                let (found, root) = along.first_root(reach.to_f64(), cast.crossing);
                (found & open, start + root)
            } else if cast.precision == Precision::Single {
                own.clear();
                for &step in steps {
                    if let Step::Leaf(leaf) | Step::Bump { leaf, .. } = step {
                        let along = near[leaf as usize].along(place, alive.toward, reach);
                        // Bumps that none of the rays comes near add nothing.
                        let nothing =
                            matches!(step, Step::Bump { .. }) && !(open & !along.is_nothing(reach)).any();
                        if nothing {
                            continue;
                        }
                        single.leaves[leaf as usize] = along;
                    }
                    own.push(step);
                }
                let Along { leaves, stack } = &mut *single;
                let (found, root) = first_roots(own, leaves, -reach, reach, open, cast.crossing, stack);
                (found, alive.around + (at + root).to_f64())
            } else {
                self.search_in_double(alive, (at, reach), steps, open, cast.crossing, double)
            };
            if !found.any() {
                continue;
            }
            let (found, t, normal) = match cast.crossing {
                // What blocks light is not looked at.
                Crossing::Entry => (found, t, NOWHERE),
                Crossing::Any => {
                    let (rough, (t, normal, settled)) = (t, self.polish(alive, found, t, steps, values));
                    // What matters in this part is not the whole form: beyond it a root means nothing.
                    let beside = (t - alive.around - at.to_f64()).abs();
                    let within = (reach * F32x8::splat(1.001)).to_f64().at_least(beside);
                    let doubtful = found & !(settled & within);
                    if cast.precision == Precision::Single && doubtful.any() {
                        // Rounding may have made a root of large terms that nearly cancel.
                        let (again, exact) =
                            self.search_in_double(alive, (at, reach), steps, doubtful, cast.crossing, double);
                        let t = F64x8::pick(again, exact, F64x8::pick(doubtful, rough, t));
                        let found = (found & !doubtful) | again;
                        let (t, normal, _) = self.polish(alive, found, t, steps, values);
                        (found, t, normal)
                    } else {
                        (found, t, normal)
                    }
                }
            };
            if !found.any() {
                continue;
            }
            hits[alive.octet].improve(found, t, cast.body, normal);
            alive.open = alive.open & !found;
        }
        left
    }

    /// Searches some of eight rays around a distance in double precision. Called, not copied: it is large and seldom used.
    #[inline(never)]
    fn search_in_double(
        &self,
        alive: &Alive,
        (at, reach): (F32x8, F32x8),
        steps: &[Step],
        open: Mask8,
        crossing: Crossing,
        double: &mut Along<F64x8>,
    ) -> (Mask8, F64x8) {
        let start = alive.around + at.to_f64();
        let (line, reach) = (alive.line(start), reach.to_f64());
        for &step in steps {
            if let Step::Leaf(leaf) | Step::Bump { leaf, .. } = step {
                let along = line.quadric(&self.program.leaves[leaf as usize].0);
                double.leaves[leaf as usize] = along.bounded(reach);
            }
        }
        let Along { leaves, stack } = &mut *double;
        let (found, root) = first_roots(steps, leaves, -reach, reach, open, crossing, stack);
        (found, start + root)
    }

    /// Turns what matters in a part around its middle, and returns that, from the middle of the bounds.
    #[inline(always)]
    fn set_up(&self, part: &Aabb, steps: &[Step], near: &mut [NearQuadric]) -> Vec3 {
        let center = self.bounds.center();
        // Rounded first, so that the places of rays and of coefficients are counted from the same point.
        let middle = (part.center() - center).as_vec3();
        let point = center + middle.as_dvec3();
        // Of offset, direction and distance: one rounding each, and one more of their sum.
        let drift = self.bounds.radius() * 4.0 * f64::from(f32::EPSILON);
        for step in steps {
            if let Step::Leaf(leaf) | Step::Bump { leaf, .. } = *step {
                let q = &self.program.leaves[leaf as usize];
                near[leaf as usize] = NearQuadric::new(q, point, part.radius() * 1.01, drift);
            }
        }
        middle
    }

    /// Improves distances along rays by steps of Newton's method in double precision and returns them with the
    /// outward normals, in object space, and tells which came to rest.
    #[inline(always)]
    fn polish(
        &self,
        rays: &Alive,
        found: Mask8,
        first: F64x8,
        steps: &[Step],
        values: &mut Vec<(F64x8, DVec3x8)>,
    ) -> (F64x8, DVec3x8, Mask8) {
        let radius = F64x8::splat(self.bounds.radius()) / rays.direction.length();
        let [longest, far, close] = [1e-3, 1e-2, 3e-6].map(|share| radius * F64x8::splat(share));
        let (mut t, mut normal, mut moving) = (first, NOWHERE, found);
        // One step is enough but where a ray nearly touches the surface: single precision is far off there.
        for _ in 0..8 {
            let p = rays.origin + rays.direction.scaled(t);
            let (value, gradient) = values_and_gradients(&self.program, steps, p, values);
            normal = NOWHERE - gradient;
            let step = value / gradient.dot(rays.direction);
            let ahead = F64x8::pick(step.above(longest), longest, step);
            let step = F64x8::pick((-longest).above(step), -longest, ahead);
            // What is no number, on a surface that turns away from the ray, moves nothing.
            t = t - F64x8::pick(step.equal(step), step, F64x8::ZERO);
            moving = found & step.abs().above(close);
            if !moving.any() {
                break;
            }
        }
        // At a crease or a tangent steps may lead away, or nowhere.
        let settled = far.above((t - first).abs()) & !moving;
        (F64x8::pick(settled, t, first), normal, settled)
    }
}

impl Alive {
    /// Returns the rays around points at a distance.
    #[inline(always)]
    fn line(&self, t: F64x8) -> Line {
        Line { point: self.origin + self.direction.scaled(t), direction: self.direction }
    }
}

/// Returns where rays enter and leave a box around the origin; rays in a face plane are inside.
#[inline(always)]
fn clip_near(half: Vec3, offset: Vec3x8, toward: Vec3x8) -> (F32x8, F32x8) {
    let infinity = F32x8::splat(f32::INFINITY);
    let (mut near, mut far) = (-infinity, infinity);
    for (o, d, half) in
        [(offset.x, toward.x, half.x), (offset.y, toward.y, half.y), (offset.z, toward.z, half.z)]
    {
        let half = F32x8::splat(half);
        let one_over = F32x8::splat(1.0) / d;
        let (a, b) = ((-half - o) * one_over, (half - o) * one_over);
        let flat = d.equal(F32x8::ZERO);
        let outside = flat & o.abs().above(half);
        near = flat.pick(near, near.max(a.min(b)));
        far = outside.pick(-infinity, flat.pick(far, far.min(a.max(b))));
    }
    (near, far)
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
    /// Returns it with a bound on its rounding error up to `reach` from the points.
    #[inline(always)]
    fn bounded(&self, reach: F64x8) -> RayQuadric<F64x8> {
        let Self { a, b, c } = *self;
        let error = ((a.abs() * reach + b.abs()) * reach + c.abs()) * F64x8::splat(16.0 * f64::EPSILON);
        RayQuadric { a, b, c, error }
    }

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
    use polyptych_core::registers::Registers;

    /// Returns quadrics along rays in single precision, looked at up to `reach` around one distance, from a point
    /// that no ray is further from than `size`.
    pub(crate) fn along(
        program: &Program,
        rays: &[(DVec3, DVec3); LANES],
        (around, reach): (f64, f64),
        (point, size): (DVec3, f64),
    ) -> Vec<RayQuadric<F32x8>> {
        let (mut place, mut toward) = (NOWHERE, NOWHERE);
        for (i, &(o, d)) in rays.iter().enumerate() {
            place.set(i, o + d * around - point);
            toward.set(i, d);
        }
        let (place, toward, reach) = (place.round(), toward.round(), F32x8::splat(reach as f32));
        let drift = size * 4.0 * f64::from(f32::EPSILON);
        let near = |q: &Quadric| NearQuadric::new(q, point, size, drift).along(place, toward, reach);
        program.leaves.iter().map(near).collect()
    }

    /// Casts rays at the figure that uses every step, with the widest registers and with the plainest.
    #[test]
    fn bytes_do_not_depend_on_the_registers() {
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
        let bits = |registers: Registers, (crossing, precision): (Crossing, Precision)| {
            let mut hits: Vec<Hits> = rays.iter().map(Hits::nothing).collect();
            let mut scratch = FormScratch::default();
            let place = DAffine3::from_rotation_y(0.3);
            let cast = Cast { object_from_world: &place, body: 7, crossing, precision };
            registers.limit();
            body.cast(cast, &rays, &mut hits, &mut scratch);
            let numbers = |h: &Hits| {
                let normal = h.normal;
                (h.body.0, [h.t, normal.x, normal.y, normal.z].map(|v| v.0.map(f64::to_bits)))
            };
            hits.iter().map(numbers).collect::<Vec<_>>()
        };
        let ways = [Crossing::Any, Crossing::Entry]
            .map(|c| [Precision::Single, Precision::Double].map(|precision| (c, precision)));
        for way in ways.into_iter().flatten() {
            let [plain, wider, widest] = Registers::ALL.map(|registers| bits(registers, way));
            let met = plain.iter().flat_map(|h| h.0).filter(|b| *b == 7).count();
            assert!(wider == plain && widest == plain, "{way:?}");
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
        let of = |pick: &dyn Fn(usize) -> f64| F64x8::new(std::array::from_fn(pick));
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
        let (near, far) = crate::pyramid::clip(&bounds, &origin, &direction);
        for (i, &(o, d)) in rays.iter().enumerate() {
            let many = (near.0[i] <= far.0[i]).then_some((near.0[i], far.0[i]));
            assert_eq!(many, bounds.clip(o, d), "{i}");
        }
    }
}
