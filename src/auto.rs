//! Which back end, with which tolerance, is right enough or fast enough for a picture?
//!
//! Plans say what each would build; how fast and how right it is they cannot know, for that depends on the scene. So each
//! candidate draws two small pictures of it first: their times tell what a pixel costs and what the rest does, their
//! difference to the reference's how right it is. What is converted for them has the tolerance of the large picture, so
//! that it is found in the cache when that is drawn. Where even that takes next to no time, it is drawn and timed itself.

use crate::compare::REFERENCE;
use crate::framebuffer::{Channels, Framebuffer};
use crate::metrics::color_rmse;
use crate::parallel::Threads as _;
use crate::scene::Scene;
use crate::seam::{Need, Plan};
use crate::studio::{Studio, StudioError};
use serde::Serialize;
use std::sync::Arc;

/// What is asked of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Goal {
    /// At most this error: root mean square difference of displayed color to the reference, full scale 1. The fastest
    /// that meets it is taken.
    MaxError(f64),
    /// At most so many milliseconds a frame. The most accurate that meets it is taken, and of those whose errors nobody
    /// sees the fastest.
    BudgetMs(f64),
}

/// A back end with a tolerance, and what the pilot pictures told about it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// Id of the back end.
    pub backend: String,
    /// Tolerance of edges, pixels.
    pub tolerance_px: f64,
    /// Time of a frame to be expected, milliseconds.
    pub predicted_ms: f64,
    /// Color error to be expected.
    pub predicted_error: f64,
    /// Bytes that the back end's plan names.
    pub planned_bytes: u64,
}

/// What was chosen, and from what.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// What was asked.
    pub goal: Goal,
    /// The best candidate.
    pub chosen: Candidate,
    /// Whether it is expected to meet the goal; otherwise it comes nearest.
    pub meets_goal: bool,
    /// All candidates.
    pub considered: Vec<Candidate>,
}

/// Tolerances that are tried, in pixels.
const TOLERANCES: [f64; 3] = [2.0, 0.5, 0.125];

/// The pilot pictures' sizes, as divisors of the picture's edges.
const DIVISORS: [u32; 2] = [6, 3];

/// A pilot picture has at least so many columns: smaller ones are all edges.
const LEAST: u32 = 48;

/// Candidates whose plan names more bytes are not tried.
const MOST_BYTES: u64 = 4 << 30;

/// Share of a goal that a prediction must keep to, since it may be off by as much.
const MARGIN: f64 = 0.9;

/// Frames of a pilot after the first, and the time of one from which on there are none, milliseconds.
const FRAMES: usize = 4;
const SLOW_MS: f64 = 150.0;

/// A picture that is expected in so many milliseconds is drawn in full: its time is then known and not expected.
const FULL_MS: f64 = 40.0;

/// Errors below a quarter of a step of eight bits look alike.
pub const UNSEEN: f64 = 0.25 / 255.0;

/// A pilot that takes so long, milliseconds, is the last of its back end: finer ones take longer still.
const PATIENCE_MS: f64 = 3000.0;

