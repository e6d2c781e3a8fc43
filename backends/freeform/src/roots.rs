//! Where does each ray of a packet first meet the zero surface of a form?
//!
//! Along a ray each quadric is a polynomial of second degree, taken around a point near the form (set up in
//! double precision), so that far eyes lose nothing. A stretch of the ray is excluded when the bounds of the
//! form over it, widened by the rounding error of their own evaluation, do not hold zero; it is searched when
//! the bounds of the derivative do not; else it is halved. So no root is missed except a pair closer than
//! [`FINEST`] of the stretch.

use crate::bundle::Crossing;
use crate::program::Step;
use polyptych_core::lanes::{F32x8, F64x8, LANES, Mask8};
use polyptych_core::scene::Power;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Eight numbers in single or double precision.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Shortest stretch that is still halved, as a share of the whole: about the resolution of the precision.
    const FINEST: f64;
    /// Rounding error of an operation with a little more.
    const ROUNDING: f64;
    const ZERO: Self;
    fn number(value: f64) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    fn above(self, other: Self) -> Mask8;
    fn at_least(self, other: Self) -> Mask8;
    fn pick(mask: Mask8, yes: Self, no: Self) -> Self;
}

macro_rules! number {
    ($lanes:ident, $finest:expr, $rounding:expr, $number:expr, $pick:expr) => {
        impl Number for $lanes {
            const FINEST: f64 = 1.0 / (1u64 << $finest) as f64;
            const ROUNDING: f64 = 1.0 / (1u64 << $rounding) as f64;
            const ZERO: Self = $lanes::ZERO;
            #[inline(always)]
            fn number(value: f64) -> Self {
                $number(value)
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                $lanes::min(self, other)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                $lanes::max(self, other)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $lanes::abs(self)
            }
            #[inline(always)]
            fn above(self, other: Self) -> Mask8 {
                $lanes::above(self, other)
            }
            #[inline(always)]
            fn at_least(self, other: Self) -> Mask8 {
                $lanes::at_least(self, other)
            }
            #[inline(always)]
            fn pick(mask: Mask8, yes: Self, no: Self) -> Self {
                $pick(mask, yes, no)
            }
        }
    };
}
number!(F32x8, 20, 22, |v| F32x8::splat(v as f32), |m: Mask8, yes, no| m.pick(yes, no));
number!(F64x8, 40, 51, F64x8::splat, F64x8::pick);

/// A quadric along eight rays: `a u^2 + b u + c`, with a bound on the rounding error over the whole stretch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayQuadric<N> {
    pub(crate) a: N,
    pub(crate) b: N,
    pub(crate) c: N,
    pub(crate) error: N,
}

/// Bounds of a function and its derivative over a stretch.
#[derive(Clone, Copy, Debug)]
struct Range<N> {
    lo: N,
    hi: N,
    slope_lo: N,
    slope_hi: N,
}

impl<N: Number> RayQuadric<N> {
    pub(crate) const ZERO: Self = Self { a: N::ZERO, b: N::ZERO, c: N::ZERO, error: N::ZERO };

    /// Tells where it is not zero up to `reach` from the points.
    #[inline(always)]
    pub(crate) fn is_nowhere_zero(&self, reach: N) -> Mask8 {
        let range = leaf_range(self, -reach, reach);
        range.lo.above(N::ZERO) | N::ZERO.above(range.hi)
    }

    /// Tells where it is nowhere positive up to `reach` from the points.
    #[inline(always)]
    pub(crate) fn is_nothing(&self, reach: N) -> Mask8 {
        let top = leaf_range(self, -reach, reach).hi;
        N::ZERO.at_least(top)
    }
}

impl<N: Number> Range<N> {
    const ZERO: Self = Self { lo: N::ZERO, hi: N::ZERO, slope_lo: N::ZERO, slope_hi: N::ZERO };
}

/// Scratch memory of one worker.
pub(crate) struct Stack<N> {
    ranges: Vec<Range<N>>,
    values: Vec<(N, N)>,
}

impl<N> Default for Stack<N> {
    fn default() -> Self {
        Self { ranges: Vec::new(), values: Vec::new() }
    }
}

