//! How does the host drive the reference: plan, prepare, render?

use crate::cost;
use crate::lights::Lamp;
use crate::march::Cloud;
use crate::sampling::place_in_pixel;
use crate::shade::Wants;
use crate::shapes::Geometry;
use crate::trace::Tracer;
use crate::world::{Item, World};
use glam::Vec3;
use polyptych_core::camera::View;
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Band, Channel, Channels, Framebuffer, Pixel};
use polyptych_core::scene::{Object, Scene, Shape, ShapeKind};
use polyptych_core::seam::{
    self, BackendFactory, BackendInfo, Control, Counter, Decision, Demand, Frame, Need, ObjectPlan,
    Parameter, ParameterKind, PassPlan, Phases, Plan, Prepared, Registry, RenderError, Renderer, Report,
    Surfaces, Value,
};
use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Rows of a band: small, so that two threads end at about the same time.
const ROWS: u32 = 8;
/// Pixels between two looks at the stop sign.
const PATIENCE: u32 = 16;

/// Makes instances of [`Reference`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl BackendFactory for Factory {
    fn info(&self) -> BackendInfo {
        info()
    }

    fn create(&self, _registry: &Registry) -> Box<dyn Renderer> {
        Box::new(Reference::new())
    }
}

/// The reference back end: an exact ray caster in double precision. See the crate's documentation for what it
/// holds to be right.
#[derive(Debug)]
pub struct Reference {
    info: BackendInfo,
    ready: Option<Ready>,
    /// Geometry of shapes seen by the last `prepare`, by address; the shape is kept, so the address is too.
    built: HashMap<usize, Arc<Geometry>>,
}

#[derive(Debug)]
struct Ready {
    world: World,
    decisions: Arc<[Decision]>,
    bytes: u64,
    samples: u32,
    bounces: u32,
    volume_step: f64,
}

impl Default for Reference {
    fn default() -> Self {
        Self::new()
    }
}

impl Reference {
    /// Makes an instance that has nothing prepared.
    #[must_use]
    pub fn new() -> Self {
        Self { info: info(), ready: None, built: HashMap::new() }
    }
}

fn info() -> BackendInfo {
    BackendInfo {
        id: "reference".to_owned(),
        name: "Exact reference".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        native: ShapeKind::ALL.to_vec(),
        channels: Channels::ALL,
        photometric: true,
        parameters: vec![
            Parameter {
                name: "samples",
                kind: ParameterKind::Int { min: 1, max: 256 },
                default: Value::Int(1),
                unit: "",
                help: "Samples a pixel for color and coverage; geometry always comes from the pixel's center",
                tag: "samples",
                quality_axis: true,
            },
            Parameter {
                name: "bounces",
                kind: ParameterKind::Int { min: 0, max: 16 },
                default: Value::Int(4),
                unit: "",
                help: "How often a ray is mirrored",
                tag: "bounces",
                quality_axis: false,
            },
            Parameter {
                name: "volume.step",
                kind: ParameterKind::Float { min: 0.05, max: 2.0 },
                default: Value::Float(0.25),
                unit: "spacings",
                help: "Length of a step through a volume",
                tag: "volume.step",
                quality_axis: true,
            },
        ],
    }
}

/// Decides how an object is drawn: as given, but for what has no area or no place.
fn decide(object: &Object) -> Decision {
    if let Some(why) = seam::why_not_drawn(object) {
        return Decision::Skipped { why: why.to_owned() };
    }
    let left_out = seam::left_out(&object.shape);
    if left_out.is_empty() { Decision::Exact } else { Decision::Approximated { why: left_out.join("; ") } }
}

fn describe(shape: &Shape) -> String {
    match shape {
        Shape::Mesh(mesh) => format!("tree over {} triangles", mesh.triangles.len()),
        Shape::HeightField(_) => "ranges of blocks of 4x4 cells".to_owned(),
        Shape::Volume(_) => "marks of empty blocks of 8x8x8 cells".to_owned(),
        Shape::Primitive(_) | Shape::Voxels(_) | Shape::FreeForm(_) => String::new(),
    }
}

