//! The one trait of a back end.

use super::control::{Cancelled, Control};
use super::info::BackendInfo;
use super::need::{Frame, Need};
use super::plan::{Decision, Plan};
use super::report::Report;
use crate::convert::{ConvertError, Converter};
use crate::framebuffer::Framebuffer;
use crate::scene::Scene;
use std::sync::Arc;

/// A back end: draws any scene by its method, and says what it did.
///
/// Promises that the conformance suite holds every back end to: the same input gives the same bytes, whatever
/// the number of threads; nothing is left out or replaced without standing in the report; `render` reads only
/// what `prepare` built and allocates nothing once a frame of that size and scene has been drawn; after
/// [`Cancelled`] the next call works.
pub trait Renderer: Send {
    /// Returns what the back end says of itself.
    fn info(&self) -> &BackendInfo;

    /// Says what would be built for a need, and builds nothing.
    fn plan(&self, scene: &Scene, need: &Need) -> Plan;

    /// Builds what a need asks of a scene; what an earlier call built and is still right is kept.
    ///
    /// # Errors
    /// When a required object cannot be drawn, or the host cancelled.
    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Prepared, RenderError>;

    /// Returns the scene as it is drawn, converted shapes in place of the given ones, so that the method can be
    /// held against the reference on its own model. Nothing where every shape is drawn as given, or where the
    /// model is no [`crate::scene::Shape`].
    fn model(&self) -> Option<Arc<Scene>> {
        None
    }

    /// Draws what was prepared into the target's channels. The camera may differ from the one that was needed.
    ///
    /// # Errors
    /// When nothing was prepared, or the host cancelled; the target then holds the finished parts.
    fn render(
        &mut self,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError>;
}

/// What `prepare` did.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    /// How each object of the scene will be drawn, in order.
    pub objects: Arc<[Decision]>,
    /// Bytes held for the scene.
    pub bytes: u64,
}

/// Why a back end could not draw.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum RenderError {
    #[error("cancelled")]
    Cancelled,
    #[error("nothing was prepared: call `prepare` before `render`")]
    NotPrepared,
    #[error("object `{object}` is required but {reason}")]
    Required { object: String, reason: String },
    #[error("{0}")]
    Failed(String),
}

impl From<Cancelled> for RenderError {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

impl From<ConvertError> for RenderError {
    fn from(error: ConvertError) -> Self {
        match error {
            ConvertError::Cancelled => Self::Cancelled,
            other @ ConvertError::Impossible { .. } => Self::Failed(other.to_string()),
        }
    }
}
