//! Reads pictures as height maps.
//!
//! The longer side is 2 m, the other in proportion of the samples; the heights between the lowest and the highest
//! value span a fifth of the longer side, from 0 up. The first row of the picture is the far border (-z).

use super::error::Fault;
use super::image::decode_picture;
use super::source::Source;
use crate::scene::{HeightField, Material, Object, Scene, Shape};
use glam::{DVec2, Vec3};
use image::DynamicImage;

/// Length of the longer side in meters.
const LONGER_SIDE: f64 = 2.0;
/// Height over the range of values, as a share of the longer side.
const RELIEF: f64 = 0.2;

/// Loads a picture as a scene of one height field.
pub(super) fn load(source: &mut Source<'_>) -> Result<Scene, Fault> {
    let field = read(source, None, None)?;
    let mut scene = Scene::default();
    let material = scene.add_material(Material::new(Vec3::new(0.62, 0.58, 0.50)));
    scene.objects.push(Object::new(source.name.clone(), Shape::HeightField(field), material));
    Ok(scene)
}

/// Reads a height field; `extent` and `height` are those of the file's owner where he says them.
pub(super) fn read(
    source: &mut Source<'_>,
    extent: Option<DVec2>,
    height: Option<f64>,
) -> Result<HeightField, Fault> {
    let bytes = std::mem::take(&mut source.bytes);
    let picture = decode_picture(&bytes, &format!("map.{}", source.extension), source.limits)?;
    drop(bytes);
    let (mut columns, mut rows) = (picture.width(), picture.height());
    let mut values = gray_values(picture);
    let bad = values.iter().filter(|v| !v.is_finite()).count();
    if bad > 0 {
        source.notes.add(format!("{bad} heights that are not finite are taken as 0"));
        values.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
    }
    if columns == 1 {
        values = values.iter().flat_map(|&v| [v, v]).collect();
        columns = 2;
        source.notes.add("the picture is one sample wide, its column is doubled");
    }
    if rows == 1 {
        values.extend_from_within(..);
        rows = 2;
        source.notes.add("the picture is one sample high, its row is doubled");
    }
    let extent = extent.unwrap_or_else(|| {
        let cells = DVec2::new(f64::from(columns - 1), f64::from(rows - 1));
        cells * (LONGER_SIDE / cells.max_element())
    });
    let height = height.unwrap_or(RELIEF * extent.max_element());
    let (low, high) =
        values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)));
    let (low, range) = (f64::from(low), f64::from(high) - f64::from(low));
    let scale = if range > 0.0 { height / range } else { 0.0 };
    let heights = values.iter().map(|&v| ((f64::from(v) - low) * scale) as f32).collect();
    HeightField::new(columns, rows, extent, heights).map_err(Fault::malformed)
}

/// Returns gray values in full depth; colors by their luminance.
fn gray_values(picture: DynamicImage) -> Vec<f32> {
    match picture {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            picture.into_luma16().as_raw().iter().map(|&v| f32::from(v) / 65535.0).collect()
        }
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => picture.to_luma32f().into_raw(),
        other => other.into_luma8().as_raw().iter().map(|&v| f32::from(v) / 255.0).collect(),
    }
}
