//! Normals for surfaces that come without: smooth over gentle edges, sharp at creases.
//!
//! The faces around a point are joined over the edges they share there, as long as the faces meet at less than
//! [`CREASE_DEGREES`]; each group of joined faces gets the mean of its normals weighted by the angle of the corner
//! (G. Thürmer and C. A. Wüthrich, *Computing Vertex Normals from Polygonal Facets*, JGT 3(1), 1998). A vertex in
//! more than one group is duplicated. Vertices at exactly the same position count as one point, so that texture
//! seams and unconnected triangles are smooth too. The work is `n log n` for any valence.

use super::surface::RawMesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::hash::{BuildHasher, RandomState};

/// Edges sharper than this stay sharp. Below 40 the facets of a 9-sided column would show; above 44 the bevels of
/// an eight-sided bolt would blur.
pub(crate) const CREASE_DEGREES: f64 = 40.0;

/// Generates all normals of a mesh, and duplicates vertices at creases.
pub(crate) fn generate_normals(mesh: &mut RawMesh) {
    let points = weld(&mesh.positions);
    let fans = Fans::around(&mesh.triangles, &points);
    let faces: Vec<Face> = mesh.triangles.par_iter().map(|t| Face::of(mesh, t)).collect();
    let mut grouping = Grouping::new(mesh.positions.len());
    for point in 0..fans.len() {
        grouping.group(mesh, &points, &faces, fans.corners(point));
    }
    mesh.normals = grouping.normals;
}

/// Replaces normals that are zero or not finite by those of the faces, makes the others one long, and returns how
/// many were replaced.
pub(crate) fn repair_normals(mesh: &mut RawMesh) -> usize {
    let mut bad = Vec::new();
    for (i, normal) in mesh.normals.iter_mut().enumerate() {
        match normal.as_dvec3().try_normalize() {
            Some(unit) if normal.is_finite() => *normal = unit.as_vec3(),
            _ => bad.push(i),
        }
    }
    if bad.is_empty() {
        return 0;
    }
    let mut sums: HashMap<u32, DVec3> = bad.iter().map(|&i| (i as u32, DVec3::ZERO)).collect();
    for t in &mesh.triangles {
        let area = area_vector(mesh, t);
        for i in t {
            if let Some(sum) = sums.get_mut(i) {
                *sum += area.normalize_or_zero();
            }
        }
    }
    for (i, sum) in sums {
        mesh.normals[i as usize] = sum.normalize_or(DVec3::Y).as_vec3();
    }
    bad.len()
}

fn area_vector(mesh: &RawMesh, t: &[u32; 3]) -> DVec3 {
    let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
    // Scaled by the longest edge, so that triangles of any size have a normal.
    let (u, v) = (b - a, c - a);
    let longest = u.abs().max(v.abs()).max_element();
    if longest > 0.0 && longest.is_finite() { (u / longest).cross(v / longest) } else { DVec3::ZERO }
}

fn face_normal(mesh: &RawMesh, t: &[u32; 3]) -> Vec3 {
    area_vector(mesh, t).normalize_or_zero().as_vec3()
}

/// Gives the same number to all vertices at exactly the same position, counted up in their order.
///
/// The table holds only vertex numbers, a fifth of what a map from positions would take on large scans.
pub(crate) fn weld(positions: &[DVec3]) -> Vec<u32> {
    // + 0 turns -0 into 0
    let key = |p: &DVec3| p.to_array().map(|c| (c + 0.0).to_bits());
    let hasher = RandomState::new();
    let mask = (positions.len() * 2).next_power_of_two() - 1;
    let mut table = vec![u32::MAX; mask + 1];
    let mut points: Vec<u32> = Vec::with_capacity(positions.len());
    let mut next = 0;
    for (i, position) in positions.iter().enumerate() {
        let wanted = key(position);
        let mut place = hasher.hash_one(wanted) as usize & mask;
        let point = loop {
            match table[place] {
                u32::MAX => {
                    table[place] = i as u32;
                    next += 1;
                    break next - 1;
                }
                known if key(&positions[known as usize]) == wanted => break points[known as usize],
                _ => place = (place + 1) & mask,
            }
        };
        points.push(point);
    }
    points
}

/// The corners around each point, in compressed rows; a corner is `3 * triangle + place`.
struct Fans {
    starts: Vec<u32>,
    corners: Vec<u32>,
}

impl Fans {
    fn around(triangles: &[[u32; 3]], points: &[u32]) -> Self {
        let count = points.iter().max().map_or(0, |&p| p as usize + 1);
        let mut starts = vec![0u32; count + 1];
        for &i in triangles.iter().flatten() {
            starts[points[i as usize] as usize + 1] += 1;
        }
        for p in 0..count {
            starts[p + 1] += starts[p];
        }
        let mut next = starts.clone();
        let mut corners = vec![0u32; triangles.len() * 3];
        for (corner, &i) in triangles.iter().flatten().enumerate() {
            let place = &mut next[points[i as usize] as usize];
            corners[*place as usize] = corner as u32;
            *place += 1;
        }
        Self { starts, corners }
    }

