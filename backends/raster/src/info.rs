//! What does the back end say of itself, and what can be set?

use crate::smooth;
use polyptych_core::framebuffer::Channels;
use polyptych_core::scene::{LightingModel, ShapeKind};
use polyptych_core::seam::{BackendInfo, Need, Parameter, ParameterKind, Value};

/// The parameters of a need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Options {
    pub(crate) map_size: u32,
    /// Nothing for what suits texels and pixels.
    pub(crate) tier: Option<Tier>,
    pub(crate) samples: u32,
    pub(crate) mode: Mode,
    pub(crate) shading: Shading,
    /// Nothing for that of the scene.
    pub(crate) lighting: Option<LightingModel>,
    pub(crate) culls_back: bool,
    /// Whether meshes are drawn with no more triangles than the tolerance asks for.
    pub(crate) spares_triangles: bool,
}

/// What a picture shows of surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    /// Light, and what blocks it.
    Shadowed,
    /// Light that nothing blocks.
    Lit,
    /// Edges that no surface hides.
    HiddenLine,
    /// All edges.
    Wireframe,
}

/// How shadows are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tier {
    /// By depths in a map; see [`plain`](crate::plain).
    Plain,
    /// By triangles that a map names; see [`lookup`](crate::lookup).
    Id,
    /// By all triangles on the way to the light; see [`exact`](crate::exact).
    Exact,
}

/// Where on a triangle light is reckoned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shading {
    /// At each pixel, with the normal interpolated between the corners.
    Phong,
    /// At the corners, interpolated between them.
    Gouraud,
    /// At each pixel, with the triangle's own normal.
    Flat,
}

const MODES: [(&str, Mode); 4] = [
    ("shadowed", Mode::Shadowed),
    ("lit", Mode::Lit),
    ("hidden-line", Mode::HiddenLine),
    ("wireframe", Mode::Wireframe),
];
const TIERS: [(&str, Option<Tier>); 4] =
    [("id", Some(Tier::Id)), ("plain", Some(Tier::Plain)), ("exact", Some(Tier::Exact)), ("auto", None)];
const SHADINGS: [(&str, Shading); 3] =
    [("phong", Shading::Phong), ("gouraud", Shading::Gouraud), ("flat", Shading::Flat)];
const LIGHTINGS: [(&str, Option<LightingModel>); 4] = [
    ("scene", None),
    ("lambert", Some(LightingModel::Lambert)),
    ("phong", Some(LightingModel::Phong)),
    ("blinn-phong", Some(LightingModel::BlinnPhong)),
];

impl Mode {
    /// Tells whether edges are drawn instead of light.
    pub(crate) fn draws_lines(self) -> bool {
        matches!(self, Self::HiddenLine | Self::Wireframe)
    }
}

impl Options {
    pub(crate) fn of(need: &Need, info: &BackendInfo) -> Self {
        let (settings, declared) = (&need.settings, &info.parameters);
        Self {
            map_size: settings.int(declared, "shadow.map_size").clamp(256, 8192) as u32,
            tier: named(&TIERS, settings.text(declared, "shadow.tier")),
            samples: need.samples.max(settings.int(declared, "samples") as u32).clamp(1, smooth::MOST),
            mode: named(&MODES, settings.text(declared, "mode")),
            shading: named(&SHADINGS, settings.text(declared, "shading")),
            lighting: named(&LIGHTINGS, settings.text(declared, "lighting")),
            culls_back: settings.text(declared, "cull") == "back",
            spares_triangles: settings.text(declared, "triangles") == "needed",
        }
    }
}

/// Returns what a word stands for; the first of all for words that are not declared.
fn named<T: Copy>(all: &[(&str, T)], word: &str) -> T {
    all.iter().find(|(name, _)| *name == word).unwrap_or(&all[0]).1
}

/// Declares a choice, the first word its default.
fn choice(name: &'static str, choices: &'static [&'static str], help: &'static str) -> Parameter {
    Parameter {
        name,
        kind: ParameterKind::Choice { choices },
        default: Value::Text(choices[0].to_owned()),
        unit: "",
        help,
        tag: "",
        quality_axis: false,
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
                name: "samples",
                kind: ParameterKind::Int { min: 1, max: smooth::MOST as i64 },
                default: Value::Int(1),
                unit: "",
                help: "Places in a pixel that are looked at for edges; each triangle of a pixel is shaded once",
                tag: "samples",
                quality_axis: true,
            },
            choice(
                "shadow.tier",
                &["id", "plain", "exact", "auto"],
                "How shadows are found: by triangles that a map names, by depths in a map with soft edges of a texel, by \
                 all triangles on the way, or exactly where texels are larger than pixels",
            ),
            choice(
                "mode",
                &["shadowed", "lit", "hidden-line", "wireframe"],
                "Light with shadows or without them, edges that nothing hides, or all edges",
            ),
            choice(
                "shading",
                &["phong", "gouraud", "flat"],
                "Light at each pixel, at the corners and interpolated, or one normal for a triangle",
            ),
            choice(
                "lighting",
                &["scene", "lambert", "phong", "blinn-phong"],
                "How highlights are reckoned: as the scene says, none, by the reflected ray, by the half-way vector",
            ),
            choice(
                "cull",
                &["none", "back"],
                "Which sides of triangles are left out; none is right for open meshes",
            ),
            choice(
                "triangles",
                &["all", "needed"],
                "Whether meshes are drawn as given, or with as few triangles as stay within the tolerance: that takes a \
                 second a million once, and pays for itself where many frames are drawn",
            ),
        ],
    }
}
