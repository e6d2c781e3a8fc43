//! From where the scene is seen, and how directions become pixels.

use crate::lanes::{DVec3x8, F64x8, I32x8, LANES, Mask8, Vec3x8};
use crate::math::{Aabb, Ray};
use crate::scene::Background;
use glam::{DMat3, DVec2, DVec3, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::hint::black_box;
use std::sync::Arc;

/// An eye with six degrees of freedom and a projection.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Where the eye is; for orthographic cameras the middle of the picture plane.
    pub eye: DVec3,
    /// Columns are right, up and backward: a right-handed frame that looks along its -z.
    pub world_from_camera: DMat3,
    /// How directions become pixels.
    pub projection: Projection,
}

/// How directions become pixels. Angles are whole angles in radians.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Projection {
    /// Straight lines stay straight.
    Perspective {
        /// Vertical field of view.
        fov_y: f64,
    },
    /// Parallel rays.
    Orthographic {
        /// Height of the picture in meters.
        height: f64,
    },
    /// Equidistant fisheye: the distance from the middle is the angle to the axis. Pixels outside of the
    /// image circle, which touches the shorter edges, see nothing.
    Fisheye {
        /// Angle across the image circle, up to a full turn.
        fov: f64,
    },
    /// Columns are angles around the up axis, rows are heights on a cylinder.
    Cylindrical {
        /// Angle across the width.
        fov_x: f64,
        /// Vertical field of view at eye level, below pi.
        fov_y: f64,
    },
    /// Any screen: directions from a table.
    #[serde(skip)]
    Warp(Arc<WarpTable>),
}

/// Directions in camera space on a grid over the picture, interpolated bilinearly.
#[derive(Clone, Debug, PartialEq)]
pub struct WarpTable {
    columns: u32,
    rows: u32,
    directions: Vec<DVec3>,
}

impl WarpTable {
    /// Builds a table whose first and last entries lie on the picture's borders.
    ///
    /// # Errors
    /// When it has fewer than 2x2 entries, or their number does not fit. A direction that is zero or not
    /// finite marks pixels around it as seeing nothing.
    pub fn new(columns: u32, rows: u32, directions: Vec<DVec3>) -> Result<Self, String> {
        if columns < 2 || rows < 2 {
            return Err(format!("a warp table needs at least 2x2 directions, got {columns}x{rows}"));
        }
        if directions.len() as u64 != u64::from(columns) * u64::from(rows) {
            return Err(format!("{} directions for {columns}x{rows}", directions.len()));
        }
        Ok(Self { columns, rows, directions })
    }

    /// Returns the number of columns.
    #[must_use]
    pub fn columns(&self) -> u32 {
        self.columns
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Returns the directions, row by row.
    #[must_use]
    pub fn directions(&self) -> &[DVec3] {
        &self.directions
    }

    /// Interpolates the direction at a place of the picture, `(0, 0)` top left, `(1, 1)` bottom right.
    fn direction(&self, place: DVec2) -> Option<DVec3> {
        let grid = place * DVec2::new(f64::from(self.columns - 1), f64::from(self.rows - 1));
        let column = grid.x.floor().clamp(0.0, f64::from(self.columns - 2));
        let row = grid.y.floor().clamp(0.0, f64::from(self.rows - 2));
        let (u, v) = (grid.x - column, grid.y - row);
        let first = (row as u32 * self.columns + column as u32) as usize;
        let corner = |dx: usize, dy: usize| {
            let d = self.directions[first + dy * self.columns as usize + dx];
            d.try_normalize().filter(|d| d.is_finite())
        };
        let (a, b, c, d) = (corner(0, 0)?, corner(1, 0)?, corner(0, 1)?, corner(1, 1)?);
        a.lerp(b, u).lerp(c.lerp(d, u), v).try_normalize()
    }
}

impl Camera {
    /// Builds a perspective camera that looks at a point. `up` need not be perpendicular; where it is
    /// parallel to the view, another axis is taken.
    #[must_use]
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, projection: Projection) -> Self {
        let backward = (eye - target).try_normalize().unwrap_or(DVec3::Z);
        let right = [up, DVec3::Y, DVec3::Z, DVec3::X]
            .iter()
            .filter_map(|u| u.try_normalize())
            .map(|u| u.cross(backward))
            .find(|r| r.length() > 1e-9)
            .and_then(DVec3::try_normalize)
            .unwrap_or(DVec3::X);
        let world_from_camera = DMat3::from_cols(right, backward.cross(right), backward);
        Self { eye, world_from_camera, projection }
    }

