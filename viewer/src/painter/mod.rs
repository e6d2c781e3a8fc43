//! Who draws the picture of a pane? A thread of its own with threads of its own, which always works on what was
//! ordered last.
//!
//! A new order stops the running one, but for a coarse picture that will soon be done: while a camera moves, orders
//! come faster than pictures, and the coarse ones are what is then seen. Nor does a camera that moves stop what is being
//! prepared for it: begun anew with every move, that would never be done.

mod crew;
mod easel;
mod order;
mod tiles;
mod turns;

pub(crate) use crew::Crew;
pub(crate) use order::{Order, Pace};

use crate::measure::Times;
use easel::Easel;
use eframe::egui::ColorImage;
use polyptych::convert::Converter;
use polyptych::framebuffer::Framebuffer;
use polyptych::seam::{Decision, Registry};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A frame that is expected to take longer is first drawn with fewer pixels.
pub(crate) const BUDGET: Duration = Duration::from_millis(33);
/// An order that has come no further than its coarse picture is left to finish for so long.
const PATIENCE: Duration = Duration::from_millis(80);

/// A finished picture.
#[derive(Clone, Debug)]
pub(crate) struct Painting {
    pub(crate) backend: String,
    /// As it is looked at.
    pub(crate) image: Arc<ColorImage>,
    pub(crate) framebuffer: Arc<Framebuffer>,
    /// Whether nothing finer follows.
    pub(crate) is_full: bool,
    /// How long it was prepared and drawn, the turns of other painters not counted.
    pub(crate) prepare: Duration,
    pub(crate) frame: Duration,
    /// Pixels of the window for each pixel that was drawn, along an edge.
    pub(crate) coarse: u32,
    /// Bytes that the back end holds for the scene.
    pub(crate) bytes: u64,
    pub(crate) decisions: Arc<[Decision]>,
}

/// What there is to see.
pub(crate) enum News {
    Painting(Painting),
    /// The finished parts of a picture that is still being drawn.
    Parts(ColorImage),
    /// Why there is no picture.
    Failure(String),
}

/// Draws on a thread of its own.
pub(crate) struct Painter {
    desk: Arc<Desk>,
    crew: Crew,
}

/// What the window and a painter share.
struct Desk {
    state: Mutex<State>,
    ordered: Condvar,
    wake: Box<dyn Fn() + Send + Sync>,
}

#[derive(Default)]
struct State {
    order: Option<Order>,
    running: Option<Running>,
    news: Option<News>,
    is_closed: bool,
    /// Times from stopping an order until the painter was free.
    stops: Times,
}

/// The order that is being drawn.
struct Running {
    stop: Arc<AtomicBool>,
    /// Since when pictures are drawn, or prepared.
    begun: Instant,
    is_coarse: bool,
    /// The order as long as it is being prepared.
    preparing: Option<Order>,
    stopped: Option<Instant>,
}

impl Running {
    /// Stops the work, unless its coarse picture is about to be done, or what is being prepared serves the next order;
    /// tells whether it did.
    fn give_way(&mut self, next: &Order) -> bool {
        let goes_on = match &self.preparing {
            Some(order) => order.is_but_for_camera(next),
            None => self.is_coarse && self.begun.elapsed() < PATIENCE,
        };
        if !goes_on {
            self.stop();
        }
        !goes_on
    }

    fn stop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.stopped.get_or_insert_with(Instant::now);
    }
}

