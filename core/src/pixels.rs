//! In which bytes does a program of your own want its pixels?
//!
//! [`Layout`] writes the colors of a picture into memory of any format and stride. [`SetPixel`] hands each pixel to a
//! function as soon as its band is drawn, while others still are. Neither asks for memory.
//!
//! # Example
//! ```
//! use polyptych_core::framebuffer::{Channels, Framebuffer};
//! use polyptych_core::pixels::{Layout, PixelFormat};
//! let picture = Framebuffer::new(3, 2, Channels::COLOR);
//! // Rows of a screen begin at multiples of 16 bytes.
//! let screen = Layout { format: PixelFormat::Bgra8, stride: 16 };
//! let mut memory = [7u8; 32];
//! screen.write(&picture, &mut memory).unwrap();
//! assert_eq!(memory[..16], [0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0, 255, 7, 7, 7, 7]);
//! ```

use crate::framebuffer::{Band, Channel, Framebuffer};
use crate::seam::Watcher;
use crate::shade::srgb_from_linear;
use glam::Vec3;
use std::sync::LazyLock;

/// How the color of a pixel is written. All but the last are sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PixelFormat {
    /// Red, green, blue, a byte each.
    Rgb8,
    /// Blue, green, red.
    Bgr8,
    /// Red, green, blue, 255.
    Rgba8,
    /// Blue, green, red, 255: `0xffRRGGBB` as a little-endian number, what most windows take.
    Bgra8,
    /// Two bytes, little-endian: five bits of red, six of green, five of blue.
    Rgb565,
    /// One byte: the luminance.
    Gray8,
    /// Linear red, green, blue as they are, four bytes each, of this processor's order.
    RgbF32,
}

impl PixelFormat {
    /// Returns the bytes of a pixel.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Gray8 => 1,
            Self::Rgb565 => 2,
            Self::Rgb8 | Self::Bgr8 => 3,
            Self::Rgba8 | Self::Bgra8 => 4,
            Self::RgbF32 => 12,
        }
    }

    /// Writes one pixel; `to` has [`PixelFormat::bytes`] bytes.
    #[inline]
    fn put(self, color: Vec3, to: &mut [u8]) {
        let [r, g, b] = srgb_bytes(color);
        match self {
            Self::Rgb8 => to.copy_from_slice(&[r, g, b]),
            Self::Bgr8 => to.copy_from_slice(&[b, g, r]),
            Self::Rgba8 => to.copy_from_slice(&[r, g, b, 255]),
            Self::Bgra8 => to.copy_from_slice(&[b, g, r, 255]),
            Self::Rgb565 => {
                let part = |c: u8, most: u32| (u32::from(c) * most + 127) / 255;
                let packed = part(r, 31) << 11 | part(g, 63) << 5 | part(b, 31);
                to.copy_from_slice(&(packed as u16).to_le_bytes());
            }
            // Rec. 709.
            Self::Gray8 => to[0] = srgb_byte(color.dot(Vec3::new(0.2126, 0.7152, 0.0722))),
            Self::RgbF32 => {
                for (bytes, c) in to.chunks_exact_mut(4).zip(color.to_array()) {
                    bytes.copy_from_slice(&c.to_ne_bytes());
                }
            }
        }
    }
}

/// How a picture lies in memory: rows from the top, `stride` bytes from one to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// How a pixel is written.
    pub format: PixelFormat,
    /// Bytes from the beginning of a row to that of the next; those behind the pixels are left as they are.
    pub stride: usize,
}

/// Why pixels could not be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PixelsError {
    /// Rows would lie over one another.
    #[error("a row of {width} pixels takes {needed} bytes, the stride is {stride}")]
    Stride {
        /// Pixels of a row.
        width: u32,
        /// Bytes that they take.
        needed: usize,
        /// Bytes from row to row.
        stride: usize,
    },
    /// The picture does not fit.
    #[error("the picture takes {needed} bytes, {there} are there")]
    Short {
        /// Bytes of the picture.
        needed: usize,
        /// Bytes of the memory.
        there: usize,
    },
    /// There are no colors.
    #[error("the picture was drawn without the channel `color`: ask for it")]
    NoColor,
}

impl Layout {
    /// Returns the layout whose rows follow one another without a gap.
    #[must_use]
    pub const fn packed(format: PixelFormat, width: u32) -> Self {
        Self { format, stride: width as usize * format.bytes() }
    }