    /// Builds a camera that sees the whole of a box from a direction.
    ///
    /// `azimuth` turns around y from +z towards +x, `elevation` rises from the horizon (radians); `aspect` is
    /// width over height. Any box works: empty ones, points, and boxes of any size.
    #[must_use]
    pub fn framing(bounds: &Aabb, azimuth: f64, elevation: f64, aspect: f64, projection: Projection) -> Self {
        let radius = match bounds.radius() {
            r if r > 0.0 && r.is_finite() => r,
            _ => 1.0,
        };
        let outward =
            DVec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
        let narrow = |fov_y: f64| {
            let half = (fov_y * 0.5).clamp(1e-6, 1.5);
            half.min((half.tan() * aspect).atan())
        };
        let (distance, projection) = match projection {
            Projection::Perspective { fov_y } => (radius / narrow(fov_y).sin(), projection),
            Projection::Orthographic { .. } => {
                let height = 2.0 * radius / aspect.min(1.0);
                (radius * 2.0, Projection::Orthographic { height })
            }
            Projection::Fisheye { fov } => (radius / (fov * 0.5).clamp(0.1, 1.5).sin(), projection),
            Projection::Cylindrical { fov_y, .. } => (radius / narrow(fov_y).sin(), projection),
            Projection::Warp(_) => (radius * 3.0, projection),
        };
        let center = bounds.center();
        Self::look_at(center + outward * distance, center, DVec3::Y, projection)
    }

    /// Returns the viewing direction.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        -self.world_from_camera.z_axis
    }

    /// Returns the camera's right.
    #[must_use]
    pub fn right(&self) -> DVec3 {
        self.world_from_camera.x_axis
    }

    /// Returns the camera's up.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.world_from_camera.y_axis
    }

    /// Prepares the rays of a picture of that size.
    #[must_use]
    pub fn view(&self, width: u32, height: u32) -> View<'_> {
        let half = match self.projection {
            Projection::Perspective { fov_y } | Projection::Cylindrical { fov_y, .. } => (fov_y * 0.5).tan(),
            Projection::Orthographic { height } => height * 0.5,
            Projection::Fisheye { .. } | Projection::Warp(_) => 0.0,
        };
        View { camera: self, width: f64::from(width.max(1)), height: f64::from(height.max(1)), half }
    }
}

/// A camera with a picture size: turns pixel coordinates into rays.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    camera: &'a Camera,
    width: f64,
    height: f64,
    /// Half of the picture's height on a plane at distance 1, where the projection has one: a tangent that need
    /// not be taken for each ray.
    half: f64,
}

/// Directions of rays that are affine in the column, in the precision of colors.
#[derive(Clone, Copy, Debug)]
pub struct RowDirections {
    /// Of the first column; not of unit length.
    pub first: Vec3,
    /// What each column adds.
    pub step: Vec3,
}

impl RowDirections {
    /// Returns the direction at a column, of unit length.
    #[must_use]
    #[inline]
    pub fn at(&self, column: u32) -> Vec3 {
        let direction = self.first + self.step * column as f32;
        direction / direction.length()
    }

    /// Fills colors with what is seen of a background in directions from a column on.
    #[inline(always)]
    pub fn fill(&self, background: &Background, column: u32, colors: &mut [Vec3]) {
        let (first, step) = (Vec3x8::splat(self.first), Vec3x8::splat(self.step));
        let background = background.gradient();
        for (chunk, colors) in colors.chunks_mut(LANES).enumerate() {
            let columns = I32x8::count_from((column as usize + chunk * LANES) as i32).to_f64().round();
            let direction = first + step.scaled(columns);
            // Taken apart in memory: the compiler would reckon each lane's color by itself.
            let seen = black_box(background.colors(direction.y / direction.length()).finite());
            for (lane, color) in colors.iter_mut().enumerate() {
                *color = seen.get(lane);
            }
        }
    }
}

