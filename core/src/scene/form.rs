//! Free forms: quadrics, perturbations of quadrics, and set operations, as one implicit function.
//!
//! Source: S. I. Vyatkin, *Perturbation functions for compact database*, IADIS 2014; set operations by
//! minimum and maximum; smooth union after I. Quilez, *Smooth minimum*, polynomial form.

use super::primitive::Primitive;
use crate::math::{Aabb, Interval};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A solid bounded by the zero surface of a [`Form`].
#[derive(Clone, Debug, PartialEq)]
pub struct FreeForm {
    form: Form,
    bounds: Aabb,
}

/// An implicit function of position; a point is inside where it is `>= 0`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Form {
    /// Ten coefficients.
    Quadric(Quadric),
    /// `1 - sum(((p - center) / radii)^2)`.
    Ellipsoid {
        /// Its middle.
        #[schemars(with = "[f64; 3]")]
        center: DVec3,
        /// Half axes.
        #[schemars(with = "[f64; 3]")]
        radii: DVec3,
    },
    /// Everything behind a plane: `offset - normal . p`.
    HalfSpace {
        /// Points out of the solid.
        #[schemars(with = "[f64; 3]")]
        normal: DVec3,
        /// Distance of the plane along the normal, times the normal's length.
        offset: f64,
    },
    /// An endless round cylinder: `radius^2 - |distance to the axis|^2`.
    Cylinder {
        /// A point on the axis.
        #[schemars(with = "[f64; 3]")]
        center: DVec3,
        /// Direction of the axis.
        #[schemars(with = "[f64; 3]")]
        axis: DVec3,
        /// Its radius.
        radius: f64,
    },
    /// A ring around the y axis: `4 R^2 (x^2 + z^2) - (|p|^2 + R^2 - r^2)^2`.
    Torus {
        /// Radius of the ring.
        major: f64,
        /// Radius of the tube.
        minor: f64,
    },
    /// `base + sum(weight * R(function))`, where `R(q)` is `q^2` or `q^3` where `q > 0` and 0 elsewhere.
    Perturbed {
        /// What is bent.
        base: Box<Form>,
        /// What bends it.
        terms: Vec<Perturbation>,
    },
    /// Everything in any of them: the maximum.
    Union(Vec<Form>),
    /// Everything in all of them: the minimum.
    Intersection(Vec<Form>),
    /// The first without the second: `min(a, -b)`.
    Difference(Box<Form>, Box<Form>),
    /// A union with a fillet: `max(a, b) + max(k - |a - b|, 0)^2 / (4 k)`.
    SmoothUnion {
        /// First part.
        a: Box<Form>,
        /// Second part.
        b: Box<Form>,
        /// Width of the fillet in units of the function, positive.
        k: f64,
    },
    /// The function plus a constant: swells or shrinks the solid.
    Offset {
        /// What is swollen.
        form: Box<Form>,
        /// Added to the function.
        amount: f64,
    },
    /// `(1 - t) from + t to`.
    Morph {
        /// The form at t = 0.
        from: Box<Form>,
        /// The form at t = 1.
        to: Box<Form>,
        /// The share of `to`.
        t: f64,
    },
}

/// A second-order function `A x^2 + B y^2 + C z^2 + D xy + E xz + F yz + G x + H y + I z + K`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Quadric(
    /// `[A, B, C, D, E, F, G, H, I, K]`
    pub [f64; 10],
);

/// One perturbation term: `weight * R(function)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Perturbation {
    /// Positive raises bumps, negative presses dents.
    pub weight: f64,
    /// How the positive part is raised.
    #[serde(default)]
    pub power: Power,
    /// Where it is positive the form is bent; may itself be perturbed.
    pub function: Form,
}

/// Exponent of a perturbation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Power {
    /// `q^2`: the surface has a continuous tangent plane.
    #[default]
    Square,
    /// `q^3`: the surface has continuous curvature.
    Cube,
}

