//! What do scene and drawing options mean?

use super::Failure;
use super::arguments::{
    DrawArguments, PluginArguments, ProjectionName, Quality, ReadingArguments, SceneArguments, ViewArguments,
};
use glam::DVec3;
use polyptych::camera::{Camera, Projection};
use polyptych::load::{LoadOptions, RawVolume, load};
use polyptych::plugins::{Isolation, LogLine, Options, PluginBackends, Refusal, Severity, plugin_folders};
use polyptych::scene::Scene;
use polyptych::seam::{Need, Registry, Settings};
use polyptych::{BuiltinBackends, Studio, builtin};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Default picture size.
const SIZE: [u32; 2] = [960, 540];

/// Loads the scene that was named.
pub(super) fn scene(arguments: &SceneArguments) -> Result<Arc<Scene>, Failure> {
    named_scene(arguments.scene.as_deref().unwrap_or("builtin:atelier"), &arguments.reading)
}

/// Loads a scene by its name: a file or `builtin:NAME`.
pub(super) fn named_scene(name: &str, reading: &ReadingArguments) -> Result<Arc<Scene>, Failure> {
    if let Some(builtin) = name.strip_prefix("builtin:") {
        return builtin::scene(builtin).map(Arc::new).map_err(Failure::input);
    }
    let volume = reading
        .volume
        .as_deref()
        .map(|text| {
            text.parse::<RawVolume>().map_err(|e| Failure::wrong_use(format!("--volume {text}: {e}")))
        })
        .transpose()?;
    let (height_map, frame) = (reading.height_map, reading.frame);
    let options = LoadOptions { volume, height_map, frame, ..LoadOptions::default() };
    load(Path::new(name), &options).map(Arc::new).map_err(Failure::input)
}

/// Opens a studio with the threads that were asked for, the built-in back ends and the plugins. What is refused is
/// told on standard error.
pub(super) fn studio(threads: usize, arguments: &PluginArguments) -> Result<Studio, Failure> {
    Studio::new(warned_registry(arguments)?, threads).map_err(Failure::running)
}

/// Opens a studio for measuring: its threads stay on cores of their own where that is possible.
pub(super) fn measuring_studio(threads: usize, arguments: &PluginArguments) -> Result<Studio, Failure> {
    Studio::pinned(warned_registry(arguments)?, threads).map_err(Failure::running)
}

fn warned_registry(arguments: &PluginArguments) -> Result<Registry, Failure> {
    let (registry, refused) = registry(arguments)?;
    for refusal in refused {
        eprintln!("warning: plugin refused: {refusal}");
    }
    Ok(registry)
}

/// Returns the built-in back ends and the plugins, and what was refused.
pub(super) fn registry(arguments: &PluginArguments) -> Result<(Registry, Vec<Refusal>), Failure> {
    for folder in &arguments.plugin_dir {
        if !folder.is_dir() {
            let folder = folder.display();
            return Err(Failure::wrong_use(format!("--plugin-dir {folder}: there is no such folder")));
        }
    }
    let mut registry = Registry::builtin();
    let mut options = Options { log: Arc::new(print_log), ..Options::default() };
    if let Some(limit) = arguments.plugin_limit {
        options.limits.silence = Duration::from_secs(limit);
    }
    if arguments.trust_plugins {
        options.isolation = Isolation::InProcess;
    }
    // A folder of the environment that is not there holds no plugins.
    let folders: Vec<_> =
        plugin_folders(&arguments.plugin_dir).into_iter().filter(|folder| folder.is_dir()).collect();
    let refused = registry.add_plugins(&folders, &options).map_err(Failure::input)?;
    Ok((registry, refused))
}

fn print_log(line: LogLine) {
    if line.severity > Severity::Debug {
        let LogLine { backend, severity, object, text } = line;
        let object = object.map_or(String::new(), |o| format!("object {o}: "));
        eprintln!("{backend}: {severity:?}: {object}{text}");
    }
}

/// Returns the need of a picture, without settings.
pub(super) fn need(arguments: &DrawArguments, scene: &Scene) -> Result<Need, Failure> {
    need_of(arguments, scene, arguments.size.unwrap_or(SIZE))
}

/// Returns the need of a picture of a size, without settings.
pub(super) fn need_of(
    arguments: &DrawArguments,
    scene: &Scene,
    [width, height]: [u32; 2],
) -> Result<Need, Failure> {
    let (tolerance, samples) = match arguments.quality.unwrap_or(Quality::Normal) {
        Quality::Draft => (2.0, 1),
        Quality::Normal => (0.5, 1),
        Quality::High => (0.25, 4),
        Quality::Exact => (0.05, 16),
    };
    let tolerance_px = arguments.tolerance.unwrap_or(tolerance);
    if !(tolerance_px > 0.0 && tolerance_px.is_finite()) {
        return Err(Failure::wrong_use(format!(
            "--tolerance {tolerance_px}: must be a positive number of pixels"
        )));
    }
    let camera = camera(&arguments.view, scene, f64::from(width) / f64::from(height))?;
    let samples = arguments.samples.unwrap_or(samples);
    Ok(Need { tolerance_px, samples, ..Need::new(camera, width, height) })
}

