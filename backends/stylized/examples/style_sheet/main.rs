//! What does each style look like? Draws the sheet of all of them over five bodies: `docs/styles.png`.
//!
//! `cargo run --release -p polyptych-stylized --example style_sheet -- [FILE.png [MODELS]]`; with a folder of models its
//! bunny, cow and fighter take the places of the hare, the bird and the aircraft that are made here.

mod bodies;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::parallel::Pool;
use polyptych_core::scene::Scene;
use polyptych_core::seam::{Control, Need, Origin, Registry, Renderer};
use polyptych_core::shade::srgb_from_linear;
use polyptych_stylized::{Preset, STYLES, Stylized};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// Size of a picture of the sheet.
const CELL: [u32; 2] = [232, 168];
/// Pixels between pictures.
const GAP: u32 = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().unwrap_or_else(|| "out/styles.png".to_owned());
    let models = arguments.next();
    // For a closer look at one row: how many times as large, and which style.
    let scale: u32 = arguments.next().map_or(Ok(1), |a| a.parse())?;
    let only = arguments.next();
    let stands = bodies::all(models.as_deref().map(Path::new))?;
    let styles: Vec<&str> =
        STYLES.iter().copied().filter(|s| only.as_deref().is_none_or(|only| only == *s)).collect();
    let mut registry = Registry::default();
    registry.add(Arc::new(polyptych_raster::Factory), Origin::BuiltIn);
    let pool = Pool::new(0)?;
    let [wide, high] = CELL.map(|c| c * scale);
    let (columns, rows) = (stands.len() as u32, styles.len() as u32);
    let mut sheet = image::RgbImage::from_pixel(
        columns * (wide + GAP) + GAP,
        rows * (high + GAP) + GAP,
        image::Rgb([255; 3]),
    );
    for (row, style) in (0..).zip(&styles) {
        println!("{style}: {}", Preset::builtin(style)?.evokes);
        for (column, (scene, direction)) in (0..).zip(&stands) {
            let mut renderer = Stylized::new(registry.clone());
            let picture = draw(&mut renderer, scene, style, direction, [wide, high], &pool)?;
            let (left, top) = (GAP + column * (wide + GAP), GAP + row * (high + GAP));
            for (i, color) in (0..).zip(picture.color()) {
                let bytes = color.to_array().map(encode);
                sheet.put_pixel(left + i % wide, top + i / wide, image::Rgb(bytes));
            }
        }
    }
    if let Some(folder) = Path::new(&file).parent() {
        std::fs::create_dir_all(folder)?;
    }
    let encoder = PngEncoder::new_with_quality(
        std::io::BufWriter::new(std::fs::File::create(&file)?),
        CompressionType::Best,
        FilterType::Adaptive,
    );
    sheet.write_with_encoder(encoder)?;
    println!("{file}: {}x{}, {} bytes", sheet.width(), sheet.height(), std::fs::metadata(&file)?.len());
    Ok(())
}

/// Encodes a channel in a quarter of the steps: paper's grain would fill the file.
fn encode(linear: f32) -> u8 {
    let full = (srgb_from_linear(linear.clamp(0.0, 1.0)) * 63.0).round();
    (full * 255.0 / 63.0).round() as u8
}

fn draw(
    renderer: &mut Stylized,
    scene: &Arc<Scene>,
    style: &str,
    direction: &[f64; 2],
    [width, height]: [u32; 2],
    pool: &Pool,
) -> Result<Framebuffer, Box<dyn Error>> {
    let view = Projection::Perspective { fov_y: 0.5 };
    let [azimuth, elevation] = direction.map(f64::to_radians);
    let aspect = f64::from(width) / f64::from(height);
    let mut camera = Camera::framing(&scene.bounds(), azimuth, elevation, aspect, view);
    fit(&mut camera, scene, [width, height]);
    let mut need = Need::new(camera, width, height);
    let declared = renderer.info().parameters.clone();
    need.settings.set("stylized", &declared, "preset", style)?;
    let control = Control::new(pool);
    renderer.prepare(scene, &need, &Converter::default(), &control)?;
    let mut picture = Framebuffer::new(width, height, need.channels);
    renderer.render(&need.frame(), &mut picture, &control)?;
    Ok(picture)
}

/// Moves the camera until the corners of the scene's box just fit.
fn fit(camera: &mut Camera, scene: &Scene, [width, height]: [u32; 2]) {
    let (bounds, [w, h]) = (scene.bounds(), [width, height].map(f64::from));
    let (center, out) = (bounds.center(), camera.eye - bounds.center());
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        glam::DVec3::new(pick(0), pick(1), pick(2))
    };
    let half = (0.25f64).tan();
    let fits = |eye: glam::DVec3| {
        (0..8).all(|i| {
            let p = camera.world_from_camera.transpose() * (corner(i) - eye);
            let room = -p.z * half * 1.08;
            p.z < 0.0 && p.y.abs() < room && p.x.abs() < room * w / h
        })
    };
    let mut share = (0.2, 1.5);
    for _ in 0..20 {
        let middle = (share.0 + share.1) * 0.5;
        if fits(center + out * middle) { share.1 = middle } else { share.0 = middle }
    }
    camera.eye = center + out * share.1;
}
