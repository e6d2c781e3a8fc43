//! How does a program change the scene while it is shown?

use crate::viewer::Viewer;
use eframe::egui::{Context, InputState};
use polyptych::scene::Scene;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// A function that is called before every frame of the window, with the scene, the seconds since the window was opened,
/// and what keys and mouse do.
pub(crate) type Program = Box<dyn FnMut(&mut Stage<'_>, f64, &InputState)>;

/// The scene in the hands of a program. Whoever only reads it changes nothing; the first write begins a new picture.
pub struct Stage<'a> {
    scene: &'a mut Arc<Scene>,
}

impl Deref for Stage<'_> {
    type Target = Scene;
    fn deref(&self) -> &Scene {
        self.scene
    }
}

impl DerefMut for Stage<'_> {
    fn deref_mut(&mut self) -> &mut Scene {
        Arc::make_mut(self.scene)
    }
}

impl Viewer {
    /// Has a program change the scene before every frame.
    pub fn run(&mut self, program: impl FnMut(&mut Stage<'_>, f64, &InputState) + 'static) {
        self.program = Some(Box::new(program));
    }

    pub(crate) fn run_program(&mut self, ctx: &Context) {
        let Some(program) = &mut self.program else { return };
        let scene = &mut self.document.scene;
        // Whoever draws it holds it, too: a write makes another one.
        let before = scene.clone();
        ctx.input(|input| program(&mut Stage { scene }, input.time, input));
        drop(before);
        ctx.request_repaint();
    }
}
