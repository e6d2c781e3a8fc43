//! What do small pictures tell of a large one: how long will it take, and how wrong will it be?

use crate::compare::REFERENCE;
use crate::framebuffer::{Channels, Framebuffer};
use crate::metrics::color_rmse;
use crate::scene::Scene;
use crate::seam::Need;
use crate::studio::{Studio, StudioError};
use std::sync::Arc;

/// The pilots' sizes, as divisors of the picture's edges: the larger one's, and twice that for the smaller. Rays through
/// the middles of the larger pilot's pixels are rays of the picture where an odd divisor goes into its edges.
const DIVISORS: [u32; 2] = [3, 5];

/// A pilot has at least so many columns: smaller ones are all edges.
const LEAST: u32 = 48;

/// Frames of a pilot after the first, and the time of one from which on there are none, milliseconds.
const FRAMES: usize = 4;
const SLOW_MS: f64 = 150.0;

/// The reference draws the whole picture where it is expected to take no longer than this, milliseconds: errors then are
/// known and not expected, also those in the few pixels that no pilot has.
const RULER_MS: f64 = 1200.0;

/// A picture, and the times of drawing it.
pub(super) struct Pilot {
    pub(super) picture: Framebuffer,
    pub(super) ms: f64,
    pub(super) prepare_ms: f64,
}

/// Draws a picture some times; the fastest counts, so that scratch memory and other programs do not.
pub(super) fn pilot(
    studio: &mut Studio,
    backend: &str,
    scene: &Arc<Scene>,
    need: &Need,
    [width, height]: [u32; 2],
) -> Result<Pilot, StudioError> {
    // In world space the tolerance is that of the large picture.
    let tolerance_px = need.tolerance_px * f64::from(width) / f64::from(need.width.max(1));
    let small = Need { width, height, tolerance_px, channels: Channels::COLOR, ..need.clone() };
    let drawing = studio.draw(backend, scene, &small)?;
    let mut picture = drawing.framebuffer;
    let mut ms = drawing.frame_ms;
    for _ in 0..FRAMES {
        if ms > SLOW_MS {
            break;
        }
        ms = ms.min(studio.render(backend, &small.frame(), &mut picture)?.1);
    }
    Ok(Pilot { picture, ms, prepare_ms: drawing.prepare_ms })
}

/// The reference's pilots, against which the candidates' are held.
pub(super) struct Rulers {
    pub(super) sizes: [[u32; 2]; 2],
    pictures: [Framebuffer; 2],
    /// The picture itself, where the reference is quick enough to draw it.
    full: Option<Framebuffer>,
}

impl Rulers {
    pub(super) fn draw(studio: &mut Studio, scene: &Arc<Scene>, need: &Need) -> Result<Self, StudioError> {
        let sizes = sizes(need.width, need.height);
        let mut drawn = |size| pilot(studio, REFERENCE, scene, need, size);
        let [small, large] = [drawn(sizes[0])?, drawn(sizes[1])?];
        let ms = [small.ms, large.ms];
        let mut rulers = Self { sizes, pictures: [small.picture, large.picture], full: None };
        if rulers.extrapolated(ms, need) < RULER_MS {
            let whole = Need { channels: Channels::COLOR, ..need.clone() };
            rulers.full = Some(studio.draw(REFERENCE, scene, &whole)?.framebuffer);
        }
        Ok(rulers)
    }

    /// Tells the error of a picture of full size where the reference has drawn that, too.
    pub(super) fn whole(&self, picture: &Framebuffer) -> Option<f64> {
        color_rmse(picture, self.full.as_ref()?)
    }

    /// Lays a line through the times of two sizes: what a pixel costs, and what does not depend on pixels.
    pub(super) fn extrapolated(&self, ms: [f64; 2], need: &Need) -> f64 {
        let count = |[w, h]: [u32; 2]| f64::from(w) * f64::from(h);
        let [small, large] = self.sizes.map(count);
        let full = count([need.width, need.height]);
        if large <= small {
            return ms[1] * full / large.max(1.0);
        }
        // Noise must not make pixels cost less than nothing, nor the rest.
        let slope = ((ms[1] - ms[0]) / (large - small)).clamp(0.0, ms[1] / large);
        ms[1] + slope * (full - large)
    }

    /// Expects an error to fall from the larger pilot to the picture as it fell from the smaller one.
    pub(super) fn finer(&self, pilots: [&Framebuffer; 2]) -> f64 {
        let error = |i: usize| color_rmse(pilots[i], &self.pictures[i]).unwrap_or(0.0);
        falling(error(0), error(1))
    }

