//! How does the host drive the shader: an inner back end for visibility, and the style laid over it?

use crate::frame::{Buffers, Ready, decode};
use crate::hatch::Hatching;
use crate::info::info;
use crate::paint::ROWS;
use crate::paper::Grain;
use crate::prepare::{Coded, Outlines, colorful, looks, outlines_forecast};
use crate::preset::Preset;
use crate::stroke::Stroke;
use crate::style::Styles;
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::scene::Scene;
use polyptych_core::seam::{
    BackendFactory, BackendInfo, Control, Counter, Frame, Need, PassPlan, Phases, Plan, Prepared, Registry,
    RenderError, Renderer, Report, Settings, Survey,
};
use std::sync::Arc;

/// Makes [`Stylized`] renderers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl BackendFactory for Factory {
    fn info(&self) -> BackendInfo {
        info()
    }
    fn create(&self, registry: &Registry) -> Box<dyn Renderer> {
        Box::new(Stylized::new(registry.clone()))
    }
}

/// The stylized shader.
pub struct Stylized {
    info: BackendInfo,
    registry: Registry,
    inner: Option<(String, Box<dyn Renderer>)>,
    ready: Option<Ready>,
    outlines: Outlines,
    coded: Coded,
    grain: Grain,
    scratch: Buffers,
}

impl Stylized {
    /// Makes a renderer that takes its inner back end from a registry.
    #[must_use]
    pub fn new(registry: Registry) -> Self {
        Self {
            info: info(),
            registry,
            inner: None,
            ready: None,
            outlines: Outlines::default(),
            coded: Coded::default(),
            grain: Grain::new(),
            scratch: Buffers::default(),
        }
    }

    /// Finds the lines of a frame without painting it: what a drawing in vectors is made of. Lines of meshes come
    /// first, in the order of objects.
    ///
    /// # Errors
    /// When nothing was prepared, or the host cancelled.
    pub fn strokes(
        &mut self,
        frame: &Frame,
        width: u32,
        height: u32,
        control: &Control<'_>,
    ) -> Result<&[Stroke], RenderError> {
        let (Some(ready), Some((_, inner))) = (&self.ready, &mut self.inner) else {
            return Err(RenderError::NotPrepared);
        };
        let buffers = &mut self.scratch;
        buffers.reserve(width, height, ready.styles.channels(), ready.scene.objects.len());
        inner.render(frame, &mut buffers.visible, &control.unwatched())?;
        buffers.find_lines(ready, &self.outlines, &frame.camera, control)?;
        Ok(&buffers.lines.strokes)
    }

    /// Draws the lines of a frame as an SVG picture on the style's paper, or on nothing.
    ///
    /// # Errors
    /// When nothing was prepared, or the host cancelled.
    pub fn svg(
        &mut self,
        frame: &Frame,
        width: u32,
        height: u32,
        control: &Control<'_>,
    ) -> Result<String, RenderError> {
        self.strokes(frame, width, height, control)?;
        let ready = self.ready.as_ref().ok_or(RenderError::NotPrepared)?;
        Ok(crate::svg::picture(&self.scratch.lines.strokes, &ready.scene, &ready.styles, [width, height]))
    }

    /// Returns the styles that settings name, what is baked for those of before kept.
    fn styles(&self, scene: &Scene, settings: &Settings) -> Result<Styles, RenderError> {
        let styles = self.ready.iter().flat_map(|r| &r.styles.all);
        let before: Vec<Arc<Hatching>> = styles.filter_map(|s| s.hatching.clone()).collect();
        let names = scene.objects.iter().map(|o| o.name.as_str());
        Styles::of(settings, &self.info.parameters, names, &before)
            .map_err(|e| RenderError::Failed(e.to_string()))
    }

    /// Returns the id of the inner back end, and what it needs.
    fn inner_need(&self, need: &Need, styles: &Styles) -> Result<(String, Need), RenderError> {
        let failed = |e: String| RenderError::Failed(e);
        let declared = &self.info.parameters;
        let chosen = Preset::chosen(&need.settings, declared)
            .and_then(|preset| preset.under(&need.settings, declared))
            .map_err(|e| failed(e.to_string()))?;
        let other = chosen.text(declared, "visibility.other");
        let id = if other.is_empty() { chosen.text(declared, "visibility") } else { other }.to_owned();
        let inner = self.registry.info(&id).map_err(|e| failed(format!("visibility: {e}")))?;
        if id == self.info.id {
            return Err(failed("visibility.other: the shader cannot see through itself".to_owned()));
        }
        let mut settings = Settings::default();
        // Which sides are left out is for the one who sees.
        let cull = chosen.text(declared, "cull");
        if cull != "none" && inner.parameters.iter().any(|p| p.name == "cull") {
            settings.set(&id, &inner.parameters, "cull", cull).map_err(|e| failed(e.to_string()))?;
        }
        let wanted = need.channels.iter().filter(|&c| c != Channel::Color);
        let channels = wanted.fold(styles.channels(), Channels::with);
        let missing = channels.iter().find(|&c| !inner.channels.has(c));
        if let Some(missing) = missing {
            return Err(failed(format!("visibility: {id} does not deliver the channel {}", missing.name())));
        }
        Ok((id, Need { channels, settings, ..need.clone() }))
    }
}

