//! Which chunks of a world without end are at hand, and which are on their way?
//!
//! A [`World`] shows a window of chunks around the eye as an ordinary grid, which every back end draws. Chunks come from
//! a [`ChunkSource`], loaded by threads in the background, nearest first, and are kept within a budget of memory: those
//! that were out of sight longest go first. A chunk that is not there yet is drawn in its coarse color, never as a hole;
//! so a picture converges to that of the world as a whole once the eye rests.
//!
//! Places are whole numbers of chunks plus a place within the window: nothing trembles 2^31 cells from the origin.

use crate::scene::{CHUNK, Chunk, Voxels};
use glam::DVec3;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Where the chunks of a world come from: a procedure, a file, a network.
pub trait ChunkSource: Send + Sync + 'static {
    /// Makes a chunk; places count chunks from the world's origin. Called by threads in the background, for several
    /// chunks at once. Where it panics the chunk keeps its coarse color.
    fn load(&self, place: [i32; 3]) -> Chunk;

    /// Returns the byte that stands for a chunk until it is there, 0 for one that is mostly empty. Called for every
    /// chunk that comes into the window: it must be quick.
    fn coarse(&self, place: [i32; 3]) -> u8;
}

/// How large a world's window is, and what loading may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Chunks of the window along each axis.
    pub chunks: [u32; 3],
    /// Bytes that loaded chunks may hold.
    pub bytes: u64,
    /// Threads that load.
    pub threads: usize,
    /// Chunks taken over by one call of [`World::voxels`]: what comes at once is made ready at once.
    pub at_once: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { chunks: [16, 8, 16], bytes: 256 << 20, threads: 1, at_once: 16 }
    }
}

/// A world without end, seen through a window.
pub struct World {
    source: Arc<dyn ChunkSource>,
    limits: Limits,
    /// Place of the first chunk of the window.
    first: [i32; 3],
    window: Voxels,
    /// Chunks that were loaded, in the window or out of it.
    loaded: HashMap<[i32; 3], Loaded>,
    bytes: u64,
    /// Counts moves of the window: when a chunk was last in it.
    clock: u64,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

struct Loaded {
    chunk: Chunk,
    seen: u64,
}

/// What the loading threads and the world hold in common.
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// Places that are wanted, the nearest last.
    wanted: Vec<[i32; 3]>,
    /// Those that are being loaded.
    busy: HashSet<[i32; 3]>,
    ready: Vec<([i32; 3], Chunk)>,
    is_over: bool,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // A source that panics does so outside of the lock.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn bytes_of(chunk: &Chunk) -> u64 {
    match chunk {
        Chunk::Uniform(_) => 16,
        Chunk::Cells(cells) => cells.len() as u64,
    }
}

/// Chunks that wait to be taken over, for each thread: no more are loaded ahead.
const AHEAD: usize = 16;

impl World {
    /// Opens a window around the chunk at the world's origin, and begins to load.
    ///
    /// # Panics
    /// When no thread can be started.
    #[must_use]
    pub fn new(source: Arc<dyn ChunkSource>, limits: Limits) -> Self {
        let limits = Limits { chunks: limits.chunks.map(|c| c.clamp(1, 1024)), ..limits };
        let shared = Arc::new(Shared { state: Mutex::default(), changed: Condvar::new() });
        let threads = (0..limits.threads.max(1))
            .map(|i| {
                let (source, shared) = (source.clone(), shared.clone());
                let thread = std::thread::Builder::new().name(format!("polyptych-chunks-{i}"));
                thread.spawn(move || load(&*source, &shared)).expect("a thread that loads chunks")
            })
            .collect();
        let mut world = Self {
            source,
            limits,
            first: [0; 3],
            window: Voxels::new(limits.chunks.map(|c| c * CHUNK)),
            loaded: HashMap::new(),
            bytes: 0,
            clock: 0,
            shared,
            threads,
        };
        world.show([0; 3]);
        world
    }

    /// Moves the window so that a chunk is in its middle.
    pub fn look_from(&mut self, chunk: [i32; 3]) {
        let first = std::array::from_fn(|a| {
            let half = (self.limits.chunks[a] / 2) as i32;
            let last = i32::MAX - self.limits.chunks[a] as i32;
            chunk[a].saturating_sub(half).clamp(i32::MIN, last)
        });
        if first != self.first {
            self.show(first);
        }
    }

