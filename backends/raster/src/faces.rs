//! How are cameras drawn that bend straight lines? As up to six right-angled pictures, looked up pixel by pixel.

use crate::lens::{Lens, cube_axes, cube_face};
use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, View};
use polyptych_core::framebuffer::{Channels, Framebuffer, Pixel};
use polyptych_core::parallel::Threads;
use polyptych_core::scene::Background;
use std::sync::atomic::{AtomicU8, Ordering};

/// Pixels of a face for one of the picture where the picture is finest: the nearest one is then at most a third
/// of a pixel off.
const FINER: f64 = 1.5;
/// Smallest and largest edge of a face.
const EDGES: [f64; 2] = [16.0, 4096.0];
/// Rows that one thread takes at a time.
const ROWS: u32 = 32;

/// Pictures of the faces of a cube around the eye; kept from frame to frame.
#[derive(Default)]
pub(crate) struct Faces {
    pictures: Vec<Framebuffer>,
}

impl Faces {
    /// Makes room for six faces and returns their edge.
    pub(crate) fn reserve(&mut self, view: &View<'_>, width: u32, height: u32, channels: Channels) -> u32 {
        let edge = (2.0 * FINER / finest_angle(view, width, height)).clamp(EDGES[0], EDGES[1]).ceil() as u32;
        // The id tells which pixels see nothing.
        let channels = channels.with(polyptych_core::framebuffer::Channel::Id);
        let fits = |p: &Framebuffer| p.width() == edge && p.channels() == channels;
        if self.pictures.len() != 6 || !self.pictures.iter().all(fits) {
            self.pictures = (0..6).map(|_| Framebuffer::new(edge, edge, channels)).collect();
        }
        edge
    }

    /// Returns the picture of a face.
    pub(crate) fn picture(&mut self, face: usize) -> &mut Framebuffer {
        &mut self.pictures[face]
    }

    /// Returns the bytes held.
    pub(crate) fn bytes(&self) -> u64 {
        self.pictures.iter().map(Framebuffer::bytes).sum()
    }

    /// Copies each pixel from the face that its ray goes through.
    pub(crate) fn resample(
        &self,
        camera: &Camera,
        background: &Background,
        target: &mut Framebuffer,
        threads: &dyn Threads,
    ) {
        let view = camera.view(target.width(), target.height());
        let nothing = Pixel::background(background.color(camera.forward()));
        let edge = self.pictures[0].width();
        let lenses: [Lens; 6] = std::array::from_fn(|face| face_lens(camera, face, edge, 0.0));
        target.for_each_band(threads, ROWS, &|mut band| {
            for row in 0..band.rows {
                for x in 0..band.width {
                    let place = (f64::from(x) + 0.5, f64::from(band.first_row + row) + 0.5);
                    let pixel = match view.ray(place.0, place.1) {
                        None => nothing,
                        Some(ray) => {
                            let face = face_of(camera, ray.direction);
                            let (column, line, _) = lenses[face].place(ray.direction);
                            let hold = |v: f64| (v.max(0.0) as u32).min(edge - 1);
                            let at = (hold(line) * edge + hold(column)) as usize;
                            let mut pixel = pixel_at(&self.pictures[face], at);
                            if pixel.id == 0 {
                                pixel.color = background.color(ray.direction);
                            }
                            pixel
                        }
                    };
                    band.put(x, row, &pixel);
                }
            }
        });
    }
}

/// Tells which faces a picture needs, a bit for each.
pub(crate) fn needed(camera: &Camera, width: u32, height: u32, threads: &dyn Threads) -> u8 {
    let view = camera.view(width, height);
    let needed = AtomicU8::new(0);
    polyptych_core::parallel::for_each_index(threads, height as usize, ROWS as usize, &|row| {
        let mut of_row = 0;
        for x in 0..width {
            if let Some(ray) = view.ray(f64::from(x) + 0.5, row as f64 + 0.5) {
                of_row |= 1 << face_of(camera, ray.direction);
            }
        }
        needed.fetch_or(of_row, Ordering::Relaxed);
    });
    needed.into_inner()
}

/// Returns the lens of a face; the cube is turned with the camera.
pub(crate) fn face_lens(camera: &Camera, face: usize, edge: u32, near: f64) -> Lens {
    let axes = camera.world_from_camera * cube_axes(face);
    Lens::central(camera.eye, axes, f64::from(edge) * 0.5, [edge; 2], near)
}

fn face_of(camera: &Camera, direction: DVec3) -> usize {
    cube_face(camera.world_from_camera.transpose() * direction)
}

/// Returns the smallest angle between neighboring pixels, from a grid of places over the picture.
fn finest_angle(view: &View<'_>, width: u32, height: u32) -> f64 {
    let (mut finest, cells) = (f64::INFINITY, 16);
    for i in 0..cells * cells {
        let share = |c: u32, size: u32| (f64::from(c) + 0.5) / f64::from(cells) * f64::from(size);
        let (x, y) = (share(i % cells, width), share(i / cells, height));
        let Some(here) = view.ray(x, y) else { continue };
        for (dx, dy) in [(0.5, 0.0), (0.0, 0.5)] {
            if let Some(there) = view.ray(x + dx, y + dy) {
                let angle = (here.direction - there.direction).length() * 2.0;
                if angle > 1e-9 {
                    finest = finest.min(angle);
                }
            }
        }
    }
    if finest.is_finite() { finest } else { 0.01 }
}

fn pixel_at(picture: &Framebuffer, i: usize) -> Pixel {
    let plain = Pixel::background(Vec3::ZERO);
    Pixel {
        color: picture.color().get(i).copied().unwrap_or(plain.color),
        distance: picture.distance().get(i).copied().unwrap_or(plain.distance),
        normal: picture.normal().get(i).copied().unwrap_or(plain.normal),
        id: picture.id().get(i).copied().unwrap_or(plain.id),
        albedo: picture.albedo().get(i).copied().unwrap_or(plain.albedo),
        shadow: picture.shadow().get(i).copied().unwrap_or(plain.shadow),
        coverage: picture.coverage().get(i).copied().unwrap_or(plain.coverage),
    }
}
