//! How long does one picture take, and how far is it from the ruler?

use super::{Point, PointErrors, Request, Spread, Subject, TOLERANCE};
use crate::compare::REFERENCE;
use crate::framebuffer::{Channel, Channels, Framebuffer};
use crate::metrics::{Errors, color_rmse};
use crate::picture::{displayed, encode};
use crate::seam::{BackendInfo, Need, ParameterKind, Settings, Value};
use crate::studio::{Studio, StudioError};
use std::collections::BTreeMap;

/// Timed frames of a point: at least so many ...
const FRAMES: usize = 3;
/// ... and more while they take less than this, milliseconds.
const FRAMES_MS: f64 = 60.0;
/// A single frame that takes so long, milliseconds, is drawn twice and no more.
const SLOW_MS: f64 = 150.0;

/// The step through volumes that the ruler takes, in spacings.
const RULER_STEP: f64 = 0.1;

/// What pictures are held against.
struct Ruler {
    centers: Framebuffer,
    antialiased: Option<Framebuffer>,
}

/// A scene, ready to be drawn and measured.
pub(super) struct Bench<'a> {
    pub(super) studio: &'a mut Studio,
    pub(super) request: &'a Request,
    pub(super) subject: &'a Subject,
    reference: Ruler,
    /// Rulers of back ends with a look of their own.
    own: BTreeMap<String, Option<Ruler>>,
}

impl<'a> Bench<'a> {
    pub(super) fn new(
        studio: &'a mut Studio,
        request: &'a Request,
        subject: &'a Subject,
    ) -> Result<Self, StudioError> {
        let info = studio.registry().info(REFERENCE)?.clone();
        let mut settings = Settings::default();
        // The ruler's own parameters may be named otherwise in a plugin that took its place.
        let _ = settings.set(REFERENCE, &info.parameters, "volume.step", &RULER_STEP.to_string());
        let need = Need { channels: channels(), settings, ..base_need(request, subject) };
        let centers = studio.draw(REFERENCE, &subject.scene, &need)?.framebuffer;
        let many = Need { samples: request.ruler_samples, ..base_need(request, subject) };
        let antialiased = Some(studio.draw(REFERENCE, &subject.scene, &many)?.framebuffer);
        Ok(Self { studio, request, subject, reference: Ruler { centers, antialiased }, own: BTreeMap::new() })
    }

    /// Returns the ruler's picture as JPEG.
    pub(super) fn ruler_picture(&self) -> Vec<u8> {
        jpeg(&self.reference.centers)
    }

    /// Draws with some settings, or takes the point of an earlier run.
    pub(super) fn measure(
        &mut self,
        backend: &str,
        settings: &BTreeMap<String, Value>,
    ) -> Result<Point, StudioError> {
        let known = self
            .request
            .known
            .iter()
            .find(|p| p.scene == self.subject.name && p.backend == backend && p.settings == *settings);
        if let Some(point) = known {
            return Ok(point.clone());
        }
        let info = self.studio.registry().info(backend)?.clone();
        let need = self.need(&info, settings);
        let drawing = self.studio.draw(backend, &self.subject.scene, &need)?;
        let timed = Need { channels: Channels::COLOR, ..need.clone() };
        let (prepared, _) = self.studio.prepare(backend, &self.subject.scene, &timed)?;
        let mut target = Framebuffer::new(need.width, need.height, Channels::COLOR);
        let mut times = Vec::new();
        let is_slow = drawing.frame_ms > SLOW_MS;
        if !is_slow {
            self.studio.render(backend, &timed.frame(), &mut target)?;
        }
        let wanted = if is_slow { 2 } else { FRAMES };
        while times.len() < wanted || (times.iter().sum::<f64>() < FRAMES_MS && times.len() < 15) {
            times.push(self.studio.render(backend, &timed.frame(), &mut target)?.1);
        }
        let count = |word: &str| drawing.prepared.objects.iter().filter(|d| d.word() == word).count();
        Ok(Point {
            scene: self.subject.name.clone(),
            backend: backend.to_owned(),
            settings: settings.clone(),
            prepare_ms: drawing.prepare_ms,
            ms: Spread::of(&mut times),
            bytes: prepared.bytes,
            objects: ["exact", "converted", "approximated", "skipped"].map(count),
            errors: self.errors(&info, &need, &drawing.framebuffer)?,
            fingerprint: fingerprint(&drawing.framebuffer),
            picture: jpeg(&drawing.framebuffer),
        })
    }

