//! What do the values of parameters mean for a picture?

use crate::hatch::{HatchError, Hatching};
use crate::preset::{Preset, StyleError};
use crate::stroke::{Kind, Pen};
use crate::tone::Tone;
use glam::Vec3;
use polyptych_core::framebuffer::{Channel, Channels};
use polyptych_core::seam::{Parameter, Settings};
use std::sync::Arc;

/// Most styles in one picture: their number shares a byte with the kind of a line.
pub(crate) const MOST_STYLES: usize = 31;

/// How highlights are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Highlight {
    Off,
    Soft,
    Hard,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Show {
    Style,
    Depth,
    Normals,
}

/// Paper under a drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Paper {
    /// Whether it takes the place of the background.
    pub(crate) is_shown: bool,
    pub(crate) color: Vec3,
    pub(crate) grain: f32,
    /// Pixels between printed lines, 0 for none.
    pub(crate) grid: f32,
}

/// Everything of a style that parameters set.
#[derive(Clone, Debug)]
pub(crate) struct Style {
    pub(crate) tone: Tone,
    pub(crate) shadow: bool,
    pub(crate) shadow_depth: f32,
    pub(crate) highlight: Highlight,
    pub(crate) highlight_color: Vec3,
    pub(crate) hatching: Option<Arc<Hatching>>,
    pub(crate) dashes_hidden: bool,
    pub(crate) pens: [Pen; Kind::ALL.len()],
    /// Cosine of the angle from which on a fold has a line.
    pub(crate) crease_cosine: f32,
    pub(crate) paper: Paper,
    pub(crate) show: Show,
}

impl Style {
    /// Reads a style from values that are all set or have their defaults. Hatching is baked unless `before` has it.
    pub(crate) fn of(
        settings: &Settings,
        declared: &[Parameter],
        before: &[Arc<Hatching>],
    ) -> Result<Self, HatchError> {
        let float = |name: &str| settings.float(declared, name) as f32;
        let is_on = |name: &str| settings.bool(declared, name);
        let contours = is_on("contours");
        let pen = |kind: Kind| {
            let [switch, color, width] = kind.parameters();
            let width = if width.is_empty() { 0.8 } else { float(width) };
            let is_drawn = is_on(switch) && (contours || kind == Kind::Wire);
            Pen { is_drawn, width, color: settings.color(declared, color) }
        };
        Ok(Self {
            tone: Tone {
                cool: settings.color(declared, "tone.cool"),
                warm: settings.color(declared, "tone.warm"),
                alpha: float("tone.alpha"),
                beta: float("tone.beta"),
                steps: settings.int(declared, "tone.steps") as u32,
            },
            shadow: is_on("shadow"),
            shadow_depth: float("shadow.depth"),
            highlight: match settings.text(declared, "specular") {
                "off" => Highlight::Off,
                "hard" => Highlight::Hard,
                _ => Highlight::Soft,
            },
            highlight_color: settings.color(declared, "specular.color") * float("specular.strength"),
            hatching: Hatching::of(settings, declared, before)?,
            dashes_hidden: settings.text(declared, "contours.hidden") == "dash",
            pens: Kind::ALL.map(pen),
            crease_cosine: float("crease.angle").to_radians().cos(),
            paper: Paper {
                is_shown: is_on("paper"),
                color: settings.color(declared, "paper.color"),
                grain: float("paper.grain"),
                grid: float("paper.grid"),
            },
            show: match settings.text(declared, "show") {
                "depth" => Show::Depth,
                "normals" => Show::Normals,
                _ => Show::Style,
            },
        })
    }

    pub(crate) fn pen(&self, kind: Kind) -> &Pen {
        &self.pens[kind as usize]
    }

    /// Tells whether any line is drawn.
    pub(crate) fn draws_lines(&self) -> bool {
        self.pens.iter().any(|pen| pen.is_drawn)
    }

    /// Returns the channels that the style reads.
    pub(crate) fn channels(&self) -> Channels {
        let mut channels = Channels::of(&[Channel::Id]);
        if self.show == Show::Style || self.show == Show::Normals || self.draws_lines() {
            channels = channels.with(Channel::Normal);
        }
        if self.show == Show::Depth || self.draws_lines() || self.hatching.is_some() {
            channels = channels.with(Channel::Distance);
        }
        if self.show == Show::Style {
            channels = channels.with(Channel::Albedo);
            if self.shadow {
                channels = channels.with(Channel::Shadow);
            }
        }
        channels
    }
}

/// The styles of a picture: one for all, and those of single objects.
pub(crate) struct Styles {
    /// The first is that of objects without one of their own.
    pub(crate) all: Vec<Style>,
    /// Index of each object's style.
    pub(crate) of_object: Vec<u8>,
}

impl Styles {
    /// Reads the styles that settings name. `objects` are the names of the scene's objects, in order.
    pub(crate) fn of<'a>(
        settings: &Settings,
        declared: &[Parameter],
        objects: impl Iterator<Item = &'a str>,
        before: &[Arc<Hatching>],
    ) -> Result<Self, StyleError> {
        let refuse =
            |e: HatchError| StyleError::Malformed { place: "hatch".to_owned(), reason: e.to_string() };
        let chosen = Preset::chosen(settings, declared)?.under(settings, declared)?;
        let mut all = vec![Style::of(&chosen, declared, before).map_err(refuse)?];
        let mut named: Vec<(&str, u8)> = Vec::new();
        let pairs = settings.text(declared, "styles");
        for pair in pairs.split(',').map(str::trim).filter(|p| !p.is_empty()) {
            let malformed = |reason: &str| StyleError::Malformed {
                place: format!("styles: `{pair}`"),
                reason: reason.to_owned(),
            };
            let (object, name) = pair.rsplit_once('=').ok_or_else(|| malformed("write object=style"))?;
            if all.len() > MOST_STYLES {
                return Err(malformed("too many styles in one picture"));
            }
            let own = Preset::named(name.trim())?.under(&Settings::default(), declared)?;
            let made: Vec<_> = all.iter().filter_map(|s| s.hatching.clone()).collect();
            let known = [before, &made].concat();
            let mut style = Style::of(&own, declared, &known).map_err(refuse)?;
            // Paper and what is shown belong to the picture.
            (style.paper, style.show) = (all[0].paper, all[0].show);
            named.push((object.trim(), all.len() as u8));
            all.push(style);
        }
        let style_of = |name: &str| named.iter().rev().find(|(n, _)| *n == name).map_or(0, |(_, s)| *s);
        Ok(Self { all, of_object: objects.map(style_of).collect() })
    }

    /// Returns the style of what has an id in a picture.
    #[inline(always)]
    pub(crate) fn index(&self, id: u32) -> u8 {
        self.of_object.get(id.wrapping_sub(1) as usize).copied().unwrap_or(0)
    }

    pub(crate) fn channels(&self) -> Channels {
        self.all.iter().flat_map(|s| s.channels().iter()).fold(Channels::NONE, Channels::with)
    }

    pub(crate) fn draw_lines(&self) -> bool {
        self.all.iter().any(Style::draws_lines)
    }

    /// Tells whether any style draws a kind of line.
    pub(crate) fn draw(&self, kind: Kind) -> bool {
        self.all.iter().any(|s| s.pen(kind).is_drawn)
    }
}
