//! What is wanted of a picture: from this a back end decides what to build, and builds no more.

use super::parameter::Settings;
use crate::camera::Camera;
use crate::framebuffer::Channels;
use crate::math::Aabb;

/// What is wanted of a picture.
#[derive(Clone, Debug)]
pub struct Need {
    /// From where.
    pub camera: Camera,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Channels that will be asked for.
    pub channels: Channels,
    /// How far an edge may be off, in pixels.
    pub tolerance_px: f64,
    /// Samples a pixel for the color.
    pub samples: u32,
    /// Parameters of the back end.
    pub settings: Settings,
}

impl Need {
    /// Builds a need for one color sample a pixel, edges true to half a pixel, and default settings.
    #[must_use]
    pub fn new(camera: Camera, width: u32, height: u32) -> Self {
        Self {
            camera,
            width,
            height,
            channels: Channels::COLOR,
            tolerance_px: 0.5,
            samples: 1,
            settings: Settings::default(),
        }
    }

    /// Returns the world-space error that stays under the tolerance for everything in a box: the size of the
    /// tolerance where the box is nearest to the eye. An eye inside takes a thousandth of the box instead of 0.
    #[must_use]
    pub fn world_tolerance(&self, bounds: &Aabb) -> f64 {
        let eye = self.camera.eye;
        let nearest = eye.distance(eye.clamp(bounds.min, bounds.max));
        let distance = nearest.max(bounds.radius() * 1e-3);
        self.tolerance_px * self.camera.view(self.width, self.height).pixel_size(distance)
    }

    /// Returns the frame that was needed.
    #[must_use]
    pub fn frame(&self) -> Frame {
        Frame { camera: self.camera.clone() }
    }
}

/// One picture to be drawn of what was prepared; size and channels are the target's.
#[derive(Clone, Debug)]
pub struct Frame {
    /// From where.
    pub camera: Camera,
}
