//! `polyptych animate`: the frames of a turntable, or of a flight through a scene's cameras.

use super::arguments::AnimateArguments;
use super::{Failure, input, print};
use image::RgbImage;
use indicatif::{ProgressBar, ProgressStyle};
use polyptych::Studio;
use polyptych::animate::{Motion, apng, gif};
use polyptych::framebuffer::{Channel, Channels};
use polyptych::picture::{displayed, encode, write_whole};
use polyptych::scene::Scene;
use polyptych::seam::{Frame, Need};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Frames of a whole animation where none are asked for.
const COUNT: u32 = 120;

/// What is to be drawn, and where it goes.
struct Job {
    scene: Arc<Scene>,
    backend: String,
    need: Need,
    motion: Motion,
    /// Frames of the whole, and those of them that are wanted.
    count: u32,
    frames: Vec<u32>,
    folder: PathBuf,
    /// The file that they become, if it is one.
    film: Option<PathBuf>,
}

pub(super) fn run(arguments: &AnimateArguments) -> Result<(), Failure> {
    let scene = input::scene(&arguments.scene)?;
    let threads = usize::from(arguments.draw.threads.unwrap_or(0));
    let mut studio = input::studio(threads, &arguments.draw.plugins)?;
    let job = job(arguments, scene, &studio)?;
    let identity = identity(arguments, &job);
    claim(&job.folder, &identity)?;
    let (drawn, kept) = draw(&mut studio, &job)?;
    if let Some(film) = &job.film {
        bind(&job, film, arguments.fps)?;
        // The film holds all of them.
        std::fs::remove_dir_all(&job.folder).map_err(Failure::running)?;
    }
    let out = job.film.as_deref().unwrap_or(&job.folder).display();
    if arguments.draw.json {
        let result = json!({
            "backend": job.backend, "width": job.need.width, "height": job.need.height, "count": job.count,
            "drawn": drawn, "kept": kept, "out": out.to_string(),
        });
        print(&format!("{result}\n"));
    } else if !arguments.draw.quiet {
        print(&format!("{out}: {drawn} frames drawn, {kept} were there already\n"));
    }
    Ok(())
}

/// Reads what is asked for.
fn job(arguments: &AnimateArguments, scene: Arc<Scene>, studio: &Studio) -> Result<Job, Failure> {
    let backends = input::backends(&arguments.draw, studio.registry(), &["raster"])?;
    let [backend] = &backends[..] else {
        return Err(Failure::wrong_use("animate draws with one back end: run it once for each"));
    };
    let mut settings = input::settings(&arguments.draw, studio.registry(), &backends)?;
    let settings = settings.remove(backend).unwrap_or_default();
    let need = Need { settings, channels: Channels::COLOR, ..input::need(&arguments.draw, &scene)? };
    let motion = if arguments.turntable { Motion::Turntable } else { Motion::Flight };
    if motion == Motion::Flight && scene.cameras.len() < 2 {
        let why = "the scene has no two cameras to fly between: turn it with --turntable";
        return Err(Failure::wrong_use(why));
    }
    let asked = arguments.frames.map(|[first, end]| first..end);
    let count = arguments.count.unwrap_or(asked.as_ref().map_or(COUNT, |frames| frames.end));
    let frames = asked.unwrap_or(0..count);
    if frames.end > count {
        return Err(Failure::wrong_use(format!("--frames: there are {count} frames in all (--count)")));
    }
    let [shard, shards] = arguments.shard.unwrap_or([1, 1]);
    let frames = frames.filter(|frame| frame % shards == shard - 1).collect();
    let extension = arguments.output.extension().unwrap_or_default().to_ascii_lowercase();
    let film = (extension == "gif" || extension == "apng").then(|| arguments.output.clone());
    if film.is_some() && shards > 1 {
        return Err(Failure::wrong_use("--shard: a part of the frames goes into a folder, not into a film"));
    }
    let mut folder = arguments.output.clone().into_os_string();
    if film.is_some() {
        folder.push(".frames");
    }
    Ok(Job { scene, backend: backend.clone(), need, motion, count, frames, folder: folder.into(), film })
}

