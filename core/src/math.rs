//! Rays, boxes and intervals in double precision.

use glam::{DAffine3, DVec3};
use std::ops::{Add, Mul, Neg, Sub};

/// A half line. `direction` has unit length, so that a parameter along it is a distance in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where the ray begins.
    pub origin: DVec3,
    /// Where it goes, unit length.
    pub direction: DVec3,
}

impl Ray {
    /// Returns the point at `distance` from the origin.
    #[must_use]
    pub fn at(&self, distance: f64) -> DVec3 {
        self.origin + self.direction * distance
    }
}

/// An axis-aligned box. [`Aabb::EMPTY`] holds nothing and is the identity of [`Aabb::union`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest corner.
    pub min: DVec3,
    /// Largest corner.
    pub max: DVec3,
}

impl Aabb {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// Builds a box from two corners.
    #[must_use]
    pub fn new(min: DVec3, max: DVec3) -> Self {
        Self { min, max }
    }

    /// Bounds the finite points of an iterator; points that are not finite are passed over.
    pub fn of_points(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().filter(|p| p.is_finite()).fold(Self::EMPTY, Self::with)
    }

    /// Tells whether the box holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !(self.min.x <= self.max.x && self.min.y <= self.max.y && self.min.z <= self.max.z)
    }

    /// Returns the box grown to hold `point`.
    #[must_use]
    pub fn with(self, point: DVec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// Returns the smallest box that holds both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Returns what both boxes share.
    #[must_use]
    pub fn intersection(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Returns the box grown by `margin` on every side.
    #[must_use]
    pub fn grown(self, margin: f64) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// Returns the middle of the box, or the origin when it is empty.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.min * 0.5 + self.max * 0.5 }
    }

    /// Returns the edge lengths, zero when the box is empty.
    #[must_use]
    pub fn size(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.max - self.min }
    }

    /// Returns half of the diagonal: the radius of the bounding sphere.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.size().length() * 0.5
    }

    /// Returns the eight corners.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |bit: usize, lo: f64, hi: f64| if i >> bit & 1 == 0 { lo } else { hi };
            DVec3::new(
                pick(0, self.min.x, self.max.x),
                pick(1, self.min.y, self.max.y),
                pick(2, self.min.z, self.max.z),
            )
        })
    }

    /// Returns the box of the transformed box.
    #[must_use]
    pub fn transformed(&self, map: &DAffine3) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        Self::of_points(self.corners().map(|c| map.transform_point3(c)))
    }

    /// Returns the part `[near, far]` of the ray inside the box, clipped to `near >= 0`, if there is one.
    ///
    /// Rays that lie in a face plane count as inside: a zero direction component never yields NaN.
    #[must_use]
    pub fn clip(&self, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        let (mut near, mut far) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            if d == 0.0 {
                if o < self.min[axis] || o > self.max[axis] {
                    return None;
                }
                continue;
            }
            let (a, b) = ((self.min[axis] - o) / d, (self.max[axis] - o) / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near <= far).then_some((near, far))
    }
}

/// A closed range of real numbers, for bounding a function over a box or a stretch of a ray.
///
/// Each operation widens its result by a few units in the last place, so that the interval of a formula
/// contains the exact value (R. E. Moore, *Interval Analysis*, 1966).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub lo: f64,
    /// Upper end.
    pub hi: f64,
}

/// Relative widening of one operation: two units in the last place cover the rounding of both ends.
const WIDEN: f64 = 2.0 * f64::EPSILON;

impl Interval {
    /// Builds an interval; the ends must be in order.
    #[must_use]
    pub fn new(lo: f64, hi: f64) -> Self {
        debug_assert!(lo <= hi || lo.is_nan() || hi.is_nan(), "interval ends out of order: {lo} > {hi}");
        Self { lo, hi }
    }

    /// Builds the interval of one number.
    #[must_use]
    pub fn point(value: f64) -> Self {
        Self { lo: value, hi: value }
    }

    fn widened(lo: f64, hi: f64) -> Self {
        Self { lo: lo - lo.abs() * WIDEN, hi: hi + hi.abs() * WIDEN }
    }

    /// Tells whether `value` lies within.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        self.lo <= value && value <= self.hi
    }

    /// Returns the difference of the ends.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.hi - self.lo
    }

    /// Returns the range of the squares.
    #[must_use]
    pub fn square(self) -> Self {
        let (a, b) = (self.lo * self.lo, self.hi * self.hi);
        if self.lo <= 0.0 && self.hi >= 0.0 {
            Self::widened(0.0, a.max(b))
        } else {
            Self::widened(a.min(b), a.max(b))
        }
    }

    /// Returns the range of `max(x, 0)`.
    #[must_use]
    pub fn positive_part(self) -> Self {
        Self { lo: self.lo.max(0.0), hi: self.hi.max(0.0) }
    }

    /// Returns the range of the smaller of two.
    #[must_use]
    pub fn min(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.min(other.hi) }
    }

    /// Returns the range of the larger of two.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self { lo: self.lo.max(other.lo), hi: self.hi.max(other.hi) }
    }

    /// Returns the smallest interval that holds both.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::widened(self.lo + other.lo, self.hi + other.hi)
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::widened(self.lo - other.hi, self.hi - other.lo)
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self { lo: -self.hi, hi: -self.lo }
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let p = [self.lo * other.lo, self.lo * other.hi, self.hi * other.lo, self.hi * other.hi];
        Self::widened(p[0].min(p[1]).min(p[2].min(p[3])), p[0].max(p[1]).max(p[2].max(p[3])))
    }
}

impl Mul<f64> for Interval {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        let (a, b) = (self.lo * factor, self.hi * factor);
        Self::widened(a.min(b), a.max(b))
    }
}

/// Returns two unit vectors that make a right-handed frame with the unit vector `n`.
///
/// Source: Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6(1), 2017.
#[must_use]
pub fn orthonormal_basis(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn box_clip_keeps_rays_in_a_face_plane() {
        let unit = Aabb::new(DVec3::ZERO, DVec3::ONE);
        let hit = unit.clip(DVec3::new(-1.0, 0.0, 0.5), DVec3::X);
        assert_eq!(hit, Some((1.0, 2.0)));
        assert_eq!(unit.clip(DVec3::new(-1.0, -1e-9, 0.5), DVec3::X), None);
    }

    #[test]
    fn empty_box_has_a_finite_center_and_no_size() {
        assert_eq!(Aabb::EMPTY.center(), DVec3::ZERO);
        assert_eq!(Aabb::EMPTY.radius(), 0.0);
        assert!(Aabb::of_points([DVec3::NAN]).is_empty());
    }

    #[test]
    fn intervals_contain_the_products_of_their_members() {
        let (a, b) = (Interval::new(-1.5, 0.25), Interval::new(-3.0, 7.0));
        for i in 0..=10 {
            for j in 0..=10 {
                let (x, y) = (a.lo + a.width() * f64::from(i) / 10.0, b.lo + b.width() * f64::from(j) / 10.0);
                assert!((a * b).contains(x * y) && (a + b).contains(x + y) && (a - b).contains(x - y));
                assert!(a.square().contains(x * x));
            }
        }
    }

    #[test]
    fn basis_is_orthonormal_for_axes_and_diagonals() {
        for n in [DVec3::X, -DVec3::Z, DVec3::Z, DVec3::new(0.6, -0.48, 0.64)] {
            let (u, v) = orthonormal_basis(n);
            assert!(u.dot(v).abs() < 1e-15 && u.dot(n).abs() < 1e-15);
            assert!((u.cross(v) - n).length() < 1e-15);
        }
    }
}
