//! Turns glTF materials into those of the scene: metal and roughness become a highlight and a mirror.
//!
//! | glTF | here |
//! |---|---|
//! | base color, its texture | base color, texture |
//! | roughness `r` | shininess `2 / r^4 - 2`, 1 to 1024 (B. Karis, *Specular BRDF Reference*, 2013) |
//! | metal `m`, `r` | specular `F0 (shininess + 8) / 8 (1 - r^2)`, at most 1, `F0 = mix(0.04, 0.3, m)`: the peak of the normalized lobe, fading where it would veil the whole surface in white |
//! | metal `m`, `r` below 0.4 | reflectivity `0.6 m (1 - r / 0.4)` |
//! | emissive factor x strength | emission; with an emissive texture none, since a factor alone would light everything |
//! | alpha mode, cutoff | alpha, opacity |
//! | normal texture, scale | normal map |
//! | unlit | diffuse only |
//!
//! Normal textures turn the shading normals; the tangents of a file are not read, those of triangles serve. Occlusion,
//! metal and emissive textures are left out, with a note, as are normal textures with coordinates of their own.

use super::data::{Data, read_uri};
use super::document::{Document, MaterialEntry, TextureInfo, TextureTransform};
use crate::load::error::{Fault, one_line};
use crate::load::image::{Holds, TextureMaker};
use crate::load::source::Source;
use crate::scene::{AlphaMode, Material, NormalMap, Scene, TextureWrap};
use glam::{Vec2, Vec3};
use std::borrow::Cow;
use std::collections::HashMap;

/// The materials and textures of a document, put into the scene when they are first used.
pub(super) struct Materials<'a> {
    document: &'a Document,
    data: &'a Data<'a>,
    maker: TextureMaker<'a>,
    placed: HashMap<Option<usize>, usize>,
    textures: HashMap<(usize, [TextureWrap; 2], Holds), usize>,
    /// Receives materials and textures.
    pub(super) scene: Scene,
}

/// Which texture coordinates a material reads, and what it does to them.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct UvSource {
    /// Whether the material has a texture at all.
    pub(super) wanted: bool,
    pub(super) set: u32,
    transform: Option<TextureTransform>,
}

impl UvSource {
    fn of(info: &TextureInfo) -> Self {
        let transform = info.extensions.transform;
        Self { wanted: true, set: transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord), transform }
    }

    /// Applies `KHR_texture_transform`: scale, then rotate, then move.
    pub(super) fn transform(&self, uv: Vec2) -> Vec2 {
        let Some(t) = self.transform else { return uv };
        let scaled = uv * Vec2::from_array(t.scale);
        let (sin, cos) = t.rotation.sin_cos();
        Vec2::new(cos * scaled.x + sin * scaled.y, cos * scaled.y - sin * scaled.x)
            + Vec2::from_array(t.offset)
    }
}

impl<'a> Materials<'a> {
    pub(super) fn new(document: &'a Document, data: &'a Data<'a>, source: &Source<'a>) -> Self {
        Self {
            document,
            data,
            maker: TextureMaker::new(source.limits),
            placed: HashMap::new(),
            textures: HashMap::new(),
            scene: Scene::default(),
        }
    }

    /// Tells which texture coordinates a material reads.
    pub(super) fn uv_source(&self, material: Option<usize>) -> UvSource {
        let entry = material.map(|m| &self.document.materials[m]);
        let info = entry.and_then(|entry| {
            entry.pbr_metallic_roughness.base_color_texture.as_ref().or(entry.normal_texture.as_ref())
        });
        info.map_or(UvSource { wanted: false, set: 0, transform: None }, UvSource::of)
    }

    /// Returns the scene's index of a material.
    pub(super) fn place(&mut self, material: Option<usize>, source: &mut Source<'_>) -> usize {
        if let Some(&known) = self.placed.get(&material) {
            return known;
        }
        let made = match material {
            None => Material::default(),
            Some(index) => {
                let entry = &self.document.materials[index];
                let mut made = convert(entry, index);
                if let Some(info) = &entry.pbr_metallic_roughness.base_color_texture {
                    made.texture = Some(self.texture(info, Holds::Colors, source));
                }
                let fits = |info: &&TextureInfo| UvSource::of(info) == self.uv_source(material);
                if let Some(info) = entry.normal_texture.as_ref().filter(fits) {
                    let texture = self.texture(info, Holds::Data, source);
                    let scale = finite(info.scale.unwrap_or(1.0), 1.0).clamp(-100.0, 100.0);
                    made.normal_map = Some(NormalMap { texture, scale });
                }
                note_what_is_left_out(entry, made.normal_map.is_some(), source);
                made
            }
        };
        let index = self.scene.add_material(made);
        self.placed.insert(material, index);
        index
    }

    fn texture(&mut self, info: &TextureInfo, holds: Holds, source: &mut Source<'_>) -> usize {
        let texture = &self.document.textures[info.index];
        let wrap = texture.sampler.map_or([TextureWrap::Repeat; 2], |s| {
            let sampler = &self.document.samplers[s];
            [sampler.wrap_s, sampler.wrap_t].map(|code| match code {
                33071 => TextureWrap::Clamp,
                33648 => TextureWrap::Mirror,
                _ => TextureWrap::Repeat,
            })
        });
        // A texture without source has it in an extension (KTX2, WebP): the placeholder stands for it.
        let image = texture.source.unwrap_or(usize::MAX);
        if let Some(&known) = self.textures.get(&(image, wrap, holds)) {
            return known;
        }
        let name = self.image_name(image);
        let bytes = self.image_bytes(image, source);
        let made = self.maker.make(&name, bytes, (wrap, holds), &mut source.notes);
        let index = self.scene.add_texture(made);
        self.textures.insert((image, wrap, holds), index);
        index
    }