/// Finds the first root of each active ray in `[from, to]`. Returns which rays have one, and where.
#[inline(always)]
pub(crate) fn first_roots<N: Number>(
    steps: &[Step],
    leaves: &[RayQuadric<N>],
    from: N,
    to: N,
    active: Mask8,
    crossing: Crossing,
    stack: &mut Stack<N>,
) -> (Mask8, N) {
    let half = N::number(0.5);
    let shortest = (to - from) * N::number(N::FINEST);
    let mut begin = from;
    let mut length = to - from;
    let mut open = active & to.at_least(from);
    let (mut hit, mut root) = (Mask8::NONE, N::ZERO);
    while open.any() {
        let end = (begin + length).min(to);
        let range = bound(steps, leaves, begin, end, &mut stack.ranges);
        let excluded = (range.lo.above(N::ZERO) | (-range.hi).above(N::ZERO)) & open;
        let monotone = range.slope_lo.above(N::ZERO) | (-range.slope_hi).above(N::ZERO);
        let tiny = shortest.at_least(length);
        let search = (monotone | tiny) & open & !excluded;
        let mut passed = excluded;
        if search.any() {
            let (at_begin, _) = value(steps, leaves, begin, &mut stack.values);
            let (at_end, _) = value(steps, leaves, end, &mut stack.values);
            let inside = at_begin.at_least(N::ZERO);
            let ends_inside = at_end.at_least(N::ZERO);
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
                root = N::pick(found, refined, root);
                hit = hit | found;
                open = open & !found;
            }
            passed = passed | (search & !change);
        }
        open = open & !(passed & end.at_least(to));
        begin = N::pick(passed, end, begin);
        length = N::pick(passed, length + length, length * half);
    }
    (hit, root)
}

/// Most steps towards a root: halving alone resolves a bracket with about as many. Few take more than four.
const HALVINGS: usize = 48;

/// Closes in on a root by Newton's method, by bisection where a step would leave the bracket or is no shorter than half
/// of the one before.
#[inline(always)]
fn refine<N: Number>(
    steps: &[Step],
    leaves: &[RayQuadric<N>],
    mut lo: N,
    mut hi: N,
    wanted: Mask8,
    inside_at_lo: Mask8,
    values: &mut Vec<(N, N)>,
) -> N {
    let half = N::number(0.5);
    // The next step of Newton's method squares what is left of a share of the bracket; less than rounding means nothing.
    let close = ((hi - lo) * N::number(1e-4)).max((lo.abs() + hi.abs()) * N::number(4.0 * N::ROUNDING));
    let (mut u, mut last) = ((lo + hi) * half, hi - lo);
    for _ in 0..HALVINGS {
        let (f, slope) = value(steps, leaves, u, values);
        let inside = f.at_least(N::ZERO);
        let same = (inside & inside_at_lo) | (!inside & !inside_at_lo);
        lo = N::pick(same, u, lo);
        hi = N::pick(same, hi, u);
        let newton = u - f / slope;
        let within = newton.at_least(lo) & hi.at_least(newton);
        // Steps that do not shrink may go to and fro for ever, around a turn of the function.
        let shrinks = (last * half).at_least((newton - u).abs());
        let next = N::pick(within & shrinks, newton, (lo + hi) * half);
        last = (next - u).abs();
        let moved = last.above(close) & wanted;
        u = next;
        if !moved.any() {
            break;
        }
    }
    u
}

/// Evaluates the form and its derivative along the rays.
#[inline(always)]
fn value<N: Number>(steps: &[Step], leaves: &[RayQuadric<N>], u: N, stack: &mut Vec<(N, N)>) -> (N, N) {
    let quadric = |leaf: u32| {
        let q = &leaves[leaf as usize];
        ((q.a * u + q.b) * u + q.c, (q.a + q.a) * u + q.b)
    };
    let number = N::number;
    stack.clear();
    // The top of the stack.
    let (mut b, mut db) = (N::number(-1.0), N::ZERO);
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
                (N::pick(first, a, b), N::pick(first, da, db))
            }
            Step::Min => {
                let first = b.at_least(a);
                (N::pick(first, a, b), N::pick(first, da, db))
            }
            Step::Smooth(k) => {
                let first = a.at_least(b);
                let (top, low) = (N::pick(first, a, b), N::pick(first, b, a));
                let (dtop, dlow) = (N::pick(first, da, db), N::pick(first, db, da));
                let overlap = (number(k) - (top - low)).max(N::ZERO);
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
fn raised<N: Number>((q, dq): (N, N), weight: f64, power: Power) -> (N, N) {
    let (q, w) = (q.max(N::ZERO), N::number(weight));
    match power {
        Power::Square => (w * (q * q), w * (q + q) * dq),
        Power::Cube => {
            let q2 = q * q;
            (w * (q2 * q), w * (N::number(3.0) * q2) * dq)
        }
    }
}

/// Bounds the form and its derivative over `[u0, u1]`.
#[inline(always)]
fn bound<N: Number>(
    steps: &[Step],
    leaves: &[RayQuadric<N>],
    u0: N,
    u1: N,
    stack: &mut Vec<Range<N>>,
) -> Range<N> {
    stack.clear();
    // The top of the stack.
    let mut b = Range { lo: N::number(-1.0), hi: N::number(-1.0), ..Range::ZERO };
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
                if q.hi.above(N::ZERO).any() {
                    b = widened(term_range(b, q, weight, power));
                }
                continue;
            }
            Step::Neg => {
                b = flipped(b);
                continue;
            }
            Step::Add(c) => {
                let c = N::number(c);
                b = widened(Range { lo: b.lo + c, hi: b.hi + c, ..b });
                continue;
            }
            _ => {}
        }
        let Some(a) = stack.pop() else { break };
        b = widened(match step {
            Step::Term { weight, power } => term_range(a, b, weight, power),
            Step::Max => max_range(a, b),
            Step::Min => flipped(max_range(flipped(a), flipped(b))),
            Step::Smooth(k) => smooth_range(a, b, k),
            Step::Mix(t) => sum(scaled(a, 1.0 - t), scaled(b, t)),
            Step::Torus(ring) => {
                let (s_lo, s_hi) = square(b.lo, b.hi);
                let (p_lo, p_hi) = product(b.lo, b.hi, b.slope_lo, b.slope_hi);
                let two = N::number(-2.0);
                let minus = Range { lo: -s_hi, hi: -s_lo, slope_lo: p_hi * two, slope_hi: p_lo * two };
                sum(scaled(a, ring), minus)
            }
            Step::Leaf(_) | Step::Bump { .. } | Step::Neg | Step::Add(_) => b,
        });
    }
    b
}

