//! Decodes pictures within limits, and makes textures of them.

use super::error::{Fault, LoadError};
use super::limits::Limits;
use super::notes::Notes;
use crate::scene::{Texture, TextureWrap};
use image::{DynamicImage, ImageFormat, ImageReader};
use std::io::Cursor;
use std::path::Path;

/// Decodes a picture (PNG, JPEG, TGA, HDR, BMP, GIF, TIFF), known by its first bytes or else by its name.
///
/// # Errors
/// When it is damaged, of another kind, empty, or larger than [`Limits::texture_pixels`]; the size is compared before
/// pixels are decoded.
pub fn decode(bytes: &[u8], name: &str, limits: &Limits) -> Result<DynamicImage, LoadError> {
    decode_picture(bytes, name, limits).map_err(|fault| fault.in_file(Path::new(name)))
}

pub(crate) fn decode_picture(bytes: &[u8], name: &str, limits: &Limits) -> Result<DynamicImage, Fault> {
    let format = format_of(bytes, name)?;
    let [width, height] = size_of_picture(bytes, format)?;
    check_size(width, height, limits.texture_pixels)?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut bounds = image::Limits::default();
    // Eight bytes a pixel hold every format that is read here, but for floating point, which is rarely large.
    bounds.max_alloc = Some(limits.texture_pixels.saturating_mul(10));
    reader.limits(bounds);
    let picture = reader.decode().map_err(|error| damaged(&error))?;
    check_size(picture.width(), picture.height(), limits.texture_pixels)?;
    Ok(picture)
}

fn size_of_picture(bytes: &[u8], format: ImageFormat) -> Result<[u32; 2], Fault> {
    let (width, height) = ImageReader::with_format(Cursor::new(bytes), format)
        .into_dimensions()
        .map_err(|error| damaged(&error))?;
    Ok([width, height])
}

fn check_size(width: u32, height: u32, most: u64) -> Result<(), Fault> {
    if width == 0 || height == 0 {
        return Err(Fault::malformed(format!("the picture has {width}x{height} pixels")));
    }
    if u64::from(width) * u64::from(height) > most {
        let what = format!("the picture has {width}x{height} pixels, at most {most} are decoded");
        return Err(Fault::over(what, "texture_pixels"));
    }
    Ok(())
}

fn damaged(error: &image::ImageError) -> Fault {
    match error {
        image::ImageError::Limits(_) => {
            Fault::over(format!("the picture is too large ({error})"), "texture_pixels")
        }
        image::ImageError::Unsupported(_) => {
            Fault::unsupported(format!("the picture cannot be decoded ({error})"), "save it as PNG or JPEG")
        }
        _ => Fault::malformed(format!("the picture cannot be decoded ({error})"))
            .advise("the picture is damaged, save it again as PNG or JPEG"),
    }
}

fn format_of(bytes: &[u8], name: &str) -> Result<ImageFormat, Fault> {
    if bytes.is_empty() {
        return Err(Fault::malformed("the picture has no bytes"));
    }
    // TGA has no magic number: the name decides where the bytes do not.
    let format = image::guess_format(bytes).or_else(|_| ImageFormat::from_path(Path::new(name)));
    let readable = [
        ImageFormat::Png,
        ImageFormat::Jpeg,
        ImageFormat::Tga,
        ImageFormat::Hdr,
        ImageFormat::Bmp,
        ImageFormat::Gif,
        ImageFormat::Tiff,
    ];
    match format {
        Ok(format) if readable.contains(&format) => Ok(format),
        Ok(format) => {
            let what = format!("{format:?} pictures are not read");
            Err(Fault::unsupported(what, "save it as PNG or JPEG"))
        }
        Err(_) => Err(Fault::unsupported("this is no picture that is read here", "save it as PNG or JPEG")),
    }
}

/// What the pixels of a picture are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Holds {
    /// Colors in sRGB.
    Colors,
    /// Numbers as they are.
    Data,
}

/// Makes the textures of one scene, within one budget of pixels.
pub(crate) struct TextureMaker<'a> {
    limits: &'a Limits,
    pixels: u64,
}

impl<'a> TextureMaker<'a> {
    pub(crate) fn new(limits: &'a Limits) -> Self {
        Self { limits, pixels: 0 }
    }