impl View<'_> {
    /// Returns the ray through a place of the picture in pixels: `(0, 0)` is the top left corner, the middle of
    /// the first pixel `(0.5, 0.5)`. Nothing where the projection sees nothing.
    #[must_use]
    #[inline]
    pub fn ray(&self, x: f64, y: f64) -> Option<Ray> {
        let camera = self.camera;
        let (u, v) = (x * 2.0 / self.width - 1.0, 1.0 - y * 2.0 / self.height);
        let aspect = self.width / self.height;
        let half = self.half;
        let local = match &camera.projection {
            Projection::Perspective { .. } => DVec3::new(u * half * aspect, v * half, -1.0),
            Projection::Orthographic { .. } => {
                let shift = camera.world_from_camera * DVec3::new(u * half * aspect, v * half, 0.0);
                return Some(Ray { origin: camera.eye + shift, direction: camera.forward() });
            }
            Projection::Fisheye { fov } => {
                let scale = DVec2::new(aspect.max(1.0), (1.0 / aspect).max(1.0));
                let place = DVec2::new(u, v) * scale;
                let radius = place.length();
                if radius > 1.0 {
                    return None;
                }
                let angle = radius * fov * 0.5;
                let side = if radius > 0.0 { angle.sin() / radius } else { 0.0 };
                DVec3::new(place.x * side, place.y * side, -angle.cos())
            }
            Projection::Cylindrical { fov_x, .. } => {
                let angle = u * fov_x * 0.5;
                DVec3::new(angle.sin(), v * half, -angle.cos())
            }
            Projection::Warp(table) => table.direction(DVec2::new(x / self.width, y / self.height))?,
        };
        let direction = (camera.world_from_camera * local).try_normalize()?;
        Some(Ray { origin: camera.eye, direction })
    }

    /// Returns the rays through eight places of a row of the picture, to the same bytes as [`View::ray`], and
    /// which of them there are.
    #[must_use]
    #[inline(always)]
    pub fn rays(&self, x: F64x8, y: f64) -> (DVec3x8, DVec3x8, Mask8) {
        let (camera, half) = (self.camera, F64x8::splat(self.half));
        let aspect = F64x8::splat(self.width / self.height);
        let (one, two) = (F64x8::splat(1.0), F64x8::splat(2.0));
        let u = x * two / F64x8::splat(self.width) - one;
        let v = F64x8::splat(1.0 - y * 2.0 / self.height);
        let turn = &camera.world_from_camera;
        let eye = DVec3x8::splat(camera.eye);
        match &camera.projection {
            Projection::Perspective { .. } => {
                let local = DVec3x8 { x: u * half * aspect, y: v * half, z: -one };
                let direction = local.turned(turn);
                let share = one / direction.length();
                let there = share.above(F64x8::ZERO) & F64x8::splat(f64::INFINITY).above(share);
                (eye, direction.scaled(share), there)
            }
            Projection::Orthographic { .. } => {
                let shift = DVec3x8 { x: u * half * aspect, y: v * half, z: F64x8::ZERO };
                (eye + shift.turned(turn), DVec3x8::splat(camera.forward()), Mask8::ALL)
            }
            Projection::Fisheye { .. } | Projection::Cylindrical { .. } | Projection::Warp(_) => {
                let (mut origin, mut direction, mut there) = (eye, eye, Mask8::NONE);
                for i in 0..LANES {
                    if let Some(ray) = self.ray(x.0[i], y) {
                        origin.set(i, ray.origin);
                        direction.set(i, ray.direction);
                        there.0[i] = u32::MAX;
                    }
                }
                (origin, direction, there)
            }
        }
    }

    /// Returns the directions of the rays through the centers of a row of pixels, where the projection keeps
    /// straight lines straight.
    #[must_use]
    pub fn row(&self, y: u32) -> Option<RowDirections> {
        let (camera, half) = (self.camera, self.half);
        let v = 1.0 - (f64::from(y) + 0.5) * 2.0 / self.height;
        let (first, step) = match &camera.projection {
            Projection::Orthographic { .. } => (DVec3::NEG_Z, DVec3::ZERO),
            Projection::Perspective { .. } => {
                let wide = half * self.width / self.height;
                let step = 2.0 * wide / self.width;
                (DVec3::new(0.5 * step - wide, v * half, -1.0), DVec3::X * step)
            }
            Projection::Fisheye { .. } | Projection::Cylindrical { .. } | Projection::Warp(_) => return None,
        };
        let turned = |v: DVec3| (camera.world_from_camera * v).as_vec3();
        Some(RowDirections { first: turned(first), step: turned(step) })
    }

    /// Returns how large a pixel is at a distance from the eye, in meters, near the middle of the picture.
    #[must_use]
    pub fn pixel_size(&self, distance: f64) -> f64 {
        match &self.camera.projection {
            Projection::Perspective { .. } => distance * 2.0 * self.half / self.height,
            Projection::Orthographic { height } => height / self.height,
            Projection::Fisheye { fov } => distance * fov / self.width.min(self.height),
            Projection::Cylindrical { fov_x, .. } => distance * fov_x / self.width,
            Projection::Warp(_) => distance * PI / self.width,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(projection: Projection) -> Camera {
        Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, projection)
    }

    #[test]
    fn eight_rays_are_single_rays() {
        for projection in [
            Projection::Perspective { fov_y: 1.2 },
            Projection::Orthographic { height: 3.0 },
            Projection::Fisheye { fov: 3.0 },
            Projection::Cylindrical { fov_x: 4.0, fov_y: 1.0 },
        ] {
            let camera = Camera::look_at(DVec3::new(1.0, 2.0, 5.0), DVec3::ZERO, DVec3::Y, projection);
            let view = camera.view(37, 23);
            for y in [0.5, 7.25, 22.5] {
                let x = F64x8::new([0.5, 1.5, 7.75, 12.5, 18.5, 20.5, 35.5, 36.5]);
                let (origin, direction, there) = view.rays(x, y);
                for i in 0..LANES {
                    let ray = view.ray(x.0[i], y);
                    assert_eq!(there.has(i), ray.is_some());
                    assert!(ray.is_none_or(|r| r.origin == origin.get(i) && r.direction == direction.get(i)));
                }
            }
        }
    }

    #[test]
    fn rows_of_directions_are_those_of_single_rays() {
        for projection in [Projection::Perspective { fov_y: 1.2 }, Projection::Orthographic { height: 3.0 }] {
            let camera = Camera::look_at(DVec3::new(1.0, 2.0, 5.0), DVec3::ZERO, DVec3::Y, projection);
            let view = camera.view(37, 23);
            let background =
                Background::Gradient { below: Vec3::ZERO, horizon: Vec3::splat(0.5), above: Vec3::ONE };
            for y in [0, 11, 22] {
                let row = view.row(y).unwrap();
                let mut colors = [Vec3::ZERO; 37];
                row.fill(&background, 0, &mut colors);
                for x in 0..37 {
                    let ray = view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5).unwrap();
                    assert!((row.at(x) - ray.direction.as_vec3()).length() < 1e-6);
                    let truth = background.color(ray.direction);
                    assert!((colors[x as usize] - truth).length() < 1e-6, "{x} {y}");
                }
            }
        }
    }

    #[test]
    fn middle_of_every_projection_looks_forward() {
        let directions = vec![
            DVec3::new(-1.0, 1.0, -1.0),
            DVec3::new(1.0, 1.0, -1.0),
            DVec3::new(-1.0, -1.0, -1.0),
            DVec3::new(1.0, -1.0, -1.0),
        ];
        let table = Arc::new(WarpTable::new(2, 2, directions).unwrap());
        for projection in [
            Projection::Perspective { fov_y: 0.7 },
            Projection::Orthographic { height: 2.0 },
            Projection::Fisheye { fov: PI },
            Projection::Cylindrical { fov_x: PI, fov_y: 1.0 },
            Projection::Warp(table),
        ] {
            let camera = camera(projection);
            let ray = camera.view(64, 36).ray(32.0, 18.0).unwrap();
            assert!((ray.direction - DVec3::NEG_Z).length() < 1e-12, "{:?}", camera.projection);
            assert_eq!(ray.origin, camera.eye);
        }
    }

    #[test]
    fn fisheye_sees_sideways_at_the_edge_of_half_a_turn() {
        let camera = camera(Projection::Fisheye { fov: PI });
        let view = camera.view(100, 100);
        let ray = view.ray(100.0, 50.0).unwrap();
        assert!((ray.direction - DVec3::X).length() < 1e-12);
        assert_eq!(view.ray(99.0, 99.0), None);
    }

    #[test]
    fn framing_survives_degenerate_boxes() {
        let huge = Aabb::new(DVec3::splat(-1e30), DVec3::splat(1e30));
        for bounds in [Aabb::EMPTY, Aabb::new(DVec3::ONE, DVec3::ONE), huge] {
            let camera =
                Camera::framing(&bounds, 0.6, 0.4, 16.0 / 9.0, Projection::Perspective { fov_y: 0.7 });
            assert!(camera.eye.is_finite() && camera.world_from_camera.is_finite(), "{bounds:?}");
            assert!((camera.world_from_camera.determinant() - 1.0).abs() < 1e-9);
        }
    }
}
