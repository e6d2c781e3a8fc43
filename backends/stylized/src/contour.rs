//! Where are the lines of a drawing?
//!
//! In image space: between neighboring pixels of different objects, where the distance jumps away from the plane
//! through one of them (so that grazing planes have no false lines), and where the normal turns by more than the
//! crease angle. The line lies on the nearer pixel.

use glam::{DVec3, Vec3};
use polyptych_core::camera::View;
use polyptych_core::framebuffer::Framebuffer;

/// Which lines are drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contours {
    /// Whether any are.
    pub(crate) drawn: bool,
    /// Width in pixels.
    pub(crate) width: f32,
    /// Color, linear.
    pub(crate) color: Vec3,
    /// Cosine of the angle from which on a fold is a crease.
    pub(crate) crease_cosine: f32,
}

/// A jump in distance smaller than this share of it is no silhouette: it would show on any rounded edge.
const JUMP: f32 = 0.01;

impl Contours {
    /// Returns how many rows around a row its lines may come from.
    pub(crate) fn reach(&self) -> u32 {
        (self.width * 0.5).ceil() as u32 + 1
    }

    /// Marks the edge pixels of a row.
    pub(crate) fn mark_row(&self, picture: &Framebuffer, view: &View<'_>, y: u32, edges: &mut [bool]) {
        edges.fill(false);
        let (width, height) = (picture.width(), picture.height());
        for x in 0..width {
            let here = (y * width + x) as usize;
            let beside = |dx: i32, dy: i32| -> bool {
                let (Some(u), Some(v)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else {
                    return false;
                };
                u < width && v < height && self.edge(picture, view, (x, y), (u, v))
            };
            edges[x as usize] =
                picture.id()[here] != 0 && (beside(1, 0) || beside(0, 1) || beside(-1, 0) || beside(0, -1));
        }
    }

    /// Tells whether a line runs between two neighbors, on the side of `a`.
    fn edge(&self, picture: &Framebuffer, view: &View<'_>, a: (u32, u32), b: (u32, u32)) -> bool {
        let index = |p: (u32, u32)| (p.1 * picture.width() + p.0) as usize;
        let (i, j) = (index(a), index(b));
        let (near, far) = (picture.distance()[i], picture.distance()[j]);
        let (id, other) = (picture.id()[i], picture.id()[j]);
        let nearer = near < far || (near == far && id < other);
        if id != other {
            return nearer;
        }
        let (normal, other_normal) = (picture.normal()[i], picture.normal()[j]);
        if normal.dot(other_normal) < self.crease_cosine {
            return nearer;
        }
        if !nearer || far - near <= JUMP * near {
            return false;
        }
        let ray = |p: (u32, u32)| view.ray(f64::from(p.0) + 0.5, f64::from(p.1) + 0.5);
        let (Some(ray_a), Some(ray_b)) = (ray(a), ray(b)) else { return true };
        // Does the neighbor lie on the plane through this pixel, or this pixel on the neighbor's?
        let along = |n: Vec3, p: DVec3, r: &polyptych_core::math::Ray| {
            let n = n.as_dvec3();
            n.dot(p - r.origin) / n.dot(r.direction)
        };
        let (point_a, point_b) = (ray_a.at(f64::from(near)), ray_b.at(f64::from(far)));
        let off_a = (along(normal, point_a, &ray_b) - f64::from(far)).abs();
        let off_b = (along(other_normal, point_b, &ray_a) - f64::from(near)).abs();
        let allowed = f64::from(JUMP * near);
        !(off_a <= allowed || off_b <= allowed)
    }

    /// Lays the lines of one row of edges over a row of coverage that is `dy` rows away.
    pub(crate) fn splat_row(&self, edges: &[bool], dy: f32, coverage: &mut [f32]) {
        let reach = self.reach() as usize;
        for x in (0..edges.len()).filter(|&x| edges[x]) {
            let last = (x + reach).min(edges.len() - 1);
            for (u, cover) in coverage[..=last].iter_mut().enumerate().skip(x.saturating_sub(reach)) {
                let dx = u as f32 - x as f32;
                let line = self.width * 0.5 + 0.5 - (dx * dx + dy * dy).sqrt();
                *cover = cover.max(line.clamp(0.0, 1.0));
            }
        }
    }
}
