//! From where is each frame of an animation seen, and how do frames become one file?

use crate::camera::{Camera, Projection};
use crate::scene::Scene;
use glam::{DMat3, DQuat, DVec3};
use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame, RgbImage};
use std::f64::consts::TAU;

/// How the camera moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Once around the middle of the scene.
    Turntable,
    /// From one camera of the scene to the next, slow at each of them.
    Flight,
}

impl Motion {
    /// Returns the camera at a share of the whole way.
    ///
    /// ```
    /// use polyptych::animate::Motion;
    /// let scene = polyptych::builtin::scene("polyhedra").unwrap();
    /// let start = &scene.cameras[0].1;
    /// let half = Motion::Turntable.camera(&scene, start, 0.5);
    /// let center = scene.bounds().center();
    /// assert!((half.eye.distance(center) - start.eye.distance(center)).abs() < 1e-9);
    /// assert!(half.eye.distance(start.eye) > start.eye.distance(center));
    /// ```
    #[must_use]
    pub fn camera(self, scene: &Scene, start: &Camera, share: f64) -> Camera {
        match self {
            Self::Turntable => turned(start, scene.bounds().center(), share * TAU),
            Self::Flight => between(&scene.cameras, share).unwrap_or_else(|| start.clone()),
        }
    }

    /// Returns the share of the way at a frame. A turn ends where it began, so its last frame is the one before.
    #[must_use]
    pub fn share(self, frame: u32, count: u32) -> f64 {
        let steps = match self {
            Self::Turntable => count,
            Self::Flight => count.saturating_sub(1),
        };
        f64::from(frame) / f64::from(steps.max(1))
    }
}

/// Turns a camera around the vertical axis through a point.
#[must_use]
pub fn turned(camera: &Camera, center: DVec3, angle: f64) -> Camera {
    let turn = DMat3::from_rotation_y(angle);
    Camera {
        eye: center + turn * (camera.eye - center),
        world_from_camera: turn * camera.world_from_camera,
        projection: camera.projection.clone(),
    }
}

/// Returns the camera at a share of the way through some cameras.
fn between(cameras: &[(String, Camera)], share: f64) -> Option<Camera> {
    let place = share.clamp(0.0, 1.0) * cameras.len().saturating_sub(1) as f64;
    let (_, a) = cameras.get(place as usize)?;
    let Some((_, b)) = cameras.get(place as usize + 1) else { return Some(a.clone()) };
    let t = place.fract();
    let t = t * t * (3.0 - 2.0 * t);
    let turn = DQuat::from_mat3(&a.world_from_camera).slerp(DQuat::from_mat3(&b.world_from_camera), t);
    let mix = |a: f64, b: f64| a + (b - a) * t;
    let projection = match (&a.projection, &b.projection) {
        (&Projection::Perspective { fov_y: a }, &Projection::Perspective { fov_y: b }) => {
            Projection::Perspective { fov_y: mix(a, b) }
        }
        (&Projection::Orthographic { height: a }, &Projection::Orthographic { height: b }) => {
            Projection::Orthographic { height: mix(a, b) }
        }
        (a, b) => if t < 0.5 { a } else { b }.clone(),
    };
    Some(Camera { eye: a.eye.lerp(b.eye, t), world_from_camera: DMat3::from_quat(turn), projection })
}

/// Encodes frames as an endless GIF. Its times are hundredths of a second.
///
/// # Errors
/// Those of the encoder or of a frame that cannot be had.
pub fn gif(frames: impl Iterator<Item = Result<RgbImage, String>>, fps: u16) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    {
        let mut encoder = GifEncoder::new_with_speed(&mut bytes, 10);
        encoder.set_repeat(Repeat::Infinite).map_err(|e| e.to_string())?;
        for frame in frames {
            let picture = image::DynamicImage::ImageRgb8(frame?).into_rgba8();
            let delay = Delay::from_numer_denom_ms(1000, u32::from(fps.max(1)));
            encoder.encode_frame(Frame::from_parts(picture, 0, 0, delay)).map_err(|e| e.to_string())?;
        }
    }
    Ok(bytes)
}

/// Encodes frames of one size as an endless animated PNG.
///
/// # Errors
/// Those of the encoder or of a frame that cannot be had.
pub fn apng(
    frames: impl Iterator<Item = Result<RgbImage, String>>,
    count: u32,
    [width, height]: [u32; 2],
    fps: u16,
) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_animated(count, 0).map_err(|e| e.to_string())?;
    encoder.set_frame_delay(1, fps.max(1)).map_err(|e| e.to_string())?;
    let mut writer = encoder.write_header().map_err(|e| e.to_string())?;
    for frame in frames {
        writer.write_image_data(&frame?).map_err(|e| e.to_string())?;
    }
    writer.finish().map_err(|e| e.to_string())?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_begins_and_ends_at_cameras() {
        let mut scene = crate::builtin::scene("polyhedra").unwrap();
        let first = scene.cameras[0].1.clone();
        let second = turned(&first, scene.bounds().center(), 1.0);
        scene.cameras = vec![("a".into(), first.clone()), ("b".into(), second.clone())];
        let at = |share| Motion::Flight.camera(&scene, &first, share);
        assert!(at(0.0).eye.distance(first.eye) < 1e-9 && at(1.0).eye.distance(second.eye) < 1e-9);
        assert!((at(0.5).eye - first.eye.lerp(second.eye, 0.5)).length() < 1e-9);
        assert!((at(0.25).world_from_camera.determinant() - 1.0).abs() < 1e-9);
        assert_eq!([Motion::Flight.share(4, 5), Motion::Turntable.share(4, 5)], [1.0, 0.8]);
    }
}
