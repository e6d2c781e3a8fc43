//! A back end in a library: how open to the sky is each place? Ambient occlusion by rays over the half sphere.
//!
//! The color is the base color times the share of directions in which nothing is near: corners and hollows are dark,
//! whatever the lights are. None of the built-in back ends draws that. It takes triangles only; the host converts all
//! other shapes before.
//!
//! Source: S. Zhukov, A. Iones, G. Kronin, *An ambient light illumination model*, Rendering Techniques 1998; directions
//! by the cosine, on a spiral after H. Vogel, *A better way to construct the sunflower head*, 1979.

mod hit;
mod surface;
mod tree;

use polyptych_plugin::core::convert::Converter;
use polyptych_plugin::core::framebuffer::{Channel, Channels, Framebuffer, Pixel};
use polyptych_plugin::core::scene::{Material, Object, Scene, Shape, ShapeKind};
use polyptych_plugin::core::seam::{
    BackendInfo, Control, Counter, Decision, Frame, Need, ObjectPlan, Parameter, ParameterKind, PassPlan,
    Phases, Plan, Prepared, RenderError, Report, Value,
};
use polyptych_plugin::{Renderer, export_backend};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use surface::World;

export_backend!(Occlusion, accepts: [Mesh]);

/// The back end.
pub struct Occlusion {
    info: BackendInfo,
    ready: Option<Ready>,
}

struct Ready {
    world: World,
    samples: u32,
    radius: f64,
    decisions: Arc<[Decision]>,
}

impl Default for Occlusion {
    fn default() -> Self {
        let parameters = vec![
            Parameter {
                name: "samples",
                kind: ParameterKind::Int { min: 1, max: 1024 },
                default: Value::Int(16),
                unit: "rays",
                help: "directions that are tried at each pixel",
                tag: "samples",
                quality_axis: true,
            },
            Parameter {
                name: "radius",
                kind: ParameterKind::Float { min: 0.001, max: 10.0 },
                default: Value::Float(0.25),
                unit: "of the scene's radius",
                help: "how near a thing must be to shade a place",
                tag: "",
                quality_axis: false,
            },
        ];
        let info = BackendInfo {
            id: "occlusion".into(),
            name: "Ambient occlusion".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            native: vec![ShapeKind::Mesh],
            channels: Channels::of(&[
                Channel::Color,
                Channel::Distance,
                Channel::Normal,
                Channel::Id,
                Channel::Albedo,
                Channel::Coverage,
            ]),
            photometric: false,
            parameters,
        };
        Self { info, ready: None }
    }
}

/// Says how an object is drawn.
fn decision(scene: &Scene, object: &Object) -> Decision {
    if !object.visible {
        return Decision::Skipped { why: "it is invisible".into() };
    }
    if let Shape::Mesh(mesh) = &*object.shape
        && mesh.triangles.is_empty()
        && !mesh.segments.is_empty()
    {
        return Decision::Skipped { why: "line segments have no area".into() };
    }
    let materials = || (0..object.materials.len().max(1)).map(|slot| scene.material(object, slot));
    if materials().any(Material::is_see_through) {
        return Decision::Approximated { why: "what is see-through is drawn opaque".into() };
    }
    Decision::Exact
}

impl Renderer for Occlusion {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, scene: &Scene, need: &Need) -> Plan {
        let mut triangles = 0;
        let objects = scene.objects.iter().map(|object| {
            let count = match &*object.shape {
                Shape::Mesh(mesh) => mesh.triangles.len() as u64,
                _ => 0,
            };
            triangles += count;
            ObjectPlan {
                name: object.name.clone(),
                shape: object.shape.kind().name(),
                decision: decision(scene, object),
                builds: if count > 0 { format!("a tree over {count} triangles") } else { String::new() },
                bytes: count * World::BYTES_PER_TRIANGLE,
            }
        });
        let objects: Vec<_> = objects.collect();
        let samples = need.settings.int(&self.info.parameters, "samples");
        let pass = PassPlan {
            name: "occlusion".into(),
            needed: need.channels.has(Channel::Color),
            why: format!("{samples} rays from each visible point, for the color"),
        };
        let pixels = f64::from(need.width) * f64::from(need.height);
        Plan {
            objects,
            passes: vec![pass],
            bytes: triangles * World::BYTES_PER_TRIANGLE,
            estimated_ms: pixels * (1.0 + samples as f64) * 4e-4,
        }
    }

    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        _: &Converter,
        control: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        control.check()?;
        let decisions: Vec<Decision> = scene.objects.iter().map(|o| decision(scene, o)).collect();
        for (object, decision) in scene.objects.iter().zip(&decisions) {
            if let Decision::Skipped { why } = decision
                && object.required
                && object.visible
            {
                return Err(RenderError::Required { object: object.name.clone(), reason: why.clone() });
            }
        }
        let drawn = |index: usize| !matches!(decisions[index], Decision::Skipped { .. });
        let world = World::new(scene.clone(), &drawn);
        let radius = need.settings.float(&self.info.parameters, "radius") * world.radius();
        let samples = need.settings.int(&self.info.parameters, "samples") as u32;
        let (objects, bytes) = (Arc::from(decisions), world.bytes());
        let ready = Ready { world, samples, radius, decisions: Arc::clone(&objects) };
        self.ready = Some(ready);
        Ok(Prepared { objects, bytes })
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
        let (channels, rays) = (target.channels(), AtomicU64::new(0));
        target.for_each_band(control.threads, 4, &|mut band| {
            for row in 0..band.rows {
                if control.is_cancelled() {
                    return;
                }
                let y = band.first_row + row;
                for x in 0..band.width {
                    let ray = view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
                    let pixel = match ray {
                        Some(ray) => ready.pixel(ray, u64::from(y) << 32 | u64::from(x), channels),
                        None => Pixel::background(Default::default()),
                    };
                    band.put(x, row, &pixel);
                }
                rays.fetch_add(u64::from(band.width), Ordering::Relaxed);
            }
            control.finished(&band);
        });
        control.check()?;
        phases.end("draw");
        let mut counters = [None; 6];
        counters[0] = Some(Counter { name: "primary rays", count: rays.into_inner() });
        let (objects, bytes) = (ready.decisions.clone(), ready.world.bytes());
        Ok(Report { objects, phases, counters, bytes })
    }
}
