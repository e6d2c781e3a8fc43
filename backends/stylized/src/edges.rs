//! Which edges does a mesh have, and what lies on both sides of each?
//!
//! Corners are told apart by their places: a mesh with sharp edges or seams in its texture has several vertices at
//! one corner. Found once for each mesh and kept as long as it is drawn.

use crate::crossings;
use glam::Vec3;
use polyptych_core::scene::Mesh;
use polyptych_core::seam::{Cancelled, Control};
use std::collections::HashMap;

/// No face on that side.
pub(crate) const NO_FACE: u32 = u32::MAX;

/// An edge with its two sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edge {
    /// Corners of the mesh.
    pub(crate) ends: [u32; 2],
    /// Faces on both sides; the second may be [`NO_FACE`].
    pub(crate) faces: [u32; 2],
    /// Cosine of the angle between the faces' normals.
    pub(crate) cosine: f32,
    /// Whether the faces wind against each other, so that one of them is seen from behind when both face the eye.
    pub(crate) is_turned: bool,
    /// Whether the faces are of different materials.
    pub(crate) parts_materials: bool,
    /// Whether more than two faces meet here.
    pub(crate) is_crowded: bool,
    /// Whether the faces have no edge in common, but pass through each other here.
    pub(crate) crosses: bool,
}

/// The edges of a mesh.
#[derive(Debug, Default)]
pub(crate) struct Edges {
    /// Planes of the faces, outward: unit normal, and its product with a corner.
    pub(crate) planes: Vec<[f32; 4]>,
    pub(crate) edges: Vec<Edge>,
    /// Places of the corners.
    pub(crate) places: Vec<Vec3>,
    /// Whether every edge has two faces that wind alike, so that no face is ever seen from behind from outside.
    pub(crate) is_closed: bool,
    /// Whether it was looked for where the mesh crosses itself.
    pub(crate) crossed: Crossed,
}

/// Where faces pass through each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Crossed {
    /// Nobody has looked.
    #[default]
    Unknown,
    /// Is among the edges.
    Found,
    /// Is left out: they do so too often.
    TooOften,
}

impl Edges {
    /// Finds the edges of a mesh. Triangles without area have none.
    #[cfg(test)]
    pub(crate) fn of(mesh: &Mesh) -> Self {
        Self::new(mesh, false, &Control::simple()).unwrap()
    }

    /// Finds the edges of a mesh, and if asked to where it crosses itself.
    pub(crate) fn new(mesh: &Mesh, crossings: bool, control: &Control<'_>) -> Result<Self, Cancelled> {
        let mut places = Vec::new();
        let mut known: HashMap<[u32; 3], u32, Mixed> =
            HashMap::with_capacity_and_hasher(mesh.positions.len(), Mixed::default());
        // Adding 0 makes one number of 0 and -0.
        let corner_of: Vec<u32> = mesh
            .positions
            .iter()
            .map(|&p| {
                *known.entry((p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert_with(|| {
                    places.push(p);
                    places.len() as u32 - 1
                })
            })
            .collect();
        let mut all = Self { places, is_closed: true, ..Self::default() };
        let mut halves = Vec::with_capacity(mesh.triangles.len() * 3);
        let mut slots = Vec::with_capacity(mesh.triangles.len());
        let mut faces = Vec::new();
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            control.check()?;
            let corners = triangle.map(|i| corner_of[i as usize]);
            let [a, b, c] = corners.map(|i| all.places[i as usize].as_dvec3());
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            let face = all.planes.len() as u32;
            let n = normal.as_vec3();
            all.planes.push([n.x, n.y, n.z, normal.dot(a) as f32]);
            slots.push(mesh.slot(t) as u16);
            if crossings {
                faces.push(corners);
            }
            for i in 0..3 {
                let (from, to) = (corners[i], corners[(i + 1) % 3]);
                let (low, high) = (from.min(to), from.max(to));
                halves.push((u64::from(low) << 32 | u64::from(high), face << 1 | u32::from(from > to)));
            }
        }
        halves.sort_unstable();
        for same in halves.chunk_by(|a, b| a.0 == b.0) {
            control.check()?;
            all.add(same, &slots);
        }
        all.is_closed &= !all.planes.is_empty();
        if crossings {
            all.cross(&faces, control)?;
        }
        Ok(all)
    }

    /// Adds where the faces of these corners cross.
    fn cross(&mut self, faces: &[[u32; 3]], control: &Control<'_>) -> Result<(), Cancelled> {
        let Some(crossings) = crossings::find(&self.places, faces, control)? else {
            self.crossed = Crossed::TooOften;
            return Ok(());
        };
        self.crossed = Crossed::Found;
        for crossing in crossings {
            let first = self.places.len() as u32;
            self.places.extend(crossing.ends);
            self.edges.push(Edge {
                ends: [first, first + 1],
                faces: crossing.faces,
                cosine: -1.0,
                is_turned: false,
                parts_materials: false,
                is_crowded: false,
                crosses: true,
            });
        }
        Ok(())
    }

    fn add(&mut self, same: &[(u64, u32)], slots: &[u16]) {
        let ends = [(same[0].0 >> 32) as u32, same[0].0 as u32];
        let face = |half: &(u64, u32)| half.1 >> 1;
        let is_crowded = same.len() > 2;
        self.is_closed &= same.len() == 2 && same[0].1 & 1 != same[1].1 & 1;
        if same.len() == 1 {
            let faces = [face(&same[0]), NO_FACE];
            self.edges.push(Edge {
                ends,
                faces,
                cosine: 1.0,
                is_turned: false,
                parts_materials: false,
                is_crowded,
                crosses: false,
            });
            return;
        }
        // Where more than two meet, each pair of neighbors in the list may be a silhouette.
        for pair in same.windows(2) {
            let faces = [face(&pair[0]), face(&pair[1])];
            let [a, b] = faces.map(|f| {
                let [x, y, z, _] = self.planes[f as usize];
                Vec3::new(x, y, z)
            });
            let is_turned = pair[0].1 & 1 == pair[1].1 & 1;
            let cosine = if is_turned { -a.dot(b) } else { a.dot(b) };
            let parts_materials = slots[faces[0] as usize] != slots[faces[1] as usize];
            self.edges.push(Edge {
                ends,
                faces,
                cosine,
                is_turned,
                parts_materials,
                is_crowded,
                crosses: false,
            });
        }
    }

    /// Foretells [`Edges::bytes`]: a closed mesh has three edges for two triangles, and half as many corners as those.
    pub(crate) fn forecast(mesh: &Mesh) -> u64 {
        let faces = mesh.triangles.len();
        (faces * 16 + faces * 3 / 2 * size_of::<Edge>() + (faces / 2) * 12) as u64
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.planes.len() * 16 + self.edges.len() * size_of::<Edge>() + self.places.len() * 12) as u64
    }
}

