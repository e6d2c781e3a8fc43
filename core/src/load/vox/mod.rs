//! Reads MagicaVoxel `.vox` files: one object for each model that the scene graph shows.
//!
//! Files have z up. Cell `(x, y, z)` of a model of `ny` rows becomes cell `(x, z, ny - 1 - y)`, a rotation, so that
//! nothing is mirrored; the transforms of the graph are turned with it. A model turns around `floor(size / 2)`. A file
//! without a graph shows one of its models (they are frames) with its smallest corner at the origin. What is hidden
//! becomes an invisible object.
//!
//! An own reader: the crate `dot_vox` hands on sizes, counts and loops unchecked. It serves as the yardstick in tests.

mod chunks;
mod graph;
mod palette;

use super::error::Fault;
use super::source::Source;
use crate::scene::{Object, Scene, Shape, Voxels};
use chunks::{Chunks, Model};
use glam::{DAffine3, DMat3, DVec3};
use graph::Instance;
use std::sync::Arc;

/// Loads a `.vox` file.
pub(super) fn load(source: &mut Source<'_>) -> Result<Scene, Fault> {
    let bytes = std::mem::take(&mut source.bytes);
    let chunks = chunks::read(&bytes, &mut source.notes)?;
    let frame = source.options.frame;
    let instances = if chunks.nodes.is_empty() {
        let count = chunks.models.len();
        if frame > 0 && frame as usize >= count {
            let what = format!("there is no frame {frame}, the file has {count}");
            return Err(Fault::unsupported(what, "ask for one of those, counted from 0"));
        }
        if count > 1 {
            source.notes.add(format!("frame {frame} of {count} is shown (`--frame`)"));
        }
        chunks.models.get(frame as usize).map(|model| frame_of(frame, model)).into_iter().collect()
    } else {
        graph::flatten(&chunks, frame, source.limits.instances, &mut source.notes)?
    };
    let mut builder =
        Builder { chunks: &chunks, shapes: vec![None; chunks.models.len()], used: [false; 256], bytes: 0 };
    let mut scene = Scene::default();
    for instance in &instances {
        let shape = builder.shape(instance.model, source)?;
        scene.objects.push(Object {
            name: instance.name.clone().unwrap_or_else(|| format!("model {}", instance.model)),
            shape,
            world_from_object: place(instance, &chunks.models[instance.model]),
            materials: Vec::new(),
            visible: !instance.is_hidden,
            required: false,
        });
    }
    let materials = builder.place_materials(&mut scene);
    scene.objects.iter_mut().for_each(|object| object.materials.clone_from(&materials));
    if scene.objects.is_empty() {
        source.notes.add("the file shows no model");
    }
    Ok(scene)
}

/// Shows a model with its smallest corner at the origin.
fn frame_of(frame: u32, model: &Model<'_>) -> Instance {
    // `place` turns around the pivot and puts rows the other way round: take both back.
    let [x, y, z] = model.size.map(f64::from);
    let pivot = DVec3::new((x / 2.0).floor(), (y / 2.0).floor(), (z / 2.0).floor());
    let corner = DVec3::new(pivot.x, pivot.y - y, pivot.z);
    Instance {
        model: frame as usize,
        name: None,
        world_from_pivot: DAffine3::from_translation(corner),
        is_hidden: false,
    }
}

/// Returns the transform of a model's cells: object space to the file's model space, around the pivot, through the
/// graph, and from z up to y up.
fn place(instance: &Instance, model: &Model<'_>) -> DAffine3 {
    let [x, y, z] = model.size.map(f64::from);
    let pivot = DVec3::new((x / 2.0).floor(), (y / 2.0).floor(), (z / 2.0).floor());
    let z_up_from_y_up = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);
    let pivot_from_object = DAffine3::from_mat3_translation(z_up_from_y_up, DVec3::new(0.0, y, 0.0) - pivot);
    DAffine3::from_mat3(z_up_from_y_up.transpose()) * instance.world_from_pivot * pivot_from_object
}

struct Builder<'a> {
    chunks: &'a Chunks<'a>,
    shapes: Vec<Option<Arc<Shape>>>,
    used: [bool; 256],
    bytes: u64,
}