    fn len(&self) -> usize {
        self.starts.len() - 1
    }

    fn corners(&self, point: usize) -> &[u32] {
        &self.corners[self.starts[point] as usize..self.starts[point + 1] as usize]
    }
}

/// Finds groups of faces around points and hands out their normals.
struct Grouping {
    normals: Vec<Vec3>,
    given: Vec<bool>,
    crease: f32,
    /// Half of the crease: faces that are all this near to their mean are nearer than the crease to each other.
    near: f32,
    leader: Vec<u32>,
    edges: Vec<(u32, u32)>,
    members: Vec<(u32, u32, u32)>,
}

impl Grouping {
    fn new(vertices: usize) -> Self {
        Self {
            normals: vec![Vec3::Y; vertices],
            given: vec![false; vertices],
            crease: CREASE_DEGREES.to_radians().cos() as f32,
            near: (CREASE_DEGREES * 0.5).to_radians().cos() as f32,
            leader: Vec::new(),
            edges: Vec::new(),
            members: Vec::new(),
        }
    }

    /// Groups the corners around one point and gives each group's normal to its vertices.
    fn group(&mut self, mesh: &mut RawMesh, points: &[u32], faces: &[Face], corners: &[u32]) {
        let face = |corner: u32| faces[corner as usize / 3].normal;
        let mean = corners.iter().map(|&c| face(c)).sum::<Vec3>().normalize_or_zero();
        let gentle = corners.iter().all(|&c| face(c) == Vec3::ZERO || face(c).dot(mean) >= self.near);
        if gentle {
            let normal = weighted(faces, corners.iter().copied()).or(mean.try_normalize()).unwrap_or(Vec3::Y);
            for &corner in corners {
                let vertex = mesh.triangles[corner as usize / 3][corner as usize % 3] as usize;
                self.normals[vertex] = normal;
                self.given[vertex] = true;
            }
            return;
        }
        self.join_over_edges(mesh, points, faces, corners);
        self.members.clear();
        for (place, &corner) in corners.iter().enumerate() {
            let vertex = mesh.triangles[corner as usize / 3][corner as usize % 3];
            self.members.push((find(&mut self.leader, place as u32), vertex, corner));
        }
        self.members.sort_unstable();
        let members = std::mem::take(&mut self.members);
        for group in members.chunk_by(|a, b| a.0 == b.0) {
            let normal = weighted(faces, group.iter().map(|m| m.2)).unwrap_or(Vec3::Y);
            for same in group.chunk_by(|a, b| a.1 == b.1) {
                let vertex = self.vertex_for_group(mesh, same[0].1);
                self.normals[vertex as usize] = normal;
                for &(_, _, corner) in same {
                    mesh.triangles[corner as usize / 3][corner as usize % 3] = vertex;
                }
            }
        }
        self.members = members;
    }

    /// Joins corners whose faces share an edge at the point and meet gently there.
    fn join_over_edges(&mut self, mesh: &RawMesh, points: &[u32], faces: &[Face], corners: &[u32]) {
        self.leader.clear();
        self.leader.extend(0..corners.len() as u32);
        self.edges.clear();
        for (place, &corner) in corners.iter().enumerate() {
            let (t, k) = (corner as usize / 3, corner as usize % 3);
            for other in [(k + 1) % 3, (k + 2) % 3] {
                let vertex = self.first_copy(mesh, points, mesh.triangles[t][other]);
                self.edges.push((vertex, place as u32));
            }
        }
        self.edges.sort_unstable();
        for pair in 0..self.edges.len().saturating_sub(1) {
            let ((a, first), (b, second)) = (self.edges[pair], self.edges[pair + 1]);
            let face = |place: u32| faces[corners[place as usize] as usize / 3].normal;
            let (m, n) = (face(first), face(second));
            if a == b && (m.dot(n) >= self.crease || m == Vec3::ZERO || n == Vec3::ZERO) {
                let (x, y) = (find(&mut self.leader, first), find(&mut self.leader, second));
                self.leader[x.max(y) as usize] = x.min(y);
            }
        }
    }

    /// Returns the point of a vertex; copies made at creases have the point of their original.
    fn first_copy(&self, mesh: &RawMesh, points: &[u32], vertex: u32) -> u32 {
        let mut vertex = vertex as usize;
        if vertex >= points.len() {
            vertex = mesh.copied_from[vertex - points.len()] as usize;
        }
        points[vertex]
    }

