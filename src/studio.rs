//! How does a program draw a picture with a back end chosen at run time?

use crate::convert::Converter;
use crate::framebuffer::Framebuffer;
use crate::parallel::Pool;
use crate::scene::Scene;
use crate::seam::{Control, Frame, Need, Prepared, Registry, RenderError, Renderer, Report, UnknownBackend};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// A place to draw: back ends, threads, and conversions that they share.
///
/// Renderers are kept between pictures, so that drawing a scene again, or after an edit, costs what changed.
pub struct Studio {
    registry: Registry,
    pool: Pool,
    converter: Converter,
    renderers: BTreeMap<String, Box<dyn Renderer>>,
}

/// A finished picture.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The picture.
    pub framebuffer: Framebuffer,
    /// What was built before.
    pub prepared: Prepared,
    /// What was done for this picture.
    pub report: Report,
    /// Time to prepare, milliseconds.
    pub prepare_ms: f64,
    /// Time to draw, milliseconds.
    pub frame_ms: f64,
}

/// Why nothing was drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum StudioError {
    #[error(transparent)]
    Unknown(#[from] UnknownBackend),
    #[error("{backend}: {error}")]
    Render { backend: String, error: RenderError },
    #[error("{0}")]
    Threads(String),
}

impl Studio {
    /// Opens a studio with a number of threads; 0 means one for each core.
    ///
    /// # Errors
    /// When the threads cannot be started.
    pub fn new(registry: Registry, threads: usize) -> Result<Self, StudioError> {
        Ok(Self::with_pool(registry, Pool::new(threads).map_err(StudioError::Threads)?))
    }

    /// Opens a studio whose threads stay each on a core of its own where that is possible, for measuring.
    ///
    /// # Errors
    /// When the threads cannot be started.
    pub fn pinned(registry: Registry, threads: usize) -> Result<Self, StudioError> {
        Ok(Self::with_pool(registry, Pool::pinned(threads).map_err(StudioError::Threads)?))
    }

    fn with_pool(registry: Registry, pool: Pool) -> Self {
        Self { registry, pool, converter: Converter::default(), renderers: BTreeMap::new() }
    }

    /// Returns the back ends.
    #[must_use]
    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    /// Returns the threads.
    #[must_use]
    pub fn pool(&self) -> &Pool {
        &self.pool
    }

    /// Returns the shared conversions.
    #[must_use]
    pub fn converter(&self) -> &Converter {
        &self.converter
    }

    /// Returns a back end's renderer, made at the first call.
    ///
    /// # Errors
    /// When there is no back end of that name.
    pub fn renderer(&mut self, backend: &str) -> Result<&mut Box<dyn Renderer>, StudioError> {
        if !self.renderers.contains_key(backend) {
            self.renderers.insert(backend.to_owned(), self.registry.create(backend)?);
        }
        Ok(self.renderers.get_mut(backend).expect("the renderer was just put there"))
    }

    /// Builds what a picture needs, without drawing. Returns what was built and the milliseconds it took.
    ///
    /// # Errors
    /// When there is no such back end, or a required object cannot be drawn.
    pub fn prepare(
        &mut self,
        backend: &str,
        scene: &Arc<Scene>,
        need: &Need,
    ) -> Result<(Prepared, f64), StudioError> {
        let mut renderer = self.take(backend)?;
        let (pool, converter) = (&self.pool, &self.converter);
        let begin = Instant::now();
        let result = pool.install(|| renderer.prepare(scene, need, converter, &Control::new(pool)));
        let time = milliseconds(begin);
        self.renderers.insert(backend.to_owned(), renderer);
        result.map(|prepared| (prepared, time)).map_err(|error| render_error(backend, error))
    }

    /// Draws what was prepared into a picture. Returns what was done and the milliseconds it took. The picture is drawn
    /// even where it shows the same already, so that the time is that of drawing.
    ///
    /// # Errors
    /// When there is no such back end, or nothing was prepared.
    pub fn render(
        &mut self,
        backend: &str,
        frame: &Frame,
        target: &mut Framebuffer,
    ) -> Result<(Report, f64), StudioError> {
        let mut renderer = self.take(backend)?;
        let pool = &self.pool;
        target.touch();
        let begin = Instant::now();
        let result = pool.install(|| renderer.render(frame, target, &Control::new(pool)));
        let time = milliseconds(begin);
        self.renderers.insert(backend.to_owned(), renderer);
        result.map(|report| (report, time)).map_err(|error| render_error(backend, error))
    }

    /// Prepares and draws a picture.
    ///
    /// # Errors
    /// When there is no such back end, or a required object cannot be drawn.
    pub fn draw(&mut self, backend: &str, scene: &Arc<Scene>, need: &Need) -> Result<Drawing, StudioError> {
        let (prepared, prepare_ms) = self.prepare(backend, scene, need)?;
        let mut framebuffer = Framebuffer::new(need.width, need.height, need.channels);
        let (report, frame_ms) = self.render(backend, &need.frame(), &mut framebuffer)?;
        Ok(Drawing { framebuffer, prepared, report, prepare_ms, frame_ms })
    }

    /// Takes a renderer out, so that it can be lent to the pool while the rest of the studio is read.
    fn take(&mut self, backend: &str) -> Result<Box<dyn Renderer>, StudioError> {
        match self.renderers.remove(backend) {
            Some(renderer) => Ok(renderer),
            None => Ok(self.registry.create(backend)?),
        }
    }
}

fn milliseconds(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}

fn render_error(backend: &str, error: RenderError) -> StudioError {
    StudioError::Render { backend: backend.to_owned(), error }
}
