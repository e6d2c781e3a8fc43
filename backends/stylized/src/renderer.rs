//! The seam: an inner back end for visibility, and the style laid over it.

use crate::contour::{Contours, shows_nothing};
use crate::tone::Tone;
use glam::{DVec3, Vec3};
use polyptych_core::camera::{RowDirections, View};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Band, Channel, Channels, Framebuffer};
use polyptych_core::lanes::LANES;
use polyptych_core::parallel::for_each_mut;
use polyptych_core::scene::{Light, LightKind, Scene};
use polyptych_core::seam::{
    BackendFactory, BackendInfo, Control, Frame, Need, Parameter, ParameterKind, PassPlan, Phases, Plan,
    Prepared, Registry, RenderError, Renderer, Report, Settings, Survey, Value,
};
use polyptych_core::shade::{fogged, highlight};
use std::sync::Arc;

/// Back ends that may deliver the visible surfaces; the first is the default.
const VISIBILITY: &[&str] = &["raster", "voxel", "freeform", "reference"];

/// Rows drawn by one worker at a time.
const ROWS: u32 = 16;

/// Makes [`Stylized`] renderers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl BackendFactory for Factory {
    fn info(&self) -> BackendInfo {
        info()
    }
    fn create(&self, registry: &Registry) -> Box<dyn Renderer> {
        Box::new(Stylized::new(registry.clone()))
    }
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

fn info() -> BackendInfo {
    let color = |text: &str| Value::Text(text.to_owned());
    let share = ParameterKind::Float { min: 0.0, max: 1.0 };
    let choice = ParameterKind::Choice { choices: VISIBILITY };
    BackendInfo {
        id: "stylized".to_owned(),
        name: "Stylized shader".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        native: Vec::new(),
        channels: Channels::ALL,
        photometric: false,
        parameters: vec![
            Parameter {
                quality_axis: true,
                ..parameter(
                    "visibility",
                    choice,
                    color(VISIBILITY[0]),
                    "",
                    "back end that finds the visible surfaces",
                )
            },
            parameter("tone.cool", ParameterKind::Color, color("#2a3f6b"), "", "color away from the light"),
            parameter("tone.warm", ParameterKind::Color, color("#c9a35c"), "", "color toward the light"),
            parameter("tone.alpha", share, Value::Float(0.25), "", "share of the own color on the cool side"),
            parameter("tone.beta", share, Value::Float(0.6), "", "share of the own color on the warm side"),
            parameter(
                "tone.steps",
                ParameterKind::Int { min: 1, max: 32 },
                Value::Int(6),
                "steps",
                "steps of the color's length; 1 leaves it smooth",
            ),
            parameter("specular", ParameterKind::Bool, Value::Bool(true), "", "whether highlights are drawn"),
            parameter(
                "shadow",
                ParameterKind::Bool,
                Value::Bool(true),
                "",
                "whether shadows darken the tone",
            ),
            parameter("contours", ParameterKind::Bool, Value::Bool(true), "", "whether lines are drawn"),
            parameter(
                "contours.width",
                ParameterKind::Float { min: 0.5, max: 8.0 },
                Value::Float(1.5),
                "pixels",
                "width of lines",
            ),
            parameter("contours.color", ParameterKind::Color, color("#1a1614"), "", "color of lines"),
            parameter(
                "contours.crease",
                ParameterKind::Float { min: 1.0, max: 180.0 },
                Value::Float(40.0),
                "degrees",
                "angle from which on a fold has a line",
            ),
        ],
    }
}

/// Everything of a style that parameters set.
#[derive(Clone, Copy, Debug)]
struct Style {
    tone: Tone,
    contours: Contours,
    specular: bool,
    shadow: bool,
}

