//! What is prepared of a scene: a body for each object, in the form in which it is cast.

use crate::bundle::{Crossing, Hits, NOWHERE, Rays};
use crate::field;
use crate::form::{Cast, FormBody, FormScratch, Precision};
use crate::heights::{HeightBody, HeightScratch};
use crate::march::Shine;
use crate::surface;
use crate::volume::{Drawing, VolumeBody};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use polyptych_core::convert::DistanceModel;
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, LANES, Mask8, Vec3x8};
use polyptych_core::math::Aabb;
use polyptych_core::scene::{FreeForm, Light, Material, Object, Primitive, Scene, Shape};
use polyptych_core::seam::Decision;
use std::sync::Arc;

/// A scene, ready to be drawn.
pub(crate) struct World {
    pub(crate) scene: Arc<Scene>,
    pub(crate) bodies: Vec<Body>,
    pub(crate) lights: Vec<Light>,
    /// For each light whether anything can stand between it and a surface, so that shadow rays are cast.
    pub(crate) blocked: Vec<bool>,
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
    /// Corners of its bounds in the world.
    pub(crate) corners: [DVec3; 8],
    /// Whether light passes: drawn in layers, casts no shadow.
    pub(crate) see_through: bool,
    /// In which numbers the roots of forms are searched for.
    pub(crate) precision: Precision,
    /// Bounds in object space: of a volume what its shell leaves of it.
    pub(crate) local_bounds: Aabb,
    /// The lights as they arrive at the middle of a volume.
    pub(crate) shines: Vec<Shine>,
}

/// Scratch memory of one worker for casting rays.
#[derive(Default)]
pub(crate) struct CastScratch {
    pub(crate) form: FormScratch,
    heights: HeightScratch,
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

/// Eight points of surfaces.
#[derive(Clone, Copy)]
pub(crate) struct Points<'a> {
    /// Which of them there are.
    pub(crate) there: Mask8,
    pub(crate) position: DVec3x8,
    /// Unit normals in the world, on the viewer's side.
    pub(crate) normal: DVec3x8,
    /// Nothing where there is no point.
    pub(crate) material: [Option<&'a Material>; LANES],
    pub(crate) color: Vec3x8,
    pub(crate) opacity: F32x8,
    /// How far from a point a ray begins that leaves it: the resolution of single precision for a body of that
    /// size.
    pub(crate) hair: F64x8,
}

impl Points<'_> {
    pub(crate) const NONE: Self = Self {
        there: Mask8::NONE,
        position: NOWHERE,
        normal: NOWHERE,
        material: [None; LANES],
        color: Vec3x8 { x: F32x8::ZERO, y: F32x8::ZERO, z: F32x8::ZERO },
        opacity: F32x8::ZERO,
        hair: F64x8::ZERO,
    };
}

impl Geometry {
    /// Builds what is cast of a shape that is drawn as given, volumes as told; nothing for meshes and
    /// voxels.
    pub(crate) fn of(shape: &Shape, volumes: Drawing) -> Option<Self> {
        Some(match shape {
            Shape::Primitive(Primitive::Plane { width, depth }) => {
                Self::Plane { width: *width, depth: *depth }
            }
            Shape::Primitive(primitive) => Self::Form(FormBody::new(&FreeForm::from_primitive(primitive)?)),
            Shape::FreeForm(form) => Self::Form(FormBody::new(form)),
            Shape::HeightField(heights) => Self::Heights(HeightBody::new(heights)),
            Shape::Volume(volume) => Self::Volume(VolumeBody::new(volume, volumes)),
            Shape::Mesh(_) | Shape::Voxels(_) => return None,
        })
    }

