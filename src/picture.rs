//! How does a channel look, and how is it written to a file?

use crate::framebuffer::{Channel, Framebuffer};
use crate::pixels::srgb_bytes;
use glam::Vec3;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Why a picture could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum PictureError {
    #[error("{}: no picture format is called `{extension}`: use .png, .jpg, .exr or .pfm", path.display())]
    Format { path: PathBuf, extension: String },
    #[error("{}: the picture was drawn without the channel `{channel}`: ask for it", path.display())]
    NoChannel { path: PathBuf, channel: &'static str },
    #[error("{}: cannot be written: {error}", path.display())]
    Write { path: PathBuf, error: String },
}

/// Turns a channel into 8-bit sRGB pixels for looking: colors are encoded, distances go from white (nearest) to
/// dark (farthest), normals from `[-1, 1]` to `[0, 1]`, ids get colors of their own.
#[must_use]
pub fn displayed(picture: &Framebuffer, channel: Channel) -> Vec<[u8; 3]> {
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    let encoded = |&color: &Vec3| srgb_bytes(color);
    match channel {
        Channel::Color => picture.color().iter().map(encoded).collect(),
        Channel::Albedo => picture.albedo().iter().map(encoded).collect(),
        Channel::Normal => picture
            .normal()
            .iter()
            .map(|n| if *n == Vec3::ZERO { [0; 3] } else { n.to_array().map(|v| byte(v * 0.5 + 0.5)) })
            .collect(),
        Channel::Id => picture.id().iter().map(|&id| id_color(id)).collect(),
        Channel::Shadow => picture.shadow().iter().map(|&v| [byte(v); 3]).collect(),
        Channel::Coverage => picture.coverage().iter().map(|&v| [byte(v); 3]).collect(),
        Channel::Distance => {
            let finite = || picture.distance().iter().copied().filter(|d| d.is_finite());
            let (near, far) = (finite().fold(f32::INFINITY, f32::min), finite().fold(0.0, f32::max));
            let span = (far - near).max(f32::MIN_POSITIVE);
            let shade =
                |d: f32| if d.is_finite() { [byte(0.95 - 0.8 * (d - near) / span); 3] } else { [0; 3] };
            picture.distance().iter().map(|&d| shade(d)).collect()
        }
    }
}

/// Gives each id a color that differs from its neighbors': hues by the golden ratio.
fn id_color(id: u32) -> [u8; 3] {
    if id == 0 {
        return [0; 3];
    }
    let hue = (f64::from(id) * 0.618_033_988_75).fract() as f32 * 6.0;
    let value = 0.95 - 0.25 * ((id / 7) % 3) as f32 / 2.0;
    [5.0, 3.0, 1.0].map(|n: f32| {
        let k = (n + hue) % 6.0;
        let v = value * (1.0 - 0.65 * k.min(4.0 - k).clamp(0.0, 1.0));
        (v * 255.0) as u8
    })
}

/// Writes a channel to a file; the extension chooses the format. `.exr` and `.pfm` keep the numbers, the
/// others what is displayed. The file appears whole or not at all.
///
/// # Errors
/// When the extension is unknown, the channel was not drawn, or the file cannot be written.
pub fn save(picture: &Framebuffer, channel: Channel, path: &Path) -> Result<(), PictureError> {
    if !picture.channels().has(channel) {
        return Err(PictureError::NoChannel { path: path.to_owned(), channel: channel.name() });
    }
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let bytes = match extension.as_str() {
        "png" | "jpg" | "jpeg" => {
            encode(&displayed(picture, channel), picture.width(), picture.height(), &extension)
        }
        "pfm" => Ok(pfm(picture, channel)),
        "exr" => exr(picture, channel),
        _ => return Err(PictureError::Format { path: path.to_owned(), extension }),
    };
    let refuse = |error: String| PictureError::Write { path: path.to_owned(), error };
    write_whole(path, &bytes.map_err(refuse)?).map_err(|e| refuse(e.to_string()))
}

/// Encodes pixels as PNG or JPEG.
///
/// # Errors
/// Those of the encoder, e.g. a picture without pixels.
pub fn encode(pixels: &[[u8; 3]], width: u32, height: u32, extension: &str) -> Result<Vec<u8>, String> {
    let image = image::RgbImage::from_raw(width, height, pixels.as_flattened().to_vec())
        .ok_or("the number of pixels does not fit the size")?;
    let format = if extension == "png" { image::ImageFormat::Png } else { image::ImageFormat::Jpeg };
    let mut bytes = io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

/// Returns a channel as three numbers a pixel.
fn numbers(picture: &Framebuffer, channel: Channel) -> Vec<[f32; 3]> {
    let vectors = |plane: &[Vec3]| plane.iter().map(Vec3::to_array).collect();
    let scalars = |plane: &[f32]| plane.iter().map(|&v| [v; 3]).collect();
    match channel {
        Channel::Color => vectors(picture.color()),
        Channel::Normal => vectors(picture.normal()),
        Channel::Albedo => vectors(picture.albedo()),
        Channel::Distance => scalars(picture.distance()),
        Channel::Shadow => scalars(picture.shadow()),
        Channel::Coverage => scalars(picture.coverage()),
        Channel::Id => picture.id().iter().map(|&id| [id as f32; 3]).collect(),
    }
}

/// Encodes as portable float map: rows from the bottom, little endian.
fn pfm(picture: &Framebuffer, channel: Channel) -> Vec<u8> {
    let mut bytes = format!("PF\n{} {}\n-1.0\n", picture.width(), picture.height()).into_bytes();
    let pixels = numbers(picture, channel);
    for row in pixels.chunks(picture.width().max(1) as usize).rev() {
        bytes.extend(row.iter().flatten().flat_map(|v| v.to_le_bytes()));
    }
    bytes
}

fn exr(picture: &Framebuffer, channel: Channel) -> Result<Vec<u8>, String> {
    use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage};
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let pixels = numbers(picture, channel);
    let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| {
        let [r, g, b] = pixels[at.y() * width + at.x()];
        (r, g, b)
    });
    let attributes = LayerAttributes::named(channel.name());
    let layer = Layer::new((width, height), attributes, Encoding::SMALL_LOSSLESS, channels);
    let mut bytes = io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

/// The file that is being written, to be removed when the program is stopped.
static UNFINISHED: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Writes a file so that it appears whole or not at all: under another name first, then renamed.
///
/// # Errors
/// Those of the file system; nothing is left behind.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if let Some(folder) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
        fs::create_dir_all(folder)?;
    }
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    *UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner) = Some(part.clone());
    let result = fs::write(&part, bytes).and_then(|()| fs::rename(&part, path));
    if result.is_err() {
        discard_unfinished();
    }
    *UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner) = None;
    result
}