/// Returns what frames of one folder have in common.
fn identity(arguments: &AnimateArguments, job: &Job) -> Value {
    let name = arguments.scene.scene.as_deref().unwrap_or_default();
    // A scene file that was written since is another scene.
    let written = std::fs::metadata(name).and_then(|file| file.modified()).ok();
    let written =
        written.and_then(|time| time.duration_since(std::time::UNIX_EPOCH).ok()).map(|d| d.as_secs());
    json!({
        "scene": name, "written": written, "backend": job.backend, "settings": job.need.settings,
        "width": job.need.width, "height": job.need.height, "tolerance": job.need.tolerance_px,
        "samples": job.need.samples, "turntable": job.motion == Motion::Turntable, "count": job.count,
        "camera": format!("{:?}", job.need.camera),
    })
}

/// Takes a folder for an animation; one that holds frames of another is refused.
fn claim(folder: &Path, identity: &Value) -> Result<(), Failure> {
    let file = folder.join("animation.json");
    let text = format!("{identity:#}\n");
    match std::fs::read_to_string(&file) {
        Ok(before) if before == text => Ok(()),
        Ok(_) => {
            let folder = folder.display();
            Err(Failure::wrong_use(format!(
                "{folder}: holds frames of another animation: take another folder"
            )))
        }
        Err(_) => write_whole(&file, text.as_bytes())
            .map_err(|error| Failure::running(format!("{}: {error}", file.display()))),
    }
}

fn file_of(job: &Job, frame: u32) -> PathBuf {
    job.folder.join(format!("frame-{frame:05}.png"))
}

/// Draws the frames that are not there yet. Returns how many were drawn, and how many were there.
fn draw(studio: &mut Studio, job: &Job) -> Result<(usize, usize), Failure> {
    let missing: Vec<u32> =
        job.frames.iter().copied().filter(|&frame| !file_of(job, frame).exists()).collect();
    let bar = ProgressBar::new(missing.len() as u64);
    let style = ProgressStyle::with_template("{bar:30} frame {pos} of {len}, {eta} left");
    bar.set_style(style.unwrap_or(ProgressStyle::default_bar()));
    for &frame in &missing {
        let camera = job.motion.camera(&job.scene, &job.need.camera, job.motion.share(frame, job.count));
        let need = Need { camera: camera.clone(), ..job.need.clone() };
        studio.prepare(&job.backend, &job.scene, &need).map_err(Failure::running)?;
        let mut target = polyptych::framebuffer::Framebuffer::new(need.width, need.height, need.channels);
        studio.render(&job.backend, &Frame { camera }, &mut target).map_err(Failure::running)?;
        let picture = encode(&displayed(&target, Channel::Color), need.width, need.height, "png");
        let file = file_of(job, frame);
        write_whole(&file, &picture.map_err(Failure::running)?)
            .map_err(|error| Failure::running(format!("{}: {error}", file.display())))?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok((missing.len(), job.frames.len() - missing.len()))
}

/// Makes one file of all frames.
fn bind(job: &Job, film: &Path, fps: u16) -> Result<(), Failure> {
    let read = |frame: &u32| -> Result<RgbImage, String> {
        let file = file_of(job, *frame);
        let picture = image::open(&file).map_err(|error| format!("{}: {error}", file.display()))?;
        Ok(picture.into_rgb8())
    };
    let frames = job.frames.iter().map(read);
    let bytes = if film.extension().is_some_and(|e| e.eq_ignore_ascii_case("gif")) {
        gif(frames, fps)
    } else {
        apng(frames, job.frames.len() as u32, [job.need.width, job.need.height], fps)
    };
    write_whole(film, &bytes.map_err(Failure::running)?)
        .map_err(|error| Failure::running(format!("{}: {error}", film.display())))
}
