//! How long does a frame of a world of voxels take?
//!
//! `cargo bench -p polyptych-voxel` draws worlds of 1024x256x1024 cells at 1280x720. A number of rays a second stands
//! beside each time. `POLYPTYCH_BENCH_GRID=FILE.npy` draws a cube of bytes, x slowest, in the place of the terrain;
//! `POLYPTYCH_BENCH_VIEW=eye,target,degrees` says from where in seven numbers; the cube fills -1 to 1 along each axis.

mod worlds;

use divan::Bencher;
use divan::counter::ItemsCount;
use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{Brush, History, Light, Material, Object, Region, Scene, Shape, Voxels};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_voxel::Voxel;
use std::sync::{Arc, OnceLock};
use worlds::Kind;

fn main() {
    divan::main();
}

/// A world, built once for all that is measured.
fn world(kind: Kind) -> &'static Scene {
    static SCENES: OnceLock<[OnceLock<Scene>; 3]> = OnceLock::new();
    SCENES.get_or_init(Default::default)[kind as usize].get_or_init(|| {
        let mut scene = Scene::default();
        let earth = scene.add_material(Material::new(Vec3::new(0.4, 0.5, 0.3)));
        let given = std::env::var("POLYPTYCH_BENCH_GRID").ok().filter(|_| kind == Kind::Terrain);
        let voxels = given.map_or_else(|| kind.build([1024, 256, 1024]), |path| cube(&path));
        scene.objects.push(Object::new("world", Shape::Voxels(voxels), earth));
        scene.lights.push(Light::directional(DVec3::new(-0.4, -0.7, -0.3)));
        scene
    })
}

/// Reads a cube of bytes.
fn cube(path: &str) -> Voxels {
    let bytes = std::fs::read(path).expect("a file");
    let edge = (bytes.len() as f64).cbrt() as u32;
    let cells = &bytes[bytes.len() - (edge * edge * edge) as usize..];
    Voxels::from_fn([edge; 3], |x, y, z| u8::from(cells[((x * edge + y) * edge + z) as usize] != 0))
}

/// Returns eye and target: those that were asked for, in units of half of a cube.
fn view(kind: Kind, voxels: &Voxels) -> (DVec3, DVec3, f64) {
    if kind != Kind::Terrain || std::env::var("POLYPTYCH_BENCH_GRID").is_err() {
        let (eye, target) = kind.view(voxels);
        return (eye, target, 2.0 * 0.7f64.atan());
    }
    let asked =
        std::env::var("POLYPTYCH_BENCH_VIEW").unwrap_or_else(|_| "1.6,1.1,2.6,0,-0.15,0,40".to_owned());
    let n: Vec<f64> = asked.split(',').map(|n| n.parse().expect("numbers")).collect();
    let half = f64::from(voxels.size()[0]) * 0.5;
    let place = |n: &[f64]| (DVec3::new(n[0], n[1], n[2]) + 1.0) * half;
    (place(&n[..3]), place(&n[3..6]), n[6].to_radians())
}

/// A renderer that has prepared a world, and the picture that it draws.
struct Stage {
    need: Need,
    pool: Pool,
    voxel: Voxel,
    picture: Framebuffer,
}

impl Stage {
    fn new(kind: Kind, channels: Channels, settings: &[(&str, &str)], threads: usize) -> Self {
        let scene = world(kind);
        let Shape::Voxels(voxels) = &*scene.objects[0].shape else {
            unreachable!("a grid was just put there")
        };
        let (eye, target, fov_y) = view(kind, voxels);
        let view = Projection::Perspective { fov_y };
        let mut need = Need::new(Camera::look_at(eye, target, DVec3::Y, view), 1280, 720);
        need.channels = channels;
        let mut voxel = Voxel::new();
        for (name, value) in settings {
            need.settings.set("voxel", &voxel.info().parameters.clone(), name, value).expect("a parameter");
        }
        let pool = Pool::new(threads).expect("threads");
        let scene = Arc::new(scene.clone());
        voxel.prepare(&scene, &need, &Converter::default(), &Control::new(&pool)).expect("a scene");
        let picture = Framebuffer::new(need.width, need.height, need.channels);
        Self { need, pool, voxel, picture }
    }

