//! What holds all rays of a tile between two distances?

use glam::DVec3;
use polyptych_core::lanes::{DVec3x8, F64x8, LANES, Mask8};
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
        let (mut origins, mut directions) = (Extent::NONE, Extent::NONE);
        let (top, bottom) = (F64x8::splat(f64::INFINITY), F64x8::splat(f64::NEG_INFINITY));
        let (mut first, mut last) = (top, bottom);
        for (open, origin, direction, near, far) in rays {
            origins.add(open, origin);
            directions.add(open, direction);
            first = first.min(F64x8::pick(open, near, top));
            last = last.max(F64x8::pick(open, far, bottom));
        }
        let (near, far) = (least(first), most(last));
        (near <= far)
            .then(|| (Self { origins: origins.bounds(), directions: directions.bounds() }, near, far))
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

/// Bounds of some vectors, lane by lane. Each axis is named: of a loop over axes compilers make one that gathers eight
/// lanes of each from all over the stack.
struct Extent {
    low: DVec3x8,
    high: DVec3x8,
}

impl Extent {
    const NONE: Self = {
        let (top, bottom) = (F64x8::new([f64::INFINITY; LANES]), F64x8::new([f64::NEG_INFINITY; LANES]));
        Self { low: DVec3x8 { x: top, y: top, z: top }, high: DVec3x8 { x: bottom, y: bottom, z: bottom } }
    };

    #[inline(always)]
    fn add(&mut self, open: Mask8, v: DVec3x8) {
        let (low, high) = (DVec3x8::pick(open, v, Self::NONE.low), DVec3x8::pick(open, v, Self::NONE.high));
        self.low.x = self.low.x.min(low.x);
        self.low.y = self.low.y.min(low.y);
        self.low.z = self.low.z.min(low.z);
        self.high.x = self.high.x.max(high.x);
        self.high.y = self.high.y.max(high.y);
        self.high.z = self.high.z.max(high.z);
    }

    #[inline(always)]
    fn bounds(&self) -> Aabb {
        let (low, high) = (&self.low, &self.high);
        Aabb::new(
            DVec3::new(least(low.x), least(low.y), least(low.z)),
            DVec3::new(most(high.x), most(high.y), most(high.z)),
        )
    }
}

/// Returns the smallest of eight numbers.
#[inline(always)]
fn least(v: F64x8) -> f64 {
    let [a, b, c, d, e, f, g, h] = v.0.values();
    a.min(b).min(c.min(d)).min(e.min(f).min(g.min(h)))
}

/// Returns the largest of eight numbers.
#[inline(always)]
fn most(v: F64x8) -> f64 {
    -least(-v)
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
