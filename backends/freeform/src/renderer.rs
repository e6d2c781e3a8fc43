//! The seam: what is prepared and kept, and one frame of it.

use crate::bundle::TILE;
use crate::frame::{FrameDrawing, Options, Scratch};
use crate::world::{Body, Geometry, World};
use polyptych_core::convert::{Converter, Detail};
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::scene::{Object, Scene, Shape, ShapeKind};
use polyptych_core::seam::{
    BackendFactory, BackendInfo, Control, Counter, Decision, Frame, Need, ObjectPlan, Parameter,
    ParameterKind, PassPlan, Phases, Plan, Prepared, Registry, RenderError, Renderer, Report, Value,
};
use std::collections::HashMap;
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
    options: Options,
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
            options: Options { shadows: true, volume_step: 0.5 },
            scratch: Vec::new(),
            bytes: 0,
        }
    }

    fn detail(&self, need: &Need, object: &Object) -> Detail {
        Detail {
            tolerance: need.world_tolerance(&object.bounds()),
            max_resolution: need.settings.int(&self.info.parameters, "detail.resolution") as u32,
        }
    }

    /// Returns what is cast of an object and how that stands to the object as given.
    fn geometry(
        &mut self,
        scene: &Scene,
        object: &Object,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<(Arc<Geometry>, Decision), String> {
        let key = Arc::as_ptr(&object.shape) as usize;
        if let Some((_, geometry)) = self.kept.get(&key) {
            return Ok((geometry.clone(), Decision::Exact));
        }
        if let Some(geometry) = Geometry::of(&object.shape) {
            let geometry = Arc::new(geometry);
            self.kept.insert(key, (object.shape.clone(), geometry.clone()));
            return Ok((geometry, Decision::Exact));
        }
        let detail = self.detail(need, object);
        let model = converter.distance(scene, object, detail, control.threads).map_err(|e| e.reason)?;
        let decision = Decision::Converted { bound: model.bound, why: model.why.clone() };
        Ok((Arc::new(Geometry::Field(model)), decision))
    }
}

/// Says why an object cannot be drawn, if that is so.
fn why_skipped(object: &Object) -> Option<&'static str> {
    if object.visible { object.why_undrawable() } else { Some("it is invisible") }
}

/// Weakens a decision by what this back end leaves out of a material.
fn with_material(scene: &Scene, object: &Object, decision: Decision) -> Decision {
    let mirror = (0..object.materials.len()).any(|slot| scene.material(object, slot).reflectivity > 0.0);
    match decision {
        Decision::Exact if mirror => {
            Decision::Approximated { why: "mirror reflections are not drawn".to_owned() }
        }
        Decision::Converted { why, .. } if mirror => {
            Decision::Approximated { why: format!("{why}; mirror reflections are not drawn") }
        }
        other => other,
    }
}

impl Renderer for Freeform {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, scene: &Scene, need: &Need) -> Plan {
        let converter = Converter::default();
        let objects: Vec<ObjectPlan> = scene
            .objects
            .iter()
            .map(|object| {
                let (decision, builds, bytes) = match why_skipped(object) {
                    Some(why) => (Decision::Skipped { why: why.to_owned() }, String::new(), 0),
                    None if self.info.draws(object.shape.kind()) => {
                        let bytes = match &*object.shape {
                            Shape::Volume(v) => v.samples().len() as u64 * 4,
                            Shape::HeightField(h) => h.heights().len() as u64 * 11,
                            Shape::FreeForm(f) => f.form().node_count() as u64 * 104,
                            _ => 512,
                        };
                        (with_material(scene, object, Decision::Exact), String::new(), bytes)
                    }
                    None => {
                        let forecast = converter.distance_forecast(scene, object, self.detail(need, object));
                        let why = "drawn as the zero level of signed distances".to_owned();
                        let decision = Decision::Converted { bound: forecast.bound, why };
                        (with_material(scene, object, decision), forecast.builds, forecast.bytes)
                    }
                };
                let (name, shape) = (object.name.clone(), object.shape.kind().name());
                ObjectPlan { name, shape, decision, builds, bytes }
            })
            .collect();
        let pixels = f64::from(need.width) * f64::from(need.height);
        let shadows = need.settings.bool(&self.info.parameters, "shadow");
        let casting = scene.lights.iter().filter(|l| l.casts_shadow).count();
        Plan {
            bytes: objects.iter().map(|o| o.bytes).sum(),
            passes: vec![
                PassPlan { name: "primary rays".to_owned(), needed: true, why: "one a pixel".to_owned() },
                PassPlan {
                    name: "shadow rays".to_owned(),
                    needed: shadows && casting > 0,
                    why: format!(
                        "{casting} lights cast shadows, shadows are {}",
                        if shadows { "on" } else { "off" }
                    ),
                },
            ],
            // A quarter of a microsecond a ray and function layer, measured on the built-in scenes.
            estimated_ms: pixels * 2.5e-4 * (1.0 + casting as f64 * f64::from(u8::from(shadows))),
            objects,
        }
    }

    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        self.options = Options {
            shadows: need.settings.bool(&self.info.parameters, "shadow"),
            volume_step: need.settings.float(&self.info.parameters, "volume.step"),
        };
        // Shapes that are gone from the scene are let go.
        self.kept.retain(|_, (shape, _)| scene.objects.iter().any(|o| Arc::ptr_eq(&o.shape, shape)));
        let mut bodies = Vec::new();
        let mut decisions = Vec::with_capacity(scene.objects.len());
        for (index, object) in scene.objects.iter().enumerate() {
            control.check()?;
            let built = match why_skipped(object) {
                Some(why) => Err(why.to_owned()),
                None => self.geometry(scene, object, need, converter, control),
            };
            decisions.push(match built {
                Ok((geometry, decision)) => {
                    bodies.push(Body::new(scene, index, object, geometry));
                    with_material(scene, object, decision)
                }
                Err(reason) if object.required => {
                    return Err(RenderError::Required { object: object.name.clone(), reason });
                }
                Err(why) => Decision::Skipped { why },
            });
        }
        self.bytes = bodies.iter().map(|b| b.geometry.bytes()).sum();
        let decisions: Arc<[Decision]> = decisions.into();
        self.world = Some(World {
            scene: scene.clone(),
            bodies,
            lights: scene.all_lights(),
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
        let drawing = FrameDrawing {
            world,
            view: frame.camera.view(target.width(), target.height()),
            channels: target.channels(),
            options: self.options,
        };
        let bands = target.height().div_ceil(TILE) as usize;
        if self.scratch.len() < bands {
            self.scratch.resize_with(bands, Mutex::default);
        }
        let scratch = &self.scratch;
        target.for_each_band(control.threads, TILE, &|band| {
            let own = &scratch[(band.first_row / TILE) as usize];
            drawing.band(band, &mut own.lock().unwrap_or_else(PoisonError::into_inner), control);
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
