//! What holds all rays of a tile between two distances?

use glam::DVec3;
use polyptych_core::lanes::{DVec3x8, F64x8, Mask8};
use polyptych_core::math::Aabb;

/// A stretch is halved while it is so much longer than the tile is wide.
const SLENDER: f64 = 3.0;

/// Bounds of all rays of a tile.
pub(crate) struct Pyramid {
    origins: Aabb,
    directions: Aabb,
}

impl Pyramid {
    /// Bounds rays of which some are open, with the range of their distances; nothing if there are none.
    #[inline(always)]
    pub(crate) fn around(
        rays: impl Iterator<Item = (Mask8, DVec3x8, DVec3x8, F64x8, F64x8)>,
    ) -> Option<(Self, f64, f64)> {
        let (top, bottom) = (F64x8::splat(f64::INFINITY), F64x8::splat(f64::NEG_INFINITY));
        let (mut low, mut high) = ([top; 7], [bottom; 7]);
        for (open, o, d, near, far) in rays {
            let numbers = [o.x, o.y, o.z, d.x, d.y, d.z];
            if (!open).any() {
                for i in 0..6 {
                    low[i] = low[i].min(F64x8::pick(open, numbers[i], top));
                    high[i] = high[i].max(F64x8::pick(open, numbers[i], bottom));
                }
                low[6] = low[6].min(F64x8::pick(open, near, top));
                high[6] = high[6].max(F64x8::pick(open, far, bottom));
            } else {
                for i in 0..6 {
                    low[i] = low[i].min(numbers[i]);
                    high[i] = high[i].max(numbers[i]);
                }
                low[6] = low[6].min(near);
                high[6] = high[6].max(far);
            }
        }
        let low = low.map(|v| v.0.into_iter().fold(f64::INFINITY, f64::min));
        let high = high.map(|v| v.0.into_iter().fold(f64::NEG_INFINITY, f64::max));
        let boxed = |i: usize| {
            let [from, to] = [&low, &high].map(|v| DVec3::new(v[i], v[i + 1], v[i + 2]));
            Aabb::new(from, to)
        };
        (low[6] <= high[6]).then(|| (Self { origins: boxed(0), directions: boxed(3) }, low[6], high[6]))
    }

    /// Returns how wide all rays together are at a distance.
    #[inline(always)]
    pub(crate) fn width(&self, t: f64) -> f64 {
        (self.origins.size() + self.directions.size() * t).max_element()
    }

    /// Bounds the places of all rays between two distances.
    #[inline(always)]
    pub(crate) fn between(&self, a: f64, b: f64) -> Aabb {
        let (d, o) = (&self.directions, &self.origins);
        let (low, high) = ((d.min * a).min(d.min * b), (d.max * a).max(d.max * b));
        Aabb::new(o.min + low, o.max + high)
    }

    /// Tells whether the rays between two distances are much longer than all of them together are wide.
    pub(crate) fn is_slender(&self, a: f64, b: f64) -> bool {
        self.directions.center().length() * (b - a) > SLENDER * self.width(b)
    }
}

/// Returns where rays enter and leave a box, as [`Aabb::clip`]; rays in a face plane are inside.
#[inline(always)]
pub(crate) fn clip(bounds: &Aabb, origin: &DVec3x8, direction: &DVec3x8) -> (F64x8, F64x8) {
    let infinity = F64x8::splat(f64::INFINITY);
    let (mut near, mut far) = (F64x8::ZERO, infinity);
    let axes = [
        (origin.x, direction.x, bounds.min.x, bounds.max.x),
        (origin.y, direction.y, bounds.min.y, bounds.max.y),
        (origin.z, direction.z, bounds.min.z, bounds.max.z),
    ];
    for (o, d, min, max) in axes {
        let (min, max) = (F64x8::splat(min) - o, F64x8::splat(max) - o);
        let (a, b) = (min / d, max / d);
        let flat = d.equal(F64x8::ZERO);
        let outside = flat & (min.above(F64x8::ZERO) | F64x8::ZERO.above(max));
        let (low, high) = (a.min(b), a.max(b));
        near = F64x8::pick(flat, near, near.max(low));
        far = F64x8::pick(outside, -infinity, F64x8::pick(flat, far, far.min(high)));
    }
    (near, far)
}
