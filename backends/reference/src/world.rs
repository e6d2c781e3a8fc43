//! What does a ray meet first in the whole scene?

use crate::bvh::{Bounded, Bvh};
use crate::lights::Lamp;
use crate::line::{Hit, Line, Span, Start};
use crate::march::Cloud;
use crate::shade::Wants;
use crate::shapes::{Finish, Geometry};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use polyptych_core::math::{Aabb, Ray};
use polyptych_core::scene::{AlphaMode, Material, NormalMap, Scene, Shape};
use std::sync::Arc;

/// A scene made ready to be met by rays.
#[derive(Debug)]
pub(crate) struct World {
    pub(crate) scene: Arc<Scene>,
    /// Objects with surfaces, by rising index.
    items: Vec<Item>,
    tree: Bvh,
    /// Volumes, by rising index of their objects.
    pub(crate) clouds: Vec<Cloud>,
    pub(crate) lamps: Vec<Lamp>,
}

/// An object with a surface.
#[derive(Debug)]
pub(crate) struct Item {
    /// Index in the scene.
    pub(crate) object: usize,
    pub(crate) geometry: Arc<Geometry>,
    object_from_world: DAffine3,
    /// Turns normals of object space into such of world space.
    world_from_normal: DMat3,
    bounds: Aabb,
    /// No ray passes any point of it.
    solid: bool,
}

/// The place of a hit in the order in which a ray meets surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    t: f64,
    object: i64,
    part: i64,
}

impl Place {
    /// Before everything at distance 0.
    pub(crate) const START: Self = Self { t: 0.0, object: -1, part: -1 };
}

/// What a ray looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Search {
    /// The nearest surface that is not a hole.
    Visible,
    /// Any surface that blocks light.
    Blocking,
}

/// The surface that a ray met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Met<'a> {
    pub(crate) item: &'a Item,
    pub(crate) hit: Hit,
}

impl Met<'_> {
    pub(crate) fn place(&self) -> Place {
        Place { t: self.hit.t, object: self.item.object as i64, part: self.hit.part }
    }
}

/// A point of a surface with all that shading needs, in world space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point<'a> {
    pub(crate) position: DVec3,
    /// Unit true normal on the viewer's side.
    pub(crate) true_normal: DVec3,
    /// Unit shading normal, turned along with the true one.
    pub(crate) normal: DVec3,
    pub(crate) material: &'a Material,
    pub(crate) color: Vec3,
    pub(crate) opacity: f32,
    /// Distance along the true normal at which rays leave the surface.
    pub(crate) lift: f64,
}

/// Rays leave a surface this share of the largest number at hand above it: far above rounding (2e-16), far
/// below anything that is modeled.
const LIFT: f64 = 1e-10;

impl Item {
    pub(crate) fn new(scene: &Scene, object: usize, geometry: Arc<Geometry>) -> Self {
        let thing = &scene.objects[object];
        let object_from_world = thing.world_from_object.inverse();
        let bounds = thing.bounds();
        let margin = (bounds.min.abs().max(bounds.max.abs())).max_element() * 1e-12;
        let mut materials = thing.materials.iter().map(|&m| scene.materials.get(m));
        Self {
            object,
            geometry,
            object_from_world,
            world_from_normal: object_from_world.matrix3.transpose(),
            bounds: bounds.grown(margin),
            solid: materials.all(|m| !m.unwrap_or(Material::fallback()).is_see_through()),
        }
    }

    /// Turns a line into object space; distances along it stay those of the world.
    fn line(&self, ray: &Ray, start: Start) -> Line {
        Line {
            origin: self.object_from_world.transform_point3(ray.origin),
            direction: self.object_from_world.transform_vector3(ray.direction),
            start,
        }
    }
}

impl World {
    pub(crate) fn new(scene: Arc<Scene>, items: Vec<Item>, clouds: Vec<Cloud>, lamps: Vec<Lamp>) -> Self {
        let boxes = items.iter().enumerate().map(|(i, item)| Bounded::new(&item.bounds, i)).collect();
        Self { scene, items, tree: Bvh::build(boxes, 1), clouds, lamps }
    }

    /// Returns what [`World::bytes`] will be for so many surfaces, volumes and lights.
    pub(crate) fn planned_bytes(items: usize, clouds: usize, lamps: usize) -> u64 {
        (items * size_of::<Item>() + clouds * size_of::<Cloud>() + lamps * size_of::<Lamp>()) as u64
            + Bvh::planned_bytes(items, 1)
    }

    /// Returns the bytes held without what geometries hold.
    pub(crate) fn bytes(&self) -> u64 {
        (self.items.len() * size_of::<Item>()
            + self.clouds.len() * size_of::<Cloud>()
            + self.lamps.len() * size_of::<Lamp>()) as u64
            + self.tree.bytes()
    }