    /// Decodes a texture; what cannot be decoded becomes the placeholder, with a note.
    pub(crate) fn make(
        &mut self,
        name: &str,
        bytes: Result<impl AsRef<[u8]>, Fault>,
        (wrap, holds): ([TextureWrap; 2], Holds),
        notes: &mut Notes,
    ) -> Texture {
        let made = bytes.and_then(|bytes| self.decode(name, bytes.as_ref(), holds));
        let mut texture = made.unwrap_or_else(|fault| {
            let (instead, with) = match holds {
                Holds::Colors => ("a checker", placeholder(name)),
                Holds::Data => ("normals that turn nothing", Texture::from_linear16(name, 1, 1, vec![FLAT])),
            };
            notes.add(format!("texture `{name}` is replaced by {instead}: {}", fault.what()));
            with
        });
        texture.wrap = wrap;
        texture
    }

    /// Decodes a texture, or says why not.
    pub(crate) fn decode(&mut self, name: &str, bytes: &[u8], holds: Holds) -> Result<Texture, Fault> {
        let [width, height] = size_of_picture(bytes, format_of(bytes, name)?)?;
        let total = self.pixels + u64::from(width) * u64::from(height);
        if total > self.limits.all_texture_pixels {
            let most = self.limits.all_texture_pixels;
            return Err(Fault::over(
                format!("the textures have more than {most} pixels together"),
                "all_texture_pixels",
            ));
        }
        let picture = decode_picture(bytes, name, self.limits)?.into_rgba8();
        self.pixels = total;
        let (width, height, pixels) = (picture.width(), picture.height(), picture.as_raw());
        Ok(match holds {
            Holds::Colors => Texture::from_srgb8(name, width, height, pixels),
            Holds::Data => Texture::from_linear8(name, width, height, pixels),
        })
    }
}

/// The texel of a normal map that leaves normals as they are.
const FLAT: [u16; 4] = [32768, 32768, 65535, 65535];

/// Edge of the placeholder in pixels.
const PLACEHOLDER: u32 = 64;

/// Builds the texture that stands for one that is missing: a checker too loud to be taken for the real thing.
pub(crate) fn placeholder(name: &str) -> Texture {
    checker(name, [[255, 0, 255, 255], [16, 16, 16, 255]], 8, PLACEHOLDER)
}

/// Builds a checker of `cells` by `cells` fields, `edge` pixels wide.
pub(crate) fn checker(name: &str, colors: [[u8; 4]; 2], cells: u32, edge: u32) -> Texture {
    let field = |i: u32| i * cells / edge;
    let rgba: Vec<u8> = (0..edge)
        .flat_map(|y| (0..edge).map(move |x| ((field(x) + field(y)) % 2) as usize))
        .flat_map(|which| colors[which])
        .collect();
    Texture::from_srgb8(name, edge, edge, &rgba)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let picture = DynamicImage::new_luma8(width, height);
        picture.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
        bytes
    }

    #[test]
    fn size_is_checked_before_decoding() {
        let limits = Limits { texture_pixels: 100, ..Limits::default() };
        assert!(decode(&png(10, 10), "a.png", &limits).is_ok());
        let error = decode(&png(10, 11), "a.png", &limits).unwrap_err();
        assert_eq!(
            error.to_string(),
            "a.png: the picture has 10x11 pixels, at most 100 are decoded: use a smaller file, or raise \
             `Limits::texture_pixels`"
        );
    }

    #[test]
    fn what_cannot_be_decoded_becomes_a_loud_checker_with_a_note() {
        let (limits, mut notes) = (Limits::default(), Notes::default());
        let mut maker = TextureMaker::new(&limits);
        let texture =
            maker.make("x.png", Ok(b"nonsense"), ([TextureWrap::Repeat; 2], Holds::Colors), &mut notes);
        assert_eq!(texture.size(), [PLACEHOLDER; 2]);
        assert!((texture.sample([0.03, 0.03], 0.0).x - 1.0).abs() < 1e-3);
        assert!(notes.into_lines()[0].starts_with("texture `x.png` is replaced by a checker"));
    }

    #[test]
    fn textures_share_one_budget() {
        let limits = Limits { all_texture_pixels: 150, ..Limits::default() };
        let mut maker = TextureMaker::new(&limits);
        assert!(maker.decode("a.png", &png(10, 10), Holds::Colors).is_ok());
        assert!(maker.decode("b.png", &png(10, 10), Holds::Colors).is_err());
        assert!(maker.decode("c.png", &png(5, 10), Holds::Colors).is_ok());
    }
}
