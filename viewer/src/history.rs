//! What was the scene before it was edited? Undo and redo.

use polyptych::scene::Scene;
use std::sync::Arc;

/// Seconds within which changes of one thing are one step: a value that is dragged changes many times.
const ONE_STEP: f64 = 1.0;
/// Most steps that are kept.
const MOST: usize = 1000;

/// The scenes before and after the one that is shown; what did not change they share.
#[derive(Default)]
pub(crate) struct History {
    before: Vec<Arc<Scene>>,
    after: Vec<Arc<Scene>>,
    /// What was changed last, and when.
    last: Option<(String, f64)>,
}

impl History {
    /// Keeps the scene from before a change; `what` names the thing that is changed.
    pub(crate) fn keep(&mut self, scene: &Arc<Scene>, what: &str, now: f64) {
        let goes_on = self.last.as_ref().is_some_and(|(last, at)| last == what && now - at < ONE_STEP);
        if !goes_on {
            self.before.push(scene.clone());
            if self.before.len() > MOST {
                self.before.remove(0);
            }
        }
        self.after.clear();
        self.last = Some((what.to_owned(), now));
    }

    /// Returns the scene before the last change.
    pub(crate) fn undo(&mut self, shown: &Arc<Scene>) -> Option<Arc<Scene>> {
        let scene = self.before.pop()?;
        self.after.push(shown.clone());
        self.last = None;
        Some(scene)
    }

    /// Returns the scene after the change that was undone last.
    pub(crate) fn redo(&mut self, shown: &Arc<Scene>) -> Option<Arc<Scene>> {
        let scene = self.after.pop()?;
        self.before.push(shown.clone());
        self.last = None;
        Some(scene)
    }

    /// Tells whether there is something to undo, and to redo.
    pub(crate) fn can(&self) -> [bool; 2] {
        [!self.before.is_empty(), !self.after.is_empty()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_is_dragged_is_one_step() {
        let scene = |name: &str| Arc::new(Scene { name: name.to_owned(), ..Scene::default() });
        let (mut history, [a, b, c]) = (History::default(), ["a", "b", "c"].map(scene));
        history.keep(&a, "color", 0.0);
        history.keep(&b, "color", 0.5);
        assert!(Arc::ptr_eq(&history.undo(&c).unwrap(), &a));
        assert!(history.undo(&a).is_none());
        assert!(Arc::ptr_eq(&history.redo(&a).unwrap(), &c));
        history.keep(&c, "color", 0.6);
        history.keep(&b, "place", 0.7);
        assert_eq!(history.can(), [true, false]);
        let steps = std::iter::from_fn(|| history.undo(&a)).count();
        assert_eq!(steps, 3, "what was undone in between is a step of its own");
    }
}
