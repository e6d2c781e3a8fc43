//! How do the mouse and the keys move the camera that all panes share?

use eframe::egui;
use glam::{DMat3, DQuat, DVec3};
use polyptych::camera::{Camera, Projection};
use polyptych::math::Aabb;

/// Radians of orbit for a point of mouse movement.
const ORBIT: f64 = 0.008;
/// Share of the way to the pivot for a point of scrolling.
const DOLLY: f64 = 0.002;
/// Share of the distance to the pivot that a key flies in a second.
const FLY: f64 = 0.8;
/// Nearest the eye comes to the pivot, as a share of the scene's radius.
const NEAREST: f64 = 1e-4;

/// A camera that turns around a point.
#[derive(Clone, Debug)]
pub(crate) struct Navigation {
    pub(crate) camera: Camera,
    /// What the camera turns around.
    pivot: DVec3,
    bounds: Aabb,
}

impl Navigation {
    /// Starts at a camera, turning around the middle of what is seen.
    pub(crate) fn new(camera: Camera, bounds: Aabb) -> Self {
        let center = if bounds.is_empty() { DVec3::ZERO } else { bounds.center() };
        let ahead = (center - camera.eye).dot(camera.forward());
        let pivot = if ahead > 0.0 { camera.eye + camera.forward() * ahead } else { center };
        Self { camera, pivot, bounds }
    }

    /// Returns what the camera turns around.
    pub(crate) fn pivot(&self) -> DVec3 {
        self.pivot
    }

    /// Turns the camera around the pivot, by radians: to the right, and up.
    pub(crate) fn orbit(&mut self, right: f64, up: f64) {
        let turn = DQuat::from_axis_angle(DVec3::Y, -right)
            * DQuat::from_axis_angle(self.camera.right().normalize_or(DVec3::X), -up);
        let turned = DMat3::from_quat(turn) * self.camera.world_from_camera;
        // Over the poles the world would stand on its head.
        if turned.y_axis.y <= 0.02 && turned.y_axis.y < self.camera.world_from_camera.y_axis.y {
            return;
        }
        self.camera.world_from_camera = turned;
        self.camera.eye = self.pivot + turn * (self.camera.eye - self.pivot);
    }

    /// Moves camera and pivot along the picture, by pixels of a picture of some height.
    pub(crate) fn pan(&mut self, right: f64, down: f64, height: f64) {
        let distance = self.camera.eye.distance(self.pivot);
        let pixel = self.camera.view(1, height.max(1.0) as u32).pixel_size(distance);
        self.shift((self.camera.right() * -right + self.camera.up() * down) * pixel);
    }

    /// Goes towards the pivot (or widens an orthographic picture) by points of scrolling.
    pub(crate) fn dolly(&mut self, points: f64) {
        let factor = (-points * DOLLY).exp();
        if let Projection::Orthographic { height } = &mut self.camera.projection {
            *height *= factor;
        }
        let least = self.bounds.radius().max(1e-9) * NEAREST;
        let away = self.camera.eye - self.pivot;
        if away.length() * factor > least {
            self.camera.eye = self.pivot + away * factor;
        }
    }

    /// Flies: right, up, forward, in shares of the distance to the pivot.
    pub(crate) fn fly(&mut self, direction: DVec3) {
        let distance = self.camera.eye.distance(self.pivot).max(self.bounds.radius() * 0.05);
        let c = &self.camera;
        self.shift((c.right() * direction.x + c.up() * direction.y + c.forward() * direction.z) * distance);
    }

    /// Shows the whole scene from where the camera looks.
    pub(crate) fn frame(&mut self, aspect: f64) {
        if self.bounds.is_empty() {
            return;
        }
        let back = -self.camera.forward();
        let (azimuth, elevation) = (back.x.atan2(back.z), back.y.clamp(-1.0, 1.0).asin());
        let projection = self.camera.projection.clone();
        let camera = Camera::framing(&self.bounds, azimuth, elevation, aspect, projection);
        *self = Self::new(camera, self.bounds);
    }