impl Renderer for Stylized {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, scene: &Scene, need: &Need) -> Plan {
        let Ok(styles) = self.styles(scene, &need.settings) else { return Plan::default() };
        let Ok((id, inner_need)) = self.inner_need(need, &styles) else { return Plan::default() };
        let Ok(inner) = self.registry.create(&id) else { return Plan::default() };
        let mut plan = inner.plan(scene, &inner_need);
        for pass in &mut plan.passes {
            pass.name = format!("{id}: {}", pass.name);
        }
        let pass = |name: &str, needed: bool, why: &str| PassPlan {
            name: name.to_owned(),
            needed,
            why: why.to_owned(),
        };
        let hatches = styles.all.iter().any(|s| s.hatching.is_some());
        let lines = styles.draw_lines();
        plan.passes.push(pass("tone", true, "two colors by the light"));
        plan.passes.push(pass(
            "hatching",
            hatches,
            if hatches { "dark tones have strokes" } else { "the style has no strokes" },
        ));
        plan.passes.push(pass("contours", lines, if lines { "lines are on" } else { "lines are off" }));
        let maps: u64 = styles.all.iter().filter_map(|s| s.hatching.as_ref()).map(|h| h.bytes()).sum();
        plan.bytes += self.grain.bytes() + maps + if lines { outlines_forecast(scene) } else { 0 };
        // Nanoseconds that a pixel of the background and one of a surface take for tone, strokes and lines, on the
        // machine that all back ends' constants were measured on.
        let surface = 14.0 + if hatches { 16.0 } else { 0.0 } + if lines { 6.0 } else { 0.0 };
        let per_pixel = 4.0 + surface * Survey::of(scene, need).seen;
        plan.estimated_ms += f64::from(need.width) * f64::from(need.height) * per_pixel * 1e-6;
        plan
    }

    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        let styles = self.styles(scene, &need.settings)?;
        let (id, inner_need) = self.inner_need(need, &styles)?;
        if self.inner.as_ref().is_none_or(|(current, _)| *current != id) {
            let inner =
                self.registry.create(&id).map_err(|e| RenderError::Failed(format!("visibility: {e}")))?;
            self.inner = Some((id, inner));
        }
        self.ready = None;
        let (_, inner) = self.inner.as_mut().ok_or(RenderError::NotPrepared)?;
        let draws_meshes = inner.info().draws(polyptych_core::scene::ShapeKind::Mesh);
        let seen = self.coded.prepare(scene, &styles, draws_meshes);
        let mut prepared = inner.prepare(&seen, &inner_need, converter, control)?;
        self.outlines.prepare(scene, &prepared.objects, &styles, need, converter, control)?;
        let mut objects = prepared.objects.to_vec();
        for object in self.outlines.tangled() {
            objects[object] = objects[object].weakened("it crosses itself too often to draw lines there");
        }
        prepared.objects = objects.into();
        self.scratch.looks = looks(scene, &self.coded.objects);
        let colorful = colorful(scene, &styles);
        let bounds = scene.bounds();
        let ball = (bounds.center(), bounds.radius());
        self.ready =
            Some(Ready { scene: scene.clone(), styles, lights: scene.lights.clone(), colorful, ball });
        prepared.bytes += self.bytes();
        Ok(prepared)
    }

    fn render(
        &mut self,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError> {
        let (Some(ready), Some((_, inner))) = (&self.ready, &mut self.inner) else {
            return Err(RenderError::NotPrepared);
        };
        let mut phases = Phases::start();
        let buffers = &mut self.scratch;
        let lent = target.channels().iter().filter(|&c| c != Channel::Color);
        let lent = lent.fold(Channels::NONE, Channels::with);
        let channels = lent.iter().fold(ready.styles.channels(), Channels::with);
        let (width, height) = (target.width(), target.height());
        buffers.reserve(width, height, channels, ready.scene.objects.len());
        // The inner back end draws into the target's own planes, so that none is copied.
        buffers.visible.exchange(target, lent);
        // Finished bands of the inner picture are not the picture's.
        let result = inner.render(frame, &mut buffers.visible, &control.unwatched());
        phases.end("visibility");
        let painted = match &result {
            Ok(_) if target.channels().has(Channel::Color) => {
                buffers.paint(ready, &self.outlines, &self.grain, &frame.camera, target, &mut phases, control)
            }
            _ => Ok(()),
        };
        if lent.has(Channel::Albedo) && self.coded.objects.contains(&true) {
            decode(ready, &self.coded.objects, &mut buffers.visible, control.threads);
        }
        buffers.visible.exchange(target, lent);
        let report = result?;
        painted?;
        if !target.channels().has(Channel::Color) {
            target.for_each_band(control.threads, ROWS, &|band| control.finished(&band));
        }
        let mut counters = report.counters;
        if let Some(free) = counters.iter_mut().find(|c| c.is_none()) {
            *free = Some(Counter { name: "strokes", count: self.scratch.lines.strokes.len() as u64 });
        }
        Ok(Report { phases, counters, bytes: report.bytes + self.bytes(), ..report })
    }
}

impl Stylized {
    /// Returns the bytes held besides those of the inner back end.
    fn bytes(&self) -> u64 {
        let styles = self.ready.iter().flat_map(|r| &r.styles.all);
        let maps: u64 = styles.filter_map(|s| s.hatching.as_ref()).map(|h| h.bytes()).sum();
        maps + self.outlines.bytes() + self.grain.bytes() + self.scratch.bytes()
    }
}
