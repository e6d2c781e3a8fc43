//! Where is a plugin called? Here, in this process, or in a process of its own.

#![expect(unsafe_code, reason = "calling plugins")]

use crate::call::{Call, Told};
use crate::flat::{Memory, Names};
use crate::flat_scene::{self, Hidden};
use crate::renderer::Log;
use crate::table::Loaded;
use polyptych_core::camera::Camera;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::scene::Scene;
use polyptych_core::seam::{Control, Need, RenderError};
use polyptych_plugin_abi::{self as abi, PolyptychHost, PolyptychNeed, PolyptychScene};
use std::ffi::c_void;
use std::sync::Arc;

/// What `plan` and `prepare` are about.
pub(crate) struct Subject<'a> {
    pub(crate) scene: &'a Arc<Scene>,
    pub(crate) need: &'a Need,
    /// What the plugin does not see of each object.
    pub(crate) hidden: &'a dyn Fn(usize) -> Hidden,
}

/// One instance of a plugin. Each function returns the plugin's status, and leaves what it told in `told`.
pub(crate) trait Callee: Send {
    fn plan(&mut self, subject: &Subject<'_>, told: &mut Told) -> Result<i32, RenderError>;

    fn prepare(
        &mut self,
        subject: &Subject<'_>,
        control: &Control<'_>,
        told: &mut Told,
    ) -> Result<i32, RenderError>;

    fn render(
        &mut self,
        camera: &Camera,
        target: &mut Framebuffer,
        control: &Control<'_>,
        told: &mut Told,
    ) -> Result<i32, RenderError>;

    /// Tells whether the next call makes an instance, which has nothing prepared.
    fn is_new(&self) -> bool;

    /// Gives up an instance that may be broken.
    fn discard(&mut self);
}

/// An instance in this process.
pub(crate) struct Local {
    loaded: &'static Loaded,
    log: Log,
    instance: Option<Instance>,
    names: Names,
}

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

type SceneCall = unsafe extern "C" fn(
    instance: *mut c_void,
    scene: *const PolyptychScene,
    need: *const PolyptychNeed,
    host: *const PolyptychHost,
) -> i32;

impl Local {
    pub(crate) fn new(loaded: &'static Loaded, log: Log) -> Self {
        Self { loaded, log, instance: None, names: Names::default() }
    }

    fn instance(&mut self) -> Result<*mut c_void, RenderError> {
        if let Some(instance) = &self.instance {
            return Ok(instance.pointer);
        }
        // SAFETY: the table's function, which takes nothing.
        let pointer = self.loaded.table.create.map_or(std::ptr::null_mut(), |create| unsafe { create() });
        if pointer.is_null() {
            return Err(RenderError::Failed("`create` returned nothing".to_owned()));
        }
        self.instance = Some(Instance { pointer, loaded: self.loaded });
        Ok(pointer)
    }

    /// Calls `plan` or `prepare` with a scene that is flat already.
    ///
    /// # Safety
    /// Scene and need are whole, and live until this returns.
    pub(crate) unsafe fn call_flat(
        &mut self,
        function: Option<SceneCall>,
        scene: *const PolyptychScene,
        need: *const PolyptychNeed,
        camera: &Camera,
        control: &Control<'_>,
        told: &mut Told,
    ) -> Result<i32, RenderError> {
        let instance = self.instance()?;
        let Some(function) = function else { return Ok(abi::POLYPTYCH_OK) };
        let call = Call::new(control, camera, &self.loaded.info.id, &*self.log, told);
        let host = call.host();
        // SAFETY: the table's function with an instance of its own; all that it is passed lives until it returns.
        Ok(unsafe { function(instance, scene, need, &raw const host) })
    }

    fn call(
        &mut self,
        function: Option<SceneCall>,
        subject: &Subject<'_>,
        control: &Control<'_>,
        told: &mut Told,
    ) -> Result<i32, RenderError> {
        let mut memory = Memory::default();
        let scene = flat_scene::scene(&mut memory, &mut self.names, subject.scene, subject.hidden);
        let camera = flat_scene::camera(&subject.need.camera);
        let need = flat_scene::need(&mut memory, subject.need, &camera, &self.loaded.info.parameters);
        // SAFETY: both were just made, and what they point at lives in `memory` and in the scene.
        unsafe { self.call_flat(function, scene, &raw const need, &subject.need.camera, control, told) }
    }

    /// Returns the plugin's table.
    pub(crate) fn table(&self) -> &'static abi::PolyptychPlugin {
        &self.loaded.table
    }
}

impl Callee for Local {
    fn plan(&mut self, subject: &Subject<'_>, told: &mut Told) -> Result<i32, RenderError> {
        self.call(self.loaded.table.plan, subject, &Control::simple(), told)
    }

    fn prepare(
        &mut self,
        subject: &Subject<'_>,
        control: &Control<'_>,
        told: &mut Told,
    ) -> Result<i32, RenderError> {
        self.call(self.loaded.table.prepare, subject, control, told)
    }

    fn render(
        &mut self,
        camera: &Camera,
        target: &mut Framebuffer,
        control: &Control<'_>,
        told: &mut Told,
    ) -> Result<i32, RenderError> {
        let instance = self.instance()?;
        let Some(render) = self.loaded.table.render else { return Err(RenderError::NotPrepared) };
        let flat = flat_scene::camera(camera);
        let mut call = Call::new(control, camera, &self.loaded.info.id, &*self.log, told);
        let target = call.onto(target);
        let host = call.host();
        // SAFETY: the table's function with an instance of its own; all that it is passed lives until it returns, and
        // nobody else writes the target.
        Ok(unsafe { render(instance, &raw const flat, &raw const target, &raw const host) })
    }

    fn is_new(&self) -> bool {
        self.instance.is_none()
    }

    fn discard(&mut self) {
        // It may be half changed: it is left alone.
        std::mem::forget(self.instance.take());
    }
}
