//! What is to be drawn?

use polyptych::framebuffer::Channel;
use polyptych::scene::Scene;
use polyptych::seam::Need;
use std::sync::Arc;
use std::time::Duration;

/// What is to be drawn.
#[derive(Clone)]
pub(crate) struct Order {
    pub(crate) backend: String,
    pub(crate) scene: Arc<Scene>,
    /// Camera, size, settings, and the channels of the full picture.
    pub(crate) need: Need,
    /// The channel that is looked at.
    pub(crate) channel: Channel,
    pub(crate) pace: Pace,
}

/// How long a picture may take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Pace {
    /// As long as its full size takes; a coarse one comes first.
    #[default]
    Full,
    /// So long, with as many pixels as can be drawn in that time.
    Within(Duration),
}

impl Order {
    /// Tells whether both would give the same picture.
    pub(crate) fn is(&self, other: &Self) -> bool {
        self.is_but_for_camera(other)
            && (self.channel, self.pace) == (other.channel, other.pace)
            && self.need.camera == other.need.camera
    }

    /// Tells whether both ask for the same to be prepared: what is prepared for a camera serves all.
    pub(crate) fn is_but_for_camera(&self, other: &Self) -> bool {
        let (a, b) = (&self.need, &other.need);
        Arc::ptr_eq(&self.scene, &other.scene)
            && self.backend == other.backend
            && (a.width, a.height, a.channels, a.tolerance_px, a.samples, &a.settings)
                == (b.width, b.height, b.channels, b.tolerance_px, b.samples, &b.settings)
    }
}
