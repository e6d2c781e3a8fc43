//! Reads NRRD volumes: a text header, then samples raw, packed by gzip, or as text; here or in a file beside.

use super::Grid;
use super::samples::{FileFormat, Order, count_samples, read_gzip, read_raw};
use crate::load::error::{Fault, one_line};
use crate::load::source::Source;
use crate::load::text::decode_text;
use crate::scene::Samples;
use glam::{DMat3, DVec3};
use std::collections::HashMap;

/// Longest header that is read.
const LONGEST_HEADER: usize = 1 << 16;

/// Reads an NRRD file (or its detached header).
pub(super) fn read(source: &mut Source<'_>) -> Result<Grid, Fault> {
    let bytes = std::mem::take(&mut source.bytes);
    let (header, data) = Header::read(&bytes)?;
    let size = header.size(source)?;
    let format = header.format()?;
    let count = count_samples(size, format, source.limits).map_err(|fault| fault.at("field `sizes`"))?;
    let order = header.order(format, source)?;
    let beside;
    let data = match header.get("data file").or_else(|| header.get("datafile")) {
        Some(name) => {
            if name.starts_with("LIST") || name.contains('%') {
                return Err(Fault::unsupported("field `data file`: several files", "join them into one"));
            }
            beside = source.folder.read(name).map_err(|fault| fault.at("field `data file`"))?;
            &beside[..]
        }
        None => data.ok_or_else(|| Fault::malformed("the header does not end with an empty line"))?,
    };
    let data = header.skip(data, count * format.bytes())?;
    let samples = match header.get("encoding").unwrap_or("raw") {
        "raw" => {
            if data.len() > count * format.bytes() {
                source.notes.add(format!(
                    "{} bytes behind the samples are left out",
                    data.len() - count * format.bytes()
                ));
            }
            read_raw(data, count, format, order)
        }
        "gzip" | "gz" => read_gzip(data, count, format, order),
        "ascii" | "text" | "txt" => read_text(data, count),
        other => {
            let what = format!("field `encoding`: `{}` is not read", one_line(other));
            Err(Fault::unsupported(what, "save it with encoding raw or gzip"))
        }
    }?;
    let (spacing, rotation) = header.frame(source)?;
    Ok(Grid { size: size.map(|s| s as u32), spacing, samples, world_from_grid: rotation })
}

struct Header<'a> {
    fields: HashMap<String, &'a str>,
}

impl<'a> Header<'a> {
    /// Splits the file into its fields and the samples behind them.
    fn read(bytes: &'a [u8]) -> Result<(Self, Option<&'a [u8]>), Fault> {
        if !bytes.starts_with(b"NRRD000") {
            return Err(
                Fault::malformed("it does not begin with `NRRD000`").advise("check that it is an NRRD file")
            );
        }
        let (mut fields, mut at) = (HashMap::new(), 0);
        let mut line_number = 0;
        loop {
            let rest = &bytes[at..];
            let Some(length) = rest.iter().take(LONGEST_HEADER).position(|&b| b == b'\n') else {
                if rest.len() >= LONGEST_HEADER {
                    return Err(Fault::malformed(format!(
                        "line {} of the header has no end",
                        line_number + 1
                    )));
                }
                Self::field(rest, &mut fields, line_number + 1)?;
                return Ok((Self { fields }, None));
            };
            let line = rest[..length].strip_suffix(b"\r").unwrap_or(&rest[..length]);
            line_number += 1;
            at += length + 1;
            if line.is_empty() {
                return Ok((Self { fields }, Some(&bytes[at..])));
            }
            if at > LONGEST_HEADER {
                return Err(Fault::malformed("the header has no end"));
            }
            if line_number > 1 {
                Self::field(line, &mut fields, line_number)?;
            }
        }
    }

    fn field(line: &'a [u8], fields: &mut HashMap<String, &'a str>, number: usize) -> Result<(), Fault> {
        let text = std::str::from_utf8(line).map_err(|_| {
            Fault::malformed(format!(
                "line {number} of the header is no text: `{}`",
                one_line(&decode_text(line))
            ))
        })?;
        if let Some((key, value)) = text.split_once(':')
            && !text.starts_with('#')
        {
            // `key:=value` is free text of the author
            if !value.starts_with('=') {
                fields.insert(key.trim().to_ascii_lowercase(), value.trim());
            }
        }
        Ok(())
    }

