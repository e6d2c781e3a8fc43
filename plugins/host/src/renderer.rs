//! How does a table of functions become a [`Renderer`]?

use crate::call::{LogLine, Told};
use crate::callee::{Callee, Subject};
use crate::flat_scene::Hidden;
use crate::hand_over::{Converted, HandedOver, Handing, forecast, hand_over};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::scene::{Scene, ShapeKind};
use polyptych_core::seam::{
    BackendInfo, Control, Decision, Frame, Need, ObjectPlan, Plan, Prepared, RenderError, Renderer, Report,
};
use polyptych_plugin_abi as abi;
use std::cell::RefCell;
use std::sync::Arc;

/// Where a plugin's log goes.
pub(crate) type Log = Arc<dyn Fn(LogLine) + Send + Sync>;

/// What a renderer must know of a plugin.
#[derive(Clone)]
pub(crate) struct Described {
    pub(crate) info: BackendInfo,
    pub(crate) accepts: Vec<ShapeKind>,
    pub(crate) plans: bool,
}

/// A back end in a library, wherever it is called.
pub(crate) struct PluginRenderer {
    described: Described,
    /// Borrowed mutably by `plan`, too, which the trait lends no more than a look.
    inside: RefCell<Inside>,
    converted: Converted,
    ready: Option<Ready>,
}

struct Inside {
    callee: Box<dyn Callee>,
    told: Told,
}

/// What was prepared, to be prepared again when the instance had to be made anew.
struct Ready {
    handed: HandedOver,
    need: Need,
    decisions: Arc<[Decision]>,
    bytes: u64,
}

impl PluginRenderer {
    pub(crate) fn new(described: Described, callee: Box<dyn Callee>) -> Self {
        let inside = RefCell::new(Inside { callee, told: Told::default() });
        Self { described, inside, converted: Converted::default(), ready: None }
    }
}

impl Inside {
    /// Turns a status into a result. An instance that panicked is not used again.
    fn settle(&mut self, status: i32, function: &str, scene: &Scene) -> Result<(), RenderError> {
        let (object, why) = self.told.refusal.take().unwrap_or((abi::POLYPTYCH_NO_OBJECT, String::new()));
        let name = |index: u32| scene.objects.get(index as usize).map(|o| o.name.clone());
        let said = if why.is_empty() { "it does not say why".to_owned() } else { why };
        match status {
            abi::POLYPTYCH_OK => Ok(()),
            abi::POLYPTYCH_CANCELLED => Err(RenderError::Cancelled),
            abi::POLYPTYCH_NOT_PREPARED => Err(RenderError::NotPrepared),
            abi::POLYPTYCH_REQUIRED if name(object).is_some() => {
                Err(RenderError::Required { object: name(object).unwrap_or_default(), reason: said })
            }
            abi::POLYPTYCH_PANICKED => {
                self.callee.discard();
                Err(RenderError::Failed(format!("`{function}` {said}")))
            }
            abi::POLYPTYCH_FAILED | abi::POLYPTYCH_REQUIRED => Err(RenderError::Failed(match name(object) {
                Some(object) => format!("object `{object}`: {said}"),
                None => said,
            })),
            other => Err(RenderError::Failed(format!("`{function}` returned {other}, which means nothing"))),
        }
    }
}

/// Puts together what was done to each object.
fn decisions(objects: &[Handing], told: &[(u32, Decision)]) -> Arc<[Decision]> {
    let of = |index: usize| told.iter().rev().find(|(object, _)| *object as usize == index).map(|(_, d)| d);
    objects.iter().enumerate().map(|(index, handing)| handing.and(of(index))).collect()
}

impl Renderer for PluginRenderer {
    fn info(&self) -> &BackendInfo {
        &self.described.info
    }

