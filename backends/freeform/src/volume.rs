//! What is kept of a volume, so that rays can be marched through it?
//!
//! Values lie in rows with two more at each end, so that one load brings the four values of a row that
//! interpolation and central differences want. Bricks of samples know how far around them everything is transparent.
//! Coarser levels, of averages of eight samples, are for volumes of which many samples are in a pixel.

use crate::form::FormBody;
use glam::{DVec3, Vec3, Vec4};
use polyptych_core::lanes::{F32x8, LANES, Mask8, Vec3x8};
use polyptych_core::scene::Volume;

/// Samples that are repeated at each border.
pub(crate) const BORDER: usize = 2;

/// Steps of the table of colors and opacities.
const TABLE: usize = 4096;

/// How volumes are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drawing {
    /// Step in units of the smallest spacing.
    pub(crate) step: f64,
    /// Whether gradients are kept for each sample.
    pub(crate) keeps_gradients: bool,
    /// Whether there are coarser levels.
    pub(crate) has_levels: bool,
    /// Whether they are drawn as the surface where their opacity passes half of its greatest.
    pub(crate) as_surface: bool,
}

impl Drawing {
    #[cfg(test)]
    pub(crate) fn with_step(step: f64) -> Self {
        Self { step, keeps_gradients: false, has_levels: false, as_surface: false }
    }
}

/// A volume, ready to be marched.
#[derive(Debug)]
pub(crate) struct VolumeBody {
    /// The samples as they are, and coarser ones.
    pub(crate) levels: Vec<Level>,
    /// The form that holds what is drawn.
    pub(crate) shell: Option<FormBody>,
    /// The value of which the surface is drawn, where only that is.
    pub(crate) surface: Option<f32>,
}

/// Samples of one size.
#[derive(Debug)]
pub(crate) struct Level {
    /// Values with their borders, x fastest.
    pub(crate) values: Vec<f32>,
    /// Differences of the values behind and before each, where they are kept.
    pub(crate) gradients: Vec<Vec4>,
    /// Samples along each axis, borders included.
    pub(crate) size: [usize; 3],
    pub(crate) bricks: [usize; 3],
    /// How many bricks around each, counting itself, are transparent in all directions; 0 where it is not.
    pub(crate) clear: Vec<u8>,
    pub(crate) table: Table,
    /// Smallest gradient that counts as a surface: a thousandth of the range over a spacing.
    pub(crate) least_gradient: f32,
    pub(crate) spacing: DVec3,
    /// The corner of the volume's box.
    pub(crate) corner: DVec3,
    /// Distance of samples along a ray in object space.
    pub(crate) step: f64,
}

/// Colors with opacities of a sample, by value.
#[derive(Debug)]
pub(crate) struct Table {
    first: f32,
    per_value: f32,
    entries: Vec<Vec4>,
    /// The opacities alone: less memory to look them up in.
    opacities: Vec<f32>,
}

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
        let opacities = entries.iter().map(|e| e.w).collect();
        Self { first, per_value: TABLE as f32 / span, entries, opacities }
    }

    #[inline(always)]
    fn places(&self, value: F32x8) -> F32x8 {
        let place = (value - F32x8::splat(self.first)) * F32x8::splat(self.per_value);
        place.max(F32x8::ZERO).min(F32x8::splat(TABLE as f32))
    }

    /// Returns opacities.
    #[inline(always)]
    pub(crate) fn opacities(&self, value: F32x8) -> F32x8 {
        let place = self.places(value);
        let whole = place.nearest_below();
        let (mut a, mut b) = (F32x8::ZERO, F32x8::ZERO);
        for i in 0..LANES {
            let pair = &self.opacities[whole.0[i] as usize..];
            (b.0[i], a.0[i]) = (pair[1], pair[0]);
        }
        a + (b - a) * (place - whole.to_f32())
    }

    /// Returns colors where they are wanted.
    #[inline(always)]
    pub(crate) fn colors(&self, value: F32x8, wanted: Mask8) -> Vec3x8 {
        let place = self.places(value);
        let whole = place.nearest_below();
        let share = place - whole.to_f32();
        let mut colors = Vec3x8::splat(Vec3::ZERO);
        for i in 0..LANES {
            if wanted.has(i) {
                let pair = &self.entries[whole.0[i] as usize..];
                let (b, a) = (pair[1], pair[0]);
                colors.set(i, (a + (b - a) * share.0[i]).truncate());
            }
        }
        colors
    }

    fn place(&self, value: f32) -> f32 {
        ((value - self.first) * self.per_value).clamp(0.0, TABLE as f32)
    }

    /// Counts the entries before each that are not transparent.
    fn opaque_before(&self) -> Vec<u32> {
        let mut count = 0;
        let mut before = vec![0];
        before.extend(self.opacities.iter().map(|&opacity| {
            count += u32::from(opacity > 0.0);
            count
        }));
        before
    }
}

