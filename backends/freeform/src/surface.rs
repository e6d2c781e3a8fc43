//! Where does a ray meet the surface of a volume, at which its opacity passes half of its greatest?

use crate::volume::Level;
use glam::{DVec3, Vec3};
use polyptych_core::scene::{FreeForm, Volume};

/// How often the place of a surface is halved.
const HALVINGS: usize = 16;

/// Finds the first distance in `[near, far]` at which a ray in object space comes into what is above a value and within
/// the shell; one that begins there is followed out of it first.
///
/// Samples are as far apart as those of [`crate::march`], and clear bricks are jumped: what is transparent is below.
pub(crate) fn cast(
    level: &Level,
    (volume, surface): (&Volume, f32),
    origin: DVec3,
    direction: DVec3,
    [near, far]: [f64; 2],
) -> Option<f64> {
    let shell = volume.shell.as_ref().map(FreeForm::form);
    let is_inside = |t: f64| {
        let p = origin + direction * t;
        level.value_at(p) >= surface && shell.is_none_or(|form| form.value(p) >= 0.0)
    };
    let step = level.step / direction.length();
    let count = ((far - near) / step).ceil();
    if !(count > 0.0 && count < 1e9) {
        return None;
    }
    let (first, along) =
        (level.grid_from_object(origin + direction * near), direction * step / level.spacing);
    let (mut before, mut is_out) = (near, !is_inside(near));
    let mut i = 0.0;
    while i < count {
        i += if is_out { level.clear_samples(first + along * i, along).max(1.0) } else { 1.0 };
        let t = (near + i * step).min(far);
        let inside = is_inside(t);
        if inside && is_out {
            // What was jumped was clear: the surface is in the last step.
            let (mut low, mut high) = (before.max(t - step), t);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                if is_inside(middle) { high = middle } else { low = middle }
            }
            return Some(high);
        }
        (before, is_out) = (t, !inside);
    }
    None
}

impl Level {
    fn grid_from_object(&self, p: DVec3) -> DVec3 {
        (p - self.corner) / self.spacing + (crate::volume::BORDER as f64 - 0.5)
    }

    /// Interpolates the value at a point of object space.
    fn value_at(&self, p: DVec3) -> f32 {
        let grid = self.grid_from_object(p).as_vec3();
        let last = Vec3::from_array(self.size.map(|s| s as f32 - 2.001));
        let grid = grid.max(Vec3::ONE).min(last);
        let whole = grid.floor();
        let part = grid - whole;
        let [nx, ny, _] = self.size;
        let at = (whole.z as usize * ny + whole.y as usize) * nx + whole.x as usize;
        let row = |at: usize| self.values[at] + (self.values[at + 1] - self.values[at]) * part.x;
        let plane = |at: usize| row(at) + (row(at + nx) - row(at)) * part.y;
        plane(at) + (plane(at + nx * ny) - plane(at)) * part.z
    }

    /// Returns how many steps of a ray over the grid stay in the transparent box around its brick.
    fn clear_samples(&self, grid: DVec3, along: DVec3) -> f64 {
        let mut brick = [0; 3];
        for axis in 0..3 {
            let last = self.bricks[axis] as f64 - 1.0;
            brick[axis] = (grid[axis] / f64::from(1 << Self::BRICK_BITS)).floor().clamp(0.0, last) as usize;
        }
        let reach = self.clear[(brick[2] * self.bricks[1] + brick[1]) * self.bricks[0] + brick[0]];
        let mut count = if reach == 0 { 0.0 } else { f64::INFINITY };
        for axis in (0..3).filter(|&axis| along[axis] != 0.0) {
            let reach = f64::from(reach);
            let side = brick[axis] as f64 + if along[axis] > 0.0 { reach } else { 1.0 - reach };
            count = ((side * f64::from(1 << Self::BRICK_BITS) - grid[axis]) / along[axis]).min(count);
        }
        count.floor().max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Drawing, VolumeBody};
    use polyptych_core::scene::{Form, Samples, TransferPoint};

    /// A field that falls by one for each meter from the middle, and shows where it is above -10.
    fn ball(shell: Option<Form>) -> (Volume, VolumeBody) {
        let n = 48u32;
        let at = |k: u32| f64::from(k) + 0.5 - 24.0;
        let value = |k: u32| -DVec3::new(at(k % n), at(k / n % n), at(k / n / n)).length() as f32;
        let mut volume =
            Volume::new([n; 3], DVec3::ONE, Samples::F32((0..n * n * n).map(value).collect())).unwrap();
        let point = |value: f32, opacity: f32| TransferPoint { value, color: Vec3::ONE, opacity };
        volume.transfer.points = vec![point(-10.5, 0.0), point(-9.5, 0.8)];
        volume.shell = shell.map(|form| FreeForm::new(form).unwrap());
        let body = VolumeBody::new(&volume, Drawing { as_surface: true, ..Drawing::with_step(0.5) });
        (volume, body)
    }

    #[test]
    fn rays_meet_a_ball_where_it_is_and_its_shell_before() {
        let (volume, body) = ball(None);
        let surface = body.surface.unwrap();
        assert!((surface + 10.0).abs() < 1e-6, "{surface}");
        let shown = |v: &Volume, b: &VolumeBody, aside: f64| {
            cast(&b.levels[0], (v, surface), DVec3::new(aside, 0.3, 40.0), DVec3::NEG_Z, [16.0, 64.0])
        };
        for aside in [0.0, 3.1, 7.7, 9.5] {
            let expected = 40.0 - (100.0 - aside * aside - 0.09f64).sqrt();
            let met = shown(&volume, &body, aside).unwrap();
            // Between samples a ball is a little flat, and a grazing ray goes far within that.
            let cosine = (1.0 - aside * aside * 0.01f64).sqrt();
            assert!((met - expected).abs() < 0.025 / cosine, "{met} for {expected}");
            let value = volume.value(DVec3::new(aside, 0.3, 40.0 - met));
            assert!((value + 10.0).abs() < 1e-4, "{value}");
        }
        assert_eq!(shown(&volume, &body, 10.2), None);
        let (cut, within) =
            ball(Some(Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::new(20.0, 20.0, 4.0) }));
        let met = shown(&cut, &within, 0.0).unwrap();
        assert!((met - (40.0 - 4.0 * (1.0 - 0.09f64 / 400.0).sqrt())).abs() < 1e-3, "{met}");
    }
}
