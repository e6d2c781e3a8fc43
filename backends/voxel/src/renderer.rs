//! How does the host drive the voxel back end: plan, prepare, render?

use crate::grid::{Chunks, Grid};
use crate::lamps::Lamp;
use crate::levels::{self, Coarse, Footprint};
use crate::model::{self, Model};
use crate::occupancy::Values;
use crate::paint::{Painter, Pattern, TILE};
use crate::plan::plan;
use crate::trace::{Shadows, Tracer};
use crate::world::{Counts, Item, Numbers, World};
use polyptych_core::camera::Camera;
use polyptych_core::convert::{Converter, Filling};
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::scene::{AlphaMode, Scene, ShapeKind};
use polyptych_core::seam::{
    BackendFactory, BackendInfo, Control, Counter, Decision, Demand, Frame, Need, Parameter, ParameterKind,
    Phases, Plan, Prepared, Registry, RenderError, Renderer, Report, Surfaces, Value,
};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Makes instances of [`Voxel`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl BackendFactory for Factory {
    fn info(&self) -> BackendInfo {
        info()
    }

    fn create(&self, _registry: &Registry) -> Box<dyn Renderer> {
        Box::new(Voxel::new())
    }
}

/// The voxel back end: walks grids in exact order. See the crate's documentation for its method.
#[derive(Debug)]
pub struct Voxel {
    info: BackendInfo,
    ready: Option<Ready>,
    chunks: Chunks,
    pub(crate) last: Option<Half>,
    /// Counts frames: which half is drawn first changes from one to the next.
    pub(crate) halves: u32,
}

/// Most rays for the color of a pixel.
const MOST_SAMPLES: i64 = 64;

/// What the last frame drew of a picture of which every other pixel is drawn at once.
#[derive(Clone, Debug)]
pub(crate) struct Half {
    /// Of the picture; see [`Framebuffer::stamp`].
    stamp: u64,
    camera: Camera,
    first: u32,
    is_whole: bool,
}

#[derive(Debug)]
struct Ready {
    world: World,
    is_converted: bool,
    decisions: Arc<[Decision]>,
    bytes: u64,
    bounces: u32,
    shadows: Shadows,
    chunks_built: u64,
    checkerboard: bool,
    samples: u32,
    /// Whether blocks of cells may stand for them.
    is_coarse: bool,
}

impl Default for Voxel {
    fn default() -> Self {
        Self::new()
    }
}

impl Voxel {
    /// Makes an instance that has nothing prepared.
    #[must_use]
    pub fn new() -> Self {
        Self { info: info(), ready: None, chunks: Chunks::default(), last: None, halves: 0 }
    }

    fn resolution(&self, need: &Need) -> u32 {
        need.settings.int(&self.info.parameters, "detail.resolution").clamp(16, 1024) as u32
    }

    fn filling(&self, need: &Need) -> Filling {
        Filling::of_name(need.settings.text(&self.info.parameters, "detail.filling")).unwrap_or_default()
    }

    fn walk(&self, need: &Need) -> Numbers {
        match need.settings.text(&self.info.parameters, "walk") {
            "fast" => Numbers::Fast,
            "f64" => Numbers::Double,
            "fixed" => Numbers::Fixed,
            _ => Numbers::Exact,
        }
    }

    fn samples(&self, need: &Need) -> u32 {
        let asked = need.settings.int(&self.info.parameters, "samples").clamp(1, MOST_SAMPLES) as u32;
        need.samples.max(asked).min(MOST_SAMPLES as u32)
    }

    fn shadows(&self, need: &Need) -> Shadows {
        if need.settings.bool(&self.info.parameters, "shadow") { Shadows::Hard } else { Shadows::Off }
    }

    /// Makes the grids of a model ready; objects of one shape share theirs where their materials let through
    /// the same.
    fn items(&mut self, model: &Model, control: &Control<'_>) -> Result<(Vec<Item>, u64), RenderError> {
        let scene = &model.scene;
        let mut grids: HashMap<(usize, Values, Values), Arc<Grid>> = HashMap::new();
        let mut items = Vec::new();
        for (index, (object, decision)) in scene.objects.iter().zip(&model.decisions).enumerate() {
            control.check()?;
            let Some(voxels) = model::grid_of(object, decision) else { continue };
            let material = |value: u8| scene.material(object, usize::from(value) - 1);
            let seen = Values::of(|v| material(v).opacity > 0.0);
            let blocking =
                Values::of(|v| material(v).opacity >= 1.0 && material(v).alpha != AlphaMode::Blend);
            let without_holes =
                (1..=255).all(|v| material(v).alpha == AlphaMode::Opaque || material(v).texture.is_none());
            let key = (Arc::as_ptr(&object.shape).addr(), seen, blocking);
            let grid = match grids.entry(key) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => new.insert(self.chunks.grid(voxels, seen, blocking, control)?),
            };
            items.push(Item::new(scene, index, grid.clone(), without_holes));
        }
        Ok((items, grids.values().map(|g| g.bytes()).sum()))
    }
}

