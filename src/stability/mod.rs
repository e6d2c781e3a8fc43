//! Where does each method fail: one parameter swept until the picture is wrong?
//!
//! Every case draws a small scene whose difficulty one number sets, with each back end and with the reference, and counts
//! one kind of error. `breaks_at` is the first value at which the error passes the case's limit. Where a better way is
//! known, it is swept too, and what it costs is told.

mod cases;
mod count;
mod scenes;
mod steady;
mod sturm;

pub use cases::cases;

use crate::compare::REFERENCE;
use crate::framebuffer::{Channel, Framebuffer};
use crate::parallel::Threads as _;
use crate::picture::{displayed, encode};
use crate::seam::{Need, Settings};
use crate::studio::{Studio, StudioError};
use count::{Count, Drawn, Trial};
use scenes::Setup;
use serde::Serialize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;

/// A way in which methods fail.
pub struct Case {
    /// Its name on the command line.
    pub id: &'static str,
    /// What is drawn, for people.
    pub title: &'static str,
    /// What is swept.
    pub parameter: &'static str,
    /// Values, easy ones first.
    pub values: Vec<f64>,
    /// Whether values are far apart and want a logarithmic axis.
    pub is_logarithmic: bool,
    /// Largest error that still counts as right.
    pub limit: f64,
    /// What the error is.
    pub counted: &'static str,
    /// Whether the back end is held against the reference's picture of its own model, where it has one: then only the
    /// method counts, and not what was converted before.
    pub is_method: bool,
    /// Whether no value at all may break it.
    pub is_promise: bool,
    /// Ids of back ends that take part; others draw nothing that this case is about.
    pub backends: &'static [&'static str],
    build: fn(f64) -> Setup,
    count: Count,
    /// A better way and what changes in it.
    better: Option<Better>,
}

/// A better way: what it is called, and what changes in a setup.
type Better = (&'static str, fn(&mut Setup));

/// What a sweep of one case with one back end found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// The case's name.
    pub case: &'static str,
    /// Id of the back end.
    pub backend: String,
    /// The better way, or nothing for the plain one.
    pub method: Option<&'static str>,
    /// What was swept.
    pub parameter: &'static str,
    /// Values up to the one after the break.
    pub values: Vec<f64>,
    /// Error at each.
    pub error: Vec<f64>,
    /// Time of a frame at each, milliseconds.
    pub ms: Vec<f64>,
    /// The first value at which the error passes the limit; nothing when none does.
    pub breaks_at: Option<f64>,
    /// Largest error that still counts as right.
    pub limit: f64,
    /// Whether what is promised holds: a promise never breaks, other cases break where they may.
    pub passed: bool,
    /// What went wrong besides: a panic, a refusal.
    pub failure: Option<String>,
    /// Whether values were left out because they would take too long.
    pub is_cut_short: bool,
    /// Pictures before and at the break (or at the last value), and the reference's at it, as JPEG.
    #[serde(skip)]
    pub pictures: Vec<(f64, Vec<u8>)>,
}

/// One value of a case, drawn and counted.
pub struct Probe {
    /// The error.
    pub error: f64,
    /// Time of a frame, milliseconds.
    pub ms: f64,
    /// Time to prepare, milliseconds, where it counts.
    pub prepare_ms: f64,
    /// The back end's picture, where a single one is compared.
    pub picture: Option<Framebuffer>,
    /// The reference's.
    pub reference: Option<Framebuffer>,
}

impl Probe {
    /// Returns the pixel that is most wrong: another object before another distance before another color.
    #[must_use]
    pub fn worst_pixel(&self) -> Option<[u32; 2]> {
        let (a, b) = (self.picture.as_ref()?, self.reference.as_ref()?);
        if (a.width(), a.height()) != (b.width(), b.height()) || a.color().is_empty() {
            return None;
        }
        let off = |i: usize| {
            let id = a.id().get(i) != b.id().get(i);
            let far = |p: &Framebuffer| p.distance().get(i).copied().filter(|d| d.is_finite()).unwrap_or(0.0);
            let distance = (far(a) - far(b)).abs() / far(b).max(1e-6);
            f64::from(u8::from(id)) * 1e6
                + f64::from(distance.min(1e3)) * 1e2
                + f64::from((a.color()[i] - b.color()[i]).abs().max_element().min(1.0))
        };
        let worst = (0..a.color().len()).max_by(|&i, &j| off(i).total_cmp(&off(j)))?;
        (off(worst) > 0.0).then(|| [worst as u32 % a.width(), worst as u32 / a.width()])
    }
}

