//! Is the whole back end right? Checks against closed forms, and of its promises to the host.

mod depth;
mod layers;
mod light;
mod seam;

use crate::{Factory, Reference};
use glam::{DAffine3, DVec2, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::parallel::Pool;
use polyptych_core::scene::*;
use polyptych_core::seam::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

fn random(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
}

fn unit(state: &mut u64) -> DVec3 {
    DVec3::new(random(state), random(state), random(state)).normalize_or(DVec3::X)
}

/// A scene whose light is all from one place and whose background is black.
fn dark() -> Scene {
    let mut scene = Scene::default();
    scene.environment.background = Background::Solid(Vec3::ZERO);
    scene.environment.ambient = Vec3::ZERO;
    scene
}

/// A material that shows its own color, whatever the light.
fn glowing(color: Vec3, opacity: f32) -> Material {
    Material {
        emission: color,
        opacity,
        ambient: 0.0,
        diffuse: 0.0,
        specular: 0.0,
        ..Material::new(Vec3::ONE)
    }
}

fn camera(eye: [f64; 3], target: [f64; 3]) -> Camera {
    Camera::look_at(eye.into(), target.into(), DVec3::Y, Projection::Perspective { fov_y: 0.8 })
}

fn draw_with(scene: &Arc<Scene>, need: &Need, control: &Control<'_>) -> Framebuffer {
    let mut renderer = Reference::new();
    renderer.prepare(scene, need, &Converter::default(), control).unwrap();
    let mut picture = Framebuffer::new(need.width, need.height, need.channels);
    renderer.render(&need.frame(), &mut picture, control).unwrap();
    picture
}

fn draw(scene: Scene, camera: Camera, width: u32, height: u32) -> Framebuffer {
    let need = Need { channels: Channels::ALL, ..Need::new(camera, width, height) };
    draw_with(&Arc::new(scene), &need, &Control::simple())
}

/// What the ray of a single orthographic pixel sees.
fn probe(scene: &Arc<Scene>, renderer: &mut Reference, eye: DVec3, direction: DVec3) -> (f64, u32, Vec3) {
    let camera = Camera::look_at(eye, eye + direction, DVec3::Y, Projection::Orthographic { height: 1e-9 });
    let mut picture = Framebuffer::new(1, 1, Channels::ALL);
    let _ = scene;
    renderer.render(&Frame { camera }, &mut picture, &Control::simple()).unwrap();
    (f64::from(picture.distance()[0]), picture.id()[0], picture.color()[0])
}

fn prepared(scene: &Arc<Scene>) -> Reference {
    let need = Need { channels: Channels::ALL, ..Need::new(camera([0.0, 0.0, 5.0], [0.0; 3]), 1, 1) };
    let mut renderer = Reference::new();
    renderer.prepare(scene, &need, &Converter::default(), &Control::simple()).unwrap();
    renderer
}