    /// Finds the first surface behind a place and nearer than a distance.
    pub(crate) fn meet(
        &self,
        ray: &Ray,
        start: Start,
        after: Place,
        before: f64,
        search: Search,
    ) -> Option<Met<'_>> {
        let any = search == Search::Blocking;
        let mut best: Option<Met<'_>> = None;
        let mut before = before;
        self.tree.walk(&Line::new(ray, start), after.t, before, &mut |leaf| {
            for &index in &self.tree.order()[leaf] {
                let item = &self.items[index as usize];
                let object = item.object as i64;
                let line = item.line(ray, start);
                let span = Span {
                    after: after.t,
                    after_part: match object.cmp(&after.object) {
                        std::cmp::Ordering::Less => i64::MAX,
                        std::cmp::Ordering::Equal => after.part,
                        std::cmp::Ordering::Greater => -1,
                    },
                    before,
                    // At the same distance the lower object wins.
                    before_part: match &best {
                        Some(met) if object < met.item.object as i64 => i64::MAX,
                        _ => 0,
                    },
                    any,
                };
                let found =
                    item.geometry.first(&line, &span, &mut |hit| self.accepts(item, &line, hit, search));
                if let Some(hit) = found {
                    before = if any { f64::NEG_INFINITY } else { hit.t };
                    best = Some(Met { item, hit });
                }
            }
            before
        });
        best
    }

    fn accepts(&self, item: &Item, line: &Line, hit: &Hit, search: Search) -> bool {
        if item.solid {
            return true;
        }
        let (material, _, opacity, _) = self.look_up(item, line, hit);
        match search {
            Search::Visible => opacity > 0.0,
            Search::Blocking => opacity >= 1.0 && material.alpha != AlphaMode::Blend,
        }
    }

    /// Returns material, base color, effective opacity, and what else is there at a hit.
    fn look_up(&self, item: &Item, line: &Line, hit: &Hit) -> (&Material, Vec3, f32, Finish) {
        let scene = &*self.scene;
        let material = scene.material(&scene.objects[item.object], hit.slot);
        let position = line.at(hit.t);
        let finish = item.geometry.finish(hit, position);
        let normal = hit.normal.normalize_or_zero().as_vec3();
        let (color, opacity) = scene.base_color(material, finish.uv, position.as_vec3(), normal, 0.0);
        let opacity = material.effective_opacity(opacity).min(1.0);
        (material, color * finish.color, opacity, finish)
    }

    /// Returns what shading needs of the surface that a ray met. Without anyone to see its color no texture is read for
    /// it: color and opacity are then the material's own. Nor is a normal map that nobody sees.
    pub(crate) fn point(&self, ray: &Ray, start: Start, met: &Met<'_>, wants: Wants) -> Point<'_> {
        let item = met.item;
        let line = item.line(ray, start);
        let (material, color, opacity, finish) = if wants.color || wants.albedo {
            self.look_up(item, &line, &met.hit)
        } else {
            let material = self.scene.material(&self.scene.objects[item.object], met.hit.slot);
            let finish = item.geometry.finish(&met.hit, line.at(met.hit.t));
            (material, material.base_color, material.opacity, finish)
        };
        let world = |n: DVec3| (item.world_from_normal * n).normalize_or(-ray.direction);
        let true_normal = world(met.hit.normal);
        let side = if true_normal.dot(ray.direction) > 0.0 { -1.0 } else { 1.0 };
        let mut normal = world(finish.normal);
        if let (Some(map), true) = (&material.normal_map, wants.color || wants.normal) {
            normal = self.turned(met, map, normal, &finish);
        }
        let position = ray.at(met.hit.t);
        let reach = position.abs().max_element().max(met.hit.t).max(item.bounds.radius());
        Point {
            position,
            true_normal: true_normal * side,
            normal: normal * side,
            material,
            color,
            opacity,
            lift: reach * LIFT,
        }
    }

    /// Returns a normal on the outside as a normal map turns it; as it is where there are no texture coordinates.
    fn turned(&self, met: &Met<'_>, map: &NormalMap, normal: DVec3, finish: &Finish) -> DVec3 {
        let object = &self.scene.objects[met.item.object];
        let (Shape::Mesh(mesh), Some(uv)) = (&*object.shape, finish.uv) else { return normal };
        let Some(along) = mesh.along_uv(met.hit.part as usize) else { return normal };
        let along = along.map(|v| (object.world_from_object.matrix3 * v.as_dvec3()).as_vec3());
        self.scene.turned_normal(map, normal.as_vec3(), along, uv, 0.0).as_dvec3()
    }
}
