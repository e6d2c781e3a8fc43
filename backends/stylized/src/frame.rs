//! How is a frame drawn: lines are found and paint is laid on, with buffers that stay from frame to frame?

use crate::cracks::{self, Surfaces};
use crate::ground::Ground;
use crate::ink::Sheaf;
use crate::light::Lighting;
use crate::look::Look;
use crate::outline::{self, Sight, keeps_lines};
use crate::paint::{Painting, ROWS, Scratch};
use crate::paper::Grain;
use crate::prepare::Outlines;
use crate::spans::Spans;
use crate::style::Styles;
use glam::DVec3;
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::parallel::Threads;
use polyptych_core::scene::{Light, Scene};
use polyptych_core::seam::{Cancelled, Control, Phases};
use std::sync::{Arc, Mutex, PoisonError};

/// What a scene was prepared for.
pub(crate) struct Ready {
    pub(crate) scene: Arc<Scene>,
    pub(crate) styles: Styles,
    pub(crate) lights: Vec<Light>,
    pub(crate) colorful: Vec<bool>,
    /// Around the scene.
    pub(crate) ball: (DVec3, f64),
}

/// Buffers that live from frame to frame.
pub(crate) struct Buffers {
    pub(crate) visible: Framebuffer,
    pub(crate) looks: Vec<Look>,
    outline: outline::Scratch,
    cracks: Vec<cracks::Scratch>,
    pub(crate) lines: Sheaf,
    spans: Spans,
    ground: Ground,
    bands: Vec<Mutex<Scratch>>,
    /// For cameras that bend lines: nothing has them from its edges.
    without: Vec<bool>,
}

impl Default for Buffers {
    fn default() -> Self {
        Self {
            visible: Framebuffer::new(0, 0, Channels::NONE),
            looks: Vec::new(),
            outline: outline::Scratch::default(),
            cracks: Vec::new(),
            lines: Sheaf::default(),
            spans: Spans::default(),
            ground: Ground::default(),
            bands: Vec::new(),
            without: Vec::new(),
        }
    }
}

impl Buffers {
    pub(crate) fn bytes(&self) -> u64 {
        let bands: usize = self.bands.iter().filter_map(|b| b.lock().ok()).map(|b| b.bytes()).sum();
        let cracks: usize = self.cracks.iter().map(cracks::Scratch::bytes).sum();
        self.visible.bytes()
            + self.outline.bytes()
            + self.lines.bytes()
            + self.spans.bytes()
            + (bands + cracks) as u64
    }

    pub(crate) fn reserve(&mut self, width: u32, height: u32, channels: Channels, objects: usize) {
        let bands = height.div_ceil(ROWS) as usize;
        if (self.visible.width(), self.visible.height(), self.visible.channels()) != (width, height, channels)
        {
            self.visible = Framebuffer::new(width, height, channels);
            self.cracks = (0..bands).map(|_| cracks::Scratch::default()).collect();
            self.bands = (0..bands).map(|_| Mutex::default()).collect();
        }
        self.without.resize(objects, false);
    }

    /// Finds the lines of what was seen.
    pub(crate) fn find_lines(
        &mut self,
        ready: &Ready,
        outlines: &Outlines,
        camera: &Camera,
        control: &Control<'_>,
    ) -> Result<(), Cancelled> {
        let Self { visible, outline, cracks, lines, spans, without, .. } = self;
        let visible = &*visible;
        spans.fill(visible, control)?;
        lines.strokes.clear();
        if !ready.styles.draw_lines() {
            return Ok(());
        }
        let view = camera.view(visible.width(), visible.height());
        let straight = keeps_lines(&camera.projection);
        let surfaces = Surfaces {
            visible,
            spans,
            view,
            styles: &ready.styles,
            pixel: view.pixel_size(1.0),
            is_parallel: matches!(camera.projection, Projection::Orthographic { .. }),
            outlined: if straight { &outlines.outlined } else { without },
            colorful: &ready.colorful,
        };
        // Both at the same time: neither is done evenly.
        let (mut from_edges, mut from_pixels) = (Ok(()), Ok(()));
        control.threads.join(
            &mut || {
                if straight {
                    let sight = Sight { camera, visible, styles: &ready.styles, pixel: view.pixel_size(1.0) };
                    from_edges = outline.fill(&outlines.bodies, &sight, control);
                } else {
                    outline.clear();
                }
            },
            &mut || {
                from_pixels = control.for_each_mut(cracks, 1, &|band, scratch| {
                    let first = band as u32 * ROWS;
                    surfaces.find(first..first + ROWS, scratch);
                });
            },
        );
        from_edges.and(from_pixels)?;
        for strokes in outline.strokes().chain(cracks.iter().map(|c| &c.strokes[..])) {
            lines.strokes.extend_from_slice(strokes);
        }
        Ok(())
    }

    /// Finds lines and paints.
    pub(crate) fn paint(
        &mut self,
        ready: &Ready,
        outlines: &Outlines,
        grain: &Grain,
        camera: &Camera,
        target: &mut Framebuffer,
        phases: &mut Phases,
        control: &Control<'_>,
    ) -> Result<(), Cancelled> {
        self.find_lines(ready, outlines, camera, control)?;
        self.lines.sort(&ready.styles, target.height(), ROWS);
        phases.end("contours");
        let scene = &*ready.scene;
        let hatching = |index: usize| {
            let style = usize::from(ready.styles.index(index as u32 + 1));
            ready.styles.all[style].hatching.as_ref()
        };
        for (index, look) in self.looks.iter_mut().enumerate() {
            if let Some(hatching) = hatching(index) {
                look.place(&scene.objects[index], camera, hatching.scale);
            }
        }
        let (center, radius) = ready.ball;
        let middle = center.distance(camera.eye);
        let depths = [(middle - radius).max(0.0) as f32, (middle + radius) as f32];
        let painting = Painting {
            scene,
            styles: &ready.styles,
            looks: &self.looks,
            view: camera.view(target.width(), target.height()),
            camera,
            visible: &self.visible,
            light: Lighting::of(&ready.lights),
            grain,
            lines: &self.lines,
            spans: &self.spans,
            ground_stays: self.ground.begin(target, &ready.styles.all[0], scene, camera),
            depths,
            any_coded: self.looks.iter().any(|look| look.is_coded),
        };
        let bands = &self.bands;
        target.for_each_band(control.threads, ROWS, &|mut band| {
            if !control.is_cancelled() {
                let scratch = &bands[(band.first_row / ROWS) as usize];
                painting.draw(&mut band, &mut scratch.lock().unwrap_or_else(PoisonError::into_inner));
                control.finished(&band);
            }
        });
        control.check()?;
        self.ground.end(target, &ready.styles.all[0], scene, camera);
        phases.end("tone");
        Ok(())
    }
}

/// Puts colors in place of texture coordinates, for those who asked for colors.
pub(crate) fn decode(ready: &Ready, coded: &[bool], visible: &mut Framebuffer, threads: &dyn Threads) {
    visible.for_each_band(threads, ROWS, &|band| {
        for (id, albedo) in band.id.iter().zip(band.albedo) {
            let index = id.wrapping_sub(1) as usize;
            if coded.get(index).copied().unwrap_or(false) {
                let material =
                    ready.scene.material(&ready.scene.objects[index], albedo.z.round().max(0.0) as usize);
                let at = Some([albedo.x, albedo.y]);
                *albedo = ready.scene.base_color(material, at, glam::Vec3::ZERO, glam::Vec3::Y, 0.0).0;
            }
        }
    });
}
