//! Which part of a triangle lies ahead of the eye and within the guard band?
//!
//! Source: I. E. Sutherland, G. W. Hodgman, *Reentrant polygon clipping*, CACM 17(1), 1974, in homogeneous
//! coordinates. A crossing is always reckoned from the inner corner to the outer one, so that the two triangles
//! at an edge get the same corner, to the last bit.

use crate::lens::{GUARD, Homogeneous, Lens};
use crate::setup::{DepthPlane, ScreenPoint};

/// Corners of a triangle after five cuts.
const MOST: usize = 8;

/// A convex polygon before division.
struct Polygon {
    corners: [Homogeneous; MOST],
    count: usize,
}

/// Clips a triangle and calls `piece` for each triangle of what is left.
pub(crate) fn clip(
    lens: &Lens,
    corners: [Homogeneous; 3],
    mut piece: impl FnMut([ScreenPoint; 3], DepthPlane),
) {
    let mut polygon = Polygon { corners: [Homogeneous::default(); MOST], count: 3 };
    polygon.corners[..3].copy_from_slice(&corners);
    polygon.cut(|h| h.ahead - lens.near);
    let (right, bottom) = (f64::from(lens.width) + GUARD, f64::from(lens.height) + GUARD);
    polygon.cut(|h| h.x + GUARD * lens.divisor(h.ahead));
    polygon.cut(|h| right * lens.divisor(h.ahead) - h.x);
    polygon.cut(|h| h.y + GUARD * lens.divisor(h.ahead));
    polygon.cut(|h| bottom * lens.divisor(h.ahead) - h.y);
    if polygon.count < 3 {
        return;
    }
    let slope = depth_slope(lens, &corners);
    let point = |h: &Homogeneous| {
        let ahead = h.ahead.max(lens.near);
        let share = 1.0 / lens.divisor(ahead);
        ScreenPoint {
            x: (h.x * share).clamp(-GUARD, right),
            y: (h.y * share).clamp(-GUARD, bottom),
            depth: lens.depth(ahead),
        }
    };
    let left = &polygon.corners[..polygon.count];
    let first = point(&left[0]);
    for pair in left[1..].windows(2) {
        let points = [first, point(&pair[0]), point(&pair[1])];
        piece(points, DepthPlane { by_column: slope.0, by_row: slope.1 });
    }
}

/// Returns the change of depth over a pixel, from the whole triangle: pieces may be too narrow to tell.
///
/// With `h` = (column w, row w, w) of a corner and `k` its depth times w, the plane `a` solves `a . h = k`.
fn depth_slope(lens: &Lens, corners: &[Homogeneous; 3]) -> (f64, f64) {
    let h = corners.map(|c| glam::DVec3::new(c.x, c.y, lens.divisor(c.ahead)));
    let k = corners.map(|c| lens.depth(c.ahead) * lens.divisor(c.ahead));
    let (a, b, c) = (h[1].cross(h[2]), h[2].cross(h[0]), h[0].cross(h[1]));
    let plane = (a * k[0] + b * k[1] + c * k[2]) / h[0].dot(a);
    if plane.is_finite() { (plane.x, plane.y) } else { (0.0, 0.0) }
}

impl Polygon {
    /// Keeps what has a distance of 0 or more.
    fn cut(&mut self, distance: impl Fn(&Homogeneous) -> f64) {
        let old = self.corners;
        let count = std::mem::take(&mut self.count);
        for i in 0..count {
            let (a, b) = (&old[i], &old[(i + 1) % count]);
            let (da, db) = (distance(a), distance(b));
            if da >= 0.0 {
                self.push(*a);
            }
            if da >= 0.0 && db < 0.0 {
                self.push(crossing(a, b, da / (da - db)));
            } else if da < 0.0 && db >= 0.0 {
                self.push(crossing(b, a, db / (db - da)));
            }
        }
    }

    fn push(&mut self, corner: Homogeneous) {
        if self.count < MOST {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }
}

fn crossing(inner: &Homogeneous, outer: &Homogeneous, t: f64) -> Homogeneous {
    Homogeneous {
        x: inner.x + (outer.x - inner.x) * t,
        y: inner.y + (outer.y - inner.y) * t,
        ahead: inner.ahead + (outer.ahead - inner.ahead) * t,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec3};

    #[test]
    fn a_corner_behind_the_eye_leaves_two_pieces_ahead_of_it() {
        let lens = Lens::central(DVec3::ZERO, DMat3::IDENTITY, 50.0, [100, 100], 1e-3);
        let screen_from_object = lens.for_object(&glam::DAffine3::IDENTITY);
        let corners = [[-1.0, -1.0, -5.0], [1.0, -1.0, -5.0], [0.0, -1.0, 5.0]]
            .map(|p| screen_from_object.apply(DVec3::from_array(p)));
        let mut pieces = 0;
        clip(&lens, corners, |points, _| {
            pieces += 1;
            for p in points {
                assert!(p.x >= -GUARD && p.x <= 100.0 + GUARD && p.y <= 100.0 + GUARD, "{p:?}");
                assert!(p.depth > 0.0 && p.depth <= 1000.0);
            }
        });
        assert!(pieces >= 2, "{pieces}");
    }

    #[test]
    fn both_triangles_at_an_edge_cut_it_at_the_same_point() {
        let lens = Lens::central(DVec3::ZERO, DMat3::IDENTITY, 50.0, [100, 100], 1e-3);
        let screen_from_object = lens.for_object(&glam::DAffine3::IDENTITY);
        let at = |p: [f64; 3]| screen_from_object.apply(DVec3::from_array(p));
        let (a, b) = (at([-0.3, -1.0, -7.0]), at([0.7, -1.1, 3.0]));
        let near = |corners: [Homogeneous; 3]| {
            let mut polygon = Polygon { corners: [Homogeneous::default(); MOST], count: 3 };
            polygon.corners[..3].copy_from_slice(&corners);
            polygon.cut(|h| h.ahead - lens.near);
            polygon.corners[..polygon.count].to_vec()
        };
        let (one, two) = (near([a, b, at([5.0, 0.0, -4.0])]), near([b, a, at([-5.0, 0.0, -4.0])]));
        let shared = one.iter().filter(|h| two.contains(h)).count();
        assert_eq!(shared, 2, "the corner ahead and the crossing: {one:?} {two:?}");
    }
}
