//! Builds a scene of a scene file.

use super::place::{camera, light, transform, usage};
use super::schema::{MaterialEntry, NormalMapEntry, ObjectEntry, SceneFile, TextureEntry};
use super::schema_shapes::ShapeEntry;
use super::shape;
use crate::load::error::{Fault, one_line};
use crate::load::image::{Holds, TextureMaker, checker};
use crate::load::limits::LoadOptions;
use crate::load::source::Source;
use crate::load::text::decode_text;
use crate::pixels::srgb_bytes;
use crate::scene::{NormalMap, Object, Scene, Texture};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::DAffine3;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// Edge of a generated checker in pixels, a multiple of the number of its fields.
const CHECKER_PIXELS: u32 = 256;

/// Loads a scene file, RON or JSON by its extension.
pub(in crate::load) fn load(source: &mut Source<'_>) -> Result<Scene, Fault> {
    let bytes = std::mem::take(&mut source.bytes);
    let file = parse(&bytes, &source.extension)?;
    drop(bytes);
    let mut builder = Builder { models: HashMap::new(), materials: BTreeMap::new(), scene: Scene::default() };
    builder.scene.name = one_line(&file.name);
    builder.scene.environment = file.environment.clone();
    let textures = builder.add_textures(&file, source)?;
    builder.add_materials(&file, &textures)?;
    for (i, entry) in file.objects.iter().enumerate() {
        let place =
            if entry.name.is_empty() { format!("objects[{i}]") } else { format!("object `{}`", entry.name) };
        builder.add_object(entry, i, source).map_err(|fault| fault.at(place))?;
    }
    let mut scene = builder.scene;
    for (i, entry) in file.lights.iter().enumerate() {
        scene.lights.push(light(entry).map_err(|fault| fault.at(format_args!("lights[{i}]")))?);
    }
    for entry in &file.cameras {
        let built = camera(entry).map_err(|fault| fault.at(format_args!("camera `{}`", entry.name)))?;
        scene.cameras.push((one_line(&entry.name), built));
    }
    Ok(scene)
}

/// Parses a scene file; both parsers bound the nesting.
fn parse(bytes: &[u8], extension: &str) -> Result<SceneFile, Fault> {
    if extension == "json" {
        return serde_json::from_slice(bytes).map_err(|error| {
            let text = error.to_string();
            let cause = text.split(" at line ").next().unwrap_or(&text);
            wrong(error.line(), error.column(), cause)
        });
    }
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let shown = one_line(&decode_text(&bytes[error.valid_up_to()..][..1]));
        usage(format!("byte {}: `{shown}` is not UTF-8", error.valid_up_to()), "save it as UTF-8")
    })?;
    let options = ron::Options::default().with_default_extension(super::extensions());
    options.from_str(text).map_err(|error| {
        let start = error.span.start;
        wrong(start.line, start.col, &error.code.to_string())
    })
}

fn wrong(line: usize, column: usize, cause: &str) -> Fault {
    usage(format!("line {line} column {column}: {cause}"), "mend the scene file")
}

