//! What happens when a back end panics? It is caught here: a panic that reached the host would abort the process.

use std::any::Any;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Once;

thread_local! {
    /// What the last panic of this thread said, and where.
    static LAST: RefCell<String> = const { RefCell::new(String::new()) };
}

/// A panic that was caught on another thread, on its way through this one.
struct Relayed(String);

/// Keeps what panics say for the host, instead of printing it. The library has a hook of its own.
pub(crate) fn listen() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        std::panic::set_hook(Box::new(|info| {
            let said = info.payload_as_str().unwrap_or("a panic without words");
            let place = info.location().map_or(String::new(), |l| format!(" at {}:{}", l.file(), l.line()));
            LAST.with_borrow_mut(|last| *last = format!("panicked: {said}{place}"));
        }));
    });
}

/// Runs work; a panic in it comes back as what it said.
pub(crate) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(said)
}

/// Goes on with a panic that [`caught`] brought from another thread.
pub(crate) fn relay(said: String) -> ! {
    resume_unwind(Box::new(Relayed(said)))
}

fn said(payload: Box<dyn Any + Send>) -> String {
    match payload.downcast::<Relayed>() {
        Ok(relayed) => relayed.0,
        Err(payload) => {
            // Dropping what somebody panicked with might panic again.
            std::mem::forget(payload);
            LAST.with_borrow_mut(std::mem::take)
        }
    }
}
