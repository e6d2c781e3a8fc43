//! The seam: what is prepared and kept, and one frame of it.

use crate::bundle::TILE;
use crate::edges::Edges;
use crate::form::Precision;
use crate::frame::{FrameDrawing, Scratch};
use crate::plan::plan;
use crate::volume::Drawing;
use crate::world::{Body, Geometry, World};
use polyptych_core::convert::{ConvertError, Converter, Detail};
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::scene::{Light, Object, Scene, Shape, ShapeKind};
use polyptych_core::seam::{
    self, BackendFactory, BackendInfo, Control, Counter, Decision, Demand, Frame, Need, Parameter,
    ParameterKind, Phases, Plan, Prepared, Registry, RenderError, Renderer, Report, Surfaces, Value,
};
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, PoisonError};

/// Makes [`Freeform`] renderers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl BackendFactory for Factory {
    fn info(&self) -> BackendInfo {
        info()
    }
    fn create(&self, _registry: &Registry) -> Box<dyn Renderer> {
        Box::new(Freeform::new())
    }
}

fn info() -> BackendInfo {
    BackendInfo {
        id: "freeform".to_owned(),
        name: "Free-form caster".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        native: vec![ShapeKind::Primitive, ShapeKind::FreeForm, ShapeKind::HeightField, ShapeKind::Volume],
        channels: Channels::ALL,
        photometric: true,
        parameters: vec![
            Parameter {
                name: "detail.resolution",
                kind: ParameterKind::Int { min: 16, max: 512 },
                default: Value::Int(128),
                unit: "samples",
                help: "most signed distances along the longest edge of a mesh or voxel object",
                tag: "detail.tolerance",
                quality_axis: true,
            },
            Parameter {
                name: "volume.step",
                kind: ParameterKind::Float { min: 0.05, max: 4.0 },
                default: Value::Float(0.5),
                unit: "samples",
                help: "step through volumes, in units of the smallest distance of their samples",
                tag: "volume.step",
                quality_axis: true,
            },
            Parameter {
                name: "volume.gradients",
                kind: ParameterKind::Choice { choices: &["found", "kept"] },
                default: Value::Text("found".to_owned()),
                unit: "",
                help: "whether gradients of volumes are found for each sample, or kept with five times the memory",
                tag: "volume.gradients",
                quality_axis: false,
            },
            Parameter {
                name: "volume.levels",
                kind: ParameterKind::Bool,
                default: Value::Bool(false),
                unit: "",
                help: "whether volumes of which many samples are in a pixel are drawn from averages of samples",
                tag: "volume.levels",
                quality_axis: false,
            },
            Parameter {
                name: "volume.surface",
                kind: ParameterKind::Bool,
                default: Value::Bool(false),
                unit: "",
                help: "whether volumes are drawn as the surface where their opacity passes half of its greatest",
                tag: "volume.surface",
                quality_axis: false,
            },
            Parameter {
                name: "roots.precision",
                kind: ParameterKind::Choice { choices: &["single", "double"] },
                default: Value::Text("single".to_owned()),
                unit: "",
                help: "numbers in which roots of free forms are searched for; both end with a step in double precision",
                tag: "roots.precision",
                quality_axis: true,
            },
            Parameter {
                name: "edge.rays",
                kind: ParameterKind::Choice { choices: &["1", "2", "4", "8"] },
                default: Value::Text("1".to_owned()),
                unit: "rays",
                help: "rays along each edge of a pixel in which edges or thin things may be",
                tag: "edge.rays",
                quality_axis: false,
            },
            Parameter {
                name: "shadow",
                kind: ParameterKind::Bool,
                default: Value::Bool(true),
                unit: "",
                help: "whether opaque things block light",
                tag: "shadow.quality",
                quality_axis: false,
            },
        ],
    }
}

/// The free-form quadric caster.
pub struct Freeform {
    info: BackendInfo,
    /// What was built of each shape, under the address of the shape, which is kept alive.
    kept: HashMap<usize, (Arc<Shape>, Arc<Geometry>)>,
    world: Option<World>,
    /// How the volumes that are kept are drawn.
    volumes: Drawing,
    /// Rays along each edge of a pixel in which there are edges.
    edge_rays: u32,
    scratch: Vec<Mutex<Scratch>>,
    bytes: u64,
}

