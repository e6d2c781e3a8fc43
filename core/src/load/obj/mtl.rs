//! Reads Wavefront material libraries.
//!
//! `Kd` is the base color as it stands: the specification calls it a reflectivity, which is linear. `Ks` becomes its
//! mean, since highlights are white here; `Ka` is passed over (ambient light is relative to the base color), and so is
//! every map but `map_Kd`.

use crate::load::error::{Fault, one_line};
use crate::load::notes::Notes;
use crate::load::text::{Words, decode_text, parse_number};
use crate::scene::{AlphaMode, Material, TextureWrap};
use glam::Vec3;
use std::collections::BTreeSet;

/// A material of a library; its texture is still a reference.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LibraryMaterial {
    pub(super) name: String,
    pub(super) material: Material,
    pub(super) texture: Option<TextureReference>,
    /// A picture of normals, as the extension for physically based materials has it.
    pub(super) normals: Option<TextureReference>,
}

/// A reference to a picture.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct TextureReference {
    pub(super) file: String,
    pub(super) wrap: [TextureWrap; 2],
}

/// Reads a library; statements that are not understood are passed over, numbers that are none keep the default.
pub(super) fn read(bytes: &[u8], notes: &mut Notes) -> Result<Vec<LibraryMaterial>, Fault> {
    let mut words = Words::new(bytes)?;
    let mut list: Vec<LibraryMaterial> = Vec::new();
    let mut unused = BTreeSet::new();
    let mut opacity_map = None;
    while words.next_line() {
        let Some(keyword) = words.word() else { continue };
        let keyword = decode_text(keyword).to_ascii_lowercase();
        if keyword == "newmtl" {
            let name = decode_text(words.rest()).into_owned();
            list.push(LibraryMaterial { name, material: blank(), texture: None, normals: None });
            opacity_map = None;
            continue;
        }
        let Some(current) = list.last_mut() else { continue };
        match keyword.as_str() {
            "kd" => current.material.base_color = color(&mut words, current.material.base_color),
            "ks" => current.material.specular = color(&mut words, Vec3::ZERO).element_sum() / 3.0,
            "ke" => current.material.emission = color(&mut words, Vec3::ZERO),
            "ns" => current.material.shininess = number(&mut words).map_or(32.0, |n| n.clamp(1.0, 1024.0)),
            "d" => current.material.opacity = share(&mut words, 1.0),
            "tr" => current.material.opacity = 1.0 - share(&mut words, 0.0),
            "map_kd" => current.texture = texture(words.rest()),
            "norm" => current.normals = texture(words.rest()),
            "map_d" => opacity_map = texture(words.rest()),
            map if map.starts_with("map_") || matches!(map, "bump" | "disp" | "decal" | "refl") => {
                unused.insert(map.to_owned());
            }
            _ => {}
        }
        if let (Some(mask), Some(picture)) = (&opacity_map, &current.texture)
            && mask.file == picture.file
        {
            current.material.alpha = AlphaMode::Mask(0.5);
        }
    }
    if !unused.is_empty() {
        let list: Vec<&str> = unused.iter().map(String::as_str).collect();
        notes.add(format!("maps that are not used: {}", list.join(", ")));
    }
    for entry in &mut list {
        finish(entry, notes);
    }
    Ok(list)
}

/// A material before any statement: OBJ files that give no `Ks` mean no highlight.
fn blank() -> Material {
    Material { specular: 0.0, ..Material::default() }
}

fn finish(entry: &mut LibraryMaterial, notes: &mut Notes) {
    let name = one_line(&entry.name);
    entry.material.name.clone_from(&name);
    if entry.texture.is_some() && entry.material.base_color.max_element() <= 0.0 {
        // Some exporters write a black Kd beside a map, and mean the map alone.
        entry.material.base_color = Vec3::ONE;
        notes.add(format!("material `{name}`: Kd is black beside a map and is taken as white"));
    }
}

