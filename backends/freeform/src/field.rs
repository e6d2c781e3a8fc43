//! How does a ray meet the zero level of a grid of signed distances?

use glam::{DVec3, Vec3};
use polyptych_core::convert::DistanceModel;
use polyptych_core::math::Aabb;

/// Bounds the grid of samples in object space.
pub(crate) fn bounds(model: &DistanceModel) -> Aabb {
    let last = DVec3::from_array(model.size.map(|s| f64::from(s - 1))) * model.step;
    Aabb::new(model.first, model.first + last)
}

/// Finds the first distance in `[near, far]` at which a ray in object space enters the solid.
///
/// Away from the surface a distance is a safe step; close to it the steps are half a sample, and a change of sign
/// is closed in by the rule of false position.
pub(crate) fn cast(
    model: &DistanceModel,
    origin: DVec3,
    direction: DVec3,
    near: f64,
    far: f64,
) -> Option<f64> {
    let speed = direction.length();
    let at = |t: f64| f64::from(value(model, origin + direction * t));
    let mut t = near;
    let mut before = at(t);
    if before >= 0.0 {
        // Started inside: shadow rays leave their own surface first.
        while before >= 0.0 && t < far {
            t += model.step * 0.25 / speed;
            before = at(t);
        }
    }
    while t < far {
        let step = (-before).max(model.step * 0.5) / speed;
        let next = (t + step).min(far);
        let after = at(next);
        if after >= 0.0 {
            return Some(close_in(&at, t, next, before, after));
        }
        (t, before) = (next, after);
        if next >= far {
            break;
        }
    }
    None
}

fn close_in(at: &impl Fn(f64) -> f64, mut lo: f64, mut hi: f64, mut f_lo: f64, mut f_hi: f64) -> f64 {
    for _ in 0..12 {
        let share = (f_lo / (f_lo - f_hi)).clamp(0.05, 0.95);
        let middle = lo + (hi - lo) * share;
        let f = at(middle);
        if f >= 0.0 {
            (hi, f_hi) = (middle, f);
        } else {
            (lo, f_lo) = (middle, f);
        }
    }
    hi
}

/// Interpolates the distance; outside of the grid that of its border.
fn value(model: &DistanceModel, p: DVec3) -> f32 {
    let (base, part) = place(model, p);
    let [nx, ny, _] = model.size.map(|s| s as usize);
    let i = (base[2] * ny + base[1]) * nx + base[0];
    let d = &model.distances;
    let row = |i: usize| d[i] + (d[i + 1] - d[i]) * part.x;
    let plane = |i: usize| row(i) + (row(i + nx) - row(i)) * part.y;
    plane(i) + (plane(i + nx * ny) - plane(i)) * part.z
}

/// Returns the sample before a point and the place between it and the next.
fn place(model: &DistanceModel, p: DVec3) -> ([usize; 3], Vec3) {
    let grid = (p - model.first) / model.step;
    let base: [usize; 3] =
        std::array::from_fn(|a| grid[a].floor().clamp(0.0, f64::from(model.size[a] - 2)) as usize);
    let part = grid - DVec3::from_array(base.map(|b| b as f64));
    (base, part.clamp(DVec3::ZERO, DVec3::ONE).as_vec3())
}

/// Returns the outward normal at a point, by central differences over one sample.
pub(crate) fn normal(model: &DistanceModel, p: DVec3) -> DVec3 {
    let h = model.step * 0.5;
    let slope = |axis: DVec3| f64::from(value(model, p + axis * h) - value(model, p - axis * h));
    -DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z))
}

/// Returns the index of the material at a point: that of the nearest sample that has one.
pub(crate) fn material(model: &DistanceModel, p: DVec3) -> usize {
    let (base, part) = place(model, p);
    let [nx, ny, _] = model.size.map(|s| s as usize);
    let near = |a: usize| base[a] + usize::from(part[a] > 0.5);
    let byte = |x: usize, y: usize, z: usize| model.colors[(z * ny + y) * nx + x];
    let found = byte(near(0), near(1), near(2));
    if found != 0 {
        return usize::from(found) - 1;
    }
    let corner =
        (0..8).map(|k| byte(base[0] + (k & 1), base[1] + (k >> 1 & 1), base[2] + (k >> 2))).find(|&b| b != 0);
    corner.map_or(0, |b| usize::from(b) - 1)
}
