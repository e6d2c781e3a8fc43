//! A scalar field on a grid with a transfer function.

use super::form::FreeForm;
use super::material::color_text;
use crate::math::Aabb;
use glam::{DVec3, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A scalar field drawn directly: its samples lie at cell centers and are interpolated trilinearly.
///
/// The grid fills a box around the origin of object space with edges `size * spacing`; between the border of
/// the box and the outermost cell centers the field is constant.
#[derive(Clone, Debug)]
pub struct Volume {
    size: [u32; 3],
    spacing: DVec3,
    samples: Samples,
    range: [f32; 2],
    /// Turns field values into color and opacity.
    pub transfer: TransferFunction,
    /// Draws only what lies inside this form, given in the volume's object space.
    pub shell: Option<FreeForm>,
}

/// Field values, x fastest, then y, then z.
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "the names are the number formats")]
pub enum Samples {
    U8(Vec<u8>),
    I16(Vec<i16>),
    U16(Vec<u16>),
    F32(Vec<f32>),
}

impl Samples {
    /// Returns the number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(s) => s.len(),
            Self::I16(s) => s.len(),
            Self::U16(s) => s.len(),
            Self::F32(s) => s.len(),
        }
    }

    /// Tells whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns a sample.
    #[must_use]
    pub fn get(&self, index: usize) -> f32 {
        match self {
            Self::U8(s) => f32::from(s[index]),
            Self::I16(s) => f32::from(s[index]),
            Self::U16(s) => f32::from(s[index]),
            Self::F32(s) => s[index],
        }
    }

    /// Returns the bytes held.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        match self {
            Self::U8(s) => s.len() as u64,
            Self::I16(s) => s.len() as u64 * 2,
            Self::U16(s) => s.len() as u64 * 2,
            Self::F32(s) => s.len() as u64 * 4,
        }
    }
}

/// Piecewise linear color and opacity over the field's values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransferFunction {
    /// Support points by rising value; beyond the ends the first and last hold.
    pub points: Vec<TransferPoint>,
    /// The length, in object space, over which a point's opacity is reached.
    pub reference_length: f64,
}

/// Transfer functions with a name, for computed tomography in Hounsfield units.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TransferPreset {
    /// Skin and muscle thin and warm, bone white and dense.
    CtTissue,
    /// Bone alone.
    CtBone,
    /// The surface of the body.
    CtSkin,
    /// Vessels with contrast agent, red and thin, over bone.
    CtVessels,
}

/// One support point of a [`TransferFunction`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransferPoint {
    /// Field value.
    pub value: f32,
    /// Color, linear.
    #[serde(with = "color_text")]
    #[schemars(with = "color_text::ColorText")]
    pub color: Vec3,
    /// Opacity of a homogeneous layer as thick as the reference length, 0 to 1.
    pub opacity: f32,
}

impl TransferFunction {
    /// Returns a transfer function for computed tomography in Hounsfield units: air is empty, skin and muscle thin
    /// and warm, bone white and dense. The steps follow the scale: air -1000, fat -100, water 0, muscle 50, bone from 300.
    #[must_use]
    pub fn ct(reference_length: f64) -> Self {
        Self::preset(TransferPreset::CtTissue, reference_length)
    }

    /// Returns a transfer function by its name.
    #[must_use]
    pub fn preset(preset: TransferPreset, reference_length: f64) -> Self {
        let points: &[(f32, [f32; 3], f32)] = match preset {
            TransferPreset::CtTissue => &[
                (-500.0, [0.80, 0.45, 0.32], 0.0),
                (-250.0, [0.82, 0.50, 0.36], 0.02),
                (60.0, [0.78, 0.30, 0.22], 0.04),
                (180.0, [0.90, 0.70, 0.52], 0.10),
                (320.0, [0.95, 0.91, 0.82], 0.55),
                (1200.0, [1.0, 0.98, 0.94], 0.95),
            ],
            TransferPreset::CtBone => &[
                (180.0, [0.86, 0.72, 0.56], 0.0),
                (320.0, [0.95, 0.91, 0.82], 0.55),
                (1200.0, [1.0, 0.98, 0.94], 0.95),
            ],
            TransferPreset::CtSkin => &[
                (-600.0, [0.78, 0.52, 0.40], 0.0),
                (-350.0, [0.86, 0.60, 0.47], 0.35),
                (-100.0, [0.87, 0.62, 0.49], 0.80),
            ],
            TransferPreset::CtVessels => &[
                (120.0, [0.62, 0.10, 0.08], 0.0),
                (180.0, [0.75, 0.14, 0.10], 0.20),
                (300.0, [0.90, 0.55, 0.40], 0.45),
                (600.0, [0.97, 0.94, 0.88], 0.90),
            ],
        };
        let point =
            |&(value, color, opacity)| TransferPoint { value, color: Vec3::from_array(color), opacity };
        Self { points: points.iter().map(point).collect(), reference_length }
    }

