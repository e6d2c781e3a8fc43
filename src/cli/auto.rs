//! What does `--backend auto` become?

use super::Failure;
use super::arguments::DrawArguments;
use polyptych::Studio;
use polyptych::auto::{Choice, Goal, choose};
use polyptych::scene::Scene;
use polyptych::seam::Need;
use std::sync::Arc;

/// The word for a back end that is yet to be chosen.
pub(super) const AUTO: &str = "auto";

/// Chooses for `--backend auto`, or for a goal without any back end; nothing where neither was asked for. The choice is
/// told on standard error.
pub(super) fn resolve(
    arguments: &DrawArguments,
    studio: &mut Studio,
    scene: &Arc<Scene>,
    need: &Need,
) -> Result<Option<Choice>, Failure> {
    let goal = match (arguments.max_error, arguments.budget_ms) {
        (Some(_), Some(_)) => {
            return Err(Failure::wrong_use("--max-error and --budget-ms: give one of them"));
        }
        (Some(error), None) => Some(Goal::MaxError(positive("--max-error", error)?)),
        (None, Some(ms)) => Some(Goal::BudgetMs(positive("--budget-ms", ms)?)),
        (None, None) => None,
    };
    let named = arguments.backend.iter().any(|b| b == AUTO);
    let goal = match (named, goal) {
        (true, None) => {
            return Err(Failure::wrong_use("--backend auto: say what for, with --max-error or --budget-ms"));
        }
        (false, Some(_)) if !arguments.backend.is_empty() => {
            return Err(Failure::wrong_use(
                "--max-error and --budget-ms choose a back end: write --backend auto",
            ));
        }
        (_, None) => return Ok(None),
        (_, Some(goal)) => goal,
    };
    let candidates = ["reference", "raster", "voxel", "freeform"].map(str::to_owned);
    let choice = choose(studio, scene, need, &candidates, goal).map_err(Failure::running)?;
    if !arguments.quiet {
        eprintln!("{}", choice.told(studio));
    }
    Ok(Some(choice))
}

fn positive(option: &str, value: f64) -> Result<f64, Failure> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(Failure::wrong_use(format!("{option} {value}: must be a positive number")))
    }
}
