//! How much light comes from a volume along a stretch of a ray?
//!
//! `P = sum_n I_n a_n prod_{m<n} (1 - a_m)`, front to back, with opacities corrected for the length of a sample.
//! What is all transparent is jumped as far as it reaches: its samples would add exactly nothing, and the samples
//! beyond stand where they would have stood, so the picture is the same, byte for byte.
//!
//! Values lie in rows with two more at each end, so that one load brings the four values of a row that
//! interpolation and central differences want; twelve rows make a sample with its gradient. Samples that add
//! something are lit eight at once.

use glam::{DVec3, Mat3, Vec3, Vec4};
use polyptych_core::lanes::{F32x8, LANES, Mask8, Vec3x8};
use polyptych_core::scene::{Environment, Light, Material, Volume};
use polyptych_core::shade::{Surfaces, fogged};

/// Samples along the edge of a brick.
const BRICK: usize = 4;

/// Samples that are repeated at each border.
const BORDER: usize = 2;

/// Steps of the table of colors and opacities.
const TABLE: usize = 4096;

/// Transparency at which a ray ends.
pub(crate) const OPAQUE: f32 = 1.0 / 1024.0;

/// A volume, ready to be marched.
#[derive(Debug)]
pub(crate) struct VolumeBody {
    /// Values with their borders, x fastest.
    values: Vec<f32>,
    /// Samples along each axis, borders included.
    size: [usize; 3],
    bricks: [usize; 3],
    /// How many bricks around each, counting itself, are transparent in all directions; 0 where it is not.
    clear: Vec<u8>,
    table: Table,
    /// Smallest gradient that counts as a surface: a thousandth of the range over a spacing.
    least_gradient: f32,
    /// Distance of samples along a ray in object space.
    pub(crate) step: f64,
}

/// Colors with opacities of a sample, by value.
#[derive(Debug)]
struct Table {
    first: f32,
    per_value: f32,
    entries: Vec<Vec4>,
}

/// A light that reaches everything alike: volumes receive no shadow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shine {
    to_light: Vec3,
    radiance: Vec3,
}

impl Shine {
    /// Returns a light as it arrives at a place, if it does.
    pub(crate) fn arriving(light: &Light, at: DVec3) -> Option<Self> {
        let a = light.arriving(at)?;
        Some(Self { to_light: a.to_light.as_vec3(), radiance: a.radiance })
    }
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
    pub(crate) shines: &'a [Shine],
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    /// Step in world units.
    pub(crate) step: f64,
    /// Turns gradients of object space into normals of the world.
    pub(crate) normal_map: Mat3,
    pub(crate) to_eye: Vec3,
}

/// Samples that add something and wait to be lit.
struct Batch {
    count: usize,
    color: Vec3x8,
    gradient: Vec3x8,
    /// The share of each in what the eye sees.
    weight: [f32; LANES],
    distance: [f64; LANES],
}

const BLACK: Vec3x8 = Vec3x8 { x: F32x8::ZERO, y: F32x8::ZERO, z: F32x8::ZERO };

impl Table {
    /// Tabulates the transfer function for samples that stand for a length of the ray in object space.
    fn new(volume: &Volume, length: f64) -> Self {
        let transfer = &volume.transfer;
        let ends = transfer.points.first().zip(transfer.points.last());
        let (first, last) = ends.map_or((0.0, 1.0), |(a, b)| (a.value, b.value));
        let span = if last > first { last - first } else { 1.0 };
        let entry = |i: usize| {
            let (color, opacity) = transfer.at(first + span * (i as f32 / TABLE as f32));
            color.extend(transfer.corrected_opacity(opacity, length).max(0.0))
        };
        // One more, so that the last step has an end.
        let mut entries: Vec<Vec4> = (0..=TABLE).map(entry).collect();
        entries.push(entries[TABLE]);
        Self { first, per_value: TABLE as f32 / span, entries }
    }

    #[inline(always)]
    fn place(&self, value: f32) -> f32 {
        ((value - self.first) * self.per_value).max(0.0).min(TABLE as f32)
    }

    /// Returns color and opacity.
    #[inline(always)]
    fn at(&self, value: f32) -> Vec4 {
        let place = self.place(value);
        let i = place as i32;
        let [a, b] = [self.entries[i as usize], self.entries[i as usize + 1]];
        a + (b - a) * (place - i as f32)
    }

    /// Counts the entries before each that are not transparent.
    fn opaque_before(&self) -> Vec<u32> {
        let mut count = 0;
        let mut before = vec![0];
        before.extend(self.entries.iter().map(|e| {
            count += u32::from(e.w > 0.0);
            count
        }));
        before
    }
}

