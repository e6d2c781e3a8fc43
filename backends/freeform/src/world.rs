//! What is prepared of a scene: a body for each object, in the form in which it is cast.

use crate::bundle::{Bundle, Crossing, Hit};
use crate::field;
use crate::form::{FormBody, FormScratch};
use crate::heights::HeightBody;
use crate::volume::VolumeBody;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use polyptych_core::convert::DistanceModel;
use polyptych_core::math::Aabb;
use polyptych_core::scene::{FreeForm, Light, Material, Object, Primitive, Scene, Shape};
use polyptych_core::seam::Decision;
use std::sync::Arc;

/// A scene, ready to be drawn.
pub(crate) struct World {
    pub(crate) scene: Arc<Scene>,
    pub(crate) bodies: Vec<Body>,
    pub(crate) lights: Vec<Light>,
    pub(crate) decisions: Arc<[Decision]>,
}

/// An object in the form in which it is cast.
pub(crate) struct Body {
    pub(crate) object: usize,
    pub(crate) shape: Arc<Shape>,
    pub(crate) geometry: Arc<Geometry>,
    pub(crate) object_from_world: DAffine3,
    /// Turns normals of object space into the world's.
    pub(crate) normal_map: DMat3,
    pub(crate) center: DVec3,
    pub(crate) radius: f64,
    /// Whether light passes: drawn in layers, casts no shadow.
    pub(crate) see_through: bool,
}

/// What is cast.
#[derive(Debug)]
pub(crate) enum Geometry {
    Form(FormBody),
    Plane { width: f64, depth: f64 },
    Heights(HeightBody),
    Volume(VolumeBody),
    Field(Arc<DistanceModel>),
}

/// A point of a surface.
pub(crate) struct Point<'a> {
    pub(crate) t: f64,
    pub(crate) position: DVec3,
    /// Unit normal in the world, not turned to the eye.
    pub(crate) normal: DVec3,
    pub(crate) material: &'a Material,
    pub(crate) color: Vec3,
    pub(crate) opacity: f32,
}

