//! The scene: what is there, in the representation its author gave, and nothing more.

mod edit;
mod environment;
mod form;
mod height_field;
mod light;
mod material;
mod mesh;
mod primitive;
mod texture;
mod volume;
mod voxels;

pub use edit::{Brush, Edit, History, Region};
pub use environment::{Background, Environment, Fog, Gradient, LightingModel};
pub use form::{Form, FreeForm, Perturbation, Power, Quadric};
pub use height_field::HeightField;
pub use light::{Arriving, Light, LightKind};
pub use material::{AlphaMode, Mapping, Material, NormalMap, color_text};
pub use mesh::Mesh;
pub use primitive::Primitive;
#[cfg(debug_assertions)]
pub use texture::texture_lookups;
pub use texture::{Texture, TextureWrap};
pub use volume::{Samples, TransferFunction, TransferPoint, TransferPreset, Volume};
pub use voxels::{CHUNK, Chunk, Voxels};

use crate::camera::Camera;
use crate::math::Aabb;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

/// Everything a back end may draw. Shapes and textures are shared, so cloning a scene to edit it is cheap.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// What the scene is called in reports.
    pub name: String,
    /// The things in it.
    pub objects: Vec<Object>,
    /// What they are made of; [`Object::materials`] points here.
    pub materials: Vec<Material>,
    /// Pictures that materials refer to.
    pub textures: Vec<Arc<Texture>>,
    /// Light sources.
    pub lights: Vec<Light>,
    /// Background, ambient light, fog and the lighting model.
    pub environment: Environment,
    /// Views its author saved; the first is the default.
    pub cameras: Vec<(String, Camera)>,
    /// What a loader changed, replaced or left out, a line each.
    pub notes: Vec<String>,
}

/// One thing in the scene.
#[derive(Clone, Debug)]
pub struct Object {
    /// Its name in reports.
    pub name: String,
    /// Its geometry, shared between instances.
    pub shape: Arc<Shape>,
    /// Its place.
    pub world_from_object: DAffine3,
    /// Indices into [`Scene::materials`], one for each material slot that the shape's faces or voxels name.
    pub materials: Vec<usize>,
    /// Whether it is drawn at all.
    pub visible: bool,
    /// Whether a back end that cannot draw it must refuse the scene instead of skipping the object.
    pub required: bool,
}

/// Geometry, kept in the representation its author gave.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A parametric body.
    Primitive(Primitive),
    /// Indexed triangles and free segments.
    Mesh(Mesh),
    /// A grid of palette bytes.
    Voxels(Voxels),
    /// A quadric with perturbations and set operations.
    FreeForm(FreeForm),
    /// Heights over a base plane.
    HeightField(HeightField),
    /// A scalar field with a transfer function.
    Volume(Volume),
}

/// The kinds of [`Shape`], for capabilities and reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "one for each variant of Shape, documented there")]
pub enum ShapeKind {
    Primitive,
    Mesh,
    Voxels,
    FreeForm,
    HeightField,
    Volume,
}

impl ShapeKind {
    /// All kinds, in the order of [`Shape`].
    pub const ALL: [Self; 6] =
        [Self::Primitive, Self::Mesh, Self::Voxels, Self::FreeForm, Self::HeightField, Self::Volume];

    /// Returns the name used in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Primitive => "primitive",
            Self::Mesh => "mesh",
            Self::Voxels => "voxels",
            Self::FreeForm => "free_form",
            Self::HeightField => "height_field",
            Self::Volume => "volume",
        }
    }
}

impl Shape {
    /// Returns which kind of shape this is.
    #[must_use]
    pub fn kind(&self) -> ShapeKind {
        match self {
            Self::Primitive(_) => ShapeKind::Primitive,
            Self::Mesh(_) => ShapeKind::Mesh,
            Self::Voxels(_) => ShapeKind::Voxels,
            Self::FreeForm(_) => ShapeKind::FreeForm,
            Self::HeightField(_) => ShapeKind::HeightField,
            Self::Volume(_) => ShapeKind::Volume,
        }
    }

    /// Tells whether there is nothing of it anywhere.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        match self {
            Self::Mesh(mesh) => mesh.is_empty(),
            other => other.bounds().is_empty(),
        }
    }

    /// Bounds the shape in its own space.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Primitive(s) => s.bounds(),
            Self::Mesh(s) => s.bounds(),
            Self::Voxels(s) => s.bounds(),
            Self::FreeForm(s) => s.bounds(),
            Self::HeightField(s) => s.bounds(),
            Self::Volume(s) => s.bounds(),
        }
    }

    /// Returns the bytes that the shape holds.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        match self {
            Self::Primitive(_) => size_of::<Primitive>() as u64,
            Self::Mesh(s) => s.bytes(),
            Self::Voxels(s) => s.bytes(),
            Self::FreeForm(s) => s.form().node_count() as u64 * size_of::<Form>() as u64,
            Self::HeightField(s) => s.heights().len() as u64 * 4,
            Self::Volume(s) => s.samples().bytes(),
        }
    }
}

impl Object {
    /// Builds a visible object at the origin with one material.
    pub fn new(name: impl Into<String>, shape: Shape, material: usize) -> Self {
        Self {
            name: name.into(),
            shape: Arc::new(shape),
            world_from_object: DAffine3::IDENTITY,
            materials: vec![material],
            visible: true,
            required: false,
        }
    }

