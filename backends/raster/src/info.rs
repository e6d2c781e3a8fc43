//! What does the back end say of itself, and what can be set?

use polyptych_core::framebuffer::Channels;
use polyptych_core::scene::ShapeKind;
use polyptych_core::seam::{BackendInfo, Need, Parameter, ParameterKind, Value};

/// The parameters of a need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Options {
    pub(crate) map_size: u32,
    pub(crate) shadow: bool,
    pub(crate) culls_back: bool,
}

impl Options {
    pub(crate) fn of(need: &Need, info: &BackendInfo) -> Self {
        let (settings, declared) = (&need.settings, &info.parameters);
        Self {
            map_size: settings.int(declared, "shadow.map_size").clamp(256, 8192) as u32,
            shadow: settings.bool(declared, "shadow"),
            culls_back: settings.text(declared, "cull") == "back",
        }
    }
}

pub(crate) fn info() -> BackendInfo {
    BackendInfo {
        id: "raster".to_owned(),
        name: "Rasterizer with shadow maps".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        native: vec![ShapeKind::Mesh],
        channels: Channels::ALL,
        photometric: true,
        parameters: vec![
            Parameter {
                name: "shadow.map_size",
                kind: ParameterKind::Int { min: 256, max: 8192 },
                default: Value::Int(2048),
                unit: "texels",
                help: "Edge of a directional light's shadow map; those of other lights are at most half of it",
                tag: "shadow.quality",
                quality_axis: true,
            },
            Parameter {
                name: "shadow",
                kind: ParameterKind::Bool,
                default: Value::Bool(true),
                unit: "",
                help: "Whether things block light",
                tag: "",
                quality_axis: false,
            },
            Parameter {
                name: "cull",
                kind: ParameterKind::Choice { choices: &["none", "back"] },
                default: Value::Text("none".to_owned()),
                unit: "",
                help: "Which sides of triangles are left out; none is right for open meshes",
                tag: "",
                quality_axis: false,
            },
        ],
    }
}
