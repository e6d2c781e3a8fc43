//! Reads volumes: NRRD, NIfTI-1 and raw samples.
//!
//! The samples keep their order. A file that says how it lies in a patient (every NIfTI; NRRD with a `space`) is turned
//! so that the patient's head is up (y) and its face looks to -z; all other files keep their axes. The spacing is
//! taken as it stands, whatever its unit.

mod nifti;
mod nrrd;
mod samples;

use super::error::Fault;
use super::limits::SampleFormat;
use super::source::Source;
use crate::scene::{Material, Object, Samples, Scene, Shape, TransferFunction, Volume};
use glam::{DAffine3, DMat3, DVec3};
use samples::{FileFormat, Order};

pub(in crate::load) use samples::unpack;

/// Samples with their size, spacing and orientation.
struct Grid {
    size: [u32; 3],
    spacing: DVec3,
    samples: Samples,
    world_from_grid: DMat3,
}

/// Loads a volume as a scene of one object.
pub(in crate::load) fn load(source: &mut Source<'_>) -> Result<Scene, Fault> {
    let (volume, world_from_object) = read(source)?;
    let mut scene = Scene::default();
    let material = scene.add_material(Material::new(glam::Vec3::ONE));
    scene
        .objects
        .push(Object::new(source.name.clone(), Shape::Volume(volume), material).placed(world_from_object));
    Ok(scene)
}

/// Reads a volume and its orientation.
pub(super) fn read(source: &mut Source<'_>) -> Result<(Volume, DAffine3), Fault> {
    let grid = match source.extension.as_str() {
        "nrrd" | "nhdr" => nrrd::read(source)?,
        "nii" | "nii.gz" => nifti::read(source)?,
        _ => read_raw(source)?,
    };
    let mut volume = Volume::new(grid.size, grid.spacing, grid.samples).map_err(Fault::malformed)?;
    if matches!(volume.samples(), Samples::I16(_)) && volume.range()[0] <= -900.0 {
        // Air at -1000 tells Hounsfield units of a computed tomography.
        volume.transfer = TransferFunction::ct(grid.spacing.min_element());
    }
    if let Samples::F32(list) = volume.samples()
        && list.iter().any(|v| !v.is_finite())
    {
        source.notes.add("samples that are not finite are empty");
    }
    Ok((volume, DAffine3::from_mat3(grid.world_from_grid)))
}

fn read_raw(source: &mut Source<'_>) -> Result<Grid, Fault> {
    let Some(raw) = source.options.volume else {
        let what = "a raw volume does not say its size";
        return Err(Fault::unsupported(what, "say it: WxHxD:FORMAT, for example 256x256x128:u16"));
    };
    let format = match raw.format {
        SampleFormat::U8 => FileFormat::U8,
        SampleFormat::I16 => FileFormat::I16,
        SampleFormat::U16 => FileFormat::U16,
        SampleFormat::F32 => FileFormat::F32,
    };
    let bytes = std::mem::take(&mut source.bytes);
    let count = samples::count_samples(raw.size.map(u64::from), format, source.limits)?;
    if bytes.len() > count * format.bytes() {
        source.notes.add(format!(
            "the file has {} bytes more than {raw} needs",
            bytes.len() - count * format.bytes()
        ));
    }
    let samples = samples::read_raw(&bytes, count, format, Order::Little)?;
    Ok(Grid { size: raw.size, spacing: DVec3::ONE, samples, world_from_grid: DMat3::IDENTITY })
}

/// Replaces spacings that are zero, negative or not finite by one.
fn sound_spacing(spacing: DVec3, source: &mut Source<'_>) -> DVec3 {
    let sound = |s: f64| s.is_finite() && s > 0.0;
    if spacing.to_array().into_iter().all(sound) {
        return spacing;
    }
    source.notes.add(format!("the spacing {spacing} makes no sense, 1 is taken"));
    DVec3::from_array(spacing.to_array().map(|s| if sound(s) { s } else { 1.0 }))
}

/// Returns the map from right-anterior-superior to y up: right stays, superior is up, anterior is away.
fn z_up() -> DMat3 {
    DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y)
}

/// Returns the map from grid axes to the world, from their directions in right-anterior-superior space; nothing when
/// they are not at right angles.
fn upright([x, y, z]: [DVec3; 3]) -> Option<DMat3> {
    let axes = DMat3::from_cols(x, y, z);
    ((axes.determinant().abs() - 1.0).abs() < 1e-3).then(|| z_up() * axes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_are_up() {
        let world = upright([DVec3::X, DVec3::Y, DVec3::Z]).unwrap();
        assert_eq!(world * DVec3::Z, DVec3::Y);
        assert_eq!(world * DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 3.0, -2.0));
        assert_eq!(upright([DVec3::X, DVec3::X, DVec3::Z]), None);
    }
}
