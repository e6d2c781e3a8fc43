//! Which back end, with which tolerance, is right enough or fast enough for a picture?
//!
//! Plans say what each would build; how fast and how right it is they cannot know, for that depends on the scene. So each
//! candidate draws two small pictures of it first: their times tell what a pixel costs and what the rest does, their
//! difference to the reference's how right it is. What is converted for them has the tolerance of the large picture, so
//! that it is found in the cache when that is drawn. Where even that takes next to no time, or comes near to what is
//! asked, it is drawn and measured itself, and held against the reference's where that is drawn in about a second.
//! Those between which it is close then draw by turns: what else the machine does
//! slows all of them.

mod pilot;

use crate::compare::REFERENCE;
use crate::framebuffer::Channels;
use crate::parallel::Threads as _;
use crate::scene::Scene;
use crate::seam::{Need, Plan};
use crate::studio::{Studio, StudioError};
use pilot::{Rulers, pilot};
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

/// What an expected error was read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Evidence {
    /// Small pictures.
    Pilots,
    /// Every so many pixels of the picture itself.
    SomePixels,
    /// The whole picture.
    Picture,
}

impl Evidence {
    /// Returns the share of a goal that an error must keep to, since it may be off by as much: pilots by a tenth, a picture's
    /// pixels that are the reference's, too, by a thirtieth.
    fn margin(self) -> f64 {
        match self {
            Self::Pilots => 0.9,
            Self::SomePixels => 0.95,
            Self::Picture => 1.0,
        }
    }
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
    /// Where that was seen.
    pub error_seen_in: Evidence,
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

/// What a choice turned out to be at full size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// What was chosen, and from what.
    #[serde(flatten)]
    pub choice: Choice,
    /// Median time of a frame in color, milliseconds.
    pub ms: f64,
    /// Color error.
    pub error: f64,
    /// Whether the goal was kept.
    pub kept: bool,
}

/// Tolerances that are tried, in pixels.
const TOLERANCES: [f64; 3] = [2.0, 0.5, 0.125];

/// Candidates whose plan names more bytes are not tried.
const MOST_BYTES: u64 = 4 << 30;

/// Share of a budget that a time must keep to: those near it are measured.
const TIME_MARGIN: f64 = 0.97;

/// A picture that is expected in so many milliseconds is drawn in full: its time is then known and not expected.
const FULL_MS: f64 = 100.0;

/// Errors below a quarter of a step of eight bits look alike.
pub const UNSEEN: f64 = 0.25 / 255.0;

/// A pilot that takes so long, milliseconds, is the last of its back end: finer ones take longer still.
const PATIENCE_MS: f64 = 3000.0;

/// What pilots foretell may be off by this factor: nearer to what is asked it may lie on the other side.
const NEAR: f64 = 2.0;

/// Measured times that differ by less than this factor may be the other way round without other programs.
const CLOSE: f64 = 1.5;

/// How often candidates between which it is close take their turn, and how long a frame of theirs may be, milliseconds.
const TURNS: usize = 4;
const TURN_MS: f64 = 150.0;

/// Where a shortest time lies within this share of a budget, they take more turns, so often at most.
const AT_BUDGET: f64 = 0.1;
const ROUNDS: usize = 3;

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
    let rulers = Rulers::draw(studio, scene, need)?;
    let mut considered = Vec::new();
    for backend in backends {
        if !studio.registry().info(backend)?.photometric {
            continue;
        }
        let mut plans: Vec<Plan> = Vec::new();
        for tolerance_px in TOLERANCES {
            let need = Need { tolerance_px, ..need.clone() };
            let plan = studio.renderer(backend)?.plan(scene, &need);
            // What is drawn as given is the same at any tolerance.
            if plan.bytes > MOST_BYTES || plans.contains(&plan) {
                continue;
            }
            let (candidate, pilot_ms) = measured(studio, scene, &need, backend, &plan, &rulers, goal)?;
            considered.push(candidate);
            plans.push(plan);
            if pilot_ms > PATIENCE_MS || backend == REFERENCE {
                break;
            }
        }
    }
    take_turns(studio, scene, need, &mut considered, goal)?;
    let (chosen, meets_goal) = best(&considered, goal)
        .ok_or_else(|| StudioError::Threads("no back end that could be chosen can draw this".to_owned()))?;
    Ok(Choice { goal, chosen, meets_goal, considered })
}

