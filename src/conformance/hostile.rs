//! Does it stand storms of edits, any parameters, and numbers that are none?

use super::{Random, Subject, hold, scene};
use crate::prelude::*;
use crate::seam::{Parameter, ParameterKind};
use std::sync::Arc;

pub(super) fn edits(subject: &Subject) -> Result<(), String> {
    let mut random = Random(subject.seed);
    let mut current = (*scene("polyhedra")?).clone();
    let more = scene("figure")?;
    let mut studio = subject.studio(2)?;
    for round in 0..20 {
        let index = random.below(current.objects.len());
        let what = match random.below(6) {
            0 => {
                current.objects[index].world_from_object.translation.x += random.share() - 0.5;
                "moved"
            }
            1 => {
                current.objects[index].visible = !current.objects[index].visible;
                "hidden or shown"
            }
            2 if current.objects.len() > 2 => {
                current.objects.remove(index);
                "removed"
            }
            3 => {
                let copy = current.objects[index].clone();
                current.objects.push(copy.at(DVec3::new(random.share(), random.share(), random.share())));
                "copied"
            }
            4 => {
                let color = Vec3::new(random.share() as f32, random.share() as f32, 0.5);
                let material = current.add_material(Material::new(color));
                current.objects[index].materials = vec![material];
                "painted"
            }
            _ => {
                current.objects[index].shape = more.objects[random.below(more.objects.len())].shape.clone();
                "exchanged"
            }
        };
        let edited = Arc::new(current.clone());
        let need = subject.need(&edited, 40, 24)?;
        let kept = studio.draw(&subject.backend, &edited, &need);
        let kept = kept.map_err(|e| format!("edit {round} ({what}): {e}"))?;
        let fresh = subject.draw(2, &edited, &need)?;
        let same = kept.framebuffer.same_bits(&fresh.framebuffer);
        hold(same, || format!("edit {round} ({what}): the picture is not that of the scene drawn anew"))?;
        hold(kept.prepared.objects == fresh.prepared.objects, || {
            format!("edit {round} ({what}): the decisions are not those of the scene drawn anew")
        })?;
    }
    Ok(())
}

pub(super) fn parameters(subject: &Subject) -> Result<(), String> {
    let declared = subject.registry.info(&subject.backend).map_err(|e| e.to_string())?.parameters.clone();
    let mut random = Random(subject.seed);
    let scene = scene("polyhedra")?;
    let mut studio = subject.studio(2)?;
    for _ in 0..if declared.is_empty() { 0 } else { 20 } {
        let mut need = subject.need(&scene, 24, 16)?;
        let mut set = Vec::new();
        for parameter in &declared {
            // What sets the size of conversions stays small.
            if parameter.name != "detail.resolution" && random.below(2) == 0 {
                let value = any_value(parameter, &mut random);
                let checked = need.settings.set(&subject.backend, &declared, parameter.name, &value);
                checked.map_err(|e| format!("its own range is refused: {e}"))?;
                set.push(format!("{}={value}", parameter.name));
            }
        }
        let set = set.join(" ");
        let picture = studio.draw(&subject.backend, &scene, &need).map_err(|e| format!("{set}: {e}"))?;
        let wild = picture.framebuffer.count_not_finite();
        hold(wild == 0, || format!("{set}: {wild} numbers are not finite"))?;
    }
    Ok(())
}

/// Returns an allowed value; of wide ranges those near the default, so that a check ends.
fn any_value(parameter: &Parameter, random: &mut Random) -> String {
    match parameter.kind {
        ParameterKind::Bool => (random.below(2) == 0).to_string(),
        ParameterKind::Int { min, max } => {
            let default = parameter.default.to_string().parse().unwrap_or(min);
            let (low, high) = (min.max(default / 4), max.min(default.saturating_mul(4).max(min + 4)));
            (low + random.below((high - low + 1).max(1) as usize) as i64).to_string()
        }
        ParameterKind::Float { min, max } => {
            let default: f64 = parameter.default.to_string().parse().unwrap_or(min);
            let (low, high) = (min.max(default * 0.25), max.min(default * 4.0).max(min));
            (low + (high - low).max(0.0) * random.share()).to_string()
        }
        ParameterKind::Choice { choices } => choices[random.below(choices.len())].to_owned(),
        ParameterKind::Color => format!("#{:06x}", random.below(1 << 24)),
        // What a line of text names need not be there; what is there by default is.
        ParameterKind::Text => parameter.default.to_string(),
    }
}

pub(super) fn wild_numbers(subject: &Subject) -> Result<(), String> {
    let plain = scene("polyhedra")?;
    let wild = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 1e-300, 0.0];
    let mut random = Random(subject.seed);
    let mut studio = subject.studio(2)?;
    for round in 0..30 {
        let mut scene = (*plain).clone();
        let index = random.below(scene.objects.len());
        let value = wild[random.below(wild.len())];
        let what = match random.below(6) {
            0 => {
                scene.objects[index].world_from_object.translation.y = value;
                "an object's place"
            }
            1 => {
                // Not 1e300: triangles for a body of that size would take minutes, and prove nothing.
                let length = if value.abs() == 1e300 { 1e4 } else { value };
                scene.objects[index].world_from_object.matrix3.x_axis.x = length;
                "an object's axis"
            }
            2 => {
                scene.lights.push(Light::point(DVec3::splat(value), value as f32));
                "a light"
            }
            3 => {
                let color = Vec3::splat(value as f32);
                let material =
                    scene.add_material(Material { shininess: value as f32, ..Material::new(color) });
                scene.objects[index].materials = vec![material];
                "a material"
            }
            4 => {
                let corner = value as f32;
                let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(0.0, corner, corner)];
                let mesh = Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() };
                scene.objects.push(Object::new("wild triangle", Shape::Mesh(mesh), 0));
                "a corner"
            }
            _ => {
                scene.objects[index].materials = vec![usize::MAX - 1, 12_345];
                "an index of a material"
            }
        };
        let scene = Arc::new(scene);
        let need = subject.need(&scene, 24, 16)?;
        // The picture may be what it wants; that there is one, or a line that says why not, is asked.
        if let Err(error) = studio.draw(&subject.backend, &scene, &need) {
            let line = error.to_string();
            let ended = line.contains("crashed") || line.contains("panicked");
            hold(!ended, || format!("round {round}: {what} is {value}: {line}"))?;
        }
    }
    let need = subject.need(&plain, 24, 16)?;
    studio.draw(&subject.backend, &plain, &need).map(|_| ()).map_err(|e| format!("after all: {e}"))
}
