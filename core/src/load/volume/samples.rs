//! Reads the samples of a volume from a stream of bytes, whatever their number format.

use crate::load::error::Fault;
use crate::load::limits::Limits;
use crate::scene::Samples;
use flate2::read::MultiGzDecoder;
use std::io::Read;

/// Number formats of files; those that the scene does not hold are widened or converted to `f32`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FileFormat {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl FileFormat {
    /// Bytes of a sample in the file.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Bytes of a sample in memory.
    fn held_bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::I8 | Self::I16 | Self::U16 => 2,
            _ => 4,
        }
    }
}

/// Order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

/// Checks the edges of a grid against the limit and returns the number of its samples.
pub(super) fn count_samples(size: [u64; 3], format: FileFormat, limits: &Limits) -> Result<usize, Fault> {
    let [x, y, z] = size;
    if size.contains(&0) {
        return Err(Fault::malformed(format!("a volume of {x}x{y}x{z} samples")));
    }
    // Three edges of 32 bits and 4 bytes a sample fit into 128 bits.
    let clipped = size.map(|s| u128::from(s.min(u64::from(u32::MAX))));
    let bytes = clipped.iter().product::<u128>() * u128::from(format.held_bytes());
    if bytes > u128::from(limits.volume_bytes) {
        let what = format!(
            "a volume of {x}x{y}x{z} samples needs {bytes} bytes, at most {} are held",
            limits.volume_bytes
        );
        return Err(Fault::over(what, "volume_bytes"));
    }
    Ok((x * y * z) as usize)
}

/// Deflate makes a byte stand for 1032 at most.
const MOST_EXPANSION: usize = 1032;

/// Reads `count` samples that lie in the file as they are.
pub(super) fn read_raw(
    bytes: &[u8],
    count: usize,
    format: FileFormat,
    order: Order,
) -> Result<Samples, Fault> {
    let needed = count * format.bytes();
    if bytes.len() < needed {
        return Err(Fault::malformed(format!(
            "{needed} bytes of samples are promised, {} are there",
            bytes.len()
        )));
    }
    fill(&bytes[..needed], count, format, order)
}

/// Reads `count` samples that are packed by gzip; a stream that holds more is refused.
pub(super) fn read_gzip(
    bytes: &[u8],
    count: usize,
    format: FileFormat,
    order: Order,
) -> Result<Samples, Fault> {
    let needed = count * format.bytes();
    if needed / MOST_EXPANSION > bytes.len() {
        let what =
            format!("{needed} bytes of samples are promised, {} packed bytes cannot hold them", bytes.len());
        return Err(Fault::malformed(what));
    }
    let mut stream = MultiGzDecoder::new(bytes);
    let samples = fill(&mut stream, count, format, order)?;
    if !matches!(stream.read(&mut [0u8; 1]), Ok(0) | Err(_)) {
        return Err(Fault::malformed(format!(
            "the packed stream holds more than the {needed} bytes that are promised"
        )));
    }
    Ok(samples)
}

fn fill(stream: impl Read, count: usize, format: FileFormat, order: Order) -> Result<Samples, Fault> {
    macro_rules! numbers {
        ($type:ty, $into:expr) => {{
            let bytes = format.bytes();
            match order {
                Order::Little => collect(stream, count, bytes, |b| {
                    $into(<$type>::from_le_bytes(b.try_into().unwrap_or_default()))
                }),
                Order::Big => collect(stream, count, bytes, |b| {
                    $into(<$type>::from_be_bytes(b.try_into().unwrap_or_default()))
                }),
            }?
        }};
    }
    Ok(match format {
        FileFormat::U8 => Samples::U8(numbers!(u8, |v| v)),
        FileFormat::I8 => Samples::I16(numbers!(i8, i16::from)),
        FileFormat::I16 => Samples::I16(numbers!(i16, |v| v)),
        FileFormat::U16 => Samples::U16(numbers!(u16, |v| v)),
        FileFormat::F32 => Samples::F32(numbers!(f32, |v| v)),
        FileFormat::I32 => Samples::F32(numbers!(i32, |v| v as f32)),
        FileFormat::U32 => Samples::F32(numbers!(u32, |v| v as f32)),
        FileFormat::I64 => Samples::F32(numbers!(i64, |v| v as f32)),
        FileFormat::U64 => Samples::F32(numbers!(u64, |v| v as f32)),
        FileFormat::F64 => Samples::F32(numbers!(f64, |v| v as f32)),
    })
}

/// Reads numbers piece by piece, so that no second copy of the bytes is needed.
fn collect<T>(
    mut stream: impl Read,
    count: usize,
    bytes: usize,
    read: impl Fn(&[u8]) -> T,
) -> Result<Vec<T>, Fault> {
    let mut list = Vec::with_capacity(count);
    let mut piece = vec![0u8; 1 << 16];
    while list.len() < count {
        let wanted = ((count - list.len()) * bytes).min(piece.len());
        let part = &mut piece[..wanted];
        stream.read_exact(part).map_err(|error| {
            Fault::malformed(format!("the samples end after {} of {count} ({error})", list.len()))
        })?;
        list.extend(part.chunks_exact(bytes).map(&read));
    }
    Ok(list)
}

/// Unpacks a whole gzip stream, up to `most` bytes.
pub(in crate::load) fn unpack(bytes: &[u8], most: u64) -> Result<Vec<u8>, Fault> {
    let mut unpacked = Vec::new();
    let read = MultiGzDecoder::new(bytes).take(most + 1).read_to_end(&mut unpacked);
    read.map_err(|error| Fault::malformed(format!("it cannot be unpacked ({error})")))?;
    if unpacked.len() as u64 > most {
        return Err(Fault::over(format!("it unpacks to more than {most} bytes"), "volume_bytes"));
    }
    Ok(unpacked)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use std::io::Write;

    fn packed(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn both_byte_orders_and_packed_samples_are_read() {
        let Samples::I16(list) = read_raw(&[0xff, 0xfe, 0, 1], 2, FileFormat::I16, Order::Big).unwrap()
        else {
            panic!("16-bit samples")
        };
        assert_eq!(list, [-2, 1]);
        let Samples::F32(list) =
            read_gzip(&packed(&2.5f64.to_le_bytes()), 1, FileFormat::F64, Order::Little).unwrap()
        else {
            panic!("converted samples")
        };
        assert_eq!(list, [2.5]);
    }

    #[test]
    fn bombs_and_short_streams_are_refused() {
        let bomb = packed(&vec![0; 1 << 22]);
        assert!(read_gzip(&bomb, 64, FileFormat::U8, Order::Little).is_err());
        assert!(read_gzip(&bomb, 1 << 23, FileFormat::U8, Order::Little).is_err());
        assert!(read_gzip(&bomb, 1 << 40, FileFormat::U8, Order::Little).is_err());
        assert!(unpack(&bomb, 1 << 20).is_err());
        assert!(read_raw(&[0; 7], 2, FileFormat::F32, Order::Little).is_err());
        let limits = Limits::default();
        assert!(count_samples([1 << 20, 1 << 20, 1 << 20], FileFormat::U8, &limits).is_err());
        assert!(count_samples([u64::MAX; 3], FileFormat::U8, &limits).is_err());
    }
}