fn address(shape: &Arc<Shape>) -> usize {
    Arc::as_ptr(shape).addr()
}

impl Renderer for Reference {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, scene: &Scene, need: &Need) -> Plan {
        let mut seen = std::collections::HashSet::new();
        let objects: Vec<ObjectPlan> = scene
            .objects
            .iter()
            .map(|object| {
                let decision = decide(object);
                let builds =
                    !matches!(decision, Decision::Skipped { .. }) && seen.insert(address(&object.shape));
                ObjectPlan {
                    name: object.name.clone(),
                    shape: object.shape.kind().name(),
                    decision,
                    builds: if builds { describe(&object.shape) } else { String::new() },
                    bytes: if builds { Geometry::estimated_bytes(&object.shape) } else { 0 },
                }
            })
            .collect();
        let of_kind = |is_cloud: bool| {
            let drawn = scene.objects.iter().filter(|o| seam::why_not_drawn(o).is_none());
            drawn.filter(|o| matches!(&*o.shape, Shape::Volume(_)) == is_cloud).count()
        };
        let lights = scene.all_lights();
        let bytes = objects.iter().map(|o| o.bytes).sum::<u64>()
            + World::planned_bytes(of_kind(false), of_kind(true), lights.len());
        // The ruler casts every shadow ray: it must not rest on what it is to check.
        let demand = Demand::of(scene, need, &lights, true, Surfaces::Stepped);
        let samples = self.samples(need);
        let mut passes = vec![PassPlan {
            name: "primary rays".to_owned(),
            needed: true,
            why: format!("{samples} for a pixel's color, its center for geometry"),
        }];
        passes.extend(demand.passes());
        let casting = lights.iter().filter(|l| l.casts_shadow).count();
        let shades = demand.shading || need.channels.has(Channel::Shadow);
        passes.push(PassPlan {
            name: "shadow rays".to_owned(),
            needed: shades && casting > 0,
            why: match (shades, casting) {
                (false, _) => "neither color nor shadow is asked for".to_owned(),
                (true, 0) => "no light casts a shadow".to_owned(),
                (true, n) => format!("{n} lights cast shadows"),
            },
        });
        let step = need.settings.float(&self.info.parameters, "volume.step");
        let estimated_ms = cost::milliseconds(scene, need, [lights.len(), casting], samples, step);
        Plan { objects, passes, bytes, estimated_ms }
    }

    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        _converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        self.ready = None;
        let mut built = HashMap::with_capacity(self.built.len());
        let (mut items, mut clouds, mut decisions) = (Vec::new(), Vec::new(), Vec::new());
        for (index, object) in scene.objects.iter().enumerate() {
            control.check()?;
            let decision = decide(object);
            if let Decision::Skipped { why } = &decision {
                if object.required && object.visible {
                    return Err(RenderError::Required { object: object.name.clone(), reason: why.clone() });
                }
                decisions.push(decision);
                continue;
            }
            let key = address(&object.shape);
            let geometry = built.entry(key).or_insert_with(|| {
                self.built.get(&key).cloned().unwrap_or_else(|| Arc::new(Geometry::new(&object.shape)))
            });
            match &*object.shape {
                Shape::Volume(_) => clouds.push(Cloud::new(scene, index, geometry.clone())),
                _ => items.push(Item::new(scene, index, geometry.clone())),
            }
            decisions.push(decision);
        }
        self.built = built;
        control.check()?;
        let world = World::new(scene.clone(), items, clouds, Lamp::all(scene));
        let bytes = world.bytes() + self.built.values().map(|g| g.bytes()).sum::<u64>();
        let decisions: Arc<[Decision]> = decisions.into();
        let declared = &self.info.parameters;
        self.ready = Some(Ready {
            world,
            decisions: decisions.clone(),
            bytes,
            samples: self.samples(need),
            bounces: need.settings.int(declared, "bounces").clamp(0, 16) as u32,
            volume_step: need.settings.float(declared, "volume.step").clamp(0.05, 2.0),
        });
        Ok(Prepared { objects: decisions, bytes })
    }

    fn render(
        &mut self,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError> {
        let ready = self.ready.as_ref().ok_or(RenderError::NotPrepared)?;
        let mut phases = Phases::start();
        let view = frame.camera.view(target.width(), target.height());
        let painter = Painter { ready, view, channels: target.channels() };
        let (rays, shadow_rays) = (AtomicU64::new(0), AtomicU64::new(0));
        let stopped = AtomicBool::new(false);
        target.for_each_band(control.threads, ROWS, &|mut band| {
            let tracer = Tracer {
                world: &ready.world,
                bounces: ready.bounces,
                volume_step: ready.volume_step,
                rays: Cell::new(0),
                shadow_rays: Cell::new(0),
            };
            let done = painter.paint(&tracer, &mut band, control);
            rays.fetch_add(tracer.rays.get(), Ordering::Relaxed);
            shadow_rays.fetch_add(tracer.shadow_rays.get(), Ordering::Relaxed);
            if done {
                control.finished(&band);
            } else {
                stopped.store(true, Ordering::Relaxed);
            }
        });
        if stopped.into_inner() {
            return Err(RenderError::Cancelled);
        }
        phases.end("trace");
        let mut counters = [None; 6];
        counters[0] = Some(Counter { name: "rays", count: rays.into_inner() });
        counters[1] = Some(Counter { name: "shadow rays", count: shadow_rays.into_inner() });
        Ok(Report { objects: ready.decisions.clone(), phases, counters, bytes: ready.bytes })
    }
}

