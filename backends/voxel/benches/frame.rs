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
use polyptych_core::scene::{Light, Material, Object, Scene, Shape, Voxels};
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
