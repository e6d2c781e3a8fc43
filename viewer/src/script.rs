//! What does a scripted session do? A line each, as in:
//!
//! ```text
//! size 800x500        of the window
//! do Wipe             an action by its name
//! panes raster,voxel  the back ends of the panes
//! open sponza.glb     a scene
//! bend 0.7            weight of the first perturbation in the scene
//! orbit 30            turns the camera for so many seconds, and prints how long frames and stops took
//! switch 60           switches back ends for so many seconds, and prints how much memory that took
//! wait                until everything is drawn
//! shot window.png     a picture of the window
//! quit
//! ```

use crate::actions::{ACTIONS, Action};
use crate::measure::Times;
use crate::viewer::Viewer;
use eframe::egui::{Context, ViewportCommand};
use polyptych::scene::{Form, FreeForm, Scene, Shape};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Radians that a scripted orbit turns in a second.
const SPEED: f64 = 0.6;

/// One thing to do.
#[derive(Clone, Debug, PartialEq)]
enum Step {
    Size([f32; 2]),
    Do(Action),
    Panes(Vec<String>),
    Open(String),
    Bend(f64),
    Orbit(Duration),
    Switch(Duration),
    Wait,
    Shot(PathBuf),
    Quit,
}

/// A session that goes by itself.
#[derive(Debug)]
pub struct Script {
    steps: std::vec::IntoIter<Step>,
    running: Option<Running>,
    /// When the program read it, until the first frame.
    read: Option<Instant>,
}

#[derive(Debug)]
struct Running {
    step: Step,
    since: Instant,
    last: Instant,
    /// Bytes that the process held, from time to time.
    memory: Vec<u64>,
    count: u64,
}

impl Script {
    /// Reads a script.
    ///
    /// # Errors
    /// Names the line that is none.
    pub fn read(text: &str) -> Result<Self, String> {
        let lines = text.lines().map(str::trim).enumerate();
        let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let steps: Result<Vec<_>, _> = lines
            .map(|(i, line)| step(line).ok_or_else(|| format!("line {}: `{line}` is no step", i + 1)))
            .collect();
        Ok(Self { steps: steps?.into_iter(), running: None, read: Some(Instant::now()) })
    }
}

fn step(line: &str) -> Option<Step> {
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    let rest = rest.trim();
    let seconds = || rest.parse().ok().and_then(|s: f64| Duration::try_from_secs_f64(s).ok());
    let size = || {
        let (width, height) = rest.split_once('x')?;
        let edge = |text: &str| text.parse().ok().filter(|edge| (1.0..=16_384.0).contains(edge));
        Some([edge(width)?, edge(height)?])
    };
    Some(match word {
        "size" => Step::Size(size()?),
        "do" => Step::Do(ACTIONS.iter().find(|entry| entry.name == rest)?.action),
        "panes" if !rest.is_empty() => Step::Panes(rest.split(',').map(|id| id.trim().to_owned()).collect()),
        "open" if !rest.is_empty() => Step::Open(rest.to_owned()),
        "bend" => Step::Bend(rest.parse().ok().filter(|v: &f64| v.is_finite())?),
        "orbit" => Step::Orbit(seconds()?),
        "switch" => Step::Switch(seconds()?),
        "wait" if rest.is_empty() => Step::Wait,
        "shot" if !rest.is_empty() => Step::Shot(PathBuf::from(rest)),
        "quit" if rest.is_empty() => Step::Quit,
        _ => return None,
    })
}

/// How long a script that waits for pictures leaves the window alone.
const PAUSE: Duration = Duration::from_millis(50);

impl Running {
    /// Tells whether nothing goes on but what painters do.
    fn waits(&self) -> bool {
        self.count > 2 && matches!(self.step, Step::Wait | Step::Open(_) | Step::Shot(_))
    }
}

impl Viewer {
    /// Has a script do what a user would.
    pub fn follow(&mut self, script: Script) {
        self.script = Some(script);
        self.panels.welcome = false;
    }

    pub(crate) fn follow_script(&mut self, ctx: &Context) {
        let Some(mut script) = self.script.take() else { return };
        match &script.running {
            // Whoever only looks at the window takes no time from those who draw.
            Some(running) if running.waits() => ctx.request_repaint_after(PAUSE),
            _ => ctx.request_repaint(),
        }
        if let Some(read) = script.read.take() {
            println!("first frame after {:.2} s", read.elapsed().as_secs_f64());
        }
        let is_done = match &mut script.running {
            Some(running) => self.go_on(running, ctx),
            None => true,
        };
        if is_done {
            if let Some(running) = script.running.take() {
                self.tell(&running);
            }
            let Some(step) = script.steps.next() else { return };
            self.begin(&step, ctx);
            let now = Instant::now();
            script.running = Some(Running { step, since: now, last: now, memory: Vec::new(), count: 0 });
        }
        self.script = Some(script);
    }

    fn begin(&mut self, step: &Step, ctx: &Context) {
        match step {
            Step::Size(size) => ctx.send_viewport_cmd(ViewportCommand::InnerSize((*size).into())),
            Step::Do(action) => self.perform(*action, ctx),
            Step::Panes(backends) => {
                self.set_count(backends.len(), ctx);
                for (index, backend) in backends.iter().enumerate() {
                    if self.backends.contains(backend) {
                        self.set_backend(index, backend.clone());
                    }
                }
            }
            Step::Open(name) => self.open(name, ctx),
            Step::Bend(weight) => {
                if let Some(scene) = bent(&self.document.scene, *weight) {
                    self.document.edit(scene, "bend", ctx.input(|i| i.time));
                }
            }
            Step::Orbit(_) => {
                (self.frames, self.whole_frames) = (Times::default(), Times::default());
                self.panes.iter().for_each(|pane| pane.painter.forget_stops());
            }
            Step::Shot(file) => self.save_screenshot(Some(file.clone()), ctx),
            Step::Quit => ctx.send_viewport_cmd(ViewportCommand::Close),
            Step::Switch(_) | Step::Wait => {}
        }
    }

