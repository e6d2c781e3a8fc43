//! Where does a ray cross the zero surface of a free form, with no crossing missed?
//!
//! Interval bisection along the ray (after D. P. Mitchell, *Robust ray intersection with interval arithmetic*,
//! Graphics Interface 1990): a stretch is dropped when bounds of the function exclude zero, solved when bounds
//! of the slope do, and halved otherwise. On a stretch every second-order leaf is a parabola around the
//! stretch's middle, whose range is exact. All bounds are widened by their rounding error.
//!
//! **Accuracy**: a pair of crossings closer together than 1e-12 of the ray's way through the bounds may be
//! taken for a touch, and touches are no crossings. The ray is measured from the middle of that way, so that
//! far eyes cost no digits.

use crate::line::{Hit, Line, Span};
use crate::roots::bracketed_root;
use glam::DVec3;
use polyptych_core::math::{Aabb, Interval};
use polyptych_core::scene::{Form, FreeForm, Power, Quadric};

/// Stretches shorter than this share of the whole are not halved any further.
const SHORTEST: f64 = 1e-12;
/// After so many stretches without an end the shortest grows: only forms that vanish on whole stretches of a
/// ray come here (a double plane seen edge-on), and there a crossing means nothing.
const PATIENCE: u32 = 20_000;
const STACK: usize = 128;

/// Bounds the rounding of one operation with room to spare.
const ROUND: f64 = 2.0 * f64::EPSILON;

/// A form made ready for evaluation along rays.
#[derive(Debug)]
pub(crate) struct Solid {
    function: Function,
    bounds: Aabb,
}

/// A [`Form`] with what can be computed once.
#[derive(Debug)]
pub(crate) enum Function {
    Quadric(Quadric),
    Ellipsoid { center: DVec3, inverse: DVec3 },
    HalfSpace { normal: DVec3, offset: f64 },
    Cylinder { center: DVec3, axis: DVec3, radius: f64 },
    Torus { major: f64, minor: f64 },
    Perturbed { base: Box<Self>, terms: Vec<(f64, Power, Self)> },
    Max(Vec<Self>),
    Min(Vec<Self>),
    Minus(Box<Self>),
    Smooth { a: Box<Self>, b: Box<Self>, k: f64 },
    Offset(Box<Self>, f64),
    Morph { from: Box<Self>, to: Box<Self>, t: f64 },
}

/// A function on a stretch: bounds of its value and slope, and its value in the middle with a bound on the
/// rounding of that.
#[derive(Clone, Copy, Debug)]
struct Jet {
    value: Interval,
    slope: Interval,
    middle: f64,
    error: f64,
}

/// `c + b s + a s^2`, and the size of the sums that `c` and `b` came from.
struct Parabola {
    a: f64,
    b: f64,
    c: f64,
    size: f64,
    steepness: f64,
}

impl Solid {
    pub(crate) fn new(form: &FreeForm) -> Self {
        // Surfaces that lie in the faces of the bounds must be well inside.
        let bounds = form.bounds();
        Self { function: Function::new(form.form()), bounds: bounds.grown(bounds.radius() * 1e-6) }
    }

    pub(crate) fn first(
        &self,
        form: &FreeForm,
        line: &Line,
        span: &Span,
        accept: &mut impl FnMut(&Hit) -> bool,
    ) -> Option<Hit> {
        let mut found = None;
        let mut part = 0;
        self.crossings(line, span.before, &mut |t, p| {
            let hit = Hit::plain(t, part, DVec3::ZERO);
            part += 1;
            if span.holds(t, hit.part) {
                let hit = Hit { normal: -form.form().value_and_gradient(p).1, ..hit };
                if accept(&hit) {
                    found = Some(hit);
                }
            }
            found.is_none() && t < span.before
        });
        found
    }

    /// Tells whether a point is inside.
    pub(crate) fn contains(&self, point: DVec3) -> bool {
        self.function.on(point, DVec3::ZERO, 0.0).middle >= 0.0
    }

