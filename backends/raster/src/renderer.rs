//! How does the host drive the rasterizer: plan, prepare, render?

use crate::conversion::Conversion;
use crate::decide::{self, RESAMPLED};
use crate::frame::{Scratch, Work};
use crate::info::{Mode, Options, info};
use crate::lens::Lens;
use crate::light::Lamp;
use crate::lines::Lines;
use crate::model::{Model, Source};
use crate::paint::Announce;
use crate::plan::plan;
use crate::ready::{Ready, triangle_bytes};
use crate::shadow::MapSizes;
use crate::smooth;
use polyptych_core::camera::Camera;
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Framebuffer};
use polyptych_core::scene::{Object, Scene, Shape};
use polyptych_core::seam::{
    BackendFactory, BackendInfo, Control, Counter, Decision, Frame, Need, Phases, Plan, Prepared, Registry,
    RenderError, Renderer, Report,
};
use std::sync::{Arc, OnceLock};

/// Largest width and height: beyond, snapped corners would not fit their numbers.
const LARGEST: u32 = 4_000_000;
/// Makes instances of [`Raster`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl BackendFactory for Factory {
    fn info(&self) -> BackendInfo {
        info()
    }

    fn create(&self, _registry: &Registry) -> Box<dyn Renderer> {
        Box::new(Raster::new())
    }
}

/// The rasterizer. See the crate's documentation for what it draws and how.
pub struct Raster {
    info: BackendInfo,
    ready: Option<Ready>,
    /// Conversions that the last `prepare` used.
    converted: Vec<Conversion>,
    scratch: Scratch,
    last: Option<Drawn>,
}

/// What the last frame left in its picture.
struct Drawn {
    camera: Camera,
    /// Of the picture; see [`Framebuffer::stamp`].
    stamp: u64,
    report: Report,
}

impl Default for Raster {
    fn default() -> Self {
        Self::new()
    }
}

impl Raster {
    /// Makes an instance that has nothing prepared.
    #[must_use]
    pub fn new() -> Self {
        Self { info: info(), ready: None, converted: Vec::new(), scratch: Scratch::default(), last: None }
    }

    /// Returns the model, to tell whether it was kept.
    #[cfg(test)]
    pub(crate) fn model_in_use(&self) -> Option<Arc<Model>> {
        self.ready.as_ref().map(|ready| ready.model.clone())
    }

    /// Returns the shadow maps, to tell whether they were kept.
    #[cfg(test)]
    pub(crate) fn shadows(&self) -> Option<Arc<crate::shadow::Shadows>> {
        self.ready.as_ref()?.shadows.clone()
    }