impl Painter {
    /// Starts a painter; `wake` is called whenever there is something new to see.
    pub(crate) fn new(
        registry: Registry,
        converter: Arc<Converter>,
        crew: Crew,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Self {
        let desk = Arc::new(Desk { state: Mutex::default(), ordered: Condvar::new(), wake: Box::new(wake) });
        let (shared, own) = (desk.clone(), crew.clone());
        std::thread::spawn(move || {
            // The threads that this one starts yield like it.
            yield_to_the_window();
            let number = own.join();
            let mut easel = Easel::new(registry, converter, own.clone());
            while let Some((order, stop)) = shared.next() {
                let _at_work = own.work(number);
                easel.paint(&order, &stop, &shared);
            }
        });
        Self { desk, crew }
    }

    /// Orders a picture in place of what was ordered before.
    pub(crate) fn order(&self, order: Order) {
        let mut state = self.desk.lock();
        let stops = state.running.as_mut().is_some_and(|running| running.give_way(&order));
        state.order = Some(order);
        drop(state);
        self.desk.ordered.notify_one();
        if stops {
            self.crew.look();
        }
    }

    /// Stops what is being drawn and forgets what was ordered.
    pub(crate) fn stop(&self) {
        let mut state = self.desk.lock();
        state.order = None;
        if let Some(running) = &mut state.running {
            running.stop();
        }
        drop(state);
        self.crew.look();
    }

    /// Takes what is new to see.
    pub(crate) fn take(&self) -> Option<News> {
        self.desk.lock().news.take()
    }

    /// Tells whether something is still being drawn.
    pub(crate) fn is_busy(&self) -> bool {
        let state = self.desk.lock();
        state.running.is_some() || state.order.is_some()
    }

    /// Returns the times from stopping an order until the painter was free.
    pub(crate) fn stops(&self) -> Times {
        self.desk.lock().stops.clone()
    }

    /// Begins to count these times anew.
    pub(crate) fn forget_stops(&self) {
        self.desk.lock().stops = Times::default();
    }
}

impl Drop for Painter {
    /// Lets the thread end by itself: whoever closes a pane need not wait for it.
    fn drop(&mut self) {
        self.desk.lock().is_closed = true;
        self.stop();
        self.desk.ordered.notify_one();
    }
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the next order; nothing when the pane is closed.
    fn next(&self) -> Option<(Order, Arc<AtomicBool>)> {
        let mut state = self.lock();
        if let Some(stopped) = state.running.take().and_then(|running| running.stopped) {
            state.stops.add(stopped.elapsed());
        }
        loop {
            if state.is_closed {
                return None;
            }
            if let Some(order) = state.order.take() {
                let stop = Arc::new(AtomicBool::new(false));
                state.running = Some(Running {
                    stop: stop.clone(),
                    begun: Instant::now(),
                    is_coarse: true,
                    preparing: Some(order.clone()),
                    stopped: None,
                });
                return Some((order, stop));
            }
            drop(state);
            // Whoever waits for the painter to be done learns it.
            (self.wake)();
            state = self.lock();
            if state.order.is_none() && !state.is_closed {
                state = self.ordered.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
        }
    }

    /// Begins the coarse picture: all is prepared.
    fn is_prepared(&self) {
        if let Some(running) = &mut self.lock().running {
            (running.preparing, running.begun) = (None, Instant::now());
        }
    }

    /// Begins the full picture; not if something newer was ordered meanwhile.
    fn may_refine(&self) -> bool {
        let mut state = self.lock();
        if let Some(running) = &mut state.running {
            running.is_coarse = false;
        }
        state.order.is_none()
    }

    /// Shows what is new; what belongs to a stopped order is of no use any more.
    fn tell(&self, stop: &AtomicBool, news: News) {
        if !stop.load(Ordering::Relaxed) {
            // What nobody looked at is freed when the window need not wait for it.
            let _unseen = self.lock().news.replace(news);
            (self.wake)();
        }
    }
}

/// Lets the window's thread go first where both want a core.
#[cfg(target_os = "linux")]
fn yield_to_the_window() {
    // With 5 a frame of the window in 20 was late where OpenGL is drawn in software, with 10 one in 1800.
    let own = rustix::thread::gettid();
    // A system that refuses leaves the thread as it is.
    let _ = rustix::process::setpriority_process(Some(own), 10);
}

#[cfg(not(target_os = "linux"))]
fn yield_to_the_window() {}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use polyptych::camera::{Camera, Projection};
    use polyptych::framebuffer::Channel;
    use polyptych::scene::Scene;
    use polyptych::seam::Need;

    #[test]
    fn a_moved_camera_does_not_stop_what_is_prepared_for_it() {
        let scene = Arc::new(Scene::default());
        let order = |from: DVec3, scene: &Arc<Scene>| {
            let view = Projection::Orthographic { height: 2.0 };
            let need = Need::new(Camera::look_at(from, DVec3::ZERO, DVec3::Y, view), 8, 8);
            let (backend, pace) = ("raster".to_owned(), Pace::Full);
            Order { backend, scene: scene.clone(), need, channel: Channel::Color, pace }
        };
        let first = order(DVec3::Z, &scene);
        let (moved, other) = (order(DVec3::X, &scene), order(DVec3::Z, &Arc::new(Scene::default())));
        let is_stopped_by = |preparing: Option<Order>, is_coarse: bool, next: &Order| {
            let stop = Arc::new(AtomicBool::new(false));
            let begun = Instant::now();
            let mut running = Running { stop: stop.clone(), begun, is_coarse, preparing, stopped: None };
            assert_eq!(running.give_way(next), stop.load(Ordering::Relaxed));
            stop.load(Ordering::Relaxed)
        };
        assert!(!is_stopped_by(Some(first.clone()), true, &moved));
        assert!(is_stopped_by(Some(first), true, &other), "of no use for another scene");
        assert!(is_stopped_by(None, false, &moved), "a full picture gives way");
    }
}
