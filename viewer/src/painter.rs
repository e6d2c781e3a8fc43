//! Who draws the picture of a pane? A thread of its own, which always works on what was asked for last.
//!
//! A new order cancels the running one. While the camera moves a picture of a quarter of the pixels, or less,
//! comes first, so that slow back ends answer, too; the full one follows when nothing new was ordered.

use polyptych::convert::Converter;
use polyptych::framebuffer::{Channel, Channels, Framebuffer};
use polyptych::parallel::Pool;
use polyptych::picture::displayed;
use polyptych::scene::Scene;
use polyptych::seam::{Control, Decision, Need, Registry, RenderError, Renderer};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A frame that is expected to take longer is first drawn with fewer pixels.
const BUDGET: Duration = Duration::from_millis(33);
/// Fewest pixels along an edge of a coarse picture, as a share of the full one.
const COARSEST: u32 = 8;

/// What is to be drawn.
#[derive(Clone)]
pub(crate) struct Order {
    pub(crate) backend: String,
    pub(crate) scene: Arc<Scene>,
    /// Camera, size, settings, and the channels of the full picture.
    pub(crate) need: Need,
    /// The channel that is looked at.
    pub(crate) channel: Channel,
}

/// A finished picture.
#[derive(Clone, Debug)]
pub(crate) struct Painting {
    pub(crate) backend: String,
    pub(crate) pixels: Vec<[u8; 3]>,
    pub(crate) framebuffer: Arc<Framebuffer>,
    pub(crate) size: [usize; 2],
    /// Whether it has all pixels that were ordered.
    pub(crate) is_full: bool,
    pub(crate) prepare: Duration,
    pub(crate) frame: Duration,
    pub(crate) decisions: Arc<[Decision]>,
}

/// Draws on a thread of its own.
pub(crate) struct Painter {
    desk: Arc<Desk>,
    thread: Option<std::thread::JoinHandle<()>>,
}

/// What the window and a painter share.
struct Desk {
    state: Mutex<State>,
    ordered: Condvar,
}

