//! What does it cost to run a plugin in a process of its own? Prints medians, side by side with the same process.
//!
//!     cargo run --release --example plugin_cost -- LIBRARY

use polyptych::convert::Converter;
use polyptych::parallel::Pool;
use polyptych::plugins::{self, Isolation, Options};
use polyptych::prelude::*;
use polyptych::seam::Control;
use std::sync::Arc;
use std::time::Instant;

/// Frames of each kind, drawn in turns.
const FRAMES: usize = 101;

fn milliseconds(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_unstable_by(f64::total_cmp);
    times[times.len() / 2]
}

/// A mesh of so many bytes.
fn large_scene(bytes: usize) -> Scene {
    let vertices = bytes / 36;
    let place = |i: usize| Vec3::new((i % 1000) as f32, 0.0, (i / 1000) as f32) * 1e-3;
    let corners = |i: usize| [i as u32, (i + 1) as u32, (i + 1000).min(vertices - 1) as u32];
    let mesh = Mesh {
        positions: (0..vertices).map(place).collect(),
        triangles: (0..vertices * 2 - 2).map(|i| corners(i / 2)).collect(),
        ..Mesh::default()
    };
    let mut scene = Scene::default();
    let gray = scene.add_material(Material::default());
    scene.objects.push(Object::new("large", Shape::Mesh(mesh), gray));
    scene
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    plugins::serve();
    let library = std::env::args().nth(1).ok_or("which library?")?;
    let isolated = Options::default();
    let here = Options { isolation: Isolation::InProcess, ..Options::default() };
    let pool = Pool::new(0)?;
    let control = Control::new(&pool);
    let converter = Converter::default();
    let mut renderers = Vec::new();
    for options in [&here, &isolated] {
        let mut registry = Registry::default();
        let id = registry.load_with(&library, options)?;
        let begin = Instant::now();
        renderers.push(registry.create(&id)?);
        println!("{:?}: made in {:.2} ms", options.isolation, milliseconds(begin));
    }

    let scene = Arc::new(polyptych::builtin::scene("polyhedra")?);
    let channels = Channels::of(&[Channel::Color, Channel::Distance]);
    for channels in [Channels::COLOR, channels, Channels::ALL] {
        let need = Need { channels, ..Need::new(scene.cameras[0].1.clone(), 1280, 720) };
        let mut targets = [0, 1].map(|_| Framebuffer::new(1280, 720, channels));
        let mut times = [Vec::new(), Vec::new()];
        for renderer in &mut renderers {
            renderer.prepare(&scene, &need, &converter, &control)?;
        }
        for _ in 0..FRAMES + 3 {
            for which in 0..2 {
                let (renderer, target) = (&mut renderers[which], &mut targets[which]);
                target.touch();
                let begin = Instant::now();
                pool.install(|| renderer.render(&need.frame(), target, &control))?;
                times[which].push(milliseconds(begin));
            }
        }
        let mut more: Vec<f64> = times[0].iter().zip(&times[1]).map(|(a, b)| b - a).skip(3).collect();
        let [one, other] = &mut times;
        println!(
            "1280x720, {} channels: {:.2} ms here, {:.2} ms in a child; the child takes {:+.2} ms more",
            channels.iter().count(),
            median(&mut one[3..]),
            median(&mut other[3..]),
            median(&mut more)
        );
        assert!(targets[0].same_bits(&targets[1]));
    }

    let need = Need::new(scene.cameras[0].1.clone(), 16, 16);
    let mut times = [Vec::new(), Vec::new()];
    let mut moved = [Vec::new(), Vec::new()];
    for _ in 0..5 {
        let scene = large_scene(40_000_000);
        let mut edited = scene.clone();
        edited.objects[0].world_from_object.translation.x += 1.0;
        let (scene, edited) = (Arc::new(scene), Arc::new(edited));
        for which in 0..2 {
            for (scene, times) in [(&scene, &mut times), (&edited, &mut moved)] {
                let begin = Instant::now();
                renderers[which].prepare(scene, &need, &converter, &control)?;
                times[which].push(milliseconds(begin));
            }
        }
    }
    for (what, [one, other]) in [("40 MB of triangles", &mut times), ("the same, moved", &mut moved)] {
        println!("{what}: prepared in {:.2} ms here, {:.2} ms in a child", median(one), median(other));
    }
    Ok(())
}
