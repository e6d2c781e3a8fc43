//! Differences of displayed color: means, and the four numbers that catch what means let through.

use super::{display_colors, flip::flip_map, ssim::ssim};
use crate::framebuffer::Framebuffer;
use serde::Serialize;

/// Differences of displayed color, in shares of the full range unless said otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ColorErrors {
    /// Root of the mean square over pixels and channels.
    pub rmse: f64,
    /// Peak signal-to-noise ratio, dB; 99 for equal pictures.
    pub psnr: f64,
    /// Structural similarity, 1 for equal pictures.
    pub ssim: f64,
    /// Mean FLIP error at 67 pixels a degree, 0 for equal pictures.
    pub flip: f64,
    /// Largest mean difference of a channel, sign dropped after the mean.
    pub bias: f64,
    /// Mean absolute difference in the worst 32x32 tile.
    pub worst_tile: f64,
    /// Number of pixels outside of the range of the reference's 3x3 neighborhood.
    pub outliers: u64,
    /// Number of pixels in the largest connected group of those.
    pub largest_blob: u64,
    /// Number of the reference's pixels outside of the range of the picture's 3x3 neighborhood: thin lines that are
    /// missing, which the outliers of the picture do not show.
    pub missing: u64,
    /// Largest mean difference of a channel in a 16x16 tile over its standard error: what noise cannot explain.
    pub worst_z: f64,
    /// Number of outliers that stand out of the noise of their 16x16 tile, too.
    pub loud: u64,
}

/// How far a channel must be outside of the neighborhood's range to count: eight steps of an 8-bit display,
/// above dithering and the last steps of a highlight, below any shadow or crack.
const OUTLIER: f32 = 8.0 / 255.0;

/// Edge of a tile.
const TILE: usize = 32;

/// Edge of a tile whose noise is measured.
const NOISE_TILE: usize = 16;

/// Standard deviation of a difference that has none: half of a step of an 8-bit display.
const LEAST_NOISE: f64 = 0.5 / 255.0;

/// Standard deviations beyond which a pixel is loud.
const LOUD: f64 = 6.0;

impl ColorErrors {
    pub(super) fn between(picture: &Framebuffer, reference: &Framebuffer) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        Self::of_displayed(&display_colors(picture), &display_colors(reference), width, height)
    }

    /// Compares displayed colors in rows.
    ///
    /// # Panics
    /// When the number of pixels does not fit the size.
    #[must_use]
    pub fn of_displayed(picture: &[[f32; 3]], reference: &[[f32; 3]], width: usize, height: usize) -> Self {
        assert_eq!(
            (picture.len(), reference.len()),
            (width * height, width * height),
            "pixels of the pictures"
        );
        let count = (width * height).max(1) as f64;
        let (rmse, sum) = differences(picture, reference);
        let outside = outliers(picture, reference, width, height);
        let (worst_z, loud) = noise(picture, reference, &outside, width, height);
        let flip = flip_map(picture, reference, width, height);
        Self {
            rmse,
            psnr: if rmse > 0.0 { (-20.0 * rmse.log10()).min(99.0) } else { 99.0 },
            ssim: ssim(picture, reference, width, height),
            flip: flip.iter().map(|&e| f64::from(e)).sum::<f64>() / count,
            bias: sum.iter().map(|s| (s / count).abs()).fold(0.0, f64::max),
            worst_tile: worst_tile(picture, reference, width, height),
            outliers: outside.iter().filter(|&&o| o).count() as u64,
            largest_blob: largest_blob(&outside, width),
            missing: outliers(reference, picture, width, height).iter().filter(|&&o| o).count() as u64,
            worst_z,
            loud,
        }
    }
}

/// Returns the root of the mean square of the differences, and their sum for each channel.
pub(super) fn differences(picture: &[[f32; 3]], reference: &[[f32; 3]]) -> (f64, [f64; 3]) {
    let (mut square, mut sum) = (0.0_f64, [0.0_f64; 3]);
    for (a, b) in picture.iter().zip(reference) {
        for c in 0..3 {
            let difference = f64::from(a[c]) - f64::from(b[c]);
            square += difference * difference;
            sum[c] += difference;
        }
    }
    ((square / (3.0 * picture.len().max(1) as f64)).sqrt(), sum)
}

fn worst_tile(picture: &[[f32; 3]], reference: &[[f32; 3]], width: usize, height: usize) -> f64 {
    let mut worst = 0.0_f64;
    for y in (0..height).step_by(TILE) {
        for x in (0..width).step_by(TILE) {
            let (mut sum, mut count) = (0.0_f64, 0u32);
            for row in y..(y + TILE).min(height) {
                for i in row * width + x..row * width + (x + TILE).min(width) {
                    sum += (0..3).map(|c| f64::from((picture[i][c] - reference[i][c]).abs())).sum::<f64>();
                    count += 3;
                }
            }
            worst = worst.max(sum / f64::from(count));
        }
    }
    worst
}