    /// Calls `visit` with distance and place of every crossing before a distance, in order, while it returns
    /// true.
    pub(crate) fn crossings(&self, line: &Line, before: f64, visit: &mut impl FnMut(f64, DVec3) -> bool) {
        let Some((near, far)) = self.bounds.clip(line.origin, line.direction) else { return };
        if !(near <= before && (far - near).is_finite()) {
            return;
        }
        let middle = near * 0.5 + far * 0.5;
        let local = Line { origin: line.at(middle), ..*line };
        let half = (far - near) * 0.5;
        self.isolate(&local, -half, half, &mut |s| visit(middle + s, local.at(s)));
    }

    fn isolate(&self, line: &Line, from: f64, to: f64, visit: &mut impl FnMut(f64) -> bool) {
        let on = |a: f64, b: f64| self.function.on(line.at(a * 0.5 + b * 0.5), line.direction, (b - a) * 0.5);
        let at = |s: f64| self.function.on(line.at(s), line.direction, 0.0);
        let changes = |a: f64, b: f64| (at(a).middle >= 0.0) != (at(b).middle >= 0.0);
        let solve = |a: f64, b: f64| {
            bracketed_root(a, b, |s| {
                let jet = at(s);
                (jet.middle, (jet.slope.lo + jet.slope.hi) * 0.5)
            })
        };
        let mut shortest = SHORTEST * (to - from);
        let mut stack = [(0.0, 0.0); STACK];
        stack[0] = (from, to);
        let (mut height, mut count) = (1, 0u32);
        while height > 0 {
            height -= 1;
            count += 1;
            if count > PATIENCE && count.is_multiple_of(64) {
                shortest *= 2.0;
            }
            let (a, b) = stack[height];
            let jet = on(a, b);
            if jet.value.lo > 0.0 || jet.value.hi < 0.0 {
                continue;
            }
            let monotone = jet.slope.lo > 0.0 || jet.slope.hi < 0.0;
            if monotone || b - a <= shortest || height + 2 > STACK {
                if changes(a, b) && !visit(solve(a, b)) {
                    return;
                }
                continue;
            }
            let middle = a * 0.5 + b * 0.5;
            stack[height] = (middle, b);
            stack[height + 1] = (a, middle);
            height += 2;
        }
    }
}

impl Function {
    fn new(form: &Form) -> Self {
        let boxed = |f: &Form| Box::new(Self::new(f));
        let all = |parts: &[Form]| parts.iter().map(Self::new).collect();
        match form {
            Form::Quadric(q) => Self::Quadric(*q),
            Form::Ellipsoid { center, radii } => Self::Ellipsoid { center: *center, inverse: radii.recip() },
            Form::HalfSpace { normal, offset } => Self::HalfSpace { normal: *normal, offset: *offset },
            Form::Cylinder { center, axis, radius } => {
                Self::Cylinder { center: *center, axis: axis.normalize_or(DVec3::Y), radius: *radius }
            }
            Form::Torus { major, minor } => Self::Torus { major: *major, minor: *minor },
            Form::Perturbed { base, terms } => Self::Perturbed {
                base: boxed(base),
                terms: terms.iter().map(|t| (t.weight, t.power, Self::new(&t.function))).collect(),
            },
            Form::Union(parts) => Self::Max(all(parts)),
            Form::Intersection(parts) => Self::Min(all(parts)),
            Form::Difference(a, b) => Self::Min(vec![Self::new(a), Self::Minus(boxed(b))]),
            Form::SmoothUnion { a, b, k } if *k > 0.0 => Self::Smooth { a: boxed(a), b: boxed(b), k: *k },
            Form::SmoothUnion { a, b, .. } => Self::Max(vec![Self::new(a), Self::new(b)]),
            Form::Offset { form, amount } => Self::Offset(boxed(form), *amount),
            Form::Morph { from, to, t } => Self::Morph { from: boxed(from), to: boxed(to), t: *t },
        }
    }

