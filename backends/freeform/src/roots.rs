//! Where does each ray of a packet first meet the zero surface of a form?
//!
//! Along a ray each quadric is a polynomial of second degree, taken around a point near the form (set up in
//! double precision), so that far eyes lose nothing. A stretch of the ray is excluded when the bounds of the
//! form over it, widened by the rounding error of their own evaluation, do not hold zero; it is searched when
//! the bounds of the derivative do not; else it is halved. So no root is missed except a pair closer than
//! [`FINEST`] of the stretch.

use crate::bundle::Crossing;
use crate::form::Parabola;
use crate::program::Step;
use polyptych_core::lanes::{F32x8, F64x8, LANES, Mask8};
use polyptych_core::scene::Power;

/// Shortest stretch that is still halved, as a share of the whole: the resolution of single precision.
const FINEST: f32 = 1.0 / (1 << 20) as f32;

/// Rounding error of an operation with a little more: 2^-22.
const ROUNDING: f32 = 1.0 / (1 << 22) as f32;

/// A quadric along eight rays: `a u^2 + b u + c`, with a bound on the rounding error over the whole stretch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayQuadric {
    pub(crate) a: F32x8,
    pub(crate) b: F32x8,
    pub(crate) c: F32x8,
    pub(crate) error: F32x8,
}

/// Bounds of a function and its derivative over a stretch.
#[derive(Clone, Copy, Debug)]
struct Range {
    lo: F32x8,
    hi: F32x8,
    slope_lo: F32x8,
    slope_hi: F32x8,
}

impl RayQuadric {
    /// Rounds a quadric along rays that is looked at up to `reach` from their points.
    #[inline(always)]
    pub(crate) fn new(along: &Parabola, reach: F64x8) -> Self {
        let Parabola { a, b, c } = *along;
        // Three roundings of single precision on each term, doubled.
        let error =
            ((a.abs() * reach + b.abs()) * reach + c.abs()) * F64x8::splat(6.0 * f64::from(f32::EPSILON));
        Self { a: a.round(), b: b.round(), c: c.round(), error: error.round() }
    }

    pub(crate) const ZERO: Self = Self { a: F32x8::ZERO, b: F32x8::ZERO, c: F32x8::ZERO, error: F32x8::ZERO };
}

impl Range {
    const ZERO: Self =
        Self { lo: F32x8::ZERO, hi: F32x8::ZERO, slope_lo: F32x8::ZERO, slope_hi: F32x8::ZERO };
}

/// Scratch memory of one worker.
#[derive(Default)]
pub(crate) struct Stack {
    ranges: Vec<Range>,
    values: Vec<(F32x8, F32x8)>,
}

/// Finds the first root of each active ray in `[from, to]`. Returns which rays have one, and where.
#[inline(always)]
pub(crate) fn first_roots(
    steps: &[Step],
    leaves: &[RayQuadric],
    from: F32x8,
    to: F32x8,
    active: Mask8,
    crossing: Crossing,
    stack: &mut Stack,
) -> (Mask8, F32x8) {
    let half = F32x8::splat(0.5);
    let shortest = (to - from) * F32x8::splat(FINEST);
    let mut begin = from;
    let mut length = to - from;
    let mut open = active & to.at_least(from);
    let (mut hit, mut root) = (Mask8::NONE, F32x8::ZERO);
    while open.any() {
        let end = (begin + length).min(to);
        let range = bound(steps, leaves, begin, end, &mut stack.ranges);
        let excluded = (range.lo.above(F32x8::ZERO) | (-range.hi).above(F32x8::ZERO)) & open;
        let monotone = range.slope_lo.above(F32x8::ZERO) | (-range.slope_hi).above(F32x8::ZERO);
        let tiny = shortest.at_least(length);
        let search = (monotone | tiny) & open & !excluded;
        let mut passed = excluded;
        if search.any() {
            let (at_begin, _) = value(steps, leaves, begin, &mut stack.values);
            let (at_end, _) = value(steps, leaves, end, &mut stack.values);
            let inside = at_begin.at_least(F32x8::ZERO);
            let ends_inside = at_end.at_least(F32x8::ZERO);
            let change = match crossing {
                Crossing::Any => (inside & !ends_inside) | (!inside & ends_inside),
                Crossing::Entry => !inside & ends_inside,
            };
            let found = search & change;
            if found.any() {
                let refined = match crossing {
                    Crossing::Any => refine(steps, leaves, begin, end, found, inside, &mut stack.values),
                    // What blocks light does so wherever it is.
                    Crossing::Entry => begin,
                };
                root = found.pick(refined, root);
                hit = hit | found;
                open = open & !found;
            }
            passed = passed | (search & !change);
        }
        open = open & !(passed & end.at_least(to));
        begin = passed.pick(end, begin);
        length = passed.pick(length + length, length * half);
    }
    (hit, root)
}

