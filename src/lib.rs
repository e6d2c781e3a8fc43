//! Renders one scene through several back ends, side by side, and tells how fast and how right each one is.
//!
//! ```
//! use polyptych::prelude::*;
//!
//! let mut scene = Scene::default();
//! let red = scene.add_material(Material::new(Vec3::new(0.8, 0.1, 0.1)));
//! scene.objects.push(Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), red));
//! scene.lights.push(Light::directional(DVec3::new(-1.0, -2.0, -1.5)));
//! let camera = Camera::framing(&scene.bounds(), 0.5, 0.3, 1.5, Projection::Perspective { fov_y: 0.7 });
//!
//! let mut studio = Studio::new(Registry::builtin(), 2)?;
//! let picture = studio.draw("raster", &scene.into(), &Need::new(camera, 48, 32))?;
//! assert!(picture.framebuffer.color()[16 * 48 + 24].x > 0.1, "the ball is in the middle");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use polyptych_core::{
    camera, convert, framebuffer, load, math, metrics, parallel, pixels, scene, seam, shade, stream,
};

pub mod animate;
pub mod auto;
pub mod builtin;
pub mod chart;
pub mod compare;
pub mod conformance;
pub mod export;
pub mod pace;
pub mod picture;
pub mod plugins;
pub mod report;
pub mod stability;
pub mod vector;

mod registry;
mod studio;

pub use polyptych_stylized as stylized;
pub use registry::BuiltinBackends;
pub use studio::{Drawing, Studio, StudioError};

/// What most programs need.
pub mod prelude {
    pub use crate::camera::{Camera, Projection};
    pub use crate::framebuffer::{Channel, Channels, Framebuffer};
    pub use crate::plugins::PluginBackends;
    pub use crate::scene::{
        Background, Environment, Form, FreeForm, HeightField, Light, Material, Mesh, Object, Primitive,
        Scene, Shape, Texture, Volume, Voxels,
    };
    pub use crate::seam::{Need, Registry, Renderer, Settings};
    pub use crate::{BuiltinBackends, Drawing, Studio};
    pub use glam::{DAffine3, DQuat, DVec2, DVec3, Vec3};
}
