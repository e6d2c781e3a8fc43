//! Pixels for a program that has a screen of its own: set one by one while they are drawn, and copied in the screen's
//! format and stride when the picture is whole.
//!
//! `cargo run --release --example own_pixels` shows bodies of voxels in the terminal and writes `out/own_pixels.ppm`.

use polyptych::convert::Converter;
use polyptych::parallel::Pool;
use polyptych::pixels::{Layout, PixelFormat, SetPixel};
use polyptych::prelude::*;
use polyptych::seam::Control;
use std::sync::atomic::{AtomicU8, Ordering};

const WIDTH: u32 = 90;
const HEIGHT: u32 = 60;

/// Runs the example.
pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = std::sync::Arc::new(polyptych::builtin::scene("polyhedra")?);
    let camera = scene.cameras.first().ok_or("a camera")?.1.clone();
    let need = Need { channels: Channels::COLOR, ..Need::new(camera, WIDTH, HEIGHT) };
    let mut renderer = Registry::builtin().create("voxel")?;

    // A screen of characters: the brighter, the denser. It is set from several threads.
    let screen: Vec<AtomicU8> = (0..WIDTH * HEIGHT).map(|_| AtomicU8::new(b'?')).collect();
    let set_pixel = SetPixel(|x: u32, y: u32, [r, g, b]: [u8; 3]| {
        let bright = (usize::from(r) + usize::from(g) + usize::from(b)) / 3;
        screen[(y * WIDTH + x) as usize].store(b" .:-=+*#%@"[bright * 9 / 255], Ordering::Relaxed);
    });
    let pool = Pool::new(2)?;
    let control = Control::new(&pool).watched_by(&set_pixel);
    renderer.prepare(&scene, &need, &Converter::default(), &control)?;
    let mut picture = Framebuffer::new(WIDTH, HEIGHT, need.channels);
    renderer.render(&need.frame(), &mut picture, &control)?;
    for row in screen.chunks(WIDTH as usize).step_by(2) {
        println!("{}", row.iter().map(|c| char::from(c.load(Ordering::Relaxed))).collect::<String>());
    }

    // A window whose rows begin at multiples of 64 bytes, and a file whose rows follow one another.
    let window = Layout { format: PixelFormat::Bgra8, stride: (WIDTH as usize * 4).next_multiple_of(64) };
    let mut memory = vec![0; window.stride * HEIGHT as usize];
    window.write(&picture, &mut memory)?;
    let file = Layout::packed(PixelFormat::Rgb8, WIDTH);
    let mut bytes = vec![0; file.bytes(WIDTH, HEIGHT)];
    file.write(&picture, &mut bytes)?;
    std::fs::create_dir_all("out")?;
    let header = format!("P6 {WIDTH} {HEIGHT} 255\n").into_bytes();
    std::fs::write("out/own_pixels.ppm", [header, bytes].concat())?;
    Ok(())
}