    fn get(&self, key: &str) -> Option<&'a str> {
        self.fields.get(key).copied()
    }

    /// Returns the three sizes; a fourth axis of one sample is dropped.
    fn size(&self, source: &mut Source<'_>) -> Result<[u64; 3], Fault> {
        let text = self.get("sizes").ok_or_else(|| Fault::malformed("field `sizes` is missing"))?;
        let parsed: Result<Vec<u64>, _> = text.split_ascii_whitespace().map(str::parse).collect();
        let sizes = parsed
            .map_err(|_| Fault::malformed(format!("field `sizes`: `{}` are no sizes", one_line(text))))?;
        let dimension = self.get("dimension").and_then(|d| d.parse::<usize>().ok());
        if dimension != Some(sizes.len()) {
            let said = one_line(self.get("dimension").unwrap_or("missing"));
            return Err(Fault::malformed(format!(
                "field `dimension` is {said}, but there are {} sizes",
                sizes.len()
            )));
        }
        match sizes[..] {
            [x, y, z] => Ok([x, y, z]),
            [x, y, z, 1] | [1, x, y, z] => {
                source.notes.add("an axis of one sample is left out");
                Ok([x, y, z])
            }
            _ => {
                let what = format!("field `dimension`: {} axes, only 3 are read", sizes.len());
                Err(Fault::unsupported(what, "save a volume of one number a sample"))
            }
        }
    }

    fn format(&self) -> Result<FileFormat, Fault> {
        let name = self.get("type").ok_or_else(|| Fault::malformed("field `type` is missing"))?;
        Ok(match name {
            "signed char" | "int8" | "int8_t" => FileFormat::I8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => FileFormat::U8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
                FileFormat::I16
            }
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => FileFormat::U16,
            "int" | "signed int" | "int32" | "int32_t" => FileFormat::I32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => FileFormat::U32,
            "longlong" | "long long" | "signed long long" | "int64" | "int64_t" => FileFormat::I64,
            "ulonglong" | "unsigned long long" | "uint64" | "uint64_t" => FileFormat::U64,
            "float" => FileFormat::F32,
            "double" => FileFormat::F64,
            other => {
                let what = format!("field `type`: `{}` is not read", one_line(other));
                return Err(Fault::unsupported(what, "save it as uint8, int16, uint16 or float"));
            }
        })
    }

    fn order(&self, format: FileFormat, source: &mut Source<'_>) -> Result<Order, Fault> {
        match self.get("endian") {
            Some("little") => Ok(Order::Little),
            Some("big") => Ok(Order::Big),
            Some(other) => Err(Fault::malformed(format!("field `endian`: `{}`", one_line(other)))),
            None => {
                if format.bytes() > 1 && !matches!(self.get("encoding"), Some("ascii" | "text" | "txt")) {
                    source.notes.add("field `endian` is missing, little is taken");
                }
                Ok(Order::Little)
            }
        }
    }

    /// Applies `line skip` and `byte skip`; a byte skip of -1 means the samples are the end of the file.
    fn skip(&self, mut data: &'a [u8], needed: usize) -> Result<&'a [u8], Fault> {
        let number =
            |key: &str| self.get(key).map(|v| v.parse::<i64>().map_err(|_| key.to_owned())).transpose();
        let wrong = |key: String| Fault::malformed(format!("field `{key}` is no number"));
        let short = || Fault::malformed("the samples begin behind the end of the file");
        for _ in 0..number("line skip").map_err(wrong)?.unwrap_or(0).clamp(0, 1 << 20) {
            let end = data.iter().position(|&b| b == b'\n').ok_or_else(short)?;
            data = &data[end + 1..];
        }
        match number("byte skip").map_err(wrong)?.unwrap_or(0) {
            -1 => data.get(data.len().saturating_sub(needed)..).ok_or_else(short),
            skip => usize::try_from(skip).ok().and_then(|skip| data.get(skip..)).ok_or_else(short),
        }
    }

    /// Returns the spacing and the rotation of the axes into a world with y up.
    ///
    /// Only files that name a patient space (`space: left-posterior-superior` and the like) are turned, since only
    /// they say which way is up; all others keep their axes.
    fn frame(&self, source: &mut Source<'_>) -> Result<(DVec3, DMat3), Fault> {
        let directions = self.get("space directions").map(parse_vectors);
        if let Some(Some([a, b, c])) = directions {
            let lengths = DVec3::new(a.length(), b.length(), c.length());
            let unit = [a, b, c].map(DVec3::normalize_or_zero);
            let to_ras = self.get("space").and_then(ras_signs);
            let rotation = to_ras.and_then(|signs| super::upright(unit.map(|axis| axis * signs)));
            return Ok((super::sound_spacing(lengths, source), rotation.unwrap_or(DMat3::IDENTITY)));
        }
        let Some(text) = self.get("spacings") else { return Ok((DVec3::ONE, DMat3::IDENTITY)) };
        let numbers: Vec<f64> = text.split_ascii_whitespace().filter_map(|word| word.parse().ok()).collect();
        let spacing = match numbers[..] {
            [x, y, z] | [x, y, z, _] => DVec3::new(x, y, z),
            _ => return Err(Fault::malformed(format!("field `spacings`: `{}`", one_line(text)))),
        };
        Ok((super::sound_spacing(spacing, source), DMat3::IDENTITY))
    }
}