    fn draw(mut self, bencher: Bencher) {
        let control = Control::new(&self.pool);
        self.picture.touch();
        let report = self.voxel.render(&self.need.frame(), &mut self.picture, &control).expect("a picture");
        let count = |name| report.counters.iter().flatten().find(|c| c.name == name).map_or(0, |c| c.count);
        let rays = count("rays") + count("shadow rays");
        eprintln!("{:.1} steps a ray", count("steps") as f64 / rays as f64);
        bencher.counter(ItemsCount::new(rays)).bench_local(|| {
            self.picture.touch();
            self.voxel.render(&self.need.frame(), &mut self.picture, &control).expect("a picture")
        });
    }
}

/// Distances alone: no ray but those of the eye.
#[divan::bench(args = Kind::ALL, consts = [1, 2], sample_count = 9, sample_size = 1)]
fn primary_rays<const THREADS: usize>(bencher: Bencher, kind: Kind) {
    Stage::new(kind, Channels::NONE.with(Channel::Distance), &[], THREADS).draw(bencher);
}

/// The same in the numbers that are asked for.
#[divan::bench(args = Kind::ALL, consts = [0, 1, 2], sample_count = 9, sample_size = 1)]
fn walks<const NUMBERS: usize>(bencher: Bencher, kind: Kind) {
    let walk = ["fast", "exact", "f64"][NUMBERS];
    Stage::new(kind, Channels::NONE.with(Channel::Distance), &[("walk", walk)], 1).draw(bencher);
}

/// Colors in the light of a sun, with its shadows.
#[divan::bench(args = Kind::ALL, consts = [1, 2], sample_count = 9, sample_size = 1)]
fn lit_with_shadows<const THREADS: usize>(bencher: Bencher, kind: Kind) {
    Stage::new(kind, Channels::NONE.with(Channel::Color), &[], THREADS).draw(bencher);
}

/// Ten thousand edits of a world of 1024^3 cells: one cell, a box, or a ball each.
#[divan::bench(sample_count = 10_000, sample_size = 1)]
fn edits(bencher: Bencher) {
    let mut voxels = Kind::Terrain.build([1024, 1024, 1024]);
    let mut state = 7u64;
    let mut history = History::default();
    bencher
        .with_inputs(|| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            [17, 29, 41, 53].map(|shift| (state >> shift) as u32 & 1023)
        })
        .bench_local_values(|[x, y, z, kind]| {
            let at = [x, y, z];
            let center = DVec3::from_array(at.map(f64::from));
            let region = match kind % 3 {
                0 => Region::Cell(at),
                1 => Region::Box { from: at, to: at.map(|c| c + 4) },
                _ => Region::Sphere { center, radius: 3.0 },
            };
            history.edit(&mut voxels, &region, Brush::Set((kind % 5) as u8))
        });
    while history.undo(&mut voxels) {}
}

/// The same, each with the masks made ready for the next frame.
#[divan::bench(sample_count = 2_000, sample_size = 1)]
fn edits_made_ready(bencher: Bencher) {
    let mut scene = Scene::default();
    let earth = scene.add_material(Material::new(Vec3::new(0.4, 0.5, 0.3)));
    let voxels = Kind::Terrain.build([1024, 1024, 1024]);
    scene.objects.push(Object::new("world", Shape::Voxels(voxels), earth));
    let view = Projection::Perspective { fov_y: 0.9 };
    let need = Need::new(Camera::look_at(DVec3::splat(900.0), DVec3::ZERO, DVec3::Y, view), 64, 64);
    let (pool, converter) = (Pool::new(1).expect("threads"), Converter::default());
    let mut voxel = Voxel::new();
    let mut scene = Arc::new(scene);
    voxel.prepare(&scene, &need, &converter, &Control::new(&pool)).expect("a scene");
    let mut state = 7u64;
    bencher.bench_local(|| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let at = [17, 29, 41].map(|shift| (state >> shift) as u32 & 1023);
        let mut edited = Scene::clone(&scene);
        let mut shape = Shape::clone(&edited.objects[0].shape);
        if let Shape::Voxels(voxels) = &mut shape {
            let region = Region::Sphere { center: DVec3::from_array(at.map(f64::from)), radius: 3.0 };
            voxels.edit(&region, Brush::Set((at[0] % 3) as u8));
        }
        edited.objects[0].shape = Arc::new(shape);
        scene = Arc::new(edited);
        voxel.prepare(&scene, &need, &converter, &Control::new(&pool)).expect("a scene");
    });
}
