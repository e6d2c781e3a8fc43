//! What a back end says of itself.

use super::parameter::Parameter;
use crate::framebuffer::Channels;
use crate::scene::ShapeKind;

/// What a back end says of itself before it has seen a scene.
#[derive(Clone, Debug)]
pub struct BackendInfo {
    /// Short name on the command line: `raster`.
    pub id: String,
    /// Name for people.
    pub name: String,
    /// Its version.
    pub version: String,
    /// Shapes that it draws as given; all others are converted by the host's converter.
    pub native: Vec<ShapeKind>,
    /// Channels that it can deliver.
    pub channels: Channels,
    /// Whether its colors are meant to be those of the lighting equation; a stylized picture is not.
    pub photometric: bool,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
}

impl BackendInfo {
    /// Tells whether a kind of shape is drawn as given.
    #[must_use]
    pub fn draws(&self, kind: ShapeKind) -> bool {
        self.native.contains(&kind)
    }
}
