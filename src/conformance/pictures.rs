//! Does it show what the reference shows?

use super::{Subject, drawing::draws, hold, scene};
use crate::camera::Projection;
use crate::compare::REFERENCE;
use crate::framebuffer::{Channel, Framebuffer};
use crate::metrics::{Errors, Gate};
use crate::picture;
use crate::seam::Need;

/// Smallest share of pixels off edges that show the object that the reference shows: where the shapes are within the
/// tolerance, and where the report says that they are not.
const SAME_OBJECT: [f64; 2] = [0.99, 0.9];

/// Shares of the angle of view that are looked at: the whole scene with its outlines, and from near, so that what is
/// wrong with the light is not thinned out by the background.
const VIEWS: [f64; 2] = [1.0, 0.3];

pub(super) fn picture(subject: &Subject) -> Result<(), String> {
    let photometric = subject.registry.info(&subject.backend).map_err(|e| e.to_string())?.photometric;
    let names = ["polyhedra", "quadrics", "figure", "terrain"];
    for (name, view) in names.into_iter().flat_map(|name| VIEWS.map(|view| (name, view))) {
        let scene = scene(name)?;
        let need = Need { tolerance_px: 0.5, ..subject.need(&scene, 192, 108)? };
        let mut need = Need { settings: Default::default(), ..need };
        if let Projection::Perspective { fov_y } = &mut need.camera.projection {
            *fov_y *= view;
        }
        let mut studio = subject.studio(2)?;
        let drawing = studio.draw(&subject.backend, &scene, &need).map_err(|e| e.to_string())?;
        let reference = studio.draw(REFERENCE, &scene, &need).map_err(|e| e.to_string())?.framebuffer;
        if !draws(&drawing) {
            continue;
        }
        let errors = Errors::between(&drawing.framebuffer, &reference);
        let within = scene.objects.iter().zip(drawing.prepared.objects.iter()).all(|(object, decision)| {
            decision.bound().is_some_and(|bound| bound <= need.world_tolerance(&object.bounds()))
        });
        // The normals of a converted shape, and so its light, may differ more than its place.
        let exact = drawing.prepared.objects.iter().all(|decision| decision.word() == "exact");
        let mut failed = Vec::new();
        let wanted = SAME_OBJECT[usize::from(!within)];
        if photometric && exact {
            failed.extend(Gate::EDGE_TOLERANT.judge(&errors, 192 * 108).failed);
        } else if errors.id_agreement.is_some_and(|share| share < wanted) {
            failed.push(format!("id agreement {:.5} < {wanted}", errors.id_agreement.unwrap_or(0.0)));
        }
        hold(failed.is_empty(), || {
            let kept = keep_pictures(subject, name, &drawing.framebuffer, &reference);
            format!("{name}: {}{kept}", failed.join(", "))
        })?;
    }
    Ok(())
}

/// Writes both pictures, and says where.
fn keep_pictures(subject: &Subject, scene: &str, drawn: &Framebuffer, reference: &Framebuffer) -> String {
    let Some(folder) = &subject.pictures else { return String::new() };
    let mut kept = String::new();
    for (what, framebuffer) in [("drawn", drawn), ("reference", reference)] {
        let path = folder.join(format!("{scene}-{what}.png"));
        let written = std::fs::create_dir_all(folder).is_ok()
            && picture::save(framebuffer, Channel::Color, &path).is_ok();
        if written {
            kept.push_str(&format!("; see {}", path.display()));
        }
    }
    kept
}
