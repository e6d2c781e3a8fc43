//! How does a table of functions become a [`Renderer`]?

#![expect(unsafe_code, reason = "calling plugins")]

use crate::call::{Call, LogLine, Told};
use crate::flat::{Memory, Names};
use crate::flat_scene::{self, Hidden};
use crate::hand_over::{Converted, HandedOver, Handing, forecast, hand_over};
use crate::table::Loaded;
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::scene::Scene;
use polyptych_core::seam::{
    BackendInfo, Control, Decision, Frame, Need, ObjectPlan, Plan, Prepared, RenderError, Renderer, Report,
};
use polyptych_plugin_abi::{self as abi, PolyptychNeed, PolyptychScene};
use std::cell::RefCell;
use std::ffi::c_void;
use std::sync::Arc;

/// Where a plugin's log goes.
pub(crate) type Log = Arc<dyn Fn(LogLine) + Send + Sync>;

/// A back end in a library, called in this process.
pub(crate) struct PluginRenderer {
    loaded: &'static Loaded,
    log: Log,
    /// Borrowed mutably by `plan`, too, which the trait lends no more than a look.
    inside: RefCell<Inside>,
    converted: Converted,
    ready: Option<Ready>,
}

struct Inside {
    instance: Option<Instance>,
    names: Names,
    told: Told,
}

/// What was prepared, to be prepared again when the instance had to be made anew.
struct Ready {
    handed: HandedOver,
    need: Need,
    decisions: Arc<[Decision]>,
    bytes: u64,
}

/// An instance of the plugin's own.
struct Instance {
    pointer: *mut c_void,
    loaded: &'static Loaded,
}

// SAFETY: an instance may be used by one thread after another.
unsafe impl Send for Instance {}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Some(destroy) = self.loaded.table.destroy {
            // SAFETY: what `create` returned, once, and no call is running.
            unsafe { destroy(self.pointer) };
        }
    }
}

impl PluginRenderer {
    pub(crate) fn new(loaded: &'static Loaded, log: Log) -> Self {
        let inside = Inside { instance: None, names: Names::default(), told: Told::default() };
        Self { loaded, log, inside: RefCell::new(inside), converted: Converted::default(), ready: None }
    }
}

impl Inside {
    fn instance(&mut self, loaded: &'static Loaded) -> Result<*mut c_void, RenderError> {
        if let Some(instance) = &self.instance {
            return Ok(instance.pointer);
        }
        // SAFETY: the table's function, which takes nothing.
        let pointer = loaded.table.create.map_or(std::ptr::null_mut(), |create| unsafe { create() });
        if pointer.is_null() {
            return Err(RenderError::Failed("`create` returned nothing".to_owned()));
        }
        self.instance = Some(Instance { pointer, loaded });
        Ok(pointer)
    }

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
                // It may be half changed: it is left alone, and the next call makes another.
                std::mem::forget(self.instance.take());
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

type SceneCall = unsafe extern "C" fn(
    instance: *mut c_void,
    scene: *const PolyptychScene,
    need: *const PolyptychNeed,
    host: *const abi::PolyptychHost,
) -> i32;

/// Calls `plan` or `prepare`.
fn call_with_scene(
    inside: &mut Inside,
    loaded: &'static Loaded,
    (function, name): (SceneCall, &str),
    (scene, need): (&Arc<Scene>, &Need),
    hidden: &dyn Fn(usize) -> Hidden,
    control: &Control<'_>,
    log: &Log,
) -> Result<(), RenderError> {
    let instance = inside.instance(loaded)?;
    let mut memory = Memory::default();
    let flat = flat_scene::scene(&mut memory, &mut inside.names, scene, hidden);
    let camera = flat_scene::camera(&need.camera);
    let flat_need = flat_scene::need(&mut memory, need, &camera, &loaded.info.parameters);
    let call = Call::new(control, &need.camera, &loaded.info.id, &**log, &mut inside.told);
    let host = call.host();
    // SAFETY: the table's function with an instance of its own; all that it is passed lives until it returns.
    let status = unsafe { function(instance, flat, &raw const flat_need, &raw const host) };
    inside.settle(status, name, scene)
}

/// Puts together what was done to each object.
fn decisions(objects: &[Handing], told: &[(u32, Decision)]) -> Arc<[Decision]> {
    let of = |index: usize| told.iter().rev().find(|(object, _)| *object as usize == index).map(|(_, d)| d);
    objects.iter().enumerate().map(|(index, handing)| handing.and(of(index))).collect()
}

impl Renderer for PluginRenderer {
    fn info(&self) -> &BackendInfo {
        &self.loaded.info
    }

    fn plan(&self, scene: &Scene, need: &Need) -> Plan {
        let forecasts = forecast(scene, need, &self.loaded.accepts);
        let Ok(mut inside) = self.inside.try_borrow_mut() else { return Plan::default() };
        let hidden = |index: usize| match forecasts[index].0 {
            Handing::Given => Hidden::No,
            Handing::Skipped { .. } => Hidden::Object,
            Handing::Converted { .. } | Handing::Reduced { .. } => Hidden::Shape,
        };
        let mut failure = None;
        if let Some(plan) = self.loaded.table.plan {
            let scene = Arc::new(scene.clone());
            let subject = (&scene, need);
            failure = call_with_scene(
                &mut inside,
                self.loaded,
                (plan, "plan"),
                subject,
                &hidden,
                &Control::simple(),
                &self.log,
            )
            .err();
        }
        let told = &inside.told;
        let objects: Vec<ObjectPlan> = (scene.objects.iter().zip(&forecasts).enumerate())
            .map(|(index, (object, (handing, builds, bytes)))| {
                let said = told.decisions.iter().rev().find(|(o, _)| *o as usize == index).map(|(_, d)| d);
                let decision = match (said, self.loaded.table.plan) {
                    (None, None) => handing.and(Some(&Decision::Exact)),
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
        let handed = hand_over(scene, need, &self.loaded.accepts, converter, control, &mut self.converted)?;
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
        let ready = if self.inside.get_mut().instance.is_some() {
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
        let Some(prepare) = self.loaded.table.prepare else { return Err(RenderError::NotPrepared) };
        let hidden = |index: usize| match handed.objects[index] {
            Handing::Skipped { .. } => Hidden::Object,
            _ => Hidden::No,
        };
        let subject = (&handed.scene, need);
        call_with_scene(inside, self.loaded, (prepare, "prepare"), subject, &hidden, control, &self.log)?;
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
        let instance = inside.instance(self.loaded)?;
        let Some(render) = self.loaded.table.render else { return Err(RenderError::NotPrepared) };
        let camera = flat_scene::camera(&frame.camera);
        let mut call = Call::new(control, &frame.camera, &self.loaded.info.id, &*self.log, &mut inside.told);
        let flat = call.onto(target);
        let host = call.host();
        // SAFETY: the table's function with an instance of its own; all that it is passed lives until it returns, and
        // nobody else writes the target.
        let status = unsafe { render(instance, &raw const camera, &raw const flat, &raw const host) };
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
