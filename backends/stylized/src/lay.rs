//! How do highlights and strokes get onto eight pixels?

use crate::eight::{Eight, Seen, difference};
use crate::hatch::{EDGE, Hatching, Sticks};
use crate::look::Look;
use crate::paint::Painting;
use crate::style::{Highlight, Style};
use glam::{Mat3, Vec3};
use polyptych_core::camera::Projection;
use polyptych_core::lanes::{F32x8, I32x8, LANES, Mask8, Vec3x8};
use polyptych_core::shade::{highlight, highlights};

impl Painting<'_> {
    /// Adds highlights.
    #[inline(always)]
    pub(crate) fn shine(
        &self,
        style: &Style,
        eight: &Eight<'_>,
        normal: Vec3x8,
        cosine: F32x8,
        color: Vec3x8,
    ) -> Vec3x8 {
        let Eight { x, y, count, ref seen, direction } = *eight;
        let ids = seen.ids;
        let zero = F32x8::ZERO;
        if !cosine.above(zero).any() {
            return color;
        }
        let look = |id: u32| &self.looks[(id.wrapping_sub(1) as usize).min(self.looks.len() - 1)];
        let first_look = look(ids[0].max(1));
        let mut strength = F32x8::splat(first_look.specular);
        let mut faint = F32x8::splat(first_look.faint);
        let mut shininess = [first_look.shininess; LANES];
        if difference::<LANES>(ids, ids[0]) != 0 {
            for (lane, id) in ids.iter().enumerate() {
                let look = look((*id).max(1));
                (strength.0[lane], faint.0[lane], shininess[lane]) =
                    (look.specular, look.faint, look.shininess);
            }
        }
        if !strength.above(zero).any() {
            return color;
        }
        let directions = if self.light.uniform.is_some() { None } else { self.view.row(y) };
        let toward = self.toward(x as usize, y, seen, directions.as_ref());
        let between = toward - direction;
        let half = between.dot(normal) / between.length().max(F32x8::splat(f32::MIN_POSITIVE));
        let faces = cosine.above(zero) & half.above(faint);
        if !faces.any() {
            return color;
        }
        let power = powers(half.max(zero), &shininess);
        let lit = if style.shadow { F32x8::new(*seen.shadow) } else { F32x8::splat(1.0) };
        let share = match style.highlight {
            Highlight::Off => return color,
            Highlight::Soft => power * strength * lit,
            Highlight::Hard => {
                // The edge is where half of the light is left, as wide as a pixel by the change to the neighbor.
                let mut change = zero;
                for lane in 0..LANES {
                    let beside = if lane + 1 < count { lane + 1 } else { lane.saturating_sub(1) };
                    change.0[lane] = (power.0[beside] - power.0[lane]).abs();
                }
                let half = F32x8::splat(0.5);
                let over = (power - half) / change.max(F32x8::splat(1e-3)) + half;
                let full = (strength * F32x8::splat(2.5)).min(F32x8::splat(1.0));
                over.max(zero).min(F32x8::splat(1.0)) * full * lit
            }
        };
        color + Vec3x8::splat(style.highlight_color).scaled(faces.pick(share, zero))
    }

    /// Lays strokes on.
    #[inline(always)]
    pub(crate) fn hatch(
        &self,
        hatching: &Hatching,
        style: &Style,
        eight: &Eight<'_>,
        origin: Vec3x8,
        (own, coded, normal, cosine): (Vec3x8, Vec3x8, Vec3x8, F32x8),
        color: Vec3x8,
    ) -> Vec3x8 {
        let Eight { x, y, seen: Seen { ids, distance, .. }, direction, .. } = *eight;
        let (one, half) = (F32x8::splat(1.0), F32x8::splat(0.5));
        let mut light = (one + cosine) * half;
        if hatching.texture > 0.0 {
            let luminance = own.dot(Vec3x8::splat(Vec3::new(0.2126, 0.7152, 0.0722)));
            let dark = one - luminance.max(F32x8::ZERO).min(one).sqrt();
            light = light * (one - dark * F32x8::splat(hatching.texture));
        }
        let darkness = one - light;
        if !darkness.above(F32x8::splat(hatching.lightest)).any() {
            return color;
        }
        let mut ink = F32x8::ZERO;
        if hatching.sticks == Sticks::Screen {
            let scale = F32x8::splat(1.0 / (EDGE as f32 * hatching.scale));
            let u = I32x8::count_from(x as i32).to_f64().round() * scale;
            let v = F32x8::splat(y as f32) * scale;
            ink = hatching.ink(u, v, F32x8::splat(1.0 / hatching.scale), darkness);
        } else {
            let distance = F32x8::new(*distance);
            let place = origin + direction.scaled(distance);
            let pixel = self.view.pixel_size(1.0) as f32;
            let is_parallel = matches!(self.camera.projection, Projection::Orthographic { .. });
            let pixels = if is_parallel { F32x8::splat(pixel) } else { distance * F32x8::splat(pixel) };
            let mut lane = 0;
            // Run by run of one object.
            while lane < LANES {
                let id = ids[lane];
                let mut end = if difference::<LANES>(ids, id) == 0 { LANES } else { lane + 1 };
                while end < LANES && ids[end] == id {
                    end += 1;
                }
                let index = (id.wrapping_sub(1) as usize).min(self.looks.len() - 1);
                if id != 0 {
                    let look = &self.looks[index];
                    let coordinates = (hatching.sticks == Sticks::Uv && look.is_coded).then_some(coded);
                    let run = Run { look, lanes: lane..end, place, normal, pixels, coordinates };
                    run.ink(hatching, darkness, &mut ink);
                }
                lane = end;
            }
        }
        if style.paper.grain > 0.0 {
            // Strokes skip the valleys of the paper.
            let valley = one - self.grain.at(x, y);
            ink = ink * (one - valley * F32x8::splat(0.9 * style.paper.grain));
        }
        let stroke =
            Vec3x8::splat(hatching.color * (1.0 - hatching.own)) + own.scaled(F32x8::splat(hatching.own));
        let share = ink * F32x8::splat(hatching.opacity);
        color.scaled(one - share) + stroke.scaled(share)
    }
}