#[inline(always)]
fn flipped<N: Number>(r: Range<N>) -> Range<N> {
    Range { lo: -r.hi, hi: -r.lo, slope_lo: -r.slope_hi, slope_hi: -r.slope_lo }
}

/// Bounds a parabola exactly: by its ends, and its vertex where that lies between.
#[inline(always)]
fn leaf_range<N: Number>(q: &RayQuadric<N>, u0: N, u1: N) -> Range<N> {
    let at = |u: N| (q.a * u + q.b) * u + q.c;
    let (f0, f1) = (at(u0), at(u1));
    let (slope0, slope1) = ((q.a + q.a) * u0 + q.b, (q.a + q.a) * u1 + q.b);
    let turns = (-(slope0 * slope1)).above(N::ZERO);
    let vertex = q.c - (q.b * q.b) / (q.a * N::number(4.0));
    let (mut lo, mut hi) = (f0.min(f1), f0.max(f1));
    lo = N::pick(turns, lo.min(vertex), lo);
    hi = N::pick(turns, hi.max(vertex), hi);
    let slope_error = (slope0.abs() + slope1.abs() + q.b.abs()) * N::number(N::ROUNDING);
    Range {
        lo: lo - q.error,
        hi: hi + q.error,
        slope_lo: slope0.min(slope1) - slope_error,
        slope_hi: slope0.max(slope1) + slope_error,
    }
}

#[inline(always)]
fn widened<N: Number>(r: Range<N>) -> Range<N> {
    let e = N::number(N::ROUNDING);
    Range {
        lo: r.lo - r.lo.abs() * e,
        hi: r.hi + r.hi.abs() * e,
        slope_lo: r.slope_lo - r.slope_lo.abs() * e,
        slope_hi: r.slope_hi + r.slope_hi.abs() * e,
    }
}

#[inline(always)]
fn square<N: Number>(lo: N, hi: N) -> (N, N) {
    let (a, b) = (lo * lo, hi * hi);
    let holds_zero = N::ZERO.at_least(lo) & hi.at_least(N::ZERO);
    (N::pick(holds_zero, N::ZERO, a.min(b)), a.max(b))
}

#[inline(always)]
fn product<N: Number>(a_lo: N, a_hi: N, b_lo: N, b_hi: N) -> (N, N) {
    let (p, q, r, s) = (a_lo * b_lo, a_lo * b_hi, a_hi * b_lo, a_hi * b_hi);
    (p.min(q).min(r.min(s)), p.max(q).max(r.max(s)))
}

#[inline(always)]
fn scaled<N: Number>(r: Range<N>, factor: f64) -> Range<N> {
    let f = N::number(factor);
    if factor >= 0.0 {
        Range { lo: r.lo * f, hi: r.hi * f, slope_lo: r.slope_lo * f, slope_hi: r.slope_hi * f }
    } else {
        Range { lo: r.hi * f, hi: r.lo * f, slope_lo: r.slope_hi * f, slope_hi: r.slope_lo * f }
    }
}

