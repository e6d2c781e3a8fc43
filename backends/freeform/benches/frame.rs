//! How long does a frame of each kind take?
//!
//! `cargo bench -p polyptych-freeform` draws on one thread. Where `POLYPTYCH_MODELS` names a folder with
//! `volume/cranium_ct_i16.nrrd`, the head is that one, else a made-up volume of its size. Where
//! `POLYPTYCH_BENCH_SCENES` names files of scenes, with commas between, those are drawn too, lit and at 1024x1024.

use divan::Bencher;
use glam::{DVec2, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::load::LoadOptions;
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{
    Form, FreeForm, HeightField, Light, Material, Object, Perturbation, Power, Samples, Scene, Shape,
    TransferFunction, TransferPreset, Volume,
};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_freeform::Freeform;
use std::path::Path;
use std::sync::Arc;

fn main() {
    divan::main();
}

/// Numbers in `[0, 1)` from a shift register of 32 bits.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        f64::from(self.0 >> 8) / 16_777_216.0
    }

    fn direction(&mut self) -> DVec3 {
        let (around, height) = (self.next() * std::f64::consts::TAU, self.next() * 2.0 - 1.0);
        let aside = (1.0 - height * height).sqrt();
        DVec3::new(aside * around.cos(), height, aside * around.sin())
    }
}

fn ellipsoid(center: DVec3, radii: DVec3) -> Form {
    Form::Ellipsoid { center, radii }
}

/// A ball with so many bumps and dents, each an ellipsoid on its surface.
fn perturbed(count: u32) -> Form {
    let mut random = Random(7);
    let mut term = || {
        let center = random.direction() * 0.6;
        let radius = 0.05 + 0.2 * random.next();
        let flat = (1.0 + random.next()).sqrt();
        // The ball below is one of 1 where its function in squared lengths is 0.36.
        let weight = if random.next() < 0.5 { 0.25 } else { -0.25 } / 0.36;
        let function = ellipsoid(center, DVec3::new(radius, radius / flat, radius));
        Perturbation { weight, power: Power::Cube, function }
    };
    let terms = (0..count).map(|_| term()).collect();
    Form::Perturbed { base: Box::new(ellipsoid(DVec3::ZERO, DVec3::splat(0.6))), terms }
}

/// Twelve ellipsoids within a ball, without seven rods: twenty quadrics.
fn cut_and_joined() -> Form {
    let mut random = Random(7);
    let joined = (0..12)
        .map(|_| {
            let center = random.direction() * 0.55;
            ellipsoid(center, DVec3::new(random.next(), random.next(), random.next()) * 0.25 + 0.25)
        })
        .collect();
    let within = Form::Intersection(vec![Form::Union(joined), ellipsoid(DVec3::ZERO, DVec3::splat(0.9))]);
    let rod = |random: &mut Random| {
        let (center, axis) = (random.direction() * (0.3 * random.next()), random.direction());
        Form::Cylinder { center, axis, radius: 0.10 + 0.06 * random.next() }
    };
    let cut = (0..7).map(|_| rod(&mut random)).collect();
    Form::Difference(Box::new(within), Box::new(Form::Union(cut)))
}

/// Eight balls that flow into one another.
fn blended() -> Form {
    let mut random = Random(11);
    let mut ball = || {
        let center = random.direction() * (0.2 + 0.3 * random.next());
        ellipsoid(center, DVec3::splat(0.2 + 0.1 * random.next()))
    };
    let first = ball();
    (0..7).fold(first, |a, _| Form::SmoothUnion { a: Box::new(a), b: Box::new(ball()), k: 0.5 })
}

/// A scene of one shape, lit by a lamp.
fn scene_of(shape: Shape) -> Scene {
    let mut scene = Scene::default();
    let clay = scene.add_material(Material::new(Vec3::new(0.75, 0.72, 0.68)));
    scene.objects.push(Object::new("shape", shape, clay));
    scene.lights.push(Light::directional(DVec3::new(-0.5, -0.8, -0.3)));
    scene
}

fn look(eye: DVec3, target: DVec3, fov_y: f64) -> Camera {
    Camera::look_at(eye, target, DVec3::Y, Projection::Perspective { fov_y })
}

