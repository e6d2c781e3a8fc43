//! How is a scene of voxels written as a `.vox` file?
//!
//! Files have z up: cell `(x, y, z)` of a grid `nz` cells deep becomes voxel `(x, nz - 1 - z, y)`, which is what the
//! loader takes back. Coordinates are bytes, so a grid longer than 256 cells becomes several models. One grid in its
//! own space is written as a bare model; more, or moved ones, are placed by a scene graph, with invisible objects hidden.

use crate::pixels::srgb_bytes;
use crate::scene::{Material, Object, Scene, Shape, Voxels};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// Longest edge of a model.
const LONGEST: u32 = 256;
/// Most colors: one byte a voxel, 0 is empty.
const MOST_COLORS: usize = 255;
/// Beyond this the file's 32-bit lengths would not do.
const MOST_BYTES: u64 = 1 << 31;
/// Shininess that the reader gives to all that is smooth enough.
const SHINIEST: f32 = 1024.0;

/// Tells whether all that is visible are grids of one lattice: turned by quarters and moved by whole cells, with no more
/// materials than a palette holds.
pub(super) fn is_lattice(scene: &Scene) -> bool {
    scene.objects.iter().any(|object| object.visible)
        && scene.objects.iter().all(|object| {
            matches!(&*object.shape, Shape::Voxels(voxels) if frame(object, [0; 3], voxels.size()).is_some())
        })
        && Palette::of(scene).is_ok()
}

/// Writes grids; returns the file and what is in it, for people.
pub(super) fn written(scene: &Scene) -> Result<(Vec<u8>, String), String> {
    let palette = Palette::of(scene)?;
    let mut body = Vec::new();
    let (mut placed, mut models) = (Vec::new(), 0);
    // Models of a shape, and where each begins; instances share them.
    let mut known: HashMap<(usize, &[usize]), Vec<Part>> = HashMap::new();
    let mut what = Vec::new();
    for object in &scene.objects {
        let Shape::Voxels(voxels) = &*object.shape else { continue };
        let key = (Arc::as_ptr(&object.shape).addr(), &object.materials[..]);
        let parts = match known.get(&key) {
            Some(parts) => parts,
            None => {
                let mut parts = Vec::new();
                for (from, size) in blocks(voxels.size()) {
                    if let Some(model) = model_chunks(voxels, from, size, &palette.bytes_of(object)) {
                        body.extend(model);
                        parts.push((models, from, size));
                        models += 1;
                    }
                }
                if body.len() as u64 > MOST_BYTES {
                    return Err("the voxels do not fit a .vox file of 2 GiB: lower --resolution".to_owned());
                }
                let [x, y, z] = voxels.size();
                what.push(format!("{x}x{y}x{z}"));
                known.entry(key).or_insert(parts)
            }
        };
        for &(model, from, size) in parts {
            let (rotation, translation) =
                frame(object, from, size).ok_or("the grids do not lie in one lattice")?;
            placed.push(Placed { model, rotation, translation, name: &object.name, visible: object.visible });
        }
    }
    if models == 0 {
        return Err("no voxel is filled".to_owned());
    }
    let is_plain = models == 1
        && placed.len() == 1
        && placed[0].visible
        && scene.objects.iter().all(|object| object.world_from_object == DAffine3::IDENTITY);
    if !is_plain {
        graph(&placed, &mut body);
    }
    palette.write(scene, &mut body);
    let mut file = b"VOX ".to_vec();
    file.extend(200u32.to_le_bytes());
    file.extend(b"MAIN");
    file.extend(0u32.to_le_bytes());
    file.extend((body.len() as u32).to_le_bytes());
    file.extend(body);
    let what = match &what[..] {
        [one] => one.clone(),
        all => format!("{} grids", all.len()),
    };
    let models = if models > 1 { format!(" in {models} models") } else { String::new() };
    Ok((file, format!("{what} voxels{models}")))
}

/// A model of a grid: its number, first cell and size.
type Part = (i32, [u32; 3], [u32; 3]);

