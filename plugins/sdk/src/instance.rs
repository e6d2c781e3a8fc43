//! How does a call of the host become a call of [`Renderer`]?

#![expect(unsafe_code, reason = "the border to the host")]

use crate::abi::{
    self, PolyptychCamera, PolyptychHost, PolyptychNeed, PolyptychScene, PolyptychTarget, PolyptychValue,
};
use crate::host::{Host, text};
use crate::panics::caught;
use crate::scene::{Scenes, camera, slice};
use glam::Vec3;
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Band, Channel, Channels, Framebuffer};
use polyptych_core::scene::Scene;
use polyptych_core::seam::{
    BackendInfo, Decision, Frame, Need, ParameterKind, RenderError, Renderer, Report, Settings,
};
use std::ffi::{CString, c_char, c_void};
use std::sync::Arc;

/// A back end with what it keeps between calls.
pub(crate) struct Instance<B> {
    backend: B,
    info: BackendInfo,
    converter: Converter,
    scenes: Scenes,
    /// The scene that was prepared, and what was decided about its objects.
    prepared: Option<(Arc<Scene>, Arc<[Decision]>)>,
    /// Names of counts and phases as the host reads them.
    names: Vec<(&'static str, CString)>,
    owner: Arc<()>,
}

impl<B: Renderer + Default + 'static> Instance<B> {
    pub(crate) unsafe extern "C" fn create() -> *mut c_void {
        let made = caught(|| {
            let backend = B::default();
            Box::into_raw(Box::new(Self {
                info: backend.info().clone(),
                backend,
                converter: Converter::default(),
                scenes: Scenes::default(),
                prepared: None,
                names: Vec::new(),
                owner: Arc::new(()),
            }))
        });
        made.map_or(std::ptr::null_mut(), <*mut Self>::cast)
    }

    pub(crate) unsafe extern "C" fn destroy(instance: *mut c_void) {
        if !instance.is_null() {
            // SAFETY: the host passes what `create` returned, once, and no call is running.
            let instance = unsafe { Box::from_raw(instance.cast::<Self>()) };
            let _ = caught(|| drop(instance));
        }
    }

    pub(crate) unsafe extern "C" fn plan(
        instance: *mut c_void,
        scene: *const PolyptychScene,
        need: *const PolyptychNeed,
        host: *const PolyptychHost,
    ) -> i32 {
        // SAFETY: the host passes an instance of this table, used by no other thread, and what lives during the call.
        unsafe {
            call::<B>(instance, host, |this, host| {
                let scene = this.scenes.rebuild(scene).map_err(RenderError::Failed)?;
                let need = this.need(need)?;
                let plan = this.backend.plan(&scene, &need);
                for (index, object) in plan.objects.iter().enumerate() {
                    decide(host, index, &object.decision);
                    host.builds(index, &object.builds, object.bytes);
                }
                plan.passes.iter().for_each(|pass| host.pass(&pass.name, pass.needed, &pass.why));
                host.bytes(plan.bytes);
                host.estimate(plan.estimated_ms);
                Ok(())
            })
        }
    }

    pub(crate) unsafe extern "C" fn prepare(
        instance: *mut c_void,
        scene: *const PolyptychScene,
        need: *const PolyptychNeed,
        host: *const PolyptychHost,
    ) -> i32 {
        // SAFETY: as in `plan`.
        unsafe {
            call::<B>(instance, host, |this, host| {
                let scene = this.scenes.rebuild(scene).map_err(RenderError::Failed)?;
                let need = this.need(need)?;
                let prepared = this.backend.prepare(&scene, &need, &this.converter, &host.control());
                this.scenes.forget_all_but(&scene);
                this.prepared = None;
                let prepared = prepared.map_err(|error| this.with_object(&scene, host, error))?;
                decide_all(host, &prepared.objects);
                host.bytes(prepared.bytes);
                this.prepared = Some((scene, prepared.objects));
                Ok(())
            })
        }
    }

