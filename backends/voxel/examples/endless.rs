//! How does a world without end look, flown through? Hills that go on forever, made while they come into sight.
//!
//! `cargo run --release -p polyptych-voxel --example endless -- FOLDER [CHUNK]` flies 100 chunks a second for three
//! seconds within 256 MB, rests, and tells how long frames took, and how soon all was there. It starts at the chunk
//! `CHUNK` of the world along x: with 33554432 that is 2^31 cells away.

use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::metrics::display_colors;
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{Background, CHUNK, Chunk, Fog, Light, Material, Object, Scene, Shape};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_core::stream::{ChunkSource, Limits, World};
use polyptych_voxel::Voxel;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Hills that are the same again after 2^20 cells, so that they can be held against one another far apart.
struct Hills;

const PERIOD: i64 = 1 << 20;

fn random(x: i64, z: i64) -> f64 {
    let h = (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (z as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
    let h = (h ^ h >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (h >> 40) as f64 / f64::from(1 << 24)
}

fn noise(x: i64, z: i64, wide: i64) -> f64 {
    let (x, z) = (x.rem_euclid(PERIOD), z.rem_euclid(PERIOD));
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (u, v) = (smooth((x % wide) as f64 / wide as f64), smooth((z % wide) as f64 / wide as f64));
    let at = |i: i64, j: i64| random((x / wide + i) % (PERIOD / wide), (z / wide + j) % (PERIOD / wide));
    let row = |j: i64| at(0, j) + (at(1, j) - at(0, j)) * u;
    row(0) + (row(1) - row(0)) * v
}

fn height(x: i64, z: i64) -> i64 {
    (noise(x, z, 256) * 90.0 + noise(x, z, 64) * 28.0 + noise(x, z, 16) * 7.0) as i64 + 10
}

fn byte(y: i64, height: i64) -> u8 {
    match height - y {
        ..=0 if y < 48 => 4,
        ..=0 => 0,
        _ if height > 92 => 3,
        1..=2 if height > 50 => 1,
        _ => 2,
    }
}

impl ChunkSource for Hills {
    fn load(&self, place: [i32; 3]) -> Chunk {
        let edge = i64::from(CHUNK);
        let first = place.map(|c| i64::from(c) * edge);
        let heights: Vec<i64> =
            (0..edge * edge).map(|i| height(first[0] + i % edge, first[2] + i / edge)).collect();
        let (low, high) = heights.iter().fold((i64::MAX, 0), |(l, h), &y| (l.min(y), h.max(y)));
        if first[1] >= high.max(48) {
            return Chunk::Uniform(0);
        }
        if first[1] + edge + 3 < low && low > 92 {
            return Chunk::Uniform(2);
        }
        let cell = |i: i64| {
            byte(first[1] + i / edge % edge, heights[(i / (edge * edge) * edge + i % edge) as usize])
        };
        Chunk::Cells((0..edge * edge * edge).map(cell).collect())
    }

    fn coarse(&self, place: [i32; 3]) -> u8 {
        let middle = place.map(|c| i64::from(c) * i64::from(CHUNK) + 32);
        byte(middle[1], height(middle[0], middle[2]))
    }
}

fn scene() -> Scene {
    let mut scene = Scene::default();
    let matte = |r: f32, g: f32, b: f32| Material { specular: 0.0, ..Material::new(Vec3::new(r, g, b)) };
    let colors =
        [matte(0.18, 0.36, 0.10), matte(0.35, 0.27, 0.18), matte(0.9, 0.92, 0.95), matte(0.08, 0.2, 0.4)];
    let slots: Vec<usize> = colors.into_iter().map(|m| scene.add_material(m)).collect();
    let empty = polyptych_core::scene::Voxels::new([1; 3]);
    let object = Object::new("world", Shape::Voxels(empty), slots[0]);
    scene.objects.push(Object { materials: slots, ..object });
    scene.lights.push(Light { intensity: 0.9, ..Light::directional(DVec3::new(-0.5, -0.7, -0.35)) });
    let haze = Vec3::new(0.55, 0.68, 0.85);
    scene.environment.background = Background::Solid(haze);
    scene.environment.fog = Some(Fog { color: haze, density: 0.0016 });
    scene
}

struct Flight {
    world: World,
    scene: Scene,
    voxel: Voxel,
    picture: Framebuffer,
    pool: Pool,
    /// Longest times of taking over chunks, making ready, and drawing.
    longest: [Duration; 3],
}

impl Flight {
    /// Draws a frame from a place of the world.
    fn frame(&mut self, cell: [i64; 3], part: DVec3) -> Result<(), Box<dyn Error>> {
        let start = Instant::now();
        self.world.look_from(World::chunk_of(cell));
        self.scene.objects[0].shape = Arc::new(Shape::Voxels(self.world.voxels().clone()));
        let scene = Arc::new(self.scene.clone());
        let taken = start.elapsed();
        let eye = self.world.in_window(cell, part);
        let lens = Projection::Perspective { fov_y: 0.9 };
        let camera = Camera::look_at(eye, eye + DVec3::new(0.85, -0.32, 0.4), DVec3::Y, lens);
        let mut need = Need::new(camera, self.picture.width(), self.picture.height());
        need.channels = self.picture.channels();
        let control = Control::new(&self.pool);
        let start = Instant::now();
        self.voxel.prepare(&scene, &need, &Converter::default(), &control)?;
        let ready = start.elapsed();
        let start = Instant::now();
        self.voxel.render(&need.frame(), &mut self.picture, &control)?;
        for (longest, time) in self.longest.iter_mut().zip([taken, ready, start.elapsed()]) {
            *longest = time.max(*longest);
        }
        Ok(())
    }

    fn save(&self, path: &Path) -> Result<(), Box<dyn Error>> {
        let bytes = display_colors(&self.picture).into_iter().flatten();
        let bytes = bytes.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
        let (width, height) = (self.picture.width(), self.picture.height());
        let image = image::RgbImage::from_raw(width, height, bytes).ok_or("a picture of another size")?;
        Ok(image.save(path)?)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let folder = words.first().map_or(".", String::as_str);
    let folder = Path::new(folder);
    std::fs::create_dir_all(folder)?;
    let first: i64 = words.get(1).map_or(Ok(0), |word| word.parse())?;
    let limits = Limits { chunks: [16, 4, 16], ..Limits::default() };
    let mut flight = Flight {
        world: World::new(Arc::new(Hills), limits),
        scene: scene(),
        voxel: Voxel::new(),
        picture: Framebuffer::new(640, 360, Channels::NONE.with(Channel::Color)),
        pool: Pool::new(1)?,
        longest: [Duration::ZERO; 3],
    };
    let (speed, seconds) = (100.0, 3.0);
    let edge = f64::from(CHUNK);
    let (mut frames, mut most) = (0, 0);
    let start = Instant::now();
    let mut cell = [0; 3];
    while start.elapsed().as_secs_f64() < seconds {
        let flown = start.elapsed().as_secs_f64() * speed * edge;
        cell = [first * i64::from(CHUNK) + flown as i64, 170, 100];
        flight.frame(cell, DVec3::splat(0.5))?;
        frames += 1;
        most = flight.world.bytes().max(most);
    }
    let [taken, ready, drawn] = flight.longest;
    println!(
        "{frames} frames in flight: longest {taken:.1?} to take chunks over, {ready:.1?} to make them ready, {drawn:.1?} to draw"
    );
    println!("{} chunks missing, {} MB of loaded chunks at most", flight.world.missing(), most >> 20);
    flight.save(&folder.join("flight.png"))?;
    let rest = Instant::now();
    while flight.world.missing() > 0 && rest.elapsed() < Duration::from_secs(20) {
        flight.frame(cell, DVec3::splat(0.5))?;
    }
    println!("at rest all is there after {:.2?}", rest.elapsed());
    flight.save(&folder.join("rest.png"))?;
    // The hills repeat: from a place of the same kind the picture must be the same, however far away.
    let mut settle = |chunk: i64| -> Result<Framebuffer, Box<dyn Error>> {
        let cell = [chunk * i64::from(CHUNK), 170, 100];
        flight.frame(cell, DVec3::splat(0.5))?;
        while flight.world.missing() > 0 {
            flight.frame(cell, DVec3::splat(0.5))?;
        }
        Ok(flight.picture.clone())
    };
    let (here, far) = (settle(0)?, settle(1 << 25)?);
    println!("2^31 cells away the picture is {}", if here.same_bits(&far) { "the same" } else { "another" });
    Ok(())
}
