//! Reads PLY: text, or binary in either byte order; vertices with normals, colors and texture coordinates, and
//! polygons. Colors are sRGB in files. Other elements and properties are passed over.

use super::error::{Fault, one_line};
use super::polygon::PolygonCutter;
use super::source::Source;
use super::surface::RawMesh;
use super::text::{Words, decode_text, parse_number};
use crate::scene::Scene;
use crate::shade::linear_from_srgb;
use glam::{DVec3, Vec2, Vec3};

/// Longest header that is read.
const LONGEST_HEADER: usize = 1 << 16;

/// Loads a PLY file.
pub(super) fn load(source: &mut Source<'_>) -> Result<Scene, Fault> {
    let bytes = std::mem::take(&mut source.bytes);
    let (header, body) = Header::read(&bytes)?;
    let mut values = Values::new(header.encoding, body)?;
    let mut mesh = RawMesh::default();
    let mut polygons = Polygons::default();
    for element in &header.elements {
        element.check_count(&values, source)?;
        let read = match element.name.as_str() {
            "vertex" => read_vertices(element, &mut values, &mut mesh),
            "face" => read_faces(element, &mut values, &mut polygons),
            _ => pass_over(element, &mut values),
        };
        read.map_err(|fault| fault.at(format_args!("element `{}`", one_line(&element.name))))?;
    }
    polygons.cut(&mut mesh, source)?;
    Ok(super::scene_of_mesh(mesh, source))
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Text,
    Little,
    Big,
}

#[derive(Clone, Copy)]
enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Returns what a color of this format is divided by.
    fn full(self) -> f64 {
        match self {
            Self::I8 | Self::U8 => 255.0,
            Self::I16 | Self::U16 => 65535.0,
            _ => 1.0,
        }
    }
}

struct Property {
    name: String,
    /// The format of the length of a list.
    length: Option<Number>,
    number: Number,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
}

impl Header {
    fn read(bytes: &[u8]) -> Result<(Self, &[u8]), Fault> {
        if !(bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r")) {
            return Err(
                Fault::malformed("it does not begin with `ply`").advise("check that it is a PLY file")
            );
        }
        let (mut encoding, mut elements, mut at, mut line_number) = (None, Vec::<Element>::new(), 0, 0);
        loop {
            let rest = &bytes[at..];
            let end = rest.iter().position(|&b| b == b'\n' || b == b'\r');
            let Some(length) = end.filter(|&l| at + l < LONGEST_HEADER) else {
                return Err(Fault::malformed("the header has no `end_header`"));
            };
            let line = decode_text(&rest[..length]);
            at += length + if rest[length..].starts_with(b"\r\n") { 2 } else { 1 };
            line_number += 1;
            let fail =
                |what: &str| Fault::malformed(format!("line {line_number}: {what}: `{}`", one_line(&line)));
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words[..] {
                ["format", name, ..] => {
                    encoding = Some(match name {
                        "ascii" => Encoding::Text,
                        "binary_little_endian" => Encoding::Little,
                        "binary_big_endian" => Encoding::Big,
                        _ => return Err(fail("this format is not known")),
                    });
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| fail("this is no count"))?;
                    elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", "list", length, number, name] => {
                    let element = elements.last_mut().ok_or_else(|| fail("a property of nothing"))?;
                    let (Some(length), Some(number)) = (Number::of(length), Number::of(number)) else {
                        return Err(fail("this number format is not known"));
                    };
                    element.properties.push(Property { name: name.to_owned(), length: Some(length), number });
                }
                ["property", number, name] => {
                    let element = elements.last_mut().ok_or_else(|| fail("a property of nothing"))?;
                    let number = Number::of(number).ok_or_else(|| fail("this number format is not known"))?;
                    element.properties.push(Property { name: name.to_owned(), length: None, number });
                }
                ["end_header"] => break,
                _ => {}
            }
        }
        let encoding = encoding.ok_or_else(|| Fault::malformed("the header has no `format`"))?;
        Ok((Self { encoding, elements }, &bytes[at..]))
    }
}