    pub(crate) unsafe extern "C" fn render(
        instance: *mut c_void,
        from: *const PolyptychCamera,
        target: *const PolyptychTarget,
        host: *const PolyptychHost,
    ) -> i32 {
        // SAFETY: as in `plan`.
        unsafe {
            call::<B>(instance, host, |this, host| {
                let missing = || RenderError::Failed("the host passed nothing to draw on".to_owned());
                let target = abi::read(target).ok_or_else(missing)?;
                let frame = Frame { camera: camera(from).ok_or_else(missing)? };
                let mut picture = lent(&target, this.owner.clone()).map_err(RenderError::Failed)?;
                let report = this.backend.render(&frame, &mut picture, &host.control());
                if !is_lent(&mut picture, &target) {
                    // The planes that were lent may be kept somewhere and written when they are gone.
                    eprintln!("{}: the framebuffer was exchanged, which is not allowed", this.info.id);
                    std::process::abort();
                }
                this.report(host, &report?);
                Ok(())
            })
        }
    }

    fn report(&mut self, host: &Host, report: &Report) {
        let known = self
            .prepared
            .as_ref()
            .is_some_and(|(_, objects)| Arc::ptr_eq(objects, &report.objects) || objects == &report.objects);
        if !known {
            decide_all(host, &report.objects);
        }
        host.bytes(report.bytes);
        for counter in report.counters.iter().flatten() {
            let name = self.name(counter.name);
            host.count(name, counter.count);
        }
        for (name, time) in report.phases.iter() {
            let name = self.name(name);
            host.phase(name, u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
        }
    }

    fn name(&mut self, name: &'static str) -> *const c_char {
        if let Some((_, known)) = self.names.iter().find(|(n, _)| *n == name) {
            return known.as_ptr();
        }
        self.names.push((name, text(name)));
        self.names[self.names.len() - 1].1.as_ptr()
    }

    /// Reads a need.
    ///
    /// # Safety
    /// The pointer is null or the host's.
    unsafe fn need(&self, need: *const PolyptychNeed) -> Result<Need, RenderError> {
        let missing = || RenderError::Failed("the host passed no need".to_owned());
        // SAFETY: the caller's promise; the host's arrays are as long as it says.
        let (need, camera, values) = unsafe {
            let need = abi::read(need).ok_or_else(missing)?;
            let camera = camera(need.camera).ok_or_else(missing)?;
            (need, camera, slice(need.values, u64::from(need.value_count)))
        };
        Ok(Need {
            camera,
            width: need.width,
            height: need.height,
            channels: Channels::from_bits(need.channels as u8),
            tolerance_px: need.tolerance_px,
            samples: need.samples,
            settings: self.settings(values)?,
        })
    }

    fn settings(&self, values: &[PolyptychValue]) -> Result<Settings, RenderError> {
        let mut settings = Settings::default();
        for (parameter, value) in crate::info::crossing(&self.info).zip(values) {
            let words = match parameter.kind {
                ParameterKind::Bool => (value.integer != 0).to_string(),
                ParameterKind::Int { .. } => value.integer.to_string(),
                ParameterKind::Float { .. } => value.number.to_string(),
                ParameterKind::Choice { .. } | ParameterKind::Color | ParameterKind::Text => {
                    // SAFETY: the host passes text for these kinds.
                    unsafe { crate::scene::words(value.text) }
                }
            };
            settings
                .set(&self.info.id, &self.info.parameters, parameter.name, &words)
                .map_err(|e| RenderError::Failed(e.to_string()))?;
        }
        Ok(settings)
    }

    /// Tells the host which object is meant, where the error names one.
    fn with_object(&self, scene: &Scene, host: &Host, error: RenderError) -> RenderError {
        if let RenderError::Required { object, reason } = &error
            && let Some(index) = scene.objects.iter().position(|o| o.required && o.name == *object)
        {
            host.refuse(index as u32, reason);
        }
        error
    }
}

/// Runs a call: finds instance and host, catches panics, turns the result into a status.
///
/// # Safety
/// Instance and host are those that the host passed.
unsafe fn call<B>(
    instance: *mut c_void,
    host: *const PolyptychHost,
    work: impl FnOnce(&mut Instance<B>, &Host) -> Result<(), RenderError>,
) -> i32 {
    // SAFETY: the caller's promise.
    let Some(host) = (unsafe { Host::new(host) }) else { return abi::POLYPTYCH_FAILED };
    if instance.is_null() {
        host.refuse(abi::POLYPTYCH_NO_OBJECT, "there is no instance");
        return abi::POLYPTYCH_FAILED;
    }
    // SAFETY: `create` made it for this type, and one thread uses it at a time.
    let instance = unsafe { &mut *instance.cast::<Instance<B>>() };
    match caught(|| host.during(|| work(instance, &host))) {
        Ok(Ok(())) => abi::POLYPTYCH_OK,
        Ok(Err(RenderError::Cancelled)) => abi::POLYPTYCH_CANCELLED,
        Ok(Err(RenderError::NotPrepared)) => abi::POLYPTYCH_NOT_PREPARED,
        Ok(Err(RenderError::Required { .. })) => abi::POLYPTYCH_REQUIRED,
        Ok(Err(error)) => {
            host.refuse(abi::POLYPTYCH_NO_OBJECT, &error.to_string());
            abi::POLYPTYCH_FAILED
        }
        Err(said) => {
            host.refuse(abi::POLYPTYCH_NO_OBJECT, &said);
            abi::POLYPTYCH_PANICKED
        }
    }
}

fn decide_all(host: &Host, decisions: &[Decision]) {
    decisions.iter().enumerate().for_each(|(index, decision)| decide(host, index, decision));
}

fn decide(host: &Host, object: usize, decision: &Decision) {
    let (kind, bound) = match decision {
        Decision::Exact => (abi::POLYPTYCH_EXACT, 0.0),
        Decision::Converted { bound, .. } => (abi::POLYPTYCH_CONVERTED, *bound),
        Decision::Approximated { .. } => (abi::POLYPTYCH_APPROXIMATED, 0.0),
        Decision::Skipped { .. } => (abi::POLYPTYCH_SKIPPED, 0.0),
    };
    host.decide(object, kind, bound, decision.why());
}

/// Makes a framebuffer over the host's planes.
///
/// # Safety
/// The planes are as large as the target says, nobody else uses them during the call, and the framebuffer is gone
/// when it ends.
unsafe fn lent(target: &PolyptychTarget, owner: Arc<()>) -> Result<Framebuffer, String> {
    let channels = Channels::from_bits(target.channels as u8);
    let n = target.width as usize * target.height as usize;
    // SAFETY: the caller's promise; planes of channels that are left out get no pixels.
    unsafe fn plane<T>(first: *mut T, n: usize) -> &'static mut [T] {
        if first.is_null() || n == 0 {
            return &mut [];
        }
        // SAFETY: the caller's promise.
        unsafe { std::slice::from_raw_parts_mut(first, n) }
    }
    let len = |channel| if channels.has(channel) { n } else { 0 };
    // SAFETY: the caller's promise; three numbers are a `Vec3`.
    let planes = unsafe {
        Band {
            width: target.width,
            first_row: 0,
            rows: target.height,
            color: plane(target.color.cast::<Vec3>(), len(Channel::Color)),
            distance: plane(target.distance, len(Channel::Distance)),
            normal: plane(target.normal.cast::<Vec3>(), len(Channel::Normal)),
            id: plane(target.id, len(Channel::Id)),
            albedo: plane(target.albedo.cast::<Vec3>(), len(Channel::Albedo)),
            shadow: plane(target.shadow, len(Channel::Shadow)),
            coverage: plane(target.coverage, len(Channel::Coverage)),
        }
    };
    Framebuffer::lent(channels, planes, owner)
}

const _: () = assert!(size_of::<Vec3>() == 12 && align_of::<Vec3>() == 4);

/// Tells whether a framebuffer is still the one over the host's planes.
fn is_lent(picture: &mut Framebuffer, target: &PolyptychTarget) -> bool {
    fn same<T, U>(plane: &[T], lent: *mut U) -> bool {
        plane.is_empty() || plane.as_ptr().cast::<U>() == lent.cast_const()
    }
    let size = (picture.width(), picture.height(), u32::from(picture.channels().bits()));
    size == (target.width, target.height, target.channels & abi::POLYPTYCH_ALL_CHANNELS)
        && same(picture.color(), target.color)
        && same(picture.distance(), target.distance)
        && same(picture.normal(), target.normal)
        && same(picture.id(), target.id)
        && same(picture.albedo(), target.albedo)
        && same(picture.shadow(), target.shadow)
        && same(picture.coverage(), target.coverage)
}
