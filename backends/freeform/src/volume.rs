//! How much light comes from a volume along a stretch of a ray?
//!
//! `P = sum_n I_n a_n prod_{m<n} (1 - a_m)`, front to back, with opacities corrected for the length of a sample.
//! Bricks whose values are all transparent are jumped: their samples would add exactly nothing, and the samples
//! beyond stand where they would have stood, so the picture is the same, byte for byte.

use glam::{DVec3, Vec3};
use polyptych_core::scene::{Environment, LightingModel, Material, Volume};
use polyptych_core::shade::{Surface, fogged};

/// Samples along the edge of a brick.
const BRICK: u32 = 8;

/// Transparency at which a ray ends.
pub(crate) const OPAQUE: f32 = 1.0 / 1024.0;

/// A volume, ready to be marched.
#[derive(Debug)]
pub(crate) struct VolumeBody {
    values: Vec<f32>,
    size: [usize; 3],
    bricks: [usize; 3],
    /// Whether every value that is interpolated in a brick is transparent.
    clear: Vec<bool>,
    /// Smallest gradient that counts as a surface: a thousandth of the range over a spacing.
    least_gradient: f64,
}

/// A light that reaches everything alike: volumes receive no shadow.
pub(crate) struct Shine {
    pub(crate) to_light: Vec3,
    pub(crate) radiance: Vec3,
}

/// What a ray gathered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gathered {
    pub(crate) color: Vec3,
    pub(crate) transparency: f32,
    /// Where half of the light was held back, once it was.
    pub(crate) half: Option<f64>,
}

impl Gathered {
    pub(crate) const NOTHING: Self = Self { color: Vec3::ZERO, transparency: 1.0, half: None };

    /// Adds a layer in front of everything that follows.
    pub(crate) fn add(&mut self, color: Vec3, opacity: f32) {
        self.color += color * (self.transparency * opacity);
        self.transparency *= 1.0 - opacity;
    }
}

/// A ray in object space with its light.
pub(crate) struct March<'a> {
    pub(crate) volume: &'a Volume,
    pub(crate) material: &'a Material,
    pub(crate) environment: &'a Environment,
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    /// Step in world units.
    pub(crate) step: f64,
    /// Lengths in object space for a length in the world.
    pub(crate) object_per_world: f64,
    /// Turns gradients of object space into normals of the world.
    pub(crate) normal_map: glam::DMat3,
    pub(crate) to_eye: Vec3,
}

impl VolumeBody {
    pub(crate) fn new(volume: &Volume) -> Self {
        let size = volume.size().map(|s| s as usize);
        // What is not a number is empty: below everything.
        let empty = volume.range()[0];
        let values: Vec<f32> = (0..volume.samples().len())
            .map(|i| volume.samples().get(i))
            .map(|v| if v.is_finite() { v } else { empty })
            .collect();
        let bricks = volume.size().map(|s| s.div_ceil(BRICK) as usize);
        let range = f64::from(volume.range()[1] - volume.range()[0]);
        let mut body = Self {
            values,
            size,
            bricks,
            clear: Vec::new(),
            least_gradient: 1e-3 * range / volume.spacing().max_element(),
        };
        body.clear = body.find_clear(volume);
        body
    }

    /// Returns what [`VolumeBody::bytes`] will be.
    pub(crate) fn planned_bytes(volume: &Volume) -> u64 {
        let bricks: u64 = volume.size().map(|s| u64::from(s.div_ceil(BRICK))).iter().product();
        volume.samples().len() as u64 * 4 + bricks
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.values.len() as u64 * 4 + self.clear.len() as u64
    }