/// Returns the largest mean difference of a tile in standard errors, and the number of outliers that are louder than
/// the noise around them, whose strength the median of the differences tells.
fn noise(
    picture: &[[f32; 3]],
    reference: &[[f32; 3]],
    outside: &[bool],
    width: usize,
    height: usize,
) -> (f64, u64) {
    let (mut worst, mut loud) = (0.0_f64, 0);
    let mut differences: [Vec<f64>; 3] = Default::default();
    for y in (0..height).step_by(NOISE_TILE) {
        for x in (0..width).step_by(NOISE_TILE) {
            let rows = y..(y + NOISE_TILE).min(height);
            let pixels = || rows.clone().flat_map(|v| v * width + x..v * width + (x + NOISE_TILE).min(width));
            let mut strength = LEAST_NOISE;
            for (channel, own) in differences.iter_mut().enumerate() {
                own.clear();
                own.extend(pixels().map(|i| f64::from(picture[i][channel] - reference[i][channel])));
                let count = own.len() as f64;
                let mean = own.iter().sum::<f64>() / count;
                let variance = own.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / count;
                worst = worst.max(mean.abs() / (variance.sqrt().max(LEAST_NOISE) / count.sqrt()));
                own.iter_mut().for_each(|d| *d = d.abs());
                let middle = own.len() / 2;
                // The median of the sizes is 0.6745 standard deviations of a normal distribution.
                strength = strength.max(*own.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745);
            }
            let far = |i: usize| {
                (0..3).any(|c| f64::from((picture[i][c] - reference[i][c]).abs()) > LOUD * strength)
            };
            loud += pixels().filter(|&i| outside[i] && far(i)).count() as u64;
        }
    }
    (worst, loud)
}

/// Marks pixels with a channel outside of what the reference shows in the 3x3 pixels around.
fn outliers(picture: &[[f32; 3]], reference: &[[f32; 3]], width: usize, height: usize) -> Vec<bool> {
    let mut outside = vec![false; picture.len()];
    for y in 0..height {
        for x in 0..width {
            let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
            for v in y.saturating_sub(1)..(y + 2).min(height) {
                for u in x.saturating_sub(1)..(x + 2).min(width) {
                    let color = reference[v * width + u];
                    for c in 0..3 {
                        low[c] = low[c].min(color[c]);
                        high[c] = high[c].max(color[c]);
                    }
                }
            }
            let color = picture[y * width + x];
            outside[y * width + x] =
                (0..3).any(|c| !(color[c] >= low[c] - OUTLIER && color[c] <= high[c] + OUTLIER));
        }
    }
    outside
}

/// Returns the size of the largest group of marked pixels, joined over edges and corners.
fn largest_blob(marked: &[bool], width: usize) -> u64 {
    let mut left = marked.to_vec();
    let mut stack = Vec::new();
    let mut largest = 0;
    for start in 0..left.len() {
        if !left[start] {
            continue;
        }
        left[start] = false;
        stack.push(start);
        let mut size = 0;
        while let Some(i) = stack.pop() {
            size += 1;
            let (x, y) = (i % width, i / width);
            for v in y.saturating_sub(1)..=(y + 1) {
                for u in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                    let next = v * width + u;
                    if next < left.len() && left[next] {
                        left[next] = false;
                        stack.push(next);
                    }
                }
            }
        }
        largest = largest.max(size);
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planted_blob_is_counted_and_a_shift_is_not() {
        let (width, height) = (64, 48);
        let stripe = |x: usize| if (x / 8).is_multiple_of(2) { [0.2; 3] } else { [0.7; 3] };
        let reference: Vec<_> = (0..width * height).map(|i| stripe(i % width)).collect();
        let shifted: Vec<_> = (0..width * height).map(|i| stripe((i % width + 1).min(width - 1))).collect();
        let errors = ColorErrors::of_displayed(&shifted, &reference, width, height);
        assert_eq!((errors.outliers, errors.largest_blob), (0, 0));
        let mut holed = reference.clone();
        for (x, y) in [(5, 5), (6, 6), (6, 7), (40, 40)] {
            holed[y * width + x] = [1.0; 3];
        }
        let errors = ColorErrors::of_displayed(&holed, &reference, width, height);
        assert_eq!((errors.outliers, errors.largest_blob), (4, 3));
    }

    #[test]
    fn a_uniform_step_has_the_closed_form_errors() {
        let (reference, brighter) = (vec![[0.5f32; 3]; 100], vec![[0.6f32; 3]; 100]);
        let errors = ColorErrors::of_displayed(&brighter, &reference, 10, 10);
        for value in [errors.rmse, errors.bias, errors.worst_tile] {
            assert!((value - 0.1).abs() < 1e-6);
        }
        assert!((errors.psnr - 20.0).abs() < 1e-4);
    }
}
