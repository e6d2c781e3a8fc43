//! What is there where nothing is seen: paper, or the scene's background. Where it was and would be the same, it stays.

use crate::paint::Painting;
use crate::style::{Paper, Show, Style};
use glam::Vec3;
use polyptych_core::camera::{Camera, RowDirections};
use polyptych_core::framebuffer::{Channel, Framebuffer};
use polyptych_core::scene::{Background, Scene};

/// Columns over which the background's color changes evenly.
const EVEN: usize = 16;

/// What the background of the last picture looked like, if that was painted whole.
#[derive(Default)]
pub(crate) struct Ground {
    last: Option<Drawn>,
}

/// A background, and where it was painted.
#[derive(PartialEq)]
struct Drawn {
    /// See [`Framebuffer::written`].
    written: u64,
    show: Show,
    paper: Paper,
    /// On paper nothing depends on it.
    camera: Option<Camera>,
    background: Background,
}

impl Drawn {
    fn of(target: &Framebuffer, style: &Style, scene: &Scene, camera: &Camera) -> Option<Self> {
        let written = target.written()?[Channel::Color as usize];
        let camera = (!style.paper.is_shown).then(|| camera.clone());
        let background = scene.environment.background.clone();
        Some(Self { written, show: style.show, paper: style.paper, camera, background })
    }
}

impl Ground {
    /// Begins a picture, and tells whether it holds what would be painted where nothing is, but for lines.
    pub(crate) fn begin(
        &mut self,
        target: &Framebuffer,
        style: &Style,
        scene: &Scene,
        camera: &Camera,
    ) -> bool {
        let last = self.last.take();
        last.is_some() && last == Drawn::of(target, style, scene, camera)
    }

    /// Ends a picture that was painted whole.
    pub(crate) fn end(&mut self, target: &Framebuffer, style: &Style, scene: &Scene, camera: &Camera) {
        self.last = Drawn::of(target, style, scene, camera);
    }
}

impl Painting<'_> {
    /// Fills a row with what is there where nothing is.
    #[inline(always)]
    pub(crate) fn ground(&self, x: u32, y: u32, directions: Option<&RowDirections>, colors: &mut [Vec3]) {
        let Style { show, paper, .. } = &self.styles.all[0];
        if *show != Show::Style {
            colors.fill(Vec3::ZERO);
        } else if paper.is_shown {
            self.grain.paper(paper, x, y, colors);
        } else if let Some(directions) = directions {
            // Between places so near the background's color changes evenly.
            let gradient = self.scene.environment.background.gradient();
            let color_at = |column: u32| gradient.color(directions.at(column).y);
            let mut begin = color_at(x);
            for (piece, colors) in (1..).zip(colors.chunks_mut(EVEN)) {
                let end = color_at(x + piece * EVEN as u32);
                let step = (end - begin) * (1.0 / EVEN as f32);
                for (i, color) in colors.iter_mut().enumerate() {
                    *color = begin + step * i as f32;
                }
                begin = end;
            }
        } else {
            for (x, color) in (x..).zip(colors) {
                let ray = self.view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
                *color = ray.map_or(Vec3::ZERO, |r| self.scene.environment.background.color(r.direction));
            }
        }
    }
}