/// A renderer that has prepared a scene, and the picture it draws.
struct Stage {
    need: Need,
    pool: Pool,
    freeform: Freeform,
    picture: Framebuffer,
}

impl Stage {
    fn new(
        scene: Scene,
        camera: Camera,
        [width, height]: [u32; 2],
        channels: Channels,
        threads: usize,
    ) -> Self {
        Self::with(scene, camera, [width, height], channels, threads, &[])
    }

    fn with(
        scene: Scene,
        camera: Camera,
        [width, height]: [u32; 2],
        channels: Channels,
        threads: usize,
        settings: &[(&str, &str)],
    ) -> Self {
        let mut need = Need::new(camera, width, height);
        need.channels = channels;
        let mut freeform = Freeform::new();
        for (name, value) in settings {
            let declared = freeform.info().parameters.clone();
            need.settings.set("freeform", &declared, name, value).expect("a parameter");
        }
        let pool = Pool::new(threads).expect("threads");
        freeform
            .prepare(&Arc::new(scene), &need, &Converter::default(), &Control::new(&pool))
            .expect("a scene");
        let picture = Framebuffer::new(width, height, channels);
        Self { need, pool, freeform, picture }
    }

    fn of_form(form: Form, channels: Channels, threads: usize) -> Self {
        let form = FreeForm::new(form).expect("a form");
        let camera = look(DVec3::new(0.9, 1.1, 1.9), DVec3::ZERO, 2.0 * 0.4_f64.atan());
        Self::new(scene_of(Shape::FreeForm(form)), camera, [1024, 1024], channels, threads)
    }

    fn render(&mut self) {
        let control = Control::new(&self.pool);
        self.picture.touch();
        self.freeform.render(&self.need.frame(), &mut self.picture, &control).expect("a picture");
    }
}

/// Distances alone.
const DISTANCE: Channels = Channels::NONE.with(Channel::Distance);

/// A ball with so many perturbations: distances alone, on one thread and two.
#[divan::bench(args = [0, 4, 16, 64], consts = [1, 2])]
fn perturbations<const THREADS: usize>(bencher: Bencher, count: u32) {
    let mut stage = Stage::of_form(perturbed(count), DISTANCE, THREADS);
    bencher.bench_local(|| stage.render());
}

/// The same with light and shadow.
#[divan::bench(args = [0, 4, 16, 64])]
fn perturbations_lit(bencher: Bencher, count: u32) {
    let mut stage = Stage::of_form(perturbed(count), Channels::COLOR, 1);
    bencher.bench_local(|| stage.render());
}

/// Set operations and blends, lit.
#[divan::bench(args = ["cut-and-joined", "blended", "perturbed-8"])]
fn forms_lit(bencher: Bencher, which: &str) {
    let form = match which {
        "blended" => blended(),
        "perturbed-8" => perturbed(8),
        _ => cut_and_joined(),
    };
    let mut stage = Stage::of_form(form, Channels::COLOR, 1);
    bencher.bench_local(|| stage.render());
}

/// Hills of noise in five octaves over a grid of so many cells along each edge.
fn hills(edge: u32) -> HeightField {
    let noise = |x: f64, z: f64| {
        let at = |x: f64, z: f64| ((x * 12.9898 + z * 78.233).sin() * 43_758.545_3).fract().abs();
        let (u, v) = (x - x.floor(), z - z.floor());
        let (u, v) = (u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v));
        let row = |z: f64| at(x.floor(), z) * (1.0 - u) + at(x.floor() + 1.0, z) * u;
        row(z.floor()) * (1.0 - v) + row(z.floor() + 1.0) * v
    };
    let side = edge + 1;
    let height = |i: u32| {
        let (x, z) = (f64::from(i % side) / f64::from(edge), f64::from(i / side) / f64::from(edge));
        let octave = |o: i32| noise(x * 5.7 * 2f64.powi(o), z * 5.7 * 2f64.powi(o)) * 0.5f64.powi(o + 1);
        ((0..5).map(octave).sum::<f64>() * 200.0) as f32
    };
    let heights = (0..side * side).map(height).collect();
    HeightField::new(side, side, DVec2::splat(1024.0), heights).expect("heights")
}