impl Element {
    /// Compares the count with the bytes that are left and with the limits.
    fn check_count(&self, values: &Values<'_>, source: &Source<'_>) -> Result<(), Fault> {
        let name = one_line(&self.name);
        let least: usize = match values {
            Values::Text(_) => self.properties.len() * 2,
            Values::Binary { .. } => {
                self.properties.iter().map(|p| p.length.unwrap_or(p.number).bytes()).sum()
            }
        };
        // The last word of a text needs no space behind it.
        let fits = (values.left() as u64 + 1) / (least.max(1) as u64);
        if self.count > fits && !self.properties.is_empty() {
            return Err(Fault::malformed(format!(
                "{} elements `{name}` are promised, {fits} fit",
                self.count
            )));
        }
        let (most, limit) = match self.name.as_str() {
            "vertex" => (source.limits.vertices, "vertices"),
            _ => (source.limits.triangles, "triangles"),
        };
        if self.count > most {
            return Err(Fault::over(format!("there are more than {most} elements `{name}`"), limit));
        }
        Ok(())
    }

    fn place_of(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|p| p.length.is_none() && names.contains(&p.name.as_str()))
    }
}

/// The numbers behind the header, one after the other.
enum Values<'a> {
    Text(Box<Words<'a>>),
    Binary { bytes: &'a [u8], big: bool },
}

impl<'a> Values<'a> {
    fn new(encoding: Encoding, body: &'a [u8]) -> Result<Self, Fault> {
        Ok(match encoding {
            Encoding::Text => Self::Text(Box::new(Words::new(body)?)),
            Encoding::Little => Self::Binary { bytes: body, big: false },
            Encoding::Big => Self::Binary { bytes: body, big: true },
        })
    }

    fn left(&self) -> usize {
        match self {
            Self::Text(words) => words.left(),
            Self::Binary { bytes, .. } => bytes.len(),
        }
    }

    fn next(&mut self, number: Number) -> Result<f64, Fault> {
        match self {
            Self::Text(words) => {
                let word = words.next_word().ok_or_else(|| Fault::malformed("the file ends too early"))?;
                let (value, _) = parse_number(word).ok_or_else(|| {
                    Fault::malformed(format!("`{}` is no number", one_line(&decode_text(word))))
                })?;
                Ok(value)
            }
            Self::Binary { bytes, big } => {
                let size = number.bytes();
                let (head, rest) = bytes
                    .split_at_checked(size)
                    .ok_or_else(|| Fault::malformed("the file ends too early"))?;
                *bytes = rest;
                let mut raw = [0u8; 8];
                raw[..size].copy_from_slice(head);
                if *big {
                    raw[..size].reverse();
                }
                Ok(decode(number, raw))
            }
        }
    }
}

/// Reads a little-endian number from the front of eight bytes.
fn decode(number: Number, raw: [u8; 8]) -> f64 {
    let [a, b, c, d, ..] = raw;
    match number {
        Number::I8 => f64::from(a as i8),
        Number::U8 => f64::from(a),
        Number::I16 => f64::from(i16::from_le_bytes([a, b])),
        Number::U16 => f64::from(u16::from_le_bytes([a, b])),
        Number::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
        Number::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
        Number::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
        Number::F64 => f64::from_le_bytes(raw),
    }
}

fn pass_over(element: &Element, values: &mut Values<'_>) -> Result<(), Fault> {
    for _ in 0..element.count {
        for property in &element.properties {
            let count = property.length.map_or(Ok(1.0), |length| values.next(length))?;
            for _ in 0..list_length(count, values)? {
                values.next(property.number)?;
            }
        }
    }
    Ok(())
}

fn list_length(count: f64, values: &Values<'_>) -> Result<usize, Fault> {
    if count >= 0.0 && count <= values.left() as f64 + 1.0 {
        return Ok(count as usize);
    }
    Err(Fault::malformed(format!("a list of {count} numbers")))
}

fn read_vertices(element: &Element, values: &mut Values<'_>, mesh: &mut RawMesh) -> Result<(), Fault> {
    let triple = |names: [&[&str]; 3]| {
        let [a, b, c] = names.map(|n| element.place_of(n));
        Some([a?, b?, c?])
    };
    let position =
        triple([&["x"], &["y"], &["z"]]).ok_or_else(|| Fault::malformed("x, y or z is missing"))?;
    let normal = triple([&["nx"], &["ny"], &["nz"]]);
    let color = triple([
        &["red", "r", "diffuse_red"],
        &["green", "g", "diffuse_green"],
        &["blue", "b", "diffuse_blue"],
    ]);
    let u = element.place_of(&["u", "s", "texture_u", "texture_s"]);
    let v = element.place_of(&["v", "t", "texture_v", "texture_t"]);
    let mut row = vec![0.0; element.properties.len()];
    for _ in 0..element.count {
        for (value, property) in row.iter_mut().zip(&element.properties) {
            let count = property.length.map_or(Ok(1.0), |length| values.next(length))?;
            for _ in 0..list_length(count, values)? {
                *value = values.next(property.number)?;
            }
        }
        mesh.positions.push(DVec3::from_array(position.map(|i| row[i])));
        if let Some(places) = normal {
            mesh.normals.push(DVec3::from_array(places.map(|i| row[i])).as_vec3());
        }
        if let Some(places) = color {
            let shade = |i: usize| (row[i] / element.properties[i].number.full()).clamp(0.0, 1.0) as f32;
            mesh.colors.push(Vec3::from_array(places.map(|i| linear_from_srgb(shade(i)))));
        }
        if let (Some(u), Some(v)) = (u, v) {
            mesh.uvs.push(Vec2::new(row[u] as f32, (1.0 - row[v]) as f32));
        }
    }
    Ok(())
}

/// Polygons as they are in the file: corner numbers, and where each ends.
#[derive(Default)]
struct Polygons {
    corners: Vec<u32>,
    ends: Vec<usize>,
}

fn read_faces(element: &Element, values: &mut Values<'_>, polygons: &mut Polygons) -> Result<(), Fault> {
    let wanted = ["vertex_indices", "vertex_index"];
    for face in 0..element.count {
        for property in &element.properties {
            let count = property.length.map_or(Ok(1.0), |length| values.next(length))?;
            let is_polygon = property.length.is_some() && wanted.contains(&property.name.as_str());
            for _ in 0..list_length(count, values)? {
                let value = values.next(property.number)?;
                if is_polygon {
                    if !(value >= 0.0 && value < f64::from(u32::MAX)) {
                        return Err(Fault::malformed(format!("face {face}: vertex {value}")));
                    }
                    polygons.corners.push(value as u32);
                }
            }
        }
        polygons.ends.push(polygons.corners.len());
    }
    Ok(())
}

impl Polygons {
    fn cut(&self, mesh: &mut RawMesh, source: &mut Source<'_>) -> Result<(), Fault> {
        let count = mesh.positions.len();
        if let Some(place) = self.corners.iter().position(|&i| i as usize >= count) {
            let face = self.ends.partition_point(|&end| end <= place);
            return Err(Fault::malformed(format!("face {face}: vertex {} of {count}", self.corners[place])));
        }
        if self.corners.len() as u64 > source.limits.triangles * 3 {
            return Err(Fault::over("there are too many corners", "triangles"));
        }
        let (mut cutter, mut points, mut first) = (PolygonCutter::new(), Vec::new(), 0);
        for &end in &self.ends {
            let corners = &self.corners[first..end];
            points.clear();
            points.extend(corners.iter().map(|&i| mesh.positions[i as usize]));
            let triangles = &mut mesh.triangles;
            cutter.cut(&points, |t| triangles.push(t.map(|i| corners[i])));
            first = end;
        }
        if cutter.fans() > 0 {
            source.notes.add(format!(
                "{} polygons are too large or too tangled and are filled as fans",
                cutter.fans()
            ));
        }
        Ok(())
    }
}
