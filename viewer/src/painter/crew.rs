//! How many threads does a painter get? Its share of the cores among the painters that are at work, or were a moment
//! ago: while a camera moves, all of them are soon at work again.

use super::turns::{Taken, Turn, Turns};
use polyptych::parallel::{OneThread, Pool};
use polyptych::seam::{Control, Probe};
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A painter has its share of the cores for so long after its work.
const MOMENT: Duration = Duration::from_millis(100);

/// The painters of a window, who share its machine.
#[derive(Clone)]
pub(crate) struct Crew {
    cores: usize,
    members: Arc<Mutex<Members>>,
    turns: Arc<Turns>,
}

#[derive(Default)]
struct Members {
    /// Those who share the cores: nothing while at work, then when that ended.
    ends: BTreeMap<u64, Option<Instant>>,
    /// How many have ever been.
    count: u64,
}

impl Default for Crew {
    fn default() -> Self {
        Self::of(std::thread::available_parallelism().map_or(1, usize::from))
    }
}

impl Crew {
    fn of(cores: usize) -> Self {
        Self { cores, members: Arc::default(), turns: Arc::new(Turns::new(cores)) }
    }

    /// Has those who wait for their turn look whether they are to stop.
    pub(super) fn look(&self) {
        self.turns.look();
    }

    /// Returns the number of a new painter.
    pub(super) fn join(&self) -> u64 {
        let mut members = self.lock();
        members.count += 1;
        members.count
    }

    /// Counts a painter among those at work until what is returned is dropped.
    pub(super) fn work(&self, number: u64) -> AtWork {
        self.lock().ends.insert(number, None);
        AtWork { crew: self.clone(), number, _place: self.turns.take(1) }
    }

    /// Returns the threads that each of those who share the cores may have. Powers of two: then few pools are enough.
    fn share(&self) -> usize {
        let mut members = self.lock();
        members.ends.retain(|_, end| end.is_none_or(|end| end.elapsed() < MOMENT));
        let share = self.cores / members.ends.len().max(1);
        if share < 2 { 1 } else { 1 << share.ilog2() }
    }

    fn lock(&self) -> MutexGuard<'_, Members> {
        self.members.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A painter at work.
pub(super) struct AtWork {
    crew: Crew,
    number: u64,
    _place: Taken,
}

impl Drop for AtWork {
    fn drop(&mut self) {
        self.crew.lock().ends.insert(self.number, Some(Instant::now()));
    }
}

/// The threads of one painter: no other keeps them busy.
pub(super) struct Hands {
    crew: Crew,
    pools: BTreeMap<usize, Pool>,
}

impl Hands {
    pub(super) fn of(crew: Crew) -> Self {
        Self { crew, pools: BTreeMap::new() }
    }

    /// Does some work, until it is to stop, with as many threads as are due now, and tells how long that took, the
    /// others' turns not counted. Where the system gives no threads, one is enough.
    pub(super) fn lend<R: Send>(
        &mut self,
        stop: &AtomicBool,
        work: impl FnOnce(Control<'_>) -> R + Send,
    ) -> (R, Duration) {
        let count = self.crew.share();
        if count > 1 && !self.pools.contains_key(&count) {
            Pool::new(count).into_iter().for_each(|pool| drop(self.pools.insert(count, pool)));
        }
        let pool = self.pools.get(&count);
        let turns = &self.crew.turns;
        let _others = pool.map(|_| turns.take(count - 1));
        let turn = Turn::new(turns, stop);
        let begin = Instant::now();
        // Where others are at work, it begins by waiting for its turn.
        turn.stops();
        let control = |threads| Control::new(threads).cancelled_by(stop).probed_by(&turn);
        let result = match pool {
            Some(pool) => pool.install(|| work(control(pool))),
            None => work(control(&OneThread)),
        };
        let waited = turn.waited() / pool.map_or(1, |_| count as u32);
        (result, begin.elapsed().saturating_sub(waited))
    }
}

#[cfg(test)]
mod tests {
    use super::super::turns::LONGEST_WAIT;
    use super::*;

    #[test]
    fn those_at_work_share_the_cores() {
        let (crew, stop) = (Crew::of(12), AtomicBool::new(false));
        let [one, two, three] = [(); 3].map(|()| crew.join());
        let first = crew.work(one);
        assert_eq!(crew.share(), 8);
        let others = [crew.work(two), crew.work(three)];
        assert_eq!(crew.share(), 4);
        assert_eq!(Hands::of(crew.clone()).lend(&stop, |control| control.threads.count()).0, 4);
        let working = Instant::now();
        drop(others);
        while crew.share() < 8 {
            std::thread::yield_now();
        }
        assert!(working.elapsed() >= MOMENT, "they are counted for a moment");
        drop((crew.work(two), first));
        assert_eq!(crew.lock().ends.len(), 2, "nobody is counted twice");
        assert_eq!(Hands::of(Crew::of(1)).lend(&stop, |control| control.threads.count()).0, 1);
    }

    #[test]
    fn a_time_is_without_the_turns_of_others() {
        let (crew, stop) = (Crew::of(1), AtomicBool::new(false));
        let _others = [crew.join(), crew.join()].map(|number| crew.work(number));
        let begin = Instant::now();
        let ((), time) = Hands::of(crew).lend(&stop, |control| assert!(!control.is_cancelled()));
        // Nobody gives a place back, so that it waits for as long as anybody does.
        assert!(time < begin.elapsed() && begin.elapsed() - time >= LONGEST_WAIT);
    }
}
