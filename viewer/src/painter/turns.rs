//! Whose turn is it? Where painters have more threads than the machine has cores, each works for a while and then lets
//! another one go on, whenever it asks whether to stop.
//!
//! The system would let them take turns, too, but a thread that it holds up learns milliseconds late that it is to
//! stop. One that waits here learns it at once.

use polyptych::seam::Probe;
use std::cell::Cell;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::Thread;
use std::time::{Duration, Instant};

/// A turn that others wait for lasts no longer.
const TURN: Duration = Duration::from_millis(3);
/// Who has waited for so long goes on: those whose turn it is may themselves wait for what it is making.
pub(super) const LONGEST_WAIT: Duration = Duration::from_millis(12);

thread_local! {
    /// When the turn of a thread began.
    static SINCE: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// The turns of all threads that draw.
#[derive(Debug)]
pub(super) struct Turns {
    /// Threads that may work at once.
    places: isize,
    line: Mutex<Line>,
    /// Whether threads wait, or are to wait.
    is_crowded: AtomicBool,
}

#[derive(Debug, Default)]
struct Line {
    /// Below zero while threads wait that a plugin started by itself.
    working: isize,
    /// Those who wait, the next one first.
    waiting: VecDeque<Thread>,
}

impl Turns {
    pub(super) fn new(places: usize) -> Self {
        Self { places: places.cast_signed(), line: Mutex::default(), is_crowded: AtomicBool::new(false) }
    }

    /// Takes places for threads, more than there are if need be, until what is returned is dropped.
    pub(super) fn take(self: &Arc<Self>, count: usize) -> Taken {
        self.change(|line| line.working += count.cast_signed());
        Taken { turns: self.clone(), count }
    }

    /// Has those who wait look whether they are to stop.
    pub(super) fn look(&self) {
        let waiting = self.lock().waiting.clone();
        waiting.iter().for_each(Thread::unpark);
    }

    /// Lets others go on if the calling thread has worked for its turn, and waits for the next one, or for a stop;
    /// returns how long it waited.
    fn pass(&self, stop: &AtomicBool) -> Duration {
        if !self.is_crowded.load(Ordering::Relaxed) {
            return Duration::ZERO;
        }
        let now = Instant::now();
        if SINCE.get().is_some_and(|since| now - since < TURN) {
            // One that was woken, to stop or to show what is there, may have been given this one's core, and wait.
            std::thread::yield_now();
            return Duration::ZERO;
        }
        let (own, until) = (std::thread::current(), now + LONGEST_WAIT);
        self.change(|line| {
            line.waiting.push_back(own.clone());
            line.working -= 1;
        });
        loop {
            let left = until.saturating_duration_since(Instant::now());
            if self.is_next(&own) || left.is_zero() || stop.load(Ordering::Relaxed) {
                break;
            }
            std::thread::park_timeout(left);
        }
        self.change(|line| {
            line.waiting.retain(|thread| thread.id() != own.id());
            line.working += 1;
        });
        let begin = Instant::now();
        SINCE.set(Some(begin));
        begin - now
    }

    /// Tells whether it is a waiting thread's turn.
    fn is_next(&self, thread: &Thread) -> bool {
        let line = self.lock();
        line.working < self.places && line.waiting.front().is_some_and(|next| next.id() == thread.id())
    }

    /// Changes the line, notes how crowded it is then, and wakes the next one if there is a place.
    fn change(&self, change: impl FnOnce(&mut Line)) {
        let mut line = self.lock();
        change(&mut line);
        self.is_crowded.store(!line.waiting.is_empty() || line.working > self.places, Ordering::Relaxed);
        let next = line.waiting.front().filter(|_| line.working < self.places).cloned();
        // Whoever is woken is not to find it locked.
        drop(line);
        if let Some(next) = next {
            next.unpark();
        }
    }

    fn lock(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Places of threads that work.
pub(super) struct Taken {
    turns: Arc<Turns>,
    count: usize,
}

/// Lets threads that have a place take turns until they are to stop.
pub(super) struct Turn<'a> {
    turns: &'a Turns,
    stop: &'a AtomicBool,
    /// Nanoseconds that its threads have waited, all together.
    waited: AtomicU64,
}

impl<'a> Turn<'a> {
    pub(super) fn new(turns: &'a Turns, stop: &'a AtomicBool) -> Self {
        Self { turns, stop, waited: AtomicU64::new(0) }
    }

    /// Returns how long its threads have waited, all together.
    pub(super) fn waited(&self) -> Duration {
        Duration::from_nanos(self.waited.load(Ordering::Relaxed))
    }
}

impl Probe for Turn<'_> {
    fn stops(&self) -> bool {
        let waited = self.turns.pass(self.stop);
        if !waited.is_zero() {
            self.waited.fetch_add(waited.as_nanos() as u64, Ordering::Relaxed);
        }
        self.stop.load(Ordering::Relaxed)
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        self.turns.change(|line| line.working -= self.count.cast_signed());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn all_take_turns_on_one_place() {
        let (turns, go_on) = (Arc::new(Turns::new(1)), AtomicBool::new(false));
        let rounds: Vec<_> = (0..4).map(|_| AtomicUsize::new(0)).collect();
        let waited = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for own in &rounds {
                scope.spawn(|| {
                    let _place = turns.take(1);
                    let turn = Turn::new(&turns, &go_on);
                    while rounds.iter().any(|rounds| rounds.load(Ordering::Relaxed) < 3) {
                        assert!(!turn.stops());
                        own.fetch_add(1, Ordering::Relaxed);
                        std::thread::sleep(TURN);
                    }
                    waited.fetch_add(usize::from(!turn.waited().is_zero()), Ordering::Relaxed);
                });
            }
        });
        // Who is the last to begin may find the others done.
        assert!(waited.into_inner() >= 3, "four have one place: each waits while others work");
        let line = turns.lock();
        assert_eq!((line.working, line.waiting.len()), (0, 0));
        assert!(!turns.is_crowded.load(Ordering::Relaxed));
    }

    #[test]
    fn who_waits_goes_on_as_soon_as_there_is_a_place() {
        let (turns, go_on) = (Arc::new(Turns::new(1)), AtomicBool::new(false));
        let busy = turns.take(1);
        let own = turns.take(1);
        assert!(turns.is_crowded.load(Ordering::Relaxed));
        let waited = std::thread::scope(|scope| {
            let waits = scope.spawn(|| {
                let turn = Turn::new(&turns, &go_on);
                assert!(!turn.stops());
                let first = turn.waited();
                // Within its turn it need not wait, whoever else wants to work.
                let _others = turns.take(8);
                assert!(!turn.stops());
                (first, turn.waited(), SINCE.get())
            });
            // One that waits longest before this thread gets a core is done already.
            while turns.lock().waiting.is_empty() && !waits.is_finished() {
                std::thread::yield_now();
            }
            drop(busy);
            waits.join().unwrap()
        });
        assert!(!waited.0.is_zero() && waited.2.is_some());
        // Unless this machine kept the thread from its core for a whole turn.
        assert!(waited.1 == waited.0 || waited.1 - waited.0 > TURN);
        drop(own);
        assert_eq!(turns.lock().working, 0);
    }

    #[test]
    fn nobody_waits_where_there_are_places() {
        let (turns, stop) = (Arc::new(Turns::new(2)), AtomicBool::new(false));
        let places = [turns.take(1), turns.take(1)];
        assert!(!turns.is_crowded.load(Ordering::Relaxed));
        let third = turns.take(1);
        assert!(turns.is_crowded.load(Ordering::Relaxed));
        drop((places, third));
        let turn = Turn::new(&turns, &stop);
        assert!(!turns.is_crowded.load(Ordering::Relaxed) && !turn.stops() && turn.waited().is_zero());
    }

    #[test]
    fn waiting_ends_by_itself_or_by_a_stop() {
        let (turns, [stop, has_waited]) = (Arc::new(Turns::new(1)), [false; 2].map(AtomicBool::new));
        let _busy = turns.take(1);
        std::thread::scope(|scope| {
            let waits = scope.spawn(|| {
                let _place = turns.take(1);
                let turn = Turn::new(&turns, &stop);
                // The only place is never given back: it goes on all the same.
                let goes_on = !turn.stops() && turn.waited() >= LONGEST_WAIT;
                has_waited.store(true, Ordering::Relaxed);
                while !turn.stops() {}
                goes_on
            });
            while !has_waited.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
            stop.store(true, Ordering::Relaxed);
            turns.look();
            assert!(waits.join().unwrap());
        });
        assert_eq!(turns.lock().working, 1);
    }
}
