//! Separable filters over planes, borders drawn out.

/// Filters a plane with one kernel along rows and another along columns; kernels have an odd length.
pub(super) fn separable(plane: &[f32], width: usize, along_x: &[f32], along_y: &[f32]) -> Vec<f32> {
    if plane.is_empty() {
        return Vec::new();
    }
    let height = plane.len() / width;
    let mut rows = vec![0.0; plane.len()];
    let radius = along_x.len() / 2;
    // A row with its borders drawn out, so that the sums run over neighbors without asking where they are.
    let mut wide = vec![0.0; width + 2 * radius];
    for (source, target) in plane.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        wide[..radius].fill(source[0]);
        wide[radius..radius + width].copy_from_slice(source);
        wide[radius + width..].fill(source[width - 1]);
        for (k, w) in along_x.iter().enumerate() {
            for (out, value) in target.iter_mut().zip(&wide[k..]) {
                *out += w * value;
            }
        }
    }
    let mut result = vec![0.0; plane.len()];
    let radius = along_y.len() / 2;
    for (y, target) in result.chunks_exact_mut(width).enumerate() {
        for (k, w) in along_y.iter().enumerate() {
            let row = (y + k).saturating_sub(radius).min(height - 1);
            for (out, value) in target.iter_mut().zip(&rows[row * width..]) {
                *out += w * value;
            }
        }
    }
    result
}

/// Returns the kernel of a function of the offset in pixels, not normalized.
pub(super) fn kernel(radius: usize, weight: impl Fn(f64) -> f64) -> Vec<f32> {
    (0..=2 * radius).map(|k| weight(k as f64 - radius as f64) as f32).collect()
}

/// Scales a kernel so that it sums to 1.
pub(super) fn normalized(mut kernel: Vec<f32>) -> Vec<f32> {
    let sum: f32 = kernel.iter().sum();
    kernel.iter_mut().for_each(|w| *w /= sum);
    kernel
}
