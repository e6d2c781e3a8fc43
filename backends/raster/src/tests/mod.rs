//! Does the rasterizer draw what it promises? Helpers, and a file for each kind of promise.

mod agreement;
mod coverage;
mod host;
mod lines;
mod pictures;
mod registers;
mod shadows;
mod smooth;

use crate::Raster;
use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::scene::{Material, Mesh, Object, Primitive, Scene, Shape};
use polyptych_core::seam::{Control, Need, Renderer};
use std::sync::Arc;

/// A perspective camera.
fn camera(eye: [f64; 3], target: [f64; 3]) -> Camera {
    let projection = Projection::Perspective { fov_y: 0.8 };
    Camera::look_at(eye.into(), target.into(), DVec3::Y, projection)
}

/// Draws all channels.
fn draw(scene: &Scene, camera: Camera, width: u32, height: u32) -> Framebuffer {
    draw_with(scene, camera, width, height, &[])
}

/// Draws all channels with parameters.
fn draw_with(
    scene: &Scene,
    camera: Camera,
    width: u32,
    height: u32,
    settings: &[(&str, &str)],
) -> Framebuffer {
    let mut need = Need { channels: Channels::ALL, ..Need::new(camera, width, height) };
    let (mut raster, control) = (Raster::new(), Control::simple());
    let declared = raster.info().parameters.clone();
    for (name, value) in settings {
        need.settings.set("raster", &declared, name, value).unwrap();
    }
    raster.prepare(&Arc::new(scene.clone()), &need, &Converter::default(), &control).unwrap();
    let mut picture = Framebuffer::new(width, height, need.channels);
    raster.render(&need.frame(), &mut picture, &control).unwrap();
    picture
}

/// A scene of objects with one gray material, without lights.
fn scene_of(shapes: Vec<(Shape, [f64; 3])>) -> Scene {
    let mut scene = Scene::default();
    let gray = scene.add_material(Material::new(Vec3::splat(0.5)));
    for (i, (shape, at)) in shapes.into_iter().enumerate() {
        scene.objects.push(Object::new(format!("object {i}"), shape, gray).at(at.into()));
    }
    scene
}

fn cube(size: f64) -> Shape {
    Shape::Primitive(Primitive::Box { size: DVec3::splat(size) })
}

fn plane(size: f64) -> Shape {
    Shape::Primitive(Primitive::Plane { width: size, depth: size })
}

/// One triangle.
fn triangle(corners: [[f32; 3]; 3]) -> Mesh {
    Mesh { positions: corners.map(Vec3::from_array).into(), triangles: vec![[0, 1, 2]], ..Mesh::default() }
}

/// Numbers in `[0, 1)`.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}
