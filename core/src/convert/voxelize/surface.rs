//! Which cells does a surface of triangles touch, and which are the fewest that nothing slips between?

use super::super::distance::closest_weights;
use super::super::palette::triangle_color;
use super::Grid;
use super::lines::for_each_crossing;
use super::slab::Slab;
use crate::math::Aabb;
use crate::scene::{Mesh, Object, Scene};
use crate::seam::{Cancelled, Control};
use glam::{DVec3, Vec3};

/// Triangles over a grid.
pub(super) struct Surface<'a> {
    pub(super) scene: &'a Scene,
    pub(super) object: &'a Object,
    pub(super) mesh: &'a Mesh,
    pub(super) grid: &'a Grid,
}

impl Surface<'_> {
    /// Returns the corners of a triangle in the space of cells, where middles lie at whole numbers.
    pub(super) fn corners(&self, t: usize) -> [DVec3; 3] {
        self.mesh.corners(t).map(|p| (p.as_dvec3() - self.grid.first) / self.grid.cell - 0.5)
    }

    /// Returns the color of a triangle nearest to a place in the space of cells, nothing where its texture has a hole.
    pub(super) fn color(&self, t: usize, place: DVec3) -> Option<Vec3> {
        let weights = closest_weights(self.corners(t), place).as_vec3();
        triangle_color(self.scene, self.object, self.mesh, t, weights)
    }
}

/// Lists which triangles reach into each slab, or come so many cells near to it, in their order.
pub(super) fn triangles_of_slabs(
    surface: &Surface<'_>,
    slabs: &[Slab],
    margin: u32,
    control: &Control<'_>,
) -> Result<Vec<Vec<u32>>, Cancelled> {
    let grid = surface.grid;
    let mut reaching = vec![Vec::new(); slabs.len()];
    for t in 0..surface.mesh.triangles.len() {
        control.check()?;
        let corners = surface.mesh.corners(t).map(Vec3::as_dvec3);
        if corners.iter().all(|p| p.is_finite()) {
            let box_ = Aabb::of_points(corners);
            let low = grid.clamp_cell(box_.min)[2].saturating_sub(margin);
            let high = (grid.clamp_cell(box_.max)[2] + margin).min(grid.size[2] - 1);
            for list in &mut reaching[Slab::of(low)..=Slab::of(high)] {
                list.push(t as u32);
            }
        }
    }
    Ok(reaching)
}

/// Fills every cell that a triangle touches.
pub(super) fn fill_touched(
    surface: &Surface<'_>,
    slabs: &mut [Slab],
    control: &Control<'_>,
) -> Result<(), Cancelled> {
    fill_each(surface, slabs, control, fill_triangle)
}

/// Cracks that are narrower, in cells, are closed: corners that ought to be one may differ by a rounding of their 32 bits,
/// which is a hundred-thousandth of a cell in a grid of some hundred.
const CRACK: f64 = 1e-4;

/// Fills the cells in which a triangle meets one of the three lines through their middles along the axes. A way over
/// faces of cells goes from middle to middle along such lines, so that it must go through one of these cells.
///
/// Source: S. Laine, *A Topological Approach to Voxelization*, EGSR 2013 (intersection targets).
pub(super) fn fill_thinly(
    surface: &Surface<'_>,
    slabs: &mut [Slab],
    control: &Control<'_>,
) -> Result<(), Cancelled> {
    fill_each(surface, slabs, control, cross_triangle)
}

fn fill_each(
    surface: &Surface<'_>,
    slabs: &mut [Slab],
    control: &Control<'_>,
    fill: fn(&Surface<'_>, usize, &mut Slab),
) -> Result<(), Cancelled> {
    let reaching = triangles_of_slabs(surface, slabs, 0, control)?;
    let mut parts: Vec<_> = slabs.iter_mut().zip(reaching).collect();
    control.for_each_mut(&mut parts, 1, &|_, (slab, triangles)| {
        for &t in &*triangles {
            if control.is_cancelled() {
                return;
            }
            fill(surface, t as usize, slab);
        }
    })
}

fn cross_triangle(surface: &Surface<'_>, t: usize, slab: &mut Slab) {
    let [nx, ny, nz] = surface.grid.size;
    let own = slab.from..slab.to;
    let corners = surface.corners(t);
    for axis in 0..3 {
        let cells = [0..nx, 0..ny, own.clone()];
        for_each_crossing(corners, axis, &cells, CRACK, &mut |crossing| {
            let [x, y, z] = crossing.cell((crossing.along + 0.5).floor() as i64);
            let near = |c: i64, count: u32| c.clamp(0, i64::from(count) - 1) as u32;
            let cell = [near(x, nx), near(y, ny), near(z, nz)];
            if own.contains(&cell[2])
                && let Some(color) = surface.color(t, crossing.place())
            {
                slab.fill(cell, surface.mesh.slot(t) as u16, color);
            }
        });
    }
}

/// Fills the cells of a slab that a triangle touches.
fn fill_triangle(surface: &Surface<'_>, t: usize, slab: &mut Slab) {
    let &Surface { scene, object, mesh, grid } = surface;
    let half = DVec3::splat(grid.cell * 0.5);
    let corners = mesh.corners(t).map(Vec3::as_dvec3);
    let box_ = Aabb::of_points(corners);
    let (low, high) = (grid.clamp_cell(box_.min), grid.clamp_cell(box_.max));
    for z in low[2].max(slab.from)..=high[2].min(slab.to - 1) {
        for y in low[1]..=high[1] {
            for x in low[0]..=high[0] {
                let middle = grid.corner([x, y, z]) + half;
                if !triangle_touches_box(corners, middle, half) {
                    continue;
                }
                let weights = closest_weights(corners, middle).as_vec3();
                if let Some(color) = triangle_color(scene, object, mesh, t, weights) {
                    slab.fill([x, y, z], mesh.slot(t) as u16, color);
                }
            }
        }
    }
}

/// Tells whether a triangle and a box share a point.
///
/// Source: T. Akenine-Möller, *Fast 3D triangle-box overlap testing*, JGT 6(1), 2001 (separating axes).
pub(in super::super) fn triangle_touches_box(corners: [DVec3; 3], middle: DVec3, half: DVec3) -> bool {
    let [a, b, c] = corners.map(|p| p - middle);
    let edges = [b - a, c - b, a - c];
    let separated = |axis: DVec3| {
        let p = [a.dot(axis), b.dot(axis), c.dot(axis)];
        let reach = half.dot(axis.abs()) * (1.0 + 1e-12);
        p[0].min(p[1]).min(p[2]) > reach || p[0].max(p[1]).max(p[2]) < -reach
    };
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    !(axes.iter().any(|&x| separated(x))
        || separated(edges[0].cross(edges[1]))
        || edges.iter().any(|e| axes.iter().any(|x| separated(x.cross(*e)))))
}
