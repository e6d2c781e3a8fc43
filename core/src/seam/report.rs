//! What a back end did: per object, per phase, in bytes and counts. Made without allocating.

use super::plan::Decision;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What was done for one picture.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// How each object of the scene was drawn, in order; decided when the scene was prepared.
    pub objects: Arc<[Decision]>,
    /// Time of each phase.
    pub phases: Phases,
    /// What was counted: triangles, rays, steps.
    pub counters: [Option<Counter>; 6],
    /// Bytes that the back end holds for the scene.
    pub bytes: u64,
}

/// A named count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counter {
    /// What was counted: `"rays"`.
    pub name: &'static str,
    /// How many.
    pub count: u64,
}

/// Times of up to eight named phases.
#[derive(Clone, Copy, Debug)]
pub struct Phases {
    times: [(&'static str, Duration); 8],
    len: usize,
    last: Option<Instant>,
}

impl Default for Phases {
    fn default() -> Self {
        Self { times: [("", Duration::ZERO); 8], len: 0, last: None }
    }
}

impl Phases {
    /// Starts the clock.
    #[must_use]
    pub fn start() -> Self {
        Self { last: Some(Instant::now()), ..Self::default() }
    }

    /// Ends a phase that began at the last call; a ninth phase is added to the eighth.
    pub fn end(&mut self, name: &'static str) {
        let now = Instant::now();
        let time = self.last.map_or(Duration::ZERO, |last| now - last);
        self.last = Some(now);
        self.add(name, time);
    }

    /// Adds a phase that was timed elsewhere; a ninth phase is added to the eighth.
    pub fn add(&mut self, name: &'static str, time: Duration) {
        if self.len < self.times.len() {
            self.times[self.len] = (name, time);
            self.len += 1;
        } else if let Some(last) = self.times.last_mut() {
            last.1 += time;
        }
    }

    /// Lists the phases.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, Duration)> {
        self.times[..self.len].iter().copied()
    }
}