impl Default for Freeform {
    fn default() -> Self {
        Self::new()
    }
}

impl Freeform {
    /// Makes a renderer that has prepared nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self {
            info: info(),
            kept: HashMap::new(),
            world: None,
            volumes: Drawing { step: 0.5, keeps_gradients: false, has_levels: false, as_surface: false },
            edge_rays: 1,
            scratch: Vec::new(),
            bytes: 0,
        }
    }

    fn detail(&self, need: &Need, object: &Object) -> Detail {
        seam::detail(object, need, need.settings.int(&self.info.parameters, "detail.resolution") as u32)
    }

    /// How volumes are to be drawn.
    fn drawing(&self, need: &Need) -> Drawing {
        let (settings, declared) = (&need.settings, &self.info.parameters);
        Drawing {
            step: settings.float(declared, "volume.step"),
            keeps_gradients: settings.text(declared, "volume.gradients") == "kept",
            has_levels: settings.bool(declared, "volume.levels"),
            as_surface: settings.bool(declared, "volume.surface"),
        }
    }

    /// Says how a shape is drawn that is not converted.
    fn as_given(&self, shape: &Shape) -> Decision {
        unconverted(shape, self.volumes)
    }

    /// What a picture takes.
    fn demand(&self, scene: &Scene, need: &Need, lights: &[Light]) -> Demand {
        let switch = need.settings.bool(&self.info.parameters, "shadow");
        Demand::of(scene, need, lights, switch, Surfaces::Smooth)
    }

    /// Returns what is cast of an object and how that stands to the object as given.
    fn geometry(
        &mut self,
        scene: &Scene,
        object: &Object,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<(Arc<Geometry>, Decision), ConvertError> {
        let key = Arc::as_ptr(&object.shape) as usize;
        if let Some((_, geometry)) = self.kept.get(&key) {
            return Ok((geometry.clone(), self.as_given(&object.shape)));
        }
        if let Some(geometry) = Geometry::of(&object.shape, self.volumes) {
            let geometry = Arc::new(geometry);
            self.kept.insert(key, (object.shape.clone(), geometry.clone()));
            return Ok((geometry, self.as_given(&object.shape)));
        }
        let detail = self.detail(need, object);
        let model = converter.distance(scene, object, detail, control)?;
        let decision = converted(object, model.bound, &model.why);
        Ok((Arc::new(Geometry::Field(model)), decision))
    }
}

/// Says how a shape is drawn that is not converted.
pub(crate) fn unconverted(shape: &Shape, volumes: Drawing) -> Decision {
    match shape {
        Shape::Volume(volume) if volumes.as_surface => {
            let value = volume.transfer.surface_value();
            Decision::Approximated {
                why: format!("surface at value {value:.4}; what is translucent is lost"),
            }
        }
        _ => Decision::Exact,
    }
}

/// Says how an object is drawn that was converted.
pub(crate) fn converted(object: &Object, bound: f64, why: &str) -> Decision {
    let left_out = seam::left_out(&object.shape);
    if left_out.is_empty() {
        Decision::Converted { bound, why: why.to_owned() }
    } else {
        Decision::Approximated { why: format!("{why}; {}", left_out.join("; ")) }
    }
}

/// Weakens a decision by what this back end leaves out of a material.
pub(crate) fn with_material(scene: &Scene, object: &Object, decision: Decision) -> Decision {
    let mirror = (0..object.materials.len()).any(|slot| scene.material(object, slot).reflectivity > 0.0);
    if mirror { decision.weakened("mirror reflections are not drawn") } else { decision }
}

