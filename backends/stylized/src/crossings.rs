//! Where do the faces of a mesh pass through each other?
//!
//! Faces are put in the order of a curve that fills space and boxes are put around every eight, around every eight of
//! those, and so on; faces whose boxes meet are cut with each other's planes. Faces that share a corner are neighbors,
//! not strangers; faces that touch without going on beyond, and faces almost in one plane, do not cross.
//!
//! Sources: T. Möller, *A fast triangle-triangle intersection test*, Journal of Graphics Tools 2(2), 1997; for the
//! order, G. M. Morton, *A computer oriented geodetic data base*, IBM, 1966.

use glam::{DVec3, Vec3};
use polyptych_core::seam::{Cancelled, Control};

/// A segment that two faces have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crossing {
    pub(crate) ends: [Vec3; 2],
    pub(crate) faces: [u32; 2],
}

/// Faces or boxes in a box.
const GROUP: usize = 8;
/// Faces that one worker looks at.
const PIECE: usize = 1024;
/// Pairs of faces that are cut at most, for each face: a mesh of which more boxes meet is a heap of slivers, and its
/// lines would blacken it.
const MOST_PAIRS: usize = 512;
/// The least sine of the angle between faces.
const LEAST_SINE: f64 = 0.02;

#[derive(Clone, Copy)]
struct Bounds {
    min: Vec3,
    max: Vec3,
}

impl Bounds {
    const NONE: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    fn and(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    fn meets(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }
}

/// The faces of a mesh in order, and the boxes around them.
struct Tree<'a> {
    places: &'a [Vec3],
    faces: &'a [[u32; 3]],
    /// Face by face in the order of the curve.
    order: Vec<u32>,
    /// Boxes of the faces in that order, then of groups of them, up to one.
    levels: Vec<Vec<Bounds>>,
    /// Shorter segments are none, and what is nearer to a plane lies on it.
    least: f64,
}

/// Finds all crossings; nothing where there are too many faces in one place.
pub(crate) fn find(
    places: &[Vec3],
    faces: &[[u32; 3]],
    control: &Control<'_>,
) -> Result<Option<Vec<Crossing>>, Cancelled> {
    let tree = Tree::of(places, faces, control)?;
    let mut pieces = vec![(Vec::new(), 0); faces.len().div_ceil(PIECE)];
    control.for_each_mut(&mut pieces, 1, &|piece, (found, pairs)| {
        for first in piece * PIECE..faces.len().min((piece + 1) * PIECE) {
            if *pairs <= MOST_PAIRS * PIECE && !control.is_cancelled() {
                tree.cross(first, found, pairs);
            }
        }
    })?;
    let is_whole = pieces.iter().all(|(_, pairs)| *pairs <= MOST_PAIRS * PIECE);
    Ok(is_whole.then(|| pieces.into_iter().flat_map(|(found, _)| found).collect()))
}

/// Spreads the ten lower bits of a number to every third.
fn spread(bits: u32) -> u32 {
    let mut x = bits & 0x3ff;
    for (shift, mask) in [(16, 0x0300_00ff), (8, 0x0300_f00f), (4, 0x030c_30c3), (2, 0x0924_9249)] {
        x = (x | x << shift) & mask;
    }
    x
}

impl<'a> Tree<'a> {
    fn of(places: &'a [Vec3], faces: &'a [[u32; 3]], control: &Control<'_>) -> Result<Self, Cancelled> {
        let bounds_of = |face: &[u32; 3]| {
            let corners = face.map(|corner| places[corner as usize]);
            corners.iter().fold(Bounds::NONE, |all, &p| all.and(Bounds { min: p, max: p }))
        };
        let own: Vec<Bounds> = faces.iter().map(bounds_of).collect();
        let all = own.iter().fold(Bounds::NONE, |all, one| all.and(*one));
        let size = all.max - all.min;
        let mut keys: Vec<u64> = own
            .iter()
            .enumerate()
            .map(|(face, bounds)| {
                let at = (bounds.min * 0.5 + bounds.max * 0.5 - all.min) / size * 1023.0;
                let [x, y, z] = at.to_array().map(|c| spread(c as u32));
                u64::from(x | y << 1 | z << 2) << 32 | face as u64
            })
            .collect();
        control.check()?;
        keys.sort_unstable();
        control.check()?;
        let order: Vec<u32> = keys.into_iter().map(|key| key as u32).collect();
        let mut levels = vec![order.iter().map(|&face| own[face as usize]).collect::<Vec<_>>()];
        while let Some(last) = levels.last()
            && last.len() > 1
        {
            let around = |group: &[Bounds]| group.iter().fold(Bounds::NONE, |all, one| all.and(*one));
            levels.push(last.chunks(GROUP).map(around).collect());
        }
        Ok(Self { places, faces, order, levels, least: f64::from(size.length()) * 1e-5 })
    }

    /// Finds where a face is crossed by those after it in the order.
    fn cross(&self, first: usize, found: &mut Vec<Crossing>, pairs: &mut usize) {
        let own = self.levels[0][first];
        // Level and place of boxes that are still to be looked into; of each level at most a group waits.
        let mut waits = vec![(self.levels.len() - 1, 0usize)];
        while let Some((level, at)) = waits.pop() {
            // Nothing after the face is in a box that ends before it.
            let end = (at + 1).saturating_mul(GROUP.pow(level as u32));
            if end <= first + 1 || !self.levels[level][at].meets(&own) {
                continue;
            }
            if level > 0 {
                let below = self.levels[level - 1].len();
                waits.extend((at * GROUP..below.min((at + 1) * GROUP)).map(|at| (level - 1, at)));
                continue;
            }
            *pairs += 1;
            let faces = [self.order[first], self.order[at]];
            if let Some(ends) = self.cut(faces) {
                found.push(Crossing { ends, faces });
            }
        }
    }