/// Draws the pilots of a candidate, and the whole picture where that is quick or comes near to what is asked. Returns what
/// is to be expected of it, and the milliseconds that the larger pilot took.
fn measured(
    studio: &mut Studio,
    scene: &Arc<Scene>,
    need: &Need,
    backend: &str,
    plan: &Plan,
    rulers: &Rulers,
    goal: Goal,
) -> Result<(Candidate, f64), StudioError> {
    let mut drawn = Vec::new();
    for size in rulers.sizes {
        drawn.push(pilot(studio, backend, scene, need, size)?);
    }
    let mut predicted_ms = rulers.extrapolated([drawn[0].ms, drawn[1].ms], need);
    let mut predicted_error = rulers.finer([&drawn[0].picture, &drawn[1].picture]);
    let is_exact = plan.objects.iter().all(|o| o.decision.bound() == Some(0.0));
    let at_edges = if is_exact { 0.0 } else { rulers.coarse(studio, backend, scene, need)? };
    let mut error_seen_in = Evidence::Pilots;
    let near = |value: f64, asked: f64| (asked / NEAR..asked * NEAR).contains(&value);
    let is_close = match goal {
        Goal::BudgetMs(ms) => near(predicted_ms, ms),
        Goal::MaxError(error) => near(predicted_error.max(at_edges), error),
    };
    if predicted_ms < FULL_MS || (is_close && predicted_ms < PATIENCE_MS) {
        let full = pilot(studio, backend, scene, need, [need.width, need.height])?;
        predicted_ms = full.ms;
        // The whole picture shows its error itself, everywhere or where the larger pilot's rays are among its own.
        if let Some(error) = rulers.whole(&full.picture) {
            (predicted_error, error_seen_in) = (error, Evidence::Picture);
        } else if let Some(error) = rulers.sampled(&full.picture, need) {
            (predicted_error, error_seen_in) = (error, Evidence::SomePixels);
        }
    }
    let candidate = Candidate {
        backend: backend.to_owned(),
        tolerance_px: need.tolerance_px,
        predicted_ms,
        // Errors in few places may lie between the pixels of a pilot.
        predicted_error: predicted_error.max(if error_seen_in == Evidence::Picture { 0.0 } else { at_edges }),
        error_seen_in,
        planned_bytes: plan.bytes,
    };
    Ok((candidate, drawn[1].prepare_ms + drawn[1].ms))
}

/// Lets candidates between whose times it is close draw by turns, and keeps the shortest time of each.
fn take_turns(
    studio: &mut Studio,
    scene: &Arc<Scene>,
    need: &Need,
    all: &mut [Candidate],
    goal: Goal,
) -> Result<(), StudioError> {
    let rivals = rivals(all, goal);
    if rivals.len() < 2 {
        return Ok(());
    }
    let mut shortest = vec![f64::INFINITY; rivals.len()];
    let is_at_budget = |ms: f64| matches!(goal, Goal::BudgetMs(most) if (ms / most - 1.0).abs() < AT_BUDGET);
    for round in 0..ROUNDS {
        if round > 0 && !shortest.iter().any(|ms| is_at_budget(*ms)) {
            break;
        }
        for _ in 0..TURNS {
            for (&rival, shortest) in rivals.iter().zip(&mut shortest) {
                let Candidate { backend, tolerance_px, .. } = &all[rival];
                let need = Need { tolerance_px: *tolerance_px, channels: Channels::COLOR, ..need.clone() };
                let drawing = studio.draw(backend, scene, &need)?;
                let mut picture = drawing.framebuffer;
                let again = studio.render(backend, &need.frame(), &mut picture)?.1;
                *shortest = shortest.min(drawing.frame_ms).min(again);
            }
        }
    }
    for (rival, shortest) in rivals.into_iter().zip(shortest) {
        all[rival].predicted_ms = shortest;
    }
    Ok(())
}

/// Lists the candidates of which any may turn out to be the one to take when times are known better.
fn rivals(all: &[Candidate], goal: Goal) -> Vec<usize> {
    let Some((best, _)) = best(all, goal) else { return Vec::new() };
    let is_rival = |c: &&Candidate| match goal {
        Goal::MaxError(error) => c.is_right(error),
        // One that seems too slow is none unless it would be more right.
        Goal::BudgetMs(ms) => {
            let seen = |c: &Candidate| c.predicted_error.max(UNSEEN);
            seen(c) <= seen(&best) && c.predicted_ms <= ms * NEAR
        }
    };
    let is_equal = |c: &&Candidate| match goal {
        Goal::MaxError(_) => c.predicted_ms <= best.predicted_ms * CLOSE,
        Goal::BudgetMs(_) => true,
    };
    let near = all.iter().enumerate().filter(|(_, c)| is_rival(c) && is_equal(c) && c.predicted_ms < TURN_MS);
    near.map(|(index, _)| index).collect()
}

