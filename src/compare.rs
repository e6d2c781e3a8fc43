//! How does every back end draw a scene, beside the reference?

use crate::framebuffer::{Channel, Channels, Framebuffer};
use crate::metrics::{Errors, Gate, Verdict, color_rmse};
use crate::parallel::Threads;
use crate::scene::Scene;
use crate::seam::{Decision, Need, Origin, Settings};
use crate::studio::{Studio, StudioError};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The id of the back end that all others are held against.
pub const REFERENCE: &str = "reference";

/// What to compare.
#[derive(Clone, Debug)]
pub struct Request {
    /// Back ends beside the reference.
    pub backends: Vec<String>,
    /// Camera, size, tolerance and samples for all of them; channels are added as the comparison needs them.
    pub need: Need,
    /// Settings of each back end.
    pub settings: BTreeMap<String, Settings>,
    /// Frames drawn to take the median time of; at most as many as fit into a second.
    pub frames: u32,
}

/// All back ends' pictures of a scene with times and errors.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Name of the scene.
    pub scene: String,
    /// Name and kind of shape of each object.
    pub objects: Vec<(String, &'static str)>,
    /// Lines that the loader noted.
    pub notes: Vec<String>,
    /// Columns of the pictures.
    pub width: u32,
    /// Rows of the pictures.
    pub height: u32,
    /// Threads that were used.
    pub threads: usize,
    /// The reference first, then the others.
    pub panels: Vec<Panel>,
    /// What was chosen automatically, and what it turned out to be; nothing when nobody asked for a choice.
    pub choice: Option<crate::auto::Outcome>,
    /// Back ends in libraries that failed, and why: they have no panel, and the others are untouched.
    pub failures: Vec<(String, StudioError)>,
}

/// One back end's picture.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Id of the back end.
    pub backend: String,
    /// Its name for people.
    pub name: String,
    /// Parameters that were set.
    pub settings: Settings,
    /// The picture.
    pub picture: Framebuffer,
    /// Time to prepare, milliseconds.
    pub prepare_ms: f64,
    /// Median time of a frame, milliseconds.
    pub frame_ms: f64,
    /// Bytes held for the scene.
    pub bytes: u64,
    /// How each object was drawn.
    pub decisions: Arc<[Decision]>,
    /// Errors against the reference; nothing for the reference itself.
    pub errors: Option<Errors>,
    /// Where the color error comes from.
    pub split: Split,
    /// Whether it is the same picture; nothing for the reference, and for back ends that mean to differ.
    pub gate: Option<Verdict>,
}

/// The root mean square color error by its causes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Split {
    /// Of the representation: the reference's picture of the back end's own model against the reference's
    /// picture of the scene as given. 0 where nothing was converted.
    pub model: Option<f64>,
    /// Of the algorithm: the back end's picture against the reference's picture of the same model.
    pub method: Option<f64>,
}

impl Comparison {
    /// Tells whether every gate held.
    #[must_use]
    pub fn all_gates_hold(&self) -> bool {
        self.panels.iter().all(|p| p.gate.as_ref().is_none_or(|g| g.passed))
    }
}

/// Channels of a comparison.
pub(crate) fn compared_channels() -> Channels {
    Channels::of(&[
        Channel::Color,
        Channel::Distance,
        Channel::Normal,
        Channel::Id,
        Channel::Albedo,
        Channel::Shadow,
    ])
}

/// Draws a scene with the reference and every back end of the request; `progress` is told before each step.
///
/// # Errors
/// When a back end is unknown or refuses the scene.
pub fn compare(
    studio: &mut Studio,
    scene: &Arc<Scene>,
    request: &Request,
    progress: &mut dyn FnMut(&str),
) -> Result<Comparison, StudioError> {
    let mut work = Work { studio, scene, request, reference: None };
    let (mut panels, mut failures) = (Vec::new(), Vec::new());
    progress(REFERENCE);
    let ruler = work.draw(REFERENCE)?;
    work.reference = Some(ruler.picture.clone());
    panels.push(ruler);
    for backend in request.backends.iter().filter(|b| *b != REFERENCE) {
        progress(backend);
        match work.panel(backend) {
            Ok(panel) => panels.push(panel),
            Err(error @ StudioError::Render { .. }) if work.is_plugin(backend) => {
                failures.push((backend.clone(), error));
            }
            Err(error) => return Err(error),
        }
    }
    Ok(Comparison {
        scene: scene.name.clone(),
        objects: scene.objects.iter().map(|o| (o.name.clone(), o.shape.kind().name())).collect(),
        notes: scene.notes.clone(),
        width: request.need.width,
        height: request.need.height,
        threads: work.studio.pool().count(),
        panels,
        choice: None,
        failures,
    })
}

