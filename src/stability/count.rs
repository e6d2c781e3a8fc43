//! What is counted in a case?

pub(super) use super::steady::Way;
use super::{draw, draw_measured, scenes::Setup, steady};
use crate::compare::REFERENCE;
use crate::framebuffer::{Channel, Framebuffer};
use crate::metrics::{Errors, color_rmse};
use crate::seam::{Frame, Need};
use crate::studio::{Studio, StudioError};

/// How far a camera moves in small steps, pixels.
const WAY_PX: f64 = 4.0;

/// Kinds of error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Count {
    /// Share of the seen area in which only one picture sees something, or the share of false shadows if larger.
    Silhouette,
    /// The 99th percentile of the distance error over the scene's distance, or the share of other objects if larger.
    Distance,
    /// Share of pixels off edges that show another object.
    WrongObject,
    /// Share of pixels that see nothing where the reference sees something.
    Hole,
    /// Share of pixels off edges whose shadow is the other way.
    Shadow,
    /// The 99th percentile of the difference of the surface's own color, where both see the same object.
    Albedo,
    /// Root mean square color difference.
    Color,
    /// Difference of the light that arrives in all, as a share of the reference's with many samples.
    Energy,
    /// Root mean square color difference to the back end's own picture of the first value.
    Change,
    /// Share of pixels that differ from a picture whose renderer never saw the scenes before.
    Edited,
    /// The same after an edit in the middle of a frame, of that frame and the next.
    EditedMidway,
    /// Share of pixels that differ from the picture of one thread.
    Threads,
    /// Share of pixels at which a form is not met where counting roots says.
    Roots,
    /// Share of the reference's objects that are not seen.
    Missing,
    /// Share of the cells within a shell of voxels that water from outside reaches.
    Flood(Way),
    /// Pixels that change from frame to frame beyond the reference's own, as a share of those.
    Toggles,
    /// Pixels whose shadow comes or goes, in the same way.
    ShadowToggles,
    /// Pixels whose color jumps from frame to frame beyond those of the same look over the reference, as a share of those.
    Flicker,
    /// The same for small jumps: borders of bands that wander.
    Crawl,
    /// Share of pixels with a line far from any border of objects.
    FalseLines,
    /// Share of the lines of a scene that has them that are not there.
    MissingLines,
    /// Pixels that are not finite, and 1 where it draws what must not be drawn.
    NotFinite,
    /// Exponent with which time or bytes grow from the value before.
    Growth,
}

/// What was drawn and counted.
pub(super) struct Drawn {
    pub(super) error: f64,
    pub(super) ms: f64,
    /// Time to prepare, milliseconds, where it counts.
    pub(super) prepare_ms: f64,
    pub(super) picture: Option<Framebuffer>,
    pub(super) reference: Option<Framebuffer>,
}

/// What is drawn to count one value.
pub(super) struct Trial<'a> {
    pub(super) backend: &'a str,
    /// As the back end draws it, perhaps in a better way.
    pub(super) own: Setup,
    /// As it is given.
    pub(super) plain: Setup,
    /// The case's first value.
    pub(super) first: &'a dyn Fn() -> Setup,
    /// The value before; the first has none.
    pub(super) before: Option<&'a dyn Fn() -> Setup>,
    /// Whether the reference is to draw the back end's own model.
    pub(super) is_method: bool,
}

