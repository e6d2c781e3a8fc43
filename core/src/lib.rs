//! Scene, camera, framebuffer, the renderer seam, shading, conversion, picture metrics and loaders.
//!
//! `polyptych-core` is what every back end shares. It says *what is there* ([`scene`]), *from where it is
//! seen* ([`camera`]), *what a back end promises* ([`seam`]), *how light is reckoned* ([`shade`]), how a shape
//! is turned into another representation when a back end cannot draw it as given ([`convert`]), and how two
//! pictures are compared ([`metrics`]). It knows no back end, no window and no dynamic loading.
//!
//! Conventions: right-handed, y up; meters, radians, linear light (sRGB only in files and on the screen);
//! pixel centers at .5, row 0 at the top; matrices are named by what they map (`world_from_object`);
//! `f32` in pictures, `f64` where positions are set up.

pub mod camera;
pub mod convert;
pub mod framebuffer;
pub mod lanes;
pub mod load;
pub mod math;
pub mod metrics;
pub mod parallel;
pub mod pixels;
pub mod projector;
pub mod registers;
pub mod scene;
pub mod seam;
pub mod shade;
pub mod stream;
