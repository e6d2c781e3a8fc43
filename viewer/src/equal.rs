//! With which tolerances do all back ends take the same time, or make the same error?
//!
//! The choice is that of `polyptych --backend auto` for each back end alone: it draws pilot pictures, on a thread of its
//! own, when the question or the scene changes.

use crate::painter::Pace;
use crate::viewer::Viewer;
use eframe::egui::{self, Context};
use polyptych::auto::{Candidate, Goal, choose};
use polyptych::scene::Scene;
use polyptych::seam::Need;
use polyptych::{Studio, compare::REFERENCE};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Duration;

/// What all back ends have in common.
#[derive(Default)]
pub(crate) struct Equal {
    goal: Option<Goal>,
    found: BTreeMap<String, Candidate>,
    /// What was asked when that was found.
    asked: Option<Question>,
    running: Option<Receiver<BTreeMap<String, Candidate>>>,
}

#[derive(Clone)]
struct Question {
    goal: Goal,
    scene: Arc<Scene>,
    backends: Vec<String>,
    size: [u32; 2],
}

impl Question {
    fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.scene, &other.scene)
            && (self.goal, &self.backends, self.size) == (other.goal, &other.backends, other.size)
    }
}

impl Equal {
    pub(crate) fn is_time(&self) -> bool {
        matches!(self.goal, Some(Goal::BudgetMs(_)))
    }

    pub(crate) fn is_error(&self) -> bool {
        matches!(self.goal, Some(Goal::MaxError(_)))
    }

    pub(crate) fn toggle_time(&mut self) {
        self.goal = (!self.is_time()).then_some(Goal::BudgetMs(30.0));
    }

    pub(crate) fn toggle_error(&mut self) {
        self.goal = (!self.is_error()).then_some(Goal::MaxError(0.02));
    }

    pub(crate) fn is_busy(&self) -> bool {
        self.running.is_some()
    }

    /// Returns how long each picture may take.
    pub(crate) fn pace(&self) -> Pace {
        match self.goal {
            Some(Goal::BudgetMs(ms)) => Pace::Within(Duration::from_secs_f64(ms * 1e-3)),
            _ => Pace::Full,
        }
    }

    /// Returns the tolerance of a back end that was found, pixels.
    pub(crate) fn tolerance(&self, backend: &str) -> Option<f64> {
        self.goal.and(self.found.get(backend)).map(|candidate| candidate.tolerance_px)
    }

    /// Shows what is asked for, if something is.
    pub(crate) fn show(&mut self, ui: &mut egui::Ui) {
        let (value, range, suffix, name) = match &mut self.goal {
            None => return,
            Some(Goal::BudgetMs(ms)) => (ms, 1.0..=10_000.0, " ms", "time of every pane"),
            Some(Goal::MaxError(error)) => (error, 1e-4..=1.0, " rmse", "error of every pane"),
        };
        let speed = *value * 0.02;
        let field = egui::DragValue::new(value).range(range).suffix(suffix).speed(speed);
        ui.add(field).widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, name));
        let words = self.found.values().map(|c| {
            format!(
                "{}: {} px, {:.1} ms, error {:.4}",
                c.backend, c.tolerance_px, c.predicted_ms, c.predicted_error
            )
        });
        let text = if self.running.is_some() { "trying ..." } else { "found" };
        ui.label(text).on_hover_text(words.collect::<Vec<_>>().join("\n"));
        ui.separator();
    }
}

impl Viewer {
    /// Looks for tolerances that answer what is asked for, where that is not done yet.
    pub(crate) fn balance(&mut self, ctx: &Context) {
        if let Some(running) = &self.equal.running {
            match running.try_recv() {
                Err(TryRecvError::Empty) => {}
                Ok(found) => (self.equal.found, self.equal.running) = (found, None),
                Err(TryRecvError::Disconnected) => self.equal.running = None,
            }
        }
        let Some(goal) = self.equal.goal else {
            self.equal.asked = None;
            return;
        };
        let size = self.panes.first().map_or([0, 0], |pane| pane.size);
        let mut backends: Vec<String> =
            self.shown().filter(|id| *id != REFERENCE).map(str::to_owned).collect();
        backends.sort();
        backends.dedup();
        let question = Question { goal, scene: self.document.scene.clone(), backends, size };
        let is_known = self.equal.asked.as_ref().is_some_and(|asked| asked.is(&question));
        if is_known || self.equal.running.is_some() || size.contains(&0) {
            return;
        }
        let need = Need::new(self.navigation.camera.clone(), size[0], size[1]);
        let (registry, wake) = (self.registry.clone(), ctx.clone());
        let ((sender, receiver), asked) = (channel(), question.clone());
        std::thread::spawn(move || {
            let mut found = BTreeMap::new();
            if let Ok(mut studio) = Studio::new(registry, 0) {
                for backend in &asked.backends {
                    // One that is not photometric, or cannot draw this, keeps what it comes with.
                    let choice =
                        choose(&mut studio, &asked.scene, &need, std::slice::from_ref(backend), asked.goal);
                    choice.into_iter().for_each(|c| drop(found.insert(backend.clone(), c.chosen)));
                }
            }
            // The window may be gone by now.
            let _ = sender.send(found);
            wake.request_repaint();
        });
        (self.equal.asked, self.equal.running) = (Some(question), Some(receiver));
    }
}
