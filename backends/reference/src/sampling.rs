//! Where in a pixel do its samples lie?

/// Returns the place of a sample in its pixel, `(0, 0)` to `(1, 1)`.
///
/// A single sample is the center. Several lie in strata of equal area, jittered by a hash: the strata stand in
/// about `sqrt(count)` rows, and a row is as high as its share of the samples.
pub(crate) fn place_in_pixel(x: u32, y: u32, sample: u32, count: u32) -> (f64, f64) {
    if count <= 1 {
        return (0.5, 0.5);
    }
    let rows = u64::from(count).isqrt().max(1);
    let (count, sample) = (u64::from(count), u64::from(sample));
    let begin = |row: u64| count * row / rows;
    let row = (0..rows).rev().find(|&r| begin(r) <= sample).unwrap_or(0);
    let (first, next) = (begin(row), begin(row + 1));
    let (u, v) = jitter(x, y, sample);
    let across = ((sample - first) as f64 + u) / (next - first) as f64;
    let down = (first as f64 + v * (next - first) as f64) / count as f64;
    (across, down)
}

/// Hashes a pixel and a sample into two numbers in `[0, 1)` (the finalizer of SplitMix64, Steele et al. 2014).
fn jitter(x: u32, y: u32, sample: u64) -> (f64, f64) {
    let mix = |mut z: u64| {
        z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let bits = mix(mix(u64::from(x) | u64::from(y) << 32) ^ sample);
    let unit = |half: u64| half as f64 / (1u64 << 32) as f64;
    (unit(bits >> 32), unit(bits & 0xffff_ffff))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strata_have_the_same_area_for_any_count() {
        // A half plane through the pixel is covered to within the strata on its border.
        for count in [2, 3, 4, 5, 7, 16, 61, 256] {
            let (mut sum_x, mut sum_y) = (0.0, 0.0);
            let pixels = 4000;
            for pixel in 0..pixels {
                for sample in 0..count {
                    let (u, v) = place_in_pixel(pixel, 3, sample, count);
                    assert!((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v));
                    sum_x += u;
                    sum_y += v;
                }
            }
            let n = f64::from(count * pixels);
            assert!((sum_x / n - 0.5).abs() < 0.01 && (sum_y / n - 0.5).abs() < 0.01, "{count} samples lean");
        }
        assert_eq!(place_in_pixel(9, 9, 0, 1), (0.5, 0.5));
    }
}