impl Power {
    /// Returns `R(q)` and its derivative.
    #[must_use]
    pub fn apply(self, q: f64) -> (f64, f64) {
        let q = q.max(0.0);
        match self {
            Self::Square => (q * q, 2.0 * q),
            Self::Cube => (q * q * q, 3.0 * q * q),
        }
    }
}

impl Quadric {
    /// Evaluates the function.
    #[must_use]
    pub fn value(&self, p: DVec3) -> f64 {
        let [a, b, c, d, e, f, g, h, i, k] = self.0;
        p.x * (a * p.x + d * p.y + e * p.z + g) + p.y * (b * p.y + f * p.z + h) + p.z * (c * p.z + i) + k
    }

    /// Evaluates the gradient.
    #[must_use]
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        let [a, b, c, d, e, f, g, h, i, _] = self.0;
        DVec3::new(
            2.0 * a * p.x + d * p.y + e * p.z + g,
            2.0 * b * p.y + d * p.x + f * p.z + h,
            2.0 * c * p.z + e * p.x + f * p.y + i,
        )
    }

    /// Bounds the function over a box by its Taylor form around the middle, which is exact up to rounding for
    /// functions without mixed terms.
    #[must_use]
    pub fn interval(&self, over: &Aabb) -> Interval {
        let [a, b, c, d, e, f, ..] = self.0;
        let middle = over.center();
        let half = over.size() * 0.5;
        let gradient = self.gradient(middle);
        let axis = |slope: f64, curve: f64, h: f64| {
            let ends = [slope * h + curve * h * h, curve * h * h - slope * h];
            let (mut lo, mut hi) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            if curve != 0.0 && (slope / (2.0 * curve)).abs() <= h {
                let peak = -slope * slope / (4.0 * curve);
                (lo, hi) = (lo.min(peak), hi.max(peak));
            }
            Interval::new(lo, hi)
        };
        let mixed = d.abs() * half.x * half.y + e.abs() * half.x * half.z + f.abs() * half.y * half.z;
        let value = self.value(middle);
        let sum = Interval::point(value)
            + axis(gradient.x, a, half.x)
            + axis(gradient.y, b, half.y)
            + axis(gradient.z, c, half.z)
            + Interval::new(-mixed, mixed);
        // The value and slopes at the middle were rounded too: allow for the size of the sums they came from.
        let m = middle.abs() + half;
        let [g, h, i, k] = [self.0[6], self.0[7], self.0[8], self.0[9]];
        let size = m.x * (a.abs() * m.x + d.abs() * m.y + e.abs() * m.z + g.abs())
            + m.y * (b.abs() * m.y + f.abs() * m.z + h.abs())
            + m.z * (c.abs() * m.z + i.abs())
            + k.abs();
        let slack = 64.0 * f64::EPSILON * size;
        Interval { lo: sum.lo - slack, hi: sum.hi + slack }
    }
}

impl Form {
    /// Returns the form as one quadric if it is one.
    #[must_use]
    pub fn as_quadric(&self) -> Option<Quadric> {
        match *self {
            Self::Quadric(q) => Some(q),
            Self::Ellipsoid { center: m, radii } => {
                let w = (radii * radii).recip();
                Some(Quadric([
                    -w.x,
                    -w.y,
                    -w.z,
                    0.0,
                    0.0,
                    0.0,
                    2.0 * w.x * m.x,
                    2.0 * w.y * m.y,
                    2.0 * w.z * m.z,
                    1.0 - (w * m * m).element_sum(),
                ]))
            }
            Self::HalfSpace { normal: n, offset } => {
                Some(Quadric([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -n.x, -n.y, -n.z, offset]))
            }
            Self::Cylinder { center: m, axis, radius } => {
                let u = axis.normalize_or(DVec3::Y);
                // |p - m|^2 - ((p - m) . u)^2 as a symmetric matrix I - u u^T.
                let (xx, yy, zz) = (1.0 - u.x * u.x, 1.0 - u.y * u.y, 1.0 - u.z * u.z);
                let (xy, xz, yz) = (-u.x * u.y, -u.x * u.z, -u.y * u.z);
                let mm = DVec3::new(
                    xx * m.x + xy * m.y + xz * m.z,
                    xy * m.x + yy * m.y + yz * m.z,
                    xz * m.x + yz * m.y + zz * m.z,
                );
                Some(Quadric([
                    -xx,
                    -yy,
                    -zz,
                    -2.0 * xy,
                    -2.0 * xz,
                    -2.0 * yz,
                    2.0 * mm.x,
                    2.0 * mm.y,
                    2.0 * mm.z,
                    radius * radius - mm.dot(m),
                ]))
            }
            _ => None,
        }
    }

