//! How many threads does a painter get? Its share of the cores among the painters that are at work.

use polyptych::parallel::{OneThread, Pool, Threads};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The painters of a window, who share its machine.
#[derive(Clone)]
pub(crate) struct Crew {
    cores: usize,
    at_work: Arc<AtomicUsize>,
}

impl Default for Crew {
    fn default() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Self { cores, at_work: Arc::default() }
    }
}

impl Crew {
    /// Counts a painter among those at work until what is returned is dropped.
    pub(super) fn work(&self) -> AtWork {
        self.at_work.fetch_add(1, Ordering::Relaxed);
        AtWork(self.at_work.clone())
    }

    /// Returns the threads that each of those at work may have. Powers of two: then few pools are enough.
    fn share(&self) -> usize {
        let share = self.cores / self.at_work.load(Ordering::Relaxed).max(1);
        if share < 2 { 1 } else { 1 << share.ilog2() }
    }
}

/// A painter at work.
pub(super) struct AtWork(Arc<AtomicUsize>);

impl Drop for AtWork {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
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

    /// Does some work with as many threads as are due now. Where the system gives none, one is enough.
    pub(super) fn lend<R: Send>(&mut self, work: impl FnOnce(&dyn Threads) -> R + Send) -> R {
        let count = self.crew.share();
        if count > 1 && !self.pools.contains_key(&count) {
            Pool::new(count).into_iter().for_each(|pool| drop(self.pools.insert(count, pool)));
        }
        match self.pools.get(&count) {
            Some(pool) => pool.install(|| work(pool)),
            None => work(&OneThread),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_at_work_share_the_cores() {
        let crew = Crew { cores: 12, at_work: Arc::default() };
        let first = crew.work();
        assert_eq!(crew.share(), 8);
        let others = [crew.work(), crew.work()];
        assert_eq!(crew.share(), 4);
        assert_eq!(Hands::of(crew.clone()).lend(|threads| threads.count()), 4);
        drop(others);
        assert_eq!(crew.share(), 8);
        drop(first);
        let alone = Crew { cores: 1, at_work: Arc::default() };
        assert_eq!(Hands::of(alone).lend(|threads| threads.count()), 1);
    }
}
