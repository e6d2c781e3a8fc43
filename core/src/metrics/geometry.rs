//! Differences of distance, normal, id and shadow.

use super::percentile_99;
use crate::framebuffer::Framebuffer;
use serde::Serialize;

/// Differences of distance in meters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DistanceErrors {
    /// Mean difference.
    pub mean: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest difference.
    pub max: f64,
    /// Mean of the difference over the reference's distance.
    pub relative: f64,
}

/// Angles between normals in degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct NormalErrors {
    /// Mean angle.
    pub mean: f64,
    /// 99th percentile.
    pub p99: f64,
}

/// Marks pixels whose 3x3 neighborhood in the reference shows more than one object.
pub(super) fn edge_band(reference: &Framebuffer) -> Vec<bool> {
    let (width, height) = (reference.width() as usize, reference.height() as usize);
    let id = reference.id();
    let mut edges = vec![false; id.len()];
    for y in 0..height {
        for x in 0..width {
            let own = id[y * width + x];
            edges[y * width + x] = (y.saturating_sub(1)..(y + 2).min(height))
                .any(|v| (x.saturating_sub(1)..(x + 2).min(width)).any(|u| id[v * width + u] != own));
        }
    }
    edges
}

/// Marks pixels off edges where both pictures see the same object.
pub(super) fn same_object(picture: &Framebuffer, reference: &Framebuffer, edges: &[bool]) -> Vec<bool> {
    let pairs = picture.id().iter().zip(reference.id());
    pairs.zip(edges).map(|((a, b), &edge)| !edge && a == b && *b != 0).collect()
}

pub(super) fn id_agreement(picture: &Framebuffer, reference: &Framebuffer, edges: &[bool]) -> f64 {
    let pairs = picture.id().iter().zip(reference.id()).zip(edges);
    let (mut same, mut all) = (0u64, 0u64);
    for ((a, b), _) in pairs.filter(|(_, edge)| !**edge) {
        same += u64::from(a == b);
        all += 1;
    }
    share(same, all)
}

pub(super) fn silhouette_iou(picture: &Framebuffer, reference: &Framebuffer) -> f64 {
    let (mut both, mut either) = (0u64, 0u64);
    for (a, b) in picture.id().iter().zip(reference.id()) {
        both += u64::from(*a != 0 && *b != 0);
        either += u64::from(*a != 0 || *b != 0);
    }
    share(both, either)
}

pub(super) fn shadow_agreement(picture: &Framebuffer, reference: &Framebuffer, same: &[bool]) -> f64 {
    let (mut agree, mut all) = (0u64, 0u64);
    for ((a, b), _) in picture.shadow().iter().zip(reference.shadow()).zip(same).filter(|(_, same)| **same) {
        agree += u64::from((a - b).abs() < 0.5);
        all += 1;
    }
    share(agree, all)
}

/// Returns a share; nothing out of nothing agrees fully.
fn share(part: u64, all: u64) -> f64 {
    if all == 0 { 1.0 } else { part as f64 / all as f64 }
}

impl DistanceErrors {
    pub(super) fn between(picture: &Framebuffer, reference: &Framebuffer, same: &[bool]) -> Self {
        let mut errors = Vec::new();
        let mut relative = 0.0;
        let pairs = picture.distance().iter().zip(reference.distance()).zip(same);
        for ((&a, &b), _) in pairs.filter(|((a, b), same)| **same && a.is_finite() && b.is_finite()) {
            let error = (f64::from(a) - f64::from(b)).abs();
            relative += error / f64::from(b).max(f64::MIN_POSITIVE);
            errors.push(error);
        }
        let count = errors.len().max(1) as f64;
        Self {
            mean: errors.iter().sum::<f64>() / count,
            max: errors.iter().copied().fold(0.0, f64::max),
            p99: percentile_99(&mut errors),
            relative: relative / count,
        }
    }
}

impl NormalErrors {
    pub(super) fn between(picture: &Framebuffer, reference: &Framebuffer, same: &[bool]) -> Self {
        let pairs = picture.normal().iter().zip(reference.normal()).zip(same).filter(|(_, same)| **same);
        let mut angles: Vec<f64> = pairs
            .map(|((a, b), _)| {
                // The chord is exact for small angles, where the cosine is not.
                let chord = (a.as_dvec3() - b.as_dvec3()).length();
                (chord * 0.5).clamp(0.0, 1.0).asin().to_degrees() * 2.0
            })
            .collect();
        Self {
            mean: angles.iter().sum::<f64>() / angles.len().max(1) as f64,
            p99: percentile_99(&mut angles),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Errors;
    use crate::framebuffer::{Channels, Framebuffer, Pixel};
    use glam::Vec3;

    fn picture(width: u32, draw: impl Fn(u32, u32) -> Pixel) -> Framebuffer {
        let mut picture = Framebuffer::new(width, width, Channels::ALL);
        let mut band = picture.band();
        for y in 0..width {
            for x in 0..width {
                band.put(x, y, &draw(x, y));
            }
        }
        picture
    }

    fn square(shift: u32, distance: f32) -> Framebuffer {
        picture(20, |x, y| {
            if (5 + shift..15 + shift).contains(&x) && (5..15).contains(&y) {
                Pixel { id: 1, distance, normal: Vec3::Z, ..Pixel::background(Vec3::ONE) }
            } else {
                Pixel::background(Vec3::ZERO)
            }
        })
    }

    #[test]
    fn a_picture_agrees_with_itself() {
        let errors = Errors::between(&square(0, 4.0), &square(0, 4.0));
        assert_eq!(
            (errors.id_agreement, errors.silhouette_iou, errors.shadow_agreement),
            (Some(1.0), Some(1.0), Some(1.0))
        );
        assert_eq!(errors.distance.unwrap().max, 0.0);
        assert_eq!(errors.color.unwrap().rmse, 0.0);
    }

    #[test]
    fn a_shift_by_one_pixel_stays_in_the_edge_band() {
        let errors = Errors::between(&square(1, 4.5), &square(0, 4.0));
        assert_eq!(errors.id_agreement, Some(1.0));
        assert_eq!(errors.silhouette_iou, Some(90.0 / 110.0));
        let distance = errors.distance.unwrap();
        assert_eq!((distance.mean, distance.relative), (0.5, 0.125));
    }

    #[test]
    fn an_empty_picture_is_compared_without_dividing_by_nothing() {
        let empty = Framebuffer::new(0, 0, Channels::ALL);
        let errors = Errors::between(&empty, &empty);
        assert_eq!(errors.id_agreement, Some(1.0));
        assert!(errors.color.unwrap().rmse == 0.0);
    }
}
