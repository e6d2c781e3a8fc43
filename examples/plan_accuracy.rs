//! Does a plan foretell what is then built and how long a frame takes? For each scene and back end: bytes and milliseconds
//! as planned, as measured, and their ratio.
//!
//! `cargo run --release --example plan_accuracy [SCENE...]`: files, or names of built-in scenes; all of these without any.

use polyptych::framebuffer::Framebuffer;
use polyptych::load::{LoadOptions, load};
use polyptych::pace::{Pace, frame_ms};
use polyptych::prelude::*;
use std::path::Path;
use std::sync::Arc;

const BACKENDS: [&str; 5] = ["reference", "raster", "voxel", "freeform", "stylized"];
const SIZE: [u32; 2] = [480, 270];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut names: Vec<String> = std::env::args().skip(1).collect();
    if names.is_empty() {
        names = polyptych::builtin::NAMES.iter().map(|n| (*n).to_owned()).collect();
    }
    // Measured anew: what was kept may be from an hour when other programs ran.
    let pace = Pace::measured(&Registry::builtin())?;
    for backend in BACKENDS {
        println!("{backend}: frames take {:.2} of what plans reckon with here", pace.factor(backend));
    }
    let (mut good_bytes, mut good_times, mut all) = (0, 0, 0);
    println!("scene backend bytes planned/held ratio, ms planned/measured ratio");
    for name in names {
        let scene = match polyptych::builtin::scene(&name) {
            Ok(scene) => scene,
            Err(_) => load(
                Path::new(&name),
                &LoadOptions { height_map: name.ends_with(".png"), ..LoadOptions::default() },
            )?,
        };
        let scene = Arc::new(scene);
        let camera = scene.cameras.first().map_or_else(|| framed(&scene), |(_, camera)| camera.clone());
        let need = Need::new(camera, SIZE[0], SIZE[1]);
        let short = name.rsplit('/').next().unwrap_or(&name);
        for backend in BACKENDS {
            let mut studio = Studio::new(Registry::builtin(), 1)?;
            let plan = studio.renderer(backend)?.plan(&scene, &need);
            let (prepared, _) = studio.prepare(backend, &scene, &need)?;
            let mut picture = Framebuffer::new(need.width, need.height, need.channels);
            let mut times = vec![frame_ms(&mut studio, backend, &need, &mut picture)?];
            while times.len() < 5 && times.iter().sum::<f64>() < 4000.0 {
                times.push(frame_ms(&mut studio, backend, &need, &mut picture)?);
            }
            times.sort_by(f64::total_cmp);
            let (ms, held) = (times[(times.len() - 1) / 2], prepared.bytes.max(1));
            let planned_ms = plan.estimated_ms * pace.factor(backend);
            let (bytes, time) = (plan.bytes.max(1) as f64 / held as f64, planned_ms / ms);
            all += 1;
            good_bytes += u32::from((0.9..=1.1).contains(&bytes));
            good_times += u32::from((0.5..=2.0).contains(&time));
            println!(
                "{short:<22} {backend:<10} {:>11} {held:>11} {bytes:>6.2}{} {planned_ms:>9.2} {ms:>9.2} {time:>6.2}{}",
                plan.bytes,
                if (0.9..=1.1).contains(&bytes) { ' ' } else { '!' },
                if (0.5..=2.0).contains(&time) { ' ' } else { '!' },
            );
        }
    }
    println!("{good_bytes} of {all} within 10 % in bytes, {good_times} within a factor of 2 in time");
    Ok(())
}

fn framed(scene: &Scene) -> Camera {
    let view = Projection::Perspective { fov_y: 0.7 };
    Camera::framing(&scene.bounds(), 0.5, 0.35, f64::from(SIZE[0]) / f64::from(SIZE[1]), view)
}