    /// Returns the same function with every named quadric as its ten coefficients: faster where it is evaluated
    /// millions of times.
    #[must_use]
    pub fn lowered(&self) -> Self {
        if let Some(quadric) = self.as_quadric() {
            return Self::Quadric(quadric);
        }
        let boxed = |form: &Self| Box::new(form.lowered());
        let all = |parts: &[Self]| parts.iter().map(Self::lowered).collect();
        match self {
            Self::Perturbed { base, terms } => Self::Perturbed {
                base: boxed(base),
                terms: terms
                    .iter()
                    .map(|t| Perturbation {
                        function: t.function.lowered(),
                        weight: t.weight,
                        power: t.power,
                    })
                    .collect(),
            },
            Self::Union(parts) => Self::Union(all(parts)),
            Self::Intersection(parts) => Self::Intersection(all(parts)),
            Self::Difference(a, b) => Self::Difference(boxed(a), boxed(b)),
            Self::SmoothUnion { a, b, k } => Self::SmoothUnion { a: boxed(a), b: boxed(b), k: *k },
            Self::Offset { form, amount } => Self::Offset { form: boxed(form), amount: *amount },
            Self::Morph { from, to, t } => Self::Morph { from: boxed(from), to: boxed(to), t: *t },
            other => other.clone(),
        }
    }

    /// Evaluates the function.
    #[must_use]
    pub fn value(&self, p: DVec3) -> f64 {
        self.value_and_gradient(p).0
    }

    /// Evaluates the function and its gradient; at a crease the gradient of one of the sides.
    #[must_use]
    pub fn value_and_gradient(&self, p: DVec3) -> (f64, DVec3) {
        match self {
            Self::Quadric(_) | Self::Ellipsoid { .. } | Self::HalfSpace { .. } | Self::Cylinder { .. } => {
                let q = self.as_quadric().unwrap_or(Quadric([0.0; 10]));
                (q.value(p), q.gradient(p))
            }
            Self::Torus { major, minor } => {
                let ring = 4.0 * major * major;
                let s = p.length_squared() + major * major - minor * minor;
                let flat = DVec3::new(p.x, 0.0, p.z);
                (ring * flat.length_squared() - s * s, flat * (2.0 * ring) - p * (4.0 * s))
            }
            Self::Perturbed { base, terms } => {
                let (mut value, mut gradient) = base.value_and_gradient(p);
                for term in terms {
                    let (q, slope) = term.function.value_and_gradient(p);
                    let (r, dr) = term.power.apply(q);
                    value += term.weight * r;
                    gradient += slope * (term.weight * dr);
                }
                (value, gradient)
            }
            Self::Union(parts) => fold(parts, p, f64::NEG_INFINITY, |new, old| new > old),
            Self::Intersection(parts) => fold(parts, p, f64::INFINITY, |new, old| new < old),
            Self::Difference(a, b) => {
                let (a, da) = a.value_and_gradient(p);
                let (b, db) = b.value_and_gradient(p);
                if a <= -b { (a, da) } else { (-b, -db) }
            }
            Self::SmoothUnion { a, b, k } => {
                let (a, da) = a.value_and_gradient(p);
                let (b, db) = b.value_and_gradient(p);
                let (top, dtop, low, dlow) = if a >= b { (a, da, b, db) } else { (b, db, a, da) };
                let overlap = (k - (top - low)).max(0.0);
                let share = overlap / (2.0 * k);
                (top + overlap * overlap / (4.0 * k), dtop * (1.0 - share) + dlow * share)
            }
            Self::Offset { form, amount } => {
                let (value, gradient) = form.value_and_gradient(p);
                (value + amount, gradient)
            }
            Self::Morph { from, to, t } => {
                let (a, da) = from.value_and_gradient(p);
                let (b, db) = to.value_and_gradient(p);
                (a * (1.0 - t) + b * t, da * (1.0 - t) + db * *t)
            }
        }
    }

