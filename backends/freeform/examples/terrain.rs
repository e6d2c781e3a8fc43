//! How does a terrain look that is never turned into triangles: from above, grazing, and in a valley?
//!
//! `cargo run --release -p polyptych-freeform --example terrain -- FOLDER [FILE]` draws hills that it makes, or those of a
//! gray picture.

mod common;

use common::{Easel, arguments};
use glam::{DVec2, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::load::{LoadOptions, load};
use polyptych_core::scene::{Background, Fog, HeightField, Light, Material, Object, Scene, Shape};
use std::error::Error;

/// Ridges of noise in eight octaves, two meters wide.
fn ridges(edge: u32) -> Result<HeightField, String> {
    let random = |x: i64, z: i64| {
        let h =
            (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (z as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
        let h = (h ^ h >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        (h >> 40) as f64 / f64::from(1 << 24)
    };
    let noise = |x: f64, z: f64| {
        let (i, j) = (x.floor() as i64, z.floor() as i64);
        let smooth = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
        let (u, v) = (smooth(x - x.floor()), smooth(z - z.floor()));
        let row = |j: i64| random(i, j) + (random(i + 1, j) - random(i, j)) * u;
        row(j) + (row(j + 1) - row(j)) * v
    };
    let height = |k: u32| {
        let (x, z) = (f64::from(k % edge) / f64::from(edge), f64::from(k / edge) / f64::from(edge));
        let (mut sum, mut share, mut weight) = (0.0, 0.5, 1.0);
        for octave in 0..8 {
            let scale = 3.0 * f64::from(1 << octave);
            let ridge = 1.0 - (noise(x * scale + 7.3, z * scale + 1.9) * 2.0 - 1.0).abs();
            sum += ridge * ridge * share * weight;
            weight = (ridge * ridge * 1.6).min(1.0);
            share *= 0.5;
        }
        (sum * 0.42) as f32
    };
    HeightField::new(edge, edge, DVec2::splat(2.0), (0..edge * edge).map(height).collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let (folder, file) = arguments()?;
    let heights = match file {
        None => ridges(1025)?,
        Some(file) => {
            let shapes = load(&file, &LoadOptions { height_map: true, ..LoadOptions::default() })?.objects;
            let found = shapes.iter().find_map(|o| match &*o.shape {
                Shape::HeightField(heights) => Some(heights.clone()),
                _ => None,
            });
            found.ok_or("no height field in that file")?
        }
    };
    let size = heights.extent().max_element();
    let over = |x: f64, z: f64, up: f64| DVec3::new(x, heights.height_and_normal(x, z).0 + up * size, z);
    // The lowest place that is not close to a border.
    let places = (0..64 * 64).map(|k| (DVec2::new(f64::from(k % 64), f64::from(k / 64)) / 64.0 - 0.5) * 0.6);
    let places = places.map(|p| p * heights.extent());
    let low = places.min_by(|a, b| {
        let height = |p: &DVec2| heights.height_and_normal(p.x, p.y).0;
        height(a).total_cmp(&height(b))
    });
    let low = low.unwrap_or_default();
    let look = |eye: DVec3, target: DVec3, fov_y: f64| {
        Camera::look_at(eye, target, DVec3::Y, Projection::Perspective { fov_y })
    };
    let middle = over(0.0, 0.0, 0.0);
    let top = heights.bounds().max.y;
    let corner = DVec3::new(-0.52 * heights.extent().x, top + 0.01 * size, 0.52 * heights.extent().y);
    let views = [
        ("above", look(middle + DVec3::new(0.02, 1.0, 0.6) * size, middle, 0.85)),
        (
            "grazing",
            look(corner, DVec3::new(0.3, 0.0, -0.3) * size + DVec3::Y * (0.7 * top + 0.3 * middle.y), 0.7),
        ),
        ("valley", look(over(low.x, low.y, 0.012), over(low.x * 0.2, low.y * 0.2 - 0.2 * size, 0.02), 1.1)),
    ];
    let mut scene = Scene::default();
    scene.environment.background = Background::Gradient {
        below: Vec3::new(0.75, 0.8, 0.85),
        horizon: Vec3::new(0.75, 0.8, 0.85),
        above: Vec3::new(0.25, 0.45, 0.8),
    };
    scene.environment.fog = Some(Fog { color: Vec3::new(0.7, 0.78, 0.86), density: (0.12 / size) as f32 });
    let rock = scene.add_material(Material::new(Vec3::new(0.45, 0.42, 0.36)));
    scene.objects.push(Object::new("terrain", Shape::HeightField(heights), rock));
    scene.lights.push(Light::directional(DVec3::new(-0.7, -0.5, -0.3)));
    let mut easel = Easel::new(scene, folder, &[("edge.rays", "2")])?;
    for (name, camera) in views {
        easel.draw(name, camera, [1280, 720])?;
    }
    Ok(())
}