impl VolumeBody {
    /// Prepares a volume for samples so far apart, in units of the smallest spacing.
    pub(crate) fn new(volume: &Volume, step: f64) -> Self {
        let inner = volume.size().map(|s| s as usize);
        let size = inner.map(|s| s + 2 * BORDER);
        // What is not a number is empty: below everything.
        let empty = volume.range()[0];
        let mut values = Vec::with_capacity(size.iter().product());
        for z in 0..size[2] {
            for y in 0..size[1] {
                let within = |i: usize, axis: usize| i.clamp(BORDER, inner[axis] + 1) - BORDER;
                let row = (within(z, 2) * inner[1] + within(y, 1)) * inner[0];
                let sample = |x: usize| volume.samples().get(row + within(x, 0));
                values.extend((0..size[0]).map(sample).map(|v| if v.is_finite() { v } else { empty }));
            }
        }
        let range = volume.range()[1] - volume.range()[0];
        let step = step * volume.spacing().min_element();
        let mut body = Self {
            values,
            size,
            bricks: size.map(|s| s.div_ceil(BRICK)),
            clear: Vec::new(),
            table: Table::new(volume, step),
            least_gradient: 1e-3 * range / volume.spacing().max_element() as f32,
            step,
        };
        body.clear = body.find_clear();
        body
    }

    /// Returns what [`VolumeBody::bytes`] will be.
    pub(crate) fn planned_bytes(volume: &Volume) -> u64 {
        let size = volume.size().map(|s| u64::from(s) + 2 * BORDER as u64);
        let bricks: u64 = size.iter().map(|s| s.div_ceil(BRICK as u64)).product();
        size.iter().product::<u64>() * 4 + bricks + (TABLE as u64 + 2) * 16
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.values.len() as u64 * 4 + self.clear.len() as u64 + self.table.entries.len() as u64 * 16
    }

    /// Tells of each brick how far around it everything is transparent.
    fn find_clear(&self) -> Vec<u8> {
        let before = self.table.opaque_before();
        let [nx, ny, nz] = self.bricks;
        let mut clear = Vec::with_capacity(nx * ny * nz);
        for bz in 0..nz {
            for by in 0..ny {
                for bx in 0..nx {
                    let [low, high] = self.brick_range([bx, by, bz]);
                    // A value between two entries is mixed of both.
                    let first = self.table.place(low) as usize;
                    let last = self.table.place(high).ceil() as usize;
                    clear.push(u8::from(before[last + 1] == before[first]));
                }
            }
        }
        // Each round adds one to bricks whose neighbors all reached as far.
        for reach in 1..16 {
            let last = clear.clone();
            let mut grown = false;
            for bz in 0..nz {
                for by in 0..ny {
                    for bx in 0..nx {
                        let at = (bz * ny + by) * nx + bx;
                        if last[at] < reach {
                            continue;
                        }
                        let around = |b: usize, n: usize| b.saturating_sub(1)..(b + 2).min(n);
                        let all = around(bz, nz).all(|z| {
                            around(by, ny)
                                .all(|y| around(bx, nx).all(|x| last[(z * ny + y) * nx + x] >= reach))
                        });
                        if all {
                            clear[at] = reach + 1;
                            grown = true;
                        }
                    }
                }
            }
            if !grown {
                break;
            }
        }
        clear
    }

    /// Bounds the values that are interpolated in a brick.
    fn brick_range(&self, brick: [usize; 3]) -> [f32; 2] {
        let span = |axis: usize| {
            let first = brick[axis] * BRICK;
            first..(first + BRICK + 1).min(self.size[axis])
        };
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for z in span(2) {
            for y in span(1) {
                let row = (z * self.size[1] + y) * self.size[0];
                for &v in &self.values[row + span(0).start..row + span(0).end] {
                    (low, high) = (low.min(v), high.max(v));
                }
            }
        }
        [low, high]
    }

