//! On which pixel does a point fall, and which ray goes through a place of the picture?

use crate::affine::{Linear, OnRays, Row};
use glam::{DAffine3, DMat3, DVec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::lanes::{DVec3x8, F64x8};
use polyptych_core::math::Aabb;

/// Pixels around the picture up to which triangles are drawn unclipped. Coordinates there fit 24.8 bits for
/// pictures of any sensible size.
pub(crate) const GUARD: f64 = 8192.0;

/// A straight-line view: a picture plane with square or oblong pixels, seen from an eye or along parallel rays.
///
/// Points and rays are given relative to [`Lens::origin`], so that large world coordinates cost no digits.
#[derive(Clone, Debug)]
pub(crate) struct Lens {
    /// The eye; for parallel rays the middle of the picture plane.
    pub(crate) origin: DVec3,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// What is less far ahead is not drawn.
    pub(crate) near: f64,
    pub(crate) rays: Rays,
    /// What is taken off depths: that of the farthest place that is drawn.
    farthest: f64,
    column: Row,
    row: Row,
    ahead: Row,
    start: Linear,
    pub(crate) direction: Linear,
}

/// How the rays of a view run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rays {
    /// From the eye: the picture is divided by the distance ahead.
    Central,
    /// Along the view.
    Parallel,
}

/// A point before division: column and row times `w`, and the distance ahead. `w` is the distance ahead for
/// central rays and 1 for parallel ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Homogeneous {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) ahead: f64,
}

/// A lens applied to points of an object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenFromObject {
    column: Row,
    row: Row,
    ahead: Row,
}

impl Lens {
    /// Builds a view from an eye. `axes` are right, up and backward; `scale` is in pixels for a slope of 1.
    pub(crate) fn central(origin: DVec3, axes: DMat3, scale: f64, size: [u32; 2], near: f64) -> Self {
        let (inverse, half) = (axes.inverse().transpose(), size.map(|s| f64::from(s) * 0.5));
        let forward = -inverse.z_axis;
        let (by_column, by_row) = (axes.x_axis / scale, -axes.y_axis / scale);
        Self {
            origin,
            width: size[0],
            height: size[1],
            near,
            rays: Rays::Central,
            farthest: 0.0,
            column: Row { slope: inverse.x_axis * scale + forward * half[0], offset: 0.0 },
            row: Row { slope: forward * half[1] - inverse.y_axis * scale, offset: 0.0 },
            ahead: Row { slope: forward, offset: 0.0 },
            start: Linear { base: DVec3::ZERO, by_column: DVec3::ZERO, by_row: DVec3::ZERO },
            direction: Linear {
                base: -axes.z_axis - by_column * half[0] - by_row * half[1],
                by_column,
                by_row,
            },
        }
    }

    /// Builds a view along parallel rays; `scale` is in pixels a meter along both axes of the picture.
    pub(crate) fn parallel(origin: DVec3, axes: DMat3, scale: [f64; 2], size: [u32; 2]) -> Self {
        let (inverse, half) = (axes.inverse().transpose(), size.map(|s| f64::from(s) * 0.5));
        let (by_column, by_row) = (axes.x_axis / scale[0], -axes.y_axis / scale[1]);
        Self {
            origin,
            width: size[0],
            height: size[1],
            near: 0.0,
            rays: Rays::Parallel,
            farthest: 0.0,
            column: Row { slope: inverse.x_axis * scale[0], offset: half[0] },
            row: Row { slope: inverse.y_axis * -scale[1], offset: half[1] },
            ahead: Row { slope: -inverse.z_axis, offset: 0.0 },
            start: Linear { base: -by_column * half[0] - by_row * half[1], by_column, by_row },
            direction: Linear { base: -axes.z_axis, by_column: DVec3::ZERO, by_row: DVec3::ZERO },
        }
    }

    /// Builds the view of a camera; nothing for cameras that bend straight lines.
    pub(crate) fn of_camera(camera: &Camera, width: u32, height: u32, near: f64) -> Option<Self> {
        let tall = f64::from(height.max(1));
        match camera.projection {
            Projection::Perspective { fov_y } => {
                let scale = tall / (2.0 * (fov_y * 0.5).tan());
                Some(Self::central(camera.eye, camera.world_from_camera, scale, [width, height], near))
            }
            Projection::Orthographic { height: meters } => {
                let scale = [tall / meters; 2];
                Some(Self::parallel(camera.eye, camera.world_from_camera, scale, [width, height]))
            }
            Projection::Fisheye { .. } | Projection::Cylindrical { .. } | Projection::Warp(_) => None,
        }
    }

    /// Counts depths from the farthest corner of a box on: what is small in front of how far away it is has all
    /// digits of a depth for itself.
    pub(crate) fn with_depths_of(mut self, bounds: &Aabb) -> Self {
        let ahead = bounds.corners().map(|c| self.ahead.at(c - self.origin));
        let farthest = self.depth(ahead.into_iter().fold(self.near, f64::max));
        if !bounds.is_empty() && farthest.is_finite() && ahead.iter().all(|a| a.is_finite()) {
            self.farthest = farthest;
        }
        self
    }

