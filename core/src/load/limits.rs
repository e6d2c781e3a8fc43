//! How much a file may claim, and what a caller may ask of the loader.

use crate::scene::Samples;

/// Bounds on what a loader may build. With the defaults no small file makes memory grow by 512 MB: what a header
/// merely claims is compared with these numbers, and with the bytes that are there, before anything is allocated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of any one file that is read. Default: 1 GiB.
    pub file_bytes: u64,
    /// Pixels of one picture. Default: 24 Mi, for example 6144x4096; a texture takes 11 bytes a pixel.
    pub texture_pixels: u64,
    /// Pixels of all textures of a scene together; what is over becomes a placeholder. Default: 32 Mi.
    pub all_texture_pixels: u64,
    /// Bytes of all voxel chunks together. Default: 256 MiB, four dense models of 400^3.
    pub voxel_bytes: u64,
    /// Bytes of one volume's samples. Default: 256 MiB, for example 512x512x512 of 16 bits.
    pub volume_bytes: u64,
    /// Vertices of all meshes together. Default: 8 Mi.
    pub vertices: u64,
    /// Triangles of all meshes together. Default: 16 Mi.
    pub triangles: u64,
    /// Placed objects. Default: 65,536.
    pub instances: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 1 << 30,
            texture_pixels: 24 << 20,
            all_texture_pixels: 32 << 20,
            voxel_bytes: 256 << 20,
            volume_bytes: 256 << 20,
            vertices: 8 << 20,
            triangles: 16 << 20,
            instances: 1 << 16,
        }
    }
}

/// What a caller may say about a file that the file does not say itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// Size and number format of a `.raw` volume.
    pub volume: Option<RawVolume>,
    /// Reads a picture as a height map.
    pub height_map: bool,
    /// Which frame of an animated `.vox` file is shown, counted from 0.
    pub frame: u32,
    /// How much a file may claim.
    pub limits: Limits,
}

/// Size and number format of a volume without a header; little-endian, x fastest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawVolume {
    /// Samples along each axis.
    pub size: [u32; 3],
    /// Number format of a sample.
    pub format: SampleFormat,
}

/// Number formats of [`Samples`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names are the number formats")]
pub enum SampleFormat {
    U8,
    I16,
    U16,
    F32,
}

impl SampleFormat {
    /// Returns the bytes of a sample.
    #[must_use]
    pub fn bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::F32 => 4,
        }
    }

    /// Returns the name used in options and scene files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I16 => "i16",
            Self::U16 => "u16",
            Self::F32 => "f32",
        }
    }

    /// Returns the format of samples.
    #[must_use]
    pub fn of(samples: &Samples) -> Self {
        match samples {
            Samples::U8(_) => Self::U8,
            Samples::I16(_) => Self::I16,
            Samples::U16(_) => Self::U16,
            Samples::F32(_) => Self::F32,
        }
    }
}

impl std::str::FromStr for SampleFormat {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        [Self::U8, Self::I16, Self::U16, Self::F32]
            .into_iter()
            .find(|f| f.name() == text)
            .ok_or_else(|| format!("`{text}` is no number format: write u8, i16, u16 or f32"))
    }
}

impl std::str::FromStr for RawVolume {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refuse = || format!("`{text}` is no volume: write WxHxD:FORMAT, for example 256x256x128:u16");
        let (size, format) = text.split_once(':').ok_or_else(refuse)?;
        let edges: Vec<u32> =
            size.split('x').map(|edge| edge.parse().map_err(|_| refuse())).collect::<Result<_, _>>()?;
        let size: [u32; 3] = edges.try_into().map_err(|_| refuse())?;
        if size.contains(&0) {
            return Err(refuse());
        }
        Ok(Self { size, format: format.parse()? })
    }
}

impl std::fmt::Display for RawVolume {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y, z] = self.size;
        write!(f, "{x}x{y}x{z}:{}", self.format.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raw_volumes_are_written_as_they_are_read() {
        let volume: RawVolume = "4x5x6:i16".parse().unwrap();
        assert_eq!(volume, RawVolume { size: [4, 5, 6], format: SampleFormat::I16 });
        assert_eq!(volume.to_string(), "4x5x6:i16");
        for wrong in ["4x5:u8", "4x5x6", "0x5x6:u8", "4x5x6:u12", "4x-5x6:u8", "1x2x3x4:u8"] {
            assert!(wrong.parse::<RawVolume>().is_err(), "{wrong}");
        }
    }
}
