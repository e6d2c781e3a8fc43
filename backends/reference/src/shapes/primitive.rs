//! Where does a ray cross a parametric body, in closed form?
//!
//! Quadratics are solved around the point of closest approach (E. Haines et al., *Precision Improvements for
//! Ray/Sphere Intersection*, Ray Tracing Gems, 2019), so that far eyes cost no digits.

use crate::line::{Hit, Line, Span};
use crate::roots::polynomial_roots;
use glam::{DVec2, DVec3};
use polyptych_core::scene::Primitive;

/// Up to four crossings by rising distance.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Crossings {
    list: [(f64, DVec3); 4],
    count: usize,
}

impl Crossings {
    fn push(&mut self, t: f64, normal: DVec3) {
        self.list[self.count] = (t, normal);
        self.count += 1;
    }

    fn stretch(stretch: Option<Stretch>) -> Self {
        let mut crossings = Self::default();
        if let Some(s) = stretch {
            crossings.push(s.near, s.near_normal);
            crossings.push(s.far, s.far_normal);
        }
        crossings
    }

    pub(crate) fn first(&self, span: &Span, accept: &mut impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.list[..self.count]
            .iter()
            .enumerate()
            .map(|(part, &(t, normal))| Hit::plain(t, part as i64, normal))
            .find(|hit| span.holds(hit.t, hit.part) && accept(hit))
    }
}

/// The part of a line inside a convex body, with the outward normals at its ends.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    near: f64,
    far: f64,
    near_normal: DVec3,
    far_normal: DVec3,
}

impl Stretch {
    const ENDLESS: Self = Self {
        near: f64::NEG_INFINITY,
        far: f64::INFINITY,
        near_normal: DVec3::ZERO,
        far_normal: DVec3::ZERO,
    };

    fn and(self, other: Self) -> Option<Self> {
        let (near, near_normal) = if other.near > self.near {
            (other.near, other.near_normal)
        } else {
            (self.near, self.near_normal)
        };
        let (far, far_normal) =
            if other.far < self.far { (other.far, other.far_normal) } else { (self.far, self.far_normal) };
        (near <= far).then_some(Self { near, far, near_normal, far_normal })
    }

    /// Cuts off what lies beyond a plane `normal . p = offset`.
    fn cut(self, line: &Line, normal: DVec3, offset: f64) -> Option<Self> {
        let (toward, height) = (normal.dot(line.direction), offset - normal.dot(line.origin));
        if toward == 0.0 {
            return (height >= 0.0).then_some(self);
        }
        let t = height / toward;
        let half = if toward < 0.0 {
            Self { near: t, near_normal: normal, ..Self::ENDLESS }
        } else {
            Self { far: t, far_normal: normal, ..Self::ENDLESS }
        };
        self.and(half)
    }

    fn slab(line: &Line, axis: DVec3, half: f64) -> Option<Self> {
        Self::ENDLESS.cut(line, axis, half)?.cut(line, -axis, half)
    }
}

/// Finds all crossings of a body; `faces` are those of a polyhedron.
pub(crate) fn crossings(body: &Primitive, faces: &[(DVec3, f64)], line: &Line) -> Crossings {
    match *body {
        Primitive::Box { .. } | Primitive::Frustum { .. } => Crossings::stretch(
            faces.iter().try_fold(Stretch::ENDLESS, |s, &(normal, offset)| s.cut(line, normal, offset)),
        ),
        Primitive::Sphere { radius } => Crossings::stretch(sphere(line, radius)),
        Primitive::Cylinder { radius, height } => Crossings::stretch(cylinder(line, radius, height * 0.5)),
        Primitive::Cone { radius, height } => Crossings::stretch(cone(line, radius, height)),
        Primitive::Torus { major, minor } => torus(line, major, minor),
        Primitive::Plane { width, depth } => plane(line, width * 0.5, depth * 0.5),
    }
}

fn sphere(line: &Line, radius: f64) -> Option<Stretch> {
    let d = line.direction;
    let dd = d.length_squared();
    let middle = closest_approach(line, |v| v.dot(d) / dd);
    let offset = line.at(middle);
    let rest = radius * radius - offset.length_squared();
    if !(rest >= 0.0) {
        return None;
    }
    let half = (rest / dd).sqrt();
    Some(Stretch {
        near: middle - half,
        far: middle + half,
        near_normal: offset - d * half,
        far_normal: offset + d * half,
    })
}

/// Returns where a line comes nearest to a center or an axis; the second step corrects the rounding of the
/// first for eyes far away. `along` measures a vector in units of the direction.
fn closest_approach(line: &Line, along: impl Fn(DVec3) -> f64) -> f64 {
    let t = -along(line.origin);
    t - along(line.at(t))
}

fn cylinder(line: &Line, radius: f64, half_height: f64) -> Option<Stretch> {
    let slab = Stretch::slab(line, DVec3::Y, half_height)?;
    let d = DVec2::new(line.direction.x, line.direction.z);
    let dd = d.length_squared();
    if dd == 0.0 {
        let o = DVec2::new(line.origin.x, line.origin.z);
        return (o.length() <= radius).then_some(slab);
    }
    let middle = closest_approach(line, |v| (v.x * d.x + v.z * d.y) / dd);
    let p = line.at(middle);
    let rest = radius * radius - p.x * p.x - p.z * p.z;
    if !(rest >= 0.0) {
        return None;
    }
    let half = (rest / dd).sqrt();
    let normal = |s: f64| DVec3::new(p.x + d.x * s, 0.0, p.z + d.y * s);
    slab.and(Stretch {
        near: middle - half,
        far: middle + half,
        near_normal: normal(-half),
        far_normal: normal(half),
    })
}

