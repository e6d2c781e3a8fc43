//! Turns the statements of an OBJ file into meshes: one vertex for each combination of indices, polygons cut into
//! triangles.

use super::read::ObjPart;
use super::statements::{Face, NONE, Statements};
use crate::load::notes::Notes;
use crate::load::polygon::PolygonCutter;
use crate::load::surface::RawMesh;
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// With more objects than this the file is one object: its parts are pieces, not things with names.
const MOST_PARTS: usize = 256;

/// Builds the parts that have faces or segments.
pub(super) fn build(mut from: Statements, notes: &mut Notes) -> Vec<ObjPart> {
    if from.parts.len() > MOST_PARTS {
        notes.add(format!("{} objects are merged into one", from.parts.len()));
        from.parts.truncate(1);
        from.parts[0].clear();
        from.faces.iter_mut().for_each(|f| f.part = 0);
        from.segments.iter_mut().for_each(|s| s.part = 0);
    }
    let mut builder = Builder {
        known: vec![Known { uv: NONE, normal: NONE, vertex: NONE }; from.positions.len()],
        others: HashMap::new(),
        cutter: PolygonCutter::new(),
        polygon: Vec::new(),
        vertices: Vec::new(),
        from: &from,
    };
    // Faces come in the order of their parts, so that each part is one run.
    let (mut parts, mut faces, mut segments) = (Vec::new(), 0, 0);
    for (number, name) in from.parts.iter().enumerate() {
        let face_end = faces + from.faces[faces..].partition_point(|f| usize::from(f.part) <= number);
        let segment_end =
            segments + from.segments[segments..].partition_point(|s| usize::from(s.part) <= number);
        if face_end > faces || segment_end > segments {
            parts.push(builder.part(name.clone(), faces..face_end, segments..segment_end));
        }
        (faces, segments) = (face_end, segment_end);
    }
    if builder.cutter.fans() > 0 {
        notes.add(format!(
            "{} polygons are too large or too tangled and are filled as fans",
            builder.cutter.fans()
        ));
    }
    parts
}

/// The first combination of indices seen with a position; most positions have no second.
#[derive(Clone, Copy)]
struct Known {
    uv: u32,
    normal: u32,
    vertex: u32,
}

struct Builder<'a> {
    from: &'a Statements,
    known: Vec<Known>,
    others: HashMap<[u32; 3], u32>,
    cutter: PolygonCutter,
    polygon: Vec<DVec3>,
    vertices: Vec<u32>,
}

impl Builder<'_> {
    fn part(
        &mut self,
        name: String,
        faces: std::ops::Range<usize>,
        segments: std::ops::Range<usize>,
    ) -> ObjPart {
        let from = self.from;
        let mut mesh = RawMesh::default();
        let mut slots = SlotTable { slot_of: HashMap::new(), materials: Vec::new(), last: None };
        mesh.triangles.reserve(faces.len());
        self.others.clear();
        for number in faces.clone() {
            let slot = slots.slot(&from.faces[number]);
            self.face(number, slot, &mut mesh);
        }
        for segment in &from.segments[segments.clone()] {
            let ends = segment.ends.map(|v| self.vertex(v, NONE, NONE, &mut mesh));
            mesh.segments.push(ends);
        }
        // Leave the table clean for the next part, touching only what this one used.
        let used = faces.flat_map(|f| from.corners_of(f)).map(|c| from.corners[c]);
        for v in used.chain(from.segments[segments].iter().flat_map(|s| s.ends)) {
            self.known[v as usize].vertex = NONE;
        }
        if slots.materials.len() < 2 {
            mesh.slots.clear();
        }
        if mesh.normals.iter().all(|&n| n == Vec3::ZERO) {
            // None of this part's faces has normals, though others have: they are generated, not repaired.
            mesh.normals.clear();
        }
        let materials = slots.materials.iter().map(|&m| from.materials[usize::from(m)].clone()).collect();
        ObjPart { name, mesh, materials }
    }

    fn face(&mut self, number: usize, slot: u16, mesh: &mut RawMesh) {
        let from = self.from;
        self.vertices.clear();
        self.polygon.clear();
        for corner in from.corners_of(number) {
            let v = from.corners[corner];
            let uv = from.corner_uvs.get(corner).copied().unwrap_or(NONE);
            let normal = from.corner_normals.get(corner).copied().unwrap_or(NONE);
            let vertex = self.vertex(v, uv, normal, mesh);
            self.vertices.push(vertex);
            self.polygon.push(from.positions[v as usize]);
        }
        let vertices = &self.vertices;
        self.cutter.cut(&self.polygon, |t| {
            mesh.triangles.push(t.map(|i| vertices[i]));
            mesh.slots.push(slot);
        });
    }

    /// Returns the vertex of a combination of indices, and adds it when it is new.
    fn vertex(&mut self, v: u32, uv: u32, normal: u32, mesh: &mut RawMesh) -> u32 {
        let known = &mut self.known[v as usize];
        if known.vertex == NONE {
            let vertex = add_vertex(self.from, [v, uv, normal], mesh);
            *known = Known { uv, normal, vertex };
            return vertex;
        }
        if known.uv == uv && known.normal == normal {
            return known.vertex;
        }
        *self.others.entry([v, uv, normal]).or_insert_with(|| add_vertex(self.from, [v, uv, normal], mesh))
    }
}

fn add_vertex(from: &Statements, [v, uv, normal]: [u32; 3], mesh: &mut RawMesh) -> u32 {
    mesh.positions.push(from.positions[v as usize]);
    if !from.colors.is_empty() {
        mesh.colors.push(from.colors[v as usize]);
    }
    if !from.corner_uvs.is_empty() {
        mesh.uvs.push(if uv == NONE { Vec2::ZERO } else { from.uvs[uv as usize] });
    }
    if !from.corner_normals.is_empty() {
        mesh.normals.push(if normal == NONE { Vec3::ZERO } else { from.normals[normal as usize] });
    }
    (mesh.positions.len() - 1) as u32
}

/// Numbers the materials of a part in the order of their first use.
struct SlotTable {
    slot_of: HashMap<u16, u16>,
    materials: Vec<u16>,
    last: Option<(u16, u16)>,
}

impl SlotTable {
    fn slot(&mut self, face: &Face) -> u16 {
        if let Some((material, slot)) = self.last
            && material == face.material
        {
            return slot;
        }
        let next = self.materials.len() as u16;
        let slot = *self.slot_of.entry(face.material).or_insert(next);
        if slot == next {
            self.materials.push(face.material);
        }
        self.last = Some((face.material, slot));
        slot
    }
}