    fn show(&mut self, first: [i32; 3]) {
        self.first = first;
        self.clock += 1;
        let [cx, cy, _] = self.limits.chunks.map(|c| c as usize);
        let mut wanted = Vec::new();
        let middle = self.limits.chunks.map(|c| (c / 2) as i32);
        for index in 0..self.window.chunk_count() {
            let within = [index % cx, index / cx % cy, index / (cx * cy)].map(|c| c as i32);
            let place = std::array::from_fn(|a| first[a] + within[a]);
            let chunk = match self.loaded.get_mut(&place) {
                Some(loaded) => {
                    loaded.seen = self.clock;
                    loaded.chunk.clone()
                }
                None => {
                    let far: i64 = (0..3).map(|a| i64::from(within[a] - middle[a]).pow(2)).sum();
                    wanted.push((far, place));
                    Chunk::Uniform(self.source.coarse(place))
                }
            };
            self.window.put_chunk(index, chunk);
        }
        wanted.sort_unstable_by(|a, b| b.cmp(a));
        let mut state = self.shared.lock();
        let State { wanted: list, busy, ready, .. } = &mut *state;
        list.clear();
        let on_its_way = |place: &[i32; 3]| busy.contains(place) || ready.iter().any(|r| r.0 == *place);
        list.extend(wanted.into_iter().map(|w| w.1).filter(|place| !on_its_way(place)));
        self.shared.changed.notify_all();
    }

    /// Returns the window as it is now; what was loaded since is in it, up to [`Limits::at_once`] chunks.
    pub fn voxels(&mut self) -> &Voxels {
        let taken = {
            let mut state = self.shared.lock();
            let count = state.ready.len().min(self.limits.at_once.max(1));
            let taken: Vec<_> = state.ready.drain(..count).collect();
            self.shared.changed.notify_all();
            taken
        };
        for (place, chunk) in taken {
            self.take(place, chunk);
        }
        &self.window
    }

    fn take(&mut self, place: [i32; 3], chunk: Chunk) {
        let Some(index) = self.index(place) else { return };
        let bytes = bytes_of(&chunk);
        self.evict(bytes);
        if self.bytes + bytes > self.limits.bytes {
            return;
        }
        self.bytes += bytes;
        self.window.put_chunk(index, chunk.clone());
        if let Some(old) = self.loaded.insert(place, Loaded { chunk, seen: self.clock }) {
            self.bytes -= bytes_of(&old.chunk);
        }
    }

    /// Drops chunks that were out of the window longest until as many bytes are free, if they can be.
    fn evict(&mut self, bytes: u64) {
        while self.bytes + bytes > self.limits.bytes {
            let oldest = self.loaded.iter().filter(|(_, l)| l.seen != self.clock);
            let Some(place) = oldest.min_by_key(|(place, l)| (l.seen, **place)).map(|(place, _)| *place)
            else {
                return;
            };
            if let Some(old) = self.loaded.remove(&place) {
                self.bytes -= bytes_of(&old.chunk);
            }
        }
    }

    /// Returns the index of a chunk in the window.
    fn index(&self, place: [i32; 3]) -> Option<usize> {
        let mut index = 0;
        for a in [2, 1, 0] {
            let within = place[a].checked_sub(self.first[a])?;
            if within < 0 || within as u32 >= self.limits.chunks[a] {
                return None;
            }
            index = index * self.limits.chunks[a] as usize + within as usize;
        }
        Some(index)
    }

    /// Returns a place of the world, a cell and a part of it, in the space of the window.
    #[must_use]
    pub fn in_window(&self, cell: [i64; 3], part: DVec3) -> DVec3 {
        let first = self.first.map(|c| i64::from(c) * i64::from(CHUNK));
        let whole = [0, 1, 2].map(|a| (cell[a] - first[a]) as f64);
        DVec3::from_array(whole) + part
    }

    /// Returns the chunk that a cell lies in.
    #[must_use]
    pub fn chunk_of(cell: [i64; 3]) -> [i32; 3] {
        let chunk = |c: i64| c.div_euclid(i64::from(CHUNK));
        cell.map(|c| chunk(c).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32)
    }

    /// Returns the bytes that loaded chunks hold.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Counts the chunks of the window that are still drawn in their coarse color.
    #[must_use]
    pub fn missing(&self) -> usize {
        let there = self.loaded.values().filter(|loaded| loaded.seen == self.clock).count();
        self.window.chunk_count() - there
    }
}

impl Drop for World {
    fn drop(&mut self) {
        self.shared.lock().is_over = true;
        self.shared.changed.notify_all();
        for thread in self.threads.drain(..) {
            // What a source panicked with is nothing that could be handled here.
            let _ = thread.join();
        }
    }
}

