//! The difference that one sees when two pictures are flipped back and forth.
//!
//! Source: P. Andersson, J. Nilsson, T. Akenine-Möller et al., *FLIP: A Difference Evaluator for Alternating
//! Images*, HPG 2020 (low dynamic range), at the paper's default of 67.02 pixels a degree.

use super::filter::{kernel, normalized, separable};
use crate::shade::linear_from_srgb;
use std::f64::consts::PI;

/// Pixels a degree of view: a 0.7 m wide 4K display seen from 0.7 m.
const PIXELS_PER_DEGREE: f64 = 67.02;

/// Returns the FLIP error of every pixel, 0 to 1; colors are displayed (sRGB) values.
#[must_use]
pub fn flip_map(picture: &[[f32; 3]], reference: &[[f32; 3]], width: usize, height: usize) -> Vec<f32> {
    if width * height == 0 {
        return Vec::new();
    }
    let (a, b) = (Opponent::of(picture), Opponent::of(reference));
    let (seen_a, seen_b) = (a.filtered(width), b.filtered(width));
    let (features_a, features_b) = (Features::of(&a, width), Features::of(&b, width));
    let largest = color_distance(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(0.7);
    (0..picture.len())
        .map(|i| {
            let color = redistribute(color_distance(seen_a[i], seen_b[i]).powf(0.7), largest);
            let edge = (features_a.edges[i] - features_b.edges[i]).abs();
            let point = (features_a.points[i] - features_b.points[i]).abs();
            let feature = (edge.max(point) / 2f32.sqrt()).sqrt();
            color.powf(1.0 - feature)
        })
        .collect()
}

/// The linear opponent space Y Cx Cz.
struct Opponent {
    planes: [Vec<f32>; 3],
}

/// Linear sRGB to XYZ, rows; white is their sum.
const XYZ: [[f32; 3]; 3] = [
    [0.412_390_8, 0.357_584_3, 0.180_480_8],
    [0.212_639, 0.715_168_7, 0.072_192_3],
    [0.019_330_8, 0.119_194_8, 0.950_532_2],
];

/// XYZ to linear sRGB, rows.
const RGB: [[f32; 3]; 3] = [
    [3.240_97, -1.537_383_2, -0.498_610_8],
    [-0.969_243_6, 1.875_967_5, 0.041_555_1],
    [0.055_630_1, -0.203_977, 1.056_971_5],
];

fn apply(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Returns XYZ over the white point.
fn relative_xyz(linear: [f32; 3]) -> [f32; 3] {
    let (xyz, white) = (apply(&XYZ, linear), apply(&XYZ, [1.0; 3]));
    std::array::from_fn(|c| xyz[c] / white[c])
}

impl Opponent {
    fn of(displayed: &[[f32; 3]]) -> Self {
        let mut planes = [const { Vec::new() }; 3];
        for &color in displayed {
            let [x, y, z] = relative_xyz(color.map(linear_from_srgb));
            planes[0].push(116.0 * y - 16.0);
            planes[1].push(500.0 * (x - y));
            planes[2].push(200.0 * (y - z));
        }
        Self { planes }
    }

    /// Blurs each channel by the eye's contrast sensitivity and returns Hunt-adjusted L*a*b* (section 4.1).
    fn filtered(&self, width: usize) -> Vec<[f32; 3]> {
        let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as usize;
        let gauss = |b: f64| kernel(radius, |x| (-(PI * x / PIXELS_PER_DEGREE).powi(2) / b).exp());
        let weight = |a: f64, b: f64, k: &[f32]| (a * (PI / b).sqrt()) as f32 * k.iter().sum::<f32>().powi(2);
        let single = |plane: &[f32], b: f64| {
            let k = normalized(gauss(b));
            separable(plane, width, &k, &k)
        };
        let achromatic = single(&self.planes[0], 0.0047);
        let red_green = single(&self.planes[1], 0.0053);
        // Blue-yellow is a sum of two Gaussians, normalized together.
        let (w1, w2) = (weight(34.1, 0.04, &gauss(0.04)), weight(13.5, 0.025, &gauss(0.025)));
        let (wide, narrow) = (single(&self.planes[2], 0.04), single(&self.planes[2], 0.025));
        (0..achromatic.len())
            .map(|i| {
                let blue_yellow = (w1 * wide[i] + w2 * narrow[i]) / (w1 + w2);
                hunt_lab(linear_from_opponent([achromatic[i], red_green[i], blue_yellow]))
            })
            .collect()
    }
}

fn linear_from_opponent([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    let white = apply(&XYZ, [1.0; 3]);
    let y = (y + 16.0) / 116.0;
    let xyz = [(cx / 500.0 + y) * white[0], y * white[1], (y - cz / 200.0) * white[2]];
    apply(&RGB, xyz).map(|c| c.clamp(0.0, 1.0))
}

/// Returns L*a*b* with a* and b* scaled by the lightness (Hunt effect).
fn hunt_lab(linear: [f32; 3]) -> [f32; 3] {
    let delta = 6.0_f32 / 29.0;
    let f = relative_xyz(linear)
        .map(|t| if t > delta.powi(3) { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 });
    let lightness = 116.0 * f[1] - 16.0;
    let hunt = 0.01 * lightness;
    [lightness, 500.0 * (f[0] - f[1]) * hunt, 200.0 * (f[1] - f[2]) * hunt]
}

/// Returns the HyAB distance: city block in lightness, Euclidean in the chromatic plane.
fn color_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Maps color errors to `[0, 1]`: the lower 40 % of the range fill 95 % of it (section 4.1.4).
fn redistribute(error: f32, largest: f32) -> f32 {
    let knee = 0.4 * largest;
    if error < knee { 0.95 / knee * error } else { 0.95 + (error - knee) / (largest - knee) * 0.05 }
}

/// Strength of edges and points (section 4.2).
struct Features {
    edges: Vec<f32>,
    points: Vec<f32>,
}

impl Features {
    fn of(opponent: &Opponent, width: usize) -> Self {
        let lightness: Vec<f32> = opponent.planes[0].iter().map(|y| (y + 16.0) / 116.0).collect();
        let deviation = 0.5 * 0.082 * PIXELS_PER_DEGREE;
        let radius = (3.0 * deviation).ceil() as usize;
        let bell = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
        let across = normalized(kernel(radius, bell));
        let first = balanced(kernel(radius, |x| -x * bell(x)));
        let second = balanced(kernel(radius, |x| (x * x / (deviation * deviation) - 1.0) * bell(x)));
        let strength = |derivative: &[f32]| -> Vec<f32> {
            let dx = separable(&lightness, width, derivative, &across);
            let dy = separable(&lightness, width, &across, derivative);
            dx.iter().zip(&dy).map(|(x, y)| x.hypot(*y)).collect()
        };
        Self { edges: strength(&first), points: strength(&second) }
    }
}

/// Scales the positive weights to sum to 1 and the negative ones to -1.
fn balanced(mut kernel: Vec<f32>) -> Vec<f32> {
    let positive: f32 = kernel.iter().filter(|w| **w > 0.0).sum();
    let negative: f32 = -kernel.iter().filter(|w| **w < 0.0).sum::<f32>();
    kernel.iter_mut().for_each(|w| *w /= if *w > 0.0 { positive } else { negative });
    kernel
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture with edges, a ramp and a fine pattern, all from whole numbers.
    fn pattern(width: usize, height: usize, shift: usize) -> Vec<[f32; 3]> {
        (0..width * height)
            .map(|i| {
                let (x, y) = (i % width + shift, i / width);
                let checker = if (x / 8 + y / 8) % 2 == 0 { 200 } else { 60 };
                [checker, (x * 3) % 256, if (x + y) % 5 == 0 { 255 } else { y * 2 % 256 }]
                    .map(|c| c as f32 / 255.0)
            })
            .collect()
    }

    #[test]
    fn equal_pictures_have_no_error_and_black_against_white_almost_all() {
        let a = pattern(48, 40, 0);
        assert!(flip_map(&a, &a, 48, 40).iter().all(|&e| e == 0.0));
        let (black, white) = (vec![[0.0f32; 3]; 400], vec![[1.0f32; 3]; 400]);
        let error = flip_map(&black, &white, 20, 20)[210];
        assert!((error - FLIP_BLACK_WHITE).abs() < 1e-4, "{error}");
    }

    #[test]
    fn mean_error_of_a_shift_agrees_with_the_authors_program() {
        let (a, b) = (pattern(48, 40, 2), pattern(48, 40, 0));
        let map = flip_map(&a, &b, 48, 40);
        let mean = map.iter().sum::<f32>() / map.len() as f32;
        assert!((mean - FLIP_SHIFT).abs() < 1e-4, "{mean}");
    }

    /// From the authors' own program (flip-evaluator 1.x, LDR, default pixels per degree) on the same pixels.
    const FLIP_SHIFT: f32 = 0.330_893;
    const FLIP_BLACK_WHITE: f32 = 0.967_386;
}