/// Closes in on a root by Newton's method, by bisection where a step would leave the bracket.
#[inline(always)]
fn refine(
    steps: &[Step],
    leaves: &[RayQuadric],
    mut lo: F32x8,
    mut hi: F32x8,
    wanted: Mask8,
    inside_at_lo: Mask8,
    values: &mut Vec<(F32x8, F32x8)>,
) -> F32x8 {
    let half = F32x8::splat(0.5);
    // The next step of Newton's method squares what is left of a share of the bracket.
    let close = (hi - lo) * F32x8::splat(1e-4);
    let mut u = (lo + hi) * half;
    for _ in 0..7 {
        let (f, slope) = value(steps, leaves, u, values);
        let inside = f.at_least(F32x8::ZERO);
        let same = (inside & inside_at_lo) | (!inside & !inside_at_lo);
        lo = same.pick(u, lo);
        hi = same.pick(hi, u);
        let newton = u - f / slope;
        let within = newton.at_least(lo) & hi.at_least(newton);
        let next = within.pick(newton, (lo + hi) * half);
        let moved = (next - u).abs().above(close) & wanted;
        u = next;
        if !moved.any() {
            break;
        }
    }
    u
}

/// Evaluates the form and its derivative along the rays.
#[inline(always)]
fn value(steps: &[Step], leaves: &[RayQuadric], u: F32x8, stack: &mut Vec<(F32x8, F32x8)>) -> (F32x8, F32x8) {
    let quadric = |leaf: u32| {
        let q = &leaves[leaf as usize];
        ((q.a * u + q.b) * u + q.c, (q.a + q.a) * u + q.b)
    };
    let number = |value: f64| F32x8::splat(value as f32);
    stack.clear();
    // The top of the stack.
    let (mut b, mut db) = (F32x8::splat(-1.0), F32x8::ZERO);
    for (i, &step) in steps.iter().enumerate() {
        match step {
            Step::Leaf(leaf) => {
                if i > 0 {
                    stack.push((b, db));
                }
                (b, db) = quadric(leaf);
                continue;
            }
            Step::Bump { leaf, weight, power } => {
                let (r, dr) = raised(quadric(leaf), weight, power);
                (b, db) = (b + r, db + dr);
                continue;
            }
            Step::Neg => {
                (b, db) = (-b, -db);
                continue;
            }
            Step::Add(amount) => {
                b = b + number(amount);
                continue;
            }
            _ => {}
        }
        let Some((a, da)) = stack.pop() else { break };
        (b, db) = match step {
            Step::Term { weight, power } => {
                let (r, dr) = raised((b, db), weight, power);
                (a + r, da + dr)
            }
            Step::Max => {
                let first = a.at_least(b);
                (first.pick(a, b), first.pick(da, db))
            }
            Step::Min => {
                let first = b.at_least(a);
                (first.pick(a, b), first.pick(da, db))
            }
            Step::Smooth(k) => {
                let first = a.at_least(b);
                let (top, low) = (first.pick(a, b), first.pick(b, a));
                let (dtop, dlow) = (first.pick(da, db), first.pick(db, da));
                let overlap = (number(k) - (top - low)).max(F32x8::ZERO);
                let share = overlap * number(0.5 / k);
                (top + overlap * overlap * number(0.25 / k), dtop + (dlow - dtop) * share)
            }
            Step::Mix(t) => {
                let (s, t) = (number(1.0 - t), number(t));
                (a * s + b * t, da * s + db * t)
            }
            Step::Torus(ring) => {
                let ring = number(ring);
                (ring * a - b * b, ring * da - (b + b) * db)
            }
            Step::Leaf(_) | Step::Bump { .. } | Step::Neg | Step::Add(_) => (b, db),
        };
    }
    (b, db)
}