    fn shift(&mut self, by: DVec3) {
        if by.is_finite() {
            self.camera.eye += by;
            self.pivot += by;
        }
    }

    /// Follows what the mouse does over a picture. Tells whether the camera moved.
    pub(crate) fn follow(&mut self, ui: &egui::Ui, picture: &egui::Response) -> bool {
        let before = (self.camera.eye, self.camera.world_from_camera);
        let moved = picture.drag_delta();
        let (x, y) = (f64::from(moved.x), f64::from(moved.y));
        let shift = ui.input(|i| i.modifiers.shift);
        if picture.dragged_by(egui::PointerButton::Primary) && !shift {
            self.orbit(x * ORBIT, y * ORBIT);
        } else if picture.dragged() {
            self.pan(x, y, f64::from(picture.rect.height()));
        }
        if picture.hovered() {
            let (scroll, zoom) =
                ui.input(|i| (f64::from(i.smooth_scroll_delta.y), f64::from(i.zoom_delta())));
            if scroll != 0.0 || zoom != 1.0 {
                self.dolly(scroll + zoom.ln() / DOLLY);
            }
        }
        before != (self.camera.eye, self.camera.world_from_camera)
    }

    /// Follows the keys that fly. Tells whether the camera moved.
    pub(crate) fn follow_keys(&mut self, input: &egui::InputState) -> bool {
        use egui::Key;
        let axis = |plus: Key, minus: Key| {
            f64::from(i8::from(input.key_down(plus)) - i8::from(input.key_down(minus)))
        };
        let direction = DVec3::new(axis(Key::D, Key::A), axis(Key::E, Key::Q), axis(Key::W, Key::S));
        if direction == DVec3::ZERO || input.modifiers.any() {
            return false;
        }
        self.fly(direction * FLY * f64::from(input.stable_dt.min(0.1)));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn navigation() -> Navigation {
        let camera = Camera::look_at(
            DVec3::new(0.0, 1.0, 5.0),
            DVec3::ZERO,
            DVec3::Y,
            Projection::Perspective { fov_y: 0.8 },
        );
        Navigation::new(camera, Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0)))
    }

    #[test]
    fn orbits_keep_distance_and_horizon() {
        let mut navigation = navigation();
        let distance = navigation.camera.eye.distance(navigation.pivot);
        for _ in 0..200 {
            navigation.orbit(0.1, 0.05);
            assert!((navigation.camera.eye.distance(navigation.pivot) - distance).abs() < 1e-9);
            assert!(navigation.camera.right().y.abs() < 1e-9, "the horizon is level");
            assert!(navigation.camera.up().y > 0.0, "the world is not on its head");
            let to_pivot = (navigation.pivot - navigation.camera.eye).normalize_or_zero();
            assert!(to_pivot.dot(navigation.camera.forward()) > 1.0 - 1e-9);
        }
    }

    #[test]
    fn dollies_never_pass_the_pivot() {
        let mut navigation = navigation();
        (0..1000).for_each(|_| navigation.dolly(100.0));
        assert!(navigation.camera.eye.distance(navigation.pivot) > 0.0);
        let to_pivot = navigation.pivot - navigation.camera.eye;
        assert!(to_pivot.dot(navigation.camera.forward()) > 0.0);
        (0..10_000).for_each(|_| navigation.dolly(-100.0));
        navigation.pan(f64::NAN, 0.0, 0.0);
        assert!(navigation.camera.up().is_finite());
    }

    #[test]
    fn framing_looks_along_the_same_direction() {
        let mut navigation = navigation();
        navigation.orbit(0.7, 0.2);
        let forward = navigation.camera.forward();
        navigation.dolly(-5000.0);
        navigation.frame(1.5);
        assert!(navigation.camera.forward().dot(forward) > 1.0 - 1e-9);
        assert!(navigation.camera.eye.length() < 10.0, "the scene fills the picture again");
    }
}