impl Renderer for Freeform {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, scene: &Scene, need: &Need) -> Plan {
        let lights = scene.all_lights();
        let demand = self.demand(scene, need, &lights);
        plan(scene, need, &demand, self.drawing(need), |object| self.detail(need, object))
    }

    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        let volumes = self.drawing(need);
        let precision = match need.settings.text(&self.info.parameters, "roots.precision") {
            "double" => Precision::Double,
            _ => Precision::Single,
        };
        self.edge_rays = need.settings.text(&self.info.parameters, "edge.rays").parse().unwrap_or(1);
        if volumes != self.volumes {
            // Opacities are kept for samples so far apart.
            self.kept.retain(|_, (_, geometry)| !matches!(**geometry, Geometry::Volume(_)));
            self.volumes = volumes;
        }
        // Shapes that are gone from the scene are let go.
        self.kept.retain(|_, (shape, _)| scene.objects.iter().any(|o| Arc::ptr_eq(&o.shape, shape)));
        let lights = scene.all_lights();
        let mut bodies = Vec::new();
        let mut decisions = Vec::with_capacity(scene.objects.len());
        for (index, object) in scene.objects.iter().enumerate() {
            control.check()?;
            let built = match seam::why_not_drawn(object) {
                Some(why) => Err(why.to_owned()),
                None => match self.geometry(scene, object, need, converter, control) {
                    Ok(built) => Ok(built),
                    Err(error) => Err(error.reason()?),
                },
            };
            decisions.push(match built {
                Ok((geometry, decision)) => {
                    bodies.push(Body::new((scene, &lights, precision), index, object, geometry));
                    with_material(scene, object, decision)
                }
                Err(reason) if object.required => {
                    return Err(RenderError::Required { object: object.name.clone(), reason });
                }
                Err(why) => Decision::Skipped { why },
            });
        }
        let mut seen = HashSet::new();
        let own = bodies.iter().filter(|b| seen.insert(Arc::as_ptr(&b.geometry)));
        self.bytes = own.map(|b| b.geometry.bytes()).sum();
        let decisions: Arc<[Decision]> = decisions.into();
        // A frame may ask for more channels than were needed: rays toward lights must know their way all the same.
        let all = Need { channels: need.channels.with(Channel::Color), ..need.clone() };
        let demand = self.demand(scene, &all, &lights);
        self.world = Some(World {
            scene: scene.clone(),
            bodies,
            blocked: demand.shadows.iter().map(Result::is_ok).collect(),
            lights,
            decisions: decisions.clone(),
        });
        Ok(Prepared { objects: decisions, bytes: self.bytes })
    }

    fn render(
        &mut self,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError> {
        let world = self.world.as_ref().ok_or(RenderError::NotPrepared)?;
        let mut phases = Phases::start();
        let (width, height, rays) = (target.width(), target.height(), self.edge_rays);
        let view = frame.camera.view(width, height);
        let drawing = FrameDrawing { world, view, channels: target.channels(), corner: [0; 2] };
        let fine_view = frame.camera.view(width.saturating_mul(rays), height.saturating_mul(rays));
        let edges = Edges { world, view, fine_view, height, rays };
        let shows = [Channel::Color, Channel::Coverage].iter().any(|&c| target.channels().has(c));
        let bands = target.height().div_ceil(TILE) as usize;
        if self.scratch.len() < bands {
            self.scratch.resize_with(bands, Mutex::default);
        }
        let scratch = &self.scratch;
        target.for_each_band(control.threads, TILE, &|mut band| {
            let own = &scratch[(band.first_row / TILE) as usize];
            let mut own = own.lock().unwrap_or_else(PoisonError::into_inner);
            drawing.band(&mut band, &mut own, control);
            if rays > 1 && shows && !control.is_cancelled() {
                let more = edges.refine(&mut band, &mut own.fine);
                own.traced += more;
            }
            if !control.is_cancelled() {
                control.finished(&band);
            }
        });
        control.check()?;
        phases.end("draw");
        let rays =
            scratch[..bands].iter().map(|s| s.lock().unwrap_or_else(PoisonError::into_inner).traced).sum();
        let mut report =
            Report { objects: world.decisions.clone(), phases, bytes: self.bytes, ..Report::default() };
        report.counters[0] = Some(Counter { name: "rays", count: rays });
        Ok(report)
    }
}