/// Cuts a grid into blocks that fit a model: first cells and sizes.
fn blocks(size: [u32; 3]) -> impl Iterator<Item = ([u32; 3], [u32; 3])> {
    let starts = size.map(|s| (0..s).step_by(LONGEST as usize));
    let [xs, ys, zs] = starts;
    zs.flat_map(move |z| {
        let xs = xs.clone();
        ys.clone().flat_map(move |y| xs.clone().map(move |x| [x, y, z]))
    })
    .map(move |from| (from, std::array::from_fn(|a| LONGEST.min(size[a] - from[a]))))
}

/// Writes the size and the voxels of a block; nothing for an empty one.
fn model_chunks(voxels: &Voxels, from: [u32; 3], size: [u32; 3], byte_of: &[u8; 256]) -> Option<Vec<u8>> {
    let [nx, ny, nz] = size;
    let mut cells = Vec::new();
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let value = voxels.get(from[0] + x, from[1] + y, from[2] + z);
                if value != 0 {
                    cells.extend([x as u8, (nz - 1 - z) as u8, y as u8, byte_of[usize::from(value)]]);
                }
            }
        }
    }
    let count = cells.len() as u32 / 4;
    (count > 0).then(|| {
        let mut bytes = chunk(b"SIZE", &numbers(&[nx as i32, nz as i32, ny as i32]));
        bytes.extend(chunk(b"XYZI", &[&count.to_le_bytes()[..], &cells].concat()));
        bytes
    })
}

/// A model at its place in the file's space.
struct Placed<'a> {
    model: i32,
    rotation: u8,
    translation: [i32; 3],
    name: &'a str,
    visible: bool,
}

/// Returns the file's rotation byte and translation of a block of a grid; nothing where its object is not turned by
/// quarters and moved by whole cells. A model turns around `floor(size / 2)`.
fn frame(object: &Object, from: [u32; 3], size: [u32; 3]) -> Option<(u8, [i32; 3])> {
    let whole = |v: u32| f64::from(v);
    let [nx, ny, nz] = size.map(whole);
    let first = DAffine3::from_translation(DVec3::from_array(from.map(whole)));
    let z_up_from_y_up = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);
    let pivot = DVec3::new((nx / 2.0).floor(), (nz / 2.0).floor(), (ny / 2.0).floor());
    let pivot_from_block = DAffine3::from_mat3_translation(z_up_from_y_up, DVec3::new(0.0, nz, 0.0) - pivot);
    let file_from_block = DAffine3::from_mat3(z_up_from_y_up) * object.world_from_object * first;
    let file_from_pivot = file_from_block * pivot_from_block.inverse();
    let (matrix, place) = (file_from_pivot.matrix3, file_from_pivot.translation);
    let near = |v: f64, whole: f64| (v - whole).abs() < 1e-6;
    let mut code = 0;
    let mut columns = [0; 3];
    for (row, place) in columns.iter_mut().enumerate() {
        let values = matrix.row(row).to_array();
        let column = values.iter().position(|v| near(v.abs(), 1.0))?;
        if values.iter().enumerate().any(|(i, &v)| i != column && !near(v, 0.0)) {
            return None;
        }
        *place = column;
        code |= if values[column] < 0.0 { 1 << (4 + row) } else { 0 };
    }
    let is_whole = place.to_array().iter().all(|&v| near(v, v.round()) && v.abs() < 1e9);
    let is_permutation = columns[0] != columns[1] && columns[1] != columns[2] && columns[0] != columns[2];
    let code = code | columns[0] as u8 | (columns[1] as u8) << 2;
    (is_whole && is_permutation).then(|| (code, place.round().to_array().map(|v| v as i32)))
}

