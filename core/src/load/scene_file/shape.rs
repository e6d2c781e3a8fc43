//! Turns the shapes of scene files into those of the scene, and back.

use super::place::usage;
use super::schema_shapes::{HeightEntry, MeshEntry, ShapeEntry, VolumeEntry};
use crate::load::error::Fault;
use crate::load::height;
use crate::load::limits::{Limits, LoadOptions, RawVolume, SampleFormat};
use crate::load::source::Source;
use crate::load::volume;
use crate::math::Aabb;
use crate::scene::{Form, FreeForm, HeightField, Mesh, Samples, Shape, TransferFunction, Volume, Voxels};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};
use std::io::Write;

/// Most functions in one form: finding the bounds asks each of them some hundred thousand times.
const MOST_FUNCTIONS: usize = 512;
/// Largest number in a form; its fourth power still is a number.
const LARGEST: f64 = 1e12;

/// Builds a shape, and what turns it before its transform (volumes of patients).
pub(super) fn build(entry: &ShapeEntry, source: &mut Source<'_>) -> Result<(Shape, DAffine3), Fault> {
    let shape = match entry {
        ShapeEntry::Primitive(primitive) => {
            primitive.check().map_err(|what| usage(what, "give positive lengths"))?;
            Shape::Primitive(*primitive)
        }
        ShapeEntry::Mesh(entry) => Shape::Mesh(mesh(entry, source.limits)?),
        ShapeEntry::Voxels { size, cells } => Shape::Voxels(voxels(*size, cells, source.limits)?),
        ShapeEntry::FreeForm { form, bounds } => Shape::FreeForm(free_form(form, *bounds)?),
        ShapeEntry::HeightField(entry) => Shape::HeightField(height_field(entry, source)?),
        ShapeEntry::Volume(entry) => {
            let (volume, turned) = volume_of(entry, source)?;
            return Ok((Shape::Volume(volume), turned));
        }
        ShapeEntry::Model { file, .. } => {
            return Err(Fault::malformed(format!("model `{file}` is no single shape")));
        }
    };
    Ok((shape, DAffine3::IDENTITY))
}

/// Describes a shape.
pub(super) fn entry_of(shape: &Shape) -> Result<ShapeEntry, String> {
    Ok(match shape {
        Shape::Primitive(primitive) => ShapeEntry::Primitive(*primitive),
        Shape::Mesh(mesh) => ShapeEntry::Mesh(MeshEntry {
            positions: mesh.positions.iter().map(Vec3::to_array).collect(),
            triangles: mesh.triangles.clone(),
            normals: mesh.normals.iter().map(Vec3::to_array).collect(),
            uvs: mesh.uvs.iter().map(Vec2::to_array).collect(),
            colors: mesh.colors.iter().map(Vec3::to_array).collect(),
            slots: mesh.slots.clone(),
            segments: mesh.segments.clone(),
        }),
        Shape::Voxels(voxels) => ShapeEntry::Voxels { size: voxels.size(), cells: packed_cells(voxels)? },
        Shape::FreeForm(free) => {
            // Forms that were cut off hold the cut as half spaces, and have an end without the box.
            let bounds = free.bounds();
            let needs_box = FreeForm::new(free.form().clone()).is_err();
            let bounds = needs_box.then(|| [bounds.min.to_array(), bounds.max.to_array()]);
            ShapeEntry::FreeForm { form: free.form().clone(), bounds }
        }
        Shape::HeightField(field) => ShapeEntry::HeightField(HeightEntry {
            rows: field.heights().chunks(field.columns() as usize).map(<[f32]>::to_vec).collect(),
            extent: Some(field.extent().to_array()),
            ..HeightEntry::default()
        }),
        Shape::Volume(volume) => {
            let raw = RawVolume { size: volume.size(), format: SampleFormat::of(volume.samples()) };
            ShapeEntry::Volume(VolumeEntry {
                format: Some(raw.to_string()),
                samples: Some(packed(&sample_bytes(volume.samples()))?),
                spacing: Some(volume.spacing().to_array()),
                transfer: Some(volume.transfer.clone()),
                shell: volume.shell.as_ref().map(|shell| shell.form().clone()),
                ..VolumeEntry::default()
            })
        }
    })
}

fn mesh(entry: &MeshEntry, limits: &Limits) -> Result<Mesh, Fault> {
    if entry.positions.len() as u64 > limits.vertices || entry.triangles.len() as u64 > limits.triangles {
        return Err(Fault::over("the mesh has too many vertices or triangles", "vertices"));
    }
    let mesh = Mesh {
        positions: entry.positions.iter().copied().map(Vec3::from_array).collect(),
        normals: entry.normals.iter().copied().map(Vec3::from_array).collect(),
        uvs: entry.uvs.iter().copied().map(Vec2::from_array).collect(),
        colors: entry.colors.iter().copied().map(Vec3::from_array).collect(),
        triangles: entry.triangles.clone(),
        slots: entry.slots.clone(),
        segments: entry.segments.clone(),
    };
    mesh.check().map_err(|what| usage(what, "make the lists of the mesh fit each other"))?;
    if let Some(i) = mesh.positions.iter().position(|p| !p.is_finite()) {
        return Err(usage(format!("position {i} is not finite"), "give three numbers"));
    }
    Ok(mesh)
}

