//! What is seen along a ray, and how much of the sky does it see?

use crate::Ready;
use crate::hit::{Hit, Triangle};
use crate::tree::Tree;
use glam::{DMat3, DVec3, Vec2, Vec3};
use polyptych_plugin::core::framebuffer::{Channel, Channels, Pixel};
use polyptych_plugin::core::math::Ray;
use polyptych_plugin::core::scene::{Mesh, Scene, Shape};
use polyptych_plugin::core::shade;
use std::f64::consts::TAU;
use std::sync::Arc;

/// The scene with the tree over its triangles.
pub(crate) struct World {
    scene: Arc<Scene>,
    tree: Tree,
    /// Turns normals of each object into world space.
    turns: Vec<DMat3>,
}

impl World {
    /// Bytes of a triangle with its share of the tree.
    pub(crate) const BYTES_PER_TRIANGLE: u64 = size_of::<Triangle>() as u64 + 32;

    pub(crate) fn new(scene: Arc<Scene>, drawn: &dyn Fn(usize) -> bool) -> Self {
        let mut triangles = Vec::new();
        for (index, object) in scene.objects.iter().enumerate() {
            let Shape::Mesh(mesh) = &*object.shape else { continue };
            if !drawn(index) {
                continue;
            }
            let place = |p: Vec3| object.world_from_object.transform_point3(p.as_dvec3());
            triangles.extend((0..mesh.triangles.len()).filter_map(|face| {
                let corners = mesh.corners(face).map(place);
                let is_whole = corners.iter().all(|c| c.is_finite());
                is_whole.then(|| Triangle::new(corners, index as u32, face as u32))
            }));
        }
        let turns = scene.objects.iter().map(|o| o.world_from_object.matrix3.inverse().transpose()).collect();
        Self { scene, tree: Tree::new(triangles), turns }
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.tree.len() as u64 * Self::BYTES_PER_TRIANGLE
    }

    pub(crate) fn radius(&self) -> f64 {
        let radius = self.tree.bounds().radius();
        if radius > 0.0 && radius.is_finite() { radius } else { 1.0 }
    }

    fn mesh(&self, triangle: &Triangle) -> Option<&Mesh> {
        match &*self.scene.objects[triangle.object as usize].shape {
            Shape::Mesh(mesh) => Some(mesh),
            _ => None,
        }
    }
}

impl Ready {
    /// Returns what is seen along a ray; `seed` tells pixels apart.
    pub(crate) fn pixel(&self, ray: Ray, seed: u64, channels: Channels) -> Pixel {
        let world = &self.world;
        let Some(hit) = world.tree.nearest(&ray, 0.0, f64::INFINITY) else {
            return Pixel::background(world.scene.environment.background.color(ray.direction));
        };
        let triangle = world.tree.triangle(hit.triangle);
        let object = &world.scene.objects[triangle.object as usize];
        let flat = shade::facing(triangle.normal().normalize_or(DVec3::Y), ray.direction);
        let (normal, albedo, emission) = world.surface(&hit, flat);
        let point = ray.at(hit.distance);
        let open = if channels.has(Channel::Color) { self.open(point, flat, normal, seed) } else { 0.0 };
        let color = shade::fogged(&world.scene.environment, albedo * open + emission, hit.distance);
        Pixel {
            color,
            distance: hit.distance as f32,
            normal: normal.as_vec3(),
            id: triangle.object + 1,
            albedo,
            coverage: if object.visible { 1.0 } else { 0.0 },
            ..Pixel::background(Vec3::ZERO)
        }
    }

    /// Returns the share of directions, weighted by their cosine, in which nothing is near.
    fn open(&self, point: DVec3, flat: DVec3, normal: DVec3, seed: u64) -> f32 {
        let across = normal.any_orthonormal_vector();
        let along = normal.cross(across);
        let lift = 1e-6 * (self.world.radius() + point.length());
        let origin = point + flat * lift;
        let turn = fraction(seed);
        let free = (0..self.samples).filter(|&i| {
            // Points of a spiral of equal steps on the disk (Vogel), turned differently at each pixel.
            let share = (f64::from(i) + 0.5) / f64::from(self.samples);
            let angle = TAU * (turn + f64::from(i) * 0.381_966_011_250_105);
            let (disk, up) = (share.sqrt(), (1.0 - share).sqrt());
            let direction = across * (disk * angle.cos()) + along * (disk * angle.sin()) + normal * up;
            direction.dot(flat) > 0.0
                && !self.world.tree.meets_any(&Ray { origin, direction }, 0.0, self.radius)
        });
        free.count() as f32 / self.samples as f32
    }
}

impl World {
    /// Returns shading normal, base color and emission where a triangle was hit.
    fn surface(&self, hit: &Hit, flat: DVec3) -> (DVec3, Vec3, Vec3) {
        let triangle = self.tree.triangle(hit.triangle);
        let object = &self.scene.objects[triangle.object as usize];
        let Some(mesh) = self.mesh(triangle) else { return (flat, Vec3::ZERO, Vec3::ZERO) };
        let face = triangle.face as usize;
        let corners = mesh.triangles[face].map(|i| i as usize);
        let (u, v) = (hit.u as f32, hit.v as f32);
        let mix = |values: [Vec3; 3]| values[0] * (1.0 - u - v) + values[1] * u + values[2] * v;
        let mut normal = flat;
        if !mesh.normals.is_empty() {
            let smooth =
                self.turns[triangle.object as usize] * mix(corners.map(|i| mesh.normals[i])).as_dvec3();
            let smooth = smooth.normalize_or(flat);
            normal = if smooth.dot(flat) < 0.0 { -smooth } else { smooth };
        }
        let material = self.scene.material(object, mesh.slot(face));
        let uv = (!mesh.uvs.is_empty()).then(|| {
            let [a, b, c] = corners.map(|i| mesh.uvs[i]);
            let uv: Vec2 = a * (1.0 - u - v) + b * u + c * v;
            uv.to_array()
        });
        let position = mix(corners.map(|i| mesh.positions[i]));
        let [a, b, c] = mesh.corners(face);
        let across = (b - a).cross(c - a).normalize_or_zero();
        let (mut albedo, _) = self.scene.base_color(material, uv, position, across, 0.0);
        if !mesh.colors.is_empty() {
            albedo *= mix(corners.map(|i| mesh.colors[i]));
        }
        (normal, albedo, material.emission)
    }
}

/// Turns a number into another one in [0, 1) that looks random (Steele, Lea, Flood, *SplitMix*, OOPSLA 2014).
fn fraction(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}
