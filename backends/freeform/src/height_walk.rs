//! Where do eight rays meet a height field first?
//!
//! Each ray walks the cells of a pyramid of lowest and highest heights: a block that it passes above or below is jumped
//! in one step, else the part of it in which the ray is is looked at; at the bottom the ray meets a bilinear patch, a
//! quadratic equation. All eight go side by side, each at its own place and level. Source: A. Tevs, I. Ihrke,
//! H.-P. Seidel, *Maximum mipmaps for fast, accurate, and scalable dynamic height field rendering*, I3D 2008.

use crate::height_ranges::Ranges;
use glam::DVec2;
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, I32x8, LANES, Mask8};
use polyptych_core::scene::HeightField;

/// Level at which rays begin to walk.
const FIRST_LEVEL: i32 = 2;

/// Eight rays on their way over the grid, one unit a cell.
///
/// Kept in memory from step to step, numbers of one kind beside those of another: so each group of eight is told from the
/// next by the compiler.
#[derive(Clone, Copy)]
#[repr(C)]
pub(crate) struct Walk {
    cell_x: I32x8,
    t: F64x8,
    cell_z: I32x8,
    /// Heights in the steps in which ranges are told.
    y: F64x8,
    level: I32x8,
    far: F64x8,
    /// Those that have met nothing yet.
    pub(crate) open: Mask8,
    height: F64x8,
    met: Mask8,
    rise: F64x8,
    x: Axis,
    z: Axis,
    /// Heights in units of the object.
    true_height: F64x8,
    true_rise: F64x8,
    /// The patches on which the surface is met.
    patches: Patches,
}

/// Eight rays along one axis of the grid.
#[derive(Clone, Copy)]
struct Axis {
    start: F64x8,
    slope: F64x8,
    /// One over the slopes, and infinity to add to when a ray leaves where it goes along no cells.
    pace: F64x8,
    late: F64x8,
    /// Which rays go toward higher cells.
    ahead: Mask8,
    /// The last cell.
    last: I32x8,
}

/// Where eight rays are along an axis: their cells, and the blocks around those.
struct Block {
    first: I32x8,
    last: I32x8,
    /// The border at which a ray leaves, in cells, and when.
    border: I32x8,
    leave: F64x8,
}

/// Eight patches along rays from where they enter: `a s^2 + b s + c` above the surface up to `span`.
#[derive(Clone, Copy)]
struct Patches {
    a: F64x8,
    b: F64x8,
    c: F64x8,
    near: F64x8,
    span: F64x8,
}

impl Axis {
    #[inline(always)]
    fn new(start: F64x8, slope: F64x8, cells: u32) -> Self {
        let (flat, one) = (slope.equal(F64x8::ZERO), F64x8::splat(1.0));
        Self {
            start,
            slope,
            pace: one / F64x8::pick(flat, one, slope),
            late: F64x8::pick(flat, F64x8::splat(f64::INFINITY), F64x8::ZERO),
            ahead: slope.above(F64x8::ZERO),
            // Fewer than 2^31 cells: a field of as many heights as fit into memory has less along an edge.
            last: I32x8::splat(cells as i32 - 1),
        }
    }

    /// Returns the cells that rays are in at some distances, as far as those are between two others.
    #[inline(always)]
    fn cell(&self, t: F64x8, first: I32x8, last: I32x8) -> I32x8 {
        (self.start + self.slope * t).nearest_below().max(first).min(last)
    }

    /// Returns the blocks around cells: of so many cells, less one.
    #[inline(always)]
    fn block(&self, cell: I32x8, others: I32x8) -> Block {
        let first = cell - (cell & others);
        let last = first + others;
        let border = I32x8::pick(self.ahead, last + I32x8::splat(1), first);
        let leave = (border.to_f64() - self.start) * self.pace + self.late;
        Block { first, last: last.min(self.last), border, leave }
    }

    /// Tells which cells are beyond the first or the last.
    #[inline(always)]
    fn is_beyond(&self, cell: I32x8) -> Mask8 {
        (cell | (self.last - cell)).is_negative()
    }

    /// Returns the cells behind borders.
    #[inline(always)]
    fn behind(&self, border: I32x8) -> I32x8 {
        border - I32x8::pick(self.ahead, I32x8::splat(0), I32x8::splat(1))
    }
}

