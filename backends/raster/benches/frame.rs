//! How long does a frame take, and what does a change cost?
//!
//! `cargo bench -p polyptych-raster` draws a ball with bumps of 70,000 triangles over a floor at 1280x720 on all
//! processors; `POLYPTYCH_BENCH_TRIANGLES=900000` draws one of as many.

use divan::Bencher;
use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
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

/// Right triangles of random places and turns on a picture of 1920x1080, each in front of those before it, so that
/// every pixel of each is drawn; legs are in pixels.
fn scattered(count: usize, legs: f64) -> Mesh {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f64 / f64::from(1 << 24)
    };
    let mut mesh = Mesh::default();
    for i in 0..count as u32 {
        let corners = loop {
            let (x, y) = (random() * 1920.0 - 960.0, random() * 1080.0 - 540.0);
            let (sin, cos) = (random() * std::f64::consts::TAU).sin_cos();
            let corners = [[x, y], [x + legs * cos, y + legs * sin], [x - legs * sin, y + legs * cos]];
            if corners.iter().all(|[x, y]| x.abs() < 960.0 && y.abs() < 540.0) {
                break corners;
            }
        };
        let height = f64::from(i) / count as f64;
        mesh.positions.extend(corners.map(|[x, y]| DVec3::new(x, y, height).as_vec3()));
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
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
        Self::of(scene, Need::new(camera, 1280, 720), settings, 0)
    }

    /// Shows nothing but which object is where.
    fn of_scattered(legs: f64, threads: usize) -> Self {
        let mut scene = Scene::default();
        let clay = scene.add_material(Material::new(Vec3::splat(0.5)));
        let mesh = Shape::Mesh(scattered(count_of(legs), legs));
        scene.objects.push(Object::new("triangles", mesh, clay));
        let view = Projection::Orthographic { height: 1080.0 };
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO, DVec3::Y, view);
        let mut need = Need::new(camera, 1920, 1080);
        need.channels = Channels::NONE.with(Channel::Id);
        Self::of(scene, need, &[], threads)
    }

    /// Prepares a scene; no number of threads means all.
    fn of(scene: Scene, mut need: Need, settings: &[(&str, &str)], threads: usize) -> Self {
        let mut raster = Raster::new();
        for (name, value) in settings {
            let declared = raster.info().parameters.clone();
            need.settings.set("raster", &declared, name, value).expect("a parameter");
        }
        let picture = Framebuffer::new(need.width, need.height, need.channels);
        let pool = Pool::new(threads).expect("threads");
        let all = Arc::new(scene.clone());
        raster.prepare(&all, &need, &Converter::default(), &Control::new(&pool)).expect("a scene");
        Self { scene, need, pool, raster, picture }
    }

    fn prepare(&mut self) {
        let (scene, control) = (Arc::new(self.scene.clone()), Control::new(&self.pool));
        self.raster.prepare(&scene, &self.need, &Converter::default(), &control).expect("a scene");
    }

    fn render(&mut self) {
        self.picture.touch();
        self.render_again();
    }

    /// Draws into a picture that may show the same already.
    fn render_again(&mut self) {
        let control = Control::new(&self.pool);
        self.raster.render(&self.need.frame(), &mut self.picture, &control).expect("a picture");
    }
}

/// Fewer large triangles than small ones, but always so many that they, not the picture, take the time.
fn count_of(legs: f64) -> usize {
    ((2.5e8 / (legs * legs)) as usize).clamp(4096, 262_144)
}

/// Visibility alone: triangles a second. Legs in pixels, on one thread and on two.
#[divan::bench(args = [4, 10, 25, 50, 100, 250, 500], consts = [1, 2])]
fn scattered_triangles<const THREADS: usize>(bencher: Bencher, legs: u32) {
    let mut stage = Stage::of_scattered(f64::from(legs), THREADS);
    let triangles = count_of(f64::from(legs));
    bencher.counter(divan::counter::ItemsCount::new(triangles)).bench_local(|| stage.render());
}

/// A frame in each mode, with nothing to prepare.
#[divan::bench(args = ["lit", "shadowed", "hidden-line", "wireframe"])]
fn frame(bencher: Bencher, mode: &str) {
    let mut stage = Stage::new(&[("mode", mode)]);
    bencher.bench_local(|| stage.render());
}

/// A frame in which nothing has changed.
#[divan::bench]
fn unchanged(bencher: Bencher) {
    let mut stage = Stage::new(&[]);
    stage.render();
    bencher.bench_local(|| stage.render_again());
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
