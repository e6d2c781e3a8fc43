//! Where does a ray meet a triangle?
//!
//! Source: T. Möller, B. Trumbore, *Fast, minimum storage ray-triangle intersection*, JGT 2(1), 1997.

use glam::DVec3;
use polyptych_plugin::core::math::{Aabb, Ray};

/// A triangle in world space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    corner: DVec3,
    edges: [DVec3; 2],
    /// Index of its object.
    pub(crate) object: u32,
    /// Index within its object.
    pub(crate) face: u32,
}

/// Where a ray met a triangle: at `(1 - u - v) a + u b + v c`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    pub(crate) triangle: usize,
    pub(crate) distance: f64,
    pub(crate) u: f64,
    pub(crate) v: f64,
}

impl Triangle {
    pub(crate) fn new([a, b, c]: [DVec3; 3], object: u32, face: u32) -> Self {
        Self { corner: a, edges: [b - a, c - a], object, face }
    }

    pub(crate) fn order(&self) -> (u32, u32) {
        (self.object, self.face)
    }

    pub(crate) fn bounds(&self) -> Aabb {
        Aabb::of_points([self.corner, self.corner + self.edges[0], self.corner + self.edges[1]])
    }

    pub(crate) fn center(&self) -> DVec3 {
        self.corner + (self.edges[0] + self.edges[1]) / 3.0
    }

    /// Returns the true normal, not of unit length.
    pub(crate) fn normal(&self) -> DVec3 {
        self.edges[0].cross(self.edges[1])
    }

    /// Returns the distance along the ray, and where on the triangle.
    pub(crate) fn meets(&self, ray: &Ray) -> Option<(f64, f64, f64)> {
        let [e, f] = self.edges;
        let p = ray.direction.cross(f);
        let determinant = e.dot(p);
        if determinant == 0.0 {
            return None;
        }
        let s = ray.origin - self.corner;
        let u = s.dot(p) / determinant;
        let q = s.cross(e);
        let v = ray.direction.dot(q) / determinant;
        let distance = f.dot(q) / determinant;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance.is_finite()).then_some((distance, u, v))
    }
}
