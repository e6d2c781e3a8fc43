//! Turns places, lights and cameras of scene files into those of the scene, and back.

use super::schema_views::{CameraEntry, LightEntry, LightKindEntry, ProjectionEntry, Scale, TransformEntry};
use crate::camera::{Camera, Projection};
use crate::load::error::Fault;
use crate::projector::Projector;
use crate::scene::{Light, LightKind};
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// Builds a transform.
pub(super) fn transform(entry: &TransformEntry) -> Result<DAffine3, Fault> {
    let built = if let Some([x, y, z]) = entry.matrix {
        let others = [
            entry.translate.is_some(),
            entry.rotate_deg.is_some(),
            entry.quaternion.is_some(),
            entry.scale.is_some(),
        ];
        if others.contains(&true) {
            return Err(usage("`matrix` stands beside other fields", "give either a matrix or its parts"));
        }
        let column = |i: usize| DVec3::new(x[i], y[i], z[i]);
        DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
    } else {
        let rotation = match (entry.rotate_deg, entry.quaternion) {
            (Some(_), Some(_)) => {
                return Err(usage("`rotate_deg` stands beside `quaternion`", "give one of them"));
            }
            (Some(angles), None) => {
                let [x, y, z] = angles.map(f64::to_radians);
                DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x)
            }
            (None, Some(q)) => {
                let q = DQuat::from_array(q);
                if !(q.is_finite() && q.length_squared() > 0.0) {
                    return Err(usage(
                        "`quaternion` has no direction",
                        "give four numbers that are not all 0",
                    ));
                }
                q.normalize()
            }
            (None, None) => DQuat::IDENTITY,
        };
        let scale = match entry.scale {
            None => DVec3::ONE,
            Some(Scale::Uniform(s)) => DVec3::splat(s),
            Some(Scale::Axes(x, y, z)) => DVec3::new(x, y, z),
        };
        let translation = entry.translate.map_or(DVec3::ZERO, DVec3::from_array);
        DAffine3::from_scale_rotation_translation(scale, rotation, translation)
    };
    let determinant = built.matrix3.determinant();
    if !built.is_finite() || determinant == 0.0 || !determinant.is_finite() {
        return Err(usage(
            "the transform squeezes the object to nothing or is not finite",
            "give a scale that is not 0",
        ));
    }
    Ok(built)
}

/// Describes a transform so that it reads back exactly: a scale and a translation where that is all, else a matrix.
pub(super) fn transform_entry(map: &DAffine3) -> TransformEntry {
    let m = map.matrix3;
    let scale = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
    if m != DMat3::from_diagonal(scale) {
        let row = |i: usize| [m.x_axis[i], m.y_axis[i], m.z_axis[i], map.translation[i]];
        return TransformEntry { matrix: Some([row(0), row(1), row(2)]), ..TransformEntry::default() };
    }
    let factors = if scale.x == scale.y && scale.x == scale.z {
        Scale::Uniform(scale.x)
    } else {
        Scale::Axes(scale.x, scale.y, scale.z)
    };
    TransformEntry {
        translate: (map.translation != DVec3::ZERO).then(|| map.translation.to_array()),
        scale: (scale != DVec3::ONE).then_some(factors),
        ..TransformEntry::default()
    }
}

