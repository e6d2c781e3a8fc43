//! How is a frame drawn? The steps of the pipeline, in order.

use crate::bin::{Bins, Pass};
use crate::blank::Blank;
use crate::drawing::Drawing;
use crate::faces::{Faces, face_lens, needed};
use crate::grid::TileGrid;
use crate::info::Mode;
use crate::lens::Lens;
use crate::light::Illumination;
use crate::model::Role;
use crate::paint::{self, Announce, Look, Painter};
use crate::ready::Ready;
use crate::shadow::{Before, Shadows};
use crate::strokes::Strokes;
use crate::transform::{ScreenVertices, transform};
use polyptych_core::camera::Camera;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::seam::{Cancelled, Control, Phases};
use std::sync::Mutex;

/// Buffers that live from frame to frame.
#[derive(Default)]
pub(crate) struct Scratch {
    pub(crate) pipeline: Pipeline,
    faces: Faces,
}

/// The buffers of one straight-line picture.
#[derive(Default)]
pub(crate) struct Pipeline {
    vertices: Vec<ScreenVertices>,
    bins: Bins,
    strokes: Strokes,
    bands: Vec<Mutex<paint::Scratch>>,
    blank: Blank,
}

/// What a frame took.
pub(crate) struct Work {
    pub(crate) phases: Phases,
    pub(crate) triangles: u64,
    pub(crate) shaded: u64,
}

impl Scratch {
    /// Draws the faces of a cube and looks the picture up in them.
    pub(crate) fn draw_bent(
        &mut self,
        ready: &Ready,
        camera: &Camera,
        target: &mut Framebuffer,
        work: &mut Work,
        control: &Control<'_>,
    ) -> Result<(), Cancelled> {
        let (width, height) = (target.width(), target.height());
        let view = camera.view(width, height);
        let edge = self.faces.reserve(&view, width, height, target.channels());
        let needed = needed(camera, width, height, control.threads);
        for face in (0..6).filter(|face| needed >> face & 1 == 1) {
            let lens = face_lens(camera, face, edge, ready.near(camera)).with_depths_of(&ready.model.bounds);
            self.pipeline.draw(ready, &lens, self.faces.picture(face), Announce::No, work, control)?;
        }
        self.faces.resample(camera, &ready.scene.environment.background, target, control.threads);
        control.finished(&target.band());
        work.phases.end("resample");
        Ok(())
    }

    pub(crate) fn draw_shadows(
        &mut self,
        ready: &Ready,
        old: Option<Before>,
        control: &Control<'_>,
    ) -> Result<Shadows, Cancelled> {
        let Pipeline { vertices, bins, .. } = &mut self.pipeline;
        let of = (&*ready.scene, &*ready.model);
        Shadows::build(of, &ready.lamps, ready.sizes, old, vertices, bins, control)
    }

    pub(crate) fn bytes(&self) -> u64 {
        let Pipeline { vertices, bins, strokes, bands, blank } = &self.pipeline;
        let bands: usize = bands.iter().filter_map(|b| b.lock().ok()).map(|b| b.bytes()).sum();
        (vertices.capacity() * size_of::<ScreenVertices>() + bands) as u64
            + bins.bytes()
            + strokes.bytes()
            + blank.bytes()
            + self.faces.bytes()
    }
}

impl Pipeline {
    /// Draws a picture.
    pub(crate) fn draw(
        &mut self,
        ready: &Ready,
        lens: &Lens,
        target: &mut Framebuffer,
        announce: Announce,
        work: &mut Work,
        control: &Control<'_>,
    ) -> Result<(), Cancelled> {
        let Self { vertices, bins, strokes, bands, blank } = self;
        control.check()?;
        let culls_back = ready.options.culls_back;
        let smooth = ready.places.len() > 1;
        let pass = Pass { model: &ready.model, lens, role: Role::Camera, culls_back, smooth, without: None };
        // 1. Where on the picture is every vertex?
        transform(&ready.model, lens, vertices, control)?;
        work.phases.end("transform");
        // 2. Clip, set up, and sort the triangles into tiles.
        let grid = TileGrid::new(lens.width, lens.height).smooth(smooth);
        bins.fill(&pass, vertices, &grid, control)?;
        work.triangles += bins.triangles();
        let hides = ready.options.mode == Mode::HiddenLine;
        if let Some(lines) = &ready.lines {
            strokes.fill(lines, &ready.model, lens, vertices, (culls_back, hides), control)?;
        }
        let drawing = ready.lines.as_deref().map(|lines| Drawing { lines, strokes, hides });
        work.phases.end("bin");
        // 3. Draw tile by tile: visibility, layers, surfaces and light.
        let light = Illumination {
            scene: &ready.scene,
            model: &ready.model,
            lamps: &ready.lamps,
            shadows: ready.shadows.as_deref(),
            lighting: ready.options.lighting.unwrap_or(ready.scene.environment.lighting),
        };
        let look = Look { shading: ready.options.shading, places: &ready.places, drawing };
        let background = &ready.scene.environment.background;
        blank.begin(target, grid.count(), lens, background);
        let painter = Painter::new(light, look, lens, bins, blank, target.channels());
        work.shaded += painter.paint(target, bands, announce, control)?;
        if painter.paint_crossings(target, control) && announce == Announce::Yes {
            control.finished(&target.band());
        }
        blank.end(target, lens, background);
        work.phases.end("draw");
        Ok(())
    }
}