    /// Returns what [`Geometry::bytes`] will be for a shape that is drawn as given; nothing for others.
    pub(crate) fn planned_bytes(shape: &Shape, volumes: Drawing) -> u64 {
        match shape {
            Shape::Primitive(Primitive::Plane { .. }) => 16,
            // A form as steps is as large as what is written of it here.
            Shape::Primitive(primitive) => {
                FreeForm::from_primitive(primitive).map_or(0, |form| FormBody::new(&form).bytes())
            }
            Shape::FreeForm(form) => FormBody::new(form).bytes(),
            Shape::HeightField(heights) => HeightBody::planned_bytes(heights),
            Shape::Volume(volume) => VolumeBody::planned_bytes(volume, volumes),
            Shape::Mesh(_) | Shape::Voxels(_) => 0,
        }
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
    pub(crate) fn new(
        (scene, lights, precision): (&Scene, &[Light], Precision),
        index: usize,
        object: &Object,
        geometry: Arc<Geometry>,
    ) -> Self {
        let world_from_object = object.world_from_object;
        let local = match (&*geometry, &*object.shape) {
            (Geometry::Field(model), _) => field::bounds(model),
            (_, Shape::Volume(volume)) => {
                let own = volume.bounds();
                volume.shell.as_ref().map_or(own, |s| s.bounds().intersection(own))
            }
            _ => object.shape.bounds(),
        };
        let center = local.transformed(&world_from_object).center();
        let shines = match &*geometry {
            Geometry::Volume(_) => lights.iter().filter_map(|l| Shine::arriving(l, center)).collect(),
            _ => Vec::new(),
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
            corners: local
                .grown(local.radius() * 1e-3)
                .corners()
                .map(|c| world_from_object.transform_point3(c)),
            see_through,
            precision,
            local_bounds: local,
            shines,
        }
    }

    pub(crate) fn is_volume(&self) -> bool {
        matches!(&*self.geometry, Geometry::Volume(volume) if volume.surface.is_none())
    }

    /// Improves `hits` where a ray meets the surface sooner. Volumes have none.
    pub(crate) fn cast(
        &self,
        index: u32,
        crossing: Crossing,
        rays: &[Rays],
        hits: &mut [Hits],
        scratch: &mut CastScratch,
    ) {
        match (&*self.geometry, &*self.shape) {
            (Geometry::Volume(volume), _) if volume.surface.is_none() => return,
            (Geometry::Form(form), _) => {
                let cast = Cast {
                    object_from_world: &self.object_from_world,
                    body: index,
                    crossing,
                    precision: self.precision,
                };
                form.cast(cast, rays, hits, &mut scratch.form);
                return;
            }
            (Geometry::Heights(body), Shape::HeightField(heights)) => {
                body.cast(heights, &self.object_from_world, index, rays, hits, &mut scratch.heights);
                return;
            }
            _ => {}
        }
        for (rays, hits) in rays.iter().zip(hits) {
            let open = rays.open();
            for i in (0..LANES).filter(|&i| open.has(i)) {
                let origin = self.object_from_world.transform_point3(rays.origin.get(i));
                let direction = self.object_from_world.transform_vector3(rays.direction.get(i));
                let Some((near, far)) = self.local_bounds.clip(origin, direction) else { continue };
                let (near, far) = (near.max(rays.near.0[i]), far.min(rays.far.0[i]).min(hits.t.0[i]));
                if near > far {
                    continue;
                }
                let t = match (&*self.geometry, &*self.shape) {
                    (Geometry::Field(model), _) => field::cast(model, origin, direction, near, far),
                    (
                        Geometry::Volume(VolumeBody { levels, surface: Some(value), .. }),
                        Shape::Volume(volume),
                    ) => surface::cast(&levels[0], (volume, *value), origin, direction, [near, far]),
                    // The bounds of a plane are the plane.
                    _ => (direction.y != 0.0 && near > 0.0).then_some(near),
                };
                if let Some(t) = t.filter(|&t| t < hits.t.0[i]) {
                    (hits.t.0[i], hits.body.0[i]) = (t, index);
                }
            }
        }
    }

    /// Fills in the points that some of eight rays met on this body; `reads_color` tells whether their color matters.
    #[inline(always)]
    pub(crate) fn fill<'a>(
        &'a self,
        scene: &'a Scene,
        rays: &Rays,
        hits: &Hits,
        met: Mask8,
        reads_color: bool,
        points: &mut Points<'a>,
    ) {
        let position = rays.origin + rays.direction.scaled(hits.t);
        let material = scene.material(&scene.objects[self.object], 0);
        let mut normal = hits.normal;
        let mut color = Vec3x8::splat(material.base_color);
        let mut opacity = F32x8::splat(material.effective_opacity(material.opacity));
        let is_form = matches!(*self.geometry, Geometry::Form(_));
        for i in (0..LANES).filter(|&i| met.has(i)) {
            points.material[i] = Some(material);
            if is_form && material.texture.is_none() {
                continue;
            }
            let local = self.object_from_world.transform_point3(position.get(i));
            let direction = self.object_from_world.transform_vector3(rays.direction.get(i));
            let place = self.place(local, direction, normal.get(i), material);
            let unit = place.normal.normalize_or_zero();
            // Without anyone to see the color, only holes and haze are worth a look at the texture.
            let (c, o) = if reads_color || self.see_through {
                scene.base_color(place.material, place.uv, local.as_vec3(), unit.as_vec3(), 0.0)
            } else {
                (place.material.base_color, place.material.opacity)
            };
            let c = place.color.unwrap_or(c);
            normal.set(i, place.normal);
            color.set(i, c);
            opacity.0[i] = place.material.effective_opacity(o);
            points.material[i] = Some(place.material);
        }
        let turned = normal.turned(&self.normal_map);
        let share = F64x8::splat(1.0) / turned.length();
        let good = share.above(F64x8::ZERO) & F64x8::splat(f64::INFINITY).above(share);
        let back = NOWHERE - rays.direction;
        let unit = DVec3x8::pick(good, turned.scaled(share), back);
        let away = unit.dot(rays.direction).above(F64x8::ZERO);
        let facing = DVec3x8::pick(away, NOWHERE - unit, unit);
        points.there = points.there | met;
        points.position = DVec3x8::pick(met, position, points.position);
        points.normal = DVec3x8::pick(met, facing, points.normal);
        points.color = Vec3x8::pick(met, color, points.color);
        points.opacity = met.pick(opacity, points.opacity);
        points.hair = F64x8::pick(met, F64x8::splat(self.radius * 1e-5), points.hair);
    }

