//! `polyptych render`: one picture.

use super::arguments::RenderArguments;
use super::{Failure, auto, input, print};
use polyptych::framebuffer::{Channel, Channels};
use polyptych::report::count_decisions;
use polyptych::scene::Scene;
use polyptych::seam::Need;
use polyptych::{Studio, picture, vector};
use serde_json::json;
use std::sync::Arc;
use std::time::Instant;

pub(super) fn run(arguments: &RenderArguments) -> Result<(), Failure> {
    let scene = input::scene(&arguments.scene)?;
    let mut studio =
        input::studio(usize::from(arguments.draw.threads.unwrap_or(0)), &arguments.draw.plugins)?;
    let base = input::need(&arguments.draw, &scene)?;
    let choice = auto::resolve(&arguments.draw, &mut studio, &scene, &base)?;
    let backends = match &choice {
        Some(choice) => vec![choice.chosen.backend.clone()],
        None => input::backends(&arguments.draw, studio.registry(), &["raster"])?,
    };
    let [backend] = &backends[..] else {
        return Err(Failure::wrong_use("render draws with one back end: use `compare` for several"));
    };
    let mut settings = input::settings(&arguments.draw, studio.registry(), &backends)?;
    let need = Need {
        channels: Channels::NONE.with(arguments.channel),
        settings: settings.remove(backend).unwrap_or_default(),
        tolerance_px: choice.as_ref().map_or(base.tolerance_px, |c| c.chosen.tolerance_px),
        ..base
    };
    if arguments.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg")) {
        return lines(arguments, backend, &studio, &scene, &need);
    }
    let drawing = studio.draw(backend, &scene, &need).map_err(Failure::running)?;
    if arguments.output.as_os_str() == "-" {
        print(&picture::terminal(&drawing.framebuffer, arguments.channel, 96));
    } else {
        picture::save(&drawing.framebuffer, arguments.channel, &arguments.output)
            .map_err(Failure::running)?;
    }
    if arguments.draw.json {
        let result = json!({
            "backend": backend, "width": need.width, "height": need.height,
            "prepare_ms": drawing.prepare_ms, "frame_ms": drawing.frame_ms,
            "bytes": drawing.prepared.bytes, "objects": count_decisions(&drawing.prepared.objects),
            "out": arguments.output.to_string_lossy(), "auto": choice,
        });
        print(&format!("{result}\n"));
    } else if !arguments.draw.quiet && arguments.output.as_os_str() != "-" {
        let (prepare, frame) = (drawing.prepare_ms, drawing.frame_ms);
        print(&format!(
            "{}: {backend}, {}x{}, prepared in {prepare:.1} ms, drawn in {frame:.1} ms\n",
            arguments.output.display(),
            need.width,
            need.height
        ));
    }
    if arguments.draw.verbose {
        for note in &scene.notes {
            eprintln!("note: {note}");
        }
        for (object, decision) in scene.objects.iter().zip(drawing.prepared.objects.iter()) {
            eprintln!("{}: {} {}", object.name, decision.word(), decision.why());
        }
    }
    Ok(())
}

/// Draws the contours into a file of vectors.
fn lines(
    arguments: &RenderArguments,
    backend: &str,
    studio: &Studio,
    scene: &Arc<Scene>,
    need: &Need,
) -> Result<(), Failure> {
    let file = arguments.output.display();
    if backend != "stylized" || arguments.channel != Channel::Color {
        return Err(Failure::wrong_use(format!(
            "{file}: lines are drawn by `--backend stylized` as color alone"
        )));
    }
    let begin = Instant::now();
    let svg = vector::lines_as_svg(studio, scene, need).map_err(Failure::running)?;
    let time = begin.elapsed().as_secs_f64() * 1e3;
    picture::write_whole(&arguments.output, svg.as_bytes())
        .map_err(|error| Failure::running(format!("{file}: {error}")))?;
    if arguments.draw.json {
        let result = json!({
            "backend": backend, "width": need.width, "height": need.height, "frame_ms": time, "bytes": svg.len(),
            "out": arguments.output.to_string_lossy(),
        });
        print(&format!("{result}\n"));
    } else if !arguments.draw.quiet {
        print(&format!("{file}: {backend}, {}x{}, drawn in {time:.1} ms\n", need.width, need.height));
    }
    Ok(())
}