    /// Returns the object placed by a transform.
    #[must_use]
    pub fn placed(mut self, world_from_object: DAffine3) -> Self {
        self.world_from_object = world_from_object;
        self
    }

    /// Returns the object moved to a position.
    #[must_use]
    pub fn at(mut self, position: DVec3) -> Self {
        self.world_from_object.translation = position;
        self
    }

    /// Bounds the object in world space.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.shape.bounds().transformed(&self.world_from_object)
    }

    /// Returns the index of the material in a slot; a slot without a material of its own has the first.
    #[must_use]
    pub fn material_in_slot(&self, slot: usize) -> usize {
        self.materials.get(slot).or(self.materials.first()).copied().unwrap_or(0)
    }

    /// Tells whether there is anything to draw: it is visible, bounded, and its transform can be inverted.
    #[must_use]
    pub fn is_drawable(&self) -> bool {
        self.visible && self.why_undrawable().is_none()
    }

    /// Says why a visible object can not be drawn by any back end, if that is so.
    #[must_use]
    pub fn why_undrawable(&self) -> Option<&'static str> {
        let determinant = self.world_from_object.matrix3.determinant();
        if !self.world_from_object.is_finite() {
            Some("its transform is not finite")
        } else if determinant == 0.0 || !(1.0 / determinant).is_finite() {
            Some("its transform squeezes it to nothing")
        } else if self.shape.is_empty() {
            Some("it is empty")
        } else {
            None
        }
    }
}

impl Scene {
    /// Bounds everything visible.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.objects
            .iter()
            .filter(|o| o.is_drawable())
            .map(Object::bounds)
            .filter(|b| b.min.is_finite() && b.max.is_finite())
            .fold(Aabb::EMPTY, Aabb::union)
    }

    /// Adds a material and returns its index.
    pub fn add_material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a texture and returns its index.
    pub fn add_texture(&mut self, texture: Texture) -> usize {
        self.textures.push(Arc::new(texture));
        self.textures.len() - 1
    }

    /// Returns the material in a slot of an object, or the default material where the scene has none.
    #[must_use]
    pub fn material(&self, object: &Object, slot: usize) -> &Material {
        self.materials.get(object.material_in_slot(slot)).unwrap_or(Material::fallback())
    }

    /// Returns the base color and opacity at a point of a surface.
    ///
    /// `uv` are the texture coordinates where the shape has them; `position` and `normal` are in object space
    /// and serve the mapping of shapes that have none; `lod` is the mip level (0 = full resolution).
    #[must_use]
    pub fn base_color(
        &self,
        material: &Material,
        uv: Option<[f32; 2]>,
        position: Vec3,
        normal: Vec3,
        lod: f32,
    ) -> (Vec3, f32) {
        let Some(texture) = material.texture.and_then(|t| self.textures.get(t)) else {
            return (material.base_color, material.opacity);
        };
        let texel = match (material.mapping, uv) {
            (Mapping::Uv, Some(uv)) => texture.sample(uv, lod),
            (Mapping::Uv, None) => texture.triplanar(position, normal, lod),
            (Mapping::Triplanar { scale }, _) => texture.triplanar(position * scale, normal, lod),
        };
        (material.base_color * texel.truncate(), material.opacity * texel.w)
    }

    /// Returns the unit normal that a normal map makes of one, at a point of a surface with texture coordinates; see
    /// [`NormalMap::turned`].
    #[must_use]
    #[inline]
    pub fn turned_normal(
        &self,
        map: &NormalMap,
        normal: Vec3,
        along: [Vec3; 2],
        uv: [f32; 2],
        lod: f32,
    ) -> Vec3 {
        let texel = self.textures.get(map.texture).map(|texture| texture.sample(uv, lod).truncate());
        texel.map_or(normal, |texel| map.turned(normal, along, texel))
    }

    /// Lists every light that reaches surfaces: the lights of the scene and one point light for each emissive
    /// voxel that can be seen from outside.
    ///
    /// An emissive voxel of emission `e` and edge `h` shines as a point light of intensity `e h^2` at its
    /// center: the flux of its face, taken as if from the middle.
    #[must_use]
    pub fn all_lights(&self) -> Vec<Light> {
        let mut lights = self.lights.clone();
        for object in self.objects.iter().filter(|o| o.is_drawable()) {
            let Shape::Voxels(voxels) = &*object.shape else { continue };
            let edge = object.world_from_object.matrix3.determinant().abs().cbrt();
            for (cell, value) in voxels
                .exposed_where(|v| self.material(object, usize::from(v) - 1).emission.max_element() > 0.0)
            {
                let emission = self.material(object, usize::from(value) - 1).emission;
                let center = DVec3::new(f64::from(cell[0]), f64::from(cell[1]), f64::from(cell[2])) + 0.5;
                lights.push(Light {
                    kind: LightKind::Point { position: object.world_from_object.transform_point3(center) },
                    color: emission,
                    intensity: (edge * edge) as f32,
                    casts_shadow: true,
                });
            }
        }
        lights
    }

    /// Returns the bytes that shapes and textures hold.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.objects.iter().map(|o| o.shape.bytes()).sum::<u64>()
            + self.textures.iter().map(|t| t.bytes()).sum::<u64>()
    }
}