    /// Bounds the function at `p + s d` for `|s| <= h`.
    fn on(&self, p: DVec3, d: DVec3, h: f64) -> Jet {
        match self {
            Self::Torus { major, minor } => torus(*major, *minor, p, d, h),
            Self::Perturbed { base, terms } => {
                terms.iter().fold(base.on(p, d, h), |sum, (weight, power, function)| {
                    sum.plus(function.on(p, d, h).raised(*power).times(*weight))
                })
            }
            Self::Max(parts) => {
                parts.iter().map(|f| f.on(p, d, h)).reduce(Jet::max).unwrap_or(Jet::point(f64::NEG_INFINITY))
            }
            Self::Min(parts) => {
                let least = parts.iter().map(|f| f.on(p, d, h).negated()).reduce(Jet::max);
                least.map_or(Jet::point(f64::INFINITY), Jet::negated)
            }
            Self::Minus(f) => f.on(p, d, h).negated(),
            Self::Smooth { a, b, k } => a.on(p, d, h).smooth_max(b.on(p, d, h), *k),
            Self::Offset(f, amount) => f.on(p, d, h).plus(Jet::point(*amount)),
            Self::Morph { from, to, t } => from.on(p, d, h).times(1.0 - t).plus(to.on(p, d, h).times(*t)),
            Self::Quadric(_) | Self::Ellipsoid { .. } | Self::HalfSpace { .. } | Self::Cylinder { .. } => {
                self.parabola(p, d).on(h)
            }
        }
        .sharpened(h)
    }

    /// Reduces a second-order leaf to its parabola along a line.
    fn parabola(&self, p: DVec3, d: DVec3) -> Parabola {
        match *self {
            Self::Ellipsoid { center, inverse } => {
                let (q, e) = ((p - center) * inverse, d * inverse);
                let size = 1.0 + 2.0 * ((p.abs() + center.abs()) * inverse.abs()).dot(q.abs());
                let qq = q.length_squared();
                Parabola {
                    a: -e.length_squared(),
                    b: -2.0 * q.dot(e),
                    c: 1.0 - qq,
                    size: size + qq,
                    steepness: 2.0 * ((p.abs() + center.abs()) * inverse.abs()).dot(e.abs()),
                }
            }
            Self::HalfSpace { normal, offset } => Parabola {
                a: 0.0,
                b: -normal.dot(d),
                c: offset - normal.dot(p),
                size: offset.abs() + normal.abs().dot(p.abs()),
                steepness: normal.abs().dot(d.abs()),
            },
            Self::Cylinder { center, axis, radius } => {
                let flat = |v: DVec3| v - axis * v.dot(axis);
                let (q, e) = (flat(p - center), flat(d));
                let reach = (p.abs() + center.abs()).length();
                Parabola {
                    a: -e.length_squared(),
                    b: -2.0 * q.dot(e),
                    c: radius * radius - q.length_squared(),
                    size: radius * radius + 4.0 * reach * (q.length() + reach * f64::EPSILON),
                    steepness: 8.0 * reach * d.length(),
                }
            }
            Self::Quadric(quadric) => {
                let [a, b, c, e, f, g, ..] = quadric.0;
                let [l, m, n, k] = [quadric.0[6], quadric.0[7], quadric.0[8], quadric.0[9]];
                let size = Quadric([a, b, c, e, f, g, l, m, n, k].map(f64::abs));
                Parabola {
                    a: d.x * (a * d.x + e * d.y + f * d.z) + d.y * (b * d.y + g * d.z) + c * d.z * d.z,
                    b: quadric.gradient(p).dot(d),
                    c: quadric.value(p),
                    size: size.value(p.abs()),
                    steepness: size.gradient(p.abs()).dot(d.abs()),
                }
            }
            _ => Parabola { a: 0.0, b: 0.0, c: 0.0, size: 0.0, steepness: 0.0 },
        }
    }
}