fn camera(view: &ViewArguments, scene: &Scene, aspect: f64) -> Result<Camera, Failure> {
    let projection = projection(view)?;
    if let Some(name) = &view.camera {
        let names: Vec<_> = scene.cameras.iter().map(|(n, _)| n.as_str()).collect();
        let Some((_, camera)) = scene.cameras.iter().find(|(n, _)| n == name) else {
            let all = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return Err(Failure::wrong_use(format!(
                "--camera {name}: the scene has no such camera (it has: {all})"
            )));
        };
        return Ok(with_projection(camera.clone(), projection));
    }
    if let Some(eye) = view.eye {
        let target = view.target.map_or(scene.bounds().center(), DVec3::from_array);
        let up = view.up.map_or(DVec3::Y, DVec3::from_array);
        let projection = projection.unwrap_or(Projection::Perspective { fov_y: 0.7 });
        return Ok(Camera::look_at(DVec3::from_array(eye), target, up, projection));
    }
    match (&view.view, scene.cameras.first()) {
        (None, Some((_, camera))) => Ok(with_projection(camera.clone(), projection)),
        (angles, _) => {
            let [azimuth, elevation] = angles.unwrap_or([34.0, 20.0]).map(f64::to_radians);
            let projection = projection.unwrap_or(Projection::Perspective { fov_y: 0.7 });
            Ok(Camera::framing(&scene.bounds(), azimuth, elevation, aspect, projection))
        }
    }
}

fn with_projection(mut camera: Camera, projection: Option<Projection>) -> Camera {
    if let Some(projection) = projection {
        camera.projection = projection;
    }
    camera
}

/// Returns the projection that was asked for; none when neither it nor a field of view was given.
fn projection(view: &ViewArguments) -> Result<Option<Projection>, Failure> {
    if view.projection.is_none() && view.fov.is_none() {
        return Ok(None);
    }
    let name = view.projection.unwrap_or(ProjectionName::Perspective);
    let (default, most) = match name {
        ProjectionName::Perspective => (40.0, 179.0),
        ProjectionName::Orthographic => (0.0, f64::INFINITY),
        ProjectionName::Fisheye => (180.0, 360.0),
        ProjectionName::Cylindrical => (180.0, 360.0),
    };
    let degrees = view.fov.unwrap_or(default);
    if !(degrees > 0.0 || view.fov.is_none()) || degrees > most {
        return Err(Failure::wrong_use(format!("--fov {degrees}: must lie between 0 and {most} degrees")));
    }
    let fov = degrees.to_radians();
    Ok(Some(match name {
        ProjectionName::Perspective => Projection::Perspective { fov_y: fov },
        // The height is set by the framing; with an explicit eye it is 2 m.
        ProjectionName::Orthographic => Projection::Orthographic { height: 2.0 },
        ProjectionName::Fisheye => Projection::Fisheye { fov },
        ProjectionName::Cylindrical => Projection::Cylindrical { fov_x: fov, fov_y: 1.0 },
    }))
}

/// Lists the back ends that were asked for, or the given ones.
pub(super) fn backends(
    arguments: &DrawArguments,
    registry: &Registry,
    default: &[&str],
) -> Result<Vec<String>, Failure> {
    let asked: Vec<String> = if arguments.backend.is_empty() {
        default.iter().map(|&s| s.to_owned()).collect()
    } else {
        arguments.backend.clone()
    };
    for id in &asked {
        registry.info(id).map_err(|e| Failure::wrong_use(format!("--backend {id}: {e}")))?;
    }
    Ok(asked)
}

/// Sorts `--set key=value` by back end. A key without a back end goes to every one that declares it; it is an
/// error when none does.
pub(super) fn settings(
    arguments: &DrawArguments,
    registry: &Registry,
    backends: &[String],
) -> Result<BTreeMap<String, Settings>, Failure> {
    let mut all: BTreeMap<String, Settings> = BTreeMap::new();
    for pair in &arguments.set {
        let refuse = |reason: String| Failure::wrong_use(format!("--set {pair}: {reason}"));
        let (key, value) = pair.split_once('=').ok_or_else(|| refuse("write key=value".to_owned()))?;
        let mut set = |backend: &str, key: &str| -> Result<(), Failure> {
            let info = registry.info(backend).map_err(|e| refuse(e.to_string()))?;
            let settings = all.entry(backend.to_owned()).or_default();
            settings.set(backend, &info.parameters, key, value).map_err(|e| refuse(e.to_string()))
        };
        let named = key.split_once('.').filter(|(id, _)| registry.info(id).is_ok());
        if let Some((backend, key)) = named {
            set(backend, key)?;
            continue;
        }
        let declares =
            |id: &&String| registry.info(id).is_ok_and(|i| i.parameters.iter().any(|p| p.name == key));
        let takers: Vec<&String> = backends.iter().filter(declares).collect();
        match (takers.is_empty(), backends.first()) {
            (true, Some(first)) => set(first, key)?,
            _ => takers.into_iter().try_for_each(|backend| set(backend, key))?,
        }
    }
    Ok(all)
}
