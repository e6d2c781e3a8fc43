//! Does the viewer do what its user asks, without a display?

#[path = "../../../tests/common/plugins.rs"]
mod libraries;

mod actions;
mod editing;
mod files;
mod harness;
mod panes;
mod plugins;
mod speed;