    /// Adds the samples `first..last` of a ray: sample `i` stands at `(i + 1/2) step`, counted from `begin`.
    pub(crate) fn march(
        &self,
        ray: &March<'_>,
        begin: f64,
        samples: std::ops::Range<u32>,
        sum: &mut Gathered,
    ) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            #[expect(
                unsafe_code,
                reason = "a kernel compiled for a processor feature can only be called so"
            )]
            // SAFETY: the processor has the feature that the kernel was compiled for; it was just asked.
            return unsafe { self.march_avx2(ray, begin, samples, sum) };
        }
        self.march_plain(ray, begin, samples, sum);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn march_avx2(&self, ray: &March<'_>, begin: f64, samples: std::ops::Range<u32>, sum: &mut Gathered) {
        self.march_plain(ray, begin, samples, sum);
    }

    #[inline(always)]
    fn march_plain(&self, ray: &March<'_>, begin: f64, samples: std::ops::Range<u32>, sum: &mut Gathered) {
        let volume = ray.volume;
        let middle = volume.grid_from_object(ray.origin + ray.direction * (begin + 0.5 * ray.step));
        let first = (middle + BORDER as f64).as_vec3();
        let step = (ray.direction * ray.step / volume.spacing()).as_vec3();
        let pace = step.recip();
        let last = Vec3::from_array(self.size.map(|s| s as f32 - 2.001));
        let mut batch =
            Batch { count: 0, color: BLACK, gradient: BLACK, weight: [0.0; LANES], distance: [0.0; LANES] };
        let mut i = samples.start;
        while i < samples.end && sum.transparency >= OPAQUE {
            let free = first + step * i as f32;
            let grid = free.max(Vec3::ONE).min(last);
            let sample = i;
            i += 1;
            let whole = grid.to_array().map(|g| g as i32);
            let base = whole.map(|w| w as usize);
            let reach = self.clear_around(base);
            if reach > 0 {
                i = i.saturating_add(jump(base, reach, free, step, pace));
                continue;
            }
            let place = Place::new(self, grid, whole, base);
            let (value, row) = place.value();
            let color = self.table.at(value);
            let alpha = color.w;
            if alpha <= 0.0 {
                continue;
            }
            let t = begin + (f64::from(sample) + 0.5) * ray.step;
            if let Some(shell) = &volume.shell
                && shell.form().value(ray.origin + ray.direction * t) < 0.0
            {
                continue;
            }
            let gradient = place.gradient(&row);
            batch.weight[batch.count] = sum.transparency * alpha;
            batch.distance[batch.count] = t;
            batch.color.set(batch.count, color.truncate());
            batch.gradient.set(batch.count, gradient);
            batch.count += 1;
            sum.transparency *= 1.0 - alpha;
            if sum.half.is_none() && sum.transparency <= 0.5 {
                sum.half = Some(t);
            }
            if batch.count == LANES {
                self.light(ray, &mut batch, sum);
            }
        }
        if batch.count > 0 {
            self.light(ray, &mut batch, sum);
        }
    }

    /// Tells how far around a sample everything is transparent, in bricks.
    #[inline(always)]
    fn clear_around(&self, base: [usize; 3]) -> u8 {
        let [x, y, z] = base.map(|b| b / BRICK);
        self.clear[(z * self.bricks[1] + y) * self.bricks[0] + x]
    }

    /// Lights samples by the gradient of the field, or evenly where there is hardly any, and adds them.
    #[inline(always)]
    fn light(&self, ray: &March<'_>, batch: &mut Batch, sum: &mut Gathered) {
        let (material, environment) = (ray.material, ray.environment);
        let spacing = (ray.volume.spacing() * 2.0).recip().as_vec3();
        let gradient = batch.gradient * Vec3x8::splat(spacing);
        let flat = F32x8::splat(self.least_gradient).at_least(gradient.length());
        let turn = |row: Vec3| Vec3x8::splat(-row).dot(gradient);
        let map = ray.normal_map.transpose();
        let normal = Vec3x8 { x: turn(map.x_axis), y: turn(map.y_axis), z: turn(map.z_axis) };
        let normal = normal.scaled(F32x8::splat(1.0) / normal.length()).finite();
        let to_eye = Vec3x8::splat(ray.to_eye);
        let away = F32x8::ZERO.above(normal.dot(to_eye));
        let normal = Vec3x8::pick(away, BLACK - normal, normal);
        let surfaces = Surfaces { material, color: batch.color, normal, to_eye };
        let ambient = Vec3x8::splat(environment.ambient * material.ambient);
        let mut lit = Vec3x8::splat(material.emission) + batch.color * ambient;
        for shine in ray.shines {
            let (to_light, radiance) = (Vec3x8::splat(shine.to_light), Vec3x8::splat(shine.radiance));
            let evenly = batch.color * radiance.scaled(F32x8::splat(material.diffuse * 0.5));
            let added = surfaces.lit_by(environment.lighting, to_light, radiance);
            lit = lit + Vec3x8::pick(flat, evenly, added);
        }
        let there = Mask8::first(batch.count);
        for i in 0..LANES {
            if there.has(i) {
                let color = match environment.fog {
                    Some(_) => fogged(environment, lit.get(i), batch.distance[i]),
                    None => lit.get(i),
                };
                sum.color += color * batch.weight[i];
            }
        }
        batch.count = 0;
    }
}

