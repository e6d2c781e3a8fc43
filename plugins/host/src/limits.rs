//! How long may a plugin in a process of its own do what?

use std::time::Duration;

/// How long a child may do what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Work without a sign: rows that are finished, a line in the log.
    pub silence: Duration,
    /// Go on after it was told to stop.
    pub stopping: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self { silence: Duration::from_secs(30), stopping: Duration::from_millis(250) }
    }
}