impl Count {
    /// Draws what is to be compared, and counts.
    pub(super) fn count(self, studio: &mut Studio, trial: &Trial<'_>) -> Result<Drawn, StudioError> {
        let Trial { backend, own, plain, .. } = trial;
        let held = |setup: &Setup| Setup { settings: setup.ruler_settings.clone(), ..setup.clone() };
        match self {
            Self::Toggles => return toggles(studio, trial, REFERENCE, plain, differing),
            Self::ShadowToggles => return toggles(studio, trial, REFERENCE, plain, darkening),
            Self::Flicker | Self::Crawl => {
                let mut ruler = plain.clone();
                ruler.settings.push(("visibility", REFERENCE.to_owned()));
                let changes = if self == Self::Flicker { jumping } else { crawling };
                return toggles(studio, trial, backend, &ruler, changes);
            }
            Self::Growth => return growth(studio, trial),
            Self::Edited => return steady::edited(studio, backend, own),
            Self::EditedMidway => return steady::edited_midway(studio, backend, own),
            Self::Threads => return steady::threaded(studio, backend, own),
            Self::Roots => return steady::roots_missed(studio, trial),
            Self::Flood(way) => return steady::flooded(studio, trial, way),
            _ => {}
        }
        let (picture, ms) = draw(studio, backend, own)?;
        let against = |error: f64, picture: Framebuffer, reference: Option<Framebuffer>| Drawn {
            error,
            ms,
            prepare_ms: 0.0,
            picture: Some(picture),
            reference,
        };
        match self {
            Self::NotFinite => return Ok(against(picture.count_not_finite() as f64, picture, None)),
            Self::Change => {
                let before = draw(studio, backend, &(trial.first)())?.0;
                let error = color_rmse(&picture, &before).unwrap_or(0.0);
                return Ok(against(error, picture, Some(before)));
            }
            Self::FalseLines => {
                let mut bare = own.clone();
                bare.settings.push(("contours", "false".to_owned()));
                let bare = draw(studio, backend, &bare)?.0;
                let error = lines_amid_surfaces(&picture, &bare);
                return Ok(against(error, picture, Some(bare)));
            }
            Self::MissingLines => {
                let lined = Setup { scene: own.history[0].clone(), ..own.clone() };
                let lined = draw(studio, backend, &lined)?.0;
                let error = lines_missing(&picture, &lined);
                return Ok(against(error, picture, Some(lined)));
            }
            _ => {}
        }
        let mut setup = held(if own.is_moved { own } else { plain });
        if trial.is_method
            && let Some(model) = studio.renderer(backend)?.model()
        {
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
            Self::Color => color_rmse(&picture, &reference).unwrap_or(0.0),
            Self::Albedo => albedo_error(&picture, &reference),
            Self::Missing => steady::objects_missed(&picture, &reference),
            Self::Hole => {
                let seen = picture.id().iter().zip(reference.id()).filter(|(_, b)| **b != 0);
                let (holes, all) = seen.fold((0u32, 0u32), |(h, n), (a, _)| (h + u32::from(*a == 0), n + 1));
                f64::from(holes) / f64::from(all.max(1))
            }
            _ => geometry_error(self, &Errors::of_geometry(&picture, &reference), &reference),
        };
        Ok(against(error, picture, Some(reference)))
    }
}

/// Takes the exponent with which cost grows from the value before to this one: of the time to prepare, of the time to draw
/// and of the bytes held, whichever is largest. What costs next to nothing counts as if it cost a little.
fn growth(studio: &mut Studio, trial: &Trial<'_>) -> Result<Drawn, StudioError> {
    const LEAST_MS: f64 = 2.0;
    // A shadow map more or less is no growth.
    const LEAST_BYTES: f64 = 33_554_432.0;
    let mut cost = |setup: &Setup| -> Result<([f64; 3], Framebuffer, f64), StudioError> {
        let (first, ms, prepare_ms, bytes) = draw_measured(studio, trial.backend, setup)?;
        let (mut picture, mut best) = (first, ms);
        // The first frame of a size also finds the memory for it.
        for _ in 0..if ms < 200.0 { 2 } else { 1 } {
            best = best.min(studio.render(trial.backend, &setup.need.frame(), &mut picture)?.1);
        }
        Ok((
            [best.max(LEAST_MS), prepare_ms.max(LEAST_MS * 5.0), (bytes as f64).max(LEAST_BYTES)],
            picture,
            best,
        ))
    };
    let before = match trial.before {
        Some(setup) => Some((setup().load, cost(&setup())?.0)),
        None => None,
    };
    let (now, picture, ms) = cost(&trial.own)?;
    let error = before.map_or(0.0, |(load, before)| {
        let grown = (trial.own.load / load).ln();
        let exponents = now.iter().zip(before).map(|(now, before)| (now / before).ln() / grown);
        exponents.fold(0.0, f64::max)
    });
    Ok(Drawn { error, ms, prepare_ms: now[1], picture: Some(picture), reference: None })
}

/// Returns the 99th percentile of the albedo's largest difference, where both see the same object.
fn albedo_error(picture: &Framebuffer, reference: &Framebuffer) -> f64 {
    let same = picture.id().iter().zip(reference.id()).map(|(a, b)| a == b && *a != 0);
    let pairs = same.zip(picture.albedo().iter().zip(reference.albedo())).filter(|(same, _)| *same);
    let mut off: Vec<f32> = pairs.map(|(_, (a, b))| (*a - *b).abs().max_element()).collect();
    off.sort_unstable_by(f32::total_cmp);
    off.get(off.len() * 99 / 100).map_or(0.0, |&off| f64::from(off))
}

