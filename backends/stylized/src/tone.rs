//! Which color has a surface that faces the light so much?

use glam::Vec3;
use polyptych_core::lanes::{F32x8, LANES, Mask8, Vec3x8};

/// Two colors and how they are mixed, linear light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// Color of surfaces that face away from the light.
    pub cool: Vec3,
    /// Color of surfaces that face the light.
    pub warm: Vec3,
    /// Share of the surface's own color on the cool side.
    pub alpha: f32,
    /// Share of the surface's own color on the warm side.
    pub beta: f32,
    /// Number of steps of the color's length; 1 leaves it smooth.
    pub steps: u32,
}

impl Tone {
    /// Returns the tone of a surface of base color `own` whose normal and light enclose the cosine `facing`.
    ///
    /// `I = t (warm + beta own) + (1 - t) (cool + alpha own)` with `t = (1 + facing) / 2`; then, with more than one
    /// step, the length `|I|` is rounded to `round(n |I|) / n`.
    ///
    /// ```
    /// use glam::Vec3;
    /// # use polyptych_stylized::Tone;
    /// let tone = Tone { cool: Vec3::Z * 0.5, warm: Vec3::X * 0.5, alpha: 0.25, beta: 0.5, steps: 1 };
    /// assert_eq!(tone.color(Vec3::Y, 1.0), Vec3::new(0.5, 0.5, 0.0));
    /// assert_eq!(tone.color(Vec3::Y, -1.0), Vec3::new(0.0, 0.25, 0.5));
    /// ```
    #[must_use]
    pub fn color(&self, own: Vec3, facing: f32) -> Vec3 {
        let t = (1.0 + facing.clamp(-1.0, 1.0)) * 0.5;
        let smooth = (self.warm + own * self.beta) * t + (self.cool + own * self.alpha) * (1.0 - t);
        if self.steps <= 1 {
            return smooth;
        }
        let length = smooth.length();
        if length <= 0.0 {
            return smooth;
        }
        let n = self.steps as f32;
        smooth * ((length * n).round() / (n * length))
    }

    /// Returns eight tones, the edges of steps as wide as a pixel: by `slope`, how much the cosine to the light changes
    /// over one. Where it does not change, and a pixel or more away from edges, these are those of [`Tone::color`].
    ///
    /// With `s = n |I|` an edge is where `s` passes a half; `ds = n (I . dI/dt) / |I| dt`, and `dt` is half the slope.
    #[inline(always)]
    pub(crate) fn colors(&self, own: Vec3x8, facing: F32x8, slope: F32x8) -> Vec3x8 {
        let (zero, one, half) = (F32x8::ZERO, F32x8::splat(1.0), F32x8::splat(0.5));
        let t = (one + facing) * half;
        let cool = Vec3x8::splat(self.cool) + own.scaled(F32x8::splat(self.alpha));
        let warm = Vec3x8::splat(self.warm) + own.scaled(F32x8::splat(self.beta));
        let smooth = warm.scaled(t) + cool.scaled(one - t);
        if self.steps <= 1 {
            return smooth;
        }
        let n = F32x8::splat(self.steps as f32);
        let length = smooth.length();
        let s = length * n;
        let inverse = one / length.max(F32x8::splat(1e-12));
        let change = smooth.dot(warm - cool).abs() * n * half * slope * inverse;
        let mut below = s;
        for i in 0..LANES {
            below.0[i] = s.0[i].floor();
        }
        let beyond = (s - below - half) / change.max(F32x8::splat(1e-6)) + half;
        let step = below + beyond.max(zero).min(one);
        let there: Mask8 = s.above(zero);
        smooth.scaled(there.pick(step * inverse * F32x8::splat(1.0 / self.steps as f32), zero))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_leave_a_countable_number_of_lengths() {
        let tone = Tone { cool: Vec3::ZERO, warm: Vec3::splat(1.0), alpha: 0.0, beta: 0.0, steps: 3 };
        let mut lengths: Vec<u32> = (0..=1000)
            .map(|i| (tone.color(Vec3::ONE, i as f32 / 500.0 - 1.0).length() * 3.0).round() as u32)
            .collect();
        lengths.dedup();
        assert_eq!(lengths, [0, 1, 2, 3, 4, 5], "white is sqrt(3) long: five steps and black");
    }
}
