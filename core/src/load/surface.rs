//! From what a file says about a surface to a [`Mesh`]: repairs, normals, and a place near the origin.

use super::notes::Notes;
use super::smooth;
use crate::math::Aabb;
use crate::scene::Mesh;
use glam::{DAffine3, DVec3, Vec2, Vec3};

/// A mesh as a file gives it: positions in double precision, anything may be not finite.
#[derive(Clone, Debug, Default)]
pub(crate) struct RawMesh {
    pub(crate) positions: Vec<DVec3>,
    /// Empty, or one for each position; zero or not finite where the file gives none.
    pub(crate) normals: Vec<Vec3>,
    pub(crate) uvs: Vec<Vec2>,
    pub(crate) colors: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) slots: Vec<u16>,
    pub(crate) segments: Vec<[u32; 2]>,
    /// The originals of the last vertices, which were duplicated at creases.
    pub(crate) copied_from: Vec<u32>,
}

/// A model further from the origin than this many of its radii is moved to it: at 16 radii `f32` still places a
/// vertex to a millionth of the radius.
const FAR: f64 = 16.0;

/// Sizes between these are kept; others are scaled to one, so that squares and cubes of lengths stay in `f32`.
const SIZES: std::ops::Range<f64> = 1e-6..1e9;

impl RawMesh {
    /// Drops triangles and segments with a corner that is nowhere, and repairs attributes that are no numbers.
    pub(crate) fn repair(&mut self, name: &str, notes: &mut Notes) {
        if let Some(bad) = self.drop_broken_faces() {
            notes.add(format!("{name}: {bad} faces or lines with a corner that is not finite are left out"));
        }
        let mut strange = 0;
        for uv in self.uvs.iter_mut().filter(|uv| !uv.is_finite()) {
            *uv = Vec2::ZERO;
            strange += 1;
        }
        for color in self.colors.iter_mut().filter(|c| !c.is_finite()) {
            *color = Vec3::ONE;
            strange += 1;
        }
        if strange > 0 {
            notes.add(format!(
                "{name}: {strange} texture coordinates or colors that are not finite are replaced"
            ));
        }
    }

    fn drop_broken_faces(&mut self) -> Option<usize> {
        if self.positions.iter().all(|p| p.is_finite()) {
            return None;
        }
        let before = self.triangles.len() + self.segments.len();
        let sound: Vec<bool> = self.positions.iter().map(|p| p.is_finite()).collect();
        let keep = |t: &[u32; 3]| t.iter().all(|&i| sound[i as usize]);
        if !self.slots.is_empty() {
            let kept = self.triangles.iter().zip(&self.slots).filter(|(t, _)| keep(t)).map(|(_, &s)| s);
            self.slots = kept.collect();
        }
        self.triangles.retain(keep);
        self.segments.retain(|s| s.iter().all(|&i| sound[i as usize]));
        for p in self.positions.iter_mut().filter(|p| !p.is_finite()) {
            *p = DVec3::ZERO;
        }
        let dropped = before - self.triangles.len() - self.segments.len();
        (dropped > 0).then_some(dropped)
    }

    /// Gives every vertex a unit normal: the file's where it has one, else a generated one.
    pub(crate) fn complete_normals(&mut self, name: &str, notes: &mut Notes) {
        if self.triangles.is_empty() {
            self.normals.clear();
            return;
        }
        if self.normals.is_empty() {
            smooth::generate_normals(self);
            notes.add(format!(
                "normals generated, creases sharper than {} degrees kept",
                smooth::CREASE_DEGREES
            ));
        } else {
            let bad = smooth::repair_normals(self);
            if bad > 0 {
                notes.add(format!(
                    "{name}: {bad} normals are zero or not finite, those of the faces are taken"
                ));
            }
        }
    }

    /// Drops vertices that no triangle and no segment uses.
    pub(crate) fn keep_used_vertices(&mut self) {
        let mut place = vec![u32::MAX; self.positions.len()];
        let mut order = Vec::new();
        for i in self.triangles.iter_mut().flatten().chain(self.segments.iter_mut().flatten()) {
            let to = &mut place[*i as usize];
            if *to == u32::MAX {
                *to = order.len() as u32;
                order.push(*i as usize);
            }
            *i = *to;
        }
        fn pick<T: Copy>(list: &mut Vec<T>, order: &[usize]) {
            if !list.is_empty() {
                *list = order.iter().map(|&i| list[i]).collect();
            }
        }
        pick(&mut self.positions, &order);
        pick(&mut self.normals, &order);
        pick(&mut self.uvs, &order);
        pick(&mut self.colors, &order);
    }

