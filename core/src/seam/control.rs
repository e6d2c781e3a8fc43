//! How the host steers a running frame: threads to use, a stop sign, and finished tiles.

use crate::framebuffer::Band;
use crate::parallel::{OneThread, Threads};
use std::sync::atomic::{AtomicBool, Ordering};

/// Steers a running `prepare` or `render`.
pub struct Control<'a> {
    /// Threads to work on.
    pub threads: &'a dyn Threads,
    cancel: Option<&'a AtomicBool>,
    watcher: Option<&'a dyn Watcher>,
}

/// Sees parts of a picture as they are finished.
pub trait Watcher: Sync {
    /// Called on a worker thread with a finished band of the picture.
    fn finished(&self, band: &Band<'_>);
}

/// The host asked to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

impl Control<'static> {
    /// Works on the calling thread and is never cancelled.
    #[must_use]
    pub fn simple() -> Self {
        Self::new(&OneThread)
    }
}

impl<'a> Control<'a> {
    /// Works on some threads and is never cancelled.
    #[must_use]
    pub fn new(threads: &'a dyn Threads) -> Self {
        Self { threads, cancel: None, watcher: None }
    }

    /// Stops when the flag is set.
    #[must_use]
    pub fn cancelled_by(mut self, flag: &'a AtomicBool) -> Self {
        self.cancel = Some(flag);
        self
    }

    /// Shows finished parts to a watcher.
    #[must_use]
    pub fn watched_by(mut self, watcher: &'a dyn Watcher) -> Self {
        self.watcher = Some(watcher);
        self
    }

    /// Tells whether the host wants to stop. To be asked once a tile or a millisecond.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Returns the flag that stops the work, to be handed on.
    #[must_use]
    pub fn cancel_flag(&self) -> Option<&'a AtomicBool> {
        self.cancel
    }

    /// Returns an error once the host wants to stop.
    ///
    /// # Errors
    /// [`Cancelled`] when it does.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }

    /// Tells the host that a band is finished.
    pub fn finished(&self, band: &Band<'_>) {
        if let Some(watcher) = self.watcher {
            watcher.finished(band);
        }
    }
}