/// Writes a root, a group below it, and a transform and a shape for each model.
fn graph(placed: &[Placed<'_>], body: &mut Vec<u8>) {
    let none = dict::<&str>(&[]);
    let transform = |id: i32, attributes: &[u8], child: i32, frame: &[u8]| {
        chunk(b"nTRN", &[&numbers(&[id]), attributes, &numbers(&[child, -1, -1, 1]), frame].concat())
    };
    body.extend(transform(0, &none, 1, &none));
    let count = placed.len() as i32;
    let mut children = vec![count];
    children.extend((0..count).map(|i| 2 + 2 * i));
    body.extend(chunk(b"nGRP", &[numbers(&[1]), none.clone(), numbers(&children)].concat()));
    for (i, part) in placed.iter().enumerate() {
        let id = 2 + 2 * i as i32;
        let mut attributes = vec![("_name", part.name.to_owned())];
        if !part.visible {
            attributes.push(("_hidden", "1".to_owned()));
        }
        let [x, y, z] = part.translation;
        let place = [("_r", part.rotation.to_string()), ("_t", format!("{x} {y} {z}"))];
        body.extend(transform(id, &dict(&attributes), id + 1, &dict(&place)));
        let shape = [numbers(&[id + 1]), none.clone(), numbers(&[1, part.model]), none.clone()].concat();
        body.extend(chunk(b"nSHP", &shape));
    }
}

/// The materials of a scene that some voxel has, by number: the first is color 1.
struct Palette(Vec<usize>);

impl Palette {
    fn of(scene: &Scene) -> Result<Self, String> {
        let mut used = Vec::new();
        for object in &scene.objects {
            let Shape::Voxels(voxels) = &*object.shape else { continue };
            let mut seen = [false; 256];
            voxels.for_each_filled(|_, value| seen[usize::from(value)] = true);
            for slot in (0..255).filter(|&slot| seen[slot + 1]) {
                let material = object.material_in_slot(slot);
                if !used.contains(&material) {
                    used.push(material);
                }
            }
        }
        used.sort_unstable();
        match used.len() {
            0..=MOST_COLORS => Ok(Self(used)),
            count => Err(format!("{count} materials do not fit the palette of a .vox file ({MOST_COLORS})")),
        }
    }

    /// Returns the color of each byte of an object's grid.
    fn bytes_of(&self, object: &Object) -> [u8; 256] {
        std::array::from_fn(|value| {
            let material = object.material_in_slot(value.saturating_sub(1));
            self.0.iter().position(|&m| m == material).map_or(0, |i| i as u8 + 1)
        })
    }

    fn write(&self, scene: &Scene, body: &mut Vec<u8>) {
        let material = |&index: &usize| scene.materials.get(index).unwrap_or(Material::fallback());
        let mut colors: Vec<u8> = self.0.iter().map(material).flat_map(color).collect();
        colors.resize(1024, 0);
        body.extend(chunk(b"RGBA", &colors));
        for (i, material) in self.0.iter().map(material).enumerate() {
            body.extend(chunk(b"MATL", &[numbers(&[i as i32 + 1]), dict(&properties(material))].concat()));
        }
    }
}

/// Returns the color of a material; a black thing that glows has the color of its light.
fn color(material: &Material) -> [u8; 4] {
    let most = material.emission.max_element();
    let shown = if material.base_color == Vec3::ZERO && most > 0.0 {
        material.emission / most
    } else {
        material.base_color
    };
    let [r, g, b] = srgb_bytes(shown);
    [r, g, b, 255]
}

/// Describes a material in the words of the format, which knows one kind for each: light, else glass, else mirror, else
/// matte. Read back they give the same emission, opacity and reflectivity.
fn properties(material: &Material) -> Vec<(&'static str, String)> {
    let shiny = (2.0 / (material.shininess.max(4.0) + 2.0)).powf(0.25).clamp(0.0, 1.0);
    // Where a mirror is as shiny as can be, a smoother one is only brighter.
    let rough = if material.shininess >= SHINIEST && material.specular > 0.0 {
        (1.0 - material.reflectivity / material.specular).clamp(0.0, shiny)
    } else {
        shiny
    };
    let metal = (material.reflectivity / (0.6 * (1.0 - rough))).clamp(0.0, 1.0);
    let number = |value: f32| value.to_string();
    if material.emission != Vec3::ZERO {
        let base = material.base_color.max_element();
        let power = material.emission.max_element() / if base > 0.0 { base } else { 1.0 };
        let flux = power.log2().ceil().clamp(0.0, 8.0);
        return vec![
            ("_type", "_emit".to_owned()),
            ("_emit", number((power / flux.exp2()).min(1.0))),
            ("_flux", number(flux)),
        ];
    }
    if material.opacity < 1.0 {
        let clear = number(1.0 - material.opacity.max(0.0));
        if metal == 0.0 && material.specular > 0.0 {
            return vec![("_type", "_glass".to_owned()), ("_trans", clear.clone()), ("_alpha", clear)];
        }
        return vec![
            ("_type", "_blend".to_owned()),
            ("_trans", clear.clone()),
            ("_alpha", clear),
            ("_metal", number(metal)),
            ("_rough", number(rough)),
        ];
    }
    if metal > 0.0 {
        return vec![
            ("_type", "_metal".to_owned()),
            ("_metal", number(metal)),
            ("_weight", number(metal)),
            ("_rough", number(rough)),
        ];
    }
    vec![("_type", "_diffuse".to_owned())]
}

fn numbers(list: &[i32]) -> Vec<u8> {
    list.iter().flat_map(|n| n.to_le_bytes()).collect()
}

fn dict<T: AsRef<str>>(entries: &[(&str, T)]) -> Vec<u8> {
    let mut bytes = (entries.len() as u32).to_le_bytes().to_vec();
    for text in entries.iter().flat_map(|(key, value)| [*key, value.as_ref()]) {
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text.bytes());
    }
    bytes
}