    /// Returns the vertex itself for the first group that asks, and copies of it for others.
    fn vertex_for_group(&mut self, mesh: &mut RawMesh, vertex: u32) -> u32 {
        let i = vertex as usize;
        if !self.given[i] {
            self.given[i] = true;
            return vertex;
        }
        let copy = mesh.positions.len() as u32;
        mesh.positions.push(mesh.positions[i]);
        if !mesh.uvs.is_empty() {
            mesh.uvs.push(mesh.uvs[i]);
        }
        if !mesh.colors.is_empty() {
            mesh.colors.push(mesh.colors[i]);
        }
        mesh.copied_from.push(vertex);
        self.normals.push(Vec3::Y);
        self.given.push(true);
        copy
    }
}

fn find(leader: &mut [u32], mut place: u32) -> u32 {
    while leader[place as usize] != place {
        let above = leader[leader[place as usize] as usize];
        leader[place as usize] = above;
        place = above;
    }
    place
}

/// What the grouping needs to know of a triangle.
struct Face {
    /// Unit normal; zero for triangles without area.
    normal: Vec3,
    /// Angles at the corners.
    angles: [f32; 3],
}

impl Face {
    fn of(mesh: &RawMesh, t: &[u32; 3]) -> Self {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        let angles = [angle(b - a, c - a), angle(c - b, a - b), angle(a - c, b - c)].map(|a| a as f32);
        Self { normal: face_normal(mesh, t), angles }
    }
}

/// Returns the mean of the faces' normals weighted by the angles of the corners, if it points anywhere.
fn weighted(faces: &[Face], corners: impl Iterator<Item = u32>) -> Option<Vec3> {
    let sum: DVec3 = corners
        .map(|corner| {
            let face = &faces[corner as usize / 3];
            face.normal.as_dvec3() * f64::from(face.angles[corner as usize % 3])
        })
        .sum();
    Some(sum.try_normalize()?.as_vec3())
}

fn angle(u: DVec3, v: DVec3) -> f64 {
    let (cosine, lengths) = (u.dot(v), (u.length_squared() * v.length_squared()).sqrt());
    let share = cosine / lengths;
    if share.is_finite() { share.clamp(-1.0, 1.0).acos() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed strip of `n` quads around y, split into triangles that share no vertex.
    fn column(n: u32) -> RawMesh {
        let mut mesh = RawMesh::default();
        let ring = |i: u32, y: f64| {
            let a = std::f64::consts::TAU * f64::from(i % n) / f64::from(n);
            DVec3::new(a.sin(), y, a.cos())
        };
        for i in 0..n {
            let (a, b, c, d) = (ring(i, 0.0), ring(i + 1, 0.0), ring(i + 1, 1.0), ring(i, 1.0));
            for corner in [a, b, c, a, c, d] {
                mesh.positions.push(corner);
            }
        }
        mesh.triangles = (0..n * 2).map(|t| [t * 3, t * 3 + 1, t * 3 + 2]).collect();
        mesh
    }

    #[test]
    fn a_round_column_is_smooth_and_a_square_one_sharp() {
        let mut round = column(24);
        generate_normals(&mut round);
        for (p, n) in round.positions.iter().zip(&round.normals) {
            let outward = DVec3::new(p.x, 0.0, p.z).as_vec3();
            assert!((outward - *n).length() < 1e-5, "{p}: {n}");
        }
        let mut square = column(4);
        generate_normals(&mut square);
        for t in &square.triangles {
            let face = face_normal(&square, t);
            for &i in t {
                assert!((square.normals[i as usize] - face).length() < 1e-6);
            }
        }
    }

    #[test]
    fn shared_corners_of_a_cube_are_split_in_three() {
        let mut cube = RawMesh {
            positions: (0..8u32)
                .map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)))
                .collect(),
            ..RawMesh::default()
        };
        for [a, b, c, d] in
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        {
            cube.triangles.extend([[a, b, c], [a, c, d]]);
        }
        generate_normals(&mut cube);
        assert_eq!((cube.positions.len(), cube.normals.len()), (24, 24));
        for t in &cube.triangles {
            assert!(t.iter().all(|&i| (cube.normals[i as usize] - face_normal(&cube, t)).length() < 1e-6));
        }
    }

    #[test]
    fn a_fan_of_many_faces_around_one_point_is_not_slow() {
        let n = 200_000u32;
        let mut fan = RawMesh { positions: vec![DVec3::ZERO], ..RawMesh::default() };
        for i in 0..n {
            // up and down: every edge is a crease
            let a = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            fan.positions.push(DVec3::new(a.sin(), f64::from(i % 2), a.cos()));
        }
        fan.triangles = (0..n).map(|i| [0, i + 1, (i + 1) % n + 1]).collect();
        generate_normals(&mut fan);
        assert!(fan.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4));
    }

    #[test]
    fn normals_that_are_none_are_taken_from_the_faces() {
        let mut mesh = RawMesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            normals: vec![Vec3::ZERO, Vec3::NAN, Vec3::new(0.0, 0.0, 9.0)],
            triangles: vec![[0, 1, 2]],
            ..RawMesh::default()
        };
        assert_eq!(repair_normals(&mut mesh), 2);
        assert_eq!(mesh.normals, [Vec3::Z; 3]);
    }
}
