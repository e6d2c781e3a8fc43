//! What must a projector throw onto a curved screen, so that a viewer sees the scene undistorted?
//!
//! A ray through a pixel of the projector meets the screen at a point; the viewer sees that point in some direction, and
//! there the scene is looked at. Directions are tabulated on a grid and interpolated ([`WarpTable`]), so that a table is
//! ready for each frame while the viewer moves.

use crate::camera::{Camera, Projection, View, WarpTable};
use crate::math::Ray;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Pixels of the picture between entries of a table: finer on neither axis.
const PIXELS: u32 = 16;

/// A screen that is looked at, and thrown upon, from within.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum Screen {
    /// The inside of a sphere.
    Dome {
        /// Its middle.
        #[schemars(with = "[f64; 3]")]
        center: DVec3,
        /// Its radius.
        radius: f64,
    },
    /// The inside of an endless upright cylinder.
    Cylinder {
        /// A point on its axis, which is parallel to y.
        #[schemars(with = "[f64; 3]")]
        center: DVec3,
        /// Its radius.
        radius: f64,
    },
}

/// A projector before a curved screen.
#[derive(Clone, Debug, PartialEq)]
pub struct Projector {
    /// From where and through which lens it throws its picture.
    pub lens: Camera,
    /// What it throws it on.
    pub screen: Screen,
}

impl Screen {
    /// Returns where a ray from within meets the screen; nothing for one along the axis, or from beyond that misses it.
    #[must_use]
    pub fn meet(&self, ray: &Ray) -> Option<DVec3> {
        let (center, radius, flat) = match *self {
            Self::Dome { center, radius } => (center, radius, DVec3::ONE),
            Self::Cylinder { center, radius } => (center, radius, DVec3::new(1.0, 0.0, 1.0)),
        };
        let (offset, direction) = ((ray.origin - center) * flat, ray.direction * flat);
        let (a, b) = (direction.length_squared(), offset.dot(direction));
        let discriminant = b * b - a * (offset.length_squared() - radius * radius);
        if a <= 0.0 || discriminant < 0.0 {
            return None;
        }
        let t = (discriminant.sqrt() - b) / a;
        (t > 0.0 && t.is_finite()).then(|| ray.origin + ray.direction * t)
    }
}

impl Projector {
    /// Returns the camera of a viewer for a picture of that size: what it draws, thrown onto the screen, looks right
    /// from there.
    ///
    /// # Errors
    /// When the viewer or the screen is nowhere.
    pub fn camera(&self, viewer: DVec3, width: u32, height: u32) -> Result<Camera, String> {
        let (Screen::Dome { center, radius } | Screen::Cylinder { center, radius }) = self.screen;
        if !(viewer.is_finite() && center.is_finite() && radius > 0.0 && radius.is_finite()) {
            return Err(format!("a screen of radius {radius} around {center} seen from {viewer}"));
        }
        let [columns, rows] = [width, height].map(|pixels| pixels.div_ceil(PIXELS) + 1);
        let mut directions = Vec::new();
        self.fill(viewer, [width, height], [columns, rows], &mut directions);
        let table = WarpTable::new(columns, rows, directions)?;
        let projection = Projection::Warp(Arc::new(table));
        Ok(Camera { eye: viewer, world_from_camera: self.lens.world_from_camera, projection })
    }

    /// Fills a grid of directions, in the space of the projector's lens, for a viewer; zero where the picture does not
    /// meet the screen. Allocates only when the grid is larger than any before.
    pub fn fill(
        &self,
        viewer: DVec3,
        [width, height]: [u32; 2],
        [columns, rows]: [u32; 2],
        directions: &mut Vec<DVec3>,
    ) {
        let view = self.lens.view(width, height);
        let camera_from_world = self.lens.world_from_camera.transpose();
        let step = |pixels: u32, count: u32| f64::from(pixels) / f64::from(count.max(2) - 1);
        directions.clear();
        for row in 0..rows {
            let y = f64::from(row) * step(height, rows);
            directions.extend((0..columns).map(|column| {
                let point = self.point(&view, f64::from(column) * step(width, columns), y);
                point.map_or(DVec3::ZERO, |p| camera_from_world * (p - viewer))
            }));
        }
    }