    /// Returns the bytes from the first pixel of a picture to its last.
    #[must_use]
    pub const fn bytes(&self, width: u32, height: u32) -> usize {
        if width == 0 || height == 0 {
            return 0;
        }
        (height as usize - 1) * self.stride + width as usize * self.format.bytes()
    }

    /// Writes the colors of a picture.
    ///
    /// # Errors
    /// When the picture has no colors, the stride is shorter than a row, or the memory than the picture.
    pub fn write(&self, picture: &Framebuffer, to: &mut [u8]) -> Result<(), PixelsError> {
        let (width, height) = (picture.width(), picture.height());
        if !picture.channels().has(Channel::Color) {
            return Err(PixelsError::NoColor);
        }
        let row = width as usize * self.format.bytes();
        if row > self.stride {
            return Err(PixelsError::Stride { width, needed: row, stride: self.stride });
        }
        let needed = self.bytes(width, height);
        if needed > to.len() {
            return Err(PixelsError::Short { needed, there: to.len() });
        }
        if needed == 0 {
            return Ok(());
        }
        for (colors, bytes) in picture.color().chunks(width as usize).zip(to.chunks_mut(self.stride)) {
            for (&color, pixel) in colors.iter().zip(bytes.chunks_exact_mut(self.format.bytes())) {
                self.format.put(color, pixel);
            }
        }
        Ok(())
    }
}

/// Hands pixels to a function while a frame is drawn: column, row, and sRGB red, green and blue. Give it to
/// [`Control::watched_by`](crate::seam::Control::watched_by). It is called on the threads that draw, for several pixels
/// at once if there are several, for each pixel once.
pub struct SetPixel<F>(pub F);

impl<F: Fn(u32, u32, [u8; 3]) + Sync> Watcher for SetPixel<F> {
    fn finished(&self, band: &Band<'_>) {
        for (i, &color) in band.color.iter().enumerate() {
            (self.0)(i as u32 % band.width, band.first_row + i as u32 / band.width, srgb_bytes(color));
        }
    }
}

/// Encodes a linear color as bytes of sRGB, rounded to the nearest.
#[must_use]
pub fn srgb_bytes(color: Vec3) -> [u8; 3] {
    color.to_array().map(srgb_byte)
}

/// Encodes a linear number as a byte of sRGB, rounded to the nearest; what is not a number becomes 0.
#[inline]
fn srgb_byte(linear: f32) -> u8 {
    let steps = &*STEPS;
    let linear = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
    let byte = steps.first[(linear * Steps::PARTS) as usize];
    byte + u8::from(linear >= steps.from[usize::from(byte) + 1])
}

/// Where the bytes of sRGB begin on the linear scale. A power for each channel of each pixel would take longer than many
/// a picture.
struct Steps {
    /// The byte at the beginning of each part of the scale; there is no more than one step in a part.
    first: [u8; Self::PARTS as usize + 1],
    /// The least number of each byte, and one that there is none of.
    from: [f32; 257],
}

impl Steps {
    /// At black bytes are closest: 12.92 x 255 = 3295 of them would fill the scale.
    const PARTS: f32 = 4096.0;
}

