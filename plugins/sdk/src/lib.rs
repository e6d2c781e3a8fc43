//! Writes a back end as a library of its own, in safe Rust.
//!
//! Implement [`Renderer`] as for a built-in back end, and export it with one line:
//!
//! ```
//! use polyptych_plugin::core::seam::{BackendInfo, Control, Frame, Need, Plan, Prepared, RenderError, Report};
//! use polyptych_plugin::core::{convert::Converter, framebuffer::Framebuffer, scene::Scene};
//! use polyptych_plugin::{Renderer, export_backend};
//! use std::sync::Arc;
//!
//! #[derive(Default)]
//! struct Nothing;
//!
//! impl Renderer for Nothing {
//!     // ...
//! #   fn info(&self) -> &BackendInfo { unimplemented!() }
//! #   fn plan(&self, _: &Scene, _: &Need) -> Plan { Plan::default() }
//! #   fn prepare(&mut self, _: &Arc<Scene>, _: &Need, _: &Converter, _: &Control<'_>)
//! #       -> Result<Prepared, RenderError> { Ok(Prepared::default()) }
//! #   fn render(&mut self, _: &Frame, _: &mut Framebuffer, _: &Control<'_>)
//! #       -> Result<Report, RenderError> { Ok(Report::default()) }
//! }
//!
//! export_backend!(Nothing);
//! ```
//!
//! The crate is built as a `cdylib`. `plugins/examples/template` is a whole one to copy.
//!
//! What differs from a built-in back end: there is no registry, so no renderer over another one; the scene has no
//! saved cameras and no notes; the back end must not put another framebuffer in the place of the one it is lent.
//! A panic is caught here, told to the host with its place, and the instance is made anew.

mod host;
mod info;
mod instance;
mod panics;
mod scene;

pub use host::{Severity, log};
pub use info::{Table, table};
pub use polyptych_core as core;
pub use polyptych_core::scene::ShapeKind;
pub use polyptych_core::seam::Renderer;
pub use polyptych_plugin_abi as abi;

/// Exports a type as the library's back end. It must be [`Renderer`] and [`Default`].
///
/// `accepts` lists the kinds of shape that the back end takes; the host converts all others into triangles, or else
/// voxels, before it hands over the scene. Left out, it takes all, and asks the converter itself:
///
/// ```ignore
/// export_backend!(Occlusion, accepts: [Mesh]);
/// ```
#[macro_export]
macro_rules! export_backend {
    ($backend:ty) => {
        $crate::export_backend!(@ $backend, &$crate::ShapeKind::ALL);
    };
    ($backend:ty, accepts: [$($kind:ident),+ $(,)?]) => {
        $crate::export_backend!(@ $backend, &[$($crate::ShapeKind::$kind),+]);
    };
    (@ $backend:ty, $accepts:expr) => {
        /// Returns the table of functions by which the host calls this back end.
        #[allow(unsafe_code, reason = "the one symbol that the host looks for")]
        #[unsafe(no_mangle)]
        pub extern "C" fn polyptych_plugin(
            _host_major: u32,
            _host_minor: u32,
        ) -> *const $crate::abi::PolyptychPlugin {
            static TABLE: std::sync::OnceLock<$crate::Table> = std::sync::OnceLock::new();
            $crate::table::<$backend>(&TABLE, $accepts)
        }
    };
}