    /// Returns where a place of the picture appears on the screen.
    #[must_use]
    pub fn point(&self, view: &View<'_>, x: f64, y: f64) -> Option<DVec3> {
        self.screen.meet(&view.ray(x, y)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [1920, 1080];

    fn projectors() -> [Projector; 3] {
        let look = |eye: DVec3, target: DVec3, projection: Projection| {
            Camera::look_at(eye, target, DVec3::Y, projection)
        };
        let dome = Screen::Dome { center: DVec3::new(0.0, 1.0, 0.0), radius: 6.0 };
        let wall = Screen::Cylinder { center: DVec3::new(0.5, 0.0, 0.0), radius: 4.0 };
        let wide = Projection::Perspective { fov_y: 1.2 };
        [
            Projector {
                lens: look(DVec3::new(0.0, 0.5, 2.0), DVec3::new(0.0, 2.0, -6.0), wide.clone()),
                screen: dome,
            },
            Projector {
                lens: look(
                    DVec3::new(0.3, 0.0, 0.2),
                    DVec3::new(0.3, 1.0, -4.0),
                    Projection::Fisheye { fov: 3.0 },
                ),
                screen: dome,
            },
            Projector {
                lens: look(DVec3::new(0.0, 2.0, 1.0), DVec3::new(0.0, 0.0, -4.0), wide),
                screen: wall,
            },
        ]
    }

    /// Returns how many pixels the drawn place of a straight edge is off where the lens would have to throw it, at most.
    fn most_off(projector: &Projector, viewer: DVec3, edge: [DVec3; 2]) -> (f64, u32) {
        let [width, height] = SIZE;
        let camera = projector.camera(viewer, width, height).unwrap();
        let (drawn, lens) = (camera.view(width, height), projector.lens.view(width, height));
        // A direction is on the edge where it lies in the plane through the edge and the viewer.
        let plane = (edge[0] - viewer).cross(edge[1] - viewer).normalize_or_zero();
        let (mut worst, mut met) = (0.0f64, 0);
        for row in (0..height).step_by(9) {
            let y = f64::from(row) + 0.5;
            let table = |x: f64| drawn.ray(x, y).map(|ray| ray.direction.dot(plane));
            let exact =
                |x: f64| projector.point(&lens, x, y).map(|p| (p - viewer).normalize_or_zero().dot(plane));
            for column in (0..width - 8).step_by(8) {
                let ends = [f64::from(column), f64::from(column + 8)];
                let crossing = |f: &dyn Fn(f64) -> Option<f64>, [mut a, mut b]: [f64; 2]| {
                    let sign = f(a)? > 0.0;
                    if sign == (f(b)? > 0.0) {
                        return None;
                    }
                    for _ in 0..40 {
                        let middle = 0.5 * (a + b);
                        if (f(middle)? > 0.0) == sign { a = middle } else { b = middle }
                    }
                    Some(a)
                };
                if let Some(x) = crossing(&exact, ends)
                    && let Some(found) = crossing(&table, [ends[0] - 2.0, ends[1] + 2.0])
                {
                    worst = worst.max((x - found).abs());
                    met += 1;
                }
            }
        }
        (worst, met)
    }

    #[test]
    fn straight_edges_are_straight_to_a_quarter_of_a_pixel_wherever_the_viewer_is() {
        let mut met = 0;
        for projector in projectors() {
            for viewer in [DVec3::ZERO, DVec3::new(1.0, 0.4, -0.8), DVec3::new(-1.5, 1.0, 1.0)] {
                for x in [-3.0, 0.4, 2.5] {
                    let edge = [DVec3::new(x, -4.0, -9.0), DVec3::new(x + 1.0, 9.0, -11.0)];
                    let (off, rows) = most_off(&projector, viewer, edge);
                    assert!(off <= 0.25, "{off} pixels off: {projector:?} from {viewer}");
                    met += rows;
                }
            }
        }
        assert!(met > 1000, "{met} rows meet an edge");
    }

    #[test]
    fn what_is_drawn_for_a_place_on_the_screen_lies_behind_it() {
        for projector in projectors() {
            let viewer = DVec3::new(0.7, 0.2, -0.4);
            let camera = projector.camera(viewer, 640, 360).unwrap();
            let (drawn, lens) = (camera.view(640, 360), projector.lens.view(640, 360));
            let point = projector.point(&lens, 320.0, 176.0).unwrap();
            let ray = drawn.ray(320.0, 176.0).unwrap();
            assert!(ray.direction.angle_between(point - viewer) < 1e-3);
            assert_eq!(ray.origin, viewer);
        }
        let nowhere = projectors()[0].camera(DVec3::NAN, 640, 360);
        assert!(nowhere.unwrap_err().contains("seen from"));
    }
}