impl Style {
    fn of(settings: &Settings, declared: &[Parameter]) -> Self {
        let float = |name: &str| settings.float(declared, name) as f32;
        Self {
            tone: Tone {
                cool: settings.color(declared, "tone.cool"),
                warm: settings.color(declared, "tone.warm"),
                alpha: float("tone.alpha"),
                beta: float("tone.beta"),
                steps: settings.int(declared, "tone.steps") as u32,
            },
            contours: Contours {
                drawn: settings.bool(declared, "contours"),
                width: float("contours.width"),
                color: settings.color(declared, "contours.color"),
                crease_cosine: float("contours.crease").to_radians().cos(),
            },
            specular: settings.bool(declared, "specular"),
            shadow: settings.bool(declared, "shadow"),
        }
    }

    /// Channels that the style reads.
    fn channels(&self) -> Channels {
        let base = Channels::of(&[Channel::Distance, Channel::Normal, Channel::Id, Channel::Albedo]);
        if self.shadow { base.with(Channel::Shadow) } else { base }
    }
}

/// The stylized shader.
pub struct Stylized {
    info: BackendInfo,
    registry: Registry,
    inner: Option<(String, Box<dyn Renderer>)>,
    prepared: Option<(Arc<Scene>, Style)>,
    lights: Vec<Light>,
    visible: Framebuffer,
    /// Columns of the edge pixels of each row.
    edges: Vec<Vec<u32>>,
}

impl Stylized {
    /// Makes a renderer that takes its inner back end from a registry.
    #[must_use]
    pub fn new(registry: Registry) -> Self {
        Self {
            info: info(),
            registry,
            inner: None,
            prepared: None,
            lights: Vec::new(),
            visible: Framebuffer::new(0, 0, Channels::NONE),
            edges: Vec::new(),
        }
    }

    fn inner_need(&self, need: &Need) -> Need {
        let style = Style::of(&need.settings, &self.info.parameters);
        let wanted = need.channels.iter().filter(|&c| c != Channel::Color);
        let channels = wanted.fold(style.channels(), Channels::with);
        Need { channels, settings: Settings::default(), ..need.clone() }
    }

    fn create_inner(&self, settings: &Settings) -> Result<(String, Box<dyn Renderer>), RenderError> {
        let id = settings.text(&self.info.parameters, "visibility").to_owned();
        let inner = self.registry.create(&id).map_err(|e| RenderError::Failed(format!("visibility: {e}")))?;
        Ok((id, inner))
    }
}

impl Renderer for Stylized {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, scene: &Scene, need: &Need) -> Plan {
        let Ok((id, inner)) = self.create_inner(&need.settings) else { return Plan::default() };
        let style = Style::of(&need.settings, &self.info.parameters);
        let mut plan = inner.plan(scene, &self.inner_need(need));
        for pass in &mut plan.passes {
            pass.name = format!("{id}: {}", pass.name);
        }
        plan.passes.push(PassPlan {
            name: "tone".to_owned(),
            needed: true,
            why: "two colors by the light".to_owned(),
        });
        plan.passes.push(PassPlan {
            name: "contours".to_owned(),
            needed: style.contours.drawn,
            why: format!("lines are {}", if style.contours.drawn { "on" } else { "off" }),
        });
        // Nanoseconds that a pixel of the background and one of a surface take for tone and lines, on the machine that
        // all back ends' constants were measured on.
        let per_pixel = 8.0 + 35.0 * Survey::of(scene, need).seen;
        plan.estimated_ms += f64::from(need.width) * f64::from(need.height) * per_pixel * 1e-6;
        plan
    }

    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        let id = need.settings.text(&self.info.parameters, "visibility");
        if self.inner.as_ref().is_none_or(|(current, _)| current != id) {
            self.inner = Some(self.create_inner(&need.settings)?);
        }
        let inner_need = self.inner_need(need);
        let (_, inner) = self.inner.as_mut().ok_or(RenderError::NotPrepared)?;
        let prepared = inner.prepare(scene, &inner_need, converter, control)?;
        self.prepared = Some((scene.clone(), Style::of(&need.settings, &self.info.parameters)));
        self.lights = scene.lights.clone();
        Ok(prepared)
    }

    fn render(
        &mut self,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError> {
        let (Some((scene, style)), Some((_, inner))) = (&self.prepared, &mut self.inner) else {
            return Err(RenderError::NotPrepared);
        };
        let mut phases = Phases::start();
        let (width, height) = (target.width(), target.height());
        let wanted = target.channels().iter().filter(|&c| c != Channel::Color);
        let channels = wanted.fold(style.channels(), Channels::with);
        if (self.visible.width(), self.visible.height(), self.visible.channels()) != (width, height, channels)
        {
            self.visible = Framebuffer::new(width, height, channels);
            self.edges = (0..height).map(|_| Vec::with_capacity(width as usize)).collect();
        }
        let report = inner.render(frame, &mut self.visible, control)?;
        phases.end("visibility");
        let view = frame.camera.view(width, height);
        let visible = &self.visible;
        if style.contours.drawn && target.channels().has(Channel::Color) {
            for_each_mut(control.threads, &mut self.edges, ROWS as usize, &|y, row| {
                style.contours.mark_row(visible, &view, y as u32, row);
            });
            phases.end("contours");
        }
        let painting =
            Painting { scene, style, view, visible, edges: &self.edges, light: Lighting::of(&self.lights) };
        target.for_each_band(control.threads, ROWS, &|mut band| {
            if !control.is_cancelled() {
                painting.draw(&mut band);
                control.finished(&band);
            }
        });
        control.check()?;
        phases.end("tone");
        Ok(Report { phases, ..report })
    }
}

