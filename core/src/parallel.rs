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
    is_pinned: bool,
}

impl Pool {
    /// Starts a pool of `count` threads; 0 means one for each core.
    ///
    /// # Errors
    /// When the system refuses to start that many threads; the message says why.
    pub fn new(count: usize) -> Result<Self, String> {
        Self::build(count, &[])
    }

    /// Starts a pool whose threads stay each on a core of its own, so that times can be compared. Where that is not
    /// possible (more threads than cores, or a system without such a call) it is a plain one; see [`Pool::is_pinned`].
    ///
    /// # Errors
    /// When the system refuses to start that many threads; the message says why.
    pub fn pinned(count: usize) -> Result<Self, String> {
        let cores = cores::allowed();
        let wanted = if count == 0 { cores.len() } else { count };
        Self::build(count, if wanted <= cores.len() { &cores[..wanted] } else { &[] })
    }

    /// Tells whether every thread stays on a core of its own.
    #[must_use]
    pub fn is_pinned(&self) -> bool {
        self.is_pinned
    }

    fn build(count: usize, cores: &[usize]) -> Result<Self, String> {
        let builder =
            rayon::ThreadPoolBuilder::new().num_threads(count).thread_name(|i| format!("polyptych-{i}"));
        let own = cores.to_vec();
        let pool = builder
            .start_handler(move |i| {
                if let Some(&core) = own.get(i) {
                    cores::stay_on(core);
                }
            })
            .build()
            .map_err(|e| format!("cannot start {count} threads: {e}"))?;
        // Asked of the threads themselves: a system may refuse one of them.
        let pinned =
            pool.broadcast(|thread| cores.get(thread.index()).is_some_and(|&c| cores::allowed() == [c]));
        Ok(Self { is_pinned: pinned.iter().all(|&p| p), pool: Arc::new(pool) })
    }

    /// Returns the milliseconds that the threads have worked so far, those not counted in which other programs had their
    /// cores; nothing where the system does not tell.
    #[must_use]
    pub fn worked_ms(&self) -> Option<f64> {
        self.pool.broadcast(|_| cores::worked_ms()).into_iter().sum()
    }

    /// Runs `work` inside the pool, so that rayon's own parallel iterators use these threads too.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.pool.install(work)
    }
}

/// The cores of the machine, where the system lets a thread choose.
#[cfg(target_os = "linux")]
mod cores {
    use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

    /// Lists the cores that the calling thread may run on.
    pub(super) fn allowed() -> Vec<usize> {
        sched_getaffinity(None)
            .map_or(Vec::new(), |set| (0..CpuSet::MAX_CPU).filter(|&core| set.is_set(core)).collect())
    }

    /// Keeps the calling thread on one core. A system that refuses leaves it as it was.
    pub(super) fn stay_on(core: usize) {
        let mut set = CpuSet::new();
        set.set(core);
        let _ = sched_setaffinity(None, &set);
    }

    /// Returns the milliseconds that the calling thread has had a core.
    #[expect(clippy::unnecessary_wraps, reason = "elsewhere it is not known")]
    pub(super) fn worked_ms() -> Option<f64> {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Some(time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6)
    }
}

/// Elsewhere threads go where the system puts them.
#[cfg(not(target_os = "linux"))]
mod cores {
    pub(super) fn allowed() -> Vec<usize> {
        Vec::new()
    }

    pub(super) fn stay_on(_core: usize) {}

    pub(super) fn worked_ms() -> Option<f64> {
        None
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
    for_each_piece(threads, items, grain, &|first, piece: &mut [T]| {
        for (i, item) in piece.iter_mut().enumerate() {
            work(first + i, item);
        }
    });
}

/// Calls `work(index of the first, piece)` for pieces of at most `grain` items.
pub(crate) fn for_each_piece<T: Send>(
    threads: &dyn Threads,
    items: &mut [T],
    grain: usize,
    work: &(impl Fn(usize, &mut [T]) + Sync),
) {
    fn halve<T: Send>(
        threads: &dyn Threads,
        items: &mut [T],
        first: usize,
        grain: usize,
        work: &(impl Fn(usize, &mut [T]) + Sync),
    ) {
        if items.len() <= grain {
            work(first, items);
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
    fn pinned_threads_stay_and_more_than_there_are_cores_do_not() {
        let cores = cores::allowed().len();
        if cores > 0 {
            assert!(Pool::pinned(1).unwrap().is_pinned() && Pool::pinned(0).unwrap().is_pinned());
        }
        let many = Pool::pinned(cores + 1).unwrap();
        assert_eq!((many.is_pinned(), many.count()), (false, cores + 1));
        assert!(!Pool::new(1).unwrap().is_pinned());
    }

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