/// Neighboring pixels of one object.
struct Run<'a> {
    look: &'a Look,
    lanes: std::ops::Range<usize>,
    /// Relative to the eye.
    place: Vec3x8,
    normal: Vec3x8,
    /// Edge of a pixel there.
    pixels: F32x8,
    coordinates: Option<Vec3x8>,
}

impl Run<'_> {
    /// Returns how much strokes cover of the pixels.
    #[inline(always)]
    fn ink(self, hatching: &Hatching, darkness: F32x8, ink: &mut F32x8) {
        let Self { look, lanes, place, normal, pixels, coordinates } = self;
        let texels = pixels * F32x8::splat(look.repeats * EDGE as f32);
        let mut covered;
        if let Some(coordinates) = coordinates {
            // A texture is taken to be laid once around the body: six periods.
            let scale = F32x8::splat(6.0 / hatching.scale);
            let (u, v) = (coordinates.x * scale, coordinates.y * scale);
            // By how much they change to the neighbor: how wide a pixel is in the pattern.
            let mut density = texels;
            for lane in lanes.clone().filter(|_| lanes.len() > 1) {
                let beside = if lane + 1 < lanes.end { lane + 1 } else { lane - 1 };
                let change = (u.0[beside] - u.0[lane]).hypot(v.0[beside] - v.0[lane]);
                if change > 0.0 && change < 0.25 {
                    density.0[lane] = change * EDGE as f32;
                }
            }
            covered = hatching.ink(u, v, density, darkness);
        } else {
            let p = turned(&look.pattern, place) + Vec3x8::splat(look.eye);
            let n = turned(&look.turn, normal);
            let weights = [n.x.abs(), n.y.abs(), n.z.abs()];
            // Along the axis that the surface faces most, and mixed with the next where they are much alike.
            let (zero, most) = (F32x8::ZERO, weights[0].max(weights[1]).max(weights[2]));
            let least = weights[0].min(weights[1]).min(weights[2]);
            let next = weights[0] + weights[1] + weights[2] - most - least;
            let mix = ((next - most * F32x8::splat(0.85))
                / (most * F32x8::splat(0.3)).max(F32x8::splat(1e-20)))
            .max(zero)
            .min(F32x8::splat(0.5));
            let planes = Planes { u: [p.z, p.x, p.x], v: [-p.y, p.z, -p.y] };
            let is_x = weights[0].at_least(most);
            let is_y = weights[1].at_least(most) & !is_x;
            let [u, v] = planes.across(is_x, is_y);
            covered = hatching.ink(u, v, texels, darkness) * (F32x8::splat(1.0) - mix);
            if mix.above(zero).any() {
                // Neither that axis nor the one that it faces least.
                let is_x = !is_x & !least.at_least(weights[0]);
                let is_y = !is_y & !least.at_least(weights[1]);
                let [u, v] = planes.across(is_x, is_y);
                covered = covered + hatching.ink(u, v, texels, darkness) * mix;
            }
        }
        if lanes.len() == LANES {
            *ink = covered;
            return;
        }
        for lane in lanes {
            ink.0[lane] = covered.0[lane];
        }
    }
}

/// Places on the planes across the three axes.
struct Planes {
    u: [F32x8; 3],
    v: [F32x8; 3],
}

impl Planes {
    /// Returns places on the plane across x, across y, or across z, lane by lane.
    #[inline(always)]
    fn across(&self, is_x: Mask8, is_y: Mask8) -> [F32x8; 2] {
        [
            is_x.pick(self.u[0], is_y.pick(self.u[1], self.u[2])),
            is_x.pick(self.v[0], is_y.pick(self.v[1], self.v[2])),
        ]
    }
}

#[inline(always)]
fn turned(by: &Mat3, v: Vec3x8) -> Vec3x8 {
    Vec3x8::splat(by.x_axis).scaled(v.x)
        + Vec3x8::splat(by.y_axis).scaled(v.y)
        + Vec3x8::splat(by.z_axis).scaled(v.z)
}

/// Raises cosines to their exponents: all at once where these are one, which they mostly are.
#[inline(always)]
fn powers(cosine: F32x8, shininess: &[f32; LANES]) -> F32x8 {
    if shininess.iter().all(|&s| s == shininess[0]) {
        return highlights(cosine, shininess[0]);
    }
    let mut all = cosine;
    for (power, &exponent) in all.0.iter_mut().zip(shininess) {
        *power = highlight(*power, exponent);
    }
    all
}
