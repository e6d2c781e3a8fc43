//! The statements of an OBJ file in arrays, before they become meshes.

use crate::load::error::Fault;
use crate::load::notes::Notes;
use glam::{DVec3, Vec2, Vec3};

/// No index.
pub(super) const NONE: u32 = u32::MAX;

/// A face: its corners are those from `first` to the next face's.
#[derive(Clone, Copy)]
pub(super) struct Face {
    pub(super) first: u32,
    pub(super) line: u32,
    pub(super) material: u16,
    pub(super) part: u16,
}

/// A free segment.
#[derive(Clone, Copy)]
pub(super) struct Segment {
    pub(super) ends: [u32; 2],
    pub(super) line: u32,
    pub(super) part: u16,
}

/// All statements of a file, in arrays; texture and normal indices are only stored once there is one.
#[derive(Default)]
pub(super) struct Statements {
    pub(super) positions: Vec<DVec3>,
    pub(super) colors: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    pub(super) corners: Vec<u32>,
    pub(super) corner_uvs: Vec<u32>,
    pub(super) corner_normals: Vec<u32>,
    pub(super) faces: Vec<Face>,
    pub(super) segments: Vec<Segment>,
    pub(super) materials: Vec<Option<String>>,
    pub(super) parts: Vec<String>,
    pub(super) libraries: Vec<String>,
    pub(super) triangles: u64,
    pub(super) skipped_faces: usize,
    pub(super) points: usize,
}

impl Statements {
    pub(super) fn push_corner(&mut self, v: u32, vt: u32, vn: u32) {
        let before = self.corners.len();
        self.corners.push(v);
        for (list, index) in [(&mut self.corner_uvs, vt), (&mut self.corner_normals, vn)] {
            if index != NONE || !list.is_empty() {
                list.resize(before, NONE);
                list.push(index);
            }
        }
    }

    pub(super) fn drop_corners(&mut self, first: usize) {
        self.corners.truncate(first);
        self.corner_uvs.truncate(first);
        self.corner_normals.truncate(first);
    }

    /// Returns the corners of a face as a range into the corner arrays.
    pub(super) fn corners_of(&self, face: usize) -> std::ops::Range<usize> {
        let end = self.faces.get(face + 1).map_or(self.corners.len(), |next| next.first as usize);
        self.faces[face].first as usize..end
    }

    /// Drops indices to texture vertices or normals where the file has none at all, as some exporters write them.
    pub(super) fn forget_absent_attributes(&mut self, notes: &mut Notes) {
        for (what, list, count) in [
            ("texture vertices", &mut self.corner_uvs, self.uvs.len()),
            ("normals", &mut self.corner_normals, self.normals.len()),
        ] {
            if count == 0 && !list.is_empty() {
                list.clear();
                notes.add(format!("faces refer to {what}, but there are none"));
            }
        }
    }

    pub(super) fn check_indices(&mut self) -> Result<(), Fault> {
        let lists = [
            ("vertex", &self.corners, self.positions.len()),
            ("texture vertex", &self.corner_uvs, self.uvs.len()),
            ("normal", &self.corner_normals, self.normals.len()),
        ];
        let wrong = |line: u32, what: &str, index: u32, count: usize| {
            Err(Fault::malformed(format!("line {line}: {what} {} of {count}", u64::from(index) + 1)))
        };
        for (what, list, count) in lists {
            if let Some(corner) = list.iter().position(|&i| i != NONE && i as usize >= count) {
                let face = self.faces.partition_point(|f| f.first as usize <= corner) - 1;
                return wrong(self.faces[face].line, what, list[corner], count);
            }
        }
        let count = self.positions.len();
        for segment in &self.segments {
            if let Some(&end) = segment.ends.iter().find(|&&i| i as usize >= count) {
                return wrong(segment.line, "vertex", end, count);
            }
        }
        for list in [&mut self.corner_uvs, &mut self.corner_normals] {
            if !list.is_empty() {
                list.resize(self.corners.len(), NONE);
            }
        }
        if !self.colors.is_empty() {
            self.colors.resize(count, Vec3::ONE);
        }
        Ok(())
    }
}