impl Walk {
    /// Sets out with open rays in object space, between two distances, unless there are none.
    #[inline(always)]
    pub(crate) fn start(
        field: &HeightField,
        ranges: &Ranges,
        (origin, direction): (&DVec3x8, &DVec3x8),
        (near, far): (F64x8, F64x8),
        open: Mask8,
    ) -> Self {
        let one_over = field.cell_size().recip();
        let middle = DVec2::new(f64::from(field.columns() - 1), f64::from(field.rows() - 1)) * 0.5;
        let place = |v: F64x8, middle: f64, one_over: f64| v * F64x8::splat(one_over) + F64x8::splat(middle);
        let slope = |v: F64x8, one_over: f64| v * F64x8::splat(one_over);
        let x = (place(origin.x, middle.x, one_over.x), slope(direction.x, one_over.x));
        let z = (place(origin.z, middle.y, one_over.y), slope(direction.z, one_over.y));
        let x = Axis::new(x.0, x.1, field.columns() - 1);
        let z = Axis::new(z.0, z.1, field.rows() - 1);
        let [steps, zero] = ranges.scale().map(F64x8::splat);
        let (height, rise) = (origin.y * steps + zero, direction.y * steps);
        let none = I32x8::splat(0);
        Self {
            cell_x: x.cell(near, none, x.last),
            t: near,
            cell_z: z.cell(near, none, z.last),
            y: height + rise * near,
            level: I32x8::splat(FIRST_LEVEL.min(ranges.top() as i32)),
            far,
            open,
            height,
            rise,
            x,
            z,
            true_height: origin.y,
            true_rise: direction.y,
            met: Mask8::NONE,
            patches: Patches::NONE,
        }
    }

    /// Goes one step with all rays that are open.
    #[inline(always)]
    pub(crate) fn step(&mut self, field: &HeightField, ranges: &Ranges) {
        let (none, one) = (I32x8::splat(0), I32x8::splat(1));
        let (t, level) = (self.t, self.level);
        let others = one.up(level) - one;
        let (across, along) = (self.x.block(self.cell_x, others), self.z.block(self.cell_z, others));
        let turns = across.leave.above(along.leave);
        let leave = across.leave.min(along.leave);
        let exit = leave.min(self.far).max(t);
        let after = self.height + self.rise * exit;
        let words = ranges.words(self.cell_x, self.cell_z, level);
        let (low, high) = ((words & I32x8::splat(0xFFFF)).to_f64(), words.down(I32x8::splat(16)).to_f64());
        let is_cell = level.equal(none);
        let passes = self.y.min(after).above(high) | low.above(self.y.max(after));
        let mut goes = self.open & (passes | is_cell);
        let sinks = self.open & !goes;
        let looks = self.open & is_cell;
        if looks.any() {
            let here = self.here(field, exit);
            let hair = self.hair();
            let mut on = looks & here.change_sides();
            let doubtful = looks & !on & here.may_touch(hair);
            if doubtful.any() {
                on = on | (doubtful & here.first(hair).0);
            }
            self.patches.take(on, &here);
            self.met = self.met | on;
            self.open = self.open & !on;
            goes = goes & !on;
        }
        // Across one border, and somewhere along it.
        let next_x =
            I32x8::pick(turns, self.x.cell(exit, across.first, across.last), self.x.behind(across.border));
        let next_z =
            I32x8::pick(turns, self.z.behind(along.border), self.z.cell(exit, along.first, along.last));
        // Up, where another block of the level above is entered.
        let moved = ((next_x ^ self.cell_x) | (next_z ^ self.cell_z)).down(level);
        let rises = goes & one.below(moved) & level.below(I32x8::splat(ranges.top() as i32));
        self.level = level + I32x8::pick(rises, one, none) - I32x8::pick(sinks, one, none);
        self.cell_x = I32x8::pick(goes, next_x, self.cell_x);
        self.cell_z = I32x8::pick(goes, next_z, self.cell_z);
        self.t = F64x8::pick(goes, exit, t);
        self.y = F64x8::pick(goes, after, self.y);
        let outside = self.x.is_beyond(self.cell_x) | self.z.is_beyond(self.cell_z);
        self.open = self.open & !(goes & (outside | leave.at_least(self.far)));
    }

    /// Returns which rays met the surface, and where.
    #[inline(always)]
    pub(crate) fn met(&self) -> (Mask8, F64x8) {
        (self.met, self.patches.first(self.hair()).1)
    }

    /// Returns what distances may be off by.
    #[inline(always)]
    fn hair(&self) -> F64x8 {
        self.far * F64x8::splat(1e-14)
    }