/// Mixes the bits of three numbers: keys are places, which nobody chooses to collide.
#[derive(Clone, Copy, Default)]
pub(crate) struct Mixed(u64);

impl std::hash::BuildHasher for Mixed {
    type Hasher = Self;
    fn build_hasher(&self) -> Self {
        Self(0)
    }
}

impl std::hash::Hasher for Mixed {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.0 = (self.0.rotate_left(23) ^ u64::from_le_bytes(word)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
    }
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 29
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A cube whose faces have corners of their own, as models have them.
    pub(crate) fn cube() -> Mesh {
        let mut mesh = Mesh::default();
        for axis in 0..3 {
            for side in [-0.5, 0.5f32] {
                let first = mesh.positions.len() as u32;
                for (u, v) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
                    let mut p = [0.0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, u, v);
                    mesh.positions.push(Vec3::from_array(p));
                }
                let (b, c) = if side > 0.0 { (1, 2) } else { (2, 1) };
                mesh.triangles.push([first, first + b, first + c]);
                let (b, c) = if side > 0.0 { (2, 3) } else { (3, 2) };
                mesh.triangles.push([first, first + b, first + c]);
            }
        }
        mesh
    }

    #[test]
    fn a_cube_has_twelve_folds_and_six_flat_diagonals() {
        let edges = Edges::of(&cube());
        assert_eq!((edges.places.len(), edges.planes.len(), edges.edges.len()), (8, 12, 18));
        assert_eq!(edges.edges.iter().filter(|e| e.cosine < 0.5).count(), 12);
        assert!(edges.is_closed && edges.edges.iter().all(|e| !e.is_turned));
        assert!((Edges::forecast(&cube()) as f64 / edges.bytes() as f64 - 1.0).abs() < 0.1);
    }

    #[test]
    fn a_million_edges_are_found_and_each_once() {
        let (rings, columns) = (600u32, 600u32);
        let at = |r: u32, c: u32| r % rings * columns + c % columns;
        let turn = |i: u32, of: u32| (i as f32 / of as f32 * std::f32::consts::TAU).sin_cos();
        let mut mesh = Mesh::default();
        for r in 0..rings {
            for c in 0..columns {
                let ((s, t), (u, v)) = (turn(r, rings), turn(c, columns));
                mesh.positions.push(Vec3::new((2.0 + t) * u, s, (2.0 + t) * v));
                let [a, b, d, e] = [at(r, c), at(r, c + 1), at(r + 1, c), at(r + 1, c + 1)];
                mesh.triangles.extend([[a, b, d], [b, e, d]]);
            }
        }
        let edges = Edges::of(&mesh);
        assert_eq!(edges.edges.len(), 3 * (rings * columns) as usize);
        assert!(edges.edges.len() > 1_000_000 && edges.is_closed);
    }

    #[test]
    fn open_crowded_and_turned_edges_are_told() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, -Vec3::Y];
        let mesh =
            |triangles: Vec<[u32; 3]>| Mesh { positions: positions.clone(), triangles, ..Mesh::default() };
        let one = Edges::of(&mesh(vec![[0, 1, 2]]));
        assert!(one.edges.len() == 3 && one.edges.iter().all(|e| e.faces[1] == NO_FACE) && !one.is_closed);
        let book = Edges::of(&mesh(vec![[0, 1, 2], [0, 1, 3], [0, 1, 4]]));
        assert_eq!(book.edges.iter().filter(|e| e.is_crowded).count(), 2);
        let turned = Edges::of(&mesh(vec![[0, 1, 2], [0, 1, 3]]));
        assert_eq!(turned.edges.iter().filter(|e| e.is_turned).count(), 1);
        assert_eq!(Edges::of(&mesh(vec![[0, 0, 1], [1, 1, 1]])).edges.len(), 0);
    }
}