    /// Returns the lens for points of an object.
    pub(crate) fn for_object(&self, world_from_object: &DAffine3) -> ScreenFromObject {
        let of = |row: &Row| row.after(world_from_object, self.origin);
        ScreenFromObject { column: of(&self.column), row: of(&self.row), ahead: of(&self.ahead) }
    }

    /// Returns column, row and distance ahead of a point relative to the origin.
    #[inline(always)]
    pub(crate) fn place(&self, p: DVec3) -> (f64, f64, f64) {
        let ahead = self.ahead.at(p);
        let share = match self.rays {
            Rays::Central => 1.0 / ahead,
            Rays::Parallel => 1.0,
        };
        (self.column.at(p) * share, self.row.at(p) * share, ahead)
    }

    /// Returns starts and directions of eight rays.
    #[inline(always)]
    pub(crate) fn lines(&self, x: F64x8, y: F64x8) -> (DVec3x8, DVec3x8) {
        match self.rays {
            Rays::Central => (DVec3x8::splat(DVec3::ZERO), self.direction.at_all(x, y)),
            Rays::Parallel => (self.start.at_all(x, y), DVec3x8::splat(self.direction.base)),
        }
    }

    /// Returns columns, rows and distances ahead of eight points relative to the origin.
    #[inline(always)]
    pub(crate) fn places(&self, p: DVec3x8) -> [F64x8; 3] {
        let (column, row, ahead) = (self.column.at_all(p), self.row.at_all(p), self.ahead.at_all(p));
        match self.rays {
            Rays::Central => [column / ahead, row / ahead, ahead],
            Rays::Parallel => [column, row, ahead],
        }
    }

    /// Returns the function `slope . p` along the rays.
    pub(crate) fn on_rays(&self, slope: DVec3) -> OnRays {
        let (differs, shared) = match self.rays {
            Rays::Central => (&self.direction, 0.0),
            Rays::Parallel => (&self.start, self.direction.base.dot(slope)),
        };
        OnRays {
            base: differs.base.dot(slope),
            by_column: differs.by_column.dot(slope),
            by_row: differs.by_row.dot(slope),
            shared,
        }
    }

    /// Returns start and direction (not of unit length) of the ray through a place of the picture.
    #[inline(always)]
    pub(crate) fn line(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        match self.rays {
            Rays::Central => (DVec3::ZERO, self.direction.at(x, y)),
            Rays::Parallel => (self.start.at(x, y), self.direction.base),
        }
    }

    /// Returns how far ahead a point relative to the origin is.
    pub(crate) fn ahead_of(&self, p: DVec3) -> f64 {
        self.ahead.at(p)
    }

    /// Returns how wide a pixel is at a point relative to the origin.
    pub(crate) fn meters_of_pixel(&self, p: DVec3) -> f64 {
        let [right, down] = self.steps().map(DVec3::length);
        let wide = right.max(down);
        match self.rays {
            Rays::Central => wide * self.ahead.at(p),
            Rays::Parallel => wide,
        }
    }

    /// Returns by what rays differ over one pixel to the right and one down: central ones by their direction,
    /// parallel ones by their start.
    pub(crate) fn steps(&self) -> [DVec3; 2] {
        let differs = match self.rays {
            Rays::Central => &self.direction,
            Rays::Parallel => &self.start,
        };
        [differs.by_column, differs.by_row]
    }

    /// Returns the divisor of a point's column and row.
    pub(crate) fn divisor(&self, ahead: f64) -> f64 {
        match self.rays {
            Rays::Central => ahead,
            Rays::Parallel => 1.0,
        }
    }

    /// Returns divisors and depths of eight distances ahead.
    #[inline(always)]
    pub(crate) fn divisors_and_depths(&self, ahead: F64x8) -> (F64x8, F64x8) {
        let (one, farthest) = (F64x8::splat(1.0), F64x8::splat(self.farthest));
        match self.rays {
            Rays::Central => (ahead, one / ahead - farthest),
            Rays::Parallel => (one, -ahead - farthest),
        }
    }

    /// Returns the depth that is compared: larger is nearer, and it is linear over the picture. `1/w` keeps the
    /// same number of digits at every distance, so there is no far plane; less that of the farthest place it has
    /// as many for the differences within a scene that is far away.
    pub(crate) fn depth(&self, ahead: f64) -> f64 {
        match self.rays {
            Rays::Central => 1.0 / ahead - self.farthest,
            Rays::Parallel => -ahead - self.farthest,
        }
    }
}

impl Lens {
    /// Returns the distance ahead of a depth.
    pub(crate) fn ahead(&self, depth: f64) -> f64 {
        match self.rays {
            Rays::Central => 1.0 / (depth + self.farthest),
            Rays::Parallel => -(depth + self.farthest),
        }
    }

