//! What does a tile need to know of a triangle: exact edges and the plane of its depth.

use polyptych_core::lanes::{F32x8, F64x8, I32x8};

/// Steps of a corner's place within a pixel: corners are snapped to 24.8 bits.
pub(crate) const STEPS: i32 = 256;

/// A corner on the picture, in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenPoint {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) depth: f64,
}

/// How the depth of a triangle changes over one pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthPlane {
    pub(crate) by_column: f64,
    pub(crate) by_row: f64,
}

/// Which sides of triangles are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Sides {
    /// Both.
    #[default]
    Both,
    /// Those whose corners run counter-clockwise on the picture.
    CounterClockwise,
    /// Those whose corners run clockwise on the picture.
    Clockwise,
}

impl Sides {
    /// Tells whether a triangle of such an [area](Corners::area) is drawn.
    #[inline(always)]
    pub(crate) fn draws(self, area: i64) -> bool {
        match self {
            Self::Both => area != 0,
            Self::CounterClockwise => area < 0,
            Self::Clockwise => area > 0,
        }
    }
}

/// The corners of a triangle on the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corners {
    pub(crate) points: [ScreenPoint; 3],
    /// In steps.
    pub(crate) x: [i32; 3],
    pub(crate) y: [i32; 3],
}

impl Corners {
    pub(crate) fn snapped(points: [ScreenPoint; 3]) -> Self {
        let steps = f64::from(STEPS);
        Self { points, x: points.map(|p| round(p.x * steps)), y: points.map(|p| round(p.y * steps)) }
    }

    /// Returns twice the area in steps; negative where the corners run counter-clockwise (rows grow downward).
    #[inline(always)]
    pub(crate) fn area(&self) -> i64 {
        let (x, y) = (&self.x, &self.y);
        i64::from(x[1] - x[0]) * i64::from(y[2] - y[0]) - i64::from(x[2] - x[0]) * i64::from(y[1] - y[0])
    }
}

/// A triangle ready to be drawn, in 64 bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Record {
    /// Corners in steps, turned so that their area is positive (rows grow downward).
    pub(crate) x: [i32; 3],
    pub(crate) y: [i32; 3],
    /// Depth at the first corner.
    pub(crate) depth: f64,
    pub(crate) plane: DepthPlane,
    /// Depths of the corners farthest from and nearest to the eye.
    pub(crate) farthest: f32,
    pub(crate) nearest: f32,
    pub(crate) id: u32,
}

impl DepthPlane {
    /// Finds the plane through three corners; flat where they are in a line.
    pub(crate) fn through(p: &[ScreenPoint; 3]) -> Self {
        let (ax, ay, ad) = (p[1].x - p[0].x, p[1].y - p[0].y, p[1].depth - p[0].depth);
        let (bx, by, bd) = (p[2].x - p[0].x, p[2].y - p[0].y, p[2].depth - p[0].depth);
        let share = 1.0 / (ax * by - bx * ay);
        let (by_column, by_row) = ((ad * by - bd * ay) * share, (bd * ax - ad * bx) * share);
        if (by_column + by_row).is_finite() {
            Self { by_column, by_row }
        } else {
            Self { by_column: 0.0, by_row: 0.0 }
        }
    }
}

/// Rounds to the nearest whole number: adding 1.5 * 2^52 leaves it in the low bits. Right below 2^31.
fn round(v: f64) -> i32 {
    (v + 6_755_399_441_055_744.0).to_bits() as i32
}

/// Returns the first column or row whose pixel centers three corners can enclose.
#[inline(always)]
fn first_pixel(v: &[i32; 3]) -> i32 {
    (v[0].min(v[1]).min(v[2]) + (STEPS / 2 - 1)) >> 8
}

/// Returns the last.
#[inline(always)]
fn last_pixel(v: &[i32; 3]) -> i32 {
    (v[0].max(v[1]).max(v[2]) - STEPS / 2) >> 8
}