    /// Tells the error of a picture as coarse in its own pixels as the large one in its: what is off by a share of a pixel
    /// is off by a smaller one of a pilot's. It shows at edges, of which a larger picture has fewer.
    pub(super) fn coarse(
        &self,
        studio: &mut Studio,
        backend: &str,
        scene: &Arc<Scene>,
        need: &Need,
    ) -> Result<f64, StudioError> {
        let share = f64::from(self.sizes[1][0]) / f64::from(need.width.max(1));
        let coarse = Need { tolerance_px: need.tolerance_px / share, ..need.clone() };
        let picture = pilot(studio, backend, scene, &coarse, self.sizes[1])?.picture;
        Ok(color_rmse(&picture, &self.pictures[1]).unwrap_or(0.0) * share.sqrt())
    }

    /// Tells the error of a picture of full size from those of its pixels whose rays the larger pilot has, too; nothing
    /// where it has others.
    pub(super) fn sampled(&self, picture: &Framebuffer, need: &Need) -> Option<f64> {
        let [width, height] = self.sizes[1];
        let divisor = need.width / width.max(1);
        let is_grid = divisor % 2 == 1 && [width * divisor, height * divisor] == [need.width, need.height];
        // More samples a pixel are other rays in each.
        if !is_grid || need.samples > 1 || picture.width() != need.width {
            return None;
        }
        let mut few = Framebuffer::new(width, height, Channels::COLOR);
        let all = picture.color();
        few.for_each_band(&crate::parallel::OneThread, height.max(1), &|band| {
            for (i, color) in band.color.iter_mut().enumerate() {
                let [x, y] = [i as u32 % width, band.first_row + i as u32 / width];
                let [x, y] = [x, y].map(|c| (c * divisor + divisor / 2) as usize);
                *color = all[y * need.width as usize + x];
            }
        });
        color_rmse(&few, &self.pictures[1])
    }
}

/// Returns the pilots' sizes, the smaller one first.
fn sizes(width: u32, height: u32) -> [[u32; 2]; 2] {
    let goes_in = |d: &u32| width.is_multiple_of(*d) && height.is_multiple_of(*d);
    let divisor = DIVISORS.into_iter().find(goes_in).unwrap_or(DIVISORS[0]);
    [2 * divisor, divisor].map(|d| {
        let d = d.min(width / LEAST).max(1);
        [width.div_ceil(d).max(1), height.div_ceil(d).max(1)]
    })
}

/// An error of the larger pilot falls on at most by half: edges take a smaller share of a larger picture.
fn falling(small: f64, large: f64) -> f64 {
    if small > 0.0 { large * (large / small).clamp(0.5, 1.0) } else { large }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BuiltinBackends as _;
    use crate::seam::Registry;

    #[test]
    fn time_is_what_pixels_cost_and_what_they_do_not() {
        let nothing = || Framebuffer::new(0, 0, Channels::COLOR);
        let rulers = Rulers { sizes: [[100, 100], [200, 100]], pictures: [nothing(), nothing()], full: None };
        let camera = crate::builtin::scene("cloud").unwrap().cameras.remove(0).1;
        let full = |ms: [f64; 2], width: u32| {
            let need = Need::new(camera.clone(), width, 100);
            rulers.extrapolated(ms, &need)
        };
        assert!((full([3.0, 5.0], 300) - 7.0).abs() < 1e-12);
        assert!((full([5.0, 5.0], 300) - 5.0).abs() < 1e-12, "all is fixed");
        assert!((full([0.0, 4.0], 400) - 8.0).abs() < 1e-12, "all is pixels");
        let errors = [falling(0.0, 0.1), falling(0.4, 0.2), falling(0.4, 0.1), falling(0.1, 0.2)];
        assert_eq!(errors, [0.1, 0.1, 0.05, 0.2]);
    }

    #[test]
    fn the_pixels_that_a_pilot_has_tell_the_error_of_all() {
        let scene = Arc::new(crate::builtin::scene("polyhedra").unwrap());
        let need = Need { tolerance_px: 2.0, ..Need::new(scene.cameras[0].1.clone(), 288, 162) };
        let mut studio = Studio::new(Registry::builtin(), 2).unwrap();
        let rulers = Rulers::draw(&mut studio, &scene, &need).unwrap();
        assert_eq!(rulers.sizes, [[48, 27], [96, 54]]);
        let truth = studio.draw(REFERENCE, &scene, &need).unwrap().framebuffer;
        assert_eq!(rulers.sampled(&truth, &need), Some(0.0), "they are the same rays");
        let picture = studio.draw("raster", &scene, &need).unwrap().framebuffer;
        let (sampled, all) =
            (rulers.sampled(&picture, &need).unwrap(), color_rmse(&picture, &truth).unwrap());
        assert!(all > 0.005 && (sampled / all - 1.0).abs() < 0.25, "{sampled} of {all}");
        assert_eq!(rulers.whole(&picture), Some(all), "the reference is quick here");
        assert_eq!(rulers.sampled(&truth, &Need { width: 287, ..need.clone() }), None, "others are not");
        assert_eq!(sizes(1280, 720)[1], [256, 144]);
    }
}
