//! Loads files and says what is in them, how long it took, and what was noted.
//!
//! Usage: `cargo run --release -p polyptych-core --example inspect -- FILE...`

use polyptych_core::load::{LoadOptions, load};
use polyptych_core::scene::Shape;
use std::path::Path;
use std::time::Instant;

fn main() {
    let mut options = LoadOptions { height_map: true, ..LoadOptions::default() };
    for argument in std::env::args().skip(1) {
        if let Some(volume) = argument.strip_prefix("--volume=") {
            options.volume = volume.parse().ok();
            continue;
        }
        let start = Instant::now();
        let loaded = load(Path::new(&argument), &options);
        let milliseconds = start.elapsed().as_secs_f64() * 1e3;
        let scene = match loaded {
            Ok(scene) => scene,
            Err(error) => {
                println!("{milliseconds:8.1} ms  error: {error}");
                continue;
            }
        };
        let (mut triangles, mut area, mut cells) = (0, 0.0, 0);
        for object in &scene.objects {
            match &*object.shape {
                Shape::Mesh(mesh) => {
                    triangles += mesh.triangles.len();
                    area += mesh.area();
                }
                Shape::Voxels(voxels) => cells += voxels.filled(),
                _ => {}
            }
        }
        println!(
            "{milliseconds:8.1} ms  {argument}: {} objects, {triangles} triangles (area {area:.6}), {cells} voxels, {} materials, {} textures, {:.1} MB, size {:.3}",
            scene.objects.len(),
            scene.materials.len(),
            scene.textures.len(),
            scene.bytes() as f64 / 1e6,
            scene.bounds().size()
        );
        for note in &scene.notes {
            println!("             {note}");
        }
    }
}