    /// Converts what must be and decides about all objects; keeps the model of before where it is the same.
    fn build_model(
        &mut self,
        before: Option<&Ready>,
        scene: &Arc<Scene>,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<(Arc<Model>, Arc<[Decision]>), RenderError> {
        let options = Options::of(need, &self.info);
        let draws_lines = options.mode.draws_lines();
        let (mut sources, mut used) = (Vec::with_capacity(scene.objects.len()), Vec::new());
        for object in &scene.objects {
            control.check()?;
            if let Some(reason) = decide::why_skipped(object, draws_lines) {
                if object.required && object.visible {
                    return Err(RenderError::Required { object: object.name.clone(), reason });
                }
                sources.push(Err(reason));
            } else if let (Shape::Mesh(_), false) = (&*object.shape, options.spares_triangles) {
                sources.push(Ok(Source::Given(object.shape.clone())));
            } else {
                let conversion = self.convert(scene, object, need, converter, control)?;
                sources.push(Ok(Source::Converted(conversion.model.clone())));
                used.push(conversion);
            }
        }
        self.converted = used;
        let is_same = |before: &&Ready| {
            Arc::ptr_eq(&before.scene, scene)
                && before.model.has_sources(sources.iter().filter_map(|s| s.as_ref().ok()))
        };
        let same = before.filter(is_same);
        let decide = |(object, source): (&Object, &Result<Source, String>)| match source {
            Err(why) => Decision::Skipped { why: why.clone() },
            Ok(source) => {
                decide::decision(object, source.converted(), decide::losses(scene, object, draws_lines))
            }
        };
        let decisions = match same.filter(|b| b.options.mode.draws_lines() == draws_lines) {
            Some(before) => before.given.clone(),
            None => scene.objects.iter().zip(&sources).map(decide).collect(),
        };
        if let Some(before) = same {
            return Ok((before.model.clone(), decisions));
        }
        let mut model = Model::default();
        for (index, source) in sources.into_iter().enumerate() {
            let part = before.and_then(|b| b.model.part_of(index));
            if source.is_ok_and(|source| !model.add(scene, index, source, part)) {
                return Err(RenderError::Failed(format!("more than {} triangles", u32::MAX)));
            }
        }
        Ok((Arc::new(model), decisions))
    }

    /// Finds what an earlier call converted, or asks the converter.
    fn convert(
        &self,
        scene: &Scene,
        object: &Object,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Conversion, RenderError> {
        let detail = decide::detail(object, need);
        let wanted = |c: &&Conversion| c.serves(scene, object, detail);
        let model = match self.converted.iter().find(wanted) {
            Some(kept) => kept.model.clone(),
            None => converter.level(scene, object, detail, control)?,
        };
        Ok(Conversion::new(scene, object, detail, model))
    }
}

impl Raster {
    /// Returns the report of a picture that shows a frame already.
    fn unchanged(&self, frame: &Frame, target: &Framebuffer) -> Option<Report> {
        let last = self.last.as_ref()?;
        let is_same = Some(last.stamp) == target.stamp() && last.camera == frame.camera;
        is_same.then(|| last.report.clone())
    }
}

impl Renderer for Raster {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, scene: &Scene, need: &Need) -> Plan {
        plan(scene, need, Options::of(need, &self.info))
    }

    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        let (before, last) = (self.ready.take(), self.last.take());
        let options = Options::of(need, &self.info);
        let (model, given) = self.build_model(before.as_ref(), scene, need, converter, control)?;
        let mut lamps = Lamp::all(scene);
        let demand = decide::demand(scene, need, &lamps, options);
        // What stands before a light depends neither on the mode nor on the channels, which may change back.
        let all = Need { channels: need.channels.with(Channel::Color), ..need.clone() };
        let is_all = options.mode == Mode::Shadowed && all.channels == need.channels;
        let of_all = (!is_all)
            .then(|| decide::demand(scene, &all, &lamps, Options { mode: Mode::Shadowed, ..options }));
        for (lamp, shadow) in lamps.iter_mut().zip(&of_all.as_ref().unwrap_or(&demand).shadows) {
            lamp.is_blocked = shadow.is_ok();
        }
        let asked = need.channels.has(Channel::Color) || need.channels.has(Channel::Shadow);
        let sizes = MapSizes::new(options.map_size, &lamps);
        sizes.choose_tiers(&mut lamps, options.tier, scene, need);
        let mut decisions = given.to_vec();
        for loss in decide::losses_of_all(scene, &lamps, options, sizes) {
            decisions.iter_mut().for_each(|d| *d = d.weakened(loss));
        }
        let kept = before.as_ref().filter(|b| Arc::ptr_eq(&b.model, &model)).and_then(|b| b.lines.clone());
        let lines = options.mode.draws_lines().then(|| kept.unwrap_or_else(|| Arc::new(Lines::of(&model))));
        let is_same = before.as_ref().is_some_and(|before| before.draws(scene, &model, need, options));
        let mut ready = Ready {
            triangle_bytes: triangle_bytes(&model),
            scene: scene.clone(),
            channels: need.channels,
            model,
            given,
            lines,
            lamps,
            places: smooth::places(options.samples),
            shadows: None,
            resting_shadows: None,
            sizes,
            options,
            decisions_resampled: decisions.iter().map(|d| d.weakened(RESAMPLED)).collect(),
            decisions: decisions.into(),
            as_drawn: OnceLock::new(),
        };
        let (kept, old) = before.map_or((None, None), |b| b.shadows_for(&ready));
        if demand.any_shadow() {
            ready.shadows = Some(match kept {
                Some(kept) => kept,
                None => Arc::new(self.scratch.draw_shadows(&ready, old, control)?),
            });
        } else if options.mode != Mode::Shadowed && asked {
            // Another mode may want them again.
            ready.resting_shadows = kept;
        }
        let prepared = Prepared { objects: ready.decisions(&need.camera), bytes: ready.bytes() };
        self.ready = Some(ready);
        self.last = last.filter(|_| is_same);
        Ok(prepared)
    }

    fn model(&self) -> Option<Arc<Scene>> {
        let ready = self.ready.as_ref()?;
        ready.as_drawn.get_or_init(|| ready.as_drawn()).clone()
    }

    fn render(
        &mut self,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError> {
        let ready = self.ready.as_ref().ok_or(RenderError::NotPrepared)?;
        let (width, height) = (target.width(), target.height());
        if width > LARGEST || height > LARGEST {
            return Err(RenderError::Failed(format!("{width}x{height} is more than {LARGEST} pixels long")));
        }
        if let Some(report) = self.unchanged(frame, target) {
            control.finished(&target.band());
            self.last = target.stamp().zip(self.last.take()).map(|(stamp, last)| Drawn { stamp, ..last });
            return Ok(report);
        }
        self.last = None;
        let mut work = Work { phases: Phases::start(), triangles: 0, shaded: 0 };
        let near = ready.near(&frame.camera);
        match Lens::of_camera(&frame.camera, width, height, near) {
            Some(lens) => self.scratch.pipeline.draw(
                ready,
                &lens.with_depths_of(&ready.model.bounds),
                target,
                Announce::Yes,
                &mut work,
                control,
            )?,
            None => self.scratch.draw_bent(ready, &frame.camera, target, &mut work, control)?,
        }
        let mut counters = [None; 6];
        counters[0] = Some(Counter { name: "triangles", count: work.triangles });
        counters[1] = Some(Counter { name: "pixels shaded", count: work.shaded });
        let report = Report {
            objects: ready.decisions(&frame.camera),
            phases: work.phases,
            counters,
            bytes: ready.bytes() + self.scratch.bytes(),
        };
        let kept = Report { phases: Phases::default(), ..report.clone() };
        let drawn = |stamp| Drawn { camera: frame.camera.clone(), stamp, report: kept };
        self.last = target.stamp().map(drawn);
        Ok(report)
    }
}