/// Chooses among back ends for a need; those that are not photometric show something else and are left out.
///
/// # Errors
/// When a back end is unknown or none can draw the scene.
pub fn choose(
    studio: &mut Studio,
    scene: &Arc<Scene>,
    need: &Need,
    backends: &[String],
    goal: Goal,
) -> Result<Choice, StudioError> {
    let sizes = DIVISORS.map(|d| {
        let divisor = d.min(need.width / LEAST).max(1);
        [need.width.div_ceil(divisor).max(1), need.height.div_ceil(divisor).max(1)]
    });
    let rulers =
        [pilot(studio, REFERENCE, scene, need, sizes[0])?, pilot(studio, REFERENCE, scene, need, sizes[1])?];
    let mut considered = Vec::new();
    for backend in backends {
        if !studio.registry().info(backend)?.photometric {
            continue;
        }
        let mut plans: Vec<Plan> = Vec::new();
        for tolerance_px in TOLERANCES {
            let need = Need { tolerance_px, ..need.clone() };
            let plan = studio.renderer(backend)?.plan(scene, &need);
            let planned_bytes = plan.bytes;
            // What is drawn as given is the same at any tolerance.
            if planned_bytes > MOST_BYTES || plans.contains(&plan) {
                continue;
            }
            plans.push(plan);
            let mut drawn = Vec::new();
            for size in sizes {
                drawn.push(pilot(studio, backend, scene, &need, size)?);
            }
            let mut predicted_ms = extrapolated(sizes, [drawn[0].ms, drawn[1].ms], need.width, need.height);
            if predicted_ms < FULL_MS {
                predicted_ms = pilot(studio, backend, scene, &need, [need.width, need.height])?.ms;
            }
            let error = |i: usize| color_rmse(&drawn[i].picture, &rulers[i].picture).unwrap_or(0.0);
            considered.push(Candidate {
                backend: backend.clone(),
                tolerance_px,
                predicted_ms,
                predicted_error: finer(error(0), error(1)),
                planned_bytes,
            });
            if drawn[1].prepare_ms + drawn[1].ms > PATIENCE_MS || backend == REFERENCE {
                break;
            }
        }
    }
    let (chosen, meets_goal) = best(&considered, goal)
        .ok_or_else(|| StudioError::Threads("no back end that could be chosen can draw this".to_owned()))?;
    Ok(Choice { goal, chosen, meets_goal, considered })
}

struct Pilot {
    picture: Framebuffer,
    ms: f64,
    prepare_ms: f64,
}

/// Draws a small picture some times; the fastest counts, so that scratch memory and other programs do not.
fn pilot(
    studio: &mut Studio,
    backend: &str,
    scene: &Arc<Scene>,
    need: &Need,
    [width, height]: [u32; 2],
) -> Result<Pilot, StudioError> {
    // In world space the tolerance is that of the large picture.
    let tolerance_px = need.tolerance_px * f64::from(width) / f64::from(need.width.max(1));
    let small = Need { width, height, tolerance_px, channels: Channels::COLOR, ..need.clone() };
    let drawing = studio.draw(backend, scene, &small)?;
    let mut picture = drawing.framebuffer;
    let mut ms = drawing.frame_ms;
    for _ in 0..FRAMES {
        if ms > SLOW_MS {
            break;
        }
        ms = ms.min(studio.render(backend, &small.frame(), &mut picture)?.1);
    }
    Ok(Pilot { picture, ms, prepare_ms: drawing.prepare_ms })
}

/// Lays a line through the times of two sizes: what a pixel costs, and what does not depend on pixels.
fn extrapolated(sizes: [[u32; 2]; 2], ms: [f64; 2], width: u32, height: u32) -> f64 {
    let count = |[w, h]: [u32; 2]| f64::from(w) * f64::from(h);
    let (small, large, full) = (count(sizes[0]), count(sizes[1]), count([width, height]));
    if large <= small {
        return ms[1] * full / large.max(1.0);
    }
    // Noise must not make pixels cost less than nothing, nor the rest.
    let slope = ((ms[1] - ms[0]) / (large - small)).clamp(0.0, ms[1] / large);
    ms[1] + slope * (full - large)
}

/// Expects an error to fall from the larger pilot to the picture as it fell from the smaller one, at most by half: edges
/// take a smaller share of a larger picture.
fn finer(small: f64, large: f64) -> f64 {
    if small > 0.0 { large * (large / small).clamp(0.5, 1.0) } else { large }
}

