//! Reads Wavefront OBJ: statements in, [`RawMesh`]es with material names out.
//!
//! An own reader and not a crate, because those at hand give no line with an error, cut polygons as fans (wrong for
//! concave ones), confuse attributes where faces of different forms are mixed, and hold positions in `f32`, in
//! which a model far from the origin has lost its detail before anything can be done about it.
//!
//! Free-form curves, groups, smoothing groups and the like are passed over. Vertex colors (`v x y z r g b`) are taken
//! as sRGB. `v` coordinates of textures count from below and are turned.

use super::parts;
use super::statements::{Face, NONE, Segment, Statements};
use crate::load::error::{Fault, one_line};
use crate::load::limits::Limits;
use crate::load::notes::Notes;
use crate::load::surface::RawMesh;
use crate::load::text::{Words, decode_text, parse_number};
use crate::shade::linear_from_srgb;
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// What an OBJ file says.
pub(super) struct Obj {
    /// One mesh for each `o` statement, with the names of its materials by slot; no name = no `usemtl`.
    pub(super) parts: Vec<ObjPart>,
    /// The arguments of `mtllib`.
    pub(super) libraries: Vec<String>,
}

/// A mesh of an OBJ file.
pub(super) struct ObjPart {
    pub(super) name: String,
    pub(super) mesh: RawMesh,
    pub(super) materials: Vec<Option<String>>,
}

/// Reads an OBJ file.
pub(super) fn read(bytes: &[u8], limits: &Limits, notes: &mut Notes) -> Result<Obj, Fault> {
    let mut statements = Statements::default();
    Reader {
        words: Words::new(bytes)?,
        limits,
        notes,
        to: &mut statements,
        names: HashMap::new(),
        material: 0,
    }
    .read()?;
    if statements.skipped_faces > 0 {
        notes.add(format!("{} faces with fewer than three corners are left out", statements.skipped_faces));
    }
    if statements.points > 0 {
        notes.add("points (`p`) are not drawn");
    }
    statements.forget_absent_attributes(notes);
    statements.check_indices()?;
    let libraries = std::mem::take(&mut statements.libraries);
    Ok(Obj { parts: parts::build(statements, notes), libraries })
}

struct Reader<'a, 'n> {
    words: Words<'a>,
    limits: &'n Limits,
    notes: &'n mut Notes,
    to: &'n mut Statements,
    names: HashMap<Vec<u8>, u16>,
    material: u16,
}

/// Statements that are known and change nothing here.
const PASSED_OVER: [&[u8]; 31] = [
    b"g",
    b"s",
    b"mg",
    b"vp",
    b"cstype",
    b"deg",
    b"bmat",
    b"step",
    b"curv",
    b"curv2",
    b"surf",
    b"parm",
    b"trim",
    b"hole",
    b"scrv",
    b"sp",
    b"end",
    b"con",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"shadow_obj",
    b"trace_obj",
    b"ctech",
    b"stech",
    b"usemap",
    b"maplib",
    b"vw",
    b"t",
    b"call",
];

impl Reader<'_, '_> {
    fn read(&mut self) -> Result<(), Fault> {
        self.to.materials.push(None);
        self.to.parts.push(String::new());
        while self.words.next_line() {
            let line = self.words.line();
            let Some(keyword) = self.words.word() else { continue };
            let done = match keyword {
                b"v" => self.vertex(),
                b"vt" => self.texture_vertex(),
                b"vn" => self.normal(),
                b"f" | b"fo" => self.face(),
                b"l" => self.polyline(),
                b"p" => {
                    self.to.points += 1;
                    Ok(())
                }
                b"o" => {
                    self.part();
                    Ok(())
                }
                b"usemtl" => self.use_material(),
                b"mtllib" => {
                    let name = decode_text(self.words.rest()).into_owned();
                    if self.to.libraries.len() < 64 && !self.to.libraries.contains(&name) {
                        self.to.libraries.push(name);
                    }
                    Ok(())
                }
                known if PASSED_OVER.contains(&known) => Ok(()),
                other => self.unknown(other),
            };
            done.map_err(|fault| fault.at(format_args!("line {line}")))?;
        }
        Ok(())
    }

    fn unknown(&mut self, keyword: &[u8]) -> Result<(), Fault> {
        if keyword.iter().any(|b| !b.is_ascii_graphic()) || keyword.len() > 64 {
            return Err(Fault::malformed("this is no text").advise("check that it is an OBJ file"));
        }
        self.notes.add(format!("statements `{}` are passed over", decode_text(keyword)));
        Ok(())
    }