    fn plan(&self, scene: &Scene, need: &Need) -> Plan {
        let forecasts = forecast(scene, need, &self.described.accepts);
        let Ok(mut inside) = self.inside.try_borrow_mut() else { return Plan::default() };
        let hidden = |index: usize| match forecasts[index].0 {
            Handing::Given => Hidden::No,
            Handing::Skipped { .. } => Hidden::Object,
            Handing::Converted { .. } | Handing::Reduced { .. } => Hidden::Shape,
        };
        let inside = &mut *inside;
        let mut failure = None;
        if self.described.plans {
            let subject = Subject { scene: &Arc::new(scene.clone()), need, hidden: &hidden };
            let status = inside.callee.plan(&subject, &mut inside.told);
            failure = status.and_then(|status| inside.settle(status, "plan", scene)).err();
        }
        let told = &inside.told;
        let objects: Vec<ObjectPlan> = (scene.objects.iter().zip(&forecasts).enumerate())
            .map(|(index, (object, (handing, builds, bytes)))| {
                let said = told.decisions.iter().rev().find(|(o, _)| *o as usize == index).map(|(_, d)| d);
                let decision = match (said, self.described.plans) {
                    (None, false) => handing.and(Some(&Decision::Exact)),
                    (said, _) => handing.and(said),
                };
                let more = told.builds.iter().find(|(o, ..)| *o as usize == index);
                let both = [builds.as_str(), more.map_or("", |(_, what, _)| what.as_str())];
                ObjectPlan {
                    name: object.name.clone(),
                    shape: object.shape.kind().name(),
                    decision,
                    builds: both.iter().filter(|b| !b.is_empty()).copied().collect::<Vec<_>>().join("; "),
                    bytes: bytes + more.map_or(0, |(_, _, bytes)| *bytes),
                }
            })
            .collect();
        let mut passes = told.passes.clone();
        if let Some(error) = failure {
            let name = "plan".to_owned();
            passes.push(polyptych_core::seam::PassPlan { name, needed: false, why: error.to_string() });
        }
        let converted: u64 = forecasts.iter().map(|(_, _, bytes)| bytes).sum();
        Plan { objects, passes, bytes: converted + told.bytes, estimated_ms: told.estimated_ms }
    }

    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        self.ready = None;
        let handed =
            hand_over(scene, need, &self.described.accepts, converter, control, &mut self.converted)?;
        let ready = self.prepare_handed(handed, need, control)?;
        let prepared = Prepared { objects: ready.decisions.clone(), bytes: ready.bytes };
        self.ready = Some(ready);
        Ok(prepared)
    }

    fn model(&self) -> Option<Arc<Scene>> {
        let ready = self.ready.as_ref()?;
        let changed = ready
            .handed
            .objects
            .iter()
            .any(|o| matches!(o, Handing::Converted { .. } | Handing::Reduced { .. }));
        changed.then(|| ready.handed.scene.clone())
    }

    fn render(
        &mut self,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError> {
        let ready = self.ready.take().ok_or(RenderError::NotPrepared)?;
        let ready = if !self.inside.get_mut().callee.is_new() {
            ready
        } else {
            let need = ready.need.clone();
            self.prepare_handed(ready.handed, &need, control)?
        };
        let result = self.render_ready(&ready, frame, target, control);
        self.ready = Some(ready);
        result
    }
}

impl PluginRenderer {
    /// Prepares a scene that the plugin can take.
    fn prepare_handed(
        &mut self,
        handed: HandedOver,
        need: &Need,
        control: &Control<'_>,
    ) -> Result<Ready, RenderError> {
        let inside = self.inside.get_mut();
        let hidden = |index: usize| match handed.objects[index] {
            Handing::Skipped { .. } => Hidden::Object,
            _ => Hidden::No,
        };
        let subject = Subject { scene: &handed.scene, need, hidden: &hidden };
        let status = inside.callee.prepare(&subject, control, &mut inside.told)?;
        inside.settle(status, "prepare", &handed.scene)?;
        let decisions = decisions(&handed.objects, &inside.told.decisions);
        if let Some(index) = handed.scene.objects.iter().enumerate().position(|(index, object)| {
            object.required && object.visible && matches!(decisions[index], Decision::Skipped { .. })
        }) {
            let (object, reason) =
                (handed.scene.objects[index].name.clone(), decisions[index].why().to_owned());
            return Err(RenderError::Required { object, reason });
        }
        Ok(Ready { handed, need: need.clone(), decisions, bytes: inside.told.bytes })
    }

    fn render_ready(
        &mut self,
        ready: &Ready,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError> {
        let inside = self.inside.get_mut();
        let status = inside.callee.render(&frame.camera, target, control, &mut inside.told)?;
        inside.settle(status, "render", &ready.handed.scene)?;
        let told = &inside.told;
        let objects = if told.decisions.is_empty() {
            ready.decisions.clone()
        } else {
            decisions(&ready.handed.objects, &told.decisions)
        };
        Ok(Report {
            objects,
            phases: told.phases,
            counters: told.counters,
            bytes: told.bytes.max(ready.bytes),
        })
    }
}
