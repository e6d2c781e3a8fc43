//! How does the host drive the rasterizer: plan, prepare, render?

use crate::bin::{Bins, Pass};
use crate::conversion::Conversion;
use crate::decide::{self, RESAMPLED, is_resampled};
use crate::drawing::Drawing;
use crate::faces::{Faces, face_lens, needed};
use crate::info::{Mode, Options, info};
use crate::lens::Lens;
use crate::light::{Illumination, Lamp};
use crate::lines::Lines;
use crate::model::{Model, Part, Role, Source};
use crate::paint::{self, Announce, Look, Painter};
use crate::plan::plan;
use crate::shadow::{Before, MapSizes, Shadows};
use crate::smooth;
use crate::strokes::Strokes;
use crate::tile::TileGrid;
use crate::transform::{ScreenVertices, transform};
use polyptych_core::camera::Camera;
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Framebuffer};
use polyptych_core::scene::{Object, Scene, Shape};
use polyptych_core::seam::{
    BackendFactory, BackendInfo, Cancelled, Control, Counter, Decision, Frame, Need, Phases, Plan, Prepared,
    Registry, RenderError, Renderer, Report,
};
use std::sync::{Arc, Mutex, OnceLock};

/// Largest width and height: beyond, snapped corners would not fit their numbers.
const LARGEST: u32 = 4_000_000;
/// What is nearer to the eye than this share of the scene's size and distance is not drawn.
const NEAR: f64 = 1e-6;

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
}

/// A prepared scene.
struct Ready {
    scene: Arc<Scene>,
    model: Arc<Model>,
    /// What each object loses by being triangles.
    given: Arc<[Decision]>,
    /// Made when they are drawn.
    lines: Option<Arc<Lines>>,
    lamps: Vec<Lamp>,
    /// Of samples in a pixel, in steps from its center.
    places: Vec<[i32; 2]>,
    shadows: Option<Arc<Shadows>>,
    /// Those of a mode without shadows, which may be switched back.
    resting_shadows: Option<Arc<Shadows>>,
    sizes: MapSizes,
    options: Options,
    decisions: Arc<[Decision]>,
    /// The same for cameras that bend straight lines.
    decisions_resampled: Arc<[Decision]>,
    as_drawn: OnceLock<Option<Arc<Scene>>>,
    /// Bytes of what was converted.
    triangle_bytes: u64,
}

