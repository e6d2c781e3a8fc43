//! Turns the primitives of a glTF mesh into one mesh with a material slot for each material.

use super::data::Data;
use super::document::{Document, MeshEntry, PrimitiveEntry};
use super::material::{Materials, UvSource};
use crate::load::error::{Fault, one_line};
use crate::load::source::Source;
use crate::load::surface::RawMesh;
use crate::scene::Shape;
use glam::{DAffine3, DVec3, Vec2, Vec3};
use std::sync::Arc;

/// A mesh that nodes can place.
#[derive(Clone)]
pub(super) struct Placeable {
    pub(super) shape: Arc<Shape>,
    /// Where the shape lies in the mesh's space.
    pub(super) mesh_from_shape: DAffine3,
    /// Scene materials by slot.
    pub(super) materials: Vec<usize>,
}

/// Builds meshes within one budget of vertices and triangles.
pub(super) struct MeshBuilder<'a> {
    pub(super) document: &'a Document,
    pub(super) data: &'a Data<'a>,
    pub(super) vertices: u64,
    pub(super) triangles: u64,
}

impl MeshBuilder<'_> {
    /// Builds a mesh; nothing when it has nothing to draw.
    pub(super) fn build(
        &mut self,
        index: usize,
        materials: &mut Materials<'_>,
        source: &mut Source<'_>,
    ) -> Result<Option<Placeable>, Fault> {
        let entry = &self.document.meshes[index];
        let name = mesh_name(entry, index);
        let (mut whole, mut slots) = (RawMesh::default(), Vec::<usize>::new());
        for (i, primitive) in entry.primitives.iter().enumerate() {
            let place = format!("meshes[{index}].primitives[{i}]");
            let read = self.primitive(primitive, materials.uv_source(primitive.material), source, &place);
            let Some(mut part) = read.map_err(|fault| fault.at(&place))? else { continue };
            part.repair(&name, &mut source.notes);
            part.complete_normals(&name, &mut source.notes);
            let material = materials.place(primitive.material, source);
            let slot = slots.iter().position(|&m| m == material).unwrap_or_else(|| {
                slots.push(material);
                slots.len() - 1
            });
            let slot = u16::try_from(slot).map_err(|_| {
                Fault::unsupported(format!("{place}: more than 65,536 materials"), "use fewer")
            })?;
            part.slots = vec![slot; part.triangles.len()];
            whole.append(part);
        }
        if whole.triangles.is_empty() && whole.segments.is_empty() {
            return Ok(None);
        }
        if slots.len() < 2 {
            whole.slots.clear();
        }
        let (mesh, mesh_from_shape) = whole.settle();
        Ok(Some(Placeable { shape: Arc::new(Shape::Mesh(mesh)), mesh_from_shape, materials: slots }))
    }

    fn primitive(
        &mut self,
        entry: &PrimitiveEntry,
        uv_source: UvSource,
        source: &mut Source<'_>,
        place: &str,
    ) -> Result<Option<RawMesh>, Fault> {
        if entry.extensions.contains_key("KHR_draco_mesh_compression")
            && !entry.attributes.contains_key("POSITION")
        {
            return Err(Fault::unsupported(
                "the geometry is compressed",
                "export it without mesh compression",
            ));
        }
        let Some(&positions) = entry.attributes.get("POSITION") else {
            source.notes.add(format!("{place}: it has no POSITION and is left out"));
            return Ok(None);
        };
        if entry.mode == 0 {
            source.notes.add("points are not drawn");
            return Ok(None);
        }
        if !entry.targets.is_empty() {
            source.notes.add("morph targets are not applied");
        }
        let positions = self.data.vectors::<3>(positions)?;
        let mut mesh = RawMesh::default();
        self.attributes(entry, uv_source, positions.len(), &mut mesh)?;
        let indices = match entry.indices {
            Some(indices) => self.data.indices(indices)?,
            None => (0..positions.len() as u32).collect(),
        };
        if let Some(wrong) = indices.iter().find(|&&i| i as usize >= positions.len()) {
            return Err(Fault::malformed(format!("vertex index {wrong} of {}", positions.len())));
        }
        mesh.positions = positions.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
        assemble(entry.mode, &indices, &mut mesh)?;
        if entry.mode == 4 && indices.len() % 3 != 0 {
            source
                .notes
                .add(format!("{place}: the number of indices is no multiple of 3, the rest is left out"));
        }
        self.count(&mut mesh, source)?;
        Ok(Some(mesh))
    }

    fn attributes(
        &self,
        entry: &PrimitiveEntry,
        uv_source: UvSource,
        count: usize,
        mesh: &mut RawMesh,
    ) -> Result<(), Fault> {
        let fits = |name: &str, length: usize| {
            if length == count {
                return Ok(());
            }
            Err(Fault::malformed(format!("{length} elements of {name} for {count} positions")))
        };
        if let Some(&normals) = entry.attributes.get("NORMAL") {
            mesh.normals = self.data.vectors::<3>(normals)?.into_iter().map(Vec3::from_array).collect();
            fits("NORMAL", mesh.normals.len())?;
        }
        let name = format!("TEXCOORD_{}", uv_source.set);
        if let (true, Some(&uvs)) = (uv_source.wanted, entry.attributes.get(&name)) {
            let uvs = self.data.vectors::<2>(uvs)?;
            mesh.uvs = uvs.into_iter().map(|uv| uv_source.transform(Vec2::from_array(uv))).collect();
            fits(&name, mesh.uvs.len())?;
        }
        if let Some(&colors) = entry.attributes.get("COLOR_0") {
            mesh.colors = if self.document.accessors[colors].kind == "VEC4" {
                self.data.vectors::<4>(colors)?.into_iter().map(|[r, g, b, _]| Vec3::new(r, g, b)).collect()
            } else {
                self.data.vectors::<3>(colors)?.into_iter().map(Vec3::from_array).collect()
            };
            fits("COLOR_0", mesh.colors.len())?;
        }
        Ok(())
    }

    /// Keeps only the vertices that are used (exporters like to share one large array), and counts them.
    fn count(&mut self, mesh: &mut RawMesh, source: &Source<'_>) -> Result<(), Fault> {
        let used = mesh.triangles.len() * 3 + mesh.segments.len() * 2;
        if used < mesh.positions.len() {
            mesh.keep_used_vertices();
        }
        self.vertices += mesh.positions.len() as u64;
        self.triangles += mesh.triangles.len() as u64;
        let limits = source.limits;
        if self.vertices > limits.vertices {
            return Err(Fault::over(format!("there are more than {} vertices", limits.vertices), "vertices"));
        }
        if self.triangles > limits.triangles {
            return Err(Fault::over(
                format!("there are more than {} triangles", limits.triangles),
                "triangles",
            ));
        }
        Ok(())
    }
}