static STEPS: LazyLock<Steps> = LazyLock::new(|| {
    let rounded = |linear: f32| (srgb_from_linear(linear) * 255.0).round() as u8;
    let mut from = [f32::INFINITY; 257];
    for (byte, from) in from.iter_mut().enumerate().take(256) {
        // The least float that rounds to the byte: floats from 0 up are ordered as their bits are.
        let (mut low, mut high) = (0u32, 1f32.to_bits());
        while low < high {
            let middle = low + (high - low) / 2;
            if usize::from(rounded(f32::from_bits(middle))) >= byte {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        *from = f32::from_bits(low);
    }
    Steps { first: std::array::from_fn(|part| rounded(part as f32 / Steps::PARTS)), from }
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framebuffer::Channels;
    use crate::parallel::Pool;
    use crate::seam::Control;
    use std::sync::atomic::{AtomicU32, Ordering};

    fn ramp(width: u32, height: u32) -> Framebuffer {
        let mut picture = Framebuffer::new(width, height, Channels::COLOR);
        for (i, color) in picture.band().color.iter_mut().enumerate() {
            *color = Vec3::new(i as f32 * 0.1, 0.25, 1.5 - i as f32 * 0.2);
        }
        picture
    }

    #[test]
    fn bytes_are_those_of_the_curve() {
        for i in 0..=100_000 {
            let linear = (i as f32 / 100_000.0).powi(2) * 1.01;
            assert_eq!(srgb_byte(linear), (srgb_from_linear(linear) * 255.0).round() as u8, "{linear}");
        }
        let strange = [f32::NAN, f32::INFINITY, -1.0, -0.0, f32::MIN_POSITIVE, 1.0, 1.0f32.next_down()];
        assert_eq!(strange.map(srgb_byte), [0, 255, 0, 0, 0, 255, 255]);
    }

    #[test]
    fn each_format_has_its_bytes_in_its_order() {
        let picture = ramp(1, 1);
        let bytes = |format: PixelFormat| {
            let mut memory = vec![9; format.bytes() + 1];
            Layout::packed(format, 1).write(&picture, &mut memory).unwrap();
            assert_eq!(memory.pop(), Some(9));
            memory
        };
        assert_eq!(bytes(PixelFormat::Rgb8), [0, 137, 255]);
        assert_eq!(bytes(PixelFormat::Bgr8), [255, 137, 0]);
        assert_eq!(bytes(PixelFormat::Rgba8), [0, 137, 255, 255]);
        assert_eq!(bytes(PixelFormat::Bgra8), [255, 137, 0, 255]);
        assert_eq!(bytes(PixelFormat::Rgb565), (34u16 << 5 | 31).to_le_bytes());
        // 0.7152 / 4 + 0.0722 * 1.5 is 0.2871.
        assert_eq!(bytes(PixelFormat::Gray8), [146]);
        let floats: Vec<u8> = [0.0f32, 0.25, 1.5].into_iter().flat_map(f32::to_ne_bytes).collect();
        assert_eq!(bytes(PixelFormat::RgbF32), floats);
    }

    #[test]
    fn rows_lie_at_their_stride_and_nothing_else_is_touched() {
        let picture = ramp(3, 4);
        let layout = Layout { format: PixelFormat::Rgb8, stride: 11 };
        let mut memory = vec![1; 50];
        layout.write(&picture, &mut memory).unwrap();
        for (i, byte) in memory.iter().enumerate() {
            let (row, column) = (i / 11, i % 11);
            let expected = if row < 4 && column < 9 {
                srgb_bytes(picture.color()[row * 3 + column / 3])[column % 3]
            } else {
                1
            };
            assert_eq!(*byte, expected, "byte {i}");
        }
        assert_eq!(
            layout.write(&picture, &mut memory[..41]),
            Err(PixelsError::Short { needed: 42, there: 41 })
        );
        let narrow = Layout { stride: 8, ..layout };
        let refused = narrow.write(&picture, &mut memory).unwrap_err().to_string();
        assert_eq!(refused, "a row of 3 pixels takes 9 bytes, the stride is 8");
        assert_eq!(Layout::packed(PixelFormat::Rgb8, 0).write(&ramp(0, 5), &mut []), Ok(()));
        let colorless = Framebuffer::new(2, 2, Channels::NONE);
        assert_eq!(layout.write(&colorless, &mut memory), Err(PixelsError::NoColor));
    }

    #[test]
    fn a_function_is_called_once_for_each_pixel() {
        let (width, height) = (19, 23);
        let screen: Vec<AtomicU32> = (0..width * height).map(|_| AtomicU32::new(0)).collect();
        let sink = SetPixel(|x: u32, y: u32, [r, g, b]: [u8; 3]| {
            let packed = 1 << 24 | u32::from(r) << 16 | u32::from(g) << 8 | u32::from(b);
            screen[(y * width + x) as usize].fetch_add(packed, Ordering::Relaxed);
        });
        let pool = Pool::new(3).unwrap();
        let control = Control::new(&pool).watched_by(&sink);
        let mut picture = Framebuffer::new(width, height, Channels::COLOR);
        picture.for_each_band(&pool, 4, &|band| {
            for (i, color) in band.color.iter_mut().enumerate() {
                *color = Vec3::new(0.2, (band.first_row * width + i as u32) as f32 / 437.0, 1.0);
            }
            control.finished(&band);
        });
        for (pixel, &color) in screen.iter().zip(picture.color()) {
            let [r, g, b] = srgb_bytes(color).map(u32::from);
            assert_eq!(pixel.load(Ordering::Relaxed), 1 << 24 | r << 16 | g << 8 | b);
        }
    }
}