/// Buffers that live from frame to frame.
#[derive(Default)]
struct Scratch {
    vertices: Vec<ScreenVertices>,
    bins: Bins,
    strokes: Strokes,
    bands: Vec<Mutex<paint::Scratch>>,
    faces: Faces,
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
        Self { info: info(), ready: None, converted: Vec::new(), scratch: Scratch::default() }
    }

    /// Returns the model, to tell whether it was kept.
    #[cfg(test)]
    pub(crate) fn model_in_use(&self) -> Option<Arc<Model>> {
        self.ready.as_ref().map(|ready| ready.model.clone())
    }

    /// Returns the shadow maps, to tell whether they were kept.
    #[cfg(test)]
    pub(crate) fn shadows(&self) -> Option<Arc<Shadows>> {
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
        let draws_lines = Options::of(need, &self.info).mode.draws_lines();
        let (mut sources, mut used) = (Vec::with_capacity(scene.objects.len()), Vec::new());
        for object in &scene.objects {
            control.check()?;
            if let Some(reason) = decide::why_skipped(object, draws_lines) {
                if object.required && object.visible {
                    return Err(RenderError::Required { object: object.name.clone(), reason });
                }
                sources.push(Err(reason));
            } else if let Shape::Mesh(_) = &*object.shape {
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
            None => converter
                .mesh(scene, object, detail, control.threads)
                .map_err(|e| RenderError::Failed(e.to_string()))?,
        };
        Ok(Conversion::new(scene, object, detail, model))
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
        let before = self.ready.take();
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
        let mut decisions = given.to_vec();
        for loss in decide::losses_of_all(scene, &lamps, options, sizes) {
            decisions.iter_mut().for_each(|d| *d = decide::with_loss(d, loss));
        }
        let kept = before.as_ref().filter(|b| Arc::ptr_eq(&b.model, &model)).and_then(|b| b.lines.clone());
        let lines = options.mode.draws_lines().then(|| kept.unwrap_or_else(|| Arc::new(Lines::of(&model))));
        let mut ready = Ready {
            triangle_bytes: triangle_bytes(&model),
            scene: scene.clone(),
            model,
            given,
            lines,
            lamps,
            places: smooth::places(options.samples),
            shadows: None,
            resting_shadows: None,
            sizes,
            options,
            decisions_resampled: decisions.iter().map(|d| decide::with_loss(d, RESAMPLED)).collect(),
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
        let mut work = Work { phases: Phases::start(), triangles: 0, shaded: 0 };
        let near = ready.near(&frame.camera);
        match Lens::of_camera(&frame.camera, width, height, near) {
            Some(lens) => self.scratch.draw(
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
        Ok(Report {
            objects: ready.decisions(&frame.camera),
            phases: work.phases,
            counters,
            bytes: ready.bytes() + self.scratch.bytes(),
        })
    }
}

/// Returns the bytes of all converted triangles; objects of one shape share theirs.
fn triangle_bytes(model: &Model) -> u64 {
    let mut seen = std::collections::HashSet::new();
    let of = |part: &Part| match &part.source {
        Source::Converted(m) if seen.insert(Arc::as_ptr(m)) => m.mesh.bytes(),
        _ => 0,
    };
    model.parts.iter().map(of).sum()
}

/// What a frame took.
struct Work {
    phases: Phases,
    triangles: u64,
    shaded: u64,
}

impl Scratch {
    /// Draws a picture: vertices, bins, tiles.
    fn draw(
        &mut self,
        ready: &Ready,
        lens: &Lens,
        target: &mut Framebuffer,
        announce: Announce,
        work: &mut Work,
        control: &Control<'_>,
    ) -> Result<(), Cancelled> {
        draw(
            ready,
            lens,
            target,
            announce,
            work,
            control,
            (&mut self.vertices, &mut self.bins, &mut self.strokes, &mut self.bands),
        )
    }

    /// Draws the faces of a cube and looks the picture up in them.
    fn draw_bent(
        &mut self,
        ready: &Ready,
        camera: &Camera,
        target: &mut Framebuffer,
        work: &mut Work,
        control: &Control<'_>,
    ) -> Result<(), Cancelled> {
        let (width, height) = (target.width(), target.height());
        let view = camera.view(width, height);
        let edge = self.faces.reserve(&view, width, height, target.channels());
        let needed = needed(camera, width, height, control.threads);
        for face in (0..6).filter(|face| needed >> face & 1 == 1) {
            let lens = face_lens(camera, face, edge, ready.near(camera)).with_depths_of(&ready.model.bounds);
            let buffers = (&mut self.vertices, &mut self.bins, &mut self.strokes, &mut self.bands);
            let picture = self.faces.picture(face);
            draw(ready, &lens, picture, Announce::No, work, control, buffers)?;
        }
        self.faces.resample(camera, &ready.scene.environment.background, target, control.threads);
        control.finished(&target.band());
        work.phases.end("resample");
        Ok(())
    }

    fn draw_shadows(
        &mut self,
        ready: &Ready,
        old: Option<Before>,
        control: &Control<'_>,
    ) -> Result<Shadows, Cancelled> {
        let (vertices, bins) = (&mut self.vertices, &mut self.bins);
        let of = (&*ready.scene, &*ready.model);
        Shadows::build(of, &ready.lamps, ready.sizes, old, vertices, bins, control)
    }

    fn bytes(&self) -> u64 {
        let bands: usize = self.bands.iter().filter_map(|b| b.lock().ok()).map(|b| b.bytes()).sum();
        (self.vertices.capacity() * size_of::<ScreenVertices>() + bands) as u64
            + self.bins.bytes()
            + self.strokes.bytes()
            + self.faces.bytes()
    }
}

type Buffers<'a> =
    (&'a mut Vec<ScreenVertices>, &'a mut Bins, &'a mut Strokes, &'a mut Vec<Mutex<paint::Scratch>>);

/// The pipeline.
fn draw(
    ready: &Ready,
    lens: &Lens,
    target: &mut Framebuffer,
    announce: Announce,
    work: &mut Work,
    control: &Control<'_>,
    (vertices, bins, strokes, bands): Buffers<'_>,
) -> Result<(), Cancelled> {
    control.check()?;
    let culls_back = ready.options.culls_back;
    let smooth = ready.places.len() > 1;
    let pass = Pass { model: &ready.model, lens, role: Role::Camera, culls_back, smooth, without: None };
    // 1. Where on the picture is every vertex?
    transform(&ready.model, lens, vertices, control.threads);
    work.phases.end("transform");
    // 2. Clip, set up, and sort the triangles into tiles.
    bins.fill(&pass, vertices, &TileGrid::new(lens.width, lens.height).smooth(smooth), control.threads);
    work.triangles += bins.triangles();
    let drawing = ready.lines.as_deref().map(|lines| {
        let hides = ready.options.mode == Mode::HiddenLine;
        strokes.fill(lines, &ready.model, lens, vertices, (culls_back, hides), control.threads);
        Drawing { lines, strokes, hides }
    });
    work.phases.end("bin");
    // 3. Draw tile by tile: visibility, layers, surfaces and light.
    let light = Illumination {
        scene: &ready.scene,
        model: &ready.model,
        lamps: &ready.lamps,
        shadows: ready.shadows.as_deref(),
        lighting: ready.options.lighting.unwrap_or(ready.scene.environment.lighting),
    };
    let look = Look { shading: ready.options.shading, places: &ready.places, drawing };
    let painter = Painter::new(light, look, lens, bins, target.channels());
    work.shaded += painter.paint(target, bands, announce, control)?;
    if painter.paint_crossings(target, control) && announce == Announce::Yes {
        control.finished(&target.band());
    }
    work.phases.end("draw");
    Ok(())
}

impl Ready {
    fn decisions(&self, camera: &Camera) -> Arc<[Decision]> {
        let bent = is_resampled(&camera.projection);
        if bent { self.decisions_resampled.clone() } else { self.decisions.clone() }
    }

    fn near(&self, camera: &Camera) -> f64 {
        let bounds = &self.model.bounds;
        let near = NEAR * (bounds.radius() + bounds.center().distance(camera.eye));
        if near > 0.0 && near.is_finite() { near } else { NEAR }
    }

    fn bytes(&self) -> u64 {
        self.triangle_bytes
            + self.shadows.as_ref().or(self.resting_shadows.as_ref()).map_or(0, |s| s.bytes())
            + self.lines.as_ref().map_or(0, |lines| lines.bytes())
    }

    /// Returns the shadow maps if they are those of another scene, too: same lights, same things that block. Where
    /// some are not, returns them with what is still right.
    fn shadows_for(self, other: &Self) -> (Option<Arc<Shadows>>, Option<Before>) {
        let Some(shadows) = self.shadows.or(self.resting_shadows) else { return (None, None) };
        let same_parts = self.model.parts.len() == other.model.parts.len()
            && self.model.parts.iter().zip(&other.model.parts).all(|(a, b)| a.blocks_like(b));
        let has_masks =
            other.scene.materials.iter().any(|m| m.alpha != polyptych_core::scene::AlphaMode::Opaque);
        let same_masks = !has_masks || Arc::ptr_eq(&self.scene, &other.scene);
        let same_map = |(a, b): (&Lamp, &Lamp)| {
            same_parts
                && same_masks
                && self.sizes == other.sizes
                && a.light == b.light
                && a.cell == b.cell
                && a.is_blocked == b.is_blocked
        };
        let same_maps: Vec<bool> = self.lamps.iter().zip(&other.lamps).map(same_map).collect();
        if self.lamps.len() == other.lamps.len() && same_parts && same_maps.iter().all(|same| *same) {
            return (Some(shadows), None);
        }
        let shadows = Arc::try_unwrap(shadows).ok();
        (None, shadows.map(|shadows| Before { shadows, same_blockers: same_parts, same_maps }))
    }

    /// Returns the scene with converted shapes as meshes. Polyhedra and voxels are drawn by their true faces
    /// and stay what they are.
    fn as_drawn(&self) -> Option<Arc<Scene>> {
        let mut scene = (*self.scene).clone();
        let mut changed = false;
        for part in &self.model.parts {
            let object = &mut scene.objects[part.object];
            let Source::Converted(model) = &part.source else { continue };
            let true_faces = matches!(*object.shape, Shape::Primitive(_) | Shape::Voxels(_));
            if !(true_faces && model.bound == 0.0) {
                object.shape = Arc::new(Shape::Mesh(model.mesh.clone()));
                changed = true;
            }
        }
        changed.then(|| Arc::new(scene))
    }
}