/// Builds a light.
pub(super) fn light(entry: &LightEntry) -> Result<Light, Fault> {
    let direction = |d: [f64; 3]| {
        let d = DVec3::from_array(d);
        let points = d.is_finite() && d.length_squared() > 0.0;
        points
            .then_some(d)
            .ok_or_else(|| usage("`direction` points nowhere", "give three numbers that are not all 0"))
    };
    let position = |p: [f64; 3]| {
        let p = DVec3::from_array(p);
        p.is_finite().then_some(p).ok_or_else(|| usage("`position` is not finite", "give three numbers"))
    };
    let kind = match entry.kind {
        LightKindEntry::Directional { direction: d } => LightKind::Directional { direction: direction(d)? },
        LightKindEntry::Point { position: p } => LightKind::Point { position: position(p)? },
        LightKindEntry::Spot { position: p, direction: d, inner_deg, outer_deg } => {
            if !(0.0 <= inner_deg && inner_deg < outer_deg && outer_deg <= 180.0) {
                let what = format!("the cone goes from {inner_deg} to {outer_deg} degrees");
                return Err(usage(what, "give `inner_deg` below `outer_deg`, up to 180"));
            }
            let (inner, outer) = (inner_deg.to_radians(), outer_deg.to_radians());
            LightKind::Spot { position: position(p)?, direction: direction(d)?, inner, outer }
        }
    };
    if !(entry.intensity.is_finite() && entry.intensity >= 0.0 && entry.color.min_element() >= 0.0) {
        return Err(usage("the light is negative or not finite", "give `intensity` and `color` from 0 up"));
    }
    Ok(Light { kind, color: entry.color, intensity: entry.intensity, casts_shadow: entry.casts_shadow })
}

/// Describes a light.
pub(super) fn light_entry(light: &Light) -> LightEntry {
    let kind = match light.kind {
        LightKind::Directional { direction } => {
            LightKindEntry::Directional { direction: direction.to_array() }
        }
        LightKind::Point { position } => LightKindEntry::Point { position: position.to_array() },
        LightKind::Spot { position, direction, inner, outer } => LightKindEntry::Spot {
            position: position.to_array(),
            direction: direction.to_array(),
            inner_deg: inner.to_degrees(),
            outer_deg: outer.to_degrees(),
        },
    };
    LightEntry { kind, color: light.color, intensity: light.intensity, casts_shadow: light.casts_shadow }
}

/// Builds a camera.
pub(super) fn camera(entry: &CameraEntry) -> Result<Camera, Fault> {
    let [eye, target, up] = [entry.eye, entry.target, entry.up].map(DVec3::from_array);
    if !(eye.is_finite() && target.is_finite() && up.is_finite()) || eye == target {
        return Err(usage("`eye` and `target` are the same or not finite", "give two different points"));
    }
    let angle = |name: &str, degrees: f64, most: f64| {
        if degrees > 0.0 && degrees <= most {
            return Ok(degrees.to_radians());
        }
        Err(usage(format!("`{name}` is {degrees}"), format!("give an angle above 0 up to {most} degrees")))
    };
    let projection = match entry.projection {
        ProjectionEntry::Perspective { fov_y_deg } => {
            Projection::Perspective { fov_y: angle("fov_y_deg", fov_y_deg, 179.0)? }
        }
        ProjectionEntry::Orthographic { height } if height > 0.0 && height.is_finite() => {
            Projection::Orthographic { height }
        }
        ProjectionEntry::Orthographic { height } => {
            return Err(usage(format!("`height` is {height}"), "give a height above 0"));
        }
        ProjectionEntry::Fisheye { fov_deg } => {
            Projection::Fisheye { fov: angle("fov_deg", fov_deg, 360.0)? }
        }
        ProjectionEntry::Cylindrical { fov_x_deg, fov_y_deg } => Projection::Cylindrical {
            fov_x: angle("fov_x_deg", fov_x_deg, 360.0)?,
            fov_y: angle("fov_y_deg", fov_y_deg, 179.0)?,
        },
        ProjectionEntry::Projector { at, toward, fov_y_deg, aspect, screen } => {
            let fov_y = angle("fov_y_deg", fov_y_deg, 179.0)?;
            if !(0.01..=100.0).contains(&aspect) {
                return Err(usage(format!("`aspect` is {aspect}"), "give a number from 0.01 to 100"));
            }
            let [at, toward] = [at, toward].map(DVec3::from_array);
            let lens = Camera::look_at(at, toward, up, Projection::Perspective { fov_y });
            // A table as fine as for a picture of that height.
            return Projector { lens, screen }
                .camera(eye, (aspect * 1080.0) as u32, 1080)
                .map_err(|e| usage(e, "give finite places and a radius above 0"));
        }
    };
    Ok(Camera::look_at(eye, target, up, projection))
}

