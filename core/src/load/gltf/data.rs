//! Reads the numbers of a glTF file: buffers from the binary chunk, data URIs or the folder, and accessors into them.

use super::document::{Accessor, Document, SparsePart};
use crate::load::error::{Fault, one_line};
use crate::load::source::Source;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::cell::Cell;

/// Elements of an accessor without bytes; the specification lets it stand for zeros, however many.
const MOST_ZEROS: u64 = 1 << 20;

/// The bytes of all buffers of a document.
pub(super) struct Data<'a> {
    document: &'a Document,
    buffers: Vec<Vec<u8>>,
    /// Elements that may still be read: many primitives can name one large accessor.
    left: Cell<u64>,
}

impl<'a> Data<'a> {
    /// Reads all buffers.
    pub(super) fn read(
        document: &'a Document,
        mut binary: Option<Vec<u8>>,
        source: &Source<'_>,
    ) -> Result<Self, Fault> {
        let mut buffers = Vec::new();
        for (i, buffer) in document.buffers.iter().enumerate() {
            let bytes = match (&buffer.uri, i) {
                (Some(uri), _) => read_uri(uri, source),
                (None, 0) => binary.take().ok_or_else(|| Fault::malformed("there is no binary chunk")),
                (None, _) => Err(Fault::malformed("it has no `uri`")),
            };
            let bytes = bytes.map_err(|fault| fault.at(format_args!("buffers[{i}]")))?;
            if (bytes.len() as u64) < buffer.byte_length {
                let what = format!("buffers[{i}]: {} bytes of {}", bytes.len(), buffer.byte_length);
                return Err(Fault::malformed(what));
            }
            buffers.push(bytes);
        }
        let left = Cell::new(source.limits.vertices * 3 + source.limits.triangles * 3);
        Ok(Self { document, buffers, left })
    }

    /// Returns the bytes of a buffer view.
    pub(super) fn view(&self, index: usize) -> Result<&[u8], Fault> {
        let view = &self.document.buffer_views[index];
        let bytes = &self.buffers[view.buffer];
        let end = view.byte_offset.checked_add(view.byte_length).filter(|&end| end <= bytes.len() as u64);
        match end {
            Some(end) => Ok(&bytes[view.byte_offset as usize..end as usize]),
            None => Err(Fault::malformed(format!(
                "bufferViews[{index}]: bytes {} + {} of a buffer of {}",
                view.byte_offset,
                view.byte_length,
                bytes.len()
            ))),
        }
    }

    /// Reads an accessor of vectors as `f32`; normalized integers become shares of their range.
    pub(super) fn vectors<const N: usize>(&self, index: usize) -> Result<Vec<[f32; N]>, Fault> {
        let accessor = &self.document.accessors[index];
        let fail = |fault: Fault| fault.at(format_args!("accessors[{index}]"));
        let component = Component::of(accessor.component_type).map_err(fail)?;
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        if accessor.kind != kind {
            let what = format!("type {} where {kind} is needed", one_line(&accessor.kind));
            return Err(fail(Fault::malformed(what)));
        }
        let read = component.reader(accessor.normalized);
        let size = component.size();
        let element = |bytes: &[u8]| std::array::from_fn(|i| read(&bytes[i * size..(i + 1) * size]));
        self.elements(accessor, N * size, [0.0; N], element).map_err(fail)
    }

    /// Reads an accessor of indices.
    pub(super) fn indices(&self, index: usize) -> Result<Vec<u32>, Fault> {
        let accessor = &self.document.accessors[index];
        let fail = |fault: Fault| fault.at(format_args!("accessors[{index}]"));
        if accessor.kind != "SCALAR" {
            return Err(fail(Fault::malformed(format!("type {} for indices", one_line(&accessor.kind)))));
        }
        let component = Component::of(accessor.component_type).map_err(fail)?;
        let read = component.index_reader().map_err(fail)?;
        self.elements(accessor, component.size(), 0, read).map_err(fail)
    }

