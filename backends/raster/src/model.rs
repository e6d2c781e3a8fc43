//! What is drawn: triangle meshes at their places, given or converted.

use crate::setup::Sides;
use glam::{DAffine3, DMat3, DVec3, Mat3, Vec3};
use polyptych_core::convert::MeshModel;
use polyptych_core::lanes::LANES;
use polyptych_core::math::Aabb;
use polyptych_core::scene::{AlphaMode, Material, Mesh, Object, Scene, Shape};
use std::ops::Range;
use std::sync::Arc;

/// All triangles of a scene, numbered through.
pub(crate) struct Model {
    /// By rising index of their objects.
    pub(crate) parts: Vec<Part>,
    pub(crate) triangles: u32,
    /// Eights of vertices: each part begins with one of its own.
    pub(crate) eights: usize,
    pub(crate) bounds: Aabb,
    /// Largest coordinate that went into a corner: what rounding errors are measured by.
    pub(crate) reach: f64,
}

impl Default for Model {
    fn default() -> Self {
        Self { parts: Vec::new(), triangles: 0, eights: 0, bounds: Aabb::EMPTY, reach: 0.0 }
    }
}

/// An object as triangles.
pub(crate) struct Part {
    /// Index in the scene.
    pub(crate) object: usize,
    pub(crate) source: Source,
    pub(crate) world_from_object: DAffine3,
    /// Turns normals of object space into such of world space, up to a factor that keeps `f32` in range.
    pub(crate) world_from_normal: Mat3,
    /// Whether the transform turns the winding over.
    pub(crate) mirrored: bool,
    pub(crate) first_triangle: u32,
    pub(crate) first_eight: usize,
    /// In the world.
    pub(crate) bounds: Aabb,
    /// Largest coordinate that went into a corner.
    reach: f64,
    /// How each slot looks to the camera and to lights.
    classes: Vec<[Class; 2]>,
    /// Whether light can be blocked on its way to it.
    pub(crate) takes_shadow: bool,
    /// Whether faces that let light through are seen from outside only: one step into a solid is one surface.
    pub(crate) one_sided_layers: bool,
}

/// Where the triangles of a part come from.
#[derive(Clone)]
pub(crate) enum Source {
    /// The scene.
    Given(Arc<Shape>),
    /// The converter.
    Converted(Arc<MeshModel>),
}

/// For whom a pass is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// The camera: everything that can be seen.
    Camera,
    /// A light: everything that blocks it.
    Light,
}

/// How a triangle takes part in a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    /// Not at all.
    Nothing,
    /// It hides what lies behind.
    Solid,
    /// It may have holes or let light through.
    Layer,
}

impl Source {
    pub(crate) fn mesh(&self) -> &Mesh {
        static NOTHING: Mesh = Mesh {
            positions: Vec::new(),
            normals: Vec::new(),
            uvs: Vec::new(),
            colors: Vec::new(),
            triangles: Vec::new(),
            slots: Vec::new(),
            segments: Vec::new(),
        };
        match self {
            Self::Converted(model) => &model.mesh,
            Self::Given(shape) => match &**shape {
                Shape::Mesh(mesh) => mesh,
                _ => &NOTHING,
            },
        }
    }

    /// Returns the bound and the description of a conversion.
    pub(crate) fn converted(&self) -> Option<(f64, String)> {
        match self {
            Self::Given(_) => None,
            Self::Converted(model) => Some((model.bound, model.why.clone())),
        }
    }

