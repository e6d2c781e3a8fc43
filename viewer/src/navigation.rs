//! How do the mouse and the keys move the camera that all panes share?

use eframe::egui;
use glam::{DMat3, DQuat, DVec3};
use polyptych::camera::{Camera, Projection};
use polyptych::math::Aabb;
use std::f64::consts::{PI, TAU};

/// Field of view of perspectives that begin, radians.
const FOV: f64 = 0.7;
/// Radians of orbit for a point of mouse movement.
const ORBIT: f64 = 0.008;
/// Share of the way to the pivot for a point of scrolling.
const DOLLY: f64 = 0.002;
/// Share of the distance to the pivot that a key flies in a second.
const FLY: f64 = 0.8;
/// Radians that the camera rolls in a second.
const ROLL: f64 = 0.9;
/// Steepest view that an orbit reaches, radians: over the poles the world would stand on its head.
const STEEPEST: f64 = 1.55;
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
        let level = self.camera.forward().cross(DVec3::Y).normalize_or(self.camera.right());
        let pitch = self.camera.world_from_camera.z_axis.y.clamp(-1.0, 1.0).asin();
        let up = (pitch + up).clamp(-STEEPEST.max(-pitch), STEEPEST.max(pitch)) - pitch;
        let turn = DQuat::from_axis_angle(DVec3::Y, -right) * DQuat::from_axis_angle(level, -up);
        if turn.is_finite() {
            self.camera.world_from_camera = DMat3::from_quat(turn) * self.camera.world_from_camera;
            self.camera.eye = self.pivot + turn * (self.camera.eye - self.pivot);
        }
    }

    /// Turns the camera around its own axis, by radians, the world turning to the right.
    pub(crate) fn roll(&mut self, angle: f64) {
        self.camera.world_from_camera *= DMat3::from_rotation_z(angle);
    }

    /// Takes the roll out of the view.
    pub(crate) fn level(&mut self) {
        let (eye, ahead) = (self.camera.eye, self.camera.eye + self.camera.forward());
        self.camera = Camera::look_at(eye, ahead, DVec3::Y, self.camera.projection.clone());
    }

    /// Looks at the pivot along a direction, from as far as before.
    pub(crate) fn look_along(&mut self, direction: DVec3, aspect: f64) {
        let distance = self.camera.eye.distance(self.pivot);
        let up = if direction.y.abs() > 0.5 { DVec3::Z * direction.y } else { DVec3::Y };
        let eye = self.pivot - direction * distance;
        self.camera = Camera::look_at(eye, self.pivot, up, self.camera.projection.clone());
        if distance <= self.bounds.radius() * NEAREST {
            self.frame(self.bounds, aspect);
        }
    }

    /// Tells whether rays are parallel.
    pub(crate) fn is_parallel(&self) -> bool {
        matches!(self.camera.projection, Projection::Orthographic { .. })
    }

    /// Changes between perspective and parallel rays; what is around the pivot keeps its size.
    pub(crate) fn change_projection(&mut self) {
        let distance = self.camera.eye.distance(self.pivot).max(1e-9);
        self.camera.projection = match self.camera.projection {
            Projection::Perspective { fov_y } => {
                Projection::Orthographic { height: 2.0 * distance * (fov_y * 0.5).tan() }
            }
            Projection::Orthographic { height } => {
                let distance = height / (2.0 * (FOV * 0.5).tan());
                self.camera.eye = self.pivot - self.camera.forward() * distance;
                Projection::Perspective { fov_y: FOV }
            }
            _ => Projection::Perspective { fov_y: FOV },
        };
    }

    /// Sees more or less at once, by a factor.
    pub(crate) fn widen(&mut self, factor: f64) {
        match &mut self.camera.projection {
            Projection::Perspective { fov_y } => *fov_y = (*fov_y * factor).clamp(0.01, 2.9),
            Projection::Orthographic { height } => *height = (*height * factor).clamp(1e-9, 1e12),
            Projection::Fisheye { fov } => *fov = (*fov * factor).clamp(0.01, TAU),
            Projection::Cylindrical { fov_x, fov_y } => {
                *fov_x = (*fov_x * factor).clamp(0.01, TAU);
                *fov_y = (*fov_y * factor).clamp(0.01, 2.9);
            }
            Projection::Warp(_) => {}
        }
    }

    /// Shows how directions become pixels, to be changed.
    pub(crate) fn show_lens(&mut self, ui: &mut egui::Ui) {
        let distance = self.camera.eye.distance(self.pivot).max(1e-9);
        for (name, projection) in [
            ("perspective", Projection::Perspective { fov_y: FOV }),
            ("parallel", Projection::Orthographic { height: 2.0 * distance * (FOV * 0.5).tan() }),
            ("fisheye", Projection::Fisheye { fov: PI }),
            ("cylindrical", Projection::Cylindrical { fov_x: PI, fov_y: 1.0 }),
        ] {
            let same = std::mem::discriminant(&projection) == std::mem::discriminant(&self.camera.projection);
            if ui.radio(same, name).clicked() && !same {
                self.camera.projection = projection;
            }
        }
        let (name, unit, value, most) = match &mut self.camera.projection {
            Projection::Perspective { fov_y } => ("field of view", true, fov_y, 2.9),
            Projection::Orthographic { height } => ("height of the picture", false, height, 1e12),
            Projection::Fisheye { fov } => ("field of view", true, fov, TAU),
            Projection::Cylindrical { fov_x, .. } => ("field of view", true, fov_x, TAU),
            Projection::Warp(_) => return,
        };
        let scale = if unit { 1f64.to_degrees() } else { 1.0 };
        let mut shown = *value * scale;
        let label = ui.label(name).id;
        let speed = (shown * 0.01).max(1e-6);
        let field = egui::DragValue::new(&mut shown).range(1e-6..=most * scale).speed(speed);
        if ui.add(field.suffix(if unit { "°" } else { " m" })).labelled_by(label).changed() {
            *value = shown / scale;
        }
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

    /// Shows the whole of a box from where the camera looks, and turns around its middle from now on.
    pub(crate) fn frame(&mut self, bounds: Aabb, aspect: f64) {
        if bounds.is_empty() {
            return;
        }
        let back = -self.camera.forward();
        let (azimuth, elevation) = (back.x.atan2(back.z), back.y.clamp(-1.0, 1.0).asin());
        let projection = self.camera.projection.clone();
        self.camera = Camera::framing(&bounds, azimuth, elevation, aspect, projection);
        self.pivot = bounds.center();
    }

    fn shift(&mut self, by: DVec3) {
        if by.is_finite() {
            self.camera.eye += by;
            self.pivot += by;
        }
    }

    /// Follows what the mouse, or fingers, do over a picture.
    pub(crate) fn follow(&mut self, ui: &egui::Ui, picture: &egui::Response) {
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
            // Two fingers turn and shift, too.
            if let Some(touch) = ui.input(egui::InputState::multi_touch) {
                self.roll(f64::from(touch.rotation_delta));
                let [x, y] = [touch.translation_delta.x, touch.translation_delta.y].map(f64::from);
                self.pan(x, y, f64::from(picture.rect.height()));
            }
        }
    }

    /// Follows the keys that fly. Tells whether the camera moved.
    pub(crate) fn follow_keys(&mut self, input: &egui::InputState) -> bool {
        use egui::Key;
        let axis = |plus: Key, minus: Key| {
            f64::from(i8::from(input.key_down(plus)) - i8::from(input.key_down(minus)))
        };
        let direction = DVec3::new(axis(Key::D, Key::A), axis(Key::E, Key::Q), axis(Key::W, Key::S));
        let roll = axis(Key::Period, Key::Comma);
        if (direction == DVec3::ZERO && roll == 0.0) || input.modifiers.any() {
            return false;
        }
        let time = f64::from(input.stable_dt.min(0.1));
        self.fly(direction * FLY * time);
        self.roll(roll * ROLL * time);
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
        navigation.frame(navigation.bounds, 1.5);
        assert!(navigation.camera.forward().dot(forward) > 1.0 - 1e-9);
        assert!(navigation.camera.eye.length() < 10.0, "the scene fills the picture again");
    }

    #[test]
    fn a_rolled_camera_orbits_and_is_leveled() {
        let mut navigation = navigation();
        navigation.roll(2.5);
        let forward = navigation.camera.forward();
        navigation.orbit(0.3, 0.1);
        assert!(navigation.camera.forward().dot(forward) < 0.99, "it turns upside down, too");
        assert!(navigation.camera.right().y.abs() > 0.1);
        navigation.level();
        assert!(navigation.camera.right().y.abs() < 1e-9 && navigation.camera.up().y > 0.0);
    }

    #[test]
    fn parallel_and_perspective_show_the_same_size() {
        let mut navigation = navigation();
        let size = |n: &Navigation| n.camera.view(100, 100).pixel_size(n.camera.eye.distance(n.pivot));
        let before = size(&navigation);
        navigation.change_projection();
        assert!(navigation.is_parallel() && (size(&navigation) - before).abs() < 1e-12);
        navigation.change_projection();
        assert!(!navigation.is_parallel() && (size(&navigation) - before).abs() < 1e-12);
        for direction in [DVec3::NEG_Y, DVec3::X, DVec3::Z, DVec3::Y] {
            navigation.look_along(direction, 1.0);
            assert!(navigation.camera.forward().dot(direction) > 1.0 - 1e-9);
        }
    }
}