    fn number(&mut self) -> Result<Option<f64>, Fault> {
        let Some(word) = self.words.word() else { return Ok(None) };
        match parse_number(word) {
            Some((number, true)) => Ok(Some(number)),
            Some((number, false)) => {
                let (word, line) = (one_line(&decode_text(word)), self.words.line());
                self.notes.add(format!("line {line}: `{word}` is read as {number}"));
                Ok(Some(number))
            }
            None => Err(Fault::malformed(format!("`{}` is no number", one_line(&decode_text(word))))),
        }
    }

    fn needed(&mut self) -> Result<f64, Fault> {
        self.number()?.ok_or_else(|| Fault::malformed("a number is missing"))
    }

    fn vertex(&mut self) -> Result<(), Fault> {
        let position = DVec3::new(self.needed()?, self.needed()?, self.needed()?);
        if self.to.positions.len() as u64 >= self.limits.vertices {
            let what = format!("there are more than {} vertices", self.limits.vertices);
            return Err(Fault::over(what, "vertices"));
        }
        let extra = [self.number()?, self.number()?, self.number()?];
        if let [Some(r), Some(g), Some(b)] = extra {
            let color = [r, g, b].map(|c| linear_from_srgb(c.clamp(0.0, 1.0) as f32));
            self.to.colors.resize(self.to.positions.len(), Vec3::ONE);
            self.to.colors.push(Vec3::from_array(color));
        }
        self.to.positions.push(position);
        Ok(())
    }

    fn texture_vertex(&mut self) -> Result<(), Fault> {
        let (u, v) = (self.needed()?, self.number()?.unwrap_or(0.0));
        self.to.uvs.push(Vec2::new(u as f32, (1.0 - v) as f32));
        Ok(())
    }

    fn normal(&mut self) -> Result<(), Fault> {
        let normal = DVec3::new(self.needed()?, self.needed()?, self.needed()?);
        self.to.normals.push(normal.normalize_or_zero().as_vec3());
        Ok(())
    }

    fn face(&mut self) -> Result<(), Fault> {
        let first = self.to.corners.len();
        while let Some(word) = self.words.word() {
            let [v, vt, vn] = self.corner(word)?;
            self.to.push_corner(v, vt, vn);
        }
        let count = self.to.corners.len() - first;
        if count < 3 {
            self.to.drop_corners(first);
            self.to.skipped_faces += 1;
            return Ok(());
        }
        self.to.triangles += count as u64 - 2;
        if self.to.triangles > self.limits.triangles {
            return Err(Fault::over(
                format!("there are more than {} triangles", self.limits.triangles),
                "triangles",
            ));
        }
        let (line, part) = (self.words.line() as u32, (self.to.parts.len() - 1) as u16);
        self.to.faces.push(Face { first: first as u32, line, material: self.material, part });
        Ok(())
    }

    fn polyline(&mut self) -> Result<(), Fault> {
        let (line, part) = (self.words.line() as u32, (self.to.parts.len() - 1) as u16);
        let mut last = None;
        while let Some(word) = self.words.word() {
            let [v, _, _] = self.corner(word)?;
            if let Some(last) = last.replace(v) {
                self.to.segments.push(Segment { ends: [last, v], line, part });
            }
        }
        Ok(())
    }

    /// Reads `v`, `v/vt`, `v//vn` or `v/vt/vn`; empty places are allowed.
    fn corner(&self, word: &[u8]) -> Result<[u32; 3], Fault> {
        let counts = [self.to.positions.len(), self.to.uvs.len(), self.to.normals.len()];
        let mut indices = [NONE; 3];
        for (place, text) in word.split(|&b| b == b'/').enumerate() {
            if place > 2 {
                return Err(Fault::malformed(format!(
                    "corner `{}` has too many parts",
                    one_line(&decode_text(word))
                )));
            }
            if !text.is_empty() {
                indices[place] = index(text, counts[place])?;
            }
        }
        if indices[0] == NONE {
            return Err(Fault::malformed(format!("corner `{}` has no vertex", one_line(&decode_text(word)))));
        }
        Ok(indices)
    }

    fn part(&mut self) {
        let name = one_line(&decode_text(self.words.rest()));
        let part = self.to.parts.len() - 1;
        let used = self.to.faces.last().is_some_and(|f| usize::from(f.part) == part)
            || self.to.segments.last().is_some_and(|s| usize::from(s.part) == part);
        if used && part < usize::from(u16::MAX) {
            self.to.parts.push(name);
        } else {
            self.to.parts[part] = name;
        }
    }