    /// Marks bricks that are transparent, neighbors of the border samples included.
    fn find_clear(&self, volume: &Volume) -> Vec<bool> {
        let mut clear = Vec::with_capacity(self.bricks.iter().product());
        for bz in 0..self.bricks[2] {
            for by in 0..self.bricks[1] {
                for bx in 0..self.bricks[0] {
                    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
                    let span = |b: usize, axis: usize| {
                        let first = (b * BRICK as usize).saturating_sub(1);
                        first..((b + 1) * BRICK as usize + 2).min(self.size[axis])
                    };
                    for z in span(bz, 2) {
                        for y in span(by, 1) {
                            for x in span(bx, 0) {
                                let v = self.values[(z * self.size[1] + y) * self.size[0] + x];
                                (low, high) = (low.min(v), high.max(v));
                            }
                        }
                    }
                    clear.push(is_clear(volume, low, high));
                }
            }
        }
        clear
    }

    /// Interpolates the field at a place in cells from the first sample.
    fn value(&self, grid: DVec3) -> f32 {
        let last = DVec3::from_array(self.size.map(|s| (s - 1) as f64));
        let grid = grid.clamp(DVec3::ZERO, last);
        let base: [usize; 3] =
            std::array::from_fn(|a| (grid[a] as usize).min(self.size[a].saturating_sub(2)));
        let part = (grid - DVec3::from_array(base.map(|b| b as f64))).as_vec3();
        let step = [1, self.size[0], self.size[0] * self.size[1]];
        // An axis with a single sample has no neighbor: it is its own.
        let step: [usize; 3] = std::array::from_fn(|a| if self.size[a] > 1 { step[a] } else { 0 });
        let i = (base[2] * self.size[1] + base[1]) * self.size[0] + base[0];
        let v = &self.values;
        let row = |i: usize| v[i] + (v[i + step[0]] - v[i]) * part.x;
        let plane = |i: usize| row(i) + (row(i + step[1]) - row(i)) * part.y;
        plane(i) + (plane(i + step[2]) - plane(i)) * part.z
    }

    /// Returns the gradient by central differences one sample wide on each side, object space.
    fn gradient(&self, volume: &Volume, grid: DVec3) -> DVec3 {
        let slope = |axis: DVec3| f64::from(self.value(grid + axis) - self.value(grid - axis));
        let difference = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
        difference / (volume.spacing() * 2.0)
    }

    /// Tells whether a sample stands in a transparent brick, and how many samples may then be jumped.
    fn jump(&self, grid: DVec3, step: DVec3) -> Option<u32> {
        let brick: [usize; 3] =
            std::array::from_fn(|a| ((grid[a].max(0.0) / f64::from(BRICK)) as usize).min(self.bricks[a] - 1));
        if !self.clear[(brick[2] * self.bricks[1] + brick[1]) * self.bricks[0] + brick[0]] {
            return None;
        }
        let mut count = f64::INFINITY;
        for axis in 0..3 {
            if step[axis] != 0.0 {
                let side = (brick[axis] + usize::from(step[axis] > 0.0)) as f64 * f64::from(BRICK);
                count = count.min((side - grid[axis]) / step[axis]);
            }
        }
        // One sample less than the border: rounding never jumps over a brick that is not clear.
        Some(if count.is_finite() { (count.floor() as u32).saturating_sub(1) } else { u32::MAX / 2 })
    }

    /// Adds the samples `first..last` of a ray: sample `i` stands at `(i + 1/2) step`, counted from `begin`.
    pub(crate) fn march(
        &self,
        ray: &March<'_>,
        begin: f64,
        samples: std::ops::Range<u32>,
        lights: &[Shine],
        sum: &mut Gathered,
    ) {
        let volume = ray.volume;
        let grid_step = ray.direction * ray.step / volume.spacing();
        let length = ray.step * ray.object_per_world;
        let mut i = samples.start;
        while i < samples.end && sum.transparency >= OPAQUE {
            let t = begin + (f64::from(i) + 0.5) * ray.step;
            let p = ray.origin + ray.direction * t;
            let grid = volume.grid_from_object(p);
            i += 1;
            if let Some(more) = self.jump(grid, grid_step) {
                i = i.saturating_add(more);
                continue;
            }
            let (color, opacity) = volume.transfer.at(self.value(grid));
            if opacity <= 0.0 || volume.shell.as_ref().is_some_and(|s| s.form().value(p) < 0.0) {
                continue;
            }
            let alpha = volume.transfer.corrected_opacity(opacity, length);
            let lit = self.shade(ray, grid, color, lights);
            sum.add(fogged(ray.environment, lit, t), alpha);
            if sum.half.is_none() && sum.transparency <= 0.5 {
                sum.half = Some(t);
            }
        }
    }

