//! What are the bounds of a free form's function on a stretch of a ray?
//!
//! On a stretch every second-order leaf is a parabola around the stretch's middle, whose range is exact; the
//! tree above combines value and slope by interval arithmetic, and the mean value theorem tightens the result.
//! All bounds are widened by their rounding error.

use glam::DVec3;
use polyptych_core::math::Interval;
use polyptych_core::scene::{Form, Power, Quadric};

/// Bounds the rounding of one operation with room to spare.
const ROUND: f64 = 2.0 * f64::EPSILON;

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
pub(crate) struct Jet {
    pub(crate) value: Interval,
    pub(crate) slope: Interval,
    pub(crate) middle: f64,
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

impl Function {
    pub(crate) fn new(form: &Form) -> Self {
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
    pub(crate) fn on(&self, p: DVec3, d: DVec3, h: f64) -> Jet {
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
    use crate::shapes::form::tests::{everything, random};

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
}
