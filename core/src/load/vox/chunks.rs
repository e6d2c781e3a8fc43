//! Reads the chunks of a `.vox` file: sizes, voxels, palette, materials, layers and the nodes of the scene graph.
//!
//! Every count is compared with the bytes that are left before anything is built from it.

use crate::load::error::Fault;
use crate::load::notes::Notes;
use std::collections::HashMap;

/// Longest edge of a model. The editor stops at 256, and coordinates are bytes; other writers claim more.
const LONGEST_EDGE: u32 = 2048;

/// A file taken apart; text and voxels still lie in the file's bytes.
#[derive(Default)]
pub(super) struct Chunks<'a> {
    pub(super) models: Vec<Model<'a>>,
    /// Colors 1 to 255 in places 0 to 254, as in the file.
    pub(super) palette: Option<&'a [u8]>,
    pub(super) materials: HashMap<i32, Dict<'a>>,
    /// Old material chunks: type, weight.
    pub(super) old_materials: HashMap<i32, (u32, f32)>,
    pub(super) layers: HashMap<i32, Dict<'a>>,
    pub(super) nodes: HashMap<i32, Node<'a>>,
}

/// A model: its size (z is up) and four bytes a voxel, `x y z color`.
pub(super) struct Model<'a> {
    pub(super) size: [u32; 3],
    pub(super) voxels: &'a [u8],
}

/// Attributes of a node, layer or material.
#[derive(Default)]
pub(super) struct Dict<'a>(Vec<(&'a [u8], &'a [u8])>);

impl<'a> Dict<'a> {
    pub(super) fn get(&self, key: &str) -> Option<&'a [u8]> {
        self.0.iter().find(|(k, _)| *k == key.as_bytes()).map(|(_, value)| *value)
    }

    pub(super) fn number(&self, key: &str) -> Option<f32> {
        let value: f32 = std::str::from_utf8(self.get(key)?).ok()?.trim().parse().ok()?;
        value.is_finite().then_some(value)
    }

    pub(super) fn is_hidden(&self) -> bool {
        self.get("_hidden") == Some(b"1")
    }
}

/// A node of the scene graph.
pub(super) enum Node<'a> {
    /// Places its child, at each frame that is named elsewhere.
    Transform { attributes: Dict<'a>, child: i32, layer: i32, frames: Vec<Dict<'a>> },
    /// Holds others.
    Group { attributes: Dict<'a>, children: Vec<i32> },
    /// Shows a model, from each frame that is named on another.
    Shape { attributes: Dict<'a>, models: Vec<(i32, Dict<'a>)> },
}

/// Returns what holds at a frame: the last that begins at it or before, else the first. What does not name its frame
/// (`_f`) has that of its place in the list.
pub(super) fn at_frame<T>(list: &[T], frame: u32, dict: impl Fn(&T) -> &Dict<'_>) -> Option<&T> {
    let begins = |i: usize, item: &T| dict(item).number("_f").unwrap_or(i as f32);
    let begun = list.iter().enumerate().filter(|(i, item)| begins(*i, item) <= frame as f32);
    // Of equals the first.
    let last = begun.reduce(
        |best, other| {
            if begins(other.0, other.1) > begins(best.0, best.1) { other } else { best }
        },
    );
    last.map(|(_, item)| item).or(list.first())
}

/// Reads all chunks.
pub(super) fn read<'a>(bytes: &'a [u8], notes: &mut Notes) -> Result<Chunks<'a>, Fault> {
    let mut file = Cursor { bytes, at: 0, end: bytes.len() };
    if file.take(4)? != b"VOX " {
        return Err(
            Fault::malformed("byte 0: it does not begin with `VOX `").advise("check that it is a .vox file")
        );
    }
    let version = file.i32()?;
    if !(150..=200).contains(&version) {
        notes.add(format!("the file has version {version}, it is read like 200"));
    }
    let (kind, _, children) = file.chunk()?;
    if kind != b"MAIN" {
        return Err(Fault::malformed(format!("byte 8: the first chunk is {}, not MAIN", shown(kind))));
    }
    let mut chunks = Chunks::default();
    let (mut rest, mut size) = (children, None);
    while rest.at < rest.end {
        let at = rest.at;
        let (kind, content, _) = rest.chunk()?;
        chunks
            .add(kind, content, &mut size, notes)
            .map_err(|fault| fault.at(format_args!("chunk {} at byte {at}", shown(kind))))?;
    }
    if size.is_some() {
        notes.add("the last SIZE has no XYZI and is left out");
    }
    Ok(chunks)
}

fn shown(kind: &[u8]) -> String {
    String::from_utf8_lossy(kind).into_owned()
}