/// Makes the coarser grids of items that may have any, and says so of their objects.
fn levels_of(
    model: &mut Model,
    items: &[Item],
    control: &Control<'_>,
) -> Result<Vec<(usize, [Coarse; 2])>, RenderError> {
    let mut levels = Vec::new();
    let mut known: HashMap<(usize, Vec<usize>), [Coarse; 2]> = HashMap::new();
    for (index, item) in items.iter().enumerate() {
        control.check()?;
        let object = &model.scene.objects[item.object];
        let decision = &mut model.decisions[item.object];
        let Some(voxels) = model::grid_of(object, decision) else { continue };
        if !levels::is_plain(&model.scene, object) {
            continue;
        }
        let key = (Arc::as_ptr(&object.shape).addr(), object.materials.clone());
        let made = match known.entry(key) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => new.insert(levels::of(&model.scene, object, &item.grid, voxels, control)?),
        };
        levels.push((index, made.clone()));
        let blocks = "blocks of 4 and 16 cells as one where they are no larger than a pixel";
        *decision = match std::mem::replace(decision, Decision::Exact) {
            Decision::Converted { bound, why } => {
                Decision::Converted { bound, why: format!("{why}; {blocks}") }
            }
            Decision::Approximated { why } => Decision::Approximated { why: format!("{why}; {blocks}") },
            _ => Decision::Approximated { why: blocks.to_owned() },
        };
    }
    Ok(levels)
}

fn info() -> BackendInfo {
    BackendInfo {
        id: "voxel".to_owned(),
        name: "Voxel ray caster".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        native: vec![ShapeKind::Voxels],
        channels: Channels::ALL,
        photometric: true,
        parameters: vec![
            Parameter {
                name: "detail.resolution",
                kind: ParameterKind::Int { min: 16, max: 1024 },
                default: Value::Int(128),
                unit: "cells",
                help: "Most cells along the longest edge of an object that is converted",
                tag: "detail.tolerance",
                quality_axis: true,
            },
            Parameter {
                name: "detail.filling",
                kind: ParameterKind::Choice { choices: &Filling::NAMES },
                default: Value::Text("natural".to_owned()),
                unit: "",
                help: "Cells that are filled: by nature, a surface that stops water over corners or just over faces, or what is inside",
                tag: "",
                quality_axis: false,
            },
            Parameter {
                name: "detail.blocks",
                kind: ParameterKind::Bool,
                default: Value::Bool(false),
                unit: "",
                help: "Draw blocks of 4 and of 16 cells that are no larger than a pixel as one, of their mean color",
                tag: "",
                quality_axis: false,
            },
            Parameter {
                name: "walk",
                kind: ParameterKind::Choice { choices: &["fast", "exact", "f64", "fixed"] },
                default: Value::Text("exact".to_owned()),
                unit: "",
                help: "Numbers that rays are walked in",
                tag: "",
                quality_axis: true,
            },
            Parameter {
                name: "samples",
                kind: ParameterKind::Int { min: 1, max: MOST_SAMPLES },
                default: Value::Int(1),
                unit: "",
                help: "Rays that the color of a pixel is the mean of",
                tag: "samples",
                quality_axis: true,
            },
            Parameter {
                name: "checkerboard",
                kind: ParameterKind::Bool,
                default: Value::Bool(false),
                unit: "",
                help: "Draw every other pixel of a moving picture, and the rest when it rests; with one sample",
                tag: "",
                quality_axis: false,
            },
            Parameter {
                name: "bounces",
                kind: ParameterKind::Int { min: 0, max: 8 },
                default: Value::Int(2),
                unit: "",
                help: "How often a ray is mirrored",
                tag: "bounces",
                quality_axis: false,
            },
            Parameter {
                name: "shadow",
                kind: ParameterKind::Bool,
                default: Value::Bool(true),
                unit: "",
                help: "Whether opaque voxels block light",
                tag: "shadow",
                quality_axis: false,
            },
        ],
    }
}