/// Hills, seen from one of them.
#[divan::bench(args = [1024, 4096])]
fn heights(bencher: Bencher, edge: u32) {
    let eye = DVec3::new(100.3 - 512.0, 230.2, 90.7 - 512.0);
    let camera = look(eye, eye + DVec3::new(500.0, -170.0, 560.0), 2.0 * 0.7_f64.atan());
    let scene = scene_of(Shape::HeightField(hills(edge)));
    let mut stage = Stage::new(scene, camera, [1280, 720], DISTANCE, 1);
    bencher.bench_local(|| stage.render());
}

/// The head of `POLYPTYCH_MODELS`, or shells of the same size in samples.
fn head() -> Volume {
    let loaded = std::env::var("POLYPTYCH_MODELS").ok().and_then(|folder| {
        let scene = loaded(&Path::new(&folder).join("volume/cranium_ct_i16.nrrd"))?;
        scene.objects.iter().find_map(|o| match &*o.shape {
            Shape::Volume(volume) => Some(volume.clone()),
            _ => None,
        })
    });
    loaded.unwrap_or_else(|| {
        let size = [256u32, 256, 108];
        let value = |i: u32| {
            let cell = [i % 256, i / 256 % 256, i / 65536].map(f64::from);
            let p =
                (DVec3::from_array(cell) - DVec3::new(127.5, 127.5, 53.5)) / DVec3::new(100.0, 115.0, 50.0);
            let (r, ripple) = (p.length(), 0.02 * (p * 25.0).to_array().map(f64::sin).iter().sum::<f64>());
            let hounsfield = match r + ripple {
                r if r > 0.95 => -1000.0,
                r if r > 0.85 => 40.0,
                r if r > 0.75 => 900.0,
                _ => 30.0,
            };
            hounsfield as i16
        };
        let samples = Samples::I16((0..256 * 256 * 108).map(value).collect());
        Volume::new(size, DVec3::new(0.9, 0.9, 1.6), samples).expect("a volume")
    })
}

/// A head from tomography, lit: bone alone, or skin and muscle too, with steps in units of the spacing.
#[divan::bench(args = ["bone 0.5", "bone 1.0", "tissue 0.5", "tissue 1.0", "tissue 1.0 kept", "skin 1.0"], consts = [1, 2])]
fn tomography<const THREADS: usize>(bencher: Bencher, which: &str) {
    let mut volume = head();
    let mut words = which.split(' ');
    let preset = match words.next() {
        Some("bone") => TransferPreset::CtBone,
        Some("skin") => TransferPreset::CtSkin,
        _ => TransferPreset::CtTissue,
    };
    let settings = [
        ("volume.step", words.next().unwrap_or("0.5")),
        ("volume.gradients", words.next().unwrap_or("found")),
    ];
    volume.transfer = TransferFunction::preset(preset, volume.spacing().min_element());
    let far = volume.bounds().radius() * 2.6;
    let camera = look(DVec3::new(0.45, -0.85, 0.3).normalize_or_zero() * far, DVec3::ZERO, 0.7);
    let scene = scene_of(Shape::Volume(volume));
    let mut stage = Stage::with(scene, camera, [1280, 720], Channels::COLOR, THREADS, &settings);
    bencher.bench_local(|| stage.render());
}

/// Loads a scene or a model.
fn loaded(path: &Path) -> Option<Scene> {
    polyptych_core::load::load(path, &LoadOptions::default()).ok()
}

fn files() -> Vec<String> {
    let named = std::env::var("POLYPTYCH_BENCH_SCENES").unwrap_or_default();
    named.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect()
}

/// Scenes from files, from their first cameras.
#[divan::bench(args = files())]
fn scenes(bencher: Bencher, file: &String) {
    let scene = loaded(Path::new(file)).expect("a scene");
    let camera = scene.cameras.first().expect("a camera").1.clone();
    let mut stage = Stage::new(scene, camera, [1024, 1024], Channels::COLOR, 1);
    bencher.bench_local(|| stage.render());
}