    /// Goes on with a step. Tells whether it is done.
    fn go_on(&mut self, running: &mut Running, ctx: &Context) -> bool {
        let (now, since) = (Instant::now(), running.since);
        match &running.step {
            Step::Orbit(time) => {
                let angle = SPEED * (now - running.last).as_secs_f64().min(0.1);
                self.navigation.orbit(angle, 0.0);
                running.last = now;
                running.count += 1;
                since.elapsed() >= *time
            }
            Step::Switch(time) => {
                if self.is_at_rest() {
                    running.memory.extend(memory());
                    running.count += 1;
                    let count = self.backends.len().max(1) as u64;
                    let digit = Action::Backend((running.count % count) as u8);
                    self.active = (running.count / count) as usize % self.panes.len().max(1);
                    self.perform(digit, ctx);
                }
                since.elapsed() >= *time
            }
            Step::Wait | Step::Open(_) | Step::Shot(_) => {
                // What was ordered in this frame is not known to be busy before the next.
                running.count += 1;
                running.count > 2 && self.is_at_rest()
            }
            Step::Size(_) | Step::Do(_) | Step::Panes(_) | Step::Bend(_) | Step::Quit => true,
        }
    }

    /// Prints what a step was to measure.
    fn tell(&self, running: &Running) {
        match &running.step {
            Step::Orbit(time) => {
                println!("orbit: {} frames in {:.0} s", running.count, time.as_secs_f64());
                println!("window's thread, in our code: {}", self.frames);
                println!("window's thread, with painting: {}", self.whole_frames);
                println!("from stop to free: {}", self.stops());
                for pane in &self.panes {
                    println!(
                        "{}: {}, from stop to free: {}",
                        pane.backend,
                        pane.status(),
                        pane.painter.stops()
                    );
                }
            }
            Step::Switch(_) => {
                let half = running.memory.len() / 2;
                let most = |part: &[u64]| part.iter().max().copied().unwrap_or(0) as f64 * 1e-6;
                let (first, second) = (most(&running.memory[..half]), most(&running.memory[half..]));
                println!(
                    "switched {} times: most {first:.1} MB in the first half, {second:.1} MB in the second",
                    running.count
                );
            }
            Step::Open(name) => {
                println!("open {name}: {} ({:.1} s)", self.message, running.since.elapsed().as_secs_f64());
            }
            _ => {}
        }
    }
}

/// Returns the scene with another weight of its first perturbation; nothing where there is none.
fn bent(scene: &Scene, weight: f64) -> Option<Scene> {
    let forms = scene.objects.iter().enumerate().filter_map(|(index, object)| match &*object.shape {
        Shape::FreeForm(free) => Some((index, free.form().clone())),
        _ => None,
    });
    let (index, form) =
        forms.into_iter().find_map(|(index, mut form)| bend(&mut form, weight).then_some((index, form)))?;
    let mut scene = scene.clone();
    scene.objects[index].shape = Arc::new(Shape::FreeForm(FreeForm::new(form).ok()?));
    Some(scene)
}

fn bend(form: &mut Form, weight: f64) -> bool {
    match form {
        Form::Perturbed { base, terms } => {
            terms.first_mut().map(|term| term.weight = weight).is_some() || bend(base, weight)
        }
        Form::Union(parts) | Form::Intersection(parts) => parts.iter_mut().any(|part| bend(part, weight)),
        Form::Difference(a, b) | Form::SmoothUnion { a, b, .. } | Form::Morph { from: a, to: b, .. } => {
            bend(a, weight) || bend(b, weight)
        }
        Form::Offset { form, .. } => bend(form, weight),
        _ => false,
    }
}

/// Returns the bytes of memory that the process holds, where the system tells.
fn memory() -> Option<u64> {
    let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
    Some(pages.split(' ').nth(1)?.parse::<u64>().ok()? * 4096)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scripts_are_read_or_refused_by_line() {
        let script = Script::read("# a tour\ndo Wipe\n\norbit 1.5\npanes a, b\nquit").unwrap();
        let steps: Vec<_> = script.steps.collect();
        let panes = Step::Panes(vec!["a".to_owned(), "b".to_owned()]);
        assert_eq!(
            steps,
            [Step::Do(Action::Wipe), Step::Orbit(Duration::from_millis(1500)), panes, Step::Quit]
        );
        for wrong in ["do Nothing at all", "orbit", "orbit -1", "open", "quit now", "dance"] {
            let text = format!("wait\n{wrong}");
            assert_eq!(Script::read(&text).unwrap_err(), format!("line 2: `{wrong}` is no step"));
        }
    }

    #[test]
    fn bending_changes_the_first_perturbation() {
        let scene = polyptych::builtin::scene("atelier").unwrap();
        let bent = bent(&scene, 0.3).unwrap();
        let changed =
            scene.objects.iter().zip(&bent.objects).filter(|(a, b)| !Arc::ptr_eq(&a.shape, &b.shape));
        assert_eq!(changed.map(|(a, _)| a.name.as_str()).collect::<Vec<_>>(), ["sculpture"]);
    }
}