impl VolumeBody {
    /// Prepares a volume.
    pub(crate) fn new(volume: &Volume, drawing: Drawing) -> Self {
        let mut levels = vec![Level::first(volume, drawing.step)];
        while drawing.has_levels
            && let Some(next) = levels.last().and_then(|fine| fine.halved(volume))
        {
            levels.push(next);
        }
        for i in 0..levels.len() {
            let (fine, coarse) = levels.split_at_mut(i + 1);
            fine[i].clear = fine[i].find_clear(coarse.first());
            if drawing.keeps_gradients {
                fine[i].gradients = fine[i].find_gradients();
            }
        }
        let surface = drawing.as_surface.then(|| volume.transfer.surface_value());
        Self { levels, shell: volume.shell.as_ref().map(FormBody::new), surface }
    }

    /// Returns what [`VolumeBody::bytes`] will be.
    pub(crate) fn planned_bytes(volume: &Volume, drawing: Drawing) -> u64 {
        let mut inner = volume.size().map(u64::from);
        let mut bytes = volume.shell.as_ref().map_or(0, |shell| FormBody::new(shell).bytes());
        loop {
            let size = inner.map(|s| s + 2 * BORDER as u64);
            let bricks: u64 = size.iter().map(|s| s.div_ceil(Level::BRICK as u64)).product();
            let each = if drawing.keeps_gradients { 20 } else { 4 };
            bytes += size.iter().product::<u64>() * each + bricks + (TABLE as u64 + 2) * 20;
            if !drawing.has_levels || inner == [1; 3] {
                return bytes;
            }
            inner = inner.map(|s| s.div_ceil(2));
        }
    }

    pub(crate) fn bytes(&self) -> u64 {
        let levels: usize = self
            .levels
            .iter()
            .map(|l| {
                l.values.len() * 4 + l.gradients.len() * 16 + l.clear.len() + l.table.opacities.len() * 20
            })
            .sum();
        levels as u64 + self.shell.as_ref().map_or(0, FormBody::bytes)
    }
}

impl Level {
    /// Samples along the edge of a brick, as a power of two.
    pub(crate) const BRICK_BITS: i32 = 2;
    const BRICK: usize = 1 << Self::BRICK_BITS;

    /// Takes the samples as they are, for steps in units of the smallest spacing.
    fn first(volume: &Volume, step: f64) -> Self {
        // What is not a number is empty: below everything.
        let empty = volume.range()[0];
        let inner = volume.size().map(|s| s as usize);
        let sample = |[x, y, z]: [usize; 3]| {
            let value = volume.samples().get((z * inner[1] + y) * inner[0] + x);
            if value.is_finite() { value } else { empty }
        };
        let step = step * volume.spacing().min_element();
        Self::new(volume, inner, volume.spacing(), step, sample)
    }

    /// Takes averages of eight samples each; nothing where one is left.
    fn halved(&self, volume: &Volume) -> Option<Self> {
        let fine = self.size.map(|s| s - 2 * BORDER);
        if fine == [1; 3] {
            return None;
        }
        let [row, plane] = [self.size[0], self.size[0] * self.size[1]];
        let average = |cell: [usize; 3]| {
            // The last of an odd number is repeated, as it is beyond the border.
            let at = |axis: usize, d: usize| BORDER + (cell[axis] * 2 + d).min(fine[axis] - 1);
            let value =
                |k: usize| self.values[at(2, k >> 2) * plane + at(1, k >> 1 & 1) * row + at(0, k & 1)];
            (0..8).map(value).sum::<f32>() * 0.125
        };
        let size = fine.map(|s| s.div_ceil(2));
        Some(Self::new(volume, size, self.spacing * 2.0, self.step * 2.0, average))
    }