/// Returns `weight * R(q)` and its derivative.
#[inline(always)]
fn raised((q, dq): (F32x8, F32x8), weight: f64, power: Power) -> (F32x8, F32x8) {
    let (q, w) = (q.max(F32x8::ZERO), F32x8::splat(weight as f32));
    match power {
        Power::Square => (w * (q * q), w * (q + q) * dq),
        Power::Cube => {
            let q2 = q * q;
            (w * (q2 * q), w * (F32x8::splat(3.0) * q2) * dq)
        }
    }
}

/// Bounds the form and its derivative over `[u0, u1]`.
#[inline(always)]
fn bound(steps: &[Step], leaves: &[RayQuadric], u0: F32x8, u1: F32x8, stack: &mut Vec<Range>) -> Range {
    stack.clear();
    // The top of the stack.
    let mut b = Range { lo: F32x8::splat(-1.0), hi: F32x8::splat(-1.0), ..Range::ZERO };
    for (i, &step) in steps.iter().enumerate() {
        match step {
            Step::Leaf(leaf) => {
                if i > 0 {
                    stack.push(b);
                }
                b = leaf_range(&leaves[leaf as usize], u0, u1);
                continue;
            }
            Step::Bump { leaf, weight, power } => {
                let q = leaf_range(&leaves[leaf as usize], u0, u1);
                if q.hi.above(F32x8::ZERO).any() {
                    b = widened(term_range(b, q, weight as f32, power));
                }
                continue;
            }
            Step::Neg => {
                b = flipped(b);
                continue;
            }
            Step::Add(c) => {
                let c = F32x8::splat(c as f32);
                b = widened(Range { lo: b.lo + c, hi: b.hi + c, ..b });
                continue;
            }
            _ => {}
        }
        let Some(a) = stack.pop() else { break };
        b = widened(match step {
            Step::Term { weight, power } => term_range(a, b, weight as f32, power),
            Step::Max => max_range(a, b),
            Step::Min => flipped(max_range(flipped(a), flipped(b))),
            Step::Smooth(k) => smooth_range(a, b, k as f32),
            Step::Mix(t) => sum(scaled(a, (1.0 - t) as f32), scaled(b, t as f32)),
            Step::Torus(ring) => {
                let (s_lo, s_hi) = square(b.lo, b.hi);
                let (p_lo, p_hi) = product(b.lo, b.hi, b.slope_lo, b.slope_hi);
                let two = F32x8::splat(-2.0);
                let minus = Range { lo: -s_hi, hi: -s_lo, slope_lo: p_hi * two, slope_hi: p_lo * two };
                sum(scaled(a, ring as f32), minus)
            }
            Step::Leaf(_) | Step::Bump { .. } | Step::Neg | Step::Add(_) => b,
        });
    }
    b
}

#[inline(always)]
fn flipped(r: Range) -> Range {
    Range { lo: -r.hi, hi: -r.lo, slope_lo: -r.slope_hi, slope_hi: -r.slope_lo }
}