impl<'a> Chunks<'a> {
    fn add(
        &mut self,
        kind: &[u8],
        mut c: Cursor<'a>,
        size: &mut Option<[u32; 3]>,
        notes: &mut Notes,
    ) -> Result<(), Fault> {
        match kind {
            b"SIZE" => {
                let edges = [c.i32()?, c.i32()?, c.i32()?];
                if !edges.iter().all(|&e| (1..=LONGEST_EDGE as i32).contains(&e)) {
                    let [x, y, z] = edges;
                    return Err(Fault::malformed(format!(
                        "a model of {x}x{y}x{z}, edges must be 1 to {LONGEST_EDGE}"
                    )));
                }
                if size.replace(edges.map(|e| e as u32)).is_some() {
                    notes.add("a SIZE without XYZI is left out");
                }
            }
            b"XYZI" => {
                let size = size.take().ok_or_else(|| Fault::malformed("voxels come before their SIZE"))?;
                let count = c.u32()?;
                let there = (c.end - c.at) / 4;
                if count as usize > there {
                    return Err(Fault::malformed(format!("{count} voxels are promised, {there} are there")));
                }
                if (count as usize) < there {
                    notes.add(format!(
                        "{} bytes behind the voxels are left out",
                        (there - count as usize) * 4
                    ));
                }
                self.models.push(Model { size, voxels: c.take(count as usize * 4)? });
            }
            b"RGBA" => self.palette = Some(c.take((c.end - c.at).min(1024))?),
            b"MATL" => {
                let id = c.i32()?;
                self.materials.insert(id, c.dict()?);
            }
            b"MATT" => {
                let (id, kind, weight) = (c.i32()?, c.u32()?, f32::from_bits(c.u32()?));
                self.old_materials.insert(id, (kind, weight));
            }
            b"LAYR" => {
                let id = c.i32()?;
                self.layers.insert(id, c.dict()?);
            }
            b"nTRN" | b"nGRP" | b"nSHP" => {
                let id = c.i32()?;
                let node = c.node(kind)?;
                if id < 0 || self.nodes.insert(id, node).is_some() {
                    return Err(Fault::malformed(format!(
                        "node {id} is there twice, or its number is negative"
                    )));
                }
            }
            // PACK repeats the number of models; IMAP only orders the editor's palette window, colors keep their
            // numbers; cameras and render settings are the editor's own.
            _ => {}
        }
        Ok(())
    }
}

/// A cursor over a part of the file.
#[derive(Clone, Copy)]
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    end: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        if count > self.end - self.at {
            let left = self.end - self.at;
            return Err(Fault::malformed(format!(
                "byte {}: {count} bytes are needed, {left} are left",
                self.at
            )));
        }
        self.at += count;
        Ok(&self.bytes[self.at - count..self.at])
    }

    fn u32(&mut self) -> Result<u32, Fault> {
        let b = self.take(4)?;
        Ok(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    }

    fn i32(&mut self) -> Result<i32, Fault> {
        Ok(self.u32()? as i32)
    }

    /// Reads a count of things that take at least `each` bytes.
    fn count(&mut self, each: usize) -> Result<usize, Fault> {
        let count = self.u32()? as usize;
        if count > (self.end - self.at) / each {
            return Err(Fault::malformed(format!(
                "byte {}: {count} entries do not fit into the chunk",
                self.at - 4
            )));
        }
        Ok(count)
    }

    /// Reads a chunk: its name, its content, and its children, which are passed over.
    fn chunk(&mut self) -> Result<(&'a [u8], Cursor<'a>, Cursor<'a>), Fault> {
        let kind = self.take(4)?;
        let (content, children) = (self.u32()? as usize, self.u32()? as usize);
        let first = self.at;
        self.take(content)?;
        let middle = self.at;
        self.take(children)?;
        let part = |at, end| Cursor { bytes: self.bytes, at, end };
        Ok((kind, part(first, middle), part(middle, self.at)))
    }

    fn text(&mut self) -> Result<&'a [u8], Fault> {
        let length = self.count(1)?;
        self.take(length)
    }

    fn dict(&mut self) -> Result<Dict<'a>, Fault> {
        let count = self.count(8)?;
        (0..count).map(|_| Ok((self.text()?, self.text()?))).collect::<Result<_, _>>().map(Dict)
    }

    fn node(&mut self, kind: &[u8]) -> Result<Node<'a>, Fault> {
        let attributes = self.dict()?;
        Ok(match kind {
            b"nTRN" => {
                let (child, _, layer) = (self.i32()?, self.i32()?, self.i32()?);
                let count = self.count(4)?;
                let frames = (0..count).map(|_| self.dict()).collect::<Result<_, _>>()?;
                Node::Transform { attributes, child, layer, frames }
            }
            b"nGRP" => {
                let count = self.count(4)?;
                let children = (0..count).map(|_| self.i32()).collect::<Result<_, _>>()?;
                Node::Group { attributes, children }
            }
            _ => {
                let count = self.count(8)?;
                if count == 0 {
                    return Err(Fault::malformed("a shape without a model"));
                }
                let models = (0..count).map(|_| Ok((self.i32()?, self.dict()?))).collect::<Result<_, _>>()?;
                Node::Shape { attributes, models }
            }
        })
    }
}