    /// Returns what two faces have in common.
    fn cut(&self, faces: [u32; 2]) -> Option<[Vec3; 2]> {
        let corners = faces.map(|face| self.faces[face as usize]);
        if corners[0].iter().any(|corner| corners[1].contains(corner)) {
            return None;
        }
        let [a, b] = corners.map(|face| face.map(|corner| self.places[corner as usize].as_dvec3()));
        let normal = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]);
        let (normal_a, normal_b) = (normal(&a), normal(&b));
        let first = self.through(&a, b[0], normal_b)?;
        let second = self.through(&b, a[0], normal_a)?;
        let along = normal_a.cross(normal_b);
        if along.length() < LEAST_SINE * normal_a.length() * normal_b.length() {
            return None;
        }
        // Both lie on the line that the planes share; they have in common what is in both.
        let sorted = |ends: [DVec3; 2]| {
            if along.dot(ends[0]) <= along.dot(ends[1]) { ends } else { [ends[1], ends[0]] }
        };
        let ([a, b], [c, d]) = (sorted(first), sorted(second));
        let from = if along.dot(a) >= along.dot(c) { a } else { c };
        let to = if along.dot(b) <= along.dot(d) { b } else { d };
        let is_one = along.dot(to - from) > 0.0 && from.distance(to) > self.least;
        is_one.then(|| [from.as_vec3(), to.as_vec3()])
    }

    /// Returns where the sides of a triangle pass through a plane that it reaches both sides of.
    fn through(&self, triangle: &[DVec3; 3], origin: DVec3, normal: DVec3) -> Option<[DVec3; 2]> {
        let heights = triangle.map(|corner| normal.dot(corner - origin));
        let reach = normal.length() * self.least;
        if !(heights.iter().any(|h| *h > reach) && heights.iter().any(|h| *h < -reach)) {
            return None;
        }
        let above = heights.map(|height| height > 0.0);
        // The corner that is alone on its side.
        let alone = (0..3).find(|&i| above[i] != above[(i + 1) % 3] && above[i] != above[(i + 2) % 3])?;
        Some([1, 2].map(|step| {
            let other = (alone + step) % 3;
            let share = heights[alone] / (heights[alone] - heights[other]);
            triangle[alone].lerp(triangle[other], share)
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::tests::cube;
    use polyptych_core::scene::Mesh;

    fn crossings(mesh: &Mesh) -> Option<Vec<Crossing>> {
        find(&mesh.positions, &mesh.triangles, &Control::simple()).unwrap()
    }

    /// A cube and another one that sticks in it.
    pub(crate) fn two_cubes(offset: Vec3) -> Mesh {
        let mut mesh = cube();
        let (count, other) = (mesh.positions.len() as u32, cube());
        mesh.positions.extend(other.positions.iter().map(|p| *p + offset));
        mesh.triangles.extend(other.triangles.iter().map(|t| t.map(|corner| corner + count)));
        mesh
    }

    #[test]
    fn cubes_cross_along_six_edges_of_what_they_share() {
        let offset = Vec3::new(0.3, 0.4, 0.55);
        let found = crossings(&two_cubes(offset)).unwrap();
        let total: f32 = found.iter().map(|c| c.ends[0].distance(c.ends[1])).sum();
        let shared = Vec3::ONE - offset;
        assert!((total - 2.0 * (shared.x + shared.y + shared.z)).abs() < 1e-5, "{total}");
        // A closed curve: an even number of ends in each place.
        for end in found.iter().flat_map(|c| c.ends) {
            let near = found.iter().flat_map(|c| c.ends).filter(|other| other.distance(end) < 1e-5).count();
            assert!(near % 2 == 0, "{near} ends at {end}");
        }
    }

    #[test]
    fn neighbors_and_strangers_do_not_cross() {
        assert_eq!(crossings(&cube()), Some(Vec::new()));
        assert_eq!(crossings(&two_cubes(Vec3::new(1.5, 0.0, 0.0))), Some(Vec::new()));
        // One within the other, of half the size.
        let mut within = two_cubes(Vec3::ZERO);
        let half = within.positions.len() / 2;
        within.positions[half..].iter_mut().for_each(|p| *p *= 0.5);
        assert_eq!(crossings(&within), Some(Vec::new()));
        assert_eq!(crossings(&Mesh::default()), Some(Vec::new()));
    }

    #[test]
    fn a_comb_is_cut_as_often_as_it_is_long_and_a_heap_is_given_up() {
        // Upright blades through one long floor, in an order that has nothing to do with their places.
        let blades = 5000u32;
        let mut mesh = Mesh::default();
        let width = 2.0 * blades as f32;
        mesh.positions.extend([Vec3::ZERO, Vec3::X * width, Vec3::new(0.0, 0.0, 1e3)]);
        mesh.triangles.push([0, 1, 2]);
        for i in 0..blades {
            let at = Vec3::new((i * 1777 % blades) as f32 + 0.5, 0.0, 1.0);
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([
                at - Vec3::Y,
                at + Vec3::new(0.0, 1.0, -0.5),
                at + Vec3::new(0.0, 1.0, 0.5),
            ]);
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        let found = crossings(&mesh).unwrap();
        assert_eq!(found.len(), blades as usize);
        assert!(found.iter().all(|c| (c.ends[0].distance(c.ends[1]) - 0.5).abs() < 1e-3));
        // All blades in one place: every one meets every other.
        for corner in &mut mesh.positions[3..] {
            corner.x = 0.0;
        }
        assert_eq!(crossings(&mesh), None);
    }
}