    fn elements<T: Copy>(
        &self,
        accessor: &Accessor,
        size: usize,
        zero: T,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, Fault> {
        let Some(left) = self.left.get().checked_sub(accessor.count) else {
            return Err(Fault::over(format!("{} elements are too many", accessor.count), "vertices"));
        };
        self.left.set(left);
        let count = accessor.count as usize;
        let mut list = match accessor.buffer_view {
            Some(view) => {
                let stride = self.document.buffer_views[view].byte_stride;
                strided(self.view(view)?, accessor.byte_offset, stride, count, size)?.map(&read).collect()
            }
            None if accessor.count > MOST_ZEROS => {
                return Err(Fault::malformed(format!("{count} elements without any bytes")));
            }
            None => vec![zero; count],
        };
        if let Some(sparse) = &accessor.sparse {
            if sparse.count > accessor.count {
                return Err(Fault::malformed(format!("{} sparse elements of {count}", sparse.count)));
            }
            let replaced = self.sparse_indices(&sparse.indices, sparse.count as usize)?;
            let view = self.view(sparse.values.buffer_view)?;
            let values = strided(view, sparse.values.byte_offset, None, sparse.count as usize, size)?;
            for (place, bytes) in replaced.into_iter().zip(values) {
                match list.get_mut(place as usize) {
                    Some(element) => *element = read(bytes),
                    None => return Err(Fault::malformed(format!("sparse element {place} of {count}"))),
                }
            }
        }
        Ok(list)
    }

    fn sparse_indices(&self, part: &SparsePart, count: usize) -> Result<Vec<u32>, Fault> {
        let component = Component::of(part.component_type)?;
        let read = component.index_reader()?;
        Ok(strided(self.view(part.buffer_view)?, part.byte_offset, None, count, component.size())?
            .map(read)
            .collect())
    }
}

/// Walks over `count` elements of `size` bytes, after checking that all of them are there.
fn strided(
    bytes: &[u8],
    offset: u64,
    stride: Option<u64>,
    count: usize,
    size: usize,
) -> Result<impl Iterator<Item = &[u8]>, Fault> {
    let stride = stride.unwrap_or(size as u64);
    if stride < size as u64 {
        return Err(Fault::malformed(format!("stride {stride} for elements of {size} bytes")));
    }
    let last = (count as u64).saturating_sub(1).saturating_mul(stride);
    let end = if count == 0 { offset } else { offset.saturating_add(last).saturating_add(size as u64) };
    if end > bytes.len() as u64 {
        return Err(Fault::malformed(format!(
            "{count} elements need {end} bytes of a view of {}",
            bytes.len()
        )));
    }
    let bytes = &bytes[offset as usize..];
    Ok((0..count).map(move |i| &bytes[i * stride as usize..i * stride as usize + size]))
}

/// Number formats of accessors.
#[derive(Clone, Copy)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: u32) -> Result<Self, Fault> {
        Ok(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            other => return Err(Fault::malformed(format!("componentType {other} is none"))),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    fn reader(self, normalized: bool) -> fn(&[u8]) -> f32 {
        match (self, normalized) {
            (Self::I8, false) => |b| f32::from(b[0] as i8),
            (Self::I8, true) => |b| (f32::from(b[0] as i8) / 127.0).max(-1.0),
            (Self::U8, false) => |b| f32::from(b[0]),
            (Self::U8, true) => |b| f32::from(b[0]) / 255.0,
            (Self::I16, false) => |b| f32::from(i16::from_le_bytes([b[0], b[1]])),
            (Self::I16, true) => |b| (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).max(-1.0),
            (Self::U16, false) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])),
            (Self::U16, true) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0,
            (Self::U32, _) => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
            (Self::F32, _) => |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        }
    }

    fn index_reader(self) -> Result<fn(&[u8]) -> u32, Fault> {
        Ok(match self {
            Self::U8 => |b| u32::from(b[0]),
            Self::U16 => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
            Self::U32 => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            _ => return Err(Fault::malformed("indices must be unsigned integers")),
        })
    }
}

/// Reads a data URI, or a file of the folder.
pub(super) fn read_uri(uri: &str, source: &Source<'_>) -> Result<Vec<u8>, Fault> {
    let Some(data) = uri.strip_prefix("data:") else {
        return source.folder.read(&percent_decoded(uri));
    };
    let Some((_, text)) = data.split_once(";base64,") else {
        return Err(Fault::unsupported(
            "a data URI that is not base64",
            "export it with a separate .bin file",
        ));
    };
    let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    GeneralPurpose::new(&STANDARD, config)
        .decode(text.trim())
        .map_err(|error| Fault::malformed(format!("a data URI is no base64 ({error})")))
}

/// Turns `%20` into a space, and so on.
fn percent_decoded(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let (mut decoded, mut at) = (Vec::with_capacity(bytes.len()), 0);
    while at < bytes.len() {
        let hex = |b: &u8| char::from(*b).to_digit(16);
        if let (b'%', Some(high), Some(low)) =
            (bytes[at], bytes.get(at + 1).and_then(hex), bytes.get(at + 2).and_then(hex))
        {
            decoded.push((high * 16 + low) as u8);
            at += 3;
        } else {
            decoded.push(bytes[at]);
            at += 1;
        }
    }
    String::from_utf8_lossy(&decoded).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_past_the_end_are_refused() {
        let bytes = [0u8; 40];
        assert_eq!(strided(&bytes, 4, Some(12), 3, 12).unwrap().count(), 3);
        for (offset, stride, count) in [
            (5, Some(12), 3),
            (0, Some(8), 2),
            (0, None, 4),
            (u64::MAX, None, 1),
            (41, None, 0),
            (0, Some(u64::MAX), 2),
        ] {
            assert!(strided(&bytes, offset, stride, count, 12).is_err(), "{offset} {stride:?} {count}");
        }
    }

    #[test]
    fn percent_signs_are_decoded_where_they_are_codes() {
        assert_eq!(percent_decoded("a%20b%2e%zz%"), "a b.%zz%");
    }
}