/// Describes a camera; nothing for warp tables, which are not written.
pub(super) fn camera_entry(name: &str, camera: &Camera) -> Option<CameraEntry> {
    let projection = match camera.projection {
        Projection::Perspective { fov_y } => ProjectionEntry::Perspective { fov_y_deg: fov_y.to_degrees() },
        Projection::Orthographic { height } => ProjectionEntry::Orthographic { height },
        Projection::Fisheye { fov } => ProjectionEntry::Fisheye { fov_deg: fov.to_degrees() },
        Projection::Cylindrical { fov_x, fov_y } => {
            ProjectionEntry::Cylindrical { fov_x_deg: fov_x.to_degrees(), fov_y_deg: fov_y.to_degrees() }
        }
        Projection::Warp(_) => return None,
    };
    Some(CameraEntry {
        name: name.to_owned(),
        eye: camera.eye.to_array(),
        target: (camera.eye + camera.forward()).to_array(),
        up: camera.up().to_array(),
        projection,
    })
}

/// A fault of the author, who can mend it.
pub(super) fn usage(what: impl Into<String>, advice: impl Into<std::borrow::Cow<'static, str>>) -> Fault {
    Fault::malformed(what).advise(advice)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_projector_is_a_camera_of_its_viewer() {
        let text = r##"(name: "dome", eye: (1, 0, 0.5), target: (1, 0, -4), projection: Projector(at: (0, 0, 2),
            toward: (0, 1, -5), fov_y_deg: 70, aspect: 1.6, screen: Dome(center: (0, 0, 0), radius: 5)))"##;
        let entry: CameraEntry = ron::from_str(text).unwrap();
        let built = camera(&entry).unwrap();
        assert_eq!(built.eye, DVec3::new(1.0, 0.0, 0.5));
        // What is thrown upon the middle of the picture lies behind where the lens looks.
        let lens = (DVec3::new(0.0, 1.0, -5.0) - DVec3::new(0.0, 0.0, 2.0)).normalize_or_zero();
        let ray = built.view(1728, 1080).ray(864.0, 540.0).unwrap();
        let on_dome = (0..9000).map(|i| DVec3::new(0.0, 0.0, 2.0) + lens * f64::from(i) * 1e-3);
        let point =
            on_dome.min_by(|a, b| (a.length() - 5.0).abs().total_cmp(&(b.length() - 5.0).abs())).unwrap();
        assert!(ray.direction.angle_between(point - built.eye) < 2e-3, "{}", ray.direction);
        let ProjectionEntry::Projector { at, toward, fov_y_deg, screen, .. } = entry.projection else {
            panic!()
        };
        for aspect in [0.0, f64::NAN] {
            let projection = ProjectionEntry::Projector { at, toward, fov_y_deg, aspect, screen };
            assert!(camera(&CameraEntry { projection, ..entry.clone() }).is_err());
        }
    }

    #[test]
    fn angles_turn_around_x_then_y_then_z() {
        let entry = TransformEntry {
            translate: Some([1.0, 0.0, 0.0]),
            rotate_deg: Some([90.0, 0.0, 90.0]),
            scale: Some(Scale::Uniform(2.0)),
            ..TransformEntry::default()
        };
        // y becomes z by the first turn, and z stays by the last
        let moved = transform(&entry).unwrap().transform_point3(DVec3::Y);
        assert!((moved - DVec3::new(1.0, 0.0, 2.0)).length() < 1e-12, "{moved}");
    }

    #[test]
    fn transforms_read_back_exactly() {
        let turned = DAffine3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.3);
        let scaled =
            DAffine3::from_scale_rotation_translation(DVec3::new(1.0, 2.0, 0.1), DQuat::IDENTITY, DVec3::X);
        for map in [DAffine3::IDENTITY, turned, scaled] {
            assert_eq!(transform(&transform_entry(&map)).unwrap(), map);
        }
        let flat = TransformEntry { scale: Some(Scale::Axes(1.0, 0.0, 1.0)), ..TransformEntry::default() };
        assert!(transform(&flat).is_err());
    }
}
