//! What must be thrown onto a dome so that a viewer who walks sees straight things straight?
//!
//! `cargo run --release -p polyptych-freeform --example dome -- FOLDER` draws a colonnade for a projector under a dome and
//! for one before a round wall, for three places of the viewer, and tells how long a table of directions takes.

mod common;

use common::{Easel, arguments};
use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::projector::{Projector, Screen};
use polyptych_core::scene::{Background, Light, Material, Object, Primitive, Scene, Shape};
use std::error::Error;
use std::time::Instant;

fn colonnade() -> Scene {
    let mut scene = Scene::default();
    scene.environment.background = Background::Gradient {
        below: Vec3::new(0.6, 0.6, 0.65),
        horizon: Vec3::new(0.75, 0.8, 0.85),
        above: Vec3::new(0.3, 0.5, 0.85),
    };
    let marble = scene.add_material(Material::new(Vec3::new(0.8, 0.78, 0.72)));
    let ground = scene.add_material(Material::new(Vec3::new(0.35, 0.4, 0.3)));
    let mut put = |name: &str, shape: Primitive, material, at: DVec3| {
        let mut object = Object::new(name, Shape::Primitive(shape), material);
        object.world_from_object.translation = at;
        scene.objects.push(object);
    };
    put("ground", Primitive::Plane { width: 200.0, depth: 200.0 }, ground, DVec3::new(0.0, -1.6, 0.0));
    for i in -6..=6 {
        let x = f64::from(i) * 3.0;
        put("column", Primitive::Cylinder { radius: 0.45, height: 6.0 }, marble, DVec3::new(x, 1.4, -14.0));
    }
    put("beam", Primitive::Box { size: DVec3::new(40.0, 0.8, 1.4) }, marble, DVec3::new(0.0, 4.8, -14.0));
    put("step", Primitive::Box { size: DVec3::new(40.0, 0.4, 2.4) }, marble, DVec3::new(0.0, -1.4, -14.0));
    scene.lights.push(Light::directional(DVec3::new(-0.4, -0.9, -0.5)));
    scene
}

fn main() -> Result<(), Box<dyn Error>> {
    let (folder, _) = arguments()?;
    let [width, height] = [1920, 1080];
    let lens = Camera::look_at(
        DVec3::new(0.0, -0.5, 2.5),
        DVec3::new(0.0, 1.2, -5.0),
        DVec3::Y,
        Projection::Perspective { fov_y: 1.1 },
    );
    let dome = Projector { lens: lens.clone(), screen: Screen::Dome { center: DVec3::ZERO, radius: 5.0 } };
    let wall = Projector { lens, screen: Screen::Cylinder { center: DVec3::ZERO, radius: 5.0 } };
    let mut easel = Easel::new(colonnade(), folder, &[("edge.rays", "2")])?;
    for (name, projector) in [("dome", dome), ("wall", wall)] {
        for (place, x) in [("left", -1.8), ("middle", 0.0), ("right", 1.8)] {
            let viewer = DVec3::new(x, 0.0, 0.5);
            let start = Instant::now();
            let camera = projector.camera(viewer, width, height)?;
            println!("{name}, viewer {place}: a table in {:.2} ms", start.elapsed().as_secs_f64() * 1e3);
            easel.draw(&format!("{name}_{place}"), camera, [width, height])?;
        }
    }
    Ok(())
}