    /// Returns color and opacity for a value; values that are not a number are empty.
    #[must_use]
    pub fn at(&self, value: f32) -> (Vec3, f32) {
        let points = &self.points;
        let after = points.partition_point(|p| p.value <= value);
        match (after.checked_sub(1).map(|i| points[i]), points.get(after)) {
            _ if value.is_nan() => (Vec3::ZERO, 0.0),
            (Some(a), Some(b)) => {
                let s = (value - a.value) / (b.value - a.value);
                (a.color.lerp(b.color, s), a.opacity + (b.opacity - a.opacity) * s)
            }
            (Some(end), None) | (None, Some(&end)) => (end.color, end.opacity),
            (None, None) => (Vec3::ZERO, 0.0),
        }
    }

    /// Returns the opacity of a sample that stands for `length` of a ray: `1 - (1 - opacity)^(length / reference)`.
    #[must_use]
    pub fn corrected_opacity(&self, opacity: f32, length: f64) -> f32 {
        if opacity >= 1.0 {
            return 1.0;
        }
        1.0 - (1.0 - opacity).powf((length / self.reference_length) as f32)
    }

    /// Returns the value at which opacity first passes half of its greatest: where a surface is seen.
    #[must_use]
    pub fn surface_value(&self) -> f32 {
        let half = self.points.iter().fold(0.0_f32, |m, p| m.max(p.opacity)) * 0.5;
        for pair in self.points.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            if a.opacity <= half && b.opacity > half {
                return a.value + (b.value - a.value) * (half - a.opacity) / (b.opacity - a.opacity);
            }
        }
        self.points.first().map_or(0.0, |p| p.value)
    }
}

impl Volume {
    /// Builds a volume; the transfer function starts as [`Volume::default_transfer`].
    ///
    /// # Errors
    /// When an edge is zero, the number of samples is not their product, or the spacing is not positive; the
    /// message says which. Samples that are not finite are kept and read as empty.
    pub fn new(size: [u32; 3], spacing: DVec3, samples: Samples) -> Result<Self, String> {
        let [nx, ny, nz] = size;
        if size.contains(&0) {
            return Err(format!("a volume needs at least one sample, got {nx}x{ny}x{nz}"));
        }
        let count = size.iter().map(|&s| u128::from(s)).product::<u128>();
        if samples.len() as u128 != count {
            return Err(format!("{} samples for {nx}x{ny}x{nz}", samples.len()));
        }
        if !(spacing.is_finite() && spacing.min_element() > 0.0) {
            return Err(format!("the spacing must be positive, got {spacing}"));
        }
        let mut range = [f32::INFINITY, f32::NEG_INFINITY];
        for value in (0..samples.len()).map(|i| samples.get(i)).filter(|v| v.is_finite()) {
            range = [range[0].min(value), range[1].max(value)];
        }
        if range[0] > range[1] {
            range = [0.0, 0.0];
        }
        let transfer = Self::default_transfer(range, spacing);
        Ok(Self { size, spacing, samples, range, transfer, shell: None })
    }

    /// Returns a transfer function for a field of unknown meaning: empty below a quarter of the range, then
    /// from warm and thin to white and dense.
    #[must_use]
    pub fn default_transfer(range: [f32; 2], spacing: DVec3) -> TransferFunction {
        let at = |share: f32| range[0] + (range[1] - range[0]) * share;
        let point = |share: f32, color: [f32; 3], opacity: f32| TransferPoint {
            value: at(share),
            color: Vec3::from_array(color),
            opacity,
        };
        TransferFunction {
            points: vec![
                point(0.22, [0.75, 0.45, 0.30], 0.0),
                point(0.30, [0.80, 0.50, 0.34], 0.05),
                point(0.45, [0.90, 0.72, 0.55], 0.30),
                point(0.70, [0.95, 0.92, 0.85], 0.80),
            ],
            reference_length: spacing.min_element(),
        }
    }

    /// Returns the number of samples along each axis.
    #[must_use]
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Returns the distance of neighboring samples along each axis.
    #[must_use]
    pub fn spacing(&self) -> DVec3 {
        self.spacing
    }

