//! How the host steers a running frame: threads to use, a stop sign, and finished tiles.

use crate::framebuffer::Band;
use crate::parallel::{self, OneThread, Threads};
use std::sync::atomic::{AtomicBool, Ordering};

/// Steers a running `prepare`, `render` or conversion.
#[derive(Clone, Copy)]
pub struct Control<'a> {
    /// Threads to work on.
    pub threads: &'a dyn Threads,
    cancel: Option<&'a AtomicBool>,
    watcher: Option<&'a dyn Watcher>,
    probe: Option<&'a dyn Probe>,
}

/// Sees parts of a picture as they are finished.
pub trait Watcher: Sync {
    /// Called on a worker thread with a finished band of the picture.
    fn finished(&self, band: &Band<'_>);
}

/// Is told whenever the work asks whether to go on, and may stop it, or have it wait: a host lets painters take turns on
/// its cores, a test stops at the k-th time, to see what is left behind, and a measurement notes how far apart the times
/// are.
pub trait Probe: Sync {
    /// Called on the thread that asks. Once true, it must stay so.
    fn stops(&self) -> bool;
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
        Self { threads, cancel: None, watcher: None, probe: None }
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

    /// Tells a probe of every time that the work asks.
    #[must_use]
    pub fn probed_by(mut self, probe: &'a dyn Probe) -> Self {
        self.probe = Some(probe);
        self
    }

    /// Returns the same without a watcher: what is finished is nothing to be shown.
    #[must_use]
    pub fn unwatched(mut self) -> Self {
        self.watcher = None;
        self
    }

    /// Tells whether the host wants to stop. Once true, it stays so until the work is given up. To be asked once a tile
    /// or a millisecond.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed)) || self.probe.is_some_and(Probe::stops)
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

    /// Calls `work(index, &mut item)` for every item, in pieces of at most `grain` items, and asks before each piece
    /// whether to go on. A piece that takes much longer than a millisecond must ask for itself.
    ///
    /// # Errors
    /// [`Cancelled`] when the host wants to stop: some items may be as they were, or half done.
    pub fn for_each_mut<T: Send>(
        &self,
        items: &mut [T],
        grain: usize,
        work: &(impl Fn(usize, &mut T) + Sync),
    ) -> Result<(), Cancelled> {
        parallel::for_each_piece(self.threads, items, grain, &|first, piece: &mut [T]| {
            if !self.is_cancelled() {
                piece.iter_mut().enumerate().for_each(|(i, item)| work(first + i, item));
            }
        });
        self.check()
    }

    /// Tells the host that a band is finished.
    pub fn finished(&self, band: &Band<'_>) {
        if let Some(watcher) = self.watcher {
            watcher.finished(band);
        }
    }
}