impl Builder<'_> {
    /// Returns the shape of a model, built once.
    fn shape(&mut self, index: usize, source: &mut Source<'_>) -> Result<Arc<Shape>, Fault> {
        if let Some(shape) = &self.shapes[index] {
            return Ok(shape.clone());
        }
        let voxels = self.voxels(&self.chunks.models[index], source);
        self.bytes += voxels.bytes();
        if self.bytes > source.limits.voxel_bytes {
            let what = format!("the voxels need more than {} bytes", source.limits.voxel_bytes);
            return Err(Fault::over(what, "voxel_bytes"));
        }
        let shape = Arc::new(Shape::Voxels(voxels));
        self.shapes[index] = Some(shape.clone());
        Ok(shape)
    }

    fn voxels(&mut self, model: &Model<'_>, source: &mut Source<'_>) -> Voxels {
        let [nx, ny, nz] = model.size;
        let (mut outside, mut empty) = (0, 0);
        let used = &mut self.used;
        let cells = model.voxels.chunks_exact(4).filter_map(|v| {
            let [x, y, z] = [v[0], v[1], v[2]].map(u32::from);
            if x >= nx || y >= ny || z >= nz {
                outside += 1;
                return None;
            }
            if v[3] == 0 {
                empty += 1;
                return None;
            }
            used[usize::from(v[3])] = true;
            Some(([x, z, ny - 1 - y], v[3]))
        });
        let size = [nx, nz, ny];
        let volume = u64::from(nx) * u64::from(ny) * u64::from(nz);
        let is_dense = volume <= 1 << 24 && model.voxels.len() as u64 > volume / 8;
        let grid = if is_dense {
            let mut bytes = vec![0u8; volume as usize];
            cells.for_each(|([x, y, z], color)| bytes[((z * nz + y) * nx + x) as usize] = color);
            Voxels::from_bytes(size, &bytes)
        } else {
            let mut grid = Voxels::new(size);
            cells.for_each(|([x, y, z], color)| grid.set(x, y, z, color));
            grid
        };
        if outside > 0 {
            source.notes.add(format!("{outside} voxels outside of their model are left out"));
        }
        if empty > 0 {
            source.notes.add(format!("{empty} voxels of color 0, which means empty, are left out"));
        }
        grid
    }

    /// Adds a material for each color that is used, and returns the table from `color - 1`; colors that are not used
    /// have the first.
    fn place_materials(&self, scene: &mut Scene) -> Vec<usize> {
        let last = self.used.iter().rposition(|&used| used).unwrap_or(0);
        (1..=last as u8)
            .map(|color| {
                if self.used[usize::from(color)] {
                    scene.add_material(palette::material(self.chunks, color))
                } else {
                    0
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::notes::Notes;

    #[test]
    fn cells_lie_where_the_file_says() {
        let model = Model { size: [3, 4, 5], voxels: &[] };
        // model cell (1, 2, 3) is object cell (1, 3, 4 - 1 - 2); its middle in the file is (1.5, 2.5, 3.5)
        let middle = DVec3::new(1.5, 3.5, 1.5);
        let at_origin = place(&frame_of(0, &model), &model);
        assert_eq!(at_origin, DAffine3::IDENTITY);
        let moved = Instance {
            model: 0,
            name: None,
            world_from_pivot: DAffine3::from_translation(DVec3::new(10.0, 20.0, 30.0)),
            is_hidden: false,
        };
        let in_file = DVec3::new(1.5, 2.5, 3.5) - DVec3::new(1.0, 2.0, 2.0) + DVec3::new(10.0, 20.0, 30.0);
        let expected = DVec3::new(in_file.x, in_file.z, -in_file.y);
        assert_eq!(place(&moved, &model).transform_point3(middle), expected);
    }

    /// Writes a chunk.
    fn chunk(kind: &[u8], content: &[u8], children: &[u8]) -> Vec<u8> {
        let mut bytes = kind.to_vec();
        bytes.extend((content.len() as u32).to_le_bytes());
        bytes.extend((children.len() as u32).to_le_bytes());
        bytes.extend(content);
        bytes.extend(children);
        bytes
    }

    fn dict(entries: &[(&str, &str)]) -> Vec<u8> {
        let mut bytes = (entries.len() as u32).to_le_bytes().to_vec();
        for text in entries.iter().flat_map(|(key, value)| [key, value]) {
            bytes.extend((text.len() as u32).to_le_bytes());
            bytes.extend(text.bytes());
        }
        bytes
    }

    fn numbers(list: &[i32]) -> Vec<u8> {
        list.iter().flat_map(|n| n.to_le_bytes()).collect()
    }

    /// Two models of one cell; with a graph they are shown one after the other, the second from frame 5 on, 10 cells
    /// aside from frame 7 on, in a layer.
    fn animated(graph: bool, layer: &[(&str, &str)]) -> Vec<u8> {
        let mut body = Vec::new();
        for edge in [1, 2] {
            body.extend(chunk(b"SIZE", &numbers(&[edge; 3]), &[]));
            body.extend(chunk(b"XYZI", &[1, 0, 0, 0, 0, 0, 0, edge as u8], &[]));
        }
        if graph {
            let mut place = [numbers(&[0]), dict(&[]), numbers(&[1, -1, 3, 2])].concat();
            place.extend(dict(&[("_f", "0"), ("_t", "0 0 0")]));
            place.extend(dict(&[("_f", "7"), ("_t", "10 0 0")]));
            let mut shape = [numbers(&[1]), dict(&[]), numbers(&[2])].concat();
            shape.extend([numbers(&[0]), dict(&[("_f", "0")]), numbers(&[1]), dict(&[("_f", "5")])].concat());
            body.extend(chunk(b"nTRN", &place, &[]));
            body.extend(chunk(b"nSHP", &shape, &[]));
            body.extend(chunk(b"LAYR", &[numbers(&[3]), dict(layer), numbers(&[-1])].concat(), &[]));
        }
        [b"VOX \x96\0\0\0".to_vec(), chunk(b"MAIN", &[], &body)].concat()
    }

    fn load_frame(bytes: Vec<u8>, frame: u32) -> Result<Scene, String> {
        let options = super::super::LoadOptions { frame, ..Default::default() };
        let mut source = Source::open(std::path::Path::new("a.vox"), &options, bytes);
        let mut scene = load(&mut source).map_err(|fault| fault.what())?;
        scene.notes = source.notes.into_lines();
        Ok(scene)
    }

    #[test]
    fn frames_are_those_that_are_asked_for() {
        let seen = |frame| {
            let scene = load_frame(animated(true, &[]), frame).unwrap();
            assert_eq!(scene.notes, [format!("the file moves: frame {frame} is shown (`--frame`)")]);
            let bounds = scene.bounds();
            (bounds.size().x, bounds.min.x)
        };
        // A cell turns around its own corner, a grid of two around its middle.
        assert_eq!([0, 4].map(seen), [(1.0, 0.0); 2]);
        assert_eq!([5, 6].map(seen), [(2.0, -1.0); 2]);
        assert_eq!([7, 1000].map(seen), [(2.0, 9.0); 2]);
        let edge = |frame| Ok(load_frame(animated(false, &[]), frame)?.bounds().size().x);
        assert_eq!([0, 1].map(edge), [Ok(1.0), Ok(2.0)]);
        assert_eq!(edge(2), Err("there is no frame 2, the file has 2".to_owned()));
    }

    #[test]
    fn what_is_hidden_is_an_invisible_object() {
        for (layer, is_shown) in [(&[][..], true), (&[("_hidden", "1")], false), (&[("_hidden", "0")], true)]
        {
            let scene = load_frame(animated(true, layer), 0).unwrap();
            assert_eq!((scene.objects.len(), scene.objects[0].visible), (1, is_shown));
            assert_eq!(scene.notes.iter().any(|note| note.contains("hidden")), !is_shown);
        }
    }

    #[test]
    fn nested_unknown_chunks_are_passed_over() {
        let size: Vec<u8> = [2u32, 2, 2].iter().flat_map(|v| v.to_le_bytes()).collect();
        let body = [
            chunk(b"odd!", b"abc", &chunk(b"SIZE", &[0; 12], &[])),
            chunk(b"SIZE", &size, &[]),
            chunk(b"XYZI", &[1, 0, 0, 0, 1, 0, 1, 7], &[]),
        ]
        .concat();
        let file = [b"VOX \x96\0\0\0".to_vec(), chunk(b"MAIN", &[], &body)].concat();
        let chunks = chunks::read(&file, &mut Notes::default()).unwrap();
        assert_eq!((chunks.models.len(), chunks.models[0].voxels), (1, &[1u8, 0, 1, 7][..]));
        for cut in 0..file.len() {
            assert!(chunks::read(&file[..cut], &mut Notes::default()).is_err(), "cut at {cut}");
        }
    }
}
