//! How is an order drawn? Coarse where it would take long, then in full; or as fine as a time allows.

use super::crew::{Crew, Hands};
use super::tiles::Tiles;
use super::{BUDGET, Desk, News, Order, Pace, Painting};
use eframe::egui::ColorImage;
use polyptych::convert::Converter;
use polyptych::framebuffer::{Channel, Channels, Framebuffer, Pixel};
use polyptych::picture::displayed;
use polyptych::seam::{Prepared, Registry, RenderError, Renderer, Report};
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Most pixels of the window for one that is drawn, along an edge.
const COARSEST: u32 = 8;
/// Pictures that are kept to be drawn over: the one that is shown, the one before it, and a coarse one.
const KEPT: usize = 3;
/// A picture that is expected to take longer is shown in parts.
const SHOWN_IN_PARTS: Duration = Duration::from_millis(120);

/// What a painter works with.
pub(super) struct Easel {
    registry: Registry,
    hands: Hands,
    converter: Arc<Converter>,
    renderer: Option<(String, Box<dyn Renderer>)>,
    cost: Option<Cost>,
    /// The pictures drawn last: over those that nobody looks at any more the next ones are drawn. New ones would be
    /// megabytes that the system has to clear first, a page at a time.
    drawn: VecDeque<Arc<Framebuffer>>,
}

/// Seconds a pixel of the last frame.
#[derive(Clone, Copy)]
struct Cost {
    /// From its beginning to its end.
    wall: f64,
    /// Without the turns of others.
    worked: f64,
}

impl Easel {
    pub(super) fn new(registry: Registry, converter: Arc<Converter>, crew: Crew) -> Self {
        let hands = Hands::of(crew);
        Self { registry, hands, converter, renderer: None, cost: None, drawn: VecDeque::new() }
    }

    /// Draws an order. A renderer that fails or panics is thrown away.
    pub(super) fn paint(&mut self, order: &Order, stop: &AtomicBool, desk: &Desk) {
        let result = catch_unwind(AssertUnwindSafe(|| self.try_paint(order, stop, desk)));
        let why = match result {
            Ok(Ok(()) | Err(RenderError::Cancelled)) => return,
            Ok(Err(error)) => error.to_string(),
            Err(_) => "it panicked; the next picture begins anew".to_owned(),
        };
        self.renderer = None;
        desk.tell(stop, News::Failure(format!("{}: {why}", order.backend)));
    }

    fn try_paint(&mut self, order: &Order, stop: &AtomicBool, desk: &Desk) -> Result<(), RenderError> {
        if self.renderer.as_ref().is_none_or(|(id, _)| *id != order.backend) {
            let renderer =
                self.registry.create(&order.backend).map_err(|e| RenderError::Failed(e.to_string()))?;
            (self.renderer, self.cost) = (Some((order.backend.clone(), renderer)), None);
        }
        let (prepared, prepare) = self.prepare(order, stop)?;
        desk.is_prepared();
        let mut coarse = coarseness(self.expected(order), order.pace);
        let mut before: Option<Arc<ColorImage>> = None;
        loop {
            let is_draft = coarse > 1 && order.pace == Pace::Full;
            if !is_draft && before.is_some() && !desk.may_refine() {
                return Err(RenderError::Cancelled);
            }
            let size = [order.need.width, order.need.height].map(|edge| edge.div_ceil(coarse));
            let is_slow = self.expected(order).is_some_and(|time| time > SHOWN_IN_PARTS);
            let tiles = before
                .filter(|_| is_slow && !is_draft && order.channel == Channel::Color)
                .map(|coarse| Tiles::over(&coarse, size.map(|edge| edge as usize), desk, stop));
            let channels = if is_draft { Channels::of(&[order.channel]) } else { order.need.channels };
            let mut target = self.canvas(size, channels);
            let drawn = self.render(order, &mut target, tiles.as_ref(), stop);
            let target = Arc::new(target);
            self.keep(target.clone());
            let (report, frame) = drawn?;
            let finer = match order.pace {
                Pace::Full => 1,
                Pace::Within(_) => coarseness(self.expected(order), order.pace),
            };
            let bytes = displayed(&target, order.channel);
            let size = size.map(|edge| edge as usize);
            let image = Arc::new(ColorImage::from_rgb(size, bytes.as_flattened()));
            let is_full = finer >= coarse;
            let target =
                if is_full { stretched(target, order.need.width, order.need.height) } else { target };
            let decisions = if report.objects.is_empty() { prepared.objects.clone() } else { report.objects };
            let painting = Painting {
                backend: order.backend.clone(),
                image: image.clone(),
                framebuffer: target,
                is_full,
                prepare,
                frame,
                coarse,
                bytes: prepared.bytes,
                decisions,
            };
            desk.tell(stop, News::Painting(painting));
            if is_full {
                return Ok(());
            }
            (coarse, before) = (finer, Some(image));
        }
    }