impl Parabola {
    fn on(&self, h: f64) -> Jet {
        let Self { a, b, c, .. } = *self;
        let (bend, tilt) = (a * h * h, b * h);
        let (mut lo, mut hi) = ((bend - tilt).min(bend + tilt), (bend - tilt).max(bend + tilt));
        // The turn lies at -b / 2a.
        if b.abs() <= 2.0 * a.abs() * h && a != 0.0 {
            let turn = -b * b / (4.0 * a);
            (lo, hi) = (lo.min(turn), hi.max(turn));
        }
        let slack = 16.0 * f64::EPSILON * (self.size + bend.abs() + tilt.abs());
        let steep = 2.0 * a.abs() * h + 16.0 * f64::EPSILON * (self.steepness + a.abs() * h);
        Jet {
            value: Interval { lo: c + lo - slack, hi: c + hi + slack },
            slope: Interval { lo: b - steep, hi: b + steep },
            middle: c,
            error: slack,
        }
    }
}

/// `4 R^2 (x^2 + z^2) - (|p|^2 + R^2 - r^2)^2`, each square a parabola.
fn torus(major: f64, minor: f64, p: DVec3, d: DVec3, h: f64) -> Jet {
    let (flat_p, flat_d) = (DVec3::new(p.x, 0.0, p.z), DVec3::new(d.x, 0.0, d.z));
    let parabola = |p: DVec3, d: DVec3, c: f64| Parabola {
        a: d.length_squared(),
        b: 2.0 * p.dot(d),
        c: p.length_squared() + c,
        size: p.length_squared() + c.abs() + major * major,
        steepness: 2.0 * p.abs().dot(d.abs()),
    };
    let flat = parabola(flat_p, flat_d, 0.0).on(h);
    let sum = parabola(p, d, (major - minor) * (major + minor)).on(h);
    let square = Jet {
        value: sum.value.square(),
        slope: sum.value * sum.slope * 2.0,
        middle: sum.middle * sum.middle,
        error: greatest(sum.value) * sum.error * 3.0,
    };
    flat.times(4.0 * major * major).plus(square.negated())
}

fn greatest(of: Interval) -> f64 {
    of.lo.abs().max(of.hi.abs())
}

