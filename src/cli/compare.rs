//! `polyptych compare`: every back end beside the reference.

use super::arguments::CompareArguments;
use super::{Failure, auto, input, print};
use indicatif::{ProgressBar, ProgressStyle};
use polyptych::auto::verify;
use polyptych::compare::{Request, compare};
use polyptych::report;
use std::path::PathBuf;
use std::time::Duration;

/// Frames to take the median time of.
const FRAMES: u32 = 5;

pub(super) fn run(arguments: &CompareArguments) -> Result<(), Failure> {
    let scene = input::scene(&arguments.scene)?;
    let mut studio =
        input::studio(usize::from(arguments.draw.threads.unwrap_or(0)), &arguments.draw.plugins)?;
    let default = ["raster", "voxel", "freeform", "stylized"];
    let mut need = input::need(&arguments.draw, &scene)?;
    let choice = auto::resolve(&arguments.draw, &mut studio, &scene, &need)?;
    let backends = match &choice {
        Some(choice) => vec![choice.chosen.backend.clone()],
        None => input::backends(&arguments.draw, studio.registry(), &default)?,
    };
    need.tolerance_px = choice.as_ref().map_or(need.tolerance_px, |c| c.chosen.tolerance_px);
    let mut all = backends.clone();
    all.push(polyptych::compare::REFERENCE.to_owned());
    let settings = input::settings(&arguments.draw, studio.registry(), &all)?;
    let request = Request { backends, need, settings, frames: FRAMES };

    let bar = ProgressBar::new(request.backends.len() as u64 + 1);
    bar.set_style(
        ProgressStyle::with_template("{spinner} {pos}/{len} {msg}").unwrap_or(ProgressStyle::default_bar()),
    );
    bar.enable_steady_tick(Duration::from_millis(100));
    let mut comparison = compare(&mut studio, &scene, &request, &mut |step| {
        bar.set_message(step.to_owned());
        bar.inc(1);
    })
    .map_err(Failure::running)?;
    if let (Some(choice), Some(panel)) = (choice, comparison.panels.last()) {
        bar.set_message("holding what was chosen against what was expected");
        // The reference itself has no error.
        let error = panel.errors.and_then(|e| e.color).map_or(0.0, |c| c.rmse);
        let outcome = verify(&mut studio, &scene, &request.need, choice, error).map_err(Failure::running)?;
        comparison.choice = Some(outcome);
    }
    bar.finish_and_clear();

    let folder = arguments.output.clone().unwrap_or_else(|| PathBuf::from("out/compare"));
    let command = std::env::args().collect::<Vec<_>>().join(" ");
    report::write(&comparison, &folder, &command).map_err(Failure::running)?;
    if arguments.draw.json {
        print(&format!("{}\n", report::numbers(&comparison)));
    } else if !arguments.draw.quiet {
        print(&format!("{}\n", report::table(&comparison)));
        print(&format!("wrote {0}/index.html, {0}/sheet.png, {0}/compare.json\n", folder.display()));
    }
    if let Some(outcome) = comparison.choice.as_ref().filter(|_| !arguments.draw.quiet) {
        let chosen = &outcome.choice.chosen;
        eprintln!(
            "auto: {} took {:.1} ms where {:.1} were expected, with an error of {:.4} where {:.4} was expected: the goal \
             is {}",
            chosen.backend,
            outcome.ms,
            chosen.predicted_ms,
            outcome.error,
            chosen.predicted_error,
            if outcome.kept { "kept" } else { "missed" }
        );
    }
    if arguments.draw.verbose {
        for note in &comparison.notes {
            eprintln!("note: {note}");
        }
        for panel in &comparison.panels {
            for ((name, _), decision) in comparison.objects.iter().zip(panel.decisions.iter()) {
                eprintln!("{}: {name}: {} {}", panel.backend, decision.word(), decision.why());
            }
        }
    }
    for (_, error) in &comparison.failures {
        eprintln!("error: {error}");
    }
    if !comparison.failures.is_empty() {
        let names: Vec<_> = comparison.failures.iter().map(|(backend, _)| backend.as_str()).collect();
        return Err(Failure::running(format!("left out: {}", names.join(", "))));
    }
    if arguments.gate && !comparison.all_gates_hold() {
        for panel in &comparison.panels {
            if let Some(gate) = panel.gate.as_ref().filter(|g| !g.passed) {
                eprintln!("gate: {} failed: {}", panel.backend, gate.failed.join(", "));
            }
        }
        return Err(Failure::Gate);
    }
    Ok(())
}
