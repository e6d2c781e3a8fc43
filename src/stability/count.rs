//! What is counted in a case?

use super::{draw, scenes::Setup};
use crate::compare::REFERENCE;
use crate::framebuffer::{Channel, Framebuffer};
use crate::metrics::{Errors, color_rmse};
use crate::seam::{Frame, Need};
use crate::studio::{Studio, StudioError};

/// Frames of a camera that moves by a share of a pixel.
const STEPS: usize = 16;

/// Kinds of error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Count {
    /// Share of the seen area in which only one picture sees something, or the share of false shadows if larger.
    Silhouette,
    /// The 99th percentile of the distance error over the scene's distance, or the share of other objects if larger.
    Distance,
    /// Share of pixels off edges that show another object.
    WrongObject,
    /// Share of pixels off edges whose shadow is the other way.
    Shadow,
    /// Difference of the light that arrives in all, as a share of the reference's with many samples.
    Energy,
    /// Root mean square color difference to the back end's own picture of the first value.
    Change,
    /// Pixels that change from frame to frame beyond the reference's own, as a share of those.
    Toggles,
    /// Pixels whose color jumps from frame to frame beyond those of the same look over the reference, as a share of those.
    Flicker,
    /// Pixels that are not finite, and 1 where it draws what must not be drawn.
    NotFinite,
    /// Time against the first value, over the growth of the load: above 1 it grows faster than in proportion.
    Growth,
}

/// What was drawn and counted.
pub(super) struct Drawn {
    pub(super) error: f64,
    pub(super) ms: f64,
    pub(super) picture: Option<Framebuffer>,
    pub(super) reference: Option<Framebuffer>,
}

impl Count {
    /// Draws `own` with the back end, `plain` with the reference, and counts.
    pub(super) fn count(
        self,
        studio: &mut Studio,
        backend: &str,
        own: &Setup,
        plain: &Setup,
        first: &dyn Fn() -> Setup,
        against_model: bool,
    ) -> Result<Drawn, StudioError> {
        if self == Self::Toggles {
            return toggles(studio, [backend, REFERENCE], own, plain, differing);
        }
        if self == Self::Flicker {
            let mut ruler = plain.clone();
            ruler.settings.push(("visibility", REFERENCE));
            return toggles(studio, [backend, backend], own, &ruler, jumping);
        }
        let (picture, ms) = draw(studio, backend, own)?;
        let alone =
            |error: f64, picture: Framebuffer| Drawn { error, ms, picture: Some(picture), reference: None };
        match self {
            Self::NotFinite => return Ok(alone(picture.count_not_finite() as f64, picture)),
            Self::Change => {
                let before = draw(studio, backend, &first())?.0;
                let error = color_rmse(&picture, &before).unwrap_or(0.0);
                return Ok(Drawn { error, ms, picture: Some(picture), reference: Some(before) });
            }
            Self::Growth => {
                let easy = first();
                let fastest = |studio: &mut Studio, setup: &Setup| -> Result<f64, StudioError> {
                    let mut best = f64::INFINITY;
                    for _ in 0..3 {
                        best = best.min(draw(studio, backend, setup)?.1);
                    }
                    Ok(best)
                };
                let (time, base) = (fastest(studio, own)?, fastest(studio, &easy)?);
                return Ok(alone(time / base.max(1e-3) / (own.load / easy.load), picture));
            }
            _ => {}
        }
        let mut setup = if own.is_moved { own.clone() } else { plain.clone() };
        if against_model && let Some(model) = studio.renderer(backend)?.model() {
            setup.scene = model;
        }
        if self == Self::Energy {
            setup.need.samples = 64;
        }
        let reference = draw(studio, REFERENCE, &setup)?.0;
        let error = match self {
            Self::Energy => {
                let light = |p: &Framebuffer| {
                    p.color().iter().map(|c| f64::from(c.x)).sum::<f64>() / p.color().len().max(1) as f64
                };
                (light(&picture) - light(&reference)).abs() / light(&reference).max(1e-12)
            }
            _ => geometry_error(self, &Errors::of_geometry(&picture, &reference), &reference),
        };
        Ok(Drawn { error, ms, picture: Some(picture), reference: Some(reference) })
    }
}

fn geometry_error(count: Count, errors: &Errors, reference: &Framebuffer) -> f64 {
    let wrong = 1.0 - errors.id_agreement.unwrap_or(1.0);
    match count {
        Count::Silhouette => {
            let outside = 1.0 - errors.silhouette_iou.unwrap_or(1.0);
            outside.max(1.0 - errors.shadow_agreement.unwrap_or(1.0))
        }
        Count::Shadow => 1.0 - errors.shadow_agreement.unwrap_or(1.0),
        Count::Distance => {
            let seen = reference.distance().iter().filter(|d| d.is_finite());
            let (sum, count) = seen.fold((0.0, 0u32), |(sum, n), d| (sum + f64::from(*d), n + 1));
            let mean = sum / f64::from(count.max(1));
            let p99 = errors.distance.map_or(0.0, |d| d.p99);
            wrong.max(p99 / mean.max(1e-30))
        }
        _ => wrong,
    }
}

/// Moves the camera sideways by small steps and counts pixels that show something else than before, with a back end and
/// with what it is held against.
fn toggles(
    studio: &mut Studio,
    [backend, ruler]: [&str; 2],
    own: &Setup,
    plain: &Setup,
    changes: fn(&Framebuffer, &Framebuffer) -> u64,
) -> Result<Drawn, StudioError> {
    let mut last = None;
    let mut time = 0.0;
    let mut count = |backend: &str, setup: &Setup| -> Result<u64, StudioError> {
        let (first, _) = draw(studio, backend, setup)?;
        let need = &setup.need;
        let (mut target, mut before, mut changed) = (first.clone(), first, 0);
        for step in 1..=STEPS {
            let frame = Frame { camera: moved(need, setup.step_px * step as f64, setup.distance) };
            time = studio.render(backend, &frame, &mut target)?.1;
            changed += changes(&target, &before);
            before = target.clone();
        }
        last = Some(target);
        Ok(changed)
    };
    let own = count(backend, own)?;
    let theirs = count(ruler, plain)?;
    let beyond = own.saturating_sub(theirs) as f64 / (theirs.max(1)) as f64;
    Ok(Drawn { error: beyond, ms: time, picture: None, reference: last })
}

fn differing(a: &Framebuffer, b: &Framebuffer) -> u64 {
    debug_assert!(a.channels().has(Channel::Id), "toggles are counted by object");
    a.id().iter().zip(b.id()).filter(|(a, b)| a != b).count() as u64
}

/// Counts pixels whose color changes by more than a quarter of the full scale: a line that comes or goes.
fn jumping(a: &Framebuffer, b: &Framebuffer) -> u64 {
    let pairs = a.color().iter().zip(b.color());
    pairs.filter(|(a, b)| (**a - **b).abs().max_element() > 0.25).count() as u64
}

/// Moves a camera sideways so that things at a distance move by so many pixels.
fn moved(need: &Need, pixels: f64, distance: f64) -> crate::camera::Camera {
    let size = need.camera.view(need.width, need.height).pixel_size(distance);
    let mut camera = need.camera.clone();
    camera.eye += camera.right() * (pixels * size);
    camera
}