impl Record {
    /// Orders the corners; nothing where no pixel can be covered.
    ///
    /// Triangles seen from the edge are kept while their snapped corners have area: without them pixels between
    /// their neighbors would stay open.
    ///
    /// `reach` is how far from a pixel's center it may be looked at, in steps.
    #[inline(always)]
    pub(crate) fn new(
        corners: &Corners,
        area: i64,
        plane: impl FnOnce() -> DepthPlane,
        id: u32,
        reach: i32,
    ) -> Option<Self> {
        let Corners { points, mut x, mut y } = *corners;
        let pixels = |v: &[i32; 3]| first_pixel(&v.map(|v| v - reach)) <= last_pixel(&v.map(|v| v + reach));
        if !(pixels(&x) && pixels(&y)) {
            return None;
        }
        if area < 0 {
            x.swap(1, 2);
            y.swap(1, 2);
        }
        // The plane is that of the corners before they were snapped, found for what is drawn only.
        let (first, plane, steps) = (points[0], plane(), f64::from(STEPS));
        let depth = first.depth
            + plane.by_column * (f64::from(x[0]) / steps - first.x)
            + plane.by_row * (f64::from(y[0]) / steps - first.y);
        let depths = points.map(|p| p.depth);
        Some(Self {
            x,
            y,
            depth,
            plane,
            farthest: depths[0].min(depths[1]).min(depths[2]) as f32,
            nearest: depths[0].max(depths[1]).max(depths[2]) as f32,
            id,
        })
    }

    /// Returns the triangle as it covers places that lie so many steps from the pixels' centers.
    #[inline(always)]
    pub(crate) fn seen_from(&self, place: [i32; 2]) -> Self {
        Self { x: self.x.map(|x| x - place[0]), y: self.y.map(|y| y - place[1]), ..*self }
    }

    /// Returns the first and last column and row whose pixel centers can be covered; maybe none.
    #[inline(always)]
    pub(crate) fn pixels(&self) -> ([i32; 2], [i32; 2]) {
        let both = |v: &[i32; 3]| [first_pixel(v), last_pixel(v)];
        (both(&self.x), both(&self.y))
    }

    /// Returns the depth of the first corner's column at the center of a row.
    #[inline(always)]
    pub(crate) fn depth_of_row(&self, y: i32) -> f64 {
        let offset = f64::from((y << 8) + STEPS / 2 - self.y[0]) * (1.0 / f64::from(STEPS));
        self.depth + self.plane.by_row * offset
    }

    /// Returns what the center of a column adds to the depth of its row. The sum is not yet held between the
    /// depths of the corners; it is the same however a triangle is drawn.
    #[inline(always)]
    pub(crate) fn depth_of_column(&self, x: i32) -> f64 {
        self.plane.by_column * (f64::from((x << 8) + STEPS / 2 - self.x[0]) * (1.0 / f64::from(STEPS)))
    }

    /// Returns how far the centers of eight columns are from the first corner, in pixels and exactly.
    #[inline(always)]
    pub(crate) fn offset_of_columns(&self, x: i32) -> F64x8 {
        let steps =
            I32x8::count_from(0) * I32x8::splat(STEPS) + I32x8::splat((x << 8) + STEPS / 2 - self.x[0]);
        steps.to_f64() * F64x8::splat(1.0 / f64::from(STEPS))
    }

    /// Returns what the centers of eight columns add.
    #[inline(always)]
    pub(crate) fn depth_of_columns(&self, offset: F64x8) -> F64x8 {
        F64x8::splat(self.plane.by_column) * offset
    }

    /// Rounds and holds eight depths; see [`Record::hold`].
    #[inline(always)]
    pub(crate) fn hold_all(&self, depth: F64x8) -> F32x8 {
        F32x8::splat(self.nearest).min(F32x8::splat(self.farthest).max(depth.round()))
    }

    /// Rounds a depth and holds it between those of the corners: the plane of a triangle seen from the edge is
    /// so steep that it would stick out where a snapped corner moved over a pixel's center.
    #[inline(always)]
    pub(crate) fn hold(&self, depth: f64) -> f32 {
        let depth = depth as f32;
        let depth = if depth < self.farthest { self.farthest } else { depth };
        if depth > self.nearest { self.nearest } else { depth }
    }
}
