//! What does every back end promise, and does one keep it? One suite, for built-in back ends and for plugins.
//!
//! Each check makes what it needs and says in one line what is wrong. The tests run them for the built-in back ends,
//! `polyptych validate` for a plugin, each in a process of its own.

mod drawing;
mod hostile;
mod pictures;
mod steering;

use crate::framebuffer::Channels;
use crate::scene::Scene;
use crate::seam::{Need, Registry};
use crate::{Drawing, Studio};
use std::sync::Arc;

/// What is checked.
#[derive(Clone)]
pub struct Subject {
    /// Back ends; the reference is there, too, as the ruler.
    pub registry: Registry,
    /// Id of the one that is checked.
    pub backend: String,
    /// Seed of what is random.
    pub seed: u64,
    /// Folder for pictures of what failed.
    pub pictures: Option<std::path::PathBuf>,
}

/// A promise that is checked.
#[derive(Clone, Copy)]
pub struct Check {
    /// Its name: `same-bytes`.
    pub name: &'static str,
    /// What is promised.
    pub promise: &'static str,
    run: fn(&Subject) -> Result<(), String>,
}

/// The checks that every back end passes, built in or not.
pub const CHECKS: [Check; 17] = [
    check("same-bytes", "the same bytes for any number of threads", drawing::same_bytes),
    check("second-frame", "a second frame is the same as the first", drawing::second_frame),
    check("after-a-switch", "a scene is the same after another one was drawn", drawing::after_a_switch),
    check("sizes", "every size is drawn, from 0x0 to 7680 columns", drawing::sizes),
    check("channels", "channels do not depend on each other", drawing::channels),
    check("every-pixel", "every pixel of every declared channel is written", drawing::every_pixel),
    check("accounts", "every object is accounted for, as planned", drawing::accounts),
    check("required", "a required object that cannot be drawn is an error", drawing::required),
    check("projections", "every projection is drawn", drawing::projections),
    check("empty-scene", "an empty scene is its background", drawing::empty_scene),
    check("cancelling", "after cancelling the next call works", steering::cancelling),
    check("stops-soon", "it stops within 5 ms", steering::stops_soon),
    check("edits", "an edited scene is drawn as a new one", hostile::edits),
    check("parameters", "any allowed parameters are drawn with", hostile::parameters),
    check("wild-numbers", "numbers that are not finite are survived", hostile::wild_numbers),
    check("keeps-no-memory", "1,000 frames take no more memory than 100", steering::keeps_no_memory),
    check("picture", "it shows what the reference shows", pictures::picture),
];

const fn check(name: &'static str, promise: &'static str, run: fn(&Subject) -> Result<(), String>) -> Check {
    Check { name, promise, run }
}

impl Check {
    /// Runs the check.
    ///
    /// # Errors
    /// Says in one line what is wrong.
    pub fn run(&self, subject: &Subject) -> Result<(), String> {
        (self.run)(subject)
    }
}

/// Finds a check by its name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Check> {
    CHECKS.iter().find(|check| check.name == name)
}

impl Subject {
    /// Checks a back end of a registry.
    #[must_use]
    pub fn new(registry: Registry, backend: impl Into<String>) -> Self {
        Self { registry, backend: backend.into(), seed: 1, pictures: None }
    }

    fn studio(&self, threads: usize) -> Result<Studio, String> {
        Studio::new(self.registry.clone(), threads).map_err(|e| e.to_string())
    }

    fn draw(&self, threads: usize, scene: &Arc<Scene>, need: &Need) -> Result<Drawing, String> {
        self.studio(threads)?.draw(&self.backend, scene, need).map_err(|e| e.to_string())
    }

    /// Returns a need with all channels that keeps conversions small.
    fn need(&self, scene: &Scene, width: u32, height: u32) -> Result<Need, String> {
        let info = self.registry.info(&self.backend).map_err(|e| e.to_string())?;
        let camera =
            scene.cameras.first().map(|(_, camera)| camera.clone()).ok_or("the scene has no camera")?;
        let base = Need::new(camera, width, height);
        let mut need = Need { channels: Channels::ALL, tolerance_px: 2.0, ..base };
        if info.parameters.iter().any(|p| p.name == "detail.resolution") {
            // A back end whose least resolution is finer keeps its default.
            let _ = need.settings.set(&self.backend, &info.parameters, "detail.resolution", "32");
        }
        Ok(need)
    }
}

/// Returns a built-in scene.
fn scene(name: &str) -> Result<Arc<Scene>, String> {
    crate::builtin::scene(name).map(Arc::new).map_err(|e| e.to_string())
}

/// Fails with a line unless something holds.
fn hold(holds: bool, line: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(line()) }
}

/// Random numbers from a seed (Steele, Lea, Flood, *SplitMix*, OOPSLA 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }

    /// Returns a number in [0, 1).
    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}