/// Bounds a parabola exactly: by its ends, and its vertex where that lies between.
#[inline(always)]
fn leaf_range(q: &RayQuadric, u0: F32x8, u1: F32x8) -> Range {
    let at = |u: F32x8| (q.a * u + q.b) * u + q.c;
    let (f0, f1) = (at(u0), at(u1));
    let (slope0, slope1) = ((q.a + q.a) * u0 + q.b, (q.a + q.a) * u1 + q.b);
    let turns = (-(slope0 * slope1)).above(F32x8::ZERO);
    let vertex = q.c - (q.b * q.b) / (q.a * F32x8::splat(4.0));
    let (mut lo, mut hi) = (f0.min(f1), f0.max(f1));
    lo = turns.pick(lo.min(vertex), lo);
    hi = turns.pick(hi.max(vertex), hi);
    let slope_error = (slope0.abs() + slope1.abs() + q.b.abs()) * F32x8::splat(ROUNDING);
    Range {
        lo: lo - q.error,
        hi: hi + q.error,
        slope_lo: slope0.min(slope1) - slope_error,
        slope_hi: slope0.max(slope1) + slope_error,
    }
}

#[inline(always)]
fn widened(r: Range) -> Range {
    let e = F32x8::splat(ROUNDING);
    Range {
        lo: r.lo - r.lo.abs() * e,
        hi: r.hi + r.hi.abs() * e,
        slope_lo: r.slope_lo - r.slope_lo.abs() * e,
        slope_hi: r.slope_hi + r.slope_hi.abs() * e,
    }
}

#[inline(always)]
fn square(lo: F32x8, hi: F32x8) -> (F32x8, F32x8) {
    let (a, b) = (lo * lo, hi * hi);
    let holds_zero = F32x8::ZERO.at_least(lo) & hi.at_least(F32x8::ZERO);
    (holds_zero.pick(F32x8::ZERO, a.min(b)), a.max(b))
}

#[inline(always)]
fn product(a_lo: F32x8, a_hi: F32x8, b_lo: F32x8, b_hi: F32x8) -> (F32x8, F32x8) {
    let (p, q, r, s) = (a_lo * b_lo, a_lo * b_hi, a_hi * b_lo, a_hi * b_hi);
    (p.min(q).min(r.min(s)), p.max(q).max(r.max(s)))
}

#[inline(always)]
fn scaled(r: Range, factor: f32) -> Range {
    let f = F32x8::splat(factor);
    if factor >= 0.0 {
        Range { lo: r.lo * f, hi: r.hi * f, slope_lo: r.slope_lo * f, slope_hi: r.slope_hi * f }
    } else {
        Range { lo: r.hi * f, hi: r.lo * f, slope_lo: r.slope_hi * f, slope_hi: r.slope_lo * f }
    }
}

#[inline(always)]
fn sum(a: Range, b: Range) -> Range {
    // The sum may cancel: allow for the rounding of its parts.
    let e = F32x8::splat(ROUNDING);
    let lost = (a.lo.abs().max(a.hi.abs()) + b.lo.abs().max(b.hi.abs())) * e;
    let slope_lost = (a.slope_lo.abs().max(a.slope_hi.abs()) + b.slope_lo.abs().max(b.slope_hi.abs())) * e;
    Range {
        lo: a.lo + b.lo - lost,
        hi: a.hi + b.hi + lost,
        slope_lo: a.slope_lo + b.slope_lo - slope_lost,
        slope_hi: a.slope_hi + b.slope_hi + slope_lost,
    }
}

#[inline(always)]
fn term_range(base: Range, q: Range, weight: f32, power: Power) -> Range {
    let (lo, hi) = (q.lo.max(F32x8::ZERO), q.hi.max(F32x8::ZERO));
    let (raised_lo, raised_hi, outer_lo, outer_hi) = match power {
        Power::Square => (lo * lo, hi * hi, lo + lo, hi + hi),
        Power::Cube => {
            let (l2, h2) = (lo * lo, hi * hi);
            (l2 * lo, h2 * hi, l2 * F32x8::splat(3.0), h2 * F32x8::splat(3.0))
        }
    };
    let (slope_lo, slope_hi) = product(outer_lo, outer_hi, q.slope_lo, q.slope_hi);
    sum(base, scaled(widened(Range { lo: raised_lo, hi: raised_hi, slope_lo, slope_hi }), weight))
}