    /// Returns the unit vector from a point to the eye.
    pub(crate) fn to_eye(&self, point: DVec3) -> DVec3 {
        match self.rays {
            Rays::Central => -point.normalize_or_zero(),
            Rays::Parallel => -self.direction.base.normalize_or_zero(),
        }
    }

    /// Tells whether a plane turns its front to the eye; the point is one of its points.
    pub(crate) fn sees_front(&self, normal: DVec3, point: DVec3) -> bool {
        match self.rays {
            Rays::Central => normal.dot(point) < 0.0,
            Rays::Parallel => normal.dot(self.direction.base) < 0.0,
        }
    }
}

impl ScreenFromObject {
    pub(crate) fn apply(&self, p: DVec3) -> Homogeneous {
        Homogeneous { x: self.column.at(p), y: self.row.at(p), ahead: self.ahead.at(p) }
    }

    /// Returns columns, rows and distances ahead of eight points, before division.
    #[inline(always)]
    pub(crate) fn apply_all(&self, p: DVec3x8) -> [F64x8; 3] {
        [self.column.at_all(p), self.row.at_all(p), self.ahead.at_all(p)]
    }
}

/// Returns right, up and backward of the faces of a cube: +x -x +y -y +z -z.
pub(crate) fn cube_axes(face: usize) -> DMat3 {
    let forward = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z][face];
    let up = if forward.y == 0.0 { DVec3::Y } else { DVec3::Z };
    DMat3::from_cols(up.cross(-forward), up, -forward)
}

/// Returns the face of [`cube_axes`] that a direction goes through.
pub(crate) fn cube_face(d: DVec3) -> usize {
    let a = d.abs();
    let (axis, negative) = if a.x >= a.y && a.x >= a.z {
        (0, d.x < 0.0)
    } else if a.y >= a.z {
        (1, d.y < 0.0)
    } else {
        (2, d.z < 0.0)
    };
    axis * 2 + usize::from(negative)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_go_through_the_pixels_where_their_points_fall() {
        let camera = |projection: Projection| {
            Camera::look_at(DVec3::new(3.0, 2.0, 5.0), DVec3::new(0.0, 0.5, 0.0), DVec3::Y, projection)
        };
        for projection in [Projection::Perspective { fov_y: 0.8 }, Projection::Orthographic { height: 4.0 }] {
            let camera = camera(projection);
            let lens = Lens::of_camera(&camera, 64, 36, 1e-6).unwrap();
            for (x, y) in [(0.5, 0.5), (32.0, 18.0), (63.5, 7.25)] {
                let ((start, direction), truth) = (lens.line(x, y), camera.view(64, 36).ray(x, y).unwrap());
                assert!((direction.normalize_or_zero() - truth.direction).length() < 1e-14);
                assert!((start + lens.origin - truth.origin).length() < 1e-14);
                let slope = DVec3::new(0.3, -0.7, 1.1);
                let (at_start, change) = lens.on_rays(slope).at(lens.rays, x, y);
                assert!((at_start - slope.dot(start)).abs() < 1e-14);
                assert!((change - slope.dot(direction)).abs() < 1e-14);
                let (column, row, ahead) = lens.place(start + direction * 2.5);
                assert!((column - x).abs() < 1e-12 && (row - y).abs() < 1e-12 && ahead > 0.0);
            }
        }
    }

    #[test]
    fn depths_tell_a_ten_thousandth_of_a_scene_apart_however_far_away_it_is() {
        let bounds = Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0));
        let axes = DMat3::IDENTITY;
        for power in 0..9 {
            let far = DVec3::Z * (4.0 * 10f64.powi(power));
            for lens in [
                Lens::central(far, axes, 50.0, [100, 100], 1e-3),
                Lens::parallel(far, axes, [50.0; 2], [100, 100]),
            ] {
                let lens = lens.with_depths_of(&bounds);
                let depth = |z: f64| lens.depth(far.z - z) as f32;
                for step in -9..9 {
                    let z = f64::from(step) * 0.1;
                    assert!(depth(z + 1e-4) > depth(z), "10^{power}: {z}");
                }
                assert!(depth(-1.0) == 0.0 && depth(1.0).is_finite());
                let ahead = lens.ahead(lens.depth(far.z - 0.5));
                assert!(
                    (ahead - (far.z - 0.5)).abs() < 1e-4 * (far.z / 4e8).max(1e-4),
                    "10^{power}: {ahead}"
                );
            }
        }
        let empty = Lens::central(DVec3::ZERO, axes, 50.0, [100, 100], 1e-3).with_depths_of(&Aabb::EMPTY);
        assert_eq!(empty.depth(2.0), 0.5);
    }

    #[test]
    fn faces_of_the_cube_look_where_they_are_chosen() {
        for face in 0..6 {
            let axes = cube_axes(face);
            assert_eq!(cube_face(-axes.z_axis), face);
            assert!((axes.determinant() - 1.0).abs() < 1e-15);
        }
    }
}