fn free_form(form: &Form, bounds: Option<[[f64; 3]; 2]>) -> Result<FreeForm, Fault> {
    if form.node_count() > MOST_FUNCTIONS {
        let what =
            format!("the form has {} functions, at most {MOST_FUNCTIONS} are taken", form.node_count());
        return Err(usage(what, "make several objects of it"));
    }
    check_form(form).map_err(|what| usage(what, "mend the form"))?;
    let built = match bounds {
        None => FreeForm::new(form.clone()),
        Some([min, max]) => {
            let (min, max) = (DVec3::from_array(min), DVec3::from_array(max));
            let sound =
                min.is_finite() && max.is_finite() && min.abs().max(max.abs()).max_element() <= LARGEST;
            if !sound || min.cmpge(max).any() {
                return Err(usage("`bounds` hold nothing", "give the smallest corner, then the largest"));
            }
            FreeForm::within(form.clone(), Aabb::new(min, max))
        }
    };
    built.map_err(|what| usage(what, "mend the form or its `bounds`"))
}

/// Checks the numbers of a form; the parser has bounded its depth.
fn check_form(form: &Form) -> Result<(), String> {
    let number = |name: &str, value: f64| {
        if value.abs() <= LARGEST { Ok(()) } else { Err(format!("`{name}` is {value}")) }
    };
    let positive = |name: &str, value: f64| {
        if value > 0.0 && value <= LARGEST {
            Ok(())
        } else {
            Err(format!("`{name}` must be positive, got {value}"))
        }
    };
    let vector = |name: &str, v: DVec3| v.to_array().into_iter().try_for_each(|c| number(name, c));
    let filled = |parts: &[Form]| if parts.is_empty() { Err("a set of no forms".to_owned()) } else { Ok(()) };
    match form {
        Form::Quadric(quadric) => quadric.0.iter().try_for_each(|&c| number("quadric", c)),
        Form::Ellipsoid { center, radii } => {
            vector("center", *center)?;
            radii.to_array().into_iter().try_for_each(|r| positive("radii", r))
        }
        Form::HalfSpace { normal, offset } => {
            vector("normal", *normal)?;
            number("offset", *offset)
        }
        Form::Cylinder { center, axis, radius } => {
            vector("center", *center)?;
            vector("axis", *axis)?;
            positive("radius", *radius)
        }
        Form::Torus { major, minor } => {
            positive("major", *major)?;
            positive("minor", *minor)
        }
        Form::Perturbed { base, terms } => {
            check_form(base)?;
            terms.iter().try_for_each(|term| {
                number("weight", term.weight)?;
                check_form(&term.function)
            })
        }
        Form::Union(parts) | Form::Intersection(parts) => {
            filled(parts)?;
            parts.iter().try_for_each(check_form)
        }
        Form::Difference(a, b) => check_form(a).and_then(|()| check_form(b)),
        Form::SmoothUnion { a, b, k } => {
            positive("k", *k)?;
            check_form(a).and_then(|()| check_form(b))
        }
        Form::Offset { form, amount } => {
            number("amount", *amount)?;
            check_form(form)
        }
        Form::Morph { from, to, t } => {
            number("t", *t)?;
            check_form(from).and_then(|()| check_form(to))
        }
    }
}

fn height_field(entry: &HeightEntry, source: &mut Source<'_>) -> Result<HeightField, Fault> {
    let extent = entry.extent.map(DVec2::from_array);
    if extent.is_some_and(|e| !(e.is_finite() && e.min_element() > 0.0))
        || entry.height.is_some_and(|h| !h.is_finite())
    {
        return Err(usage("`extent` or `height` is not positive", "give lengths in meters"));
    }
    match (&entry.file, entry.rows.first()) {
        (Some(file), None) => {
            super::read::with_included(file, source, |inner| height::read(inner, extent, entry.height))
        }
        (None, Some(first)) => {
            let columns = first.len();
            if let Some(row) = entry.rows.iter().position(|r| r.len() != columns) {
                let what = format!("row {row} has {} heights, row 0 has {columns}", entry.rows[row].len());
                return Err(usage(what, "make all rows as long as the first"));
            }
            let rows = entry.rows.len();
            let extent = extent.unwrap_or_else(|| {
                let cells = DVec2::new(columns.max(2) as f64 - 1.0, rows.max(2) as f64 - 1.0);
                cells * (2.0 / cells.max_element())
            });
            HeightField::new(columns as u32, rows as u32, extent, entry.rows.concat())
                .map_err(|what| usage(what, "give at least two rows of two heights"))
        }
        _ => Err(usage("a height field needs `file` or `rows`", "give one of them")),
    }
}

