//! How a back end uses the host's threads: fork and join, nothing else.
//!
//! The host owns the threads; a back end is lent them as [`Threads`]. One primitive, `join`, is enough to
//! split any work in halves without allocating, and it is simple enough to cross a C border.

use std::sync::Arc;

/// Threads lent by the host.
pub trait Threads: Sync {
    /// Returns how many threads work at once.
    fn count(&self) -> usize;

    /// Runs both closures, perhaps at the same time, and returns when both are done.
    fn join(&self, left: &mut (dyn FnMut() + Send), right: &mut (dyn FnMut() + Send));
}

/// Runs everything on the calling thread.
#[derive(Clone, Copy, Debug, Default)]
pub struct OneThread;

impl Threads for OneThread {
    fn count(&self) -> usize {
        1
    }
    fn join(&self, left: &mut (dyn FnMut() + Send), right: &mut (dyn FnMut() + Send)) {
        left();
        right();
    }
}

/// A pool of a fixed number of threads.
#[derive(Clone)]
pub struct Pool {
    pool: Arc<rayon::ThreadPool>,
}

impl Pool {
    /// Starts a pool of `count` threads; 0 means one for each core.
    ///
    /// # Errors
    /// When the system refuses to start that many threads; the message says why.
    pub fn new(count: usize) -> Result<Self, String> {
        rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .thread_name(|i| format!("polyptych-{i}"))
            .build()
            .map(|pool| Self { pool: Arc::new(pool) })
            .map_err(|e| format!("cannot start {count} threads: {e}"))
    }

    /// Runs `work` inside the pool, so that rayon's own parallel iterators use these threads too.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.pool.install(work)
    }
}

impl Threads for Pool {
    fn count(&self) -> usize {
        self.pool.current_num_threads()
    }
    fn join(&self, left: &mut (dyn FnMut() + Send), right: &mut (dyn FnMut() + Send)) {
        self.pool.join(left, right);
    }
}

/// Calls `work(index, &mut item)` for every item, in pieces of at most `grain` items.
pub fn for_each_mut<T: Send>(
    threads: &dyn Threads,
    items: &mut [T],
    grain: usize,
    work: &(impl Fn(usize, &mut T) + Sync),
) {
    fn halve<T: Send>(
        threads: &dyn Threads,
        items: &mut [T],
        first: usize,
        grain: usize,
        work: &(impl Fn(usize, &mut T) + Sync),
    ) {
        if items.len() <= grain {
            for (i, item) in items.iter_mut().enumerate() {
                work(first + i, item);
            }
            return;
        }
        let middle = items.len() / 2;
        let (left, right) = items.split_at_mut(middle);
        threads.join(&mut || halve(threads, left, first, grain, work), &mut || {
            halve(threads, right, first + middle, grain, work);
        });
    }
    halve(threads, items, 0, grain.max(1), work);
}

/// Calls `work` for every index below `count`, in pieces of at most `grain`.
pub fn for_each_index(threads: &dyn Threads, count: usize, grain: usize, work: &(impl Fn(usize) + Sync)) {
    fn halve(
        threads: &dyn Threads,
        range: std::ops::Range<usize>,
        grain: usize,
        work: &(impl Fn(usize) + Sync),
    ) {
        if range.len() <= grain {
            range.for_each(work);
            return;
        }
        let middle = range.start + range.len() / 2;
        threads.join(&mut || halve(threads, range.start..middle, grain, work), &mut || {
            halve(threads, middle..range.end, grain, work);
        });
    }
    halve(threads, 0..count, grain.max(1), work);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_visited_once_with_its_index() {
        let pool = Pool::new(3).unwrap();
        for threads in [&OneThread as &dyn Threads, &pool] {
            let mut items = vec![0usize; 1009];
            for_each_mut(threads, &mut items, 7, &|i, item| *item += i + 1);
            assert!(items.iter().enumerate().all(|(i, &v)| v == i + 1));
        }
    }
}
