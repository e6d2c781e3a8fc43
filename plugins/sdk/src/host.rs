//! How does a back end use what the host lends: threads, the stop sign, finished rows, the log?

#![expect(unsafe_code, reason = "the border to the host")]

use crate::abi::{self, PolyptychHost};
use crate::panics::{caught, relay};
use polyptych_core::framebuffer::Band;
use polyptych_core::parallel::Threads;
use polyptych_core::seam::{Control, Watcher};
use std::cell::Cell;
use std::ffi::{CString, c_char, c_void};
use std::sync::atomic::AtomicBool;

thread_local! {
    /// The host of the call that this thread works for.
    static CURRENT: Cell<*const PolyptychHost> = const { Cell::new(std::ptr::null()) };
}

/// The host during one call.
pub(crate) struct Host {
    table: PolyptychHost,
    pointer: *const PolyptychHost,
}

// SAFETY: the functions that are called through a shared reference on other threads (`join`, `finished`, `log`) may
// be called on any thread, by the contract of `PolyptychHost`.
unsafe impl Sync for Host {}

impl Host {
    /// Reads the host's functions.
    ///
    /// # Safety
    /// The pointer is that of the running call.
    pub(crate) unsafe fn new(pointer: *const PolyptychHost) -> Option<Self> {
        // SAFETY: the caller's promise.
        let table = unsafe { abi::read(pointer) }?;
        Some(Self { table, pointer })
    }

    /// Returns the control of the call, with this host's threads.
    pub(crate) fn control(&self) -> Control<'_> {
        let control = Control::new(self).watched_by(self);
        if self.table.cancel.is_null() {
            return control;
        }
        // SAFETY: the byte lives as long as the call, is 0 or 1, and is written atomically.
        control.cancelled_by(unsafe { AtomicBool::from_ptr(self.table.cancel.cast_mut().cast()) })
    }

    /// Runs work during which [`log`] reaches this host.
    pub(crate) fn during<T>(&self, work: impl FnOnce() -> T) -> T {
        let before = CURRENT.replace(self.pointer);
        let done = caught(work);
        CURRENT.set(before);
        done.unwrap_or_else(|said| relay(said))
    }

    pub(crate) fn decide(&self, object: usize, decision: u32, bound: f64, why: &str) {
        let why = text(why);
        if let Some(decide) = self.table.decide {
            // SAFETY: the host's function with the host's pointer; the text lives until it returns. So below.
            unsafe { decide(self.pointer, object as u32, decision, bound, why.as_ptr()) };
        }
    }

    pub(crate) fn builds(&self, object: usize, what: &str, bytes: u64) {
        let what = text(what);
        if let Some(builds) = self.table.builds {
            // SAFETY: as in `decide`.
            unsafe { builds(self.pointer, object as u32, what.as_ptr(), bytes) };
        }
    }

    pub(crate) fn pass(&self, name: &str, needed: bool, why: &str) {
        let (name, why) = (text(name), text(why));
        if let Some(pass) = self.table.pass {
            // SAFETY: as in `decide`.
            unsafe { pass(self.pointer, name.as_ptr(), u32::from(needed), why.as_ptr()) };
        }
    }

    pub(crate) fn estimate(&self, milliseconds: f64) {
        if let Some(estimate) = self.table.estimate {
            // SAFETY: as in `decide`.
            unsafe { estimate(self.pointer, milliseconds) };
        }
    }

    pub(crate) fn bytes(&self, bytes: u64) {
        if let Some(say) = self.table.bytes {
            // SAFETY: as in `decide`.
            unsafe { say(self.pointer, bytes) };
        }
    }

    pub(crate) fn count(&self, name: *const c_char, count: u64) {
        if let Some(say) = self.table.count {
            // SAFETY: as in `decide`.
            unsafe { say(self.pointer, name, count) };
        }
    }

    pub(crate) fn phase(&self, name: *const c_char, nanoseconds: u64) {
        if let Some(say) = self.table.phase {
            // SAFETY: as in `decide`.
            unsafe { say(self.pointer, name, nanoseconds) };
        }
    }

    pub(crate) fn refuse(&self, object: u32, why: &str) {
        let why = text(why);
        if let Some(refuse) = self.table.refuse {
            // SAFETY: as in `decide`.
            unsafe { refuse(self.pointer, object, why.as_ptr()) };
        }
    }
}

impl Threads for Host {
    fn count(&self) -> usize {
        self.table.thread_count.max(1) as usize
    }

    fn join(&self, left: &mut (dyn FnMut() + Send), right: &mut (dyn FnMut() + Send)) {
        let Some(join) = self.table.join else {
            left();
            right();
            return;
        };
        let mut left = Task { work: left, host: self, said: None };
        let mut right = Task { work: right, host: self, said: None };
        let [one, other] = [&mut left, &mut right].map(|task| std::ptr::from_mut(task).cast::<c_void>());
        // SAFETY: both tasks live until the host returns, which it does when both are done.
        unsafe { join(self.pointer, Some(run), one, Some(run), other) };
        if let Some(said) = left.said.or(right.said) {
            relay(said);
        }
    }
}

impl Watcher for Host {
    fn finished(&self, band: &Band<'_>) {
        if let Some(finished) = self.table.finished {
            // SAFETY: as in `decide`; may be called on any thread.
            unsafe { finished(self.pointer, band.first_row, band.rows) };
        }
    }
}

/// Work on its way through the host to one of its threads.
struct Task<'a> {
    work: &'a mut (dyn FnMut() + Send),
    host: &'a Host,
    said: Option<String>,
}

unsafe extern "C" fn run(data: *mut c_void) {
    // SAFETY: `join` passes its own tasks, each to one call.
    let task = unsafe { &mut *data.cast::<Task<'_>>() };
    task.said = caught(|| task.host.during(&mut task.work)).err();
}

/// How much a line of the log matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// To the plugin's author.
    Debug,
    /// To the user.
    Note,
    /// The picture is not what it should be.
    Warning,
    /// Something failed.
    Error,
}

/// Writes a line to the host's log, perhaps about an object, given by its index. Goes nowhere outside of a call.
pub fn log(severity: Severity, object: Option<usize>, line: &str) {
    // SAFETY: the pointer is set during a call only, in which the host is there.
    let Some(host) = (unsafe { Host::new(CURRENT.get()) }) else { return };
    let severity = match severity {
        Severity::Debug => abi::POLYPTYCH_DEBUG,
        Severity::Note => abi::POLYPTYCH_NOTE,
        Severity::Warning => abi::POLYPTYCH_WARNING,
        Severity::Error => abi::POLYPTYCH_ERROR,
    };
    let object = object.map_or(abi::POLYPTYCH_NO_OBJECT, |o| o as u32);
    let line = text(line);
    if let Some(log) = host.table.log {
        // SAFETY: as in `decide`; may be called on any thread.
        unsafe { log(host.pointer, severity, object, line.as_ptr()) };
    }
}

/// Makes text for the other side; it ends where a zero byte is.
pub(crate) fn text(text: &str) -> CString {
    let end = text.find('\0').unwrap_or(text.len());
    CString::new(&text[..end]).unwrap_or_default()
}
