//! How is each kind of shape met by a ray in its own space?

pub(crate) mod form;
mod function;
mod height_field;
mod mesh;
mod primitive;
mod volume;
mod voxels;

use crate::line::{Hit, Line, Span};
use form::Solid;
use glam::DVec3;
use height_field::Blocks;
use mesh::MeshTree;
use polyptych_core::scene::Shape;
use std::sync::Arc;
pub(crate) use volume::EmptyBlocks;

/// A shape with what was built to meet it fast. Shared by all objects of that shape.
#[derive(Debug)]
pub(crate) struct Geometry {
    pub(crate) shape: Arc<Shape>,
    aid: Aid,
}

/// What was built for a shape.
#[derive(Debug)]
enum Aid {
    Nothing,
    Faces(Vec<(DVec3, f64)>),
    Mesh(MeshTree),
    Form(Solid),
    Heights(Blocks),
    Volume { shell: Option<Solid>, empty: EmptyBlocks },
}

/// Texture coordinates, shading normal and vertex color at a hit, in object space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Finish {
    pub(crate) uv: Option<[f32; 2]>,
    pub(crate) normal: DVec3,
    pub(crate) color: glam::Vec3,
}

impl Geometry {
    /// Builds what a shape needs.
    pub(crate) fn new(shape: &Arc<Shape>) -> Self {
        let aid = match &**shape {
            Shape::Primitive(body) => match body.faces() {
                faces if faces.is_empty() => Aid::Nothing,
                faces => Aid::Faces(faces),
            },
            Shape::Mesh(mesh) => Aid::Mesh(MeshTree::new(mesh)),
            Shape::Voxels(_) => Aid::Nothing,
            Shape::FreeForm(form) => Aid::Form(Solid::new(form)),
            Shape::HeightField(field) => Aid::Heights(Blocks::new(field)),
            Shape::Volume(volume) => {
                Aid::Volume { shell: volume.shell.as_ref().map(Solid::new), empty: EmptyBlocks::new(volume) }
            }
        };
        Self { shape: shape.clone(), aid }
    }

    /// Estimates the bytes of [`Geometry::new`] without building it.
    pub(crate) fn estimated_bytes(shape: &Shape) -> u64 {
        match shape {
            Shape::Mesh(mesh) => MeshTree::planned_bytes(mesh),
            Shape::HeightField(field) => Blocks::planned_bytes(field),
            Shape::Volume(volume) => EmptyBlocks::planned_bytes(volume),
            Shape::Primitive(body) => body.faces().len() as u64 * 32,
            Shape::FreeForm(form) => form.form().node_count() as u64 * size_of::<function::Function>() as u64,
            Shape::Voxels(_) => 0,
        }
    }

    /// Returns the bytes that were built.
    pub(crate) fn bytes(&self) -> u64 {
        match &self.aid {
            Aid::Nothing => 0,
            Aid::Faces(faces) => faces.len() as u64 * 32,
            Aid::Mesh(tree) => tree.bytes(),
            Aid::Form(_) => Self::estimated_bytes(&self.shape),
            Aid::Heights(blocks) => blocks.bytes(),
            Aid::Volume { empty, .. } => empty.bytes(),
        }
    }

    /// Finds the first hit in the span that is accepted; volumes have no surface.
    pub(crate) fn first(
        &self,
        line: &Line,
        span: &Span,
        accept: &mut impl FnMut(&Hit) -> bool,
    ) -> Option<Hit> {
        match (&*self.shape, &self.aid) {
            (Shape::Mesh(mesh), Aid::Mesh(tree)) => tree.first(mesh, line, *span, accept),
            (Shape::Primitive(body), aid) => {
                let faces: &[_] = if let Aid::Faces(faces) = aid { faces } else { &[] };
                primitive::crossings(body, faces, line).first(span, accept)
            }
            (Shape::Voxels(voxels), _) => voxels::first(voxels, line, span, accept),
            (Shape::FreeForm(form), Aid::Form(solid)) => solid.first(form, line, span, accept),
            (Shape::HeightField(field), Aid::Heights(blocks)) => blocks.first(field, line, *span, accept),
            _ => None,
        }
    }

    /// Returns the shell of a volume made ready, and its empty blocks.
    pub(crate) fn volume(&self) -> Option<(Option<&Solid>, &EmptyBlocks)> {
        match &self.aid {
            Aid::Volume { shell, empty } => Some((shell.as_ref(), empty)),
            _ => None,
        }
    }

    /// Returns what shading needs at a hit; `position` and the hit are in object space.
    pub(crate) fn finish(&self, hit: &Hit, position: DVec3) -> Finish {
        let uv = match &*self.shape {
            Shape::Mesh(mesh) => return mesh::finish(mesh, hit),
            Shape::Primitive(body) => Some(body.uv(position, hit.normal.normalize_or(DVec3::Y))),
            Shape::HeightField(field) => Some(field.uv(position.x, position.z)),
            Shape::Voxels(_) | Shape::FreeForm(_) | Shape::Volume(_) => None,
        };
        Finish { uv, normal: hit.normal, color: glam::Vec3::ONE }
    }
}
