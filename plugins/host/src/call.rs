//! What does a plugin reach during a call? The host's functions, and what they collect.

#![expect(unsafe_code, reason = "the border to plugins")]

use crate::words::{keep, words};
use polyptych_core::camera::Camera;
use polyptych_core::framebuffer::{Band, Framebuffer};
use polyptych_core::parallel::Threads;
use polyptych_core::seam::{Control, Counter, Decision, PassPlan, Phases};
use polyptych_plugin_abi::{
    self as abi, PolyptychHost, PolyptychRange, PolyptychRay, PolyptychTarget, PolyptychTask,
};
use std::ffi::{c_char, c_void};
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// How much a line of a plugin's log matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "as in the header")]
pub enum Severity {
    Debug,
    Note,
    Warning,
    Error,
}

/// A line of a plugin's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// Id of the back end.
    pub backend: String,
    /// How much it matters.
    pub severity: Severity,
    /// Index of the object that it is about.
    pub object: Option<u32>,
    /// The line.
    pub text: String,
}

/// What a plugin told during a call.
#[derive(Default)]
pub(crate) struct Told {
    pub(crate) decisions: Vec<(u32, Decision)>,
    pub(crate) builds: Vec<(u32, String, u64)>,
    pub(crate) passes: Vec<PassPlan>,
    pub(crate) estimated_ms: f64,
    pub(crate) bytes: u64,
    pub(crate) counters: [Option<Counter>; 6],
    pub(crate) phases: Phases,
    pub(crate) refusal: Option<(u32, String)>,
}

impl Told {
    /// Forgets everything, and keeps the memory for the next call.
    fn clear(&mut self) {
        let (mut decisions, mut builds, mut passes) = (
            std::mem::take(&mut self.decisions),
            std::mem::take(&mut self.builds),
            std::mem::take(&mut self.passes),
        );
        decisions.clear();
        builds.clear();
        passes.clear();
        *self = Self { decisions, builds, passes, ..Self::default() };
    }
}

/// A call that is running.
pub(crate) struct Call<'a> {
    control: &'a Control<'a>,
    camera: &'a Camera,
    backend: &'a str,
    log: &'a (dyn Fn(LogLine) + Send + Sync),
    target: Option<PolyptychTarget>,
    told: Mutex<&'a mut Told>,
}

// SAFETY: what is used on several threads is the control, which is made for it, the told things behind their lock,
// and the target's planes, of which `finished` reads rows that nobody writes any more, by the header's contract.
unsafe impl Sync for Call<'_> {}

static NEVER: AtomicBool = AtomicBool::new(false);

impl<'a> Call<'a> {
    pub(crate) fn new(
        control: &'a Control<'a>,
        camera: &'a Camera,
        backend: &'a str,
        log: &'a (dyn Fn(LogLine) + Send + Sync),
        told: &'a mut Told,
    ) -> Self {
        told.clear();
        Self { control, camera, backend, log, target: None, told: Mutex::new(told) }
    }

    /// Draws into a framebuffer; returns what the plugin is to fill.
    pub(crate) fn onto(&mut self, picture: &mut Framebuffer) -> PolyptychTarget {
        fn plane<T, U>(plane: &mut [T]) -> *mut U {
            if plane.is_empty() { std::ptr::null_mut() } else { plane.as_mut_ptr().cast() }
        }
        let channels = picture.channels();
        let band = picture.band();
        let target = PolyptychTarget {
            size: size_of::<PolyptychTarget>() as u32,
            width: band.width,
            height: band.rows,
            channels: u32::from(channels.bits()),
            color: plane(band.color),
            distance: plane(band.distance),
            normal: plane(band.normal),
            id: plane(band.id),
            albedo: plane(band.albedo),
            shadow: plane(band.shadow),
            coverage: plane(band.coverage),
        };
        self.target = Some(target);
        target
    }

    /// Returns the functions for the plugin.
    pub(crate) fn host(&self) -> PolyptychHost {
        let cancel = self.control.cancel_flag().unwrap_or(&NEVER);
        PolyptychHost {
            size: size_of::<PolyptychHost>() as u32,
            thread_count: self.control.threads.count() as u32,
            context: std::ptr::from_ref(self).cast_mut().cast(),
            cancel: cancel.as_ptr().cast(),
            join: Some(join),
            parallel_for: Some(parallel_for),
            rays: Some(rays),
            finished: Some(finished),
            decide: Some(decide),
            builds: Some(builds),
            pass: Some(pass),
            estimate: Some(estimate),
            bytes: Some(bytes),
            count: Some(count),
            phase: Some(phase),
            refuse: Some(refuse),
            log: Some(log),
        }
    }

