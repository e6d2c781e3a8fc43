//! Smooth noise for generated terrain, clouds and textures.

use glam::DVec3;

/// Returns a number in `[0, 1)` that depends on the cell alone (a mix of multiplications and shifts).
fn lattice(x: i64, y: i64, z: i64) -> f64 {
    let mut h = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
        ^ (z as u64).wrapping_mul(0x1656_67b1_9e37_79f9);
    h = (h ^ (h >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ (h >> 32)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((h ^ (h >> 29)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Interpolates lattice values smoothly (value noise), in `[0, 1)`.
fn value(p: DVec3) -> f64 {
    let base = p.floor();
    let s = (p - base) * (p - base) * (DVec3::splat(3.0) - (p - base) * 2.0);
    let at = |dx: i64, dy: i64, dz: i64| lattice(base.x as i64 + dx, base.y as i64 + dy, base.z as i64 + dz);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |dy: i64, dz: i64| mix(at(0, dy, dz), at(1, dy, dz), s.x);
    mix(mix(row(0, 0), row(1, 0), s.y), mix(row(0, 1), row(1, 1), s.y), s.z)
}

/// Sums octaves of noise, each twice as fine and half as strong; in `[0, 1)`.
pub(super) fn fractal(p: DVec3, octaves: u32) -> f64 {
    let (mut sum, mut weight, mut total, mut scale) = (0.0, 0.5, 0.0, 1.0);
    for octave in 0..octaves {
        sum += value(p * scale + f64::from(octave) * 17.3) * weight;
        total += weight;
        weight *= 0.5;
        scale *= 2.03;
    }
    sum / total
}
