//! Reads STL, binary or text. Corners at the same position become one vertex; the file's face normals are not
//! needed, since normals are generated with creases.

use super::error::{Fault, one_line};
use super::source::Source;
use super::surface::RawMesh;
use super::text::{Words, decode_text, parse_number};
use crate::scene::Scene;
use glam::DVec3;

/// Bytes in front of the triangles of a binary file: a comment of 80, and their number.
const HEADER: usize = 84;
/// Bytes of a triangle: a normal, three corners, an attribute.
const TRIANGLE: usize = 50;

/// Loads an STL file.
pub(super) fn load(source: &mut Source<'_>) -> Result<Scene, Fault> {
    let bytes = std::mem::take(&mut source.bytes);
    let mut mesh = if is_binary(&bytes) { read_binary(&bytes, source)? } else { read_text(&bytes, source)? };
    drop(bytes);
    mesh.weld();
    Ok(super::scene_of_mesh(mesh, source))
}

/// Binary files may begin with `solid` like text; the length decides.
fn is_binary(bytes: &[u8]) -> bool {
    let fits = promised(bytes).is_some_and(|n| bytes.len() >= HEADER + n * TRIANGLE);
    let looks_like_text =
        bytes.trim_ascii_start().starts_with(b"solid") && !bytes[..bytes.len().min(1024)].contains(&0);
    !looks_like_text || (fits && promised(bytes) == Some((bytes.len() - HEADER) / TRIANGLE))
}

fn promised(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..HEADER)?;
    Some(u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize)
}

fn check_count(count: usize, source: &Source<'_>) -> Result<(), Fault> {
    let most = source.limits.triangles;
    if count as u64 > most || count as u64 * 3 > u64::from(u32::MAX) {
        return Err(Fault::over(format!("there are more than {most} triangles"), "triangles"));
    }
    Ok(())
}

fn read_binary(bytes: &[u8], source: &mut Source<'_>) -> Result<RawMesh, Fault> {
    let count = promised(bytes)
        .ok_or_else(|| Fault::malformed(format!("{} bytes, the header alone has {HEADER}", bytes.len())))?;
    let there = (bytes.len() - HEADER) / TRIANGLE;
    if count > there {
        return Err(Fault::malformed(format!("byte 80: {count} triangles are promised, {there} are there")));
    }
    if bytes.len() > HEADER + count * TRIANGLE {
        source.notes.add(format!(
            "{} bytes behind the triangles are left out",
            bytes.len() - HEADER - count * TRIANGLE
        ));
    }
    check_count(count, source)?;
    let mut mesh = RawMesh { positions: Vec::with_capacity(count * 3), ..RawMesh::default() };
    for triangle in bytes[HEADER..].chunks_exact(TRIANGLE).take(count) {
        for corner in triangle[12..48].chunks_exact(12) {
            let number = |at: usize| {
                f64::from(f32::from_le_bytes([corner[at], corner[at + 1], corner[at + 2], corner[at + 3]]))
            };
            mesh.positions.push(DVec3::new(number(0), number(4), number(8)));
        }
    }
    mesh.triangles = (0..count as u32).map(|t| [t * 3, t * 3 + 1, t * 3 + 2]).collect();
    Ok(mesh)
}

fn read_text(bytes: &[u8], source: &Source<'_>) -> Result<RawMesh, Fault> {
    let mut words = Words::new(bytes)?;
    let mut mesh = RawMesh::default();
    let mut corners = Vec::new();
    while words.next_line() {
        let line = words.line();
        let fail = |what: String| Fault::malformed(format!("line {line}: {what}"));
        match words.word() {
            Some(word) if word.eq_ignore_ascii_case(b"vertex") => {
                let mut position = [0.0; 3];
                for value in &mut position {
                    let word = words.word().ok_or_else(|| fail("a number is missing".to_owned()))?;
                    let (number, _) = parse_number(word)
                        .ok_or_else(|| fail(format!("`{}` is no number", one_line(&decode_text(word)))))?;
                    *value = number;
                }
                corners.push(mesh.positions.len() as u32);
                mesh.positions.push(DVec3::from_array(position));
            }
            Some(word) if word.eq_ignore_ascii_case(b"endloop") || word.eq_ignore_ascii_case(b"endfacet") => {
                // some writers put polygons here; the format knows convex ones only
                (1..corners.len().saturating_sub(1))
                    .for_each(|i| mesh.triangles.push([corners[0], corners[i], corners[i + 1]]));
                corners.clear();
                check_count(mesh.triangles.len().max(mesh.positions.len() / 3), source)?;
            }
            _ => {}
        }
    }
    if !corners.is_empty() {
        return Err(Fault::malformed(format!("line {}: the last facet has no end", words.line())));
    }
    Ok(mesh)
}