    /// Returns the patches of the cells along the rays up to a distance.
    #[inline(always)]
    fn here(&self, field: &HeightField, far: F64x8) -> Patches {
        let ([x, z], near) = ([self.cell_x, self.cell_z], self.t);
        let (heights, columns) = (field.heights(), field.columns() as usize);
        let mut corners = [F32x8::ZERO; 4];
        for i in 0..LANES {
            let first = z.0[i] as u32 as usize * columns + x.0[i] as u32 as usize;
            if let Some(part) = heights.get(first..first + columns + 2) {
                corners[0].0[i] = part[0];
                corners[1].0[i] = part[1];
                corners[2].0[i] = part[columns];
                corners[3].0[i] = part[columns + 1];
            }
        }
        let [h00, h10, h01, h11] = corners.map(F32x8::to_f64);
        // Around the entry the numbers are small. f(s) = y - h over u = u0 + du s, v = v0 + dv s.
        let (u, v) = (
            self.x.start + self.x.slope * near - x.to_f64(),
            self.z.start + self.z.slope * near - z.to_f64(),
        );
        let (du, dv) = (self.x.slope, self.z.slope);
        let (hu, hv) = (h10 - h00, h01 - h00);
        let twist = h11 - h10 - hv;
        let c = self.true_height + self.true_rise * near - (h00 + hu * u + hv * v + twist * u * v);
        let b = self.true_rise - hu * du - hv * dv - twist * (u * dv + v * du);
        Patches { a: -(twist * du * dv), b, c, near, span: far - near }
    }
}

impl Patches {
    const NONE: Self =
        Self { a: F64x8::ZERO, b: F64x8::ZERO, c: F64x8::ZERO, near: F64x8::ZERO, span: F64x8::ZERO };

    /// Takes some of others.
    #[inline(always)]
    fn take(&mut self, mask: Mask8, other: &Self) {
        self.a = F64x8::pick(mask, other.a, self.a);
        self.b = F64x8::pick(mask, other.b, self.b);
        self.c = F64x8::pick(mask, other.c, self.c);
        self.near = F64x8::pick(mask, other.near, self.near);
        self.span = F64x8::pick(mask, other.span, self.span);
    }

    #[inline(always)]
    fn end(&self) -> F64x8 {
        (self.a * self.span + self.b) * self.span + self.c
    }

    /// Tells which rays are on different sides of the surface where they enter and leave.
    #[inline(always)]
    fn change_sides(&self) -> Mask8 {
        F64x8::ZERO.above(self.c * self.end())
    }

    /// Tells which rays that do not change sides may be on the surface all the same: at an end, or twice between.
    #[inline(always)]
    fn may_touch(&self, hair: F64x8) -> Mask8 {
        let slack = self.slack(hair);
        let leaving = self.b + (self.a + self.a) * self.span;
        let close = (self.b.abs() * slack).at_least(self.c.abs())
            | (leaving.abs() * slack).at_least(self.end().abs());
        let turns = F64x8::ZERO.above(self.b * leaving) & self.under_root().at_least(F64x8::ZERO);
        close | turns
    }

    #[inline(always)]
    fn under_root(&self) -> F64x8 {
        self.b * self.b - F64x8::splat(4.0) * self.a * self.c
    }

    #[inline(always)]
    fn slack(&self, hair: F64x8) -> F64x8 {
        self.span * F64x8::splat(1e-9) + hair
    }

    /// Finds the first distances at which rays are on their patches; the nearest to that where they are not.
    #[inline(always)]
    fn first(&self, hair: F64x8) -> (Mask8, F64x8) {
        let Self { a, b, c, near, span } = *self;
        let zero = F64x8::ZERO;
        let under = self.under_root();
        let root = under.max(zero).sqrt();
        let sum = F64x8::pick(zero.above(b), b - root, b + root);
        let q = sum * F64x8::splat(-0.5);
        // Nearly straight: one root is far away or no number, the other is that of the line.
        let straight = (b.abs() * F64x8::splat(1e-14)).at_least(a.abs() * span);
        let line = -c / b;
        let (s, r) = (F64x8::pick(straight, line, q / a), F64x8::pick(straight, line, c / q));
        let (low, high) = (s.min(r), s.max(r));
        let slack = self.slack(hair);
        let end = span + slack;
        let within = |s: F64x8| s.at_least(-slack) & end.at_least(s);
        let (first, second) = (within(low), within(high));
        let found = (first | second) & (straight | under.at_least(zero));
        let s = F64x8::pick(first, low, high);
        (found, near + s.max(zero).min(span))
    }
}
