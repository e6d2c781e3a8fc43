//! How fast is this machine, against the one that plans reckon with?
//!
//! A plan foretells the time of a frame from counts and from constants that were measured on one machine. Another machine,
//! or a build of another kind, is faster or slower by about the same factor in everything a back end does. So each back end
//! draws the built-in scenes once, which takes some seconds, and the factor is kept in the user's cache folder. Where
//! nothing can be kept it is measured again; where nothing can be measured it is 1.

use crate::builtin;
use crate::framebuffer::Framebuffer;
use crate::report::machine;
use crate::seam::{Need, Registry};
use crate::studio::{Studio, StudioError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// How much longer frames take here than plans reckon, back end by back end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pace {
    /// What was measured: another machine or version measures anew.
    of: String,
    factors: BTreeMap<String, f64>,
}

/// Sizes of the picture that is drawn: the first where that is quick, since what does not grow with the picture is much of
/// a small one.
const SIZES: [[u32; 2]; 2] = [[480, 270], [192, 108]];

/// A picture that is planned to take less is quick, milliseconds.
const QUICK_MS: f64 = 60.0;

/// Frames of it; the fastest counts, so that other programs do not.
const FRAMES: usize = 3;

/// Factors that are believed: others come from a damaged file.
const SANE: std::ops::Range<f64> = 1e-3..1e3;

impl Pace {
    /// Returns what is known of this machine, and measures it where nothing is.
    ///
    /// # Errors
    /// When a back end cannot draw the built-in scenes.
    pub fn of_this_machine(registry: &Registry) -> Result<Self, StudioError> {
        if let Some(pace) = Self::known(registry) {
            return Ok(pace);
        }
        let pace = Self::measured(registry)?;
        if let (Some(path), Ok(text)) = (cache(), serde_json::to_string_pretty(&pace)) {
            // A cache that cannot be written costs a second next time, and nothing else.
            let folder = path.parent().map_or(Ok(()), std::fs::create_dir_all);
            let _ = folder.and_then(|()| crate::picture::write_whole(&path, text.as_bytes()));
        }
        Ok(pace)
    }

    /// Returns what was measured before; nothing where that is still to be done, which takes some seconds.
    #[must_use]
    pub fn known(registry: &Registry) -> Option<Self> {
        cache().and_then(|path| Self::kept(&path, registry))
    }

    /// Draws the built-in scenes with every built-in back end on one thread; the factor is the mean of theirs, as they
    /// stand for all kinds of shapes.
    ///
    /// # Errors
    /// When a back end cannot draw them.
    pub fn measured(registry: &Registry) -> Result<Self, StudioError> {
        let mut studio = Studio::pinned(registry.clone(), 1)?;
        let mut logarithms: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        for name in builtin::NAMES {
            let scene = Arc::new(builtin::scene(name).unwrap_or_default());
            let Some((_, camera)) = scene.cameras.first() else { continue };
            for id in measurable(registry) {
                let [large, small] = SIZES.map(|[w, h]| Need::new(camera.clone(), w, h));
                let mut need = large;
                let mut planned = studio.renderer(&id)?.plan(&scene, &need).estimated_ms;
                if planned > QUICK_MS {
                    need = small;
                    planned = studio.renderer(&id)?.plan(&scene, &need).estimated_ms;
                }
                studio.prepare(&id, &scene, &need)?;
                let mut picture = Framebuffer::new(need.width, need.height, need.channels);
                let mut best = f64::INFINITY;
                for _ in 0..FRAMES {
                    best = best.min(frame_ms(&mut studio, &id, &need, &mut picture)?);
                }
                logarithms.entry(id).or_default().push((best / planned.max(1e-6)).ln());
            }
        }
        let mean = |list: &Vec<f64>| (list.iter().sum::<f64>() / list.len().max(1) as f64).exp();
        let factors = logarithms.iter().map(|(id, list)| (id.clone(), mean(list))).collect();
        Ok(Self { of: described(registry), factors })
    }

    /// Returns how much longer frames of a back end take than its plans say; 1 where that is not known.
    #[must_use]
    pub fn factor(&self, backend: &str) -> f64 {
        self.factors.get(backend).copied().filter(|f| SANE.contains(f)).unwrap_or(1.0)
    }

    fn kept(path: &std::path::Path, registry: &Registry) -> Option<Self> {
        let pace: Self = serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()?;
        (pace.of == described(registry)).then_some(pace)
    }
}

/// Draws what was prepared and returns the milliseconds that it took: those of work, where the system tells, so that what
/// other programs do meanwhile does not count. For one thread; several do not work all the time.
///
/// # Errors
/// When nothing was prepared.
pub fn frame_ms(
    studio: &mut Studio,
    backend: &str,
    need: &Need,
    picture: &mut Framebuffer,
) -> Result<f64, StudioError> {
    let before = studio.pool().worked_ms();
    let (_, ms) = studio.render(backend, &need.frame(), picture)?;
    let worked = studio.pool().worked_ms().zip(before).map(|(after, before)| after - before);
    Ok(worked.map_or(ms, |worked| worked.min(ms)))
}

/// Lists the back ends that are measured: a plugin is someone else's, and its plan too.
fn measurable(registry: &Registry) -> Vec<String> {
    let builtin = ["reference", "raster", "voxel", "freeform", "stylized"];
    let is_there = |id: &&str| registry.info(id).is_ok();
    builtin.into_iter().filter(is_there).map(str::to_owned).collect()
}

/// Says what a measurement holds for.
fn described(registry: &Registry) -> String {
    let build = if cfg!(debug_assertions) { "debug" } else { "release" };
    let back_ends: Vec<String> = measurable(registry)
        .iter()
        .filter_map(|id| registry.info(id).ok().map(|info| format!("{id} {}", info.version)))
        .collect();
    format!("{}, {build}, {}", machine(), back_ends.join(", "))
}

/// Returns the file in the user's cache folder; nothing where there is no such folder.
fn cache() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let base = if cfg!(windows) {
        folder("LOCALAPPDATA")
    } else {
        folder("XDG_CACHE_HOME").or_else(|| folder("HOME").map(|home| home.join(".cache")))
    };
    base.map(|base| base.join("polyptych").join("pace.json"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BuiltinBackends as _;

    #[test]
    fn what_was_measured_elsewhere_or_is_damaged_is_not_believed() {
        let registry = Registry::builtin();
        let folder = std::env::temp_dir().join(format!("polyptych-pace-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("pace.json");
        let factors = BTreeMap::from([("raster".to_owned(), 2.5), ("voxel".to_owned(), 1e9)]);
        let pace = Pace { of: described(&registry), factors };
        let write = |pace: &Pace| std::fs::write(&path, serde_json::to_string(pace).unwrap()).unwrap();
        write(&pace);
        let kept = Pace::kept(&path, &registry).unwrap();
        assert_eq!(["raster", "voxel", "mine"].map(|id| kept.factor(id)), [2.5, 1.0, 1.0]);
        write(&Pace { of: "another machine".to_owned(), ..pace });
        assert_eq!(Pace::kept(&path, &registry), None);
        std::fs::write(&path, "{").unwrap();
        assert_eq!(Pace::kept(&path, &registry), None);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
