//! Rays of one tile, and what they met.

use glam::DVec3;

/// Pixels along the edge of a tile.
pub(crate) const TILE: u32 = 16;
/// Rays in a tile.
pub(crate) const TILE_RAYS: usize = (TILE * TILE) as usize;

/// A ray with the stretch of it that is looked at; distances are in world units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    pub(crate) near: f64,
    pub(crate) far: f64,
}

/// Up to [`TILE_RAYS`] rays that go about the same way.
#[derive(Default)]
pub(crate) struct Bundle {
    pub(crate) rays: Vec<Stretch>,
}

/// A cone around all rays of a bundle: whatever is outside is met by none of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    origin: DVec3,
    /// How far origins are from the middle one.
    spread: f64,
    axis: DVec3,
    tangent: f64,
}

impl Bundle {
    /// Bounds the rays; nothing where they go apart by more than sixty degrees, or there are none.
    pub(crate) fn cone(&self) -> Option<Cone> {
        let count = self.rays.len() as f64;
        let origin = self.rays.iter().map(|r| r.origin).sum::<DVec3>() / count;
        let axis = self.rays.iter().map(|r| r.direction).sum::<DVec3>().try_normalize()?;
        let spread = self.rays.iter().map(|r| r.origin.distance_squared(origin)).fold(0.0, f64::max).sqrt();
        let cosine = self.rays.iter().map(|r| r.direction.dot(axis)).fold(1.0, f64::min);
        if cosine.is_nan() || cosine <= 0.5 {
            return None;
        }
        // A little wider than computed, against rounding.
        let tangent = (1.0 - cosine * cosine).max(0.0).sqrt() / cosine * 1.001 + 1e-9;
        Some(Cone { origin, spread: spread * 1.001, axis, tangent })
    }
}

impl Cone {
    /// Tells whether a sphere may be met.
    pub(crate) fn touches(&self, center: DVec3, radius: f64) -> bool {
        let offset = center - self.origin;
        let along = offset.dot(self.axis);
        let aside = (offset - self.axis * along).length();
        let reach = radius + self.spread;
        along > -reach && aside <= reach + (along + reach).max(0.0) * self.tangent + 1e-9 * aside
    }
}

/// What the rays met first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hit {
    /// Distance in world units.
    pub(crate) t: f64,
    /// Index of the body, [`Hit::NOTHING`] for none.
    pub(crate) body: u32,
    /// Outward normal of a free form in its object space, not of unit length; zero for other bodies.
    pub(crate) normal: DVec3,
}

impl Hit {
    pub(crate) const NOTHING: u32 = u32::MAX;

    /// A ray that met nothing up to a distance.
    pub(crate) fn nothing(far: f64) -> Self {
        Self { t: far, body: Self::NOTHING, normal: DVec3::ZERO }
    }

    pub(crate) fn is_some(&self) -> bool {
        self.body != Self::NOTHING
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
