//! Does `auto` keep what it is asked for, and is it as good as the best fixed choice? Twenty pairs of scene and goal, each
//! drawn with every candidate at full size.
//!
//! `cargo run --release --example auto_choices [WIDTHxHEIGHT] [SCENE...]`: a line for each pair of a scene (a file or the
//! name of a built-in one) with one of four goals, then how many kept their goal.

use polyptych::auto::{Candidate, Goal, UNSEEN, choose};
use polyptych::framebuffer::{Channels, Framebuffer};
use polyptych::load::{LoadOptions, load};
use polyptych::metrics::color_rmse;
use polyptych::prelude::*;
use std::path::Path;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut names: Vec<String> = std::env::args().skip(1).collect();
    let number = |text: &str| text.parse::<u32>().ok();
    let size =
        names.first().and_then(|n| n.split_once('x')).and_then(|(w, h)| Some([number(w)?, number(h)?]));
    if size.is_some() {
        names.remove(0);
    }
    let [width, height] = size.unwrap_or([480, 270]);
    if names.is_empty() {
        names = ["atelier", "polyhedra", "figure", "quadrics", "terrain"].map(str::to_owned).to_vec();
    }
    let goals = [Goal::MaxError(0.05), Goal::MaxError(0.01), Goal::BudgetMs(15.0), Goal::BudgetMs(100.0)];
    let backends = ["reference", "raster", "voxel", "freeform"].map(str::to_owned);
    let (mut kept, mut good, mut all) = (0, 0, 0);
    for name in &names {
        let options = LoadOptions { height_map: name.ends_with(".png"), ..LoadOptions::default() };
        let scene = match polyptych::builtin::scene(name) {
            Ok(scene) => scene,
            Err(_) => load(Path::new(name), &options)?,
        };
        let scene = Arc::new(scene);
        let view = Projection::Perspective { fov_y: 0.7 };
        let framed =
            || Camera::framing(&scene.bounds(), 0.5, 0.35, f64::from(width) / f64::from(height), view);
        let camera = scene.cameras.first().map_or_else(framed, |(_, camera)| camera.clone());
        let need = Need::new(camera, width, height);
        let name = name.rsplit('/').next().unwrap_or(name);
        let mut studio = Studio::pinned(Registry::builtin(), 0)?;
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
                    (met, best, if best.is_finite() { error.max(UNSEEN) / best.max(UNSEEN) } else { 1.0 })
                }
            };
            all += 1;
            kept += u32::from(met);
            good += u32::from(met && worse <= 1.2);
            println!(
                "{name:<22} {goal:?}: {} at {} px: {ms:.1} ms (expected {:.1}), error {error:.4} (expected {:.4}); \
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

/// How often each candidate takes its turn.
const TURNS: usize = 5;

/// Returns time and error of every candidate at full size. They draw by turns, so that what else the machine does slows
/// all of them, and the median of a candidate's turns counts.
fn measure(
    studio: &mut Studio,
    scene: &Arc<Scene>,
    need: &Need,
    candidates: &[Candidate],
    ruler: &Framebuffer,
) -> Result<Vec<(f64, f64)>, polyptych::StudioError> {
    let mut times = vec![Vec::new(); candidates.len()];
    let mut errors = Vec::new();
    for turn in 0..TURNS {
        for (candidate, times) in candidates.iter().zip(&mut times) {
            let need =
                Need { tolerance_px: candidate.tolerance_px, channels: Channels::COLOR, ..need.clone() };
            let drawing = studio.draw(&candidate.backend, scene, &need)?;
            let mut picture = drawing.framebuffer;
            let mut ms = drawing.frame_ms;
            for _ in 0..2 {
                if ms < 1000.0 {
                    ms = ms.min(studio.render(&candidate.backend, &need.frame(), &mut picture)?.1);
                }
            }
            times.push(ms);
            if turn == 0 {
                errors.push(color_rmse(&picture, ruler).unwrap_or(0.0));
            }
        }
    }
    let median = |mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    Ok(times.into_iter().map(median).zip(errors).collect())
}