#[inline(always)]
fn sum<N: Number>(a: Range<N>, b: Range<N>) -> Range<N> {
    // The sum may cancel: allow for the rounding of its parts.
    let e = N::number(N::ROUNDING);
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
fn term_range<N: Number>(base: Range<N>, q: Range<N>, weight: f64, power: Power) -> Range<N> {
    let (lo, hi) = (q.lo.max(N::ZERO), q.hi.max(N::ZERO));
    let (raised_lo, raised_hi, outer_lo, outer_hi) = match power {
        Power::Square => (lo * lo, hi * hi, lo + lo, hi + hi),
        Power::Cube => {
            let (l2, h2) = (lo * lo, hi * hi);
            (l2 * lo, h2 * hi, l2 * N::number(3.0), h2 * N::number(3.0))
        }
    };
    let (slope_lo, slope_hi) = product(outer_lo, outer_hi, q.slope_lo, q.slope_hi);
    sum(base, scaled(widened(Range { lo: raised_lo, hi: raised_hi, slope_lo, slope_hi }), weight))
}

#[inline(always)]
fn max_range<N: Number>(a: Range<N>, b: Range<N>) -> Range<N> {
    // Where one is larger everywhere, the slope is its own; else either's.
    let (only_a, only_b) = (a.lo.above(b.hi), b.lo.above(a.hi));
    let lo = N::pick(only_b, b.slope_lo, N::pick(only_a, a.slope_lo, a.slope_lo.min(b.slope_lo)));
    let hi = N::pick(only_b, b.slope_hi, N::pick(only_a, a.slope_hi, a.slope_hi.max(b.slope_hi)));
    Range { lo: a.lo.max(b.lo), hi: a.hi.max(b.hi), slope_lo: lo, slope_hi: hi }
}

#[inline(always)]
fn smooth_range<N: Number>(a: Range<N>, b: Range<N>, k: f64) -> Range<N> {
    let (gap_lo, gap_hi) = (a.lo - b.hi, a.hi - b.lo);
    let (n, f) = (gap_lo.abs().min(gap_hi.abs()), gap_lo.abs().max(gap_hi.abs()));
    let crossing = N::ZERO.at_least(gap_lo) & gap_hi.at_least(N::ZERO);
    let nearest = N::pick(crossing, N::ZERO, n);
    let fillet = |gap: N| {
        let overlap = (N::number(k) - gap).max(N::ZERO);
        overlap * overlap * N::number(0.25 / k)
    };
    let top = max_range(a, b);
    // The slope is a mix of both slopes wherever the fillet reaches.
    let mixes = N::number(k).at_least(nearest);
    Range {
        lo: top.lo + fillet(f),
        hi: top.hi + fillet(nearest),
        slope_lo: N::pick(mixes, a.slope_lo.min(b.slope_lo), top.slope_lo),
        slope_hi: N::pick(mixes, a.slope_hi.max(b.slope_hi), top.slope_hi),
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

    /// Bounds the figure that uses every step over a million random stretches of rays and looks into them.
    #[test]
    fn bounds_hold_the_values_in_double_precision() {
        let form = everything();
        let program = Program::new(&form);
        let mut ranges = Vec::new();
        let mut state = 5;
        let (mut outside, mut narrow) = (0, 0);
        for _ in 0..15_625 {
            let mut number = || random(&mut state);
            let middle = DVec3::new(number(), number(), number()) * 1.5;
            let size = 0.02 + number().abs();
            let rays: [(DVec3, DVec3); LANES] = std::array::from_fn(|_| {
                let mut point = || DVec3::new(number(), number(), number());
                let (near, toward) = (middle + point() * (size * 0.3), point().normalize_or(DVec3::X));
                (near - toward * 3.0, toward)
            });
            let reach = size * 0.4;
            let leaves = crate::form::tests::along(&program, &rays, (3.0, reach), (middle, size.max(0.3)));
            let (from, to) = (number() * reach, number() * reach);
            let (from, to) = (from.min(to) as f32, from.max(to) as f32);
            let ends = (F32x8::splat(from), F32x8::splat(to));
            let range = bound(&program.steps, &leaves, ends.0, ends.1, &mut ranges);
            for (lane, &(o, d)) in rays.iter().enumerate() {
                narrow += i32::from(range.hi.0[lane] - range.lo.0[lane] < 0.1);
                for _ in 0..8 {
                    let share = 0.5 + 0.5 * number();
                    let u = f64::from(from) + (f64::from(to) - f64::from(from)) * share;
                    let value = form.value(o + d * (3.0 + u));
                    let held = f64::from(range.lo.0[lane]) <= value && value <= f64::from(range.hi.0[lane]);
                    outside += i32::from(!held);
                }
            }
        }
        assert_eq!(outside, 0, "of a million values");
        assert!(narrow > 5000, "bounds that mean something: {narrow}");
    }
}
