//! What does a style cost above what it shades? Times frames of the rasterizer, of what it delivers to the shader, and
//! of the shader, in turn, so that all have the same weather; prints medians and shares.
//!
//! `cargo bench -p polyptych-stylized --bench cost -- [WIDTHxHEIGHT] [FRAMES] [moving] MODEL...`
//!
//! With `moving` the camera turns a little with each frame, so that nothing of the picture before can stay.

use glam::DMat3;
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::load::{LoadOptions, load};
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{Light, Object, Primitive, Scene, Shape};
use polyptych_core::seam::{Control, Frame, Need, Origin, Registry, Renderer};
use polyptych_raster::Raster;
use polyptych_stylized::Stylized;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Styles that are timed: a name and what is set.
const STYLES: [(&str, &[(&str, &str)]); 3] = [
    ("tone + steps + highlights", &[("contours", "false"), ("tone.steps", "6")]),
    ("... + contours", &[("tone.steps", "6")]),
    ("... + contours + hatching", &[("tone.steps", "6"), ("hatch", "ink")]),
];

/// A renderer, where it draws, and how long that took.
type Entry = (String, Box<dyn Renderer>, Framebuffer, Vec<Duration>);

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let size = arguments.first().and_then(|a| a.split_once('x')).unwrap_or(("1280", "720"));
    let [width, height] = [size.0.parse()?, size.1.parse()?];
    let frames: usize = arguments.get(1).map_or(Ok(15), |a| a.parse())?;
    let moves = arguments.get(2).is_some_and(|a| a == "moving");
    let names = arguments.get(if moves { 3 } else { 2 }..).unwrap_or_default();
    let ball = ["ball".to_owned()];
    for name in if names.is_empty() { &ball } else { names } {
        let scene = scene(name)?;
        measure(name, &scene, [width, height], frames, moves)?;
    }
    Ok(())
}

/// Reads a model and lights it; `ball` is one of our own.
fn scene(name: &str) -> Result<Arc<Scene>, Box<dyn Error>> {
    let mut scene = if name == "ball" {
        let mut scene = Scene::default();
        scene.objects.push(Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), 0));
        scene
    } else {
        load(Path::new(name), &LoadOptions::default())?
    };
    if scene.lights.is_empty() {
        scene.lights.push(Light::directional(glam::DVec3::new(-0.5, -0.8, -0.4)));
    }
    Ok(Arc::new(scene))
}

fn measure(
    name: &str,
    scene: &Arc<Scene>,
    [width, height]: [u32; 2],
    frames: usize,
    moves: bool,
) -> Result<(), Box<dyn Error>> {
    let view = Projection::Perspective { fov_y: 0.7 };
    let aspect = f64::from(width) / f64::from(height);
    let bounds = scene.bounds();
    let mut camera = Camera::framing(&bounds, 0.6, 0.35, aspect, view.clone());
    if name.contains("sponza") {
        // From inside the hall.
        let (c, s) = (bounds.center(), bounds.size());
        let eye = c + glam::DVec3::new(-0.38 * s.x, -0.3 * s.y, 0.02 * s.z);
        camera = Camera::look_at(eye, c - glam::DVec3::Y * 0.25 * s.y, glam::DVec3::Y, view);
    }
    let need = Need::new(camera, width, height);
    let pool = Pool::pinned(0)?;
    let (control, converter) = (Control::new(&pool), Converter::default());
    let channels = |c: &[Channel]| Channels::of(c);
    let geometry =
        channels(&[Channel::Distance, Channel::Normal, Channel::Id, Channel::Albedo, Channel::Shadow]);
    let mut registry = Registry::default();
    registry.add(Arc::new(polyptych_raster::Factory), Origin::BuiltIn);
    let mut renderers: Vec<Entry> = Vec::new();
    let mut add = |label: &str, renderer: Box<dyn Renderer>, need: &Need| -> Result<(), Box<dyn Error>> {
        let mut renderer = renderer;
        renderer.prepare(scene, need, &converter, &control)?;
        let target = Framebuffer::new(width, height, need.channels);
        renderers.push((label.to_owned(), renderer, target, Vec::new()));
        Ok(())
    };
    add("raster, color", Box::new(Raster::new()), &need)?;
    add("raster, what is shaded", Box::new(Raster::new()), &Need { channels: geometry, ..need.clone() })?;
    for (label, settings) in STYLES {
        let stylized = Stylized::new(registry.clone());
        let mut own = need.clone();
        for (key, value) in settings {
            own.settings.set("stylized", &stylized.info().parameters.clone(), key, value)?;
        }
        add(label, Box::new(stylized), &own)?;
    }
    // Only what the shader does itself, as its own clock says: lines, and all the rest.
    let mut above: Vec<[Vec<Duration>; 2]> = vec![[Vec::new(), Vec::new()]; renderers.len()];
    for frame in 0..frames + 2 {
        let turn = if moves { 0.002 * frame as f64 } else { 0.0 };
        let world_from_camera = need.camera.world_from_camera * DMat3::from_rotation_y(turn);
        let camera = Camera { world_from_camera, ..need.camera.clone() };
        let seen = Frame { camera };
        for (i, (_, renderer, target, times)) in renderers.iter_mut().enumerate() {
            target.touch();
            let begin = Instant::now();
            let report = renderer.render(&seen, target, &control)?;
            let time = begin.elapsed();
            if frame >= 2 {
                times.push(time);
                for (phase, times) in ["contours", "tone"].into_iter().zip(&mut above[i]) {
                    times.push(report.phases.iter().filter(|(p, _)| *p == phase).map(|(_, t)| t).sum());
                }
            }
        }
    }
    let median = |times: &[Duration]| {
        let mut sorted = times.to_vec();
        sorted.sort_unstable();
        sorted[sorted.len() / 2].as_secs_f64() * 1e3
    };
    let full = median(&renderers[0].3);
    println!("{name}, {width}x{height}, {} threads: raster frame {full:.2} ms", pool_count(&pool));
    for (i, (label, _, _, times)) in renderers.iter().enumerate().skip(1) {
        let (whole, [lines, paint]) = (median(times), [0, 1].map(|part| median(&above[i][part])));
        if i == 1 {
            println!("  {label:28} {whole:7.2} ms");
        } else {
            println!(
                "  {label:28} {whole:7.2} ms, above visibility {lines:6.2} + {paint:6.2} ms = {:.0} % of the raster frame",
                (lines + paint) / full * 100.0
            );
        }
    }
    Ok(())
}

fn pool_count(pool: &Pool) -> usize {
    polyptych_core::parallel::Threads::count(pool)
}
