//! Is a picture what it must be, whatever came before it, came between, or worked on it?

use super::count::{Drawn, Trial};
use super::draw;
use super::scenes::Setup;
use super::sturm::first_root;
use crate::framebuffer::{Band, Framebuffer};
use crate::parallel::Threads as _;
use crate::prelude::{DVec3, Scene, Shape, Voxels};
use crate::seam::{Control, RenderError, Watcher};
use crate::studio::{Studio, StudioError};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

fn against(error: f64, ms: f64, picture: Framebuffer, reference: Framebuffer) -> Drawn {
    Drawn { error, ms, prepare_ms: 0.0, picture: Some(picture), reference: Some(reference) }
}

/// Returns the share of pixels that differ in color or distance, by any bit.
fn differing(a: &Framebuffer, b: &Framebuffer) -> f64 {
    let distances = a.distance().iter().zip(b.distance());
    let pairs = a.color().iter().zip(b.color()).zip(distances);
    let differs = pairs.filter(|((a, b), (d, e))| a != b || d.to_bits() != e.to_bits()).count();
    differs as f64 / a.color().len().max(1) as f64
}

fn fresh(studio: &Studio, threads: usize) -> Result<Studio, StudioError> {
    Studio::new(studio.registry().clone(), threads)
}

/// Draws scene after scene with one renderer, and the last one with another that knows nothing of those before.
pub(super) fn edited(studio: &mut Studio, backend: &str, own: &Setup) -> Result<Drawn, StudioError> {
    for scene in &own.history {
        draw(studio, backend, &Setup { scene: scene.clone(), ..own.clone() })?;
    }
    let (picture, ms) = draw(studio, backend, own)?;
    let mut other = fresh(studio, studio.pool().count())?;
    let reference = draw(&mut other, backend, own)?.0;
    Ok(against(differing(&picture, &reference), ms, picture, reference))
}

/// Draws with as many threads as the load says, and with one.
pub(super) fn threaded(studio: &mut Studio, backend: &str, own: &Setup) -> Result<Drawn, StudioError> {
    let (picture, ms) = draw(&mut fresh(studio, own.load as usize)?, backend, own)?;
    let reference = draw(&mut fresh(studio, 1)?, backend, own)?.0;
    Ok(against(differing(&picture, &reference), ms, picture, reference))
}

/// Edits the scene when some bands of a frame are finished.
struct Editor<'a> {
    after: u32,
    bands: AtomicU32,
    live: Mutex<Arc<Scene>>,
    edit: fn(&mut Scene),
    stop: Option<&'a AtomicBool>,
}

impl Watcher for Editor<'_> {
    fn finished(&self, _band: &Band<'_>) {
        if self.bands.fetch_add(1, Ordering::Relaxed) + 1 == self.after {
            self.edit();
        }
    }
}

impl Editor<'_> {
    fn edit(&self) {
        let mut live = self.live.lock().unwrap_or_else(PoisonError::into_inner);
        (self.edit)(Arc::make_mut(&mut live));
        if let Some(stop) = self.stop {
            stop.store(true, Ordering::Relaxed);
        }
    }
}

/// Edits the scene while a frame is drawn, once letting the frame end and once stopping it. The frame that ends must show the
/// scene as it was, the next one the scene as it is: counts the pixels of either that do not.
pub(super) fn edited_midway(studio: &mut Studio, backend: &str, own: &Setup) -> Result<Drawn, StudioError> {
    let pool = studio.pool().clone();
    let as_it_was = draw(&mut fresh(studio, pool.count())?, backend, own)?.0;
    let mut edited = own.scene.clone();
    (own.edit)(Arc::make_mut(&mut edited));
    let now = Setup { scene: edited, ..own.clone() };
    let as_it_is = draw(&mut fresh(studio, pool.count())?, backend, &now)?.0;
    // An edit that does not show tells nothing.
    let mut error = f64::from(u8::from(differing(&as_it_is, &as_it_was) == 0.0));
    let mut last = None;
    for stops in [false, true] {
        draw(studio, backend, own)?;
        let stop = AtomicBool::new(false);
        let editor = Editor {
            after: own.load as u32,
            bands: AtomicU32::new(0),
            live: Mutex::new(own.scene.clone()),
            edit: own.edit,
            stop: stops.then_some(&stop),
        };
        let mut picture = Framebuffer::new(own.need.width, own.need.height, own.need.channels);
        let renderer = studio.renderer(backend)?;
        let drawn = pool.install(|| {
            let control = Control::new(&pool).watched_by(&editor).cancelled_by(&stop);
            renderer.render(&own.need.frame(), &mut picture, &control)
        });
        if editor.bands.load(Ordering::Relaxed) < editor.after {
            editor.edit();
        }
        match drawn {
            Ok(_) => error = error.max(differing(&picture, &as_it_was)),
            Err(RenderError::Cancelled) if stops => {}
            Err(error) => return Err(StudioError::Render { backend: backend.to_owned(), error }),
        }
        let scene = editor.live.into_inner().unwrap_or_else(PoisonError::into_inner);
        let (picture, ms) = draw(studio, backend, &Setup { scene, ..own.clone() })?;
        error = error.max(differing(&picture, &as_it_is));
        last = Some((ms, picture));
    }
    let (ms, picture) = last.ok_or_else(|| StudioError::Threads("nothing was drawn".to_owned()))?;
    Ok(against(error, ms, picture, as_it_is))
}

