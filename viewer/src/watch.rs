//! Was a file written by another program?

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime};

/// Time between two looks at a file.
const LOOK: Duration = Duration::from_millis(300);

/// Looks at a file from time to time, on a thread of its own.
pub(crate) struct Watch {
    pub(crate) file: PathBuf,
    was_written: Arc<AtomicBool>,
}

impl Watch {
    /// Watches a file; `wake` is called when it was written.
    pub(crate) fn new(file: PathBuf, wake: impl Fn() + Send + 'static) -> Self {
        let was_written = Arc::<AtomicBool>::default();
        let (watched, told) = (file.clone(), Arc::downgrade(&was_written));
        std::thread::spawn(move || {
            let age =
                || watched.metadata().ok().map(|m| (m.modified().unwrap_or(SystemTime::UNIX_EPOCH), m.len()));
            let (mut known, mut before) = (age(), age());
            while let Some(flag) = told.upgrade() {
                let now = age();
                // Twice the same: whoever writes it is done.
                if now.is_some() && now == before && now != known {
                    flag.store(true, Ordering::Relaxed);
                    known = now;
                    wake();
                }
                before = now;
                drop(flag);
                std::thread::sleep(LOOK);
            }
        });
        Self { file, was_written }
    }

    /// Tells whether it was written since the last time.
    pub(crate) fn take(&self) -> bool {
        self.was_written.swap(false, Ordering::Relaxed)
    }
}