fn number(words: &mut Words<'_>) -> Option<f32> {
    let (value, _) = parse_number(words.word()?)?;
    value.is_finite().then_some(value as f32)
}

fn share(words: &mut Words<'_>, default: f32) -> f32 {
    // `d -halo 0.5` has a word in between
    number(words).or_else(|| number(words)).unwrap_or(default).clamp(0.0, 1.0)
}

/// Reads one or three numbers; `spectral` and `xyz` colors keep the default.
fn color(words: &mut Words<'_>, default: Vec3) -> Vec3 {
    let Some(r) = number(words) else { return default };
    let g = number(words).unwrap_or(r);
    let b = number(words).unwrap_or(g);
    Vec3::new(r, g, b).max(Vec3::ZERO)
}

/// Reads the arguments of a map: options, then a file name that may hold spaces.
fn texture(arguments: &[u8]) -> Option<TextureReference> {
    let text = decode_text(arguments);
    let mut rest = text.trim();
    let mut wrap = [TextureWrap::Repeat; 2];
    while let Some(option) = rest.strip_prefix('-') {
        let (name, mut after) = next_word(option);
        // Options take a fixed number of words, or up to three numbers.
        let (fixed, numbers) = match name {
            "s" | "o" | "t" => (0, 3),
            "mm" => (2, 0),
            "blendu" | "blendv" | "cc" | "clamp" | "bm" | "boost" | "texres" | "imfchan" | "type"
            | "colorspace" => (1, 0),
            _ => break,
        };
        if name == "clamp" && next_word(after).0 == "on" {
            wrap = [TextureWrap::Clamp; 2];
        }
        for _ in 0..fixed {
            after = next_word(after).1;
        }
        for _ in 0..numbers {
            let (word, next) = next_word(after);
            if word.parse::<f32>().is_err() || next.is_empty() {
                break;
            }
            after = next;
        }
        rest = after;
    }
    let file = rest.trim().trim_matches('"').to_owned();
    (!file.is_empty()).then_some(TextureReference { file, wrap })
}

fn next_word(text: &str) -> (&str, &str) {
    let text = text.trim_start();
    let end = text.find(char::is_whitespace).unwrap_or(text.len());
    (&text[..end], text[end..].trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statements_become_materials() {
        let text = b"Kd 9 9 9\nnewmtl red paint\nKd 0.8 0.1 0\nKs 0.2 0.4 0.6\nNs 2000\nTr 0.25\nKe 3 0 0\nillum 2\n\
            newmtl wood\nKd 0 0 0\nmap_Kd -s 2 2 -clamp on .\\my wood.png\nmap_Bump b.png\nnorm turned.png\n";
        let mut notes = Notes::default();
        let list = read(text, &mut notes).unwrap();
        let red = &list[0].material;
        assert_eq!(
            (list.len(), red.name.as_str(), red.base_color),
            (2, "red paint", Vec3::new(0.8, 0.1, 0.0))
        );
        assert!((red.specular - 0.4).abs() < 1e-6);
        assert_eq!((red.shininess, red.opacity, red.emission.x), (1024.0, 0.75, 3.0));
        let texture = list[1].texture.clone().unwrap();
        assert_eq!((texture.file.as_str(), texture.wrap[0]), (".\\my wood.png", TextureWrap::Clamp));
        assert_eq!(list[1].normals.as_ref().unwrap().file, "turned.png");
        assert_eq!(list[1].material.base_color, Vec3::ONE);
        assert!(notes.into_lines()[0].contains("map_bump"));
    }

    #[test]
    fn a_file_whose_name_begins_with_a_digit_is_not_an_option() {
        assert_eq!(texture(b"-o 1 2 3.png").unwrap().file, "3.png");
        assert_eq!(texture(b"-s 1 1 1 2 wood.png").unwrap().file, "2 wood.png");
        assert_eq!(texture(b"-mm 0 1"), None);
    }
}
