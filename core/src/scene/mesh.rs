//! Indexed triangles and free segments.

use crate::math::Aabb;
use glam::{Vec2, Vec3};

/// Triangles and segments over shared vertices.
///
/// Positions are `f32` in object space; a loader moves far-away models next to the origin and puts the
/// offset into the object's transform, so that nothing is lost. `normals`, `uvs` and `colors` are empty or
/// as long as `positions`; `slots` is empty (all faces in slot 0) or as long as `triangles`.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Corner positions.
    pub positions: Vec<Vec3>,
    /// Unit normals for smooth shading; without them faces are shaded flat.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, v = 0 at the top row of the picture.
    pub uvs: Vec<Vec2>,
    /// Vertex colors in linear light, multiplied with the material's.
    pub colors: Vec<Vec3>,
    /// Corner indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Material slot of each triangle.
    pub slots: Vec<u16>,
    /// Free line segments.
    pub segments: Vec<[u32; 2]>,
}

impl Mesh {
    /// Bounds the vertices that triangles or segments use.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let used = self.triangles.iter().flatten().chain(self.segments.iter().flatten());
        Aabb::of_points(used.filter_map(|&i| self.positions.get(i as usize)).map(|p| p.as_dvec3()))
    }

    /// Tells whether no corner is anywhere; it does not look further than to the first that is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let mut used = self.triangles.iter().flatten().chain(self.segments.iter().flatten());
        !used.any(|&i| self.positions.get(i as usize).is_some_and(|p| p.is_finite()))
    }

    /// Returns the material slot of a triangle.
    #[must_use]
    pub fn slot(&self, triangle: usize) -> usize {
        self.slots.get(triangle).map_or(0, |&s| usize::from(s))
    }

    /// Returns the corner positions of a triangle.
    #[must_use]
    #[inline]
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|i| self.positions[i as usize])
    }

    /// Returns how a place moves with u and with v on a triangle, in object space, up to a factor that both share;
    /// nothing where there are no texture coordinates or all three are on a line.
    #[must_use]
    #[inline(always)]
    pub fn along_uv(&self, triangle: usize) -> Option<[Vec3; 2]> {
        if self.uvs.is_empty() {
            return None;
        }
        let [a, b, c] = self.triangles[triangle].map(|i| (self.positions[i as usize], self.uvs[i as usize]));
        let (ab, ac, right, left) = (b.0 - a.0, c.0 - a.0, b.1 - a.1, c.1 - a.1);
        // By the sign of the determinant alone: tiny triangles would lose their digits in dividing by it.
        let side = right.perp_dot(left);
        let along =
            [(ab * left.y - ac * right.y) * side.signum(), (ac * right.x - ab * left.x) * side.signum()];
        (side != 0.0 && along.iter().all(|v| v.is_finite())).then_some(along)
    }

    /// Returns the bytes held.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        (self.positions.len() * 12
            + self.normals.len() * 12
            + self.uvs.len() * 8
            + self.colors.len() * 12
            + self.triangles.len() * 12
            + self.slots.len() * 2
            + self.segments.len() * 8) as u64
    }

    /// Returns the total area of the triangles.
    #[must_use]
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t).map(glam::Vec3::as_dvec3);
                (b - a).cross(c - a).length() * 0.5
            })
            .sum()
    }

    /// Returns the enclosed volume of a closed mesh, positive when faces wind counter-clockwise outside.
    #[must_use]
    pub fn volume(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t).map(glam::Vec3::as_dvec3);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    }

    /// Checks that every index points at a vertex and every array has its length.
    ///
    /// # Errors
    /// Names the first array or index that does not fit.
    pub fn check(&self) -> Result<(), String> {
        let n = self.positions.len();
        for (name, length) in
            [("normals", self.normals.len()), ("uvs", self.uvs.len()), ("colors", self.colors.len())]
        {
            if length != 0 && length != n {
                return Err(format!("{length} {name} for {n} positions"));
            }
        }
        if !self.slots.is_empty() && self.slots.len() != self.triangles.len() {
            return Err(format!("{} slots for {} triangles", self.slots.len(), self.triangles.len()));
        }
        match self
            .triangles
            .iter()
            .flatten()
            .chain(self.segments.iter().flatten())
            .find(|&&i| i as usize >= n)
        {
            Some(i) => Err(format!("vertex index {i} of {n}")),
            None => Ok(()),
        }
    }
}
