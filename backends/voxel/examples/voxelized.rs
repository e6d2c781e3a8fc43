//! What does a model look like as voxels, and how long does it take? Draws a model at a resolution of your choice.
//!
//! `cargo run --release -p polyptych-voxel --example voxelized -- MODEL CELLS OUT.png [EYE TARGET UP]
//! [NAME=VALUE...]`: a bunny at 48, a statue at 256, a building at 512. `EYE`, `TARGET` and `UP` are `x,y,z` in the model's
//! own units and axes; the rest are parameters of the back end, such as `detail.filling=solid` or `detail.blocks=true`.

use glam::DVec3;
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::load::{LoadOptions, load};
use polyptych_core::metrics::display_colors;
use polyptych_core::parallel::Pool;
use polyptych_core::scene::Light;
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_voxel::Voxel;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Frames of which the middle one in order of time is told.
const FRAMES: usize = 9;

fn place(text: &str) -> Result<DVec3, Box<dyn Error>> {
    let numbers: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let [x, y, z] = numbers[..] else { return Err(format!("`{text}` is not x,y,z").into()) };
    Ok(DVec3::new(x, y, z))
}

fn main() -> Result<(), Box<dyn Error>> {
    let (settings, words): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|word| word.contains('='));
    let (model, cells, out, view) = match &words[..] {
        [model, cells, out] => (model, cells, out, None),
        [model, cells, out, eye, target, up] => {
            (model, cells, out, Some((place(eye)?, place(target)?, place(up)?)))
        }
        _ => return Err("MODEL CELLS OUT.png [EYE TARGET UP] [NAME=VALUE...]".into()),
    };
    let mut scene = load(Path::new(model), &LoadOptions::default())?;
    let bounds = scene.bounds();
    println!("{model} fills {:.2} to {:.2}", bounds.min, bounds.max);
    if let Some((eye, target, up)) = view {
        // From above, a little from the side of the eye.
        let forward = (target - eye).normalize_or(DVec3::NEG_Z);
        let right = forward.cross(up).normalize_or(DVec3::X);
        scene.lights =
            vec![Light::directional(forward * 0.35 + right * 0.25 - up.normalize_or(DVec3::Y) * 0.8)];
    }
    let scene = Arc::new(scene);
    let lens = Projection::Perspective { fov_y: 0.9 };
    let camera = view.map_or_else(
        || scene.cameras[0].1.clone(),
        |(eye, target, up)| Camera::look_at(eye, target, up, lens),
    );
    let (width, height) = (1280, 720);
    // As fine as was asked for, however little of it shows.
    let mut need = Need { tolerance_px: 1e-6, ..Need::new(camera, width, height) };
    need.channels = Channels::NONE.with(Channel::Color);
    let mut voxel = Voxel::new();
    need.settings.set("voxel", &voxel.info().parameters.clone(), "detail.resolution", cells)?;
    for setting in &settings {
        let (name, value) = setting.split_once('=').unwrap_or_default();
        need.settings.set("voxel", &voxel.info().parameters.clone(), name, value)?;
    }

    let pool = Pool::new(0)?;
    let control = Control::new(&pool);
    let start = Instant::now();
    let prepared = voxel.prepare(&scene, &need, &Converter::default(), &control)?;
    println!("{cells} cells: made ready in {:.2?}, {} MB", start.elapsed(), prepared.bytes >> 20);
    for decision in prepared.objects.iter().take(8) {
        println!("{decision:?}");
    }
    let mut picture = Framebuffer::new(width, height, need.channels);
    let mut times: Vec<Duration> = Vec::new();
    for _ in 0..FRAMES {
        picture.touch();
        let start = Instant::now();
        let report = voxel.render(&need.frame(), &mut picture, &control)?;
        times.push(start.elapsed());
        if times.len() == FRAMES {
            times.sort();
            let count =
                |name| report.counters.iter().flatten().find(|c| c.name == name).map_or(0, |c| c.count);
            let rays = count("rays") + count("shadow rays");
            let time = times[FRAMES / 2];
            let speed = rays as f64 / time.as_secs_f64() * 1e-6;
            let steps = count("steps") as f64 / rays as f64;
            println!(
                "a frame in {time:.1?} (least {:.1?}): {speed:.1} M rays/s, {steps:.1} steps a ray",
                times[0]
            );
        }
    }
    let bytes = display_colors(&picture).into_iter().flatten();
    let bytes = bytes.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
    image::RgbImage::from_raw(width, height, bytes).ok_or("a picture of another size")?.save(out)?;
    Ok(())
}