/// Returns the factors from a patient space to right-anterior-superior.
fn ras_signs(space: &str) -> Option<DVec3> {
    match space.to_ascii_lowercase().as_str() {
        "right-anterior-superior" | "ras" => Some(DVec3::ONE),
        "left-anterior-superior" | "las" => Some(DVec3::new(-1.0, 1.0, 1.0)),
        "left-posterior-superior" | "lps" => Some(DVec3::new(-1.0, -1.0, 1.0)),
        _ => None,
    }
}

/// Parses `(a,b,c) (d,e,f) (g,h,i)`, passing over `none`.
fn parse_vectors(text: &str) -> Option<[DVec3; 3]> {
    let mut vectors = text.split(')').filter_map(|part| {
        let (_, numbers) = part.split_once('(')?;
        let list: Vec<f64> = numbers.split(',').filter_map(|n| n.trim().parse().ok()).collect();
        <[f64; 3]>::try_from(list).ok().map(DVec3::from_array)
    });
    Some([vectors.next()?, vectors.next()?, vectors.next()?])
}

fn read_text(data: &[u8], count: usize) -> Result<Samples, Fault> {
    if data.len() < count {
        return Err(Fault::malformed(format!(
            "{count} samples are promised, {} bytes are there",
            data.len()
        )));
    }
    let text = decode_text(data);
    let words = text.split(|c: char| c.is_ascii_whitespace() || c == ',').filter(|w| !w.is_empty());
    let mut list = Vec::with_capacity(count);
    for word in words.take(count) {
        let number: f32 = word.parse().map_err(|_| {
            Fault::malformed(format!("sample {}: `{}` is no number", list.len(), one_line(word)))
        })?;
        list.push(number);
    }
    if list.len() < count {
        return Err(Fault::malformed(format!("{count} samples are promised, {} are there", list.len())));
    }
    Ok(Samples::F32(list))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_split_from_samples() {
        let file = b"NRRD0004\r\n# note: x\ntype: uchar\nkey:=value\nsizes: 1 2 3\r\n\r\nabcdef";
        let (header, data) = Header::read(file).unwrap();
        assert_eq!(
            (header.get("type"), header.get("sizes"), header.get("key")),
            (Some("uchar"), Some("1 2 3"), None)
        );
        assert_eq!(data, Some(&b"abcdef"[..]));
        assert!(Header::read(b"NRRX").is_err());
        assert!(Header::read(&[&b"NRRD0004\n"[..], &vec![b'a'; 1 << 20]].concat()).is_err());
    }

    #[test]
    fn vectors_are_parsed() {
        let [a, _, c] = parse_vectors("(1,0,0) none (0,2,0) (0, 0, -3.5)").unwrap();
        assert_eq!((a, c), (DVec3::X, DVec3::new(0.0, 0.0, -3.5)));
        assert!(parse_vectors("(1,0) (0,1)").is_none());
    }
}
