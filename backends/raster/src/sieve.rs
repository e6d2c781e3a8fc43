//! Which of eight triangles cannot cover a pixel? Most small ones cannot, and are told from the snapped corners alone.

use crate::setup::STEPS;
use crate::transform::{PartOnScreen, border};
use polyptych_core::lanes::LANES;

/// Eight triangles on the picture, corner by corner, in steps.
struct Eight {
    x: [[i32; LANES]; 3],
    y: [[i32; LANES]; 3],
    /// Borders that any corner is beyond, and those that all are.
    any: [u32; LANES],
    all: [u32; LANES],
}

polyptych_core::for_registers! {
    /// Returns one bit for each of up to eight triangles: whether it may cover a pixel. `reach` is how far from a
    /// pixel's center it may be looked at, in steps.
    pub(crate) fn may_cover(vertices: PartOnScreen<'_>, triangles: &[[u32; 3]], reach: i32) -> u32
        = may_cover_512, may_cover_256, may_cover_here;
}

#[inline(always)]
fn may_cover_here(vertices: PartOnScreen<'_>, triangles: &[[u32; 3]], reach: i32) -> u32 {
    let eight = Eight::gather(vertices, triangles);
    let mut bits = [0; LANES];
    for (lane, bit) in bits.iter_mut().enumerate() {
        *bit = i32::from(eight.may_cover(lane, reach)) << lane;
    }
    let all = bits.iter().fold(0, |all, bit| all | bit) as u32;
    all & ((1 << triangles.len().min(LANES)) - 1)
}

impl Eight {
    #[inline(always)]
    fn gather(vertices: PartOnScreen<'_>, triangles: &[[u32; 3]]) -> Self {
        let nothing = [[0; LANES]; 3];
        let mut eight = Self { x: nothing, y: nothing, any: [0; LANES], all: [0; LANES] };
        for (lane, corners) in triangles.iter().enumerate().take(LANES) {
            let (mut any, mut all) = (0, u32::MAX);
            for (k, corner) in corners.iter().enumerate() {
                let (x, y, beyond) = vertices.snapped(*corner);
                (eight.x[k][lane], eight.y[k][lane]) = (x, y);
                (any, all) = (any | beyond, all & beyond);
            }
            (eight.any[lane], eight.all[lane]) = (any, all);
        }
        eight
    }

    /// The same steps for all lanes, without branches, so that the compiler can take them at once. Numbers of triangles
    /// that are clipped, or too large for the last test, mean nothing and may wrap.
    #[inline(always)]
    fn may_cover(&self, lane: usize, reach: i32) -> bool {
        let [ax, bx, cx] = [self.x[0][lane], self.x[1][lane], self.x[2][lane]];
        let [ay, by, cy] = [self.y[0][lane], self.y[1][lane], self.y[2][lane]];
        let hidden = (self.any[lane] & border::NOWHERE) | (self.all[lane] & border::HIDING) != 0;
        let is_clipped = self.any[lane] & border::CLIPPING != 0;
        let first = |low: i32| low.wrapping_sub(reach).wrapping_add(STEPS / 2 - 1) >> 8;
        let last = |high: i32| high.wrapping_add(reach).wrapping_sub(STEPS / 2) >> 8;
        let (x0, x1) = (first(ax.min(bx).min(cx)), last(ax.max(bx).max(cx)));
        let (y0, y1) = (first(ay.min(by).min(cy)), last(ay.max(by).max(cy)));
        let has_centers = (x0 <= x1) & (y0 <= y1);
        // Of the centers in a box of two by two each is tried; the numbers of such triangles are small.
        let is_small = (reach == 0) & (x1.wrapping_sub(x0) <= 1) & (y1.wrapping_sub(y0) <= 1);
        let (left, right) = ((x0 << 8).wrapping_add(STEPS / 2), (x1 << 8).wrapping_add(STEPS / 2));
        let (top, bottom) = ((y0 << 8).wrapping_add(STEPS / 2), (y1 << 8).wrapping_add(STEPS / 2));
        let turn =
            |[ux, uy]: [i32; 2], [vx, vy]: [i32; 2]| ux.wrapping_mul(vy).wrapping_sub(vx.wrapping_mul(uy));
        let between = |[ux, uy]: [i32; 2], [vx, vy]: [i32; 2]| [vx.wrapping_sub(ux), vy.wrapping_sub(uy)];
        let (a, b, c) = ([ax, ay], [bx, by], [cx, cy]);
        let area = turn(between(a, b), between(a, c));
        let sign = if area < 0 { -1 } else { 1 };
        let mut outside = [0; 4];
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let [along_x, along_y] = between(from, to);
            let (by_column, by_row) = (along_y.wrapping_mul(-sign), along_x.wrapping_mul(sign));
            let is_top_or_left = (by_column > 0) | ((by_column == 0) & (by_row > 0));
            let bias = i32::from(!is_top_or_left);
            let value = |x: i32, y: i32| {
                let (dx, dy) = (x.wrapping_sub(from[0]), y.wrapping_sub(from[1]));
                by_column.wrapping_mul(dx).wrapping_add(by_row.wrapping_mul(dy)).wrapping_sub(bias)
            };
            outside[0] |= value(left, top);
            outside[1] |= value(right, top);
            outside[2] |= value(left, bottom);
            outside[3] |= value(right, bottom);
        }
        let covers = (area != 0) & ((outside[0] & outside[1] & outside[2] & outside[3]) >= 0);
        !hidden & (is_clipped | (has_centers & (!is_small | covers)))
    }
}