    /// Bounds the function over a box.
    #[must_use]
    pub fn interval(&self, over: &Aabb) -> Interval {
        match self {
            Self::Quadric(_) | Self::Ellipsoid { .. } | Self::HalfSpace { .. } | Self::Cylinder { .. } => {
                self.as_quadric().unwrap_or(Quadric([0.0; 10])).interval(over)
            }
            Self::Torus { major, minor } => {
                let axis = |i: usize| Interval::new(over.min[i], over.max[i]).square();
                let flat = axis(0) + axis(2);
                // With f = x^2 + z^2 the value is -(f + y^2 - c)^2 ... split so that f appears in one square.
                let (r2, m2) = (major * major, minor * minor);
                let inner = flat + axis(1) + Interval::point(r2 - m2);
                flat * (4.0 * r2) - inner.square()
            }
            Self::Perturbed { base, terms } => terms.iter().fold(base.interval(over), |sum, term| {
                let q = term.function.interval(over).positive_part();
                let raised = match term.power {
                    Power::Square => q.square(),
                    Power::Cube => q.square() * q,
                };
                sum + raised * term.weight
            }),
            Self::Union(parts) => parts
                .iter()
                .map(|f| f.interval(over))
                .reduce(Interval::max)
                .unwrap_or(Interval::point(f64::NEG_INFINITY)),
            Self::Intersection(parts) => parts
                .iter()
                .map(|f| f.interval(over))
                .reduce(Interval::min)
                .unwrap_or(Interval::point(f64::INFINITY)),
            Self::Difference(a, b) => a.interval(over).min(-b.interval(over)),
            Self::SmoothUnion { a, b, k } => {
                let (a, b) = (a.interval(over), b.interval(over));
                let gap = a - b;
                let nearest = if gap.contains(0.0) { 0.0 } else { gap.lo.abs().min(gap.hi.abs()) };
                let farthest = gap.lo.abs().max(gap.hi.abs());
                let fillet = |gap: f64| (k - gap).max(0.0).powi(2) / (4.0 * k);
                a.max(b) + Interval::new(fillet(farthest), fillet(nearest))
            }
            Self::Offset { form, amount } => form.interval(over) + Interval::point(*amount),
            Self::Morph { from, to, t } => from.interval(over) * (1.0 - t) + to.interval(over) * *t,
        }
    }

    /// Counts the functions in the tree.
    #[must_use]
    pub fn node_count(&self) -> usize {
        1 + match self {
            Self::Quadric(_)
            | Self::Ellipsoid { .. }
            | Self::HalfSpace { .. }
            | Self::Cylinder { .. }
            | Self::Torus { .. } => 0,
            Self::Perturbed { base, terms } => {
                base.node_count() + terms.iter().map(|t| t.function.node_count()).sum::<usize>()
            }
            Self::Union(parts) | Self::Intersection(parts) => parts.iter().map(Self::node_count).sum(),
            Self::Difference(a, b) | Self::SmoothUnion { a, b, .. } => a.node_count() + b.node_count(),
            Self::Offset { form, .. } => form.node_count(),
            Self::Morph { from, to, .. } => from.node_count() + to.node_count(),
        }
    }
}

