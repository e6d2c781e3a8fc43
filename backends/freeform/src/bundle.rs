//! Rays of one tile, eight and eight, and what they met.

use glam::DVec3;
use polyptych_core::lanes::{DVec3x8, F64x8, LANES, Mask8};

/// Pixels along the edge of a tile.
pub(crate) const TILE: u32 = 16;
/// Groups of eight pixels along a row of a tile.
pub(crate) const COLUMNS: usize = TILE as usize / LANES;
/// Groups of eight rays in a tile.
pub(crate) const OCTETS: usize = TILE as usize * COLUMNS;

/// Eight rays with the stretches of them that are looked at; distances are in world units. A ray whose far end
/// is not beyond its near end is closed: it meets nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rays {
    pub(crate) origin: DVec3x8,
    /// Unit vectors.
    pub(crate) direction: DVec3x8,
    pub(crate) near: F64x8,
    pub(crate) far: F64x8,
}

impl Rays {
    #[inline(always)]
    pub(crate) fn open(&self) -> Mask8 {
        self.far.above(self.near)
    }

    /// Closes a ray.
    pub(crate) fn close(&mut self, lane: usize) {
        (self.near.0[lane], self.far.0[lane]) = (1.0, 0.0);
    }
}

/// Eight vectors of no length.
pub(crate) const NOWHERE: DVec3x8 = DVec3x8 { x: F64x8::ZERO, y: F64x8::ZERO, z: F64x8::ZERO };

/// A cone around all rays of a bundle: whatever is outside is met by none of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    origin: DVec3,
    /// How far origins are from the middle one.
    spread: f64,
    axis: DVec3,
    tangent: f64,
}

impl Cone {
    /// Bounds the open rays; nothing where they go apart by more than sixty degrees, or there are none.
    #[inline(always)]
    pub(crate) fn around(rays: &[Rays]) -> Option<Self> {
        let (mut origins, mut directions, mut count) = (NOWHERE, NOWHERE, 0);
        for r in rays {
            let open = r.open();
            origins = origins + DVec3x8::pick(open, r.origin, NOWHERE);
            directions = directions + DVec3x8::pick(open, r.direction, NOWHERE);
            count += open.count();
        }
        let sum = |v: &DVec3x8| (0..LANES).map(|i| v.get(i)).sum::<DVec3>();
        let origin = sum(&origins) / f64::from(count);
        let axis = sum(&directions).try_normalize()?;
        let (middle, along) = (DVec3x8::splat(origin), DVec3x8::splat(axis));
        let (mut spread, mut cosine) = (F64x8::ZERO, F64x8::splat(1.0));
        for r in rays {
            let (open, offset) = (r.open(), r.origin - middle);
            spread = F64x8::pick(open, spread.max(offset.dot(offset)), spread);
            cosine = F64x8::pick(open, cosine.min(r.direction.dot(along)), cosine);
        }
        let spread = spread.0.into_iter().fold(0.0, f64::max).sqrt();
        let cosine = cosine.0.into_iter().fold(1.0, f64::min);
        if cosine.is_nan() || cosine <= 0.5 {
            return None;
        }
        // A little wider than computed, against rounding.
        let tangent = (1.0 - cosine * cosine).max(0.0).sqrt() / cosine * 1.001 + 1e-9;
        Some(Self { origin, spread: spread * 1.001, axis, tangent })
    }

    /// Tells whether a sphere may be met.
    pub(crate) fn touches(&self, center: DVec3, radius: f64) -> bool {
        let offset = center - self.origin;
        let along = offset.dot(self.axis);
        let aside = (offset - self.axis * along).length();
        let reach = radius + self.spread;
        along > -reach && aside <= reach + (along + reach).max(0.0) * self.tangent + 1e-9 * aside
    }
}

/// The sides of a tile of a view that keeps straight lines straight: all its rays are between them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sides([(DVec3, f64); 4]);

impl Sides {
    /// Spans planes between the rays through the corners, in order around the tile.
    pub(crate) fn between(corners: [(DVec3, DVec3); 4]) -> Self {
        let ahead = corners.map(|(o, d)| o + d);
        let middle = ahead.iter().sum::<DVec3>() * 0.25;
        Self(std::array::from_fn(|i| {
            let (o, d) = corners[i];
            let normal = (ahead[(i + 1) % 4] - ahead[i]).cross(d);
            let normal = if normal.dot(middle - o) < 0.0 { -normal } else { normal };
            (normal, normal.dot(o) - 1e-9 * normal.length() * o.length())
        }))
    }

    /// Tells whether a body of these corners is beyond one of the sides.
    pub(crate) fn exclude(&self, corners: &[DVec3; 8]) -> bool {
        self.0.iter().any(|(normal, offset)| {
            corners.iter().all(|c| normal.dot(*c) < *offset - 1e-9 * normal.length() * c.length())
        })
    }
}

/// What eight rays met first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hits {
    /// Distances in world units; the far ends where nothing is met.
    pub(crate) t: F64x8,
    /// Indices of the bodies, [`Hits::NOTHING`] for none.
    pub(crate) body: Mask8,
    /// Outward normals of free forms in their object space, not of unit length.
    pub(crate) normal: DVec3x8,
}

impl Hits {
    pub(crate) const NOTHING: u32 = u32::MAX;

    /// Rays that met nothing up to their far ends.
    #[inline(always)]
    pub(crate) fn nothing(rays: &Rays) -> Self {
        Self { t: rays.far, body: Mask8::new([Self::NOTHING; LANES]), normal: NOWHERE }
    }

    /// Tells which met something.
    #[inline(always)]
    pub(crate) fn any(&self) -> Mask8 {
        !self.of(Self::NOTHING)
    }

    /// Tells which met a body.
    #[inline(always)]
    pub(crate) fn of(&self, body: u32) -> Mask8 {
        let mut mask = Mask8::NONE;
        for i in 0..LANES {
            mask.0[i] = if self.body.0[i] == body { u32::MAX } else { 0 };
        }
        mask
    }

    /// Takes what was found where it is nearer.
    #[inline(always)]
    pub(crate) fn improve(&mut self, found: Mask8, t: F64x8, body: u32, normal: DVec3x8) {
        let nearer = found & self.t.above(t);
        self.t = F64x8::pick(nearer, t, self.t);
        self.body = nearer.pick_bits(Mask8::new([body; LANES]), self.body);
        self.normal = DVec3x8::pick(nearer, normal, self.normal);
    }
}

/// Which roots count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Crossing {
    /// Any: seen from inside, a body shows where it is left.
    Any,
    /// Only where a body is entered: light that leaves a surface is not blocked by that surface's own rounding.
    Entry,
}
