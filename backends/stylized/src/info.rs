//! What does the shader say of itself, and what can be set?

use crate::preset::STYLES;
use crate::stroke::Kind;
use polyptych_core::framebuffer::Channels;
use polyptych_core::seam::{BackendInfo, Parameter, ParameterKind, Value};

/// Back ends that may deliver the visible surfaces; the first is the default.
const VISIBILITY: &[&str] = &["raster", "voxel", "freeform", "reference"];

pub(crate) fn info() -> BackendInfo {
    BackendInfo {
        id: "stylized".to_owned(),
        name: "Stylized shader".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        native: Vec::new(),
        channels: Channels::ALL,
        photometric: false,
        parameters: parameters(),
    }
}

/// Declares all parameters. Defaults are those of the first preset; what is not set comes from the preset.
pub(crate) fn parameters() -> Vec<Parameter> {
    let visibility = Parameter {
        quality_axis: true,
        ..choice("visibility", VISIBILITY, VISIBILITY[0], "back end that finds the visible surfaces")
    };
    let mut all = vec![
        visibility,
        text("visibility.other", "id of any other back end that finds them: a plugin"),
        choice("preset", STYLES, STYLES[0], "style that gives every value that is not set"),
        text("style", "file of a style (.ron) in place of the preset"),
        text("styles", "styles of single objects: object=preset, object=file.ron, ..."),
    ];
    all.extend(tone());
    all.extend(hatching());
    all.extend(contours());
    all.extend(vec![
        switch("paper", false, "whether the background is paper in place of the scene's"),
        color("paper.color", "#f4efe4", "color of paper"),
        share("paper.grain", 0.0, "how much the paper's grain shows, on surfaces too"),
        float(
            "paper.grid",
            (0.0, 400.0),
            0.0,
            "pixels",
            "distance of lines printed on the paper; 0 has none",
        ),
        choice("show", &["style", "depth", "normals"], "style", "what is drawn, for study"),
        switch("wireframe", false, "whether the edges of all triangles are laid over"),
        color("wireframe.color", "#3a7bd5", "color of these"),
        choice(
            "cull",
            &["none", "back"],
            "none",
            "which sides of triangles are left out, where visibility can",
        ),
    ]);
    all
}

fn tone() -> Vec<Parameter> {
    vec![
        color("tone.cool", "#22345e", "color away from the light"),
        color("tone.warm", "#c9a35c", "color toward the light"),
        share("tone.alpha", 0.25, "share of the own color on the cool side"),
        share("tone.beta", 0.6, "share of the own color on the warm side"),
        int("tone.steps", (1, 32), 1, "steps", "steps of the color's length; 1 leaves it smooth"),
        switch("shadow", true, "whether shadows darken the tone"),
        float("shadow.depth", (-1.0, 1.0), 0.0, "", "cosine to the light that a shadow counts as"),
        choice("specular", &["off", "soft", "hard"], "soft", "highlights, and how their edge is"),
        float("specular.strength", (0.0, 4.0), 1.0, "", "factor of the material's highlight"),
        color("specular.color", "#ffffff", "color of highlights"),
    ]
}

fn hatching() -> Vec<Parameter> {
    let sets = &["off", "pencil", "ink", "dots", "images"];
    vec![
        choice("hatch", sets, "off", "strokes laid over dark tones"),
        text(
            "hatch.images",
            "pictures of the levels from light to dark, separated by commas, for hatch=images",
        ),
        text(
            "hatch.thresholds",
            "darkness from which each level is laid on, separated by commas; empty spreads them",
        ),
        choice("hatch.mapping", &["triplanar", "uv", "screen"], "triplanar", "what strokes stick to"),
        float("hatch.scale", (0.05, 20.0), 1.0, "", "size of the strokes' pattern on the surface"),
        float("hatch.width", (0.25, 8.0), 1.2, "pixels", "width of strokes, near and far"),
        color("hatch.color", "#2b2a2e", "color of strokes"),
        share("hatch.own", 0.0, "share of the surface's own color in that of strokes"),
        share("hatch.opacity", 1.0, "how much strokes cover"),
        share("hatch.texture", 0.0, "how much dark surfaces are hatched for being dark"),
    ]
}

fn contours() -> Vec<Parameter> {
    let mut all = vec![
        switch("contours", true, "whether lines are drawn"),
        choice("contours.hidden", &["omit", "dash"], "omit", "lines behind surfaces (of meshes)"),
    ];
    for (kind, drawn, width, help) in [
        (Kind::Silhouette, true, 2.0, "lines where a body ends before what is behind"),
        (Kind::Crease, true, 1.2, "lines along folds"),
        (Kind::Border, true, 1.6, "lines along open edges"),
        (Kind::Material, false, 1.0, "lines between materials of one body"),
        (Kind::Intersection, true, 1.2, "lines where bodies cross"),
    ] {
        let [name, ink, size] = kind.parameters();
        all.push(switch(name, drawn, help));
        all.push(color(ink, "#1a1614", "color of these"));
        all.push(float(size, (0.25, 12.0), width, "pixels", "width of these"));
    }
    all.push(float("crease.angle", (1.0, 180.0), 40.0, "degrees", "angle from which on a fold has a line"));
    all
}

fn parameter(
    name: &'static str,
    kind: ParameterKind,
    default: Value,
    unit: &'static str,
    help: &'static str,
) -> Parameter {
    Parameter { name, kind, default, unit, help, tag: "", quality_axis: false }
}

fn switch(name: &'static str, on: bool, help: &'static str) -> Parameter {
    parameter(name, ParameterKind::Bool, Value::Bool(on), "", help)
}

fn choice(
    name: &'static str,
    choices: &'static [&'static str],
    default: &str,
    help: &'static str,
) -> Parameter {
    parameter(name, ParameterKind::Choice { choices }, Value::Text(default.to_owned()), "", help)
}

fn color(name: &'static str, default: &str, help: &'static str) -> Parameter {
    parameter(name, ParameterKind::Color, Value::Text(default.to_owned()), "", help)
}

fn text(name: &'static str, help: &'static str) -> Parameter {
    parameter(name, ParameterKind::Text, Value::Text(String::new()), "", help)
}

fn float(
    name: &'static str,
    (min, max): (f64, f64),
    default: f64,
    unit: &'static str,
    help: &'static str,
) -> Parameter {
    parameter(name, ParameterKind::Float { min, max }, Value::Float(default), unit, help)
}

fn share(name: &'static str, default: f64, help: &'static str) -> Parameter {
    float(name, (0.0, 1.0), default, "", help)
}

fn int(
    name: &'static str,
    (min, max): (i64, i64),
    default: i64,
    unit: &'static str,
    help: &'static str,
) -> Parameter {
    parameter(name, ParameterKind::Int { min, max }, Value::Int(default), unit, help)
}