fn fold(parts: &[Form], p: DVec3, empty: f64, better: impl Fn(f64, f64) -> bool) -> (f64, DVec3) {
    parts
        .iter()
        .map(|f| f.value_and_gradient(p))
        .fold((empty, DVec3::ZERO), |best, next| if better(next.0, best.0) { next } else { best })
}

impl FreeForm {
    /// Builds a free form and finds its bounds by interval subdivision, down to a percent of its size.
    ///
    /// # Errors
    /// When the solid reaches further than 1e6 from the origin (give it a box with [`FreeForm::within`]), when
    /// it is empty, or when a number in it is not finite.
    pub fn new(form: Form) -> Result<Self, String> {
        let widest = Aabb::new(DVec3::splat(-1e6), DVec3::splat(1e6));
        let bounds = support(&form, widest)?;
        if (bounds.min.min_element() <= -9.9e5) || (bounds.max.max_element() >= 9.9e5) {
            return Err("the form has no end: give it `bounds`".to_owned());
        }
        Ok(Self { form, bounds })
    }

    /// Builds a free form cut off by a box: the cut is closed by the box's faces.
    ///
    /// # Errors
    /// When nothing of the solid is in the box, or a number is not finite.
    pub fn within(form: Form, cut: Aabb) -> Result<Self, String> {
        if cut.is_empty() || !(cut.min.is_finite() && cut.max.is_finite()) {
            return Err("the bounds are empty".to_owned());
        }
        let half = |normal: DVec3, offset: f64| Form::HalfSpace { normal, offset };
        let mut parts = vec![form];
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            parts.push(half(axis, cut.max.dot(axis)));
            parts.push(half(-axis, -cut.min.dot(axis)));
        }
        let form = Form::Intersection(parts);
        let bounds = support(&form, cut.grown(cut.radius() * 1e-3))?;
        Ok(Self { form, bounds: bounds.intersection(cut) })
    }

    /// Puts a form together with bounds that were found before, by [`FreeForm::bounds`] of the same form.
    #[must_use]
    pub fn from_parts(form: Form, bounds: Aabb) -> Self {
        Self { form, bounds }
    }

    /// Returns a primitive body as a free form; nothing for the plane, which encloses nothing.
    #[must_use]
    pub fn from_primitive(primitive: &Primitive) -> Option<Self> {
        Some(Self { form: primitive.form()?, bounds: primitive.bounds() })
    }

    /// Returns the same solid with its function [lowered](Form::lowered).
    #[must_use]
    pub fn lowered(&self) -> Self {
        Self { form: self.form.lowered(), bounds: self.bounds }
    }

    /// Returns the implicit function.
    #[must_use]
    pub fn form(&self) -> &Form {
        &self.form
    }

    /// Returns a box that holds the solid.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }
}

/// Finds a box around everything where the form may be `>= 0`, to a percent of that box.
fn support(form: &Form, within: Aabb) -> Result<Aabb, String> {
    let everywhere = form.interval(&within);
    if everywhere.lo.is_nan() || everywhere.hi.is_nan() {
        return Err("a coefficient is not finite or too large".to_owned());
    }
    let mut bounds = within;
    // Each round tightens the box; far away forms need several rounds of the coarse grid.
    for _ in 0..40 {
        let mut found = Aabb::EMPTY;
        collect_support(form, bounds, 4, &mut found);
        if found.is_empty() {
            return Err("the form is empty: its function is negative everywhere".to_owned());
        }
        let shrunk = found.size().max_element() < bounds.size().max_element() * 0.98
            || found.size().min_element() < bounds.size().min_element() * 0.98;
        bounds = found;
        if !shrunk {
            break;
        }
    }
    Ok(bounds)
}