    fn need(&self, info: &BackendInfo, settings: &BTreeMap<String, Value>) -> Need {
        let mut need = Need { channels: channels(), ..base_need(self.request, self.subject) };
        need.settings = self.request.settings.get(&info.id).cloned().unwrap_or_default();
        for (name, value) in settings {
            match value {
                Value::Float(px) if name == TOLERANCE => need.tolerance_px = *px,
                _ => {
                    let taken = need.settings.set(&info.id, &info.parameters, name, &value.to_string());
                    debug_assert_eq!(taken, Ok(()), "a declared axis refuses its own value");
                }
            }
        }
        need
    }

    fn errors(
        &mut self,
        info: &BackendInfo,
        need: &Need,
        picture: &Framebuffer,
    ) -> Result<PointErrors, StudioError> {
        if !info.photometric && !self.own.contains_key(&info.id) {
            let ruler = self.own_ruler(info)?;
            self.own.insert(info.id.clone(), ruler);
        }
        let geometry = Errors::of_geometry(picture, &self.reference.centers);
        let ruler = if info.photometric {
            Some(&self.reference)
        } else {
            self.own.get(&info.id).and_then(Option::as_ref)
        };
        // Only one sample a pixel shows what the ruler shows at the centers.
        let samples = info
            .parameters
            .iter()
            .any(|p| p.tag == "samples" && *need.settings.get(&info.parameters, p.name) != Value::Int(1));
        Ok(PointErrors {
            color: ruler.filter(|_| !samples).and_then(|r| color_rmse(picture, &r.centers)),
            antialiased: ruler.and_then(|r| color_rmse(picture, r.antialiased.as_ref()?)),
            distance: geometry.distance.map(|d| d.relative),
            normal_deg: geometry.normal_deg.map(|n| n.mean),
            silhouette: geometry.silhouette_iou.map(|iou| 1.0 - iou),
        })
    }

    /// Draws the ruler of a back end with a look of its own: the same look over what the reference sees. None where
    /// it cannot be told to look through the reference.
    fn own_ruler(&mut self, info: &BackendInfo) -> Result<Option<Ruler>, StudioError> {
        let through = info
            .parameters
            .iter()
            .find(|p| matches!(p.kind, ParameterKind::Choice { choices } if choices.contains(&REFERENCE)));
        let Some(parameter) = through else { return Ok(None) };
        let settings = BTreeMap::from([(parameter.name.to_owned(), Value::Text(REFERENCE.to_owned()))]);
        let need = self.need(info, &settings);
        let centers = self.studio.draw(&info.id, &self.subject.scene, &need)?.framebuffer;
        Ok(Some(Ruler { centers, antialiased: None }))
    }
}

/// Camera and size of all pictures of a scene.
fn base_need(request: &Request, subject: &Subject) -> Need {
    Need::new(subject.camera.clone(), request.width, request.height)
}

fn channels() -> Channels {
    Channels::of(&[Channel::Color, Channel::Distance, Channel::Normal, Channel::Id])
}

fn jpeg(picture: &Framebuffer) -> Vec<u8> {
    // A picture without pixels has no JPEG, and needs none.
    encode(&displayed(picture, Channel::Color), picture.width(), picture.height(), "jpg").unwrap_or_default()
}

/// Mixes the color and distance planes into a number (FNV-1a).
fn fingerprint(picture: &Framebuffer) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    let colors = picture.color().iter().flat_map(glam::Vec3::to_array);
    for value in colors.chain(picture.distance().iter().copied()) {
        hash = (hash ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3);
    }
    hash
}