    /// Makes one vertex of all at the same position; only for meshes without attributes.
    pub(crate) fn weld(&mut self) {
        let points = smooth::weld(&self.positions);
        let mut welded = Vec::new();
        for (position, &point) in self.positions.iter().zip(&points) {
            if point as usize == welded.len() {
                welded.push(*position);
            }
        }
        self.triangles.iter_mut().flatten().for_each(|i| *i = points[*i as usize]);
        self.positions = welded;
    }

    /// Adds another mesh; attributes that only one of the two has are filled up.
    pub(crate) fn append(&mut self, other: Self) {
        let (first, second) = (self.positions.len(), other.positions.len());
        join(&mut self.normals, other.normals, [first, second], Vec3::Y);
        join(&mut self.uvs, other.uvs, [first, second], Vec2::ZERO);
        join(&mut self.colors, other.colors, [first, second], Vec3::ONE);
        join(&mut self.slots, other.slots, [self.triangles.len(), other.triangles.len()], 0);
        self.positions.extend(other.positions);
        let shift = first as u32;
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + shift)));
        self.segments.extend(other.segments.iter().map(|s| s.map(|i| i + shift)));
    }

    /// Moves the mesh next to the origin where it is far, scales it where it is huge or tiny, and returns it with
    /// the map back to where it was.
    pub(crate) fn settle(self) -> (Mesh, DAffine3) {
        let used = self.triangles.iter().flatten().chain(self.segments.iter().flatten());
        let bounds = Aabb::of_points(used.map(|&i| self.positions[i as usize]));
        let (center, radius) = (bounds.center(), bounds.radius());
        let mut offset = if center.length() > FAR * radius { center } else { DVec3::ZERO };
        let reach = radius.max((center - offset).length());
        let scale = if reach > 0.0 && reach.is_finite() && !SIZES.contains(&reach) { reach } else { 1.0 };
        if !offset.is_finite() {
            offset = DVec3::ZERO;
        }
        let place = |p: &DVec3| ((*p - offset) / scale).as_vec3();
        let mesh = Mesh {
            positions: self.positions.iter().map(place).collect(),
            normals: self.normals,
            uvs: self.uvs,
            colors: self.colors,
            triangles: self.triangles,
            slots: self.slots,
            segments: self.segments,
        };
        (mesh, DAffine3::from_scale_rotation_translation(DVec3::splat(scale), glam::DQuat::IDENTITY, offset))
    }

    /// Repairs, completes and settles: the way from a file to a mesh.
    pub(crate) fn finish(mut self, name: &str, notes: &mut Notes) -> (Mesh, DAffine3) {
        self.repair(name, notes);
        self.complete_normals(name, notes);
        self.settle()
    }
}

fn join<T: Copy>(first: &mut Vec<T>, second: Vec<T>, lengths: [usize; 2], filler: T) {
    if first.is_empty() && second.is_empty() {
        return;
    }
    first.resize(lengths[0], filler);
    first.extend(second);
    first.resize(lengths[0] + lengths[1], filler);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(at: DVec3, size: f64) -> RawMesh {
        let corners = [DVec3::ZERO, DVec3::X * size, DVec3::Y * size];
        RawMesh {
            positions: corners.map(|c| c + at).to_vec(),
            triangles: vec![[0, 1, 2]],
            ..RawMesh::default()
        }
    }

    #[test]
    fn a_far_model_keeps_its_detail() {
        let at = DVec3::new(1e6, 1e6, 1e6);
        let (mesh, place) = triangle(at, 0.001).finish("t", &mut Notes::default());
        let corner = place.transform_point3(mesh.positions[1].as_dvec3());
        assert!((corner - (at + DVec3::X * 0.001)).length() < 1e-9, "{corner}");
        let (_, place) = triangle(DVec3::ONE, 1.0).finish("t", &mut Notes::default());
        assert_eq!(place, DAffine3::IDENTITY);
    }

    #[test]
    fn huge_and_tiny_models_are_scaled() {
        for size in [3e38, 1e-40, 1e-120] {
            let (mesh, place) = triangle(DVec3::ZERO, size).finish("t", &mut Notes::default());
            assert!(mesh.area() > 0.1, "{size}: {}", mesh.area());
            let corner = place.transform_point3(mesh.positions[1].as_dvec3());
            assert!((corner.x / size - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn broken_corners_take_their_faces_with_them() {
        let mut raw = triangle(DVec3::ZERO, 1.0);
        raw.append(triangle(DVec3::NAN, 1.0));
        let mut notes = Notes::default();
        let (mesh, _) = raw.finish("t", &mut notes);
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
        assert_eq!(mesh.check(), Ok(()));
        assert!(mesh.positions.iter().all(|p| p.is_finite()));
        assert!(notes.into_lines()[0].contains("1 faces"));
    }
}