/// Times what was chosen at full size; `error` is that of its picture.
///
/// # Errors
/// When it cannot draw the scene after all.
pub fn verify(
    studio: &mut Studio,
    scene: &Arc<Scene>,
    need: &Need,
    choice: Choice,
    error: f64,
) -> Result<Outcome, StudioError> {
    let backend = choice.chosen.backend.clone();
    let need = Need { tolerance_px: choice.chosen.tolerance_px, channels: Channels::COLOR, ..need.clone() };
    let drawing = studio.draw(&backend, scene, &need)?;
    let (mut picture, mut times) = (drawing.framebuffer, vec![drawing.frame_ms]);
    while times.len() < 5 && times.iter().sum::<f64>() < PATIENCE_MS {
        times.push(studio.render(&backend, &need.frame(), &mut picture)?.1);
    }
    times.sort_unstable_by(f64::total_cmp);
    let ms = times[(times.len() - 1) / 2];
    let kept = match choice.goal {
        Goal::MaxError(most) => error <= most,
        Goal::BudgetMs(most) => ms <= most,
    };
    Ok(Outcome { choice, ms, error, kept })
}

/// Returns the best candidate for a goal and whether it meets it.
fn best(all: &[Candidate], goal: Goal) -> Option<(Candidate, bool)> {
    let by_time = |a: &&Candidate, b: &&Candidate| a.predicted_ms.total_cmp(&b.predicted_ms);
    let by_error = |a: &&Candidate, b: &&Candidate| {
        let seen = |c: &Candidate| c.predicted_error.max(UNSEEN);
        seen(a).total_cmp(&seen(b)).then(a.predicted_ms.total_cmp(&b.predicted_ms))
    };
    let met = match goal {
        Goal::MaxError(error) => all.iter().filter(|c| c.is_right(error)).min_by(by_time),
        Goal::BudgetMs(ms) => all.iter().filter(|c| c.predicted_ms <= ms * TIME_MARGIN).min_by(by_error),
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

impl Candidate {
    /// Tells whether an error is kept; what is only expected must keep away from it.
    fn is_right(&self, error: f64) -> bool {
        self.predicted_error <= error * self.error_seen_in.margin()
    }
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
        let error_seen_in = Evidence::Pilots;
        Candidate {
            backend,
            tolerance_px: 0.5,
            predicted_ms,
            predicted_error,
            error_seen_in,
            planned_bytes: 0,
        }
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
        assert_eq!(chosen(Goal::BudgetMs(20.5)), ("raster".to_owned(), true), "20 ms may become 21");
        assert_eq!(chosen(Goal::BudgetMs(1.0)), ("raster".to_owned(), false));
        let alike = [candidate("raster", 2.0, 0.0003), candidate("reference", 300.0, 0.0)];
        let (chosen, _) = best(&alike, Goal::BudgetMs(1000.0)).unwrap();
        assert_eq!(chosen.backend, "raster", "nobody sees the difference");
        assert!(best(&[], Goal::BudgetMs(1.0)).is_none());
        let at_the_goal = |error_seen_in| [Candidate { error_seen_in, ..candidate("raster", 2.0, 0.048) }];
        let met = |known| best(&at_the_goal(known), Goal::MaxError(0.05)).map(|(_, met)| met);
        assert_eq!(
            [met(Evidence::Pilots), met(Evidence::Picture)],
            [Some(false), Some(true)],
            "what is known needs no margin"
        );
    }

    #[test]
    fn those_between_which_it_is_close_are_rivals() {
        let all = [
            candidate("raster", 2.0, 0.03),
            candidate("voxel", 2.8, 0.03),
            candidate("freeform", 20.0, 0.01),
            candidate("reference", 300.0, 0.0),
        ];
        assert_eq!(rivals(&all, Goal::MaxError(0.05)), [0, 1], "a third is nearly as fast");
        assert_eq!(rivals(&all, Goal::MaxError(0.02)), [2]);
        assert_eq!(rivals(&all, Goal::BudgetMs(16.0)), [0, 1, 2], "20 ms may become 15");
        assert_eq!(rivals(&all, Goal::BudgetMs(9.0)), [0, 1], "20 ms do not become 8");
        assert!(rivals(&[], Goal::BudgetMs(1.0)).is_empty());
    }
}
