//! Where are the lines of a drawing?
//!
//! In image space: between neighboring pixels of different objects, where the distance jumps away from the plane
//! through one of them (so that grazing planes have no false lines), and where the normal turns by more than the
//! crease angle. The line lies on the nearer pixel.

use glam::{DVec3, Vec3};
use polyptych_core::camera::View;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::lanes::LANES;

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

/// Tells whether none of a few pixels shows an object: most pixels of most pictures do not, and are passed quickly.
#[inline(always)]
pub(crate) fn shows_nothing(ids: &[u32]) -> bool {
    ids.iter().fold(0, |any, id| any | id) == 0
}

impl Contours {
    /// Returns how many rows around a row its lines may come from.
    pub(crate) fn reach(&self) -> u32 {
        (self.width * 0.5).ceil() as u32 + 1
    }

    /// Lists the edge pixels of a row, from the left.
    pub(crate) fn mark_row(&self, picture: &Framebuffer, view: &View<'_>, y: u32, edges: &mut Vec<u32>) {
        edges.clear();
        let (width, height) = (picture.width(), picture.height());
        let row = (y * width) as usize..((y + 1) * width) as usize;
        let pieces = (0..width).step_by(LANES).zip(picture.id()[row].chunks(LANES));
        let seen = pieces.filter(|(_, ids)| !shows_nothing(ids));
        for (x, &id) in seen.flat_map(|(first, ids)| (first..).zip(ids)) {
            let i = (y * width + x) as usize;
            let down = width as usize;
            // Most pixels are like their neighbors, which is quickly seen.
            let unlike = id != 0
                && ((x + 1 < width && self.differ(picture, i, i + 1))
                    || (y + 1 < height && self.differ(picture, i, i + down))
                    || (x > 0 && self.differ(picture, i, i - 1))
                    || (y > 0 && self.differ(picture, i, i - down)));
            if !unlike {
                continue;
            }
            let beside = |u: Option<u32>, v: Option<u32>| match (u, v) {
                (Some(u), Some(v)) if u < width && v < height => self.edge(picture, view, (x, y), (u, v)),
                _ => false,
            };
            if beside(Some(x + 1), Some(y))
                || beside(Some(x), Some(y + 1))
                || beside(x.checked_sub(1), Some(y))
                || beside(Some(x), y.checked_sub(1))
            {
                edges.push(x);
            }
        }
    }

    /// Tells whether a line may run between two pixels: nothing is between those that do not differ.
    #[inline(always)]
    fn differ(&self, picture: &Framebuffer, i: usize, j: usize) -> bool {
        let (near, far) = (picture.distance()[i], picture.distance()[j]);
        let jumps = (near - far).abs() > JUMP * near.min(far);
        picture.id()[i] != picture.id()[j]
            || jumps
            || near.is_nan()
            || far.is_nan()
            || picture.normal()[i].dot(picture.normal()[j]) < self.crease_cosine
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

    /// Lays the lines of one row of edges over a piece of coverage that begins at a column, `dy` rows away. Tells
    /// whether any are near.
    pub(crate) fn splat_row(&self, edges: &[u32], dy: f32, first: usize, coverage: &mut [f32]) -> bool {
        let reach = self.reach() as usize;
        let begin = edges.partition_point(|&x| x as usize + reach < first);
        let near = edges[begin..].iter().map(|&x| x as usize);
        let end = first + coverage.len() + reach;
        let mut touched = false;
        for x in near.take_while(|&x| x < end) {
            touched = true;
            let last = (x + reach + 1 - first).min(coverage.len());
            let from = x.saturating_sub(first + reach);
            for (u, cover) in coverage[..last].iter_mut().enumerate().skip(from) {
                let dx = (first + u) as f32 - x as f32;
                let line = self.width * 0.5 + 0.5 - (dx * dx + dy * dy).sqrt();
                *cover = cover.max(line.clamp(0.0, 1.0));
            }
        }
        touched
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_the_same_in_one_piece_and_in_many() {
        let contours = Contours { drawn: true, width: 3.5, color: Vec3::ZERO, crease_cosine: 0.5 };
        let edges = [0, 1, 14, 17, 33, 40, 63];
        let mut whole = [0.0f32; 64];
        contours.splat_row(&edges, 1.0, 0, &mut whole);
        assert!(whole[14] > 0.9 && whole[25] == 0.0 && whole[63] > 0.9);
        let mut pieces = [0.0f32; 64];
        for (i, piece) in pieces.chunks_mut(16).enumerate() {
            contours.splat_row(&edges, 1.0, i * 16, piece);
        }
        assert_eq!(whole, pieces);
    }
}
