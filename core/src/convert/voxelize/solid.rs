//! Which cells have their middle inside of a mesh?
//!
//! The winding number of a point is the mean, over all directions, of how often rays from it leave the mesh less how
//! often they enter it. For a closed mesh all directions say the same. Here the six along the axes are asked, which
//! three sweeps over the grid answer for all cells; where a mesh is open, most of them must agree.
//!
//! Source: A. Jacobson, L. Kavan, O. Sorkine-Hornung, *Robust Inside-Outside Segmentation using Generalized Winding
//! Numbers*, SIGGRAPH 2013. We deviate in the six directions.

use super::lines::{Crossing, for_each_crossing};
use super::slab::Slab;
use super::surface::{Surface, triangles_of_slabs};
use crate::seam::{Cancelled, Control};

/// Directions that must call a middle inside. With three, a line that grazes the rim of one hole and leaves by another
/// would do.
const ENOUGH: i32 = 4;

/// Fills the cells whose middles are inside. They have the color of the surface beside them, and within the body that
/// of the surface before them in their row.
pub(super) fn fill(
    surface: &Surface<'_>,
    slabs: &mut [Slab],
    control: &Control<'_>,
) -> Result<(), Cancelled> {
    let columns = surface.grid.size[0] as usize * surface.grid.size[1] as usize;
    let reaching = triangles_of_slabs(surface, slabs, 1, control)?;
    // Upright lines go through all slabs: what lies below each one comes first.
    let mut below: Vec<Vec<i32>> = slabs.iter().map(|_| vec![0; columns]).collect();
    let mut parts: Vec<_> = slabs.iter().zip(&reaching).zip(&mut below).collect();
    control.for_each_mut(&mut parts, 1, &|_, ((slab, triangles), sums)| {
        for_each_in((surface, control), slab, triangles, 2, &mut |_, crossing| {
            if let Some(cell) = first_behind(surface, slab, &crossing) {
                sums[column(surface, cell)] += crossing.sign;
            }
        });
    })?;
    drop(parts);
    let mut all = vec![0; columns];
    for sums in &mut below {
        control.check()?;
        for (sum, all) in sums.iter_mut().zip(&mut all) {
            let own = std::mem::replace(sum, *all);
            *all += own;
        }
    }
    let mut parts: Vec<_> = slabs.iter_mut().zip(&reaching).zip(&below).collect();
    control.for_each_mut(&mut parts, 1, &|_, ((slab, triangles), below)| {
        let inside = inside((surface, control), slab, triangles, [below, &all]);
        paint((surface, control), slab, triangles, &inside);
    })
}

/// Visits the crossings of all lines along an axis that a slab has to do with, until the host wants to stop.
fn for_each_in(
    (surface, control): (&Surface<'_>, &Control<'_>),
    slab: &Slab,
    triangles: &[u32],
    axis: usize,
    visit: &mut impl FnMut(usize, Crossing),
) {
    let [nx, ny, _] = surface.grid.size;
    let cells = [0..nx, 0..ny, slab.from..slab.to];
    for &t in triangles {
        if control.is_cancelled() {
            return;
        }
        for_each_crossing(surface.corners(t as usize), axis, &cells, 0.0, &mut |c| visit(t as usize, c));
    }
}

/// Returns the first cell in a line whose middle lies behind a crossing, if it is one of a slab; what lies behind the
/// last cell of a line is given to that.
fn first_behind(surface: &Surface<'_>, slab: &Slab, crossing: &Crossing) -> Option<[i64; 3]> {
    let cell = crossing.cell(crossing.along.floor() as i64 + 1);
    let clamped: [i64; 3] = std::array::from_fn(|a| cell[a].clamp(0, i64::from(surface.grid.size[a]) - 1));
    (i64::from(slab.from)..i64::from(slab.to)).contains(&clamped[2]).then_some(cell)
}

fn column(surface: &Surface<'_>, [x, y, _]: [i64; 3]) -> usize {
    y as usize * surface.grid.size[0] as usize + x as usize
}

/// Tells for each cell of a slab whether its middle is inside.
fn inside(
    (surface, control): (&Surface<'_>, &Control<'_>),
    slab: &Slab,
    triangles: &[u32],
    [below, all]: [&[i32]; 2],
) -> Vec<bool> {
    let size = [surface.grid.size[0], surface.grid.size[1], slab.to - slab.from].map(|s| s as usize);
    let stride = [1, size[0], size[0] * size[1]];
    let count = size[0] * size[1] * size[2];
    let mut votes = vec![0i32; count];
    let mut steps = vec![0i32; count];
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut sums = vec![0i32; size[u] * size[v]];
        let first = [0, 0, i64::from(slab.from)];
        for_each_in((surface, control), slab, triangles, axis, &mut |_, crossing| {
            let Some(cell) = first_behind(surface, slab, &crossing) else { return };
            let cell: [usize; 3] = std::array::from_fn(|a| (cell[a] - first[a]).max(0) as usize);
            sums[cell[v] * size[u] + cell[u]] += crossing.sign;
            if cell[axis] < size[axis] {
                steps[cell[0] + cell[1] * stride[1] + cell[2] * stride[2]] += crossing.sign;
            }
        });
        for j in 0..size[v] {
            if control.is_cancelled() {
                return vec![false; count];
            }
            for i in 0..size[u] {
                let line = j * size[u] + i;
                let (mut behind, total) = if axis == 2 { (below[line], all[line]) } else { (0, sums[line]) };
                let begin = i * stride[u] + j * stride[v];
                for k in 0..size[axis] {
                    let at = begin + k * stride[axis];
                    behind += std::mem::take(&mut steps[at]);
                    // One vote for what lies ahead, and one for what lies behind.
                    votes[at] += (total - behind).signum() - behind.signum();
                }
            }
        }
    }
    votes.into_iter().map(|votes| votes.abs() >= ENOUGH).collect()
}

/// Gives the cells inside their colors.
fn paint(
    (surface, control): (&Surface<'_>, &Control<'_>),
    slab: &mut Slab,
    triangles: &[u32],
    inside: &[bool],
) {
    let [nx, ny, _] = surface.grid.size.map(i64::from);
    for axis in 0..3 {
        let mut beside = Vec::new();
        for_each_in((surface, control), slab, triangles, axis, &mut |t, crossing| {
            let before = crossing.along.floor() as i64;
            for [x, y, z] in [crossing.cell(before), crossing.cell(before + 1)] {
                let is_here = (0..nx).contains(&x) && (0..ny).contains(&y);
                if is_here && (i64::from(slab.from)..i64::from(slab.to)).contains(&z) {
                    beside.push(([x, y, z].map(|c| c as u32), t, crossing));
                }
            }
        });
        for (cell, t, crossing) in beside {
            if control.is_cancelled() {
                return;
            }
            if inside[slab.index(cell)]
                && let Some(color) = surface.color(t, crossing.place())
            {
                slab.fill(cell, surface.mesh.slot(t) as u16, color);
            }
        }
    }
    let plain = surface.mesh.slot(triangles.first().map_or(0, |&t| t as usize));
    let color = surface.scene.material(surface.object, plain).base_color;
    let mut last = None;
    for (at, &is_inside) in inside.iter().enumerate() {
        if !is_inside {
            last = None;
        } else if slab.number_at(at) == 0 {
            let number = *last.get_or_insert_with(|| slab.number(plain as u16, color));
            slab.put(at, number);
        } else {
            last = Some(slab.number_at(at));
        }
    }
}