impl Geometry {
    /// Builds what is cast of a shape that is drawn as given; nothing for meshes and voxels.
    pub(crate) fn of(shape: &Shape) -> Option<Self> {
        Some(match shape {
            Shape::Primitive(Primitive::Plane { width, depth }) => {
                Self::Plane { width: *width, depth: *depth }
            }
            Shape::Primitive(primitive) => Self::Form(FormBody::new(&FreeForm::from_primitive(primitive)?)),
            Shape::FreeForm(form) => Self::Form(FormBody::new(form)),
            Shape::HeightField(heights) => Self::Heights(HeightBody::new(heights)),
            Shape::Volume(volume) => Self::Volume(VolumeBody::new(volume)),
            Shape::Mesh(_) | Shape::Voxels(_) => return None,
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        match self {
            Self::Form(body) => body.bytes(),
            Self::Plane { .. } => 16,
            Self::Heights(body) => body.bytes(),
            Self::Volume(body) => body.bytes(),
            Self::Field(model) => model.distances.len() as u64 * 5,
        }
    }
}

impl Body {
    pub(crate) fn new(scene: &Scene, index: usize, object: &Object, geometry: Arc<Geometry>) -> Self {
        let world_from_object = object.world_from_object;
        let local = match &*geometry {
            Geometry::Field(model) => field::bounds(model),
            _ => object.shape.bounds(),
        };
        let bounds: Aabb = local.transformed(&world_from_object);
        let see_through = match &*geometry {
            Geometry::Field(model) => model.palette.iter().any(Material::is_see_through),
            _ => scene.material(object, 0).is_see_through(),
        };
        Self {
            object: index,
            shape: object.shape.clone(),
            geometry,
            object_from_world: world_from_object.inverse(),
            normal_map: world_from_object.matrix3.inverse().transpose(),
            center: bounds.center(),
            // The margin of the forms' own bounds.
            radius: bounds.radius() * 1.001,
            see_through,
        }
    }

    pub(crate) fn is_volume(&self) -> bool {
        matches!(*self.geometry, Geometry::Volume(_))
    }

    /// Improves `hits` where a ray of the bundle meets the surface sooner. Volumes have none.
    pub(crate) fn cast(
        &self,
        index: u32,
        crossing: Crossing,
        bundle: &Bundle,
        hits: &mut [Hit],
        scratch: &mut FormScratch,
    ) {
        let bounds = match &*self.geometry {
            Geometry::Volume(_) => return,
            Geometry::Form(form) => {
                form.cast(&self.object_from_world, index, crossing, bundle, hits, scratch);
                return;
            }
            Geometry::Field(model) => field::bounds(model),
            Geometry::Plane { .. } | Geometry::Heights(_) => self.shape.bounds(),
        };
        for (stretch, hit) in bundle.rays.iter().zip(hits) {
            let origin = self.object_from_world.transform_point3(stretch.origin);
            let direction = self.object_from_world.transform_vector3(stretch.direction);
            let Some((near, far)) = bounds.clip(origin, direction) else { continue };
            let (near, far) = (near.max(stretch.near), far.min(stretch.far).min(hit.t));
            if near > far {
                continue;
            }
            let t = match (&*self.geometry, &*self.shape) {
                (Geometry::Heights(body), Shape::HeightField(heights)) => {
                    body.cast(heights, origin, direction, near, far)
                }
                (Geometry::Field(model), _) => field::cast(model, origin, direction, near, far),
                // The bounds of a plane are the plane.
                _ => (direction.y != 0.0 && near > 0.0).then_some(near),
            };
            if let Some(t) = t.filter(|&t| t < hit.t) {
                *hit = Hit { t, body: index, normal: DVec3::ZERO };
            }
        }
    }

    /// Returns the point that a ray met, with its material.
    pub(crate) fn point<'a>(
        &'a self,
        scene: &'a Scene,
        origin: DVec3,
        direction: DVec3,
        hit: &Hit,
    ) -> Point<'a> {
        let t = hit.t;
        let position = origin + direction * t;
        let local = self.object_from_world.transform_point3(position);
        let object = &scene.objects[self.object];
        let (mut uv, mut slot_material) = (None, scene.material(object, 0));
        let normal = match (&*self.geometry, &*self.shape) {
            (Geometry::Form(_), shape) => {
                if let Shape::Primitive(primitive) = shape {
                    uv = Some(primitive.uv(local, hit.normal.normalize_or_zero()));
                }
                hit.normal
            }
            (Geometry::Plane { width, depth }, _) => {
                let plane = Primitive::Plane { width: *width, depth: *depth };
                uv = Some(plane.uv(local, DVec3::Y));
                DVec3::Y
            }
            (Geometry::Heights(_), Shape::HeightField(heights)) => {
                uv = Some(heights.uv(local.x, local.z));
                heights.height_and_normal(local.x, local.z).1
            }
            (Geometry::Field(model), _) => {
                let index = field::material(model, local);
                slot_material = model.palette.get(index).unwrap_or(Material::fallback());
                field::normal(model, local)
            }
            _ => DVec3::Y,
        };
        let unit = normal.normalize_or_zero();
        let (color, opacity) = scene.base_color(slot_material, uv, local.as_vec3(), unit.as_vec3(), 0.0);
        Point {
            t,
            position,
            normal: (self.normal_map * normal).normalize_or(-direction),
            material: slot_material,
            color,
            opacity: slot_material.effective_opacity(opacity),
        }
    }
}

impl Body {
    /// Returns the material at a point of the surface.
    pub(crate) fn material_at<'a>(&'a self, scene: &'a Scene, position: DVec3) -> &'a Material {
        match &*self.geometry {
            Geometry::Field(model) => {
                let local = self.object_from_world.transform_point3(position);
                model.palette.get(field::material(model, local)).unwrap_or(Material::fallback())
            }
            _ => scene.material(&scene.objects[self.object], 0),
        }
    }
}