    fn prepare(&mut self, order: &Order, stop: &AtomicBool) -> Result<(Prepared, Duration), RenderError> {
        let Some((_, renderer)) = &mut self.renderer else { return Err(RenderError::NotPrepared) };
        let converter = &self.converter;
        let (prepared, time) =
            self.hands.lend(stop, |control| renderer.prepare(&order.scene, &order.need, converter, &control));
        Ok((prepared?, time))
    }

    /// Returns a picture to be drawn over.
    fn canvas(&mut self, [width, height]: [u32; 2], channels: Channels) -> Framebuffer {
        let is_free = |drawn: &Arc<Framebuffer>| {
            Arc::strong_count(drawn) == 1
                && (drawn.width(), drawn.height(), drawn.channels()) == (width, height, channels)
        };
        let free = self.drawn.iter().position(is_free).and_then(|at| self.drawn.remove(at));
        free.and_then(Arc::into_inner).unwrap_or_else(|| Framebuffer::new(width, height, channels))
    }

    /// Keeps a picture to be drawn over when nobody looks at it any more.
    fn keep(&mut self, drawn: Arc<Framebuffer>) {
        self.drawn.push_back(drawn);
        if self.drawn.len() > KEPT {
            self.drawn.pop_front();
        }
    }

    /// Draws a picture, and learns from it how long one takes.
    fn render(
        &mut self,
        order: &Order,
        target: &mut Framebuffer,
        tiles: Option<&Tiles<'_>>,
        stop: &AtomicBool,
    ) -> Result<(Report, Duration), RenderError> {
        let Some((_, renderer)) = &mut self.renderer else { return Err(RenderError::NotPrepared) };
        let pixels = f64::from(target.width()) * f64::from(target.height());
        let begin = Instant::now();
        let (report, frame) = self.hands.lend(stop, |control| {
            let control = match tiles {
                Some(tiles) => control.watched_by(tiles),
                None => control,
            };
            renderer.render(&order.need.frame(), target, &control)
        });
        let report = report?;
        let [wall, worked] = [begin.elapsed(), frame].map(|time| time.as_secs_f64() / pixels.max(1.0));
        self.cost = Some(Cost { wall, worked });
        Ok((report, frame))
    }

    /// Returns how long the full picture is expected to take: with the turns of others where they hold up who looks at
    /// it, without where back ends get the same time. Nothing before the first one.
    fn expected(&self, order: &Order) -> Option<Duration> {
        let pixels = f64::from(order.need.width) * f64::from(order.need.height);
        let share = self.cost.map(|cost| match order.pace {
            Pace::Full => cost.wall,
            Pace::Within(_) => cost.worked,
        });
        share.map(|cost| Duration::from_secs_f64(cost * pixels))
    }
}