fn mesh_name(entry: &MeshEntry, index: usize) -> String {
    match &entry.name {
        Some(name) if !name.trim().is_empty() => one_line(name),
        _ => format!("mesh {index}"),
    }
}

/// Makes triangles or segments of indices, by the mode of the primitive.
fn assemble(mode: u32, indices: &[u32], mesh: &mut RawMesh) -> Result<(), Fault> {
    match mode {
        1 => mesh.segments = indices.chunks_exact(2).map(|s| [s[0], s[1]]).collect(),
        2 | 3 => {
            mesh.segments = indices.windows(2).map(|s| [s[0], s[1]]).collect();
            if let (2, [first, .., last]) = (mode, indices) {
                mesh.segments.push([*last, *first]);
            }
        }
        4 => mesh.triangles = indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        5 => {
            // every other triangle of a strip is wound the other way
            let turn =
                |(i, t): (usize, &[u32])| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
            mesh.triangles = indices.windows(3).enumerate().map(turn).collect();
        }
        6 => mesh.triangles = indices.windows(2).skip(1).map(|t| [indices[0], t[0], t[1]]).collect(),
        other => return Err(Fault::malformed(format!("mode {other} is none"))),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_fans_and_loops_are_unrolled() {
        let made = |mode| {
            let mut mesh = RawMesh::default();
            assemble(mode, &[7, 8, 9, 10], &mut mesh).unwrap();
            (mesh.triangles, mesh.segments)
        };
        assert_eq!(made(5).0, [[7, 8, 9], [9, 8, 10]]);
        assert_eq!(made(6).0, [[7, 8, 9], [7, 9, 10]]);
        assert_eq!(made(4).0, [[7, 8, 9]]);
        assert_eq!(made(2).1, [[7, 8], [8, 9], [9, 10], [10, 7]]);
        assert!(assemble(9, &[], &mut RawMesh::default()).is_err());
    }
}