/// Returns the best candidate for a goal and whether it meets it.
fn best(all: &[Candidate], goal: Goal) -> Option<(Candidate, bool)> {
    let by_time = |a: &&Candidate, b: &&Candidate| a.predicted_ms.total_cmp(&b.predicted_ms);
    let by_error = |a: &&Candidate, b: &&Candidate| {
        let seen = |c: &Candidate| c.predicted_error.max(UNSEEN);
        seen(a).total_cmp(&seen(b)).then(a.predicted_ms.total_cmp(&b.predicted_ms))
    };
    let met = match goal {
        Goal::MaxError(error) => all.iter().filter(|c| c.predicted_error <= error * MARGIN).min_by(by_time),
        Goal::BudgetMs(ms) => all.iter().filter(|c| c.predicted_ms <= ms * MARGIN).min_by(by_error),
    };
    if let Some(candidate) = met {
        return Some((candidate.clone(), true));
    }
    let nearest = match goal {
        Goal::MaxError(_) => all.iter().min_by(by_error),
        Goal::BudgetMs(_) => all.iter().min_by(by_time),
    };
    nearest.map(|c| (c.clone(), false))
}

impl Choice {
    /// Says what was chosen in a line.
    #[must_use]
    pub fn told(&self, studio: &Studio) -> String {
        let goal = match self.goal {
            Goal::MaxError(error) => format!("an error of at most {error}"),
            Goal::BudgetMs(ms) => format!("at most {ms} ms a frame"),
        };
        let chosen = &self.chosen;
        format!(
            "auto: {} with a tolerance of {} px {} {goal}: {:.1} ms and an error of {:.4} are expected with {} threads",
            chosen.backend,
            chosen.tolerance_px,
            if self.meets_goal { "for" } else { "comes nearest to" },
            chosen.predicted_ms,
            chosen.predicted_error,
            studio.pool().count()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(backend: &str, predicted_ms: f64, predicted_error: f64) -> Candidate {
        let backend = backend.to_owned();
        Candidate { backend, tolerance_px: 0.5, predicted_ms, predicted_error, planned_bytes: 0 }
    }

    #[test]
    fn the_fastest_right_one_and_the_most_right_fast_one_are_taken() {
        let all = [
            candidate("raster", 2.0, 0.03),
            candidate("freeform", 20.0, 0.01),
            candidate("reference", 300.0, 0.0),
        ];
        let chosen = |goal| best(&all, goal).map(|(c, met)| (c.backend, met)).unwrap();
        assert_eq!(chosen(Goal::MaxError(0.05)), ("raster".to_owned(), true));
        assert_eq!(chosen(Goal::MaxError(0.02)), ("freeform".to_owned(), true));
        assert_eq!(chosen(Goal::MaxError(0.001)), ("reference".to_owned(), true));
        assert_eq!(chosen(Goal::BudgetMs(30.0)), ("freeform".to_owned(), true));
        assert_eq!(chosen(Goal::BudgetMs(22.0)), ("raster".to_owned(), true), "20 ms may become 23");
        assert_eq!(chosen(Goal::BudgetMs(1.0)), ("raster".to_owned(), false));
        let alike = [candidate("raster", 2.0, 0.0003), candidate("reference", 300.0, 0.0)];
        let (chosen, _) = best(&alike, Goal::BudgetMs(1000.0)).unwrap();
        assert_eq!(chosen.backend, "raster", "nobody sees the difference");
        assert!(best(&[], Goal::BudgetMs(1.0)).is_none());
    }

    #[test]
    fn time_is_what_pixels_cost_and_what_they_do_not() {
        let sizes = [[100, 100], [200, 100]];
        assert!((extrapolated(sizes, [3.0, 5.0], 300, 100) - 7.0).abs() < 1e-12);
        assert!((extrapolated(sizes, [5.0, 5.0], 300, 100) - 5.0).abs() < 1e-12, "all is fixed");
        assert!((extrapolated(sizes, [0.0, 4.0], 400, 100) - 8.0).abs() < 1e-12, "all is pixels");
        assert_eq!(
            [finer(0.0, 0.1), finer(0.4, 0.2), finer(0.4, 0.1), finer(0.1, 0.2)],
            [0.1, 0.1, 0.05, 0.2]
        );
    }
}