impl Case {
    /// Draws one value with a back end.
    ///
    /// # Errors
    /// When the back end refuses the scene or panics.
    pub fn probe(
        &self,
        studio: &mut Studio,
        backend: &str,
        value: f64,
        is_better: bool,
    ) -> Result<Probe, String> {
        let plain = (self.build)(value);
        let mut own = (self.build)(value);
        if let Some((_, change)) = self.better.filter(|_| is_better) {
            change(&mut own);
        }
        // A panic is a finding here, and the other cases go on: the studio makes the renderer anew.
        let first = || (self.build)(self.values[0]);
        let index = self.values.iter().position(|v| *v == value).unwrap_or(0);
        let before = || (self.build)(self.values[index - 1]);
        let before: Option<&dyn Fn() -> Setup> = if index > 0 { Some(&before) } else { None };
        let trial = Trial { backend, own, plain, first: &first, before, is_method: self.is_method };
        let result = catch_unwind(AssertUnwindSafe(|| self.count.count(studio, &trial)));
        match result {
            Ok(Ok(Drawn { error, ms, prepare_ms, picture, reference })) => {
                Ok(Probe { error, ms, prepare_ms, picture, reference })
            }
            Ok(Err(error)) => Err(error.to_string()),
            Err(_) => Err("it panicked".to_owned()),
        }
    }

    /// Sweeps the case with a back end until the value after the break.
    #[must_use]
    pub fn sweep(&self, studio: &mut Studio, backend: &str, is_better: bool) -> Outcome {
        let mut outcome = Outcome {
            case: self.id,
            backend: backend.to_owned(),
            method: self.better.filter(|_| is_better).map(|(name, _)| name),
            parameter: self.parameter,
            values: Vec::new(),
            error: Vec::new(),
            ms: Vec::new(),
            breaks_at: None,
            limit: self.limit,
            passed: true,
            failure: None,
            is_cut_short: false,
            pictures: Vec::new(),
        };
        let mut last: Option<(f64, Probe)> = None;
        for (index, &value) in self.values.iter().enumerate() {
            let probe = match self.probe(studio, backend, value, is_better) {
                Ok(probe) => probe,
                Err(failure) => {
                    outcome.failure = Some(failure);
                    Probe { error: f64::INFINITY, ms: 0.0, prepare_ms: 0.0, picture: None, reference: None }
                }
            };
            outcome.values.push(value);
            outcome.error.push(probe.error);
            outcome.ms.push(probe.ms);
            let next = self.values.get(index + 1).map_or(1.0, |next| next / value.max(1.0));
            outcome.is_cut_short =
                self.is_timed() && next > 1.0 && (probe.ms + probe.prepare_ms) * next > PATIENCE_MS;
            let is_broken = probe.error.is_nan() || probe.error > self.limit;
            if outcome.breaks_at.is_some() {
                break;
            }
            if is_broken {
                outcome.breaks_at = Some(value);
                outcome.pictures = last.iter().chain([&(value, probe)]).flat_map(pictures).collect();
                last = None;
                // A promise is tried to its end; elsewhere one value more shows how it goes on.
                if self.is_promise {
                    outcome.passed = false;
                }
            } else {
                last = Some((value, probe));
            }
            if outcome.is_cut_short {
                break;
            }
        }
        if outcome.pictures.is_empty() {
            outcome.pictures = last.iter().flat_map(pictures).collect();
        }
        outcome
    }

    /// Sweeps the plain way, and the better one where that breaks.
    fn both_ways(&self, studio: &mut Studio, backend: &str) -> Vec<Outcome> {
        let plain = self.sweep(studio, backend, false);
        let better =
            (self.better.is_some() && plain.breaks_at.is_some()).then(|| self.sweep(studio, backend, true));
        std::iter::once(plain).chain(better).collect()
    }

    /// Tells whether times are what it counts.
    fn is_timed(&self) -> bool {
        self.count == Count::Growth
    }

    /// Names the better way, where there is one.
    #[must_use]
    pub fn better(&self) -> Option<&'static str> {
        self.better.map(|(name, _)| name)
    }
}

fn pictures((value, probe): &(f64, Probe)) -> Vec<(f64, Vec<u8>)> {
    let jpeg = |p: &Framebuffer| {
        encode(&displayed(p, Channel::Color), p.width(), p.height(), "jpg").ok().map(|j| (*value, j))
    };
    probe.picture.iter().chain(&probe.reference).filter_map(jpeg).collect()
}