/// The lights, as far as tone asks for them.
struct Lighting<'a> {
    lights: &'a [Light],
    /// The only light's direction when it is the same everywhere.
    uniform: Option<Vec3>,
}

impl<'a> Lighting<'a> {
    fn of(lights: &'a [Light]) -> Self {
        let uniform = match lights {
            [Light { kind: LightKind::Directional { direction }, .. }] => {
                Some(-direction.normalize_or(DVec3::NEG_Y).as_vec3())
            }
            _ => None,
        };
        Self { lights, uniform }
    }

    /// Returns the mean direction to the lights, weighted by what arrives of each; to the eye without lights.
    fn toward(&self, position: impl Fn() -> DVec3, to_eye: impl Fn() -> Vec3) -> Vec3 {
        if let Some(direction) = self.uniform {
            return direction;
        }
        let p = position();
        let arriving = self.lights.iter().filter_map(|l| l.arriving(p));
        let sum = arriving.map(|a| a.to_light.as_vec3() * a.radiance.element_sum()).sum::<Vec3>();
        sum.try_normalize().unwrap_or_else(to_eye)
    }
}

/// What one frame is painted with.
struct Painting<'a> {
    scene: &'a Scene,
    style: &'a Style,
    view: View<'a>,
    visible: &'a Framebuffer,
    edges: &'a [Vec<u32>],
    light: Lighting<'a>,
}