    fn image_name(&self, image: usize) -> String {
        let entry = self.document.images.get(image);
        let file = entry.and_then(|e| e.uri.as_deref()).filter(|uri| !uri.starts_with("data:"));
        let name = entry.and_then(|e| e.name.as_deref()).filter(|name| !name.trim().is_empty());
        file.or(name).map_or_else(|| format!("image {image}"), one_line)
    }

    fn image_bytes(&self, image: usize, source: &Source<'_>) -> Result<Cow<'a, [u8]>, Fault> {
        let strange = || Fault::unsupported("its picture is in a format that is not read", "use PNG or JPEG");
        let entry = self.document.images.get(image).ok_or_else(strange)?;
        match (&entry.uri, entry.buffer_view) {
            (Some(uri), _) => read_uri(uri, source).map(Cow::Owned),
            (None, Some(view)) => self.data.view(view).map(Cow::Borrowed),
            (None, None) => Err(Fault::malformed("it has neither `uri` nor `bufferView`")),
        }
    }
}

fn convert(entry: &MaterialEntry, index: usize) -> Material {
    let pbr = &entry.pbr_metallic_roughness;
    let [r, g, b, alpha] = pbr.base_color_factor.map(|c| finite(c, 1.0).max(0.0));
    let (metal, rough) = (share(pbr.metallic_factor), share(pbr.roughness_factor));
    let shininess = (2.0 / rough.powi(4).max(1e-6) - 2.0).clamp(1.0, 1024.0);
    let head_on = 0.04 + (0.3 - 0.04) * metal;
    let strength =
        entry.extensions.emissive_strength.as_ref().map_or(1.0, |e| finite(e.emissive_strength, 1.0));
    let mut material = Material {
        name: entry.name.as_deref().map_or_else(|| format!("material {index}"), one_line),
        base_color: Vec3::new(r, g, b),
        specular: (head_on * (shininess + 8.0) / 8.0).min(1.0) * (1.0 - rough * rough),
        shininess,
        reflectivity: (0.6 * metal * (1.0 - rough / 0.4)).max(0.0),
        ..Material::default()
    };
    if entry.emissive_texture.is_none() {
        material.emission =
            Vec3::from_array(entry.emissive_factor.map(|c| finite(c, 0.0).max(0.0))) * strength.max(0.0);
    }
    match entry.alpha_mode.as_deref() {
        Some("MASK") => {
            material.alpha = AlphaMode::Mask(share(entry.alpha_cutoff.unwrap_or(0.5)) / alpha.max(1e-3));
        }
        Some("BLEND") => {
            material.alpha = AlphaMode::Blend;
            material.opacity = alpha.min(1.0);
        }
        _ => {}
    }
    if entry.extensions.unlit.is_some() {
        (material.specular, material.reflectivity, material.diffuse) = (0.0, 0.0, 1.0);
    }
    material
}

fn note_what_is_left_out(entry: &MaterialEntry, has_normal_map: bool, source: &mut Source<'_>) {
    for (name, present) in [
        (
            "normal maps with texture coordinates of their own",
            entry.normal_texture.is_some() && !has_normal_map,
        ),
        ("occlusion maps", entry.occlusion_texture.is_some()),
        ("metal and roughness maps", entry.pbr_metallic_roughness.metallic_roughness_texture.is_some()),
        ("emissive maps", entry.emissive_texture.is_some()),
    ] {
        if present {
            source.notes.add(format!("{name} are not used"));
        }
    }
}

fn finite(value: f32, otherwise: f32) -> f32 {
    if value.is_finite() { value } else { otherwise }
}

fn share(value: f32) -> f32 {
    finite(value, 1.0).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material(json: &str) -> Material {
        convert(&serde_json::from_str(json).unwrap(), 0)
    }

    #[test]
    fn rough_things_are_matte_and_smooth_metal_mirrors() {
        let rough = material(r#"{"pbrMetallicRoughness":{"metallicFactor":0}}"#);
        assert_eq!((rough.specular, rough.shininess, rough.reflectivity), (0.0, 1.0, 0.0));
        let plastic = material(r#"{"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0.5}}"#);
        assert!((plastic.shininess - 30.0).abs() < 1e-3 && (plastic.specular - 0.1425).abs() < 1e-4);
        let mirror = material(r#"{"pbrMetallicRoughness":{"roughnessFactor":0}}"#);
        assert_eq!((mirror.specular, mirror.shininess), (1.0, 1024.0));
        assert!((mirror.reflectivity - 0.6).abs() < 1e-6);
    }

    #[test]
    fn alpha_counts_only_where_the_mode_says_so() {
        let json = |mode: &str| {
            format!(
                r#"{{"alphaMode":"{mode}","alphaCutoff":0.25,"pbrMetallicRoughness":{{"baseColorFactor":[1,1,1,0.5]}}}}"#
            )
        };
        assert_eq!(material(&json("OPAQUE")).opacity, 1.0);
        assert_eq!(material(&json("BLEND")).opacity, 0.5);
        assert_eq!(material(&json("MASK")).alpha, AlphaMode::Mask(0.5));
    }

    #[test]
    fn texture_transforms_turn_as_the_extension_says() {
        let transform = TextureTransform {
            rotation: std::f32::consts::FRAC_PI_2,
            offset: [0.0, 1.0],
            scale: [2.0, 1.0],
            ..TextureTransform::default()
        };
        let source = UvSource { wanted: true, set: 0, transform: Some(transform) };
        assert!((source.transform(Vec2::new(0.5, 0.0)) - Vec2::new(0.0, 0.0)).length() < 1e-6);
    }
}