/// Counts the pixels at which a form is not met where counting the roots along the ray says.
pub(super) fn roots_missed(studio: &mut Studio, trial: &Trial<'_>) -> Result<Drawn, StudioError> {
    let own = &trial.own;
    let (picture, ms) = draw(studio, trial.backend, own)?;
    let form = own.scene.objects.first().and_then(|o| match &*o.shape {
        Shape::FreeForm(form) => Some(form.form().clone()),
        _ => None,
    });
    let view = own.need.camera.view(own.need.width, own.need.height);
    let mut wrong = 0u32;
    for (i, &distance) in picture.distance().iter().enumerate() {
        let [x, y] = [i as u32 % own.need.width, i as u32 / own.need.width].map(f64::from);
        let ray = view.ray(x + 0.5, y + 0.5);
        let truth = ray.and_then(|ray| first_root(form.as_ref()?, ray.origin, ray.direction));
        let is_right = match truth {
            Some(root) => (f64::from(distance) - root).abs() < 1e-4 * own.distance,
            None => distance.is_infinite(),
        };
        wrong += u32::from(!is_right);
    }
    let error = f64::from(wrong) / picture.distance().len().max(1) as f64;
    Ok(Drawn { error, ms, prepare_ms: 0.0, picture: Some(picture), reference: None })
}

/// Counts the objects that the reference sees and the back end does not, as a share.
pub(super) fn objects_missed(picture: &Framebuffer, reference: &Framebuffer) -> f64 {
    let seen = |p: &Framebuffer| {
        p.id().iter().copied().filter(|&id| id != 0).collect::<std::collections::HashSet<_>>()
    };
    let (own, all) = (seen(picture), seen(reference));
    all.difference(&own).count() as f64 / all.len().max(1) as f64
}

/// Lets water into the voxels of a back end's model from outside, through some sides of cells. Returns the share
/// of the cells inside that get wet; those inside lie nearer to the origin than one, by two cells.
pub(super) fn flooded(studio: &mut Studio, trial: &Trial<'_>, way: Way) -> Result<Drawn, StudioError> {
    let (picture, ms) = draw(studio, trial.backend, &trial.own)?;
    let model = studio.renderer(trial.backend)?.model();
    let grid = model.as_ref().and_then(|scene| scene.objects.first()).and_then(|o| match &*o.shape {
        Shape::Voxels(voxels) => Some((voxels, o.world_from_object)),
        _ => None,
    });
    let error = grid.map_or(0.0, |(voxels, world_from_cells)| {
        let wet = flood(voxels, way);
        let edge = world_from_cells.matrix3.determinant().abs().cbrt();
        let (mut inside, mut reached) = (0u32, 0u32);
        for (i, &wet) in wet.iter().enumerate() {
            let middle = DVec3::from_array(cell_of(voxels, i).map(f64::from)) + 0.5;
            if world_from_cells.transform_point3(middle).length() < 1.0 - 2.0 * edge * 3f64.sqrt() {
                inside += 1;
                reached += u32::from(wet);
            }
        }
        f64::from(reached) / f64::from(inside.max(1))
    });
    Ok(Drawn { error, ms, prepare_ms: 0.0, picture: Some(picture), reference: None })
}

fn cell_of(voxels: &Voxels, index: usize) -> [u32; 3] {
    let [nx, ny, _] = voxels.size().map(|s| s as usize);
    [index % nx, index / nx % ny, index / (nx * ny)].map(|c| c as u32)
}

/// Where water passes from cell to cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// Through faces.
    Faces,
    /// Through faces, edges and corners.
    Corners,
}

/// Marks the empty cells that are reached from the border.
fn flood(voxels: &Voxels, way: Way) -> Vec<bool> {
    let size = voxels.size();
    let mut wet = vec![false; size.iter().map(|&s| s as usize).product()];
    let index = |c: [u32; 3]| ((c[2] * size[1] + c[1]) * size[0] + c[0]) as usize;
    let is_empty = |c: [u32; 3]| voxels.get(c[0], c[1], c[2]) == 0;
    let at_border = |c: &[u32; 3]| (0..3).any(|a| c[a] == 0 || c[a] + 1 == size[a]);
    let mut queue: Vec<[u32; 3]> =
        (0..wet.len()).map(|i| cell_of(voxels, i)).filter(|c| at_border(c) && is_empty(*c)).collect();
    queue.iter().for_each(|&c| wet[index(c)] = true);
    while let Some(cell) = queue.pop() {
        for k in 0..27u32 {
            let step = [k % 3, k / 3 % 3, k / 9];
            if way == Way::Faces && step.iter().filter(|s| **s != 1).count() > 1 {
                continue;
            }
            let next: [u32; 3] = std::array::from_fn(|a| (cell[a] + step[a]).wrapping_sub(1));
            if (0..3).all(|a| next[a] < size[a]) && !wet[index(next)] && is_empty(next) {
                wet[index(next)] = true;
                queue.push(next);
            }
        }
    }
    wet
}
