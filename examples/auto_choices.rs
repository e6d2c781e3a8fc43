//! Does `auto` keep what it is asked for, and is it as good as the best fixed choice? Twenty pairs of scene and goal, each
//! drawn with every candidate at full size.
//!
//! `cargo run --release --example auto_choices`: a line for each pair, then how many kept their goal.

use polyptych::auto::{Candidate, Goal, choose};
use polyptych::framebuffer::{Channels, Framebuffer};
use polyptych::metrics::color_rmse;
use polyptych::prelude::*;
use std::sync::Arc;

const SIZE: [u32; 2] = [480, 270];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let goals = [Goal::MaxError(0.05), Goal::MaxError(0.01), Goal::BudgetMs(15.0), Goal::BudgetMs(100.0)];
    let backends = ["reference", "raster", "voxel", "freeform"].map(str::to_owned);
    let (mut kept, mut good, mut all) = (0, 0, 0);
    for name in ["atelier", "polyhedra", "figure", "quadrics", "terrain"] {
        let scene = Arc::new(polyptych::builtin::scene(name)?);
        let need = Need::new(scene.cameras[0].1.clone(), SIZE[0], SIZE[1]);
        let mut studio = Studio::new(Registry::builtin(), 0)?;
        let ruler = studio.draw("reference", &scene, &need)?.framebuffer;
        let mut fixed: Option<Vec<(f64, f64)>> = None;
        for goal in goals {
            let choice = choose(&mut studio, &scene, &need, &backends, goal)?;
            // What each candidate really does is measured once a scene.
            let fixed = match &fixed {
                Some(fixed) => fixed,
                None => fixed.insert(measure(&mut studio, &scene, &need, &choice.considered, &ruler)?),
            };
            let at = choice.considered.iter().position(|c| {
                c.backend == choice.chosen.backend && c.tolerance_px == choice.chosen.tolerance_px
            });
            let (ms, error) = at.map_or((f64::NAN, f64::NAN), |i| fixed[i]);
            let (met, best, worse) = match goal {
                Goal::MaxError(most) => {
                    let right = fixed.iter().filter(|f| f.1 <= most).map(|f| f.0);
                    let best = right.fold(f64::INFINITY, f64::min);
                    (error <= most, best, ms / best)
                }
                Goal::BudgetMs(most) => {
                    let fast = fixed.iter().filter(|f| f.0 <= most).map(|f| f.1);
                    let best = fast.fold(f64::INFINITY, f64::min);
                    // A budget that nothing keeps is kept as nearly as can be.
                    let fastest = fixed.iter().map(|f| f.0).fold(f64::INFINITY, f64::min);
                    let met = ms <= most || (best.is_infinite() && ms <= fastest * 1.2);
                    (met, best, if best.is_finite() { (error + 1e-4) / (best + 1e-4) } else { 1.0 })
                }
            };
            all += 1;
            kept += u32::from(met);
            good += u32::from(met && worse <= 1.2);
            println!(
                "{name:<10} {goal:?}: {} at {} px: {ms:.1} ms (expected {:.1}), error {error:.4} (expected {:.4}); \
                 {}; best fixed {best:.4}, {worse:.2} of it",
                choice.chosen.backend,
                choice.chosen.tolerance_px,
                choice.chosen.predicted_ms,
                choice.chosen.predicted_error,
                if met { "kept" } else { "MISSED" },
            );
        }
    }
    println!("{kept} of {all} keep their goal; {good} are within 20 % of the best fixed choice");
    Ok(())
}

/// Returns time and error of every candidate at full size.
fn measure(
    studio: &mut Studio,
    scene: &Arc<Scene>,
    need: &Need,
    candidates: &[Candidate],
    ruler: &Framebuffer,
) -> Result<Vec<(f64, f64)>, polyptych::StudioError> {
    let mut all = Vec::new();
    for candidate in candidates {
        let need = Need { tolerance_px: candidate.tolerance_px, channels: Channels::COLOR, ..need.clone() };
        let drawing = studio.draw(&candidate.backend, scene, &need)?;
        let mut picture = drawing.framebuffer;
        let mut times = Vec::new();
        for _ in 0..3 {
            times.push(studio.render(&candidate.backend, &need.frame(), &mut picture)?.1);
        }
        times.sort_by(f64::total_cmp);
        all.push((times[1], color_rmse(&picture, ruler).unwrap_or(0.0)));
    }
    Ok(all)
}