    fn tell(&self, what: impl FnOnce(&mut Told)) {
        what(&mut self.told.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

/// Finds the running call.
///
/// # Safety
/// The pointer is the one that the plugin was given, and the call is running.
unsafe fn call<'a>(host: *const PolyptychHost) -> &'a Call<'a> {
    // SAFETY: the caller's promise; `Call::host` wrote the context.
    unsafe { &*(*host).context.cast::<Call<'a>>() }
}

/// A plugin's data on its way to another thread.
#[derive(Clone, Copy)]
struct Data(*mut c_void);
// SAFETY: the plugin promises, by passing it, that its work may run on another thread.
unsafe impl Send for Data {}
// SAFETY: as above.
unsafe impl Sync for Data {}

impl Data {
    fn pointer(self) -> *mut c_void {
        self.0
    }
}

unsafe extern "C" fn join(
    host: *const PolyptychHost,
    left: PolyptychTask,
    left_data: *mut c_void,
    right: PolyptychTask,
    right_data: *mut c_void,
) {
    let (Some(left), Some(right)) = (left, right) else { return };
    let (left_data, right_data) = (Data(left_data), Data(right_data));
    // SAFETY: the plugin passes back the host's pointer; so in all functions below.
    let call = unsafe { call(host) };
    // SAFETY: the plugin's functions with the plugin's data, each once, as the header says.
    let (mut one, mut other) =
        (|| unsafe { left(left_data.pointer()) }, || unsafe { right(right_data.pointer()) });
    call.control.threads.join(&mut one, &mut other);
}

unsafe extern "C" fn parallel_for(
    host: *const PolyptychHost,
    count: u64,
    grain: u64,
    work: PolyptychRange,
    data: *mut c_void,
) {
    fn halve(threads: &dyn Threads, begin: u64, end: u64, grain: u64, work: &(dyn Fn(u64, u64) + Sync)) {
        if end - begin <= grain {
            work(begin, end);
            return;
        }
        // Borders lie at multiples of the grain, whatever the number of threads.
        let middle = begin + (end - begin).div_ceil(grain) / 2 * grain;
        threads.join(&mut || halve(threads, begin, middle, grain, work), &mut || {
            halve(threads, middle, end, grain, work);
        });
    }
    let Some(work) = work else { return };
    let data = Data(data);
    // SAFETY: as in `join`.
    let call = unsafe { call(host) };
    if count > 0 {
        // SAFETY: the plugin's function with the plugin's data, as the header says.
        let work = |begin, end| unsafe { work(data.pointer(), begin, end) };
        halve(call.control.threads, 0, count, grain.max(1), &work);
    }
}

unsafe extern "C" fn rays(
    host: *const PolyptychHost,
    width: u32,
    height: u32,
    row: u32,
    first: u32,
    count: u32,
    rays: *mut PolyptychRay,
) {
    // SAFETY: as in `join`.
    let view = unsafe { call(host) }.camera.view(width, height);
    for i in 0..count {
        let ray = view.ray(f64::from(first + i) + 0.5, f64::from(row) + 0.5);
        let ray = ray.map_or(PolyptychRay { origin: [0.0; 3], direction: [0.0; 3] }, |ray| PolyptychRay {
            origin: ray.origin.to_array(),
            direction: ray.direction.to_array(),
        });
        // SAFETY: the plugin has room for `count` rays.
        unsafe { rays.add(i as usize).write(ray) };
    }
}

unsafe extern "C" fn finished(host: *const PolyptychHost, first_row: u32, rows: u32) {
    // SAFETY: as in `join`.
    let call = unsafe { call(host) };
    let Some(target) = &call.target else { return };
    if first_row >= target.height || rows == 0 {
        return;
    }
    let rows = rows.min(target.height - first_row);
    let (skip, len) = (first_row as usize * target.width as usize, rows as usize * target.width as usize);
    unsafe fn part<'a, T>(plane: *mut T, skip: usize, len: usize) -> &'a mut [T] {
        if plane.is_null() {
            return &mut [];
        }
        // SAFETY: the rows lie within the plane; the plugin has finished them, and nobody else has them.
        unsafe { std::slice::from_raw_parts_mut(plane.add(skip), len) }
    }
    // SAFETY: as in `part`.
    let band = unsafe {
        Band {
            width: target.width,
            first_row,
            rows,
            color: part(target.color.cast(), skip, len),
            distance: part(target.distance, skip, len),
            normal: part(target.normal.cast(), skip, len),
            id: part(target.id, skip, len),
            albedo: part(target.albedo.cast(), skip, len),
            shadow: part(target.shadow, skip, len),
            coverage: part(target.coverage, skip, len),
        }
    };
    call.control.finished(&band);
}

unsafe extern "C" fn decide(
    host: *const PolyptychHost,
    object: u32,
    decision: u32,
    bound: f64,
    why: *const c_char,
) {
    // SAFETY: the plugin's text lives until this returns; so below.
    let (call, why) = unsafe { (call(host), words(why)) };
    let decision = match decision {
        abi::POLYPTYCH_EXACT => Decision::Exact,
        abi::POLYPTYCH_CONVERTED if bound >= 0.0 => Decision::Converted { bound, why },
        abi::POLYPTYCH_CONVERTED => Decision::Approximated { why: format!("{why}, {bound} m off") },
        abi::POLYPTYCH_SKIPPED => Decision::Skipped { why },
        _ => Decision::Approximated { why },
    };
    call.tell(|told| told.decisions.push((object, decision)));
}

unsafe extern "C" fn builds(host: *const PolyptychHost, object: u32, what: *const c_char, bytes: u64) {
    // SAFETY: as in `decide`.
    let (call, what) = unsafe { (call(host), words(what)) };
    call.tell(|told| told.builds.push((object, what, bytes)));
}

unsafe extern "C" fn pass(host: *const PolyptychHost, name: *const c_char, needed: u32, why: *const c_char) {
    // SAFETY: as in `decide`.
    let (call, name, why) = unsafe { (call(host), words(name), words(why)) };
    call.tell(|told| told.passes.push(PassPlan { name, needed: needed != 0, why }));
}

unsafe extern "C" fn estimate(host: *const PolyptychHost, milliseconds: f64) {
    // SAFETY: as in `join`.
    unsafe { call(host) }.tell(|told| told.estimated_ms = milliseconds);
}

unsafe extern "C" fn bytes(host: *const PolyptychHost, bytes: u64) {
    // SAFETY: as in `join`.
    unsafe { call(host) }.tell(|told| told.bytes = bytes);
}

unsafe extern "C" fn count(host: *const PolyptychHost, name: *const c_char, count: u64) {
    // SAFETY: as in `decide`.
    let (call, name) = unsafe { (call(host), known(name)) };
    call.tell(|told| {
        if let Some(free) = told.counters.iter_mut().find(|c| c.is_none()) {
            *free = Some(Counter { name, count });
        }
    });
}

unsafe extern "C" fn phase(host: *const PolyptychHost, name: *const c_char, nanoseconds: u64) {
    // SAFETY: as in `decide`.
    let (call, name) = unsafe { (call(host), known(name)) };
    call.tell(|told| told.phases.add(name, Duration::from_nanos(nanoseconds)));
}

/// Reads a name that is kept for ever.
///
/// # Safety
/// As [`words`].
unsafe fn known(name: *const c_char) -> &'static str {
    // SAFETY: the caller's promise.
    keep(&unsafe { words(name) })
}

unsafe extern "C" fn refuse(host: *const PolyptychHost, object: u32, why: *const c_char) {
    // SAFETY: as in `decide`.
    let (call, why) = unsafe { (call(host), words(why)) };
    call.tell(|told| {
        // The first one names the object; what is said after it repeats it.
        told.refusal.get_or_insert((object, why));
    });
}

unsafe extern "C" fn log(host: *const PolyptychHost, severity: u32, object: u32, text: *const c_char) {
    // SAFETY: as in `decide`.
    let (call, text) = unsafe { (call(host), words(text)) };
    let severity = match severity {
        abi::POLYPTYCH_DEBUG => Severity::Debug,
        abi::POLYPTYCH_NOTE => Severity::Note,
        abi::POLYPTYCH_WARNING => Severity::Warning,
        _ => Severity::Error,
    };
    let object = (object != abi::POLYPTYCH_NO_OBJECT).then_some(object);
    (call.log)(LogLine { backend: call.backend.to_owned(), severity, object, text });
}
