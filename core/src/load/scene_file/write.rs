//! Writes a scene as a scene file.

use super::place::{camera_entry, light_entry, transform_entry};
use super::schema::{MaterialEntry, MaterialNames, NormalMapEntry, ObjectEntry, SceneFile, TextureEntry};
use super::shape;
use crate::load::error::one_line;
use crate::load::image::Holds;
use crate::pixels::srgb_bytes;
use crate::scene::{Scene, Texture};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{ImageFormat, RgbaImage};
use ron::ser::PrettyConfig;
use std::collections::HashSet;
use std::io::Cursor;
use std::path::Path;

/// Why a scene was not written, in one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SaveError {
    /// The file's extension is neither `.ron` nor `.json`.
    #[error("{file}: scenes are written as .ron or .json: take one of these extensions")]
    UnknownFormat {
        /// The file as it was named.
        file: String,
    },
    /// Something in the scene has no words in a scene file.
    #[error("{file}: {what}: leave it out")]
    Unwritable {
        /// The file as it was named.
        file: String,
        /// What cannot be written, and why.
        what: String,
    },
    /// The file system refused.
    #[error("{file}: cannot be written ({what}): check the folder and its permissions")]
    Refused {
        /// The file as it was named.
        file: String,
        /// What the file system said.
        what: String,
    },
}

/// Writes a scene as `.ron` or `.json`, complete in one file: meshes as numbers, textures as PNG, voxels and volumes
/// packed. The file appears when it is whole. Warp cameras are not written.
///
/// # Errors
/// When the extension is another one, a shape is too large for a text file, or the file cannot be written.
pub fn save(scene: &Scene, path: &Path) -> Result<(), SaveError> {
    let file = || one_line(&path.to_string_lossy());
    let unwritable = |what: String| SaveError::Unwritable { file: file(), what: one_line(&what) };
    let refused =
        |error: std::io::Error| SaveError::Refused { file: file(), what: one_line(&error.to_string()) };
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if !matches!(extension.as_str(), "ron" | "json") {
        return Err(SaveError::UnknownFormat { file: file() });
    }
    let words = SceneFile::of(scene).map_err(unwritable)?;
    let text = if extension == "json" {
        serde_json::to_string_pretty(&words).map_err(|error| unwritable(error.to_string()))?
    } else {
        let config = PrettyConfig::new().depth_limit(4).extensions(super::extensions());
        ron::ser::to_string_pretty(&words, config).map_err(|error| unwritable(error.to_string()))?
    };
    let mut part = path.as_os_str().to_owned();
    part.push(format!(".part{}", std::process::id()));
    let written = std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, path));
    written.map_err(|error| {
        let _ = std::fs::remove_file(&part);
        refused(error)
    })
}

impl SceneFile {
    /// Describes a scene.
    ///
    /// # Errors
    /// Says which object has no words in a scene file.
    pub fn of(scene: &Scene) -> Result<Self, String> {
        let textures = unique_names(scene.textures.iter().map(|t| t.name.as_str()), "texture");
        let materials = unique_names(scene.materials.iter().map(|m| m.name.as_str()), "material");
        let mut file = Self {
            name: scene.name.clone(),
            environment: scene.environment.clone(),
            lights: scene.lights.iter().map(light_entry).collect(),
            cameras: scene.cameras.iter().filter_map(|(name, camera)| camera_entry(name, camera)).collect(),
            ..Self::default()
        };
        for (index, (name, texture)) in textures.iter().zip(&scene.textures).enumerate() {
            let holds = holds(scene, index).map_err(|why| format!("texture `{name}` {why}"))?;
            let entry = TextureEntry::Png { base64: png(texture, holds)?, wrap: texture.wrap };
            file.textures.insert(name.clone(), entry);
        }
        for (name, material) in materials.iter().zip(&scene.materials) {
            let texture = material.texture.and_then(|t| textures.get(t)).cloned();
            let normal_map = material.normal_map.and_then(|map| {
                let texture = textures.get(map.texture)?.clone();
                Some(NormalMapEntry { texture, scale: map.scale })
            });
            file.materials.insert(name.clone(), MaterialEntry::of(material, texture, normal_map));
        }
        for object in &scene.objects {
            let shape =
                shape::entry_of(&object.shape).map_err(|what| format!("object `{}`: {what}", object.name))?;
            let mut names: Vec<String> =
                object.materials.iter().filter_map(|&m| materials.get(m)).cloned().collect();
            let material = if names.len() == 1 {
                MaterialNames::One(names.remove(0))
            } else {
                MaterialNames::Slots(names)
            };
            file.objects.push(ObjectEntry {
                name: object.name.clone(),
                shape,
                transform: transform_entry(&object.world_from_object),
                material,
                visible: object.visible,
                required: object.required,
            });
        }
        Ok(file)
    }
}

/// Names things apart: empty and repeated names get their number.
fn unique_names<'a>(names: impl Iterator<Item = &'a str>, kind: &str) -> Vec<String> {
    let mut taken = HashSet::new();
    names
        .enumerate()
        .map(|(i, name)| {
            let mut unique = one_line(name);
            if unique.is_empty() {
                unique = format!("{kind} {i}");
            }
            while !taken.insert(unique.clone()) {
                unique = format!("{unique} ({i})");
            }
            unique
        })
        .collect()
}

/// Tells what the materials of a scene take a texture for.
fn holds(scene: &Scene, texture: usize) -> Result<Holds, &'static str> {
    let is_color = scene.materials.iter().any(|m| m.texture == Some(texture));
    match scene.materials.iter().any(|m| m.normal_map.is_some_and(|map| map.texture == texture)) {
        true if is_color => Err(super::BOTH),
        true => Ok(Holds::Data),
        false => Ok(Holds::Colors),
    }
}

/// Encodes the full picture of a texture; 8-bit pictures come out as they went in.
fn png(texture: &Texture, holds: Holds) -> Result<String, String> {
    let [width, height] = texture.size();
    let picture = RgbaImage::from_fn(width, height, |x, y| {
        let uv = [(x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32];
        let texel = texture.sample(uv, 0.0);
        let byte = |share: f32| (share * 255.0).round() as u8;
        let color = texel.truncate();
        let [r, g, b] = if holds == Holds::Data { color.to_array().map(byte) } else { srgb_bytes(color) };
        image::Rgba([r, g, b, byte(texel.w)])
    });
    let mut bytes = Vec::new();
    picture.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).map_err(|error| error.to_string())?;
    Ok(STANDARD.encode(bytes))
}