    fn new(
        volume: &Volume,
        inner: [usize; 3],
        spacing: DVec3,
        step: f64,
        sample: impl Fn([usize; 3]) -> f32,
    ) -> Self {
        let size = inner.map(|s| s + 2 * BORDER);
        let mut values = Vec::with_capacity(size.iter().product());
        let within = |i: usize, axis: usize| i.clamp(BORDER, inner[axis] + 1) - BORDER;
        for z in 0..size[2] {
            for y in 0..size[1] {
                values.extend((0..size[0]).map(|x| sample([within(x, 0), within(y, 1), within(z, 2)])));
            }
        }
        let range = volume.range()[1] - volume.range()[0];
        Self {
            values,
            gradients: Vec::new(),
            size,
            bricks: size.map(|s| s.div_ceil(Self::BRICK)),
            clear: Vec::new(),
            table: Table::new(volume, step),
            least_gradient: 1e-3 * range / volume.spacing().max_element() as f32,
            spacing,
            corner: volume.bounds().min,
            step,
        }
    }

    /// Returns the differences of the values behind and before each, along each axis.
    fn find_gradients(&self) -> Vec<Vec4> {
        let [nx, ny, nz] = self.size;
        let mut gradients = Vec::with_capacity(self.values.len());
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    let at = |[x, y, z]: [usize; 3]| self.values[(z * ny + y) * nx + x];
                    let next = |i: usize, n: usize| (i + 1).min(n - 1);
                    let along_x = at([next(x, nx), y, z]) - at([x.saturating_sub(1), y, z]);
                    let along_y = at([x, next(y, ny), z]) - at([x, y.saturating_sub(1), z]);
                    let along_z = at([x, y, next(z, nz)]) - at([x, y, z.saturating_sub(1)]);
                    gradients.push(Vec4::new(along_x, along_y, along_z, 0.0));
                }
            }
        }
        gradients
    }

    /// Tells of each brick how far around it everything is transparent, here and in the next coarser level.
    fn find_clear(&self, coarser: Option<&Self>) -> Vec<u8> {
        let before = self.table.opaque_before();
        let [nx, ny, nz] = self.bricks;
        let mut clear = Vec::with_capacity(nx * ny * nz);
        for bz in 0..nz {
            for by in 0..ny {
                for bx in 0..nx {
                    let [low, high] = self.brick_range([bx, by, bz], coarser);
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

    /// Bounds the values that are interpolated in a brick, also on the way to the next coarser level.
    fn brick_range(&self, brick: [usize; 3], coarser: Option<&Self>) -> [f32; 2] {
        let first = brick.map(|b| b * Self::BRICK);
        let last = std::array::from_fn(|axis| (first[axis] + Self::BRICK).min(self.size[axis] - 1));
        let [low, high] = self.range(first, last);
        let Some(coarser) = coarser else { return [low, high] };
        let below = first.map(|i| (i / 2).max(1));
        let above = std::array::from_fn(|axis| (last[axis] / 2 + 3).min(coarser.size[axis] - 1));
        let below = std::array::from_fn(|axis| below[axis].min(above[axis]) - 1);
        let [coarse_low, coarse_high] = coarser.range(below, above);
        [low.min(coarse_low), high.max(coarse_high)]
    }

    /// Bounds the values of a box, first and last included.
    fn range(&self, first: [usize; 3], last: [usize; 3]) -> [f32; 2] {
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                let row = (z * self.size[1] + y) * self.size[0];
                for &v in &self.values[row + first[0]..=row + last[0]] {
                    (low, high) = (low.min(v), high.max(v));
                }
            }
        }
        [low, high]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::march::{Gathered, March, Shine};
    use glam::Mat3;
    use polyptych_core::lanes::{DVec3x8, F64x8, I32x8};
    use polyptych_core::scene::{Environment, Light, Material, Samples, TransferPoint};

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

    /// Marches rays from one place, eight at once; `apart` marches each by itself.
    fn gather(body: &VolumeBody, apart: bool) -> Vec<(u32, u32)> {
        let (material, environment) = (Material::default(), Environment::default());
        let shine = Shine::arriving(&Light::directional(DVec3::NEG_Y), DVec3::ZERO).unwrap();
        let origin = DVec3::new(3.0, 5.0, 40.0);
        let mut all = Vec::new();
        for octet in 0..25 {
            let mut direction = DVec3x8::splat(DVec3::NEG_Z);
            for lane in 0..LANES {
                let i = octet * LANES + lane;
                let target = DVec3::new((i % 20) as f64 - 9.7, (i / 20) as f64 * 2.0 - 9.3, 0.0);
                direction.set(lane, (target - origin).normalize_or(DVec3::NEG_Z));
            }
            let march = March {
                level: &body.levels[0],
                coarser: None,
                material: &material,
                environment: &environment,
                shines: &[shine],
                origin: DVec3x8::splat(origin),
                direction,
                enter: F64x8::splat(15.0),
                step: F64x8::splat(0.37),
                normal_map: Mat3::IDENTITY,
                to_eye: direction.scaled(F64x8::splat(-1.0)).round(),
            };
            let mut sum = Gathered::NOTHING;
            let samples = [I32x8::splat(0), I32x8::splat(160)];
            for lane in 0..LANES {
                let mut own = Mask8::NONE;
                own.0[lane] = u32::MAX;
                match (apart, lane) {
                    (true, _) => march.run(samples, own, &mut sum),
                    (false, 0) => march.run(samples, Mask8::ALL, &mut sum),
                    _ => {}
                }
            }
            let bits = |lane: usize| (sum.color.x.0[lane].to_bits(), sum.transparency.0[lane].to_bits());
            all.extend((0..LANES).map(bits));
        }
        all
    }

    #[test]
    fn jumping_clear_bricks_changes_no_byte() {
        let volume = ball(true);
        let body = VolumeBody::new(&volume, Drawing::with_step(0.37));
        let clear = &body.levels[0].clear;
        assert!(clear.iter().filter(|c| **c > 1).count() > 20, "some bricks are clear");
        let mut plain = VolumeBody::new(&volume, Drawing::with_step(0.37));
        plain.levels[0].clear.fill(0);
        assert_eq!(gather(&body, false), gather(&plain, false));
    }

    #[test]
    fn rays_that_share_registers_change_no_byte_of_each_other() {
        let body = VolumeBody::new(&ball(true), Drawing::with_step(0.37));
        let together = gather(&body, false);
        assert!(together.iter().filter(|(color, _)| *color > 0).count() > 50);
        assert_eq!(together, gather(&body, true));
    }

    #[test]
    fn gradients_that_are_kept_light_as_those_that_are_not() {
        let volume = ball(true);
        let found = gather(&VolumeBody::new(&volume, Drawing::with_step(0.37)), false);
        let drawing = Drawing { keeps_gradients: true, ..Drawing::with_step(0.37) };
        let kept = gather(&VolumeBody::new(&volume, drawing), false);
        for ((a, transparency), (b, same)) in found.into_iter().zip(kept) {
            assert_eq!(transparency, same);
            assert!((f32::from_bits(a) - f32::from_bits(b)).abs() < 2e-5);
        }
    }

    #[test]
    fn coarser_levels_are_averages_up_to_a_single_sample() {
        let samples = (0..5 * 4 * 3).map(|i| (i % 5 * 2 + i / 5 % 4) as f32).collect();
        let volume = Volume::new([5, 4, 3], DVec3::ONE, Samples::F32(samples)).unwrap();
        let drawing = Drawing { has_levels: true, ..Drawing::with_step(0.5) };
        let body = VolumeBody::new(&volume, drawing);
        let sizes: Vec<_> = body.levels.iter().map(|l| l.size.map(|s| s - 2 * BORDER)).collect();
        assert_eq!(sizes, [[5, 4, 3], [3, 2, 2], [2, 1, 1], [1, 1, 1]]);
        let second = &body.levels[1];
        let at = |x: usize, y: usize| {
            second.values[(BORDER * second.size[1] + y + BORDER) * second.size[0] + x + BORDER]
        };
        assert_eq!([at(0, 0), at(1, 0), at(2, 0), at(0, 1)], [1.5, 5.5, 8.5, 3.5]);
        assert_eq!(body.bytes(), VolumeBody::planned_bytes(&volume, drawing));
    }
}