#[inline(always)]
fn max_range(a: Range, b: Range) -> Range {
    // Where one is larger everywhere, the slope is its own; else either's.
    let (only_a, only_b) = (a.lo.above(b.hi), b.lo.above(a.hi));
    let lo = only_b.pick(b.slope_lo, only_a.pick(a.slope_lo, a.slope_lo.min(b.slope_lo)));
    let hi = only_b.pick(b.slope_hi, only_a.pick(a.slope_hi, a.slope_hi.max(b.slope_hi)));
    Range { lo: a.lo.max(b.lo), hi: a.hi.max(b.hi), slope_lo: lo, slope_hi: hi }
}

#[inline(always)]
fn smooth_range(a: Range, b: Range, k: f32) -> Range {
    let (gap_lo, gap_hi) = (a.lo - b.hi, a.hi - b.lo);
    let (n, f) = (gap_lo.abs().min(gap_hi.abs()), gap_lo.abs().max(gap_hi.abs()));
    let crossing = F32x8::ZERO.at_least(gap_lo) & gap_hi.at_least(F32x8::ZERO);
    let nearest = crossing.pick(F32x8::ZERO, n);
    let fillet = |gap: F32x8| {
        let overlap = (F32x8::splat(k) - gap).max(F32x8::ZERO);
        overlap * overlap * F32x8::splat(0.25 / k)
    };
    let top = max_range(a, b);
    // The slope is a mix of both slopes wherever the fillet reaches.
    let mixes = F32x8::splat(k).at_least(nearest);
    Range {
        lo: top.lo + fillet(f),
        hi: top.hi + fillet(nearest),
        slope_lo: mixes.pick(a.slope_lo.min(b.slope_lo), top.slope_lo),
        slope_hi: mixes.pick(a.slope_hi.max(b.slope_hi), top.slope_hi),
    }
}

const _: () = assert!(LANES == 8);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::{Program, tests::everything};
    use glam::DVec3;

    fn random(state: &mut u64) -> f64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }

    /// Casts rays through the figure that uses every step and compares with dense sampling in f64.
    #[test]
    fn first_roots_agree_with_dense_sampling() {
        let form = everything();
        let program = Program::new(&form);
        let mut stack = Stack::default();
        let mut state = 5;
        let (mut hits, mut wrong) = (0, 0);
        for _ in 0..24 {
            let mut point = || DVec3::new(random(&mut state), random(&mut state), random(&mut state));
            let rays: [(DVec3, DVec3); LANES] = std::array::from_fn(|_| {
                let origin = point().normalize_or(DVec3::X) * 3.0;
                (origin, (point() - origin).normalize_or(DVec3::X))
            });
            let leaves = crate::form::tests::along(&program, &rays, 3.0, 3.0);
            let (from, to) = (F32x8::splat(-3.0), F32x8::splat(3.0));
            let (hit, root) =
                first_roots(&program.steps, &leaves, from, to, Mask8::ALL, Crossing::Any, &mut stack);
            for (lane, &(o, d)) in rays.iter().enumerate() {
                let steps = 20_000;
                let at = |i: i32| form.value(o + d * (6.0 * f64::from(i) / f64::from(steps)));
                let first = (1..=steps)
                    .find(|&i| (at(i) >= 0.0) != (at(0) >= 0.0))
                    .map(|i| 6.0 * f64::from(i) / f64::from(steps));
                let found = hit.has(lane).then(|| 3.0 + f64::from(root.0[lane]));
                hits += usize::from(first.is_some());
                wrong += usize::from(match (first, found) {
                    (Some(a), Some(b)) => (a - b).abs() > 3e-4,
                    (None, None) => false,
                    _ => true,
                });
            }
        }
        assert!(hits > 60 && wrong == 0, "{wrong} wrong of {hits}");
    }
}