impl Reference {
    fn samples(&self, need: &Need) -> u32 {
        let declared = need.settings.int(&self.info.parameters, "samples").clamp(1, 256) as u32;
        need.samples.max(declared)
    }
}

/// Draws bands of a picture.
struct Painter<'a> {
    ready: &'a Ready,
    view: View<'a>,
    channels: Channels,
}

impl Painter<'_> {
    /// Draws a band; false where the host stopped it.
    fn paint(&self, tracer: &Tracer<'_>, band: &mut Band<'_>, control: &Control<'_>) -> bool {
        for row in 0..band.rows {
            for x in 0..band.width {
                if x.is_multiple_of(PATIENCE) && control.is_cancelled() {
                    return false;
                }
                let pixel = self.pixel(tracer, x, band.first_row + row);
                band.put(x, row, &pixel);
            }
        }
        true
    }

    fn pixel(&self, tracer: &Tracer<'_>, x: u32, y: u32) -> Pixel {
        let samples = self.ready.samples;
        let color = self.channels.has(Channel::Color);
        let coverage = self.channels.has(Channel::Coverage);
        let geometry = [Channel::Distance, Channel::Normal, Channel::Id, Channel::Albedo, Channel::Shadow]
            .iter()
            .any(|&c| self.channels.has(c));
        let center = Wants {
            color: color && samples <= 1,
            normal: self.channels.has(Channel::Normal),
            albedo: self.channels.has(Channel::Albedo),
            shadow: self.channels.has(Channel::Shadow),
        };
        let mut pixel = if geometry || samples <= 1 {
            self.sample(tracer, x, y, (0.5, 0.5), center)
        } else {
            Pixel::background(Vec3::ZERO)
        };
        if samples > 1 && (color || coverage) {
            let (mut sum, mut hits) = (glam::DVec3::ZERO, 0u32);
            for sample in 0..samples {
                let place = place_in_pixel(x, y, sample, samples);
                let wants = Wants { color, normal: false, albedo: false, shadow: false };
                let seen = self.sample(tracer, x, y, place, wants);
                sum += seen.color.as_dvec3();
                hits += u32::from(seen.id != 0);
            }
            pixel.color = (sum / f64::from(samples)).as_vec3();
            pixel.coverage = hits as f32 / samples as f32;
        }
        pixel
    }

    fn sample(&self, tracer: &Tracer<'_>, x: u32, y: u32, place: (f64, f64), wants: Wants) -> Pixel {
        match self.view.ray(f64::from(x) + place.0, f64::from(y) + place.1) {
            Some(ray) => tracer.look(&ray, wants),
            None => Pixel::background(Vec3::ZERO),
        }
    }
}
