//! Flattens the scene graph of a `.vox` file into placed models.

use super::chunks::{Chunks, Dict, Node, at_frame};
use crate::load::error::{Fault, one_line};
use crate::load::notes::Notes;
use crate::load::text::decode_text;
use glam::{DAffine3, DMat3, DVec3};
use std::collections::HashSet;

/// A model shown at a place; space is the file's, z up.
pub(super) struct Instance {
    pub(super) model: usize,
    pub(super) name: Option<String>,
    pub(super) world_from_pivot: DAffine3,
    /// Whether the node or one above it, or a layer, is hidden.
    pub(super) is_hidden: bool,
}

/// A node to be visited.
struct Open {
    node: i32,
    world_from_parent: DAffine3,
    name: Option<String>,
    is_hidden: bool,
}

/// Walks the graph as it is at a frame, with a stack of its own. Transforms and groups may be reached once only, which
/// leaves neither loops nor sharing that multiplies; shapes may be shared.
pub(super) fn flatten(
    chunks: &Chunks<'_>,
    frame: u32,
    most: u64,
    notes: &mut Notes,
) -> Result<Vec<Instance>, Fault> {
    let mut instances = Vec::new();
    let mut visited = HashSet::new();
    let first = root(chunks, notes);
    let mut open =
        vec![Open { node: first, world_from_parent: DAffine3::IDENTITY, name: None, is_hidden: false }];
    let mut note_frames = |count: usize| {
        if count > 1 {
            notes.add(format!("the file moves: frame {frame} is shown (`--frame`)"));
        }
    };
    let mut senseless = false;
    while let Some(Open { node: id, world_from_parent, name, is_hidden }) = open.pop() {
        let node =
            chunks.nodes.get(&id).ok_or_else(|| Fault::malformed(format!("node {id} is not there")))?;
        if !matches!(node, Node::Shape { .. }) && !visited.insert(id) {
            return Err(Fault::malformed(format!(
                "node {id} is reached twice: the scene graph is not a tree"
            )));
        }
        let (Node::Transform { attributes, .. }
        | Node::Group { attributes, .. }
        | Node::Shape { attributes, .. }) = node;
        let name = name_of(attributes).or(name);
        let is_hidden = is_hidden || attributes.is_hidden();
        match node {
            Node::Transform { child, layer, frames, .. } => {
                let is_hidden = is_hidden || chunks.layers.get(layer).is_some_and(Dict::is_hidden);
                note_frames(frames.len());
                let placed = at_frame(frames, frame, |dict| dict).map_or(Some(DAffine3::IDENTITY), local);
                senseless |= placed.is_none();
                let world_from_parent = world_from_parent * placed.unwrap_or(DAffine3::IDENTITY);
                open.push(Open { node: *child, world_from_parent, name, is_hidden });
            }
            Node::Group { children, .. } => {
                let below = |&node| Open { node, world_from_parent, name: name.clone(), is_hidden };
                open.extend(children.iter().rev().map(below));
            }
            Node::Shape { models, .. } => {
                note_frames(models.len());
                let model = at_frame(models, frame, |(_, dict)| dict).map_or(-1, |(model, _)| *model);
                let known = usize::try_from(model).ok().filter(|&m| m < chunks.models.len());
                let Some(model) = known else {
                    let count = chunks.models.len();
                    return Err(Fault::malformed(format!(
                        "node {id}: there is no model {model} (of {count})"
                    )));
                };
                if instances.len() as u64 >= most {
                    return Err(Fault::over(format!("more than {most} models are placed"), "instances"));
                }
                instances.push(Instance { model, name, world_from_pivot: world_from_parent, is_hidden });
            }
        }
    }
    if senseless {
        notes.add("a transform that makes no sense is left out");
    }
    if instances.iter().any(|instance| instance.is_hidden) {
        notes.add("hidden nodes and layers are invisible objects");
    }
    Ok(instances)
}

/// The root is node 0; a file without it begins at the smallest node.
fn root(chunks: &Chunks<'_>, notes: &mut Notes) -> i32 {
    let first = chunks.nodes.keys().min().copied().unwrap_or(0);
    if first != 0 {
        notes.add(format!("the scene graph has no node 0, node {first} is taken as its root"));
    }
    first
}

fn name_of(attributes: &Dict<'_>) -> Option<String> {
    let name = one_line(&decode_text(attributes.get("_name")?));
    (!name.is_empty()).then_some(name)
}

/// Returns a transform, nothing where it makes no sense.
fn local(frame: &Dict<'_>) -> Option<DAffine3> {
    let rotation = frame.get("_r").map_or(Some(DMat3::IDENTITY), rotation_from_text)?;
    let translation = frame.get("_t").map_or(Some(DVec3::ZERO), vector_from_text)?;
    Some(DAffine3::from_mat3_translation(rotation, translation))
}

/// Decodes a signed permutation: bits 0-1 and 2-3 say in which columns the first two rows have their one, bits 4 to 6
/// which rows are negative.
fn rotation_from_text(text: &[u8]) -> Option<DMat3> {
    let code: u8 = std::str::from_utf8(text).ok()?.trim().parse().ok()?;
    let (first, second) = (usize::from(code & 3), usize::from(code >> 2 & 3));
    if first > 2 || second > 2 || first == second {
        return None;
    }
    let mut rows = [[0.0; 3]; 3];
    for (row, column) in [first, second, 3 - first - second].into_iter().enumerate() {
        rows[row][column] = if code >> (4 + row) & 1 == 1 { -1.0 } else { 1.0 };
    }
    Some(DMat3::from_cols_array_2d(&rows).transpose())
}

fn vector_from_text(text: &[u8]) -> Option<DVec3> {
    let text = std::str::from_utf8(text).ok()?;
    let mut numbers = text.split_ascii_whitespace().map(|word| word.parse::<i32>().ok().map(f64::from));
    Some(DVec3::new(numbers.next()??, numbers.next()??, numbers.next()??))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_are_decoded_as_the_format_says() {
        // the example of the format's description: first row 0 1 0, second 0 0 -1, third -1 0 0
        let code = 1 | 2 << 2 | 1 << 5 | 1 << 6;
        let rotation = rotation_from_text(code.to_string().as_bytes()).unwrap();
        assert_eq!(rotation * DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, -3.0, -1.0));
        assert_eq!(rotation_from_text(b"4"), Some(DMat3::IDENTITY));
        for wrong in [&b"255"[..], b"0", b"3", b"300", b"x", b"-1"] {
            assert_eq!(rotation_from_text(wrong), None);
        }
    }
}