impl Painting<'_> {
    /// Paints a band with the widest registers there are; the bytes do not depend on them.
    fn draw(&self, band: &mut Band<'_>) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            #[expect(
                unsafe_code,
                reason = "a kernel compiled for a processor feature can only be called so"
            )]
            // SAFETY: the processor has the feature that the kernel was compiled for; it was just asked.
            return unsafe { self.band_avx2(band) };
        }
        self.band(band);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn band_avx2(&self, band: &mut Band<'_>) {
        self.band(band);
    }

    #[inline(always)]
    fn band(&self, band: &mut Band<'_>) {
        let from = band.first_row as usize * band.width as usize;
        let count = band.rows as usize * band.width as usize;
        fn copy<T: Copy>(to: &mut [T], from: &[T], first: usize, count: usize) {
            if !to.is_empty() {
                to.copy_from_slice(&from[first..first + count]);
            }
        }
        copy(band.distance, self.visible.distance(), from, count);
        copy(band.normal, self.visible.normal(), from, count);
        copy(band.id, self.visible.id(), from, count);
        copy(band.albedo, self.visible.albedo(), from, count);
        copy(band.shadow, self.visible.shadow(), from, count);
        copy(band.coverage, self.visible.coverage(), from, count);
        if band.color.is_empty() {
            return;
        }
        for row in 0..band.rows {
            let y = band.first_row + row;
            let line = &mut band.color[(row * band.width) as usize..((row + 1) * band.width) as usize];
            let directions = self.view.row(y);
            if let Some(directions) = directions {
                directions.fill(&self.scene.environment.background, 0, line);
            }
            let ids = &self.visible.id()[(y * band.width) as usize..][..band.width as usize];
            for (piece, (ids, colors)) in ids.chunks(LANES).zip(line.chunks_mut(LANES)).enumerate() {
                if directions.is_some() && shows_nothing(ids) {
                    continue;
                }
                for (lane, (id, color)) in ids.iter().zip(colors).enumerate() {
                    if *id != 0 || directions.is_none() {
                        *color = self.pixel((piece * LANES + lane) as u32, y, directions.as_ref());
                    }
                }
            }
            if self.style.contours.drawn {
                self.lines(y, line);
            }
        }
    }

    #[inline(always)]
    fn pixel(&self, x: u32, y: u32, directions: Option<&RowDirections>) -> Vec3 {
        let i = (y * self.visible.width() + x) as usize;
        let ray = || self.view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let id = self.visible.id()[i];
        if id == 0 {
            return ray().map_or(Vec3::ZERO, |r| self.scene.environment.background.color(r.direction));
        }
        let (normal, distance) = (self.visible.normal()[i], self.visible.distance()[i]);
        let position = || ray().map_or(DVec3::ZERO, |r| r.at(f64::from(distance)));
        let to_eye = || match directions {
            Some(directions) => -directions.at(x),
            None => ray().map_or(Vec3::Y, |r| -r.direction.as_vec3()),
        };
        let light = self.light.toward(position, to_eye);
        let facing = normal.dot(light);
        // In full shadow a surface is as cool as one that turns its side to the light.
        let lit = if self.style.shadow { self.visible.shadow()[i] } else { 1.0 };
        let shaded = if facing > 0.0 { facing * lit } else { facing };
        let mut color = self.style.tone.color(self.visible.albedo()[i], shaded);
        if self.style.specular && facing > 0.0 && lit > 0.0 {
            let object = &self.scene.objects[id as usize - 1];
            let material = self.scene.material(object, 0);
            if material.specular > 0.0 {
                let half = (light + to_eye()).normalize_or_zero();
                let cosine = half.dot(normal).max(0.0);
                color += Vec3::splat(material.specular * lit * highlight(cosine, material.shininess));
            }
        }
        fogged(&self.scene.environment, color, f64::from(distance))
    }

    /// Lays the lines of the rows around over a row.
    fn lines(&self, y: u32, colors: &mut [Vec3]) {
        /// Pixels at once, on the stack: no memory is asked for while drawing.
        const PIECE: usize = 128;
        let contours = &self.style.contours;
        let reach = contours.reach();
        let rows = y.saturating_sub(reach)..(y + reach + 1).min(self.edges.len() as u32);
        if rows.clone().all(|row| self.edges[row as usize].is_empty()) {
            return;
        }
        for (piece, colors) in colors.chunks_mut(PIECE).enumerate() {
            let mut coverage = [0.0f32; PIECE];
            let coverage = &mut coverage[..colors.len()];
            let mut touched = false;
            for row in rows.clone() {
                let edges = &self.edges[row as usize];
                touched |= contours.splat_row(edges, row as f32 - y as f32, piece * PIECE, coverage);
            }
            if !touched {
                continue;
            }
            for (color, &cover) in colors.iter_mut().zip(&*coverage) {
                if cover > 0.0 {
                    *color = color.lerp(contours.color, cover);
                }
            }
        }
    }
}
