//! The seam between hosts and back ends: one trait, and data on both sides of it.

mod control;
mod demand;
mod info;
mod need;
mod parameter;
mod plan;
mod registry;
mod renderer;
mod report;
mod survey;

pub use control::{Cancelled, Control, Probe, Watcher};
pub use demand::{Demand, Surfaces, blocks_light, broken_triangles, detail, left_out, why_not_drawn};
pub use info::BackendInfo;
pub use need::{Frame, Need};
pub use parameter::{Parameter, ParameterError, ParameterKind, Settings, Value};
pub use plan::{Decision, ObjectPlan, PassPlan, Plan};
pub use registry::{BackendFactory, Origin, Registry, UnknownBackend};
pub use renderer::{Prepared, RenderError, Renderer};
pub use report::{Counter, Phases, Report};
pub use survey::Survey;