/// Loads what is wanted, until the world is dropped.
fn load(source: &dyn ChunkSource, shared: &Shared) {
    let mut state = shared.lock();
    loop {
        if state.is_over {
            return;
        }
        let next = if state.ready.len() < AHEAD { state.wanted.pop() } else { None };
        let Some(place) = next else {
            state = shared.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            continue;
        };
        state.busy.insert(place);
        drop(state);
        let made = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| source.load(place)));
        let chunk = made.ok().filter(|chunk| match chunk {
            Chunk::Uniform(_) => true,
            Chunk::Cells(cells) => cells.len() == (CHUNK * CHUNK * CHUNK) as usize,
        });
        state = shared.lock();
        state.busy.remove(&place);
        if let Some(chunk) = chunk {
            state.ready.push((place, chunk));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    /// Hills whose heights go up and down with the place in the world.
    struct Hills;

    fn height(x: i64, z: i64) -> i64 {
        20 + (x.rem_euclid(97) / 5) + (z.rem_euclid(61) / 4)
    }

    impl ChunkSource for Hills {
        fn load(&self, place: [i32; 3]) -> Chunk {
            let first = place.map(|c| i64::from(c) * 64);
            let cells = (0..64 * 64 * 64i64).map(|i| {
                let [x, y, z] = [first[0] + i % 64, first[1] + i / 64 % 64, first[2] + i / 4096];
                u8::from(y < height(x, z))
            });
            Chunk::Cells(cells.collect())
        }

        fn coarse(&self, place: [i32; 3]) -> u8 {
            u8::from(place[1] <= 0)
        }
    }

    fn limits() -> Limits {
        Limits { chunks: [5, 2, 5], bytes: 64 << 20, threads: 2, at_once: 8 }
    }

    fn settle(world: &mut World) {
        let start = Instant::now();
        while world.missing() > 0 && start.elapsed() < Duration::from_secs(20) {
            world.voxels();
            std::thread::yield_now();
        }
        assert_eq!(world.missing(), 0);
    }

    #[test]
    fn what_is_missing_is_coarse_and_then_comes() {
        let mut world = World::new(Arc::new(Hills), limits());
        world.look_from([100, 1, -7]);
        let coarse = world.voxels().clone();
        assert_eq!((coarse.get(1, 10, 1), coarse.get(1, 10 + 64, 1)), (1, 0), "nothing is a hole");
        settle(&mut world);
        let first = world.first.map(|c| i64::from(c) * 64);
        let voxels = world.voxels();
        for (x, y, z) in [(0, 0, 0), (319, 85, 319), (100, 90, 200), (64, 101, 64), (63, 100, 65)] {
            let [wx, wy, wz] = [first[0] + i64::from(x), first[1] + i64::from(y), first[2] + i64::from(z)];
            assert_eq!(voxels.get(x, y, z), u8::from(wy < height(wx, wz)));
        }
        assert_eq!(world.in_window([6400, 0, -448], DVec3::splat(0.5)), DVec3::new(128.5, 0.5, 128.5));
    }

    #[test]
    fn a_long_flight_keeps_to_the_budget_and_ends_where_it_rests() {
        let tight = Limits { bytes: 60 * 262_144, ..limits() };
        let mut world = World::new(Arc::new(Hills), tight);
        for step in 0..400 {
            world.look_from([step, 0, step / 2]);
            world.voxels();
            assert!(world.bytes() <= tight.bytes, "{} bytes", world.bytes());
        }
        settle(&mut world);
        let mut there = World::new(Arc::new(Hills), limits());
        there.look_from([399, 0, 199]);
        settle(&mut there);
        let same = |[x, y, z]: [u32; 3]| world.window.get(x, y, z) == there.window.get(x, y, z);
        assert!((0..5_000u32).all(|i| same([i * 37 % 320, i * 11 % 128, i * 53 % 320])));
    }

    #[test]
    fn far_away_is_as_near_as_here() {
        let far = 1 << 30; // chunks: 2^36 cells
        let mut world = World::new(Arc::new(Hills), limits());
        world.look_from([far, 0, -far]);
        assert_eq!(World::chunk_of([i64::from(far) * 64 + 63, -1, 0]), [far, -1, 0]);
        let at = world.in_window([i64::from(far) * 64, 0, i64::from(-far) * 64], DVec3::splat(0.25));
        assert_eq!(at, DVec3::new(128.25, 64.25, 128.25));
        for edge in [i32::MIN, i32::MAX] {
            world.look_from([edge; 3]);
            world.voxels();
        }
    }

    #[test]
    fn a_source_that_fails_leaves_coarse_colors() {
        struct Broken;
        impl ChunkSource for Broken {
            fn load(&self, place: [i32; 3]) -> Chunk {
                if place[0] == 0 { Chunk::Cells(vec![1, 2, 3].into()) } else { Chunk::Uniform(4) }
            }
            fn coarse(&self, _place: [i32; 3]) -> u8 {
                9
            }
        }
        let mut world = World::new(Arc::new(Broken), Limits { chunks: [3, 1, 1], ..limits() });
        let start = Instant::now();
        while world.missing() > 1 && start.elapsed() < Duration::from_secs(20) {
            world.voxels();
            std::thread::yield_now();
        }
        let seen = [0, 64, 128].map(|x| world.window.get(x, 0, 0));
        assert!(seen.contains(&9) && seen.contains(&4), "{seen:?}");
    }
}