#[derive(Default)]
struct State {
    order: Option<Order>,
    /// Stops the running order.
    stop: Option<Arc<AtomicBool>>,
    painting: Option<Result<Painting, String>>,
    is_busy: bool,
    is_closed: bool,
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Painter {
    /// Starts a painter; `wake` is called whenever there is something new to see.
    pub(crate) fn new(
        registry: Registry,
        pool: Pool,
        converter: Arc<Converter>,
        wake: impl Fn() + Send + 'static,
    ) -> Self {
        let desk = Arc::new(Desk { state: Mutex::default(), ordered: Condvar::new() });
        let shared = desk.clone();
        let thread = std::thread::spawn(move || {
            let mut easel = Easel { registry, pool, converter, renderer: None, cost: None };
            while let Some((order, stop)) = shared.next() {
                easel.paint(&order, &stop, &|painting| {
                    // A picture of an older order is of no use any more.
                    if !stop.load(Ordering::Relaxed) {
                        shared.lock().painting = Some(painting);
                    }
                    wake();
                });
            }
        });
        Self { desk, thread: Some(thread) }
    }

    /// Orders a picture in place of what was ordered before.
    pub(crate) fn order(&self, order: Order) {
        let mut state = self.desk.lock();
        if let Some(stop) = &state.stop {
            stop.store(true, Ordering::Relaxed);
        }
        state.order = Some(order);
        self.desk.ordered.notify_one();
    }

    /// Takes the newest picture, or the reason why there is none, if it was not taken yet.
    pub(crate) fn take(&self) -> Option<Result<Painting, String>> {
        self.desk.lock().painting.take()
    }

    /// Tells whether something is still being drawn.
    pub(crate) fn is_busy(&self) -> bool {
        let state = self.desk.lock();
        state.is_busy || state.order.is_some()
    }
}

impl Drop for Painter {
    fn drop(&mut self) {
        {
            let mut state = self.desk.lock();
            state.is_closed = true;
            if let Some(stop) = &state.stop {
                stop.store(true, Ordering::Relaxed);
            }
        }
        self.desk.ordered.notify_one();
        if let Some(thread) = self.thread.take() {
            // A painter that panicked has nothing left to do.
            let _ = thread.join();
        }
    }
}

impl Desk {
    /// Waits for the next order; nothing when the pane is closed.
    fn next(&self) -> Option<(Order, Arc<AtomicBool>)> {
        let mut state = self.lock();
        state.is_busy = false;
        loop {
            if state.is_closed {
                return None;
            }
            if let Some(order) = state.order.take() {
                let stop = Arc::new(AtomicBool::new(false));
                (state.stop, state.is_busy) = (Some(stop.clone()), true);
                return Some((order, stop));
            }
            state = self.ordered.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// What a painter works with.
struct Easel {
    registry: Registry,
    pool: Pool,
    converter: Arc<Converter>,
    renderer: Option<(String, Box<dyn Renderer>)>,
    /// Seconds a pixel of the last frame.
    cost: Option<f64>,
}

impl Easel {
    /// Draws an order, coarse and then in full. A renderer that fails or panics is thrown away.
    fn paint(&mut self, order: &Order, stop: &AtomicBool, show: &dyn Fn(Result<Painting, String>)) {
        let result = catch_unwind(AssertUnwindSafe(|| self.try_paint(order, stop, show)));
        let why = match result {
            Ok(Ok(()) | Err(RenderError::Cancelled)) => return,
            Ok(Err(error)) => error.to_string(),
            Err(_) => "it panicked; the next picture begins anew".to_owned(),
        };
        self.renderer = None;
        show(Err(format!("{}: {why}", order.backend)));
    }

    fn try_paint(
        &mut self,
        order: &Order,
        stop: &AtomicBool,
        show: &dyn Fn(Result<Painting, String>),
    ) -> Result<(), RenderError> {
        if self.renderer.as_ref().is_none_or(|(id, _)| *id != order.backend) {
            let renderer =
                self.registry.create(&order.backend).map_err(|e| RenderError::Failed(e.to_string()))?;
            (self.renderer, self.cost) = (Some((order.backend.clone(), renderer)), None);
        }
        let Some((_, renderer)) = &mut self.renderer else { return Err(RenderError::NotPrepared) };
        let need = &order.need;
        let pool = &self.pool;
        let control = || Control::new(pool).cancelled_by(stop);
        let begin = Instant::now();
        let prepared = pool.install(|| renderer.prepare(&order.scene, need, &self.converter, &control()))?;
        let prepare = begin.elapsed();
        let full = f64::from(need.width) * f64::from(need.height);
        for coarse in coarseness(self.cost.map(|cost| Duration::from_secs_f64(cost * full))) {
            let (width, height) = (need.width.div_ceil(coarse), need.height.div_ceil(coarse));
            let channels = if coarse == 1 { need.channels } else { Channels::of(&[order.channel]) };
            let mut target = Framebuffer::new(width, height, channels);
            let begin = Instant::now();
            let report = pool.install(|| renderer.render(&need.frame(), &mut target, &control()))?;
            let frame = begin.elapsed();
            self.cost = Some(frame.as_secs_f64() / (f64::from(width) * f64::from(height)).max(1.0));
            let decisions = if report.objects.is_empty() { prepared.objects.clone() } else { report.objects };
            show(Ok(Painting {
                backend: order.backend.clone(),
                pixels: displayed(&target, order.channel),
                framebuffer: Arc::new(target),
                size: [width as usize, height as usize],
                is_full: coarse == 1,
                prepare,
                frame,
                decisions,
            }));
        }
        Ok(())
    }
}

/// Returns by how much the pictures of an order are coarser than the full one, the last one being full.
///
/// A back end that nobody has timed yet begins coarse: it may be a slow one.
fn coarseness(expected: Option<Duration>) -> Vec<u32> {
    let ratio = expected.map_or(f64::from(COARSEST * COARSEST), |t| t.as_secs_f64() / BUDGET.as_secs_f64());
    let coarse = (ratio.sqrt().ceil() as u32).clamp(1, COARSEST);
    if coarse == 1 { vec![1] } else { vec![coarse, 1] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_back_ends_begin_coarse_and_end_in_full() {
        assert_eq!(coarseness(None), [COARSEST, 1]);
        assert_eq!(coarseness(Some(Duration::from_millis(10))), [1]);
        assert_eq!(coarseness(Some(Duration::from_millis(100))), [2, 1]);
        assert_eq!(coarseness(Some(Duration::from_secs(100))), [COARSEST, 1]);
    }
}