    /// Lights a sample by the gradient of the field, or evenly where there is hardly any.
    fn shade(&self, ray: &March<'_>, grid: DVec3, color: Vec3, lights: &[Shine]) -> Vec3 {
        let gradient = self.gradient(ray.volume, grid);
        let material = ray.material;
        if gradient.length() <= self.least_gradient {
            let ambient = material.emission + ray.environment.ambient * color * material.ambient;
            return lights.iter().fold(ambient, |sum, l| sum + color * material.diffuse * l.radiance * 0.5);
        }
        let normal = (ray.normal_map * -gradient).normalize_or_zero().as_vec3();
        let normal = if normal.dot(ray.to_eye) < 0.0 { -normal } else { normal };
        let surface = Surface { material, color, normal, to_eye: ray.to_eye };
        let model: LightingModel = ray.environment.lighting;
        lights.iter().fold(surface.ambient(ray.environment), |sum, l| {
            sum + surface.lit_by(model, l.to_light, l.radiance)
        })
    }
}

/// Tells whether all values of a range are transparent.
fn is_clear(volume: &Volume, low: f32, high: f32) -> bool {
    let transfer = &volume.transfer;
    transfer.at(low).1 <= 0.0
        && transfer.at(high).1 <= 0.0
        && transfer.points.iter().all(|p| p.opacity <= 0.0 || p.value <= low || p.value >= high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use polyptych_core::scene::{Samples, TransferPoint};

    fn ball(clear_outside: bool) -> Volume {
        let n = 40u32;
        let mut values = Vec::new();
        for k in 0..n * n * n {
            let p = DVec3::new(f64::from(k % n), f64::from(k / n % n), f64::from(k / n / n)) + 0.5 - 20.0;
            values.push((14.0 - p.length()).max(0.0) as f32);
        }
        let mut volume = Volume::new([n; 3], DVec3::ONE, Samples::F32(values)).unwrap();
        let point = |value: f32, opacity: f32| TransferPoint { value, color: Vec3::ONE, opacity };
        volume.transfer.points = vec![point(0.5, if clear_outside { 0.0 } else { 1e-9 }), point(9.0, 0.4)];
        volume
    }

    fn gather(volume: &Volume, body: &VolumeBody) -> Vec<(u32, u32)> {
        let (material, environment) = (Material::default(), Environment::default());
        (0..200)
            .map(|i| {
                let target = DVec3::new(f64::from(i % 20) - 9.7, f64::from(i / 20) * 2.0 - 9.3, 0.0);
                let origin = DVec3::new(3.0, 5.0, 40.0);
                let direction = (target - origin).normalize_or(DVec3::NEG_Z);
                let ray = March {
                    volume,
                    material: &material,
                    environment: &environment,
                    origin,
                    direction,
                    step: 0.37,
                    object_per_world: 1.0,
                    normal_map: glam::DMat3::IDENTITY,
                    to_eye: -direction.as_vec3(),
                };
                let light = Shine { to_light: Vec3::Y, radiance: Vec3::ONE };
                let mut sum = Gathered::NOTHING;
                body.march(&ray, 15.0, 0..160, &[light], &mut sum);
                (sum.color.x.to_bits(), sum.transparency.to_bits())
            })
            .collect()
    }

    #[test]
    fn jumping_clear_bricks_changes_no_byte() {
        let volume = ball(true);
        let body = VolumeBody::new(&volume);
        assert!(body.clear.iter().filter(|c| **c).count() > 20, "some bricks are clear");
        let mut plain = VolumeBody::new(&volume);
        plain.clear.fill(false);
        assert_eq!(gather(&volume, &body), gather(&volume, &plain));
    }
}