/// Sweeps cases with back ends, and their better ways; `progress` is told as they end how many are done, and which came last.
///
/// Pictures are too small to share, so each thread draws cases of its own, with a renderer of one thread. Cases about how
/// cost grows come last, one by one with all threads: nothing else may take their time.
pub fn stability(
    studio: &mut Studio,
    cases: &[Case],
    backends: &[String],
    progress: &mut dyn FnMut(usize, usize, &str),
) -> Vec<Outcome> {
    let runs: Vec<(&Case, &String)> = cases
        .iter()
        .flat_map(|case| {
            let takes =
                move |b: &&String| case.backends.is_empty() || case.backends.iter().any(|id| id == *b);
            backends.iter().filter(takes).map(move |b| (case, b))
        })
        .collect();
    let registry = studio.registry().clone();
    let workers: Vec<Studio> =
        (0..studio.pool().count()).filter_map(|_| Studio::new(registry.clone(), 1).ok()).collect();
    let (timed, free): (Vec<usize>, Vec<usize>) =
        (0..runs.len()).partition(|&i| workers.is_empty() || runs[i].0.is_timed());
    let mut outcomes: Vec<Vec<Outcome>> = vec![Vec::new(); runs.len()];
    let mut done = 0;
    let mut ended = |index: usize, swept: Vec<Outcome>| {
        done += 1;
        progress(done, runs.len(), &format!("{}: {}", runs[index].0.id, runs[index].1));
        outcomes[index] = swept;
    };
    let next = AtomicUsize::new(0);
    let (sender, receiver) = channel();
    std::thread::scope(|scope| {
        for mut own in workers {
            let (sender, next, free, runs) = (sender.clone(), &next, &free, &runs);
            scope.spawn(move || {
                while let Some(&index) = free.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let (case, backend) = runs[index];
                    if sender.send((index, case.both_ways(&mut own, backend))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        receiver.iter().for_each(|(index, swept)| ended(index, swept));
    });
    for index in timed {
        let (case, backend) = runs[index];
        ended(index, case.both_ways(studio, backend));
    }
    outcomes.into_iter().flatten().collect()
}

/// A load is not raised any further where the next would take longer than this, milliseconds.
const PATIENCE_MS: f64 = 4000.0;

/// Draws a setup with a back end and all channels that are compared. Returns the picture and the frame's milliseconds.
fn draw(studio: &mut Studio, backend: &str, setup: &Setup) -> Result<(Framebuffer, f64), StudioError> {
    draw_measured(studio, backend, setup).map(|(picture, ms, ..)| (picture, ms))
}

/// The same with the milliseconds to prepare and the bytes held.
fn draw_measured(
    studio: &mut Studio,
    backend: &str,
    setup: &Setup,
) -> Result<(Framebuffer, f64, f64, u64), StudioError> {
    let mut need: Need = setup.need.clone();
    need.settings = Settings::default();
    let info = studio.registry().info(backend)?.clone();
    for (name, value) in &setup.settings {
        // A better way is a setting of some back ends; others draw as they are.
        let _ = need.settings.set(backend, &info.parameters, name, value);
    }
    let k = if backend == REFERENCE { 1 } else { setup.supersampling };
    (need.width, need.height) = (need.width * k, need.height * k);
    let drawing = studio.draw(backend, &setup.scene, &need)?;
    Ok((drawing.framebuffer, drawing.frame_ms, drawing.prepare_ms, drawing.prepared.bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BuiltinBackends as _;
    use crate::seam::Registry;

    #[test]
    fn the_plain_method_breaks_far_from_the_origin_and_the_better_one_later() {
        let all = cases();
        let case = all.iter().find(|c| c.id == "far-from-origin").unwrap();
        let mut studio = Studio::new(Registry::builtin(), 2).unwrap();
        let plain = case.sweep(&mut studio, "raster", false);
        let better = case.sweep(&mut studio, "raster", true);
        let at = plain.breaks_at.unwrap_or(f64::INFINITY);
        assert!(at >= 1e3, "{plain:?}");
        assert!(better.breaks_at.unwrap_or(f64::INFINITY) >= at, "{better:?}");
    }

    #[test]
    fn cases_have_names_of_their_own_and_begin_with_what_is_easy() {
        let all = cases();
        let mut names: Vec<_> = all.iter().map(|c| c.id).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), all.len());
        assert!(all.iter().all(|c| c.values.len() >= 3 && c.limit >= 0.0));
    }
}