    /// Finds normal, coordinates and material of a point in object space that a ray met; `normal` is that of a form.
    fn place<'a>(
        &'a self,
        local: DVec3,
        direction: DVec3,
        normal: DVec3,
        material: &'a Material,
    ) -> Place<'a> {
        match (&*self.geometry, &*self.shape) {
            (Geometry::Form(_), Shape::Primitive(primitive)) => {
                let uv = Some(primitive.uv(local, normal.normalize_or_zero()));
                Place { normal, uv, material, color: None }
            }
            (Geometry::Plane { width, depth }, _) => {
                let plane = Primitive::Plane { width: *width, depth: *depth };
                Place { normal: DVec3::Y, uv: Some(plane.uv(local, DVec3::Y)), material, color: None }
            }
            (Geometry::Heights(_), Shape::HeightField(heights)) => {
                let uv = Some(heights.uv(local.x, local.z));
                Place { normal: heights.height_and_normal(local.x, local.z).1, uv, material, color: None }
            }
            (Geometry::Field(model), _) => {
                let material =
                    model.palette.get(field::material(model, local)).unwrap_or(Material::fallback());
                Place { normal: field::normal(model, local, direction), uv: None, material, color: None }
            }
            (Geometry::Volume(body), Shape::Volume(volume)) => {
                // On the cut of a shell the field is higher than at the surface.
                let value = (volume.value(local) as f32).max(body.surface.unwrap_or_default());
                let normal = match &volume.shell {
                    Some(shell) if shell.form().value(local).abs() < 1e-3 * shell.bounds().radius() => {
                        -shell.form().value_and_gradient(local).1
                    }
                    _ => -volume.gradient(local),
                };
                Place { normal, uv: None, material, color: Some(volume.transfer.at(value).0) }
            }
            _ => Place { normal, uv: None, material, color: None },
        }
    }
}

/// What is known of a point in object space.
struct Place<'a> {
    normal: DVec3,
    uv: Option<[f32; 2]>,
    material: &'a Material,
    /// In place of the material's.
    color: Option<Vec3>,
}