fn collect_support(form: &Form, part: Aabb, depth: u32, found: &mut Aabb) {
    let union = found.union(part);
    if union == *found || form.interval(&part).hi < 0.0 {
        return;
    }
    if depth == 0 {
        *found = union;
        return;
    }
    let middle = part.center();
    for corner in part.corners() {
        collect_support(form, Aabb::new(corner.min(middle), corner.max(middle)), depth - 1, found);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A figure that uses every operation.
    fn everything() -> Form {
        let ball =
            |x: f64, r: f64| Form::Ellipsoid { center: DVec3::new(x, 0.1, -0.2), radii: DVec3::splat(r) };
        let bump = Perturbation { weight: 0.7, power: Power::Cube, function: ball(0.8, 0.5) };
        let dent = Perturbation {
            weight: -0.4,
            power: Power::Square,
            function: Form::Perturbed { base: Box::new(ball(-0.6, 0.4)), terms: vec![bump.clone()] },
        };
        Form::Union(vec![
            Form::SmoothUnion {
                a: Box::new(Form::Perturbed { base: Box::new(ball(0.0, 1.0)), terms: vec![bump, dent] }),
                b: Box::new(Form::Torus { major: 1.0, minor: 0.2 }),
                k: 0.3,
            },
            Form::Difference(
                Box::new(Form::Intersection(vec![
                    Form::Cylinder { center: DVec3::ZERO, axis: DVec3::new(1.0, 1.0, 0.3), radius: 0.4 },
                    ball(0.0, 1.5),
                ])),
                Box::new(Form::HalfSpace { normal: DVec3::Y, offset: 0.1 }),
            ),
            Form::Morph {
                from: Box::new(ball(1.0, 0.2)),
                to: Box::new(Form::Offset { form: Box::new(ball(1.2, 0.3)), amount: 0.05 }),
                t: 0.4,
            },
        ])
    }

    fn random(state: &mut u64) -> f64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }

    #[test]
    fn intervals_contain_every_value_in_the_box() {
        let form = everything();
        let mut state = 7;
        let mut point =
            |scale: f64| DVec3::new(random(&mut state), random(&mut state), random(&mut state)) * scale;
        for _ in 0..2000 {
            let (middle, half) = (point(1.5), point(0.4).abs());
            let over = Aabb::new(middle - half, middle + half);
            let range = form.interval(&over);
            for _ in 0..20 {
                let p = middle + point(1.0) * half;
                let value = form.value(p);
                assert!(range.contains(value), "{value} at {p} outside of {range:?}");
            }
        }
    }

    #[test]
    fn gradients_agree_with_differences() {
        let form = everything();
        let mut state = 11;
        let mut checked = 0;
        for _ in 0..200 {
            let p = DVec3::new(random(&mut state), random(&mut state), random(&mut state)) * 1.4;
            let step = 1e-6;
            let slope =
                |axis: DVec3| (form.value(p + axis * step) - form.value(p - axis * step)) / (2.0 * step);
            let by_differences = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
            let error = (form.value_and_gradient(p).1 - by_differences).length();
            checked += usize::from(error < 1e-4 * (1.0 + by_differences.length()));
        }
        assert!(checked >= 195, "only points within a step of a crease may differ, {checked} of 200 agree");
    }

    #[test]
    fn bounds_are_found_by_intervals() {
        let ball = Form::Ellipsoid { center: DVec3::new(3.0, 0.0, 0.0), radii: DVec3::new(1.0, 2.0, 0.5) };
        let bounds = FreeForm::new(ball).unwrap().bounds();
        assert!(bounds.min.x <= 2.0 && bounds.max.y >= 2.0 && bounds.size().y < 4.4, "{bounds:?}");
        let plane = Form::HalfSpace { normal: DVec3::Y, offset: 0.0 };
        assert_eq!(FreeForm::new(plane.clone()).unwrap_err(), "the form has no end: give it `bounds`");
        let slab = FreeForm::within(plane, Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0))).unwrap();
        assert!(slab.bounds().max.y < 0.2, "{:?}", slab.bounds());
        let nothing = Form::Offset {
            form: Box::new(Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::ONE }),
            amount: -2.0,
        };
        assert!(FreeForm::new(nothing).unwrap_err().starts_with("the form is empty"));
    }
}