impl Jet {
    fn point(value: f64) -> Self {
        Self { value: Interval::point(value), slope: Interval::point(0.0), middle: value, error: 0.0 }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            slope: self.slope + other.slope,
            middle: self.middle + other.middle,
            error: self.error + other.error + ROUND * (self.middle.abs() + other.middle.abs()),
        }
    }

    fn times(self, factor: f64) -> Self {
        let middle = self.middle * factor;
        let error = self.error * factor.abs() + ROUND * middle.abs();
        Self { value: self.value * factor, slope: self.slope * factor, middle, error }
    }

    fn negated(self) -> Self {
        Self { value: -self.value, slope: -self.slope, middle: -self.middle, error: self.error }
    }

    fn raised(self, power: Power) -> Self {
        let q = self.value.positive_part();
        let (middle, top) = (power.apply(self.middle).0, q.hi + self.error);
        let error = self.error * power.apply(top).1 + 2.0 * ROUND * middle;
        match power {
            Power::Square => Self { value: q.square(), slope: q * self.slope * 2.0, middle, error },
            Power::Cube => {
                Self { value: q.square() * q, slope: q.square() * self.slope * 3.0, middle, error }
            }
        }
    }

    fn max(self, other: Self) -> Self {
        let slope = if self.value.lo > other.value.hi {
            self.slope
        } else if other.value.lo > self.value.hi {
            other.slope
        } else {
            self.slope.hull(other.slope)
        };
        Self {
            value: self.value.max(other.value),
            slope,
            middle: self.middle.max(other.middle),
            error: self.error.max(other.error),
        }
    }

    fn smooth_max(self, other: Self, k: f64) -> Self {
        let gap = self.value - other.value;
        let nearest = if gap.contains(0.0) { 0.0 } else { gap.lo.abs().min(gap.hi.abs()) };
        let farthest = gap.lo.abs().max(gap.hi.abs());
        let fillet = |gap: f64| (k - gap).max(0.0).powi(2) / (4.0 * k);
        // The share of the first function rises from 0 to 1 while the gap runs from -k to k.
        let share = |gap: f64| (0.5 + gap / (2.0 * k)).clamp(0.0, 1.0);
        let shares = Interval { lo: share(gap.lo), hi: share(gap.hi) };
        let rest = Interval { lo: 1.0 - shares.hi, hi: 1.0 - shares.lo };
        Self {
            value: self.value.max(other.value) + Interval { lo: fillet(farthest), hi: fillet(nearest) },
            slope: self.slope * shares + other.slope * rest,
            middle: self.middle.max(other.middle) + fillet((self.middle - other.middle).abs()),
            error: self.error + other.error + 8.0 * ROUND * (self.middle.abs() + other.middle.abs() + k),
        }
    }

    /// Tightens the value by the mean value theorem: it is no further from the middle than the slope allows.
    fn sharpened(self, h: f64) -> Self {
        let reach = self.slope.lo.abs().max(self.slope.hi.abs()) * h;
        let reach = reach * (1.0 + 8.0 * ROUND) + self.error + ROUND * self.middle.abs();
        let (lo, hi) = (self.middle - reach, self.middle + reach);
        if h > 0.0 && lo <= hi {
            let value = Interval { lo: self.value.lo.max(lo), hi: self.value.hi.min(hi) };
            return Self { value, ..self };
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line::Start;
    use polyptych_core::scene::Perturbation;

    fn random(state: &mut u64) -> f64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }

    fn ball(center: [f64; 3], radius: f64) -> Form {
        Form::Ellipsoid { center: center.into(), radii: DVec3::splat(radius) }
    }

    /// A figure with every operation.
    fn everything() -> Form {
        let bump = Perturbation { weight: 0.9, power: Power::Cube, function: ball([0.8, 0.1, -0.2], 0.5) };
        let dent = Perturbation {
            weight: -0.7,
            power: Power::Square,
            function: Form::Perturbed {
                base: Box::new(ball([-0.6, 0.3, 0.5], 0.5)),
                terms: vec![bump.clone()],
            },
        };
        let bent = Form::Perturbed { base: Box::new(ball([0.0; 3], 1.0)), terms: vec![bump, dent] };
        let rod = Form::Cylinder { center: DVec3::ZERO, axis: DVec3::new(1.0, 1.0, 0.3), radius: 0.3 };
        let quadric = Quadric([-1.0, -2.0, -1.5, 0.3, 0.1, -0.2, 0.4, 0.0, 0.1, 0.8]);
        Form::Union(vec![
            Form::SmoothUnion {
                a: Box::new(bent),
                b: Box::new(Form::Torus { major: 1.3, minor: 0.2 }),
                k: 0.3,
            },
            Form::Difference(
                Box::new(Form::Intersection(vec![rod, ball([0.0; 3], 1.6)])),
                Box::new(Form::HalfSpace { normal: DVec3::Y, offset: 0.1 }),
            ),
            Form::Morph {
                from: Box::new(Form::Offset { form: Box::new(Form::Quadric(quadric)), amount: -0.3 }),
                to: Box::new(ball([1.2, 0.0, 0.0], 0.3)),
                t: 0.4,
            },
        ])
    }

    #[test]
    fn bounds_on_stretches_contain_values_and_slopes() {
        let form = everything();
        let function = Function::new(&form);
        let mut s = 31;
        let mut v = |k: f64| DVec3::new(random(&mut s), random(&mut s), random(&mut s)) * k;
        for _ in 0..4000 {
            let (p, d) = (v(1.6), v(1.0));
            let h = v(1.0).x.abs().powi(3);
            let jet = function.on(p, d, h);
            for i in -10..=10 {
                let x = p + d * (h * f64::from(i) / 10.0);
                let (value, gradient) = form.value_and_gradient(x);
                assert!(jet.value.lo <= value && value <= jet.value.hi, "{value} outside of {jet:?}");
                let slope = gradient.dot(d);
                let slack = 1e-9;
                assert!(jet.slope.lo - slack <= slope && slope <= jet.slope.hi + slack, "{slope}: {jet:?}");
            }
            assert!((function.on(p, d, 0.0).middle - form.value(p)).abs() < 1e-12);
        }
    }

    #[test]
    fn no_first_root_is_missed_against_dense_sampling() {
        let form = FreeForm::new(everything()).unwrap();
        let solid = Solid::new(&form);
        let mut s = 77;
        let (mut hits, mut close) = (0, 0);
        for _ in 0..3000 {
            let mut v = || DVec3::new(random(&mut s), random(&mut s), random(&mut s));
            let origin = v().normalize_or(DVec3::X) * 4.0;
            let direction = (v() * 1.2 - origin).normalize_or(DVec3::X);
            let line = Line { origin, direction, start: Start::Eye };
            let found = solid.first(&form, &line, &Span::WHOLE, &mut |_| true).map(|h| h.t);
            // Sampling sees sign changes more than a step apart.
            let step = 1e-3;
            let sampled =
                (0..8000).map(|i| f64::from(i) * step).find(|&t| form.form().value(line.at(t)) >= 0.0);
            match (found, sampled) {
                (Some(t), Some(beyond)) => {
                    assert!(t <= beyond, "missed: {t} after {beyond} for {line:?}");
                    if t < beyond - step {
                        // Something thinner than a step: it must be real.
                        assert!(form.form().value(line.at(t + 1e-9)).abs() < 1e-6);
                        close += 1;
                    }
                    let value = form.form().value(line.at(t));
                    assert!(value.abs() < 1e-12, "{value} is not on the surface");
                    hits += 1;
                }
                (None, None) => {}
                (Some(t), None) => {
                    assert!(form.form().value(line.at(t)).abs() < 1e-12);
                    close += 1;
                }
                (None, Some(t)) => panic!("missed the solid at {t}: {line:?}"),
            }
        }
        assert!(hits > 1500 && close < 30, "{hits} hits, {close} thinner than a step");
    }

    #[test]
    fn close_pairs_are_found_down_to_the_stated_distance() {
        // Grazing a ball: the two crossings are 2 sqrt(1 - y^2) apart.
        let form = FreeForm::new(ball([0.0; 3], 1.0)).unwrap();
        let solid = Solid::new(&form);
        for k in 1..=6 {
            let gap = 10f64.powi(-k);
            let y = (1.0 - gap * gap / 4.0).sqrt();
            let line = Line { origin: DVec3::new(-5.0, y, 0.0), direction: DVec3::X, start: Start::Eye };
            let mut places = Vec::new();
            solid.crossings(&line, f64::INFINITY, &mut |t, _| {
                places.push(t);
                true
            });
            assert_eq!(places.len(), 2, "gap {gap}");
            assert!(((places[1] - places[0]) / gap - 1.0).abs() < 1e-3 * 10f64.powi(k - 4).max(1.0), "{gap}");
        }
    }

    #[test]
    fn forms_that_vanish_along_a_ray_come_to_an_end() {
        let plane = Quadric([0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let cut = Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0));
        let form = FreeForm::within(Form::Quadric(plane), cut).unwrap();
        let solid = Solid::new(&form);
        for y in [0.0, 1e-9, -1e-17, 0.3] {
            let line = Line { origin: DVec3::new(-5.0, y, 0.0), direction: DVec3::X, start: Start::Eye };
            let hit = solid.first(&form, &line, &Span::WHOLE, &mut |_| true);
            assert!(hit.is_none_or(|h| h.t.is_finite()));
        }
    }
}