/// How far from a border of objects a line may lie that belongs to it, pixels.
const REACH: usize = 3;

/// Returns the share of pixels that have a line though all around belongs to one object.
fn lines_amid_surfaces(lined: &Framebuffer, bare: &Framebuffer) -> f64 {
    let (width, height) = (lined.width() as usize, lined.height() as usize);
    let (mut lines, mut all) = (0u32, 0u32);
    for y in REACH..height.saturating_sub(REACH) {
        for x in REACH..width.saturating_sub(REACH) {
            let at = |u: usize, v: usize| v * width + u;
            let id = bare.id()[at(x, y)];
            let amid = id != 0
                && (y - REACH..=y + REACH)
                    .all(|v| (x - REACH..=x + REACH).all(|u| bare.id()[at(u, v)] == id));
            if amid {
                all += 1;
                lines += u32::from(lined.color()[at(x, y)] != bare.color()[at(x, y)]);
            }
        }
    }
    f64::from(lines) / f64::from(all.max(1))
}

/// Returns the share of the dark pixels of a picture with lines that are bright in another.
fn lines_missing(picture: &Framebuffer, lined: &Framebuffer) -> f64 {
    let dark = |p: &Framebuffer, i: usize| p.color()[i].max_element() < 0.1;
    let wanted: Vec<usize> = (0..lined.color().len()).filter(|&i| dark(lined, i)).collect();
    let missing = wanted.iter().filter(|&&i| !dark(picture, i)).count();
    missing as f64 / wanted.len().max(1) as f64
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
    trial: &Trial<'_>,
    ruler: &str,
    plain: &Setup,
    changes: fn(&Framebuffer, &Framebuffer) -> u64,
) -> Result<Drawn, StudioError> {
    let mut last = None;
    let mut time = 0.0;
    let mut count = |studio: &mut Studio, backend: &str, setup: &Setup| -> Result<u64, StudioError> {
        let (first, _) = draw(studio, backend, setup)?;
        let need = &setup.need;
        let (mut target, mut before, mut changed) = (first.clone(), first, 0);
        let steps = (WAY_PX / setup.step_px).round() as usize;
        for step in 1..=steps {
            let frame = Frame { camera: moved(need, setup.step_px * step as f64, setup.distance) };
            time = studio.render(backend, &frame, &mut target)?.1;
            changed += changes(&target, &before);
            before = target.clone();
        }
        last = Some(target);
        Ok(changed)
    };
    let own = count(studio, trial.backend, &trial.own)?;
    let model = if trial.is_method { studio.renderer(trial.backend)?.model() } else { None };
    let scene = model.unwrap_or_else(|| plain.scene.clone());
    let theirs = count(studio, ruler, &Setup { scene, ..plain.clone() })?;
    let beyond = own.saturating_sub(theirs) as f64 / (theirs.max(1)) as f64;
    Ok(Drawn { error: beyond, ms: time, prepare_ms: 0.0, picture: None, reference: last })
}

fn differing(a: &Framebuffer, b: &Framebuffer) -> u64 {
    debug_assert!(a.channels().has(Channel::Id), "toggles are counted by object");
    a.id().iter().zip(b.id()).filter(|(a, b)| a != b).count() as u64
}

fn darkening(a: &Framebuffer, b: &Framebuffer) -> u64 {
    a.shadow().iter().zip(b.shadow()).filter(|(a, b)| (*a - *b).abs() > 0.5).count() as u64
}

/// Counts pixels whose color changes by more than a quarter of the full scale: a line that comes or goes.
fn jumping(a: &Framebuffer, b: &Framebuffer) -> u64 {
    changing(a, b, 0.25)
}

/// Counts pixels whose color changes by more than half of the least step between bands.
fn crawling(a: &Framebuffer, b: &Framebuffer) -> u64 {
    changing(a, b, 0.5 / 32.0)
}

fn changing(a: &Framebuffer, b: &Framebuffer, by: f32) -> u64 {
    let pairs = a.color().iter().zip(b.color());
    pairs.filter(|(a, b)| (**a - **b).abs().max_element() > by).count() as u64
}

/// Moves a camera sideways so that things at a distance move by so many pixels.
fn moved(need: &Need, pixels: f64, distance: f64) -> crate::camera::Camera {
    let size = need.camera.view(need.width, need.height).pixel_size(distance);
    let mut camera = need.camera.clone();
    camera.eye += camera.right() * (pixels * size);
    camera
}
