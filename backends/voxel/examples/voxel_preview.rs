//! What does the voxel back end draw? Writes color, normals and distances of a generated landscape as PNG.
//!
//! `cargo run -p polyptych-voxel --example voxel_preview -- FOLDER`

use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::metrics::display_colors;
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{Light, Material, Object, Primitive, Scene, Shape, Voxels};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_voxel::Voxel;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".to_owned());
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;

    let (width, height) = (960, 540);
    let eye = DVec3::new(168.0, 74.0, 172.0);
    let camera =
        Camera::look_at(eye, DVec3::new(74.0, 14.0, 70.0), DVec3::Y, Projection::Perspective { fov_y: 0.7 });
    let need = Need { channels: Channels::ALL, ..Need::new(camera, width, height) };
    let pool = Pool::new(0)?;
    let control = Control::new(&pool);
    let mut voxel = Voxel::new();
    voxel.prepare(&Arc::new(landscape()), &need, &Converter::default(), &control)?;
    let mut picture = Framebuffer::new(width, height, Channels::ALL);
    let report = voxel.render(&need.frame(), &mut picture, &control)?;
    for decision in report.objects.iter() {
        println!("{decision:?}");
    }
    for counter in report.counters.iter().flatten() {
        println!("{} {}", counter.count, counter.name);
    }
    for (phase, time) in report.phases.iter() {
        println!("{phase}: {time:.1?}");
    }

    let save = |name: &str, pixels: Vec<[f32; 3]>| {
        let bytes = pixels.into_iter().flatten().map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
        image::RgbImage::from_raw(width, height, bytes)
            .ok_or("a picture of another size")
            .map(|image| image.save(folder.join(name)))
    };
    save("color.png", display_colors(&picture))??;
    save("normal.png", picture.normal().iter().map(|n| (*n * 0.5 + 0.5).to_array()).collect())??;
    let near = picture.distance().iter().copied().fold(f32::INFINITY, f32::min);
    let far = picture.distance().iter().copied().filter(|d| d.is_finite()).fold(near, f32::max);
    let gray = |&d: &f32| [if d.is_finite() { 1.0 - (d - near) / (far - near) } else { 0.0 }; 3];
    save("distance.png", picture.distance().iter().map(gray).collect())??;
    save("shadow.png", picture.shadow().iter().map(|&s| [s; 3]).collect())??;
    Ok(())
}

/// Hills with a lake, a tower, a lamp on a mast, a pane of glass, and a mirror ball.
fn landscape() -> Scene {
    let mut scene = Scene::default();
    let matte = |r: f32, g: f32, b: f32| Material { specular: 0.0, ..Material::new(Vec3::new(r, g, b)) };
    let materials = [
        matte(0.16, 0.34, 0.09),
        matte(0.30, 0.24, 0.17),
        matte(0.62, 0.60, 0.56),
        Material { emission: Vec3::new(1300.0, 950.0, 450.0), ..matte(1.0, 0.8, 0.5) },
        Material { opacity: 0.35, ..Material::new(Vec3::new(0.2, 0.55, 0.75)) },
        Material { reflectivity: 0.45, ..Material::new(Vec3::new(0.03, 0.09, 0.14)) },
    ];
    let slots: Vec<usize> = materials.into_iter().map(|m| scene.add_material(m)).collect();
    let height = |x: u32, z: u32| {
        let (u, v) = (f64::from(x) * 0.045, f64::from(z) * 0.045);
        let waves =
            (u * 1.3 + v * 0.4).sin() * 5.0 + (v * 1.7 - u * 0.6).cos() * 4.0 + (u * 3.1 + v * 2.3).sin();
        (14.0 + waves) as u32
    };
    let voxels = Voxels::from_fn([150, 64, 150], |x, y, z| {
        let ground = height(x, z);
        let from_tower = (f64::from(x) - 60.0).hypot(f64::from(z) - 60.0);
        match () {
            () if (6.0..9.0).contains(&from_tower) && y < 46 && (y < 42 || (x + z) % 4 < 2) => 3,
            () if (x, z) == (100, 84) && y < 32 => 2,
            () if (x, z) == (100, 84) && y == 32 => 4,
            () if (86..118).contains(&x) && z == 116 && y < 40 && y >= ground => 5,
            () if y < ground => {
                if ground - y < 2 {
                    1
                } else {
                    2
                }
            }
            () if y < 11 => 6,
            () => 0,
        }
    });
    let mut land = Object::new("land", Shape::Voxels(voxels), slots[0]);
    land.materials = slots;
    scene.objects.push(land);
    let mirror = scene.add_material(Material { reflectivity: 0.6, ..Material::new(Vec3::splat(0.5)) });
    let ball = Shape::Primitive(Primitive::Sphere { radius: 11.0 });
    scene.objects.push(Object::new("ball", ball, mirror).at(DVec3::new(118.0, 34.0, 62.0)));
    scene.lights.push(Light { intensity: 0.9, ..Light::directional(DVec3::new(-0.45, -0.7, -0.25)) });
    scene
}