fn voxels(size: [u32; 3], cells: &str, limits: &Limits) -> Result<Voxels, Fault> {
    let [x, y, z] = size;
    let count = u128::from(x) * u128::from(y) * u128::from(z);
    if count == 0 || count > u128::from(limits.voxel_bytes) {
        return Err(Fault::over(format!("{x}x{y}x{z} voxels"), "voxel_bytes"));
    }
    let bytes = unpacked(cells, count as u64)?;
    if bytes.len() as u128 != count {
        return Err(usage(format!("{} cells for {x}x{y}x{z} voxels", bytes.len()), "give one byte a cell"));
    }
    Ok(Voxels::from_bytes(size, &bytes))
}

fn packed_cells(voxels: &Voxels) -> Result<String, String> {
    let [nx, ny, nz] = voxels.size().map(|s| s as usize);
    let count = nx.checked_mul(ny).and_then(|n| n.checked_mul(nz)).filter(|&n| n <= 1 << 30);
    let mut bytes = vec![0u8; count.ok_or("a grid of more than 2^30 cells does not fit into a scene file")?];
    voxels
        .for_each_filled(|[x, y, z], value| bytes[(z as usize * ny + y as usize) * nx + x as usize] = value);
    packed(&bytes)
}

fn volume_of(entry: &VolumeEntry, source: &mut Source<'_>) -> Result<(Volume, DAffine3), Fault> {
    let format: Option<RawVolume> = match &entry.format {
        Some(text) => Some(text.parse().map_err(|what: String| usage(what, "mend `format`"))?),
        None => None,
    };
    let (mut volume, turned) = match (&entry.file, &entry.samples, format) {
        (Some(file), None, volume) => {
            let options = LoadOptions { volume, ..LoadOptions::default() };
            super::read::with_included_options(file, source, &options, volume::read)?
        }
        (None, Some(samples), Some(format)) => {
            (inline_volume(samples, format, source.limits)?, DAffine3::IDENTITY)
        }
        _ => return Err(usage("a volume needs `file`, or `samples` and `format`", "give one of the two")),
    };
    if let Some(spacing) = entry.spacing {
        let transfer_of_file = volume.transfer.clone();
        let size = volume.size();
        volume = Volume::new(size, DVec3::from_array(spacing), volume.samples().clone())
            .map_err(|what| usage(what, "give three positive lengths"))?;
        volume.transfer = transfer_of_file;
        volume.transfer.reference_length = volume.spacing().min_element();
    }
    if let Some(transfer) = &entry.transfer {
        let ordered = transfer.points.windows(2).all(|p| p[0].value <= p[1].value);
        let sound = transfer.points.iter().all(|p| p.value.is_finite() && (0.0..=1.0).contains(&p.opacity));
        if !(ordered && sound && transfer.reference_length > 0.0 && transfer.reference_length.is_finite()) {
            let advice = "give points by rising value, opacities from 0 to 1, and a reference length above 0";
            return Err(usage("the transfer function makes no sense", advice));
        }
        volume.transfer = transfer.clone();
    }
    if let Some(preset) = entry.preset {
        if entry.transfer.is_some() {
            return Err(usage("a volume has both `transfer` and `preset`", "give one of the two"));
        }
        volume.transfer = TransferFunction::preset(preset, volume.spacing().min_element());
    }
    if let Some(shell) = &entry.shell {
        let bounds = volume.bounds();
        volume.shell = Some(free_form(shell, Some([bounds.min.to_array(), bounds.max.to_array()]))?);
    }
    Ok((volume, turned))
}

fn inline_volume(samples: &str, format: RawVolume, limits: &Limits) -> Result<Volume, Fault> {
    let count =
        format.size.iter().map(|&s| u128::from(s)).product::<u128>() * u128::from(format.format.bytes());
    if count > u128::from(limits.volume_bytes) {
        return Err(Fault::over(format!("a volume of {count} bytes"), "volume_bytes"));
    }
    let bytes = unpacked(samples, count as u64)?;
    let samples = match format.format {
        SampleFormat::U8 => Samples::U8(bytes),
        SampleFormat::I16 => {
            Samples::I16(bytes.chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect())
        }
        SampleFormat::U16 => {
            Samples::U16(bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect())
        }
        SampleFormat::F32 => Samples::F32(
            bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
        ),
    };
    Volume::new(format.size, DVec3::ONE, samples).map_err(|what| usage(what, "mend `format` or `samples`"))
}

fn sample_bytes(samples: &Samples) -> Vec<u8> {
    match samples {
        Samples::U8(list) => list.clone(),
        Samples::I16(list) => list.iter().flat_map(|v| v.to_le_bytes()).collect(),
        Samples::U16(list) => list.iter().flat_map(|v| v.to_le_bytes()).collect(),
        Samples::F32(list) => list.iter().flat_map(|v| v.to_le_bytes()).collect(),
    }
}

fn packed(bytes: &[u8]) -> Result<String, String> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    let packed = encoder.write_all(bytes).and_then(|()| encoder.finish());
    packed.map(|bytes| STANDARD.encode(bytes)).map_err(|error| error.to_string())
}

fn unpacked(text: &str, most: u64) -> Result<Vec<u8>, Fault> {
    let bytes = STANDARD
        .decode(text)
        .map_err(|error| usage(format!("the data is no base64 ({error})"), "write it with this program"))?;
    volume::unpack(&bytes, most)
}