/// Returns how many pixels of the window the first picture of an order has for one that is drawn, along an edge.
///
/// A back end that nobody has timed yet begins coarse: it may be a slow one.
fn coarseness(expected: Option<Duration>, pace: Pace) -> u32 {
    let budget = match pace {
        Pace::Full => BUDGET,
        Pace::Within(time) => time.max(Duration::from_micros(100)),
    };
    let ratio = expected.map_or(f64::from(COARSEST * COARSEST), |t| t.as_secs_f64() / budget.as_secs_f64());
    (ratio.sqrt().ceil() as u32).clamp(1, COARSEST)
}

/// Draws a picture out to a larger size, so that it can be held against others of that size.
fn stretched(picture: Arc<Framebuffer>, width: u32, height: u32) -> Arc<Framebuffer> {
    let (w, h) = (picture.width(), picture.height());
    if (w, h) == (width, height) || w == 0 || h == 0 {
        return picture;
    }
    let mut large = Framebuffer::new(width, height, picture.channels());
    let mut band = large.band();
    for y in 0..height {
        for x in 0..width {
            let at = (y * h / height) as usize * w as usize + (x * w / width) as usize;
            band.put(x, y, &pixel(&picture, at));
        }
    }
    Arc::new(large)
}

/// Returns what a pixel of a picture holds; what it does not hold is as in the background.
fn pixel(picture: &Framebuffer, at: usize) -> Pixel {
    let empty = Pixel::background(glam::Vec3::ZERO);
    Pixel {
        color: picture.color().get(at).copied().unwrap_or(empty.color),
        distance: picture.distance().get(at).copied().unwrap_or(empty.distance),
        normal: picture.normal().get(at).copied().unwrap_or(empty.normal),
        id: picture.id().get(at).copied().unwrap_or(empty.id),
        albedo: picture.albedo().get(at).copied().unwrap_or(empty.albedo),
        shadow: picture.shadow().get(at).copied().unwrap_or(empty.shadow),
        coverage: picture.coverage().get(at).copied().unwrap_or(empty.coverage),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_back_ends_begin_coarse() {
        let full = |ms| coarseness(Some(Duration::from_millis(ms)), Pace::Full);
        assert_eq!(coarseness(None, Pace::Full), COARSEST);
        assert_eq!([full(10), full(100), full(100_000)], [1, 2, COARSEST]);
        let tight = Pace::Within(Duration::from_millis(5));
        assert_eq!(coarseness(Some(Duration::from_millis(20)), tight), 2, "a quarter of the pixels fits");
    }

    #[test]
    fn pictures_that_nobody_looks_at_are_drawn_over() {
        let mut easel = Easel::new(Registry::default(), Arc::new(Converter::default()), Crew::default());
        let (size, channels) = ([4, 3], Channels::COLOR);
        let shown = Arc::new(easel.canvas(size, channels));
        let place = |picture: &Framebuffer| picture.color().as_ptr();
        easel.keep(shown.clone());
        let other = easel.canvas(size, channels);
        assert_ne!(place(&other), place(&shown), "it is looked at");
        let before = place(&shown);
        drop(shown);
        assert_eq!(easel.canvas([3, 4], channels).width(), 3);
        assert_eq!(place(&easel.canvas(size, channels)), before);
        (0..9).for_each(|edge| easel.keep(Arc::new(Framebuffer::new(edge, 1, channels))));
        assert_eq!(easel.drawn.len(), KEPT);
    }

    #[test]
    fn enlarged_pictures_hold_the_same_values() {
        let mut small = Framebuffer::new(2, 1, Channels::ALL);
        small.band().put(1, 0, &Pixel { id: 7, distance: 2.0, ..Pixel::background(glam::Vec3::ONE) });
        let large = stretched(Arc::new(small), 5, 3);
        assert_eq!((large.width(), large.height()), (5, 3));
        let ids: Vec<_> = large.id()[10..].to_vec();
        assert_eq!(ids, [0, 0, 0, 7, 7]);
        assert_eq!(large.distance()[4], 2.0);
    }
}