struct Work<'a> {
    studio: &'a mut Studio,
    scene: &'a Arc<Scene>,
    request: &'a Request,
    reference: Option<Framebuffer>,
}

impl Work<'_> {
    fn is_plugin(&self, backend: &str) -> bool {
        let mut all = self.studio.registry().iter();
        all.any(|(info, origin)| info.id == backend && *origin != Origin::BuiltIn)
    }

    fn need(&self, backend: &str) -> Need {
        Need {
            channels: compared_channels(),
            settings: self.request.settings.get(backend).cloned().unwrap_or_default(),
            ..self.request.need.clone()
        }
    }

    /// Draws a picture and takes the median time of some more.
    fn draw(&mut self, backend: &str) -> Result<Panel, StudioError> {
        let need = self.need(backend);
        let drawing = self.studio.draw(backend, self.scene, &need)?;
        let mut times = vec![drawing.frame_ms];
        let mut picture = drawing.framebuffer;
        // The first frame of a fast back end also pays for its scratch memory; slow ones are not drawn again.
        while times.len() < self.request.frames as usize && times.iter().sum::<f64>() + times[0] < 1000.0 {
            times.push(self.studio.render(backend, &need.frame(), &mut picture)?.1);
        }
        Ok(Panel {
            backend: backend.to_owned(),
            name: self.studio.registry().info(backend)?.name.clone(),
            settings: need.settings,
            picture,
            prepare_ms: drawing.prepare_ms,
            frame_ms: median(&mut times),
            bytes: drawing.prepared.bytes,
            decisions: drawing.prepared.objects,
            errors: None,
            split: Split::default(),
            gate: None,
        })
    }

    fn panel(&mut self, backend: &str) -> Result<Panel, StudioError> {
        let mut panel = self.draw(backend)?;
        let Some(reference) = self.reference.take() else { return Ok(panel) };
        let pixels = u64::from(panel.picture.width()) * u64::from(panel.picture.height());
        let is_photometric = self.studio.registry().info(backend)?.photometric;
        let (mut errors, mut split) = (Errors::default(), Ok(Split::default()));
        // Comparing takes one thread; the reference draws the back end's model meanwhile.
        let pool = self.studio.pool().clone();
        pool.join(&mut || errors = Errors::between(&panel.picture, &reference), &mut || {
            if is_photometric {
                split = self.split(backend, &panel.picture, &panel.decisions, &reference);
            }
        });
        if is_photometric {
            panel.gate = Some(Gate::EDGE_TOLERANT.judge(&errors, pixels));
        }
        panel.split = split?;
        panel.errors = Some(errors);
        self.reference = Some(reference);
        Ok(panel)
    }

    /// Lets the reference draw the back end's own model, where it has one of its own.
    fn split(
        &mut self,
        backend: &str,
        picture: &Framebuffer,
        decisions: &[Decision],
        reference: &Framebuffer,
    ) -> Result<Split, StudioError> {
        let converted =
            |d: &Decision| matches!(d, Decision::Converted { .. } | Decision::Approximated { .. });
        let Some(model) = self.studio.renderer(backend)?.model() else {
            let as_given = !decisions.iter().any(converted);
            return Ok(if as_given {
                Split { model: Some(0.0), method: color_rmse(picture, reference) }
            } else {
                Split::default()
            });
        };
        let need = Need { channels: Channels::COLOR, ..self.need(REFERENCE) };
        let of_model = self.studio.draw(REFERENCE, &model, &need)?.framebuffer;
        Ok(Split { model: color_rmse(&of_model, reference), method: color_rmse(picture, &of_model) })
    }
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_unstable_by(f64::total_cmp);
    times[times.len() / 2]
}