/// Returns how many samples more stand in the transparent box around a brick.
#[inline(always)]
fn jump(base: [usize; 3], reach: u8, grid: Vec3, step: Vec3, pace: Vec3) -> u32 {
    let reach = f32::from(reach);
    let mut count = f32::INFINITY;
    for axis in 0..3 {
        if step[axis] != 0.0 {
            let brick = (base[axis] / BRICK) as i32 as f32;
            let side = if step[axis] > 0.0 { brick + reach } else { brick + 1.0 - reach };
            count = count.min((side * BRICK as f32 - grid[axis]) * pace[axis]);
        }
    }
    // One sample less than the border: rounding never jumps over a brick that is not clear.
    if count < 1e9 { (count as u32).saturating_sub(1) } else { u32::MAX / 2 }
}

/// A sample between the values.
struct Place<'a> {
    /// From the value before and below in all axes on.
    values: &'a [f32],
    row: usize,
    plane: usize,
    part: Vec3,
}

/// The rows around a sample, interpolated across: for the sample and the planes before and behind it.
struct Rows {
    middle: Vec4,
    near: Vec4,
    far: Vec4,
}

impl<'a> Place<'a> {
    #[inline(always)]
    fn new(body: &'a VolumeBody, grid: Vec3, whole: [i32; 3], base: [usize; 3]) -> Self {
        let [x, y, z] = base;
        let (row, plane) = (body.size[0], body.size[0] * body.size[1]);
        let first = (z - 1) * plane + (y - 1) * row + x - 1;
        let part = grid - Vec3::from_array(whole.map(|w| w as f32));
        Self { values: &body.values[first..first + 3 * plane + 3 * row + 4], row, plane, part }
    }

    /// Returns the four values of a row, counted from the one before the sample's.
    #[inline(always)]
    fn row(&self, y: usize, z: usize) -> Vec4 {
        Vec4::from_slice(&self.values[z * self.plane + y * self.row..])
    }

    #[inline(always)]
    fn between(&self, z: usize) -> Vec4 {
        let (a, b) = (self.row(1, z), self.row(2, z));
        a + (b - a) * self.part.y
    }

    /// Returns the value, and the rows that the gradient wants too.
    #[inline(always)]
    fn value(&self) -> (f32, Rows) {
        let (near, far) = (self.between(1), self.between(2));
        let middle = near + (far - near) * self.part.z;
        (self.along(middle), Rows { middle, near, far })
    }

    /// Interpolates the middle of a row.
    #[inline(always)]
    fn along(&self, row: Vec4) -> f32 {
        row.y + (row.z - row.y) * self.part.x
    }

    /// Returns the differences of the values one sample behind and one before, along each axis.
    #[inline(always)]
    fn gradient(&self, rows: &Rows) -> Vec3 {
        let [x, y, z] = self.part.to_array();
        let r = rows.middle;
        let along_x = (r.z + (r.w - r.z) * x) - (r.x + (r.y - r.x) * x);
        let rise = |z: usize| {
            let (a, b) = (self.row(2, z) - self.row(0, z), self.row(3, z) - self.row(1, z));
            a + (b - a) * y
        };
        let (a, b) = (rise(1), rise(2));
        let along_y = self.along(a + (b - a) * z);
        let (a, b) = (rows.far - self.between(0), self.between(3) - rows.near);
        Vec3::new(along_x, along_y, self.along(a + (b - a) * z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use polyptych_core::scene::{Material, Samples, TransferPoint};

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
                    shines: &[Shine { to_light: Vec3::Y, radiance: Vec3::ONE }],
                    origin,
                    direction,
                    step: 0.37,
                    normal_map: Mat3::IDENTITY,
                    to_eye: -direction.as_vec3(),
                };
                let mut sum = Gathered::NOTHING;
                body.march(&ray, 15.0, 0..160, &mut sum);
                (sum.color.x.to_bits(), sum.transparency.to_bits())
            })
            .collect()
    }

    #[test]
    fn jumping_clear_bricks_changes_no_byte() {
        let volume = ball(true);
        let body = VolumeBody::new(&volume, 0.37);
        assert!(body.clear.iter().filter(|c| **c > 1).count() > 20, "some bricks are clear");
        let mut plain = VolumeBody::new(&volume, 0.37);
        plain.clear.fill(0);
        assert_eq!(gather(&volume, &body), gather(&volume, &plain));
    }
}
