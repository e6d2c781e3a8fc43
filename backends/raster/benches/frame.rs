//! How long does a frame take, and what does a change cost?
//!
//! `cargo bench -p polyptych-raster` draws a ball with bumps of 70,000 triangles over a floor at 1280x720 on all
//! processors; `POLYPTYCH_BENCH_TRIANGLES=900000` draws one of as many.

use divan::Bencher;
use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{Light, Material, Mesh, Object, Primitive, Scene, Shape};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_raster::Raster;
use std::sync::Arc;

fn main() {
    divan::main();
}

/// A ball whose radius goes up and down, of rings and columns.
fn ball() -> Mesh {
    let asked = std::env::var("POLYPTYCH_BENCH_TRIANGLES").ok().and_then(|t| t.parse().ok());
    let rings = (asked.unwrap_or(70_000.0f64) / 4.0).sqrt().round().max(3.0) as u32;
    let columns = rings * 2;
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        let polar = std::f32::consts::PI * ring as f32 / rings as f32;
        for column in 0..columns {
            let angle = std::f32::consts::TAU * column as f32 / columns as f32;
            let out = Vec3::new(polar.sin() * angle.cos(), polar.cos(), polar.sin() * angle.sin());
            let bumps = (out * 9.0).to_array().map(f32::sin);
            mesh.positions.push(out * (1.0 + 0.05 * bumps[0] * bumps[1] * bumps[2]));
            mesh.normals.push(out);
        }
    }
    for ring in 0..rings {
        for column in 0..columns {
            let [a, b] = [column, (column + 1) % columns].map(|c| ring * columns + c);
            mesh.triangles.extend([[a, b, a + columns], [b, b + columns, a + columns]]);
        }
    }
    mesh
}

/// A scene, the need of its picture, and a renderer that has prepared it.
struct Stage {
    scene: Scene,
    need: Need,
    pool: Pool,
    raster: Raster,
    picture: Framebuffer,
}

impl Stage {
    fn new(settings: &[(&str, &str)]) -> Self {
        let mut scene = Scene::default();
        let clay = scene.add_material(Material::new(Vec3::new(0.75, 0.72, 0.68)));
        scene.objects.push(Object::new("ball", Shape::Mesh(ball()), clay));
        let floor = Shape::Primitive(Primitive::Plane { width: 8.0, depth: 8.0 });
        scene.objects.push(Object::new("floor", floor, clay).at(DVec3::new(0.0, -1.1, 0.0)));
        scene.lights.push(Light::directional(DVec3::new(-0.5, -0.8, -0.3)));
        let view = Projection::Perspective { fov_y: 0.7 };
        let camera = Camera::look_at(DVec3::new(1.6, 1.1, 2.6), DVec3::new(0.0, -0.15, 0.0), DVec3::Y, view);
        let mut need = Need::new(camera, 1280, 720);
        let mut raster = Raster::new();
        for (name, value) in settings {
            let declared = raster.info().parameters.clone();
            need.settings.set("raster", &declared, name, value).expect("a parameter");
        }
        let picture = Framebuffer::new(need.width, need.height, need.channels);
        let pool = Pool::new(0).expect("threads");
        let all = Arc::new(scene.clone());
        raster.prepare(&all, &need, &Converter::default(), &Control::new(&pool)).expect("a scene");
        Self { scene, need, pool, raster, picture }
    }

    fn prepare(&mut self) {
        let (scene, control) = (Arc::new(self.scene.clone()), Control::new(&self.pool));
        self.raster.prepare(&scene, &self.need, &Converter::default(), &control).expect("a scene");
    }

    fn render(&mut self) {
        let control = Control::new(&self.pool);
        self.raster.render(&self.need.frame(), &mut self.picture, &control).expect("a picture");
    }
}

/// A frame in each mode, with nothing to prepare.
#[divan::bench(args = ["lit", "shadowed", "hidden-line", "wireframe"])]
fn frame(bencher: Bencher, mode: &str) {
    let mut stage = Stage::new(&[("mode", mode)]);
    bencher.bench_local(|| stage.render());
}

/// A frame whose edges are smoothed.
#[divan::bench(args = ["1", "4", "16"])]
fn samples(bencher: Bencher, samples: &str) {
    let mut stage = Stage::new(&[("samples", samples)]);
    bencher.bench_local(|| stage.render());
}

/// A frame of each way to shade.
#[divan::bench(args = ["phong", "gouraud", "flat"])]
fn shading(bencher: Bencher, shading: &str) {
    let mut stage = Stage::new(&[("shading", shading)]);
    bencher.bench_local(|| stage.render());
}

/// A light that moves before each frame: its map is redrawn.
#[divan::bench(args = [false, true])]
fn light_moves(bencher: Bencher, then_draws: bool) {
    let (mut stage, mut time) = (Stage::new(&[]), 0.0f64);
    bencher.bench_local(|| {
        time += 0.01;
        stage.scene.lights[0] = Light::directional(DVec3::new(time.cos(), -1.2, time.sin()));
        stage.prepare();
        if then_draws {
            stage.render();
        }
    });
}

/// An object that moves before each frame: all maps are redrawn.
#[divan::bench]
fn object_moves(bencher: Bencher) {
    let (mut stage, mut time) = (Stage::new(&[]), 0.0f64);
    bencher.bench_local(|| {
        time += 0.01;
        stage.scene.objects[0].world_from_object.translation = DVec3::new(0.1 * time.sin(), 0.0, 0.0);
        stage.prepare();
        stage.render();
    });
}
