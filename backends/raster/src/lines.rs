//! Which lines does a model have: the edges of its faces, and its free segments?
//!
//! A face is what lies in one plane: the diagonal of a box's side is no edge of it. Corners are told apart by their
//! places, since a mesh with sharp edges has several vertices at one corner.

use crate::model::{Class, Model, Part, Role};
use crate::tile::NO_TRIANGLE;
use glam::{DVec3, Vec3};

/// How far out of a triangle's plane its neighbor's corner may be, as a share of the edge, to lie in one face with it.
const FLAT: f64 = 1e-5;

/// A line between two vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Edge {
    /// Vertices of the part.
    pub(crate) ends: [u32; 2],
    /// Triangles of the part on both sides, where there are any.
    pub(crate) sides: [u32; 2],
}

/// The lines of a model, part by part.
#[derive(Default)]
pub(crate) struct Lines {
    edges: Vec<Edge>,
    /// Where those of each part end.
    ends: Vec<usize>,
}

/// An edge as one triangle has it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct HalfEdge {
    /// The places of both ends, the smaller one first.
    places: [[u32; 3]; 2],
    triangle: u32,
    corner: u32,
}

impl Lines {
    pub(crate) fn of(model: &Model) -> Self {
        let mut lines = Self::default();
        for part in &model.parts {
            lines.add(part);
            lines.ends.push(lines.edges.len());
        }
        lines
    }

    /// Returns the lines of a part.
    pub(crate) fn of_part(&self, part: usize) -> &[Edge] {
        &self.edges[if part == 0 { 0 } else { self.ends[part - 1] }..self.ends[part]]
    }

    pub(crate) fn count(&self) -> usize {
        self.edges.len()
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.edges.len() * size_of::<Edge>()) as u64
    }

    fn add(&mut self, part: &Part) {
        let mesh = part.mesh();
        let is_seen = |t: &usize| part.class(Role::Camera, mesh.slot(*t)) != Class::Nothing;
        let mut halves: Vec<HalfEdge> = (0..mesh.triangles.len())
            .filter(is_seen)
            .flat_map(|t| (0..3).map(move |corner| half_edge(part, t, corner)))
            .collect();
        halves.sort_unstable();
        for same in halves.chunk_by(|a, b| a.places == b.places) {
            let (first, second) = (&same[0], same.get(1));
            let within = same.len() == 2 && second.is_some_and(|second| in_one_face(part, first, second));
            if !within && first.places[0] != first.places[1] {
                let second = second.map_or(NO_TRIANGLE, |s| s.triangle);
                self.edges.push(Edge { ends: ends(part, first), sides: [first.triangle, second] });
            }
        }
        let of_segment = |&ends: &[u32; 2]| Edge { ends, sides: [NO_TRIANGLE; 2] };
        self.edges.extend(mesh.segments.iter().map(of_segment));
    }
}

fn ends(part: &Part, half: &HalfEdge) -> [u32; 2] {
    let corners = part.mesh().triangles[half.triangle as usize];
    [corners[half.corner as usize], corners[(half.corner as usize + 1) % 3]]
}

fn half_edge(part: &Part, triangle: usize, corner: u32) -> HalfEdge {
    let mut half = HalfEdge { places: [[0; 3]; 2], triangle: triangle as u32, corner };
    // Adding 0 makes one number of 0 and -0.
    let place = |i: u32| (part.mesh().positions[i as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    half.places = ends(part, &half).map(place);
    half.places.sort_unstable();
    half
}

/// Tells whether two triangles are parts of one flat face.
fn in_one_face(part: &Part, a: &HalfEdge, b: &HalfEdge) -> bool {
    let mesh = part.mesh();
    if mesh.slot(a.triangle as usize) != mesh.slot(b.triangle as usize) {
        return false;
    }
    let at = |i: u32| mesh.positions[i as usize].as_dvec3();
    let [from, to] = ends(part, a).map(at);
    let along = to - from;
    let across = |half: &HalfEdge| {
        let corners = mesh.triangles[half.triangle as usize];
        along.cross(at(corners[(half.corner as usize + 2) % 3]) - from)
    };
    // Twice the areas, as vectors; in one plane and on both sides of the edge they are opposite.
    let (a, b): (DVec3, DVec3) = (across(a), across(b));
    a.dot(b) < 0.0 && a.cross(b).length() <= FLAT * a.length() * b.length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use polyptych_core::scene::{Mesh, Object, Scene, Shape};
    use std::sync::Arc;

    fn lines_of(mesh: Mesh) -> Lines {
        let mut scene = Scene::default();
        let shape = Arc::new(Shape::Mesh(mesh));
        scene
            .objects
            .push(Object { shape: shape.clone(), ..Object::new("mesh", Shape::Mesh(Mesh::default()), 0) });
        let mut model = Model::default();
        assert!(model.add(&scene, 0, crate::model::Source::Given(shape), None));
        Lines::of(&model)
    }

    #[test]
    fn a_box_of_triangles_with_corners_of_their_own_has_twelve_edges() {
        let mut mesh = Mesh::default();
        for axis in 0..3 {
            for side in [0.0, 1.0f32] {
                let first = mesh.positions.len() as u32;
                for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                    let mut p = [0.0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, u, v);
                    mesh.positions.push(Vec3::from_array(p));
                }
                mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
        let lines = lines_of(mesh.clone());
        assert_eq!(lines.of_part(0).len(), 12);
        assert!(lines.of_part(0).iter().all(|e| e.sides[0] / 2 != e.sides[1] / 2));
        // Segments are lines, too, and a diagonal between two materials is one.
        mesh.segments.push([0, 6]);
        mesh.slots = (0..12).map(|t| u16::from(t == 0)).collect();
        assert_eq!(lines_of(mesh).count(), 14);
    }

    #[test]
    fn a_triangle_folded_back_onto_its_neighbor_keeps_its_edges() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.2, 0.7, 0.0)];
        let folded = Mesh { positions, triangles: vec![[0, 1, 2], [0, 1, 3]], ..Mesh::default() };
        assert_eq!(lines_of(folded).count(), 5);
    }
}