    /// Returns the field values.
    #[must_use]
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Returns the smallest and largest finite sample.
    #[must_use]
    pub fn range(&self) -> [f32; 2] {
        self.range
    }

    /// Bounds the grid's box.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let half = self.spacing * DVec3::from_array(self.size.map(f64::from)) * 0.5;
        Aabb::new(-half, half)
    }

    /// Returns the sample of a cell; indices outside are moved to the border.
    #[must_use]
    pub fn sample(&self, cell: [i64; 3]) -> f32 {
        let [x, y, z]: [usize; 3] =
            std::array::from_fn(|a| cell[a].clamp(0, i64::from(self.size[a]) - 1) as usize);
        self.samples.get((z * self.size[1] as usize + y) * self.size[0] as usize + x)
    }

    /// Returns where a point of object space lies on the grid, in cells from the first sample's center.
    #[must_use]
    pub fn grid_from_object(&self, point: DVec3) -> DVec3 {
        (point - self.bounds().min) / self.spacing - 0.5
    }

    /// Interpolates the field at a point of object space.
    #[must_use]
    pub fn value(&self, point: DVec3) -> f64 {
        let grid = self.grid_from_object(point);
        let base = grid.floor();
        let part = grid - base;
        let cell = [base.x as i64, base.y as i64, base.z as i64];
        let at =
            |dx: i64, dy: i64, dz: i64| f64::from(self.sample([cell[0] + dx, cell[1] + dy, cell[2] + dz]));
        let mix = |a: f64, b: f64, s: f64| a + (b - a) * s;
        let row = |dy: i64, dz: i64| mix(at(0, dy, dz), at(1, dy, dz), part.x);
        mix(mix(row(0, 0), row(1, 0), part.y), mix(row(0, 1), row(1, 1), part.y), part.z)
    }

    /// Returns the gradient of the field by central differences one spacing wide, in object space.
    #[must_use]
    pub fn gradient(&self, point: DVec3) -> DVec3 {
        let slope = |axis: DVec3, step: f64| {
            (self.value(point + axis * (step * 0.5)) - self.value(point - axis * (step * 0.5))) / step
        };
        DVec3::new(
            slope(DVec3::X, self.spacing.x * 2.0),
            slope(DVec3::Y, self.spacing.y * 2.0),
            slope(DVec3::Z, self.spacing.z * 2.0),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_leave_air_empty_and_show_what_they_are_named_after() {
        let opacity = |preset, value| TransferFunction::preset(preset, 1.0).at(value).1;
        use TransferPreset::{CtBone, CtSkin, CtTissue, CtVessels};
        for preset in [CtTissue, CtBone, CtSkin, CtVessels] {
            let transfer = TransferFunction::preset(preset, 1.0);
            assert!(transfer.points.is_sorted_by_key(|p| p.value), "{preset:?}");
            assert_eq!(opacity(preset, -1000.0), 0.0);
            assert!(opacity(preset, 1000.0) > 0.7);
        }
        // Muscle at 50, contrast agent at 250.
        assert_eq!([CtTissue, CtBone, CtSkin].map(|p| opacity(p, 50.0) > 0.0), [true, false, true]);
        assert_eq!([CtBone, CtVessels].map(|p| opacity(p, 170.0) > 0.0), [false, true]);
    }

    #[test]
    fn a_linear_field_is_interpolated_exactly() {
        let size = [4u32, 3, 5];
        let mut samples = Vec::new();
        for z in 0..5 {
            for y in 0..3 {
                for x in 0..4 {
                    samples.push((2 * x + 3 * y - z) as f32);
                }
            }
        }
        let volume = Volume::new(size, DVec3::new(1.0, 2.0, 0.5), Samples::F32(samples)).unwrap();
        let center = volume.value(DVec3::ZERO);
        assert!((center - (3.0 + 3.0 - 2.0)).abs() < 1e-12);
        let gradient = volume.gradient(DVec3::ZERO);
        assert!((gradient - DVec3::new(2.0, 1.5, -2.0)).length() < 1e-12, "{gradient}");
    }

    #[test]
    fn opacity_of_two_halves_is_the_opacity_of_the_whole() {
        let volume = Volume::new([1, 1, 1], DVec3::ONE, Samples::U8(vec![3])).unwrap();
        let half = volume.transfer.corrected_opacity(0.36, 0.5);
        assert!((1.0 - (1.0 - half) * (1.0 - half) - 0.36).abs() < 1e-6);
    }
}