impl Renderer for Voxel {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, scene: &Scene, need: &Need) -> Plan {
        plan(scene, need, [self.resolution(need), self.samples(need)], self.shadows(need))
    }

    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        (self.ready, self.last) = (None, None);
        let mut model =
            model::build(scene, need, (self.resolution(need), self.filling(need)), converter, control)?;
        self.chunks.begin();
        let (items, grid_bytes) = self.items(&model, control)?;
        self.chunks.end();
        // The lights are those of the scene as given: a shape that was turned into voxels gives off no more light
        // than before.
        let mut lamps = Lamp::all(scene);
        // A frame may ask for more channels than were needed: rays toward lights must know their way all the same.
        let all = Need { channels: need.channels.with(Channel::Color), ..need.clone() };
        let switch = self.shadows(need) == Shadows::Hard;
        let demand = Demand::of(&model.scene, &all, &Lamp::lights(&lamps), switch, Surfaces::Stepped);
        for (lamp, shadow) in lamps.iter_mut().zip(&demand.shadows) {
            lamp.is_blocked = shadow.is_ok();
        }
        let is_coarse = need.settings.bool(&self.info.parameters, "detail.blocks");
        let levels = if is_coarse { levels_of(&mut model, &items, control)? } else { Vec::new() };
        let world = World::new(model.scene, items, &levels, lamps, self.walk(need));
        let bytes = world.bytes() + grid_bytes + self.chunks.bytes();
        let decisions: Arc<[Decision]> = model.decisions.into();
        self.ready = Some(Ready {
            world,
            is_converted: model.is_converted,
            decisions: decisions.clone(),
            bytes,
            bounces: need.settings.int(&self.info.parameters, "bounces").clamp(0, 8) as u32,
            shadows: self.shadows(need),
            chunks_built: self.chunks.built,
            // Many rays a pixel are for pictures that rest.
            checkerboard: need.settings.bool(&self.info.parameters, "checkerboard")
                && self.samples(need) == 1,
            samples: self.samples(need),
            is_coarse,
        });
        Ok(Prepared { objects: decisions, bytes })
    }

    fn model(&self) -> Option<Arc<Scene>> {
        self.ready.as_ref().filter(|r| r.is_converted).map(|r| r.world.scene.clone())
    }

    fn render(
        &mut self,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError> {
        let ready = self.ready.as_ref().ok_or(RenderError::NotPrepared)?;
        let mut phases = Phases::start();
        let last = self.last.take();
        let same = last.filter(|last| Some(last.stamp) == target.stamp() && last.camera == frame.camera);
        if let Some(last) = same.as_ref().filter(|last| last.is_whole && ready.checkerboard) {
            // Both halves are there.
            self.last = Some(last.clone());
            let counters = [const { None }; 6];
            return Ok(Report { objects: ready.decisions.clone(), phases, counters, bytes: ready.bytes });
        }
        self.halves = self.halves.wrapping_add(1);
        let pattern = match &same {
            _ if !ready.checkerboard => Pattern::Whole,
            Some(last) => Pattern::Half { first: last.first ^ 1, fills: false },
            None => Pattern::Half { first: self.halves & 1, fills: true },
        };
        let footprint =
            if ready.is_coarse { Footprint::of(&frame.camera, target.height()) } else { Footprint::NONE };
        let painter = Painter::new(&frame.camera, target, pattern, ready.samples, footprint);
        let [rays, shadow_rays, steps] = [const { AtomicU64::new(0) }; 3];
        let stopped = AtomicBool::new(false);
        target.for_each_band(control.threads, TILE, &|mut band| {
            let tracer = Tracer {
                world: &ready.world,
                bounces: ready.bounces,
                shadows: ready.shadows,
                counts: Counts::default(),
            };
            let is_done = painter.paint(&tracer, &mut band, control);
            rays.fetch_add(tracer.counts.rays.get(), Ordering::Relaxed);
            shadow_rays.fetch_add(tracer.counts.shadow_rays.get(), Ordering::Relaxed);
            steps.fetch_add(tracer.counts.steps.get(), Ordering::Relaxed);
            if is_done {
                control.finished(&band);
            } else {
                stopped.store(true, Ordering::Relaxed);
            }
        });
        if stopped.into_inner() {
            return Err(RenderError::Cancelled);
        }
        phases.end("trace");
        if let Pattern::Half { first, fills } = pattern {
            let half = |stamp| Half { stamp, camera: frame.camera.clone(), first, is_whole: !fills };
            self.last = target.stamp().map(half);
        }
        let filled = if matches!(pattern, Pattern::Half { fills: true, .. }) {
            u64::from(target.width()) * u64::from(target.height()) / 2
        } else {
            0
        };
        let counter = |name, count| Some(Counter { name, count });
        let counters = [
            counter("rays", rays.into_inner()),
            counter("shadow rays", shadow_rays.into_inner()),
            counter("steps", steps.into_inner()),
            counter("chunks built", ready.chunks_built),
            (filled > 0).then_some(Counter { name: "pixels filled in", count: filled }),
            None,
        ];
        Ok(Report { objects: ready.decisions.clone(), phases, counters, bytes: ready.bytes })
    }
}