/// Opens a file that the scene file refers to, and gives it to a reader.
pub(super) fn with_included<T>(
    file: &str,
    source: &mut Source<'_>,
    read: impl FnOnce(&mut Source<'_>) -> Result<T, Fault>,
) -> Result<T, Fault> {
    with_included_options(file, source, &LoadOptions::default(), read)
}

/// The same, with what the scene file says about the file.
pub(super) fn with_included_options<T>(
    file: &str,
    source: &mut Source<'_>,
    options: &LoadOptions,
    read: impl FnOnce(&mut Source<'_>) -> Result<T, Fault>,
) -> Result<T, Fault> {
    let path = source.folder.find(file)?;
    let options = LoadOptions { height_map: true, limits: source.limits.clone(), ..options.clone() };
    let mut inner = Source::open(&path, &options, source.folder.read(file)?);
    let made = read(&mut inner).map_err(|fault| fault.at(format_args!("`{}`", one_line(file))));
    for line in inner.notes.into_lines() {
        source.notes.add(format!("{}: {line}", one_line(file)));
    }
    made
}

/// Tells what the materials of a file take a texture for.
fn holds(file: &SceneFile, name: &str) -> Result<Holds, Fault> {
    let is = |wanted: &String| one_line(wanted) == name;
    let is_color = file.materials.values().any(|m| m.texture.as_ref().is_some_and(is));
    match file.materials.values().any(|m| m.normal_map.as_ref().is_some_and(|map| is(&map.texture))) {
        true if is_color => Err(usage(format!("texture `{name}` {}", super::BOTH), "name its file twice")),
        true => Ok(Holds::Data),
        false => Ok(Holds::Colors),
    }
}

/// A model that was included: its objects, with materials as indices into the scene.
type Included = Arc<Vec<Object>>;

struct Builder {
    /// By file and frame.
    models: HashMap<(String, u32), Included>,
    materials: BTreeMap<String, usize>,
    scene: Scene,
}

impl Builder {
    fn add_textures(
        &mut self,
        file: &SceneFile,
        source: &mut Source<'_>,
    ) -> Result<BTreeMap<String, usize>, Fault> {
        let mut maker = TextureMaker::new(source.limits);
        let mut places = BTreeMap::new();
        for (name, entry) in &file.textures {
            let name = one_line(name);
            let holds = holds(file, &name)?;
            let texture = match entry {
                TextureEntry::File { path, wrap } => {
                    let bytes = source.folder.read(path);
                    maker.make(&name, bytes, (*wrap, holds), &mut source.notes)
                }
                TextureEntry::Png { base64, wrap } => {
                    let bytes = STANDARD
                        .decode(base64)
                        .map_err(|error| usage(format!("no base64 ({error})"), "write it with this program"));
                    maker.make(&name, bytes, (*wrap, holds), &mut source.notes)
                }
                TextureEntry::Checker { colors, cells } => {
                    if !(1..=CHECKER_PIXELS).contains(cells) {
                        let what = format!("texture `{name}`: `cells` is {cells}");
                        return Err(usage(what, format!("give 1 to {CHECKER_PIXELS}")));
                    }
                    generated_checker(&name, colors.map(|c| c.0), *cells)
                }
            };
            places.insert(name, self.scene.add_texture(texture));
        }
        Ok(places)
    }

    fn add_materials(&mut self, file: &SceneFile, textures: &BTreeMap<String, usize>) -> Result<(), Fault> {
        for (name, entry) in &file.materials {
            let place = format!("material `{}`", one_line(name));
            check_material(entry).map_err(|what| usage(what, "mend the material").at(&place))?;
            let known = |wanted: &String| {
                textures.get(&one_line(wanted)).copied().ok_or_else(|| {
                    usage(format!("{place}: there is no texture `{wanted}`"), known_names(textures))
                })
            };
            let texture = entry.texture.as_ref().map(known).transpose()?;
            let normal_map = |map: &NormalMapEntry| {
                Ok::<_, Fault>(NormalMap { texture: known(&map.texture)?, scale: map.scale })
            };
            let normal_map = entry.normal_map.as_ref().map(normal_map).transpose()?;
            let index = self.scene.add_material(entry.material(&one_line(name), texture, normal_map));
            self.materials.insert(one_line(name), index);
        }
        Ok(())
    }

    fn add_object(
        &mut self,
        entry: &ObjectEntry,
        number: usize,
        source: &mut Source<'_>,
    ) -> Result<(), Fault> {
        let world_from_entry = transform(&entry.transform)?;
        let materials = self.named_materials(entry)?;
        if let ShapeEntry::Model { file, frame } = &entry.shape {
            return self.add_model((file, *frame), entry, world_from_entry, &materials, source);
        }
        let (shape, turned) = shape::build(&entry.shape, source)?;
        let name = if entry.name.is_empty() {
            format!("{} {number}", shape.kind().name())
        } else {
            one_line(&entry.name)
        };
        let materials = if materials.is_empty() { vec![self.plain_material()] } else { materials };
        self.push(
            Object {
                name,
                shape: Arc::new(shape),
                world_from_object: world_from_entry * turned,
                materials,
                visible: entry.visible,
                required: entry.required,
            },
            source,
        )
    }

    fn push(&mut self, object: Object, source: &Source<'_>) -> Result<(), Fault> {
        if self.scene.objects.len() as u64 >= source.limits.instances {
            return Err(Fault::over(
                format!("there are more than {} objects", source.limits.instances),
                "instances",
            ));
        }
        self.scene.objects.push(object);
        Ok(())
    }

    /// Places the objects of a model file, which is read once however often it is placed.
    fn add_model(
        &mut self,
        (file, frame): (&str, u32),
        entry: &ObjectEntry,
        world_from_model: DAffine3,
        materials: &[usize],
        source: &mut Source<'_>,
    ) -> Result<(), Fault> {
        let key = (file.to_owned(), frame);
        let model = match self.models.get(&key) {
            Some(model) => model.clone(),
            None => {
                let model = Arc::new(self.read_model(file, frame, source)?);
                self.models.insert(key, model.clone());
                model
            }
        };
        for object in model.iter() {
            let mut object = object.clone();
            object.name = match (entry.name.is_empty(), model.len()) {
                (true, _) => object.name,
                (false, 1) => one_line(&entry.name),
                (false, _) => one_line(&format!("{}/{}", entry.name, object.name)),
            };
            object.world_from_object = world_from_model * object.world_from_object;
            if !materials.is_empty() {
                object.materials = materials.to_vec();
            }
            // What the model hides stays hidden.
            (object.visible, object.required) = (object.visible && entry.visible, entry.required);
            self.push(object, source)?;
        }
        Ok(())
    }

    fn read_model(&mut self, file: &str, frame: u32, source: &mut Source<'_>) -> Result<Vec<Object>, Fault> {
        let options = LoadOptions { frame, ..LoadOptions::default() };
        let mut model = with_included_options(file, source, &options, |inner| {
            let is_model = matches!(inner.extension.as_str(), "obj" | "gltf" | "glb" | "stl" | "ply" | "vox");
            if !is_model {
                let what = format!("files `.{}` are no models", one_line(&inner.extension));
                return Err(Fault::unsupported(what, "give .obj .gltf .glb .stl .ply .vox"));
            }
            crate::load::reader_of(&inner.extension, inner.options)?(inner)
        })?;
        let (first_material, first_texture) = (self.scene.materials.len(), self.scene.textures.len());
        for mut material in model.materials.drain(..) {
            material.texture = material.texture.map(|t| t + first_texture);
            material.normal_map.iter_mut().for_each(|map| map.texture += first_texture);
            self.scene.materials.push(material);
        }
        self.scene.textures.append(&mut model.textures);
        for object in &mut model.objects {
            object.materials.iter_mut().for_each(|m| *m += first_material);
        }
        Ok(model.objects)
    }

    fn named_materials(&self, entry: &ObjectEntry) -> Result<Vec<usize>, Fault> {
        let find = |name: &String| {
            self.materials.get(&one_line(name)).copied().ok_or_else(|| {
                usage(format!("there is no material `{}`", one_line(name)), known_names(&self.materials))
            })
        };
        entry.material.names().iter().map(find).collect()
    }

    fn plain_material(&mut self) -> usize {
        let known = self.scene.materials.iter().position(|m| *m == crate::scene::Material::default());
        known.unwrap_or_else(|| self.scene.add_material(crate::scene::Material::default()))
    }
}

fn known_names(names: &BTreeMap<String, usize>) -> String {
    if names.is_empty() {
        return "define it first, none is".to_owned();
    }
    let list: Vec<&str> = names.keys().take(12).map(String::as_str).collect();
    format!("take one of {}", list.join(", "))
}

fn check_material(entry: &MaterialEntry) -> Result<(), String> {
    for (name, value, most) in [
        ("ambient", entry.ambient, 100.0),
        ("diffuse", entry.diffuse, 100.0),
        ("specular", entry.specular, 100.0),
        ("shininess", entry.shininess, 1e6),
        ("opacity", entry.opacity, 1.0),
        ("reflectivity", entry.reflectivity, 1.0),
    ] {
        if !(0.0..=most).contains(&value) {
            return Err(format!("`{name}` must be 0 to {most}, got {value}"));
        }
    }
    if entry.base_color.min_element() < 0.0 || entry.emission.min_element() < 0.0 {
        return Err("a color is negative".to_owned());
    }
    if let Some(map) = entry.normal_map.as_ref().filter(|map| !(-100.0..=100.0).contains(&map.scale)) {
        return Err(format!("`normal_map.scale` must be -100 to 100, got {}", map.scale));
    }
    Ok(())
}

fn generated_checker(name: &str, colors: [glam::Vec3; 2], cells: u32) -> Texture {
    let bytes = colors.map(|color| {
        let [r, g, b] = srgb_bytes(color);
        [r, g, b, 255]
    });
    checker(name, bytes, cells, CHECKER_PIXELS / cells * cells)
}