    /// Tells whether both are the same triangles in memory.
    pub(crate) fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Given(a), Self::Given(b)) => Arc::ptr_eq(a, b),
            (Self::Converted(a), Self::Converted(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

impl Model {
    /// Returns the part of an object.
    pub(crate) fn part_of(&self, object: usize) -> Option<&Part> {
        let at = self.parts.binary_search_by_key(&object, |part| part.object).ok()?;
        Some(&self.parts[at])
    }

    /// Adds an object; false when its triangles cannot be numbered any more. `before` is a part that may be made
    /// from the same triangles at the same place: those are not measured again.
    pub(crate) fn add(&mut self, scene: &Scene, index: usize, source: Source, before: Option<&Part>) -> bool {
        let object = &scene.objects[index];
        let mesh = source.mesh();
        let Ok(count) = u32::try_from(mesh.triangles.len()) else { return false };
        let Some(triangles) = self.triangles.checked_add(count).filter(|&t| t < u32::MAX) else {
            return false;
        };
        let eights = mesh.positions.len().div_ceil(LANES);
        let matrix = object.world_from_object.matrix3;
        let (bounds, reach) = match before
            .filter(|b| b.source.is(&source) && b.world_from_object == object.world_from_object)
        {
            Some(before) => (before.bounds, before.reach),
            None => extent(mesh, &object.world_from_object),
        };
        self.reach = self.reach.max(reach);
        self.bounds = self.bounds.union(bounds);
        self.parts.push(Part {
            object: index,
            world_from_object: object.world_from_object,
            world_from_normal: normal_matrix(&matrix),
            mirrored: matrix.determinant() < 0.0,
            first_triangle: self.triangles,
            first_eight: self.eights,
            bounds,
            reach,
            classes: classes(scene, object),
            takes_shadow: !matches!(*object.shape, Shape::Volume(_)),
            one_sided_layers: matches!(*object.shape, Shape::Voxels(_)),
            source,
        });
        self.triangles = triangles;
        self.eights += eights;
        true
    }

    /// Tells whether the parts are made from these.
    pub(crate) fn has_sources<'a>(&self, sources: impl Iterator<Item = &'a Source>) -> bool {
        let mut parts = self.parts.iter();
        sources.into_iter().all(|source| parts.next().is_some_and(|part| part.source.is(source)))
            && parts.next().is_none()
    }

    /// Returns the part of a triangle, which is likely the given one.
    #[inline(always)]
    pub(crate) fn part_near(&self, part: usize, id: u32) -> usize {
        if self.triangles_of(part).contains(&id) { part } else { self.find(id).0 }
    }

    /// Returns the ids of the triangles of a part.
    #[inline(always)]
    pub(crate) fn triangles_of(&self, part: usize) -> Range<u32> {
        let end = self.parts.get(part + 1).map_or(self.triangles, |next| next.first_triangle);
        self.parts[part].first_triangle..end
    }

    /// Returns the part of a triangle, and the triangle's index in it.
    pub(crate) fn find(&self, id: u32) -> (usize, usize) {
        let part = self.parts.partition_point(|p| p.first_triangle <= id).saturating_sub(1);
        (part, (id - self.parts[part].first_triangle) as usize)
    }
}

impl Part {
    pub(crate) fn mesh(&self) -> &Mesh {
        self.source.mesh()
    }

    /// Returns how a slot takes part in a pass.
    pub(crate) fn class(&self, role: Role, slot: usize) -> Class {
        self.classes.get(slot).unwrap_or(&self.classes[0])[role as usize]
    }

    /// Returns what the colors of a triangle's corners make of one, from the weights of the second and third.
    #[inline(always)]
    pub(crate) fn tinted(&self, color: Vec3, triangle: usize, [v, w]: [f32; 2]) -> Vec3 {
        let mesh = self.mesh();
        if mesh.colors.is_empty() {
            return color;
        }
        let [a, b, c] = mesh.triangles[triangle];
        let tint = |corner: u32| mesh.colors[corner as usize];
        color * (tint(a) * (1.0 - v - w) + tint(b) * v + tint(c) * w)
    }

    /// Tells whether a material has the same color everywhere on it.
    #[inline(always)]
    pub(crate) fn has_one_color(&self, material: &Material) -> bool {
        material.texture.is_none() && self.mesh().colors.is_empty()
    }

    /// Tells whether all triangles have one material.
    pub(crate) fn has_one_slot(&self) -> bool {
        self.classes.len() == 1
    }

    /// Tells whether light may pass some of what blocks it.
    pub(crate) fn has_holes(&self) -> bool {
        self.classes.iter().any(|of| of[Role::Light as usize] == Class::Layer)
    }

    /// Lists how each slot takes part in the passes.
    pub(crate) fn slots(&self) -> impl Iterator<Item = [Class; 2]> {
        self.classes.iter().copied()
    }

    /// Returns the sides to draw when those that look away are to be left out.
    pub(crate) fn sides(&self, culls: bool) -> Sides {
        match (culls, self.mirrored) {
            (false, _) => Sides::Both,
            (true, false) => Sides::CounterClockwise,
            (true, true) => Sides::Clockwise,
        }
    }

    /// Returns the corners of a triangle in world space, relative to an origin.
    pub(crate) fn corners(&self, triangle: usize, origin: DVec3) -> [DVec3; 3] {
        let (mesh, matrix) = (self.mesh(), &self.world_from_object.matrix3);
        let offset = self.world_from_object.translation - origin;
        let [a, b, c] = mesh.triangles[triangle];
        let place = |i: u32| *matrix * mesh.positions[i as usize].as_dvec3() + offset;
        [place(a), place(b), place(c)]
    }

    /// Tells whether two parts throw the same shadows.
    pub(crate) fn blocks_like(&self, other: &Self) -> bool {
        self.source.is(&other.source)
            && self.world_from_object == other.world_from_object
            && self.first_triangle == other.first_triangle
            && self.classes == other.classes
    }
}

/// Returns bounds in the world and the largest coordinate that goes into a corner.
fn extent(mesh: &Mesh, world_from_object: &DAffine3) -> (Aabb, f64) {
    let own_bounds = mesh.bounds();
    if own_bounds.is_empty() {
        return (Aabb::EMPTY, 0.0);
    }
    // Of the corners, not of the box: that of a turned box would be larger.
    let used = mesh.triangles.iter().flatten().chain(mesh.segments.iter().flatten());
    let corners = used.map(|&i| mesh.positions[i as usize].as_dvec3());
    let bounds = Aabb::of_points(corners.map(|p| world_from_object.transform_point3(p)));
    let matrix = &world_from_object.matrix3;
    let scale = matrix.x_axis.length().max(matrix.y_axis.length()).max(matrix.z_axis.length());
    (bounds, own_bounds.min.abs().max(own_bounds.max.abs()).max_element() * scale)
}

fn normal_matrix(world_from_object: &DMat3) -> Mat3 {
    let inverse = world_from_object.inverse().transpose();
    let columns = [inverse.x_axis, inverse.y_axis, inverse.z_axis];
    let largest = columns.iter().map(|c| c.abs().max_element()).fold(0.0, f64::max);
    (inverse * (1.0 / largest)).as_mat3()
}

fn classes(scene: &Scene, object: &Object) -> Vec<[Class; 2]> {
    let is_volume = matches!(*object.shape, Shape::Volume(_));
    (0..object.materials.len().max(1))
        .map(|slot| {
            let material = scene.material(object, slot);
            let to_light = if is_volume { Class::Nothing } else { class_to_light(material) };
            [class_to_camera(material), to_light]
        })
        .collect()
}

fn class_to_camera(material: &Material) -> Class {
    if !material.is_see_through() {
        Class::Solid
    } else if material.alpha == AlphaMode::Opaque && material.opacity <= 0.0 {
        Class::Nothing
    } else {
        Class::Layer
    }
}

fn class_to_light(material: &Material) -> Class {
    match material.alpha {
        AlphaMode::Opaque if material.opacity >= 1.0 => Class::Solid,
        AlphaMode::Mask(_) if material.opacity >= 1.0 => Class::Layer,
        AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::Blend => Class::Nothing,
    }
}
