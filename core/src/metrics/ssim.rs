//! Structural similarity of displayed luma.
//!
//! Source: Z. Wang, A. Bovik, H. Sheikh, E. Simoncelli, *Image quality assessment: from error visibility to
//! structural similarity*, IEEE TIP 13(4), 2004: Gaussian window, sigma 1.5, 11x11, K1 = 0.01, K2 = 0.03.

use super::filter::{kernel, normalized, separable};

/// Returns the mean structural similarity, 1 for equal pictures. Colors are weighted as luma (Rec. 709).
#[must_use]
pub fn ssim(picture: &[[f32; 3]], reference: &[[f32; 3]], width: usize, height: usize) -> f64 {
    if width * height == 0 {
        return 1.0;
    }
    let luma = |p: &[[f32; 3]]| -> Vec<f32> {
        p.iter().map(|c| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]).collect()
    };
    let window = normalized(kernel(5, |x| (-x * x / (2.0 * 1.5 * 1.5)).exp()));
    let mean = |plane: &[f32]| separable(plane, width, &window, &window);
    let (a, b) = (luma(picture), luma(reference));
    let product = |p: &[f32], q: &[f32]| -> Vec<f32> { p.iter().zip(q).map(|(x, y)| x * y).collect() };
    let (mean_a, mean_b) = (mean(&a), mean(&b));
    let (aa, bb, ab) = (mean(&product(&a, &a)), mean(&product(&b, &b)), mean(&product(&a, &b)));
    let (c1, c2) = (0.01_f64.powi(2), 0.03_f64.powi(2));
    let mut sum = 0.0;
    for i in 0..a.len() {
        let (ma, mb) = (f64::from(mean_a[i]), f64::from(mean_b[i]));
        let va = (f64::from(aa[i]) - ma * ma).max(0.0);
        let vb = (f64::from(bb[i]) - mb * mb).max(0.0);
        let cov = f64::from(ab[i]) - ma * mb;
        sum += (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
    }
    sum / a.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_pictures_are_fully_similar_and_flat_ones_follow_the_formula() {
        let noise: Vec<[f32; 3]> = (0..900).map(|i| [(i * 37 % 101) as f32 / 100.0; 3]).collect();
        assert!((ssim(&noise, &noise, 30, 30) - 1.0).abs() < 1e-9);
        let (a, b) = (vec![[0.5f32; 3]; 900], vec![[0.25f32; 3]; 900]);
        let expected = (2.0 * 0.5 * 0.25 + 1e-4) / (0.25 + 0.0625 + 1e-4);
        assert!((ssim(&a, &b, 30, 30) - expected).abs() < 1e-4);
    }
}
