//! Reads NIfTI-1 volumes, either byte order, packed by gzip or not.
//!
//! The header is 348 bytes at fixed places, which is less than it would take to guard a crate that allocates by it.

use super::Grid;
use super::samples::{FileFormat, Order, count_samples, read_raw, unpack};
use crate::load::error::Fault;
use crate::load::source::Source;
use crate::scene::Samples;
use glam::{DMat3, DQuat, DVec3};

const HEADER: usize = 348;

/// Reads a `.nii` or `.nii.gz` file.
pub(super) fn read(source: &mut Source<'_>) -> Result<Grid, Fault> {
    let mut bytes = std::mem::take(&mut source.bytes);
    if bytes.starts_with(&[0x1f, 0x8b]) {
        bytes = unpack(&bytes, source.limits.volume_bytes + (1 << 20))?;
    }
    let header = Header::of(&bytes)?;
    let size = header.size(source)?;
    let format = header.format()?;
    let count = count_samples(size, format, source.limits).map_err(|fault| fault.at("field `dim`"))?;
    let offset = f64::from(header.f32(108));
    if !(offset >= 0.0 && offset <= bytes.len() as f64) {
        return Err(Fault::malformed(format!(
            "field `vox_offset`: {offset} in a file of {} bytes",
            bytes.len()
        )));
    }
    let first = (offset as usize).max(HEADER);
    let data = bytes.get(first..).ok_or_else(|| Fault::malformed("the file ends behind its header"))?;
    let samples = scaled(read_raw(data, count, format, header.order)?, header.f32(112), header.f32(116));
    let spacing = DVec3::new(f64::from(header.f32(80)), f64::from(header.f32(84)), f64::from(header.f32(88)));
    let rotation = super::upright(header.axes()).unwrap_or_else(super::z_up);
    Ok(Grid {
        size: size.map(|s| s as u32),
        spacing: super::sound_spacing(spacing.abs(), source),
        samples,
        world_from_grid: rotation,
    })
}

struct Header<'a> {
    bytes: &'a [u8],
    order: Order,
}

impl<'a> Header<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self, Fault> {
        if bytes.len() < HEADER {
            return Err(Fault::malformed(format!("{} bytes, the header alone has {HEADER}", bytes.len())));
        }
        let order = match [bytes[0], bytes[1], bytes[2], bytes[3]] {
            [92, 1, 0, 0] => Order::Little,
            [0, 0, 1, 92] => Order::Big,
            [28, 2, 0, 0] | [0, 0, 2, 28] => {
                return Err(Fault::unsupported("this is NIfTI-2", "save it as NIfTI-1"));
            }
            _ => {
                return Err(Fault::malformed("byte 0: the size of the header is not 348")
                    .advise("check that it is a NIfTI file"));
            }
        };
        match &bytes[344..347] {
            b"n+1" => Ok(Self { bytes, order }),
            b"ni1" => Err(Fault::unsupported(
                "the samples are in another file (.hdr and .img)",
                "save it as one .nii file",
            )),
            _ => Err(Fault::malformed("byte 344: the magic is not `n+1`")),
        }
    }

    fn i16(&self, at: usize) -> i16 {
        let two = [self.bytes[at], self.bytes[at + 1]];
        match self.order {
            Order::Little => i16::from_le_bytes(two),
            Order::Big => i16::from_be_bytes(two),
        }
    }

    fn f32(&self, at: usize) -> f32 {
        let four = [self.bytes[at], self.bytes[at + 1], self.bytes[at + 2], self.bytes[at + 3]];
        match self.order {
            Order::Little => f32::from_le_bytes(four),
            Order::Big => f32::from_be_bytes(four),
        }
    }

    /// Returns the sizes of the first three axes; of a series the first volume is shown.
    fn size(&self, source: &mut Source<'_>) -> Result<[u64; 3], Fault> {
        let dimensions = self.i16(40);
        if !(3..=7).contains(&dimensions) {
            return Err(Fault::unsupported(
                format!("field `dim`: {dimensions} axes, 3 are needed"),
                "save one volume",
            ));
        }
        let edges: Vec<i16> = (0..dimensions as usize).map(|i| self.i16(42 + 2 * i)).collect();
        if let Some(wrong) = edges.iter().find(|&&e| e < 1) {
            return Err(Fault::malformed(format!("field `dim`: an axis of {wrong} samples")));
        }
        let more: u64 = edges[3..].iter().map(|&e| e as u64).product();
        if more > 1 {
            source.notes.add(format!("only the first of {more} volumes is shown"));
        }
        Ok([edges[0] as u64, edges[1] as u64, edges[2] as u64])
    }

    fn format(&self) -> Result<FileFormat, Fault> {
        Ok(match self.i16(70) {
            2 => FileFormat::U8,
            4 => FileFormat::I16,
            8 => FileFormat::I32,
            16 => FileFormat::F32,
            64 => FileFormat::F64,
            256 => FileFormat::I8,
            512 => FileFormat::U16,
            768 => FileFormat::U32,
            1024 => FileFormat::I64,
            1280 => FileFormat::U64,
            other => {
                let what = format!("field `datatype`: {other} is not read");
                return Err(Fault::unsupported(what, "save it as 8- or 16-bit integers or floats"));
            }
        })
    }

    /// Returns the directions of the axes in right-anterior-superior space: by the matrix, or else by the quaternion.
    fn axes(&self) -> [DVec3; 3] {
        let value = |at: usize| f64::from(self.f32(at));
        if self.i16(254) > 0 {
            let row = |at: usize| DVec3::new(value(at), value(at + 4), value(at + 8));
            let m = DMat3::from_cols(row(280), row(296), row(312)).transpose();
            return [m.x_axis, m.y_axis, m.z_axis].map(DVec3::normalize_or_zero);
        }
        if self.i16(252) > 0 {
            let (b, c, d) = (value(256), value(260), value(264));
            let a = (1.0 - b * b - c * c - d * d).max(0.0).sqrt();
            let rotation = DMat3::from_quat(DQuat::from_xyzw(b, c, d, a));
            let flip = if value(76) < 0.0 { -1.0 } else { 1.0 };
            return [rotation.x_axis, rotation.y_axis, rotation.z_axis * flip];
        }
        [DVec3::X, DVec3::Y, DVec3::Z]
    }
}

/// Applies slope and intercept where they change anything; a slope of 0 means none.
fn scaled(samples: Samples, slope: f32, intercept: f32) -> Samples {
    let changes =
        slope.is_finite() && intercept.is_finite() && slope != 0.0 && (slope, intercept) != (1.0, 0.0);
    if !changes {
        return samples;
    }
    Samples::F32((0..samples.len()).map(|i| samples.get(i) * slope + intercept).collect())
}