/// `x^2 + z^2 <= s^2 (h/2 - y)^2` with `s = radius / height`, below the apex.
fn cone(line: &Line, radius: f64, height: f64) -> Option<Stretch> {
    let slab = Stretch::slab(line, DVec3::Y, height * 0.5)?;
    let (d, s2, apex) = (line.direction, (radius / height).powi(2), height * 0.5);
    // Solve around the approach to the body's middle.
    let middle = closest_approach(line, |v| v.dot(d) / d.length_squared());
    let p = line.at(middle);
    let (below, down) = (apex - p.y, -d.y);
    let a = d.x * d.x + d.z * d.z - s2 * down * down;
    let b = p.x * d.x + p.z * d.z - s2 * below * down;
    let c = p.x * p.x + p.z * p.z - s2 * below * below;
    let (first, second) = match (a == 0.0, b * b - a * c) {
        (true, _) if b == 0.0 => return (c <= 0.0).then_some(slab),
        // Parallel to the side: it is crossed once.
        (true, _) if b > 0.0 => (f64::NEG_INFINITY, -c / (2.0 * b)),
        (true, _) => (-c / (2.0 * b), f64::INFINITY),
        (_, rest) if rest < 0.0 && a > 0.0 => return None,
        (_, rest) => {
            // Below zero only by rounding here: a steep line misses no more than the apex.
            let q = -(b + rest.max(0.0).sqrt().copysign(b));
            let (r, s) = (q / a, if q == 0.0 { 0.0 } else { c / q });
            let (low, high) = (r.min(s), r.max(s));
            match (a > 0.0, d.y > 0.0) {
                (true, _) => (low, high),
                // Steep lines are inside on either side of a gap; the lower side is the cone.
                (false, true) => (f64::NEG_INFINITY, low),
                (false, false) => (high, f64::INFINITY),
            }
        }
    };
    let normal = |s: f64| {
        let q = p + d * s;
        let n = DVec3::new(q.x, s2 * (apex - q.y), q.z);
        if n.length_squared() > 0.0 { n } else { DVec3::Y }
    };
    slab.and(Stretch {
        near: middle + first,
        far: middle + second,
        near_normal: if first.is_finite() { normal(first) } else { DVec3::ZERO },
        far_normal: if second.is_finite() { normal(second) } else { DVec3::ZERO },
    })
}

/// A quartic, isolated between the turns of its derivatives, then polished on `(sqrt(x^2 + z^2) - R)^2 + y^2 = r^2`.
fn torus(line: &Line, major: f64, minor: f64) -> Crossings {
    let mut crossings = Crossings::default();
    let length = line.direction.length();
    let d = line.direction / length;
    let unit = Line { direction: d, ..*line };
    let middle = closest_approach(&unit, |v| v.dot(d));
    let p = unit.at(middle);
    let reach = (major + minor) * (1.0 + 1e-9);
    let rest = reach * reach - p.length_squared();
    if !(rest > 0.0) {
        return crossings;
    }
    let half = rest.sqrt();
    // s = |p + x d|^2 + R^2 - r^2, the ray has p.d = 0 but for rounding; f = 4 R^2 (flat part)^2 - s^2.
    let (s0, s1) = (p.length_squared() + (major - minor) * (major + minor), 2.0 * p.dot(d));
    let ring = 4.0 * major * major;
    let (f0, f1, f2) = (p.x * p.x + p.z * p.z, 2.0 * (p.x * d.x + p.z * d.z), d.x * d.x + d.z * d.z);
    let quartic =
        [ring * f0 - s0 * s0, ring * f1 - 2.0 * s0 * s1, ring * f2 - 2.0 * s0 - s1 * s1, -2.0 * s1, -1.0];
    for &root in polynomial_roots(&quartic, -half, half).as_slice() {
        let mut x = root;
        for _ in 0..2 {
            let q = p + d * x;
            let flat = (q.x * q.x + q.z * q.z).sqrt();
            let value = (flat - major).powi(2) + q.y * q.y - minor * minor;
            let slope = 2.0 * ((flat - major) * (q.x * d.x + q.z * d.z) / flat + q.y * d.y);
            let step = value / slope;
            // A polish moves by rounding errors; a grazing ray is better left where it was isolated.
            if step.abs() < 1e-7 * minor {
                x -= step;
            }
        }
        let q = p + d * x;
        let flat = DVec3::new(q.x, 0.0, q.z);
        crossings.push((middle + x) / length, q - flat.normalize_or_zero() * major);
    }
    crossings
}

fn plane(line: &Line, half_width: f64, half_depth: f64) -> Crossings {
    let mut crossings = Crossings::default();
    let t = -line.origin.y / line.direction.y;
    if t.is_finite() {
        let p = line.at(t);
        if p.x.abs() <= half_width && p.z.abs() <= half_depth {
            crossings.push(t, DVec3::Y);
        }
    }
    crossings
}