fn chunk(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut bytes = kind.to_vec();
    bytes.extend((content.len() as u32).to_le_bytes());
    bytes.extend(0u32.to_le_bytes());
    bytes.extend(content);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::{LoadOptions, load};
    use glam::DQuat;
    use std::collections::BTreeMap;
    use std::f64::consts::FRAC_PI_2;

    /// Writes a scene, reads it back, and has the reference reader look at it, too.
    fn round_trip(scene: &Scene, name: &str) -> (Scene, dot_vox::DotVoxData) {
        let path = std::env::temp_dir().join(format!("polyptych-{name}-{}.vox", std::process::id()));
        let (bytes, _) = written(scene).unwrap();
        std::fs::write(&path, &bytes).unwrap();
        let back = load(&path, &LoadOptions::default()).unwrap();
        std::fs::remove_file(&path).unwrap();
        (back, dot_vox::load_bytes(&bytes).unwrap())
    }

    /// Lists middles of cells, in halves of a cell, with what they are made of.
    fn cells(scene: &Scene, visible: bool) -> BTreeMap<[i64; 3], [i64; 7]> {
        let mut cells = BTreeMap::new();
        for object in scene.objects.iter().filter(|o| o.visible == visible) {
            let Shape::Voxels(voxels) = &*object.shape else { panic!("a grid") };
            voxels.for_each_filled(|cell, value| {
                let middle = DVec3::from_array(cell.map(f64::from)) + 0.5;
                let place = object.world_from_object.transform_point3(middle) * 2.0;
                let m = scene.material(object, usize::from(value) - 1);
                let [r, g, b] = m.base_color.to_array();
                let parts = [r, g, b, m.emission.x, m.emission.y, m.opacity, m.reflectivity];
                let old = cells.insert(
                    place.round().to_array().map(|c| c as i64),
                    parts.map(|c| (f64::from(c) * 1e4).round() as i64),
                );
                assert_eq!(old, None);
            });
        }
        cells
    }

    fn materials() -> Vec<Material> {
        let byte = |c: u8| crate::shade::linear_from_srgb(f32::from(c) / 255.0);
        let color = |r: u8, g: u8, b: u8| Vec3::new(byte(r), byte(g), byte(b));
        let plain = |c: Vec3| Material { specular: 0.0, ..Material::new(c) };
        vec![
            plain(color(200, 30, 60)),
            Material { emission: color(90, 80, 20) * 5.5, ..plain(color(90, 80, 20)) },
            Material { opacity: 0.25, ..plain(color(20, 80, 220)) },
            Material { reflectivity: 0.3, shininess: 60.0, ..plain(color(120, 120, 120)) },
        ]
    }

    #[test]
    fn grids_longer_than_a_model_are_several_and_come_back_as_they_were() {
        let mut scene = Scene { materials: materials(), ..Scene::default() };
        let grid = Voxels::from_fn([300, 20, 270], |x, y, z| {
            if (x * 7 + y * 3 + z * 5) % 11 == 0 { 1 + ((x + z) % 4) as u8 } else { 0 }
        });
        scene
            .objects
            .push(Object { materials: vec![0, 1, 2, 3], ..Object::new("slab", Shape::Voxels(grid), 0) });
        let (back, known) = round_trip(&scene, "long");
        assert_eq!((back.objects.len(), known.models.len(), known.materials.len()), (4, 4, 4));
        assert!(cells(&back, true) == cells(&scene, true));
    }

    #[test]
    fn grids_of_a_lattice_keep_their_places_turns_and_materials() {
        let mut scene = Scene { materials: materials(), ..Scene::default() };
        let grid = Arc::new(Shape::Voxels(Voxels::from_fn([5, 4, 7], |x, y, z| {
            u8::from((x + y * z) % 3 != 0) * (1 + ((x + z) % 4) as u8)
        })));
        let turns = [
            DQuat::IDENTITY,
            DQuat::from_rotation_y(FRAC_PI_2),
            DQuat::from_rotation_x(-FRAC_PI_2) * DQuat::from_rotation_z(FRAC_PI_2 * 2.0),
        ];
        for (i, turn) in turns.into_iter().enumerate() {
            let place =
                DAffine3::from_rotation_translation(turn, DVec3::new(20.0 * i as f64 - 7.0, 3.0, -9.0));
            let mut object =
                Object::new(format!("part {i}"), Shape::Voxels(Voxels::new([1; 3])), 0).placed(place);
            (object.shape, object.materials, object.visible) = (grid.clone(), vec![3, 2, 1, 0], i != 1);
            scene.objects.push(object);
        }
        assert!(is_lattice(&scene));
        let (back, known) = round_trip(&scene, "lattice");
        // One model, placed three times.
        assert_eq!((back.objects.len(), known.models.len()), (3, 1));
        assert_eq!(back.objects[2].name, "part 2");
        for visible in [true, false] {
            assert!(cells(&back, visible) == cells(&scene, visible), "visible: {visible}");
        }
        scene.objects[0].world_from_object.translation.x += 0.25;
        assert!(!is_lattice(&scene));
    }

    #[test]
    fn the_smoothest_mirrors_stay_as_bright() {
        let mut mirror =
            Material { reflectivity: 0.576, specular: 0.6, shininess: 1024.0, ..materials()[0].clone() };
        for reflectivity in [0.576, 0.5, 0.6] {
            mirror.reflectivity = reflectivity;
            let mut scene = Scene { materials: vec![mirror.clone()], ..Scene::default() };
            let grid = Voxels::from_fn([1; 3], |_, _, _| 1);
            scene.objects.push(Object { materials: vec![0], ..Object::new("cell", Shape::Voxels(grid), 0) });
            let (back, _) = round_trip(&scene, "mirror");
            let read = back.material(&back.objects[0], 0);
            assert!((read.reflectivity - reflectivity).abs() < 1e-5, "{reflectivity}: {}", read.reflectivity);
            assert_eq!((read.specular, read.shininess), (mirror.specular, mirror.shininess));
        }
    }

    #[test]
    fn too_many_materials_are_refused() {
        let mut scene = Scene { materials: vec![Material::default(); 300], ..Scene::default() };
        for first in [0, 150] {
            let grid = Voxels::from_fn([150, 1, 1], |x, _, _| x as u8 + 1);
            let object = Object::new("row", Shape::Voxels(grid), 0);
            scene.objects.push(Object { materials: (first..first + 150).collect(), ..object });
        }
        assert!(!is_lattice(&scene));
        assert!(written(&scene).unwrap_err().contains("300 materials"));
    }
}
