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
            let entered = close_in(&at, t, next, before, after);
            return Some(middle_of_sheet(model, &at, entered, [near, far], speed));
        }
        (t, before) = (next, after);
        if next >= far {
            break;
        }
    }
    None
}

/// Moves on from where a ray enters a sheet to the surface in its middle, which is how far away it is: sheets of bodies of
/// other sizes are not as thick, and what lies before another must stay before it. Where the distances before the sheet do
/// not fall evenly, as around its rim, the ray stays where it entered.
fn middle_of_sheet(
    model: &DistanceModel,
    at: &impl Fn(f64) -> f64,
    entered: f64,
    [near, far]: [f64; 2],
    speed: f64,
) -> f64 {
    /// Distances from the surface, in steps: beyond the cells that it goes through, and within the band.
    const FROM: [f64; 2] = [2.4, 1.1];
    let half = model.half_sheet / model.step;
    if half == 0.0 {
        return entered;
    }
    let rise = -at(entered - 0.5 * model.step / speed) / (0.5 * model.step);
    let back = FROM.map(|from| entered - (from - half) * model.step / (speed * rise));
    if rise.is_nan() || rise <= 0.0 || back[0] < near {
        return entered;
    }
    let distance = back.map(|t| half - at(t) / model.step);
    let slope = (distance[0] - distance[1]) / (back[1] - back[0]);
    let middle = back[1] + distance[1] / slope;
    let is_even = (distance[1] - slope * (entered - back[1]) - half).abs() < 0.1;
    // Within the sheet the interpolated distances are blunt.
    let is_within = middle > entered && middle <= far && at(middle) > 0.0;
    if is_even && is_within { middle } else { entered }
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

/// Returns the outward normal at a point that a ray met, by central differences over one sample. In the middle of a sheet
/// they are nothing: there the normal is that of a point before it.
pub(crate) fn normal(model: &DistanceModel, p: DVec3, direction: DVec3) -> DVec3 {
    let h = model.step * 0.5;
    let p = if model.half_sheet > 0.0 { p - direction.normalize_or_zero() * model.step } else { p };
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

#[cfg(test)]
mod tests {
    use super::*;
    use polyptych_core::convert::{Converter, Detail};
    use polyptych_core::scene::{Mesh, Object, Scene, Shape};
    use polyptych_core::seam::Control;

    #[test]
    fn a_sheet_is_met_where_its_surface_is_however_thick_it_was_made() {
        for half in [1.0_f32, 0.6, 0.37] {
            let at = |x: f32, y: f32| Vec3::new(x * half, y * half, 0.0);
            let quad = Mesh {
                positions: vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                ..Mesh::default()
            };
            let object = Object::new("quad", Shape::Mesh(quad), 0);
            let detail = Detail { tolerance: 0.02, max_resolution: 256 };
            let model = Converter::default()
                .distance(&Scene::default(), &object, detail, &Control::simple())
                .unwrap();
            assert!(model.half_sheet > 0.005, "{}", model.half_sheet);
            for (x, y) in [(0.0, 0.0), (0.11, -0.07), (-0.2, 0.13)] {
                for lean in [0.0, 0.3, 1.0] {
                    let target = DVec3::new(x, y, 0.0);
                    let direction = DVec3::new(-lean, 0.2 * lean, -1.0).normalize_or_zero();
                    let origin = target - direction * 4.0;
                    let bounds = bounds(&model).clip(origin, direction).unwrap();
                    let met = cast(&model, origin, direction, bounds.0, bounds.1).unwrap();
                    assert!((met - 4.0).abs() < 1e-5, "{met} at {target}, leaning by {lean}");
                    let normal = normal(&model, target, direction).normalize_or_zero();
                    assert!(normal.dot(DVec3::Z) > 0.9999, "{normal}");
                }
            }
            // Past the rim nothing is met, and nothing is made up beyond the band.
            let origin = DVec3::new(f64::from(half) + 0.1, 0.0, 4.0);
            assert_eq!(cast(&model, origin, DVec3::NEG_Z, 0.0, 8.0), None);
        }
    }
}