    fn use_material(&mut self) -> Result<(), Fault> {
        let name = self.words.rest();
        if name.is_empty() {
            self.material = 0;
            return Ok(());
        }
        if let Some(&known) = self.names.get(name) {
            self.material = known;
            return Ok(());
        }
        let next = u16::try_from(self.to.materials.len())
            .map_err(|_| Fault::unsupported("there are more than 65,535 materials", "use fewer"))?;
        self.to.materials.push(Some(decode_text(name).into_owned()));
        self.names.insert(name.to_vec(), next);
        self.material = next;
        Ok(())
    }
}

/// Reads an index: from 1 up, or from -1 (the last so far) down. Whether a positive one exists is known only at the end.
fn index(text: &[u8], count: usize) -> Result<u32, Fault> {
    let refuse = |why: &str| Err(Fault::malformed(format!("index `{}` {why}", one_line(&decode_text(text)))));
    let (negative, digits) = match text {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.is_empty() {
        return refuse("is no number");
    }
    let mut number = 0u64;
    for &digit in digits {
        if !digit.is_ascii_digit() {
            return refuse("is no number");
        }
        number = number.saturating_mul(10).saturating_add(u64::from(digit - b'0'));
    }
    match (number, negative) {
        (0, _) => refuse("is illegal, indices count from 1"),
        (back, true) if back > count as u64 => refuse("points before the first"),
        (back, true) => Ok((count as u64 - back) as u32),
        (forward, false) if forward >= u64::from(NONE) => refuse("is out of range"),
        (forward, false) => Ok((forward - 1) as u32),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Obj, Fault> {
        read(text.as_bytes(), &Limits::default(), &mut Notes::default())
    }

    const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n";

    #[test]
    fn mixed_face_forms_keep_their_attributes() {
        let obj = read_text(&format!(
            "{CORNERS}f 1 2 3\nf 1/1 2/2 3/3\nf 1//1 2//1 3//1\nf -4/1/1 -3/2/1 -2/3/-1 4\n"
        ));
        let mesh = &obj.unwrap().parts[0].mesh;
        assert_eq!(mesh.triangles.len(), 5);
        assert_eq!((mesh.uvs.len(), mesh.normals.len()), (mesh.positions.len(), mesh.positions.len()));
        let [a, b, c] = mesh.triangles[1].map(|i| mesh.uvs[i as usize]);
        assert_eq!([a, b, c], [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.0)]);
        assert_eq!(mesh.normals[mesh.triangles[2][0] as usize], Vec3::Z);
    }

    #[test]
    fn wrong_indices_are_named_with_their_line() {
        for (face, message) in [
            ("f 1 2 9", "line 9: vertex 9 of 4"),
            ("f 1/1 2/2 3/7", "line 9: texture vertex 7 of 3"),
            ("f 1//1 2//1 3//2", "line 9: normal 2 of 1"),
            ("f 1 2 0", "line 9: index `0` is illegal, indices count from 1"),
            ("f 1 2 -5", "line 9: index `-5` points before the first"),
            ("f 1 2 4294967297", "line 9: index `4294967297` is out of range"),
            ("l 1 5", "line 9: vertex 5 of 4"),
            ("f 1 2 x", "line 9: index `x` is no number"),
            ("f 1/1/1/1 2 3", "line 9: corner `1/1/1/1` has too many parts"),
            ("v 1 2", "line 9: a number is missing"),
        ] {
            let fault = read_text(&format!("{CORNERS}{face}\n")).err().unwrap();
            assert_eq!(fault.what(), message);
        }
    }

    #[test]
    fn objects_and_materials_are_kept_apart() {
        let text = format!(
            "{CORNERS}o one\nusemtl red paint\nf 1 2 3\nusemtl blue\nf 1 3 4\no two\nf 1 2 4\nl 1 2 3\n"
        );
        let parts = read_text(&text).unwrap().parts;
        assert_eq!(parts.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["one", "two"]);
        assert_eq!(parts[0].materials, [Some("red paint".to_owned()), Some("blue".to_owned())]);
        assert_eq!(parts[0].mesh.slots, [0, 1]);
        assert_eq!(parts[1].materials, [Some("blue".to_owned())]);
        assert_eq!((parts[1].mesh.triangles.len(), parts[1].mesh.segments.len()), (1, 2));
    }

    #[test]
    fn faces_may_come_before_their_vertices() {
        assert_eq!(read_text(&format!("f 1 2 3\n{CORNERS}")).unwrap().parts[0].mesh.triangles.len(), 1);
    }
}
