//! What is a ray in a shape's own space, the stretch of it that is searched, and what is found there?

use glam::DVec3;
use polyptych_core::math::Ray;

/// A ray in any space. The direction is not of unit length in object space: the parameter `t` stays the
/// distance in world units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    pub(crate) start: Start,
}

/// Where a ray begins: an eye inside a filled voxel sees it, a mirror ray inside clear glass does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    Eye,
    Surface,
}

impl Line {
    pub(crate) fn new(ray: &Ray, start: Start) -> Self {
        Self { origin: ray.origin, direction: ray.direction, start }
    }

    pub(crate) fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }
}

/// The open stretch between two places in the order (t, part); parts order what lies at the same `t`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    pub(crate) after: f64,
    pub(crate) after_part: i64,
    pub(crate) before: f64,
    pub(crate) before_part: i64,
    /// Any hit will do; the search ends with the first that is found.
    pub(crate) any: bool,
}

impl Span {
    #[cfg(test)]
    pub(crate) const WHOLE: Self =
        Self { after: 0.0, after_part: -1, before: f64::INFINITY, before_part: 0, any: false };

    /// Tells whether a place lies in the stretch; `t` that is not a number does not.
    pub(crate) fn holds(&self, t: f64, part: i64) -> bool {
        (t > self.after || (t == self.after && part > self.after_part))
            && (t < self.before || (t == self.before && part < self.before_part))
    }

    /// Ends the stretch before a hit, or at once where any hit will do.
    pub(crate) fn end_before(&mut self, hit: &Hit) {
        (self.before, self.before_part) = if self.any { (f64::NEG_INFINITY, 0) } else { (hit.t, hit.part) };
    }
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// Distance in world units.
    pub(crate) t: f64,
    /// Triangle, cell or crossing: orders hits at the same distance.
    pub(crate) part: i64,
    /// True normal in object space, outward where the shape has an inside; any length.
    pub(crate) normal: DVec3,
    /// Barycentric weights of a triangle's second and third corner.
    pub(crate) weights: [f64; 2],
    /// Material slot.
    pub(crate) slot: usize,
}

impl Hit {
    /// Builds a hit of a shape with one material.
    pub(crate) fn plain(t: f64, part: i64, normal: DVec3) -> Self {
        Self { t, part, normal, weights: [0.0; 2], slot: 0 }
    }
}