/// Removes the file that is being written, if there is one: for programs that are stopped midway.
pub fn discard_unfinished() {
    let unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(part) = unfinished {
        // It may not have been created yet; there is nothing else to do about a failure here.
        let _ = fs::remove_file(part);
    }
}

/// Draws a picture with half blocks for a terminal of so many columns: two pixels a character.
#[must_use]
pub fn terminal(picture: &Framebuffer, channel: Channel, columns: u32) -> String {
    let pixels = displayed(picture, channel);
    let (width, height) = (picture.width(), picture.height());
    if width == 0 || height == 0 {
        return String::new();
    }
    let columns = columns.clamp(1, width);
    let rows = (u64::from(columns) * u64::from(height) / u64::from(width)).max(1) as u32;
    // The mean of the block of pixels under each cell.
    let cell = |x: u32, y: u32| -> [u32; 3] {
        let (x0, x1) = (x * width / columns, ((x + 1) * width / columns).max(x * width / columns + 1));
        let (y0, y1) = (y * height / rows, ((y + 1) * height / rows).max(y * height / rows + 1));
        let mut sum = [0u32; 3];
        for v in y0..y1.min(height) {
            for u in x0..x1.min(width) {
                (0..3).for_each(|c| sum[c] += u32::from(pixels[(v * width + u) as usize][c]));
            }
        }
        sum.map(|s| s / ((x1 - x0) * (y1.min(height) - y0)).max(1))
    };
    let mut text = String::new();
    for y in (0..rows).step_by(2) {
        for x in 0..columns {
            let ([r, g, b], [r2, g2, b2]) = (cell(x, y), if y + 1 < rows { cell(x, y + 1) } else { [0; 3] });
            text.push_str(&format!("\x1b[38;2;{r};{g};{b}m\x1b[48;2;{r2};{g2};{b2}m\u{2580}"));
        }
        text.push_str("\x1b[0m\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framebuffer::{Channels, Pixel};

    fn ramp() -> Framebuffer {
        let mut picture = Framebuffer::new(4, 2, Channels::ALL);
        let mut band = picture.band();
        for y in 0..2 {
            for x in 0..4 {
                let v = (y * 4 + x) as f32 / 7.0;
                band.put(x, y, &Pixel { distance: v, id: x, ..Pixel::background(Vec3::splat(v)) });
            }
        }
        picture
    }

    #[test]
    fn files_read_back() {
        let folder = std::env::temp_dir().join(format!("polyptych-picture-{}", std::process::id()));
        let picture = ramp();
        save(&picture, Channel::Color, &folder.join("a.png")).unwrap();
        let png = image::open(folder.join("a.png")).unwrap().to_rgb8();
        assert_eq!((png.dimensions(), png.get_pixel(3, 1).0), ((4, 2), [255; 3]));
        save(&picture, Channel::Distance, &folder.join("a.exr")).unwrap();
        let exr = exr::prelude::read_first_rgba_layer_from_file(
            folder.join("a.exr"),
            |_, _| Vec::new(),
            |list: &mut Vec<f32>, _, (r, _, _, _): (f32, f32, f32, f32)| list.push(r),
        );
        assert_eq!(exr.unwrap().layer_data.channel_data.pixels, picture.distance());
        save(&picture, Channel::Color, &folder.join("a.pfm")).unwrap();
        let pfm = fs::read(folder.join("a.pfm")).unwrap();
        assert!(pfm.starts_with(b"PF\n4 2\n-1.0\n") && pfm.len() == 12 + 4 * 2 * 12);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 3, "nothing unfinished is left");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn refusals_name_the_file_and_what_to_do() {
        let error = save(&ramp(), Channel::Color, Path::new("a.bmpx")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "a.bmpx: no picture format is called `bmpx`: use .png, .jpg, .exr or .pfm"
        );
    }

    #[test]
    fn the_terminal_shows_two_rows_a_line() {
        let text = terminal(&ramp(), Channel::Color, 4);
        assert_eq!(text.lines().count(), 1);
        assert_eq!(text.matches('\u{2580}').count(), 4);
    }
}
