//! Which triangles approximate the zero surface of a scalar field?
//!
//! Dual contouring on a uniform grid: one vertex in each cell that the surface crosses, placed where the
//! tangent planes of the crossings meet best, so that creases of set operations stay sharp.
//!
//! Source: T. Ju, F. Losasso, S. Schaefer, J. Warren, *Dual contouring of Hermite data*, SIGGRAPH 2002. Cells
//! are found by interval bounds instead of an octree of samples, so no sheet thinner than a cell is skipped
//! before its corners have been looked at.

use super::MeshSize;
use crate::math::Aabb;
use crate::scene::{FreeForm, Mesh, Volume};
use crate::seam::{Cancelled, Control};
use glam::{DMat3, DVec3, Vec3};
use std::collections::HashMap;

/// Most cells along an edge.
pub(super) const FINEST: u32 = 256;

/// A function that is positive inside.
trait Field: Sync {
    fn value(&self, p: DVec3) -> f64;
    fn gradient(&self, p: DVec3) -> DVec3;
    fn value_and_gradient(&self, p: DVec3) -> (f64, DVec3) {
        (self.value(p), self.gradient(p))
    }
}

impl Field for FreeForm {
    fn value(&self, p: DVec3) -> f64 {
        self.form().value(p)
    }
    fn gradient(&self, p: DVec3) -> DVec3 {
        self.form().value_and_gradient(p).1
    }
    fn value_and_gradient(&self, p: DVec3) -> (f64, DVec3) {
        self.form().value_and_gradient(p)
    }
}

/// Where a volume's opacity passes half of its greatest, cut off by its box and shell.
struct VolumeSurface<'a> {
    volume: &'a Volume,
    bounds: Aabb,
    level: f64,
}

impl<'a> VolumeSurface<'a> {
    fn of(volume: &'a Volume) -> Self {
        Self { volume, bounds: volume.bounds(), level: f64::from(volume.transfer.surface_value()) }
    }
}

impl Field for VolumeSurface<'_> {
    fn value(&self, p: DVec3) -> f64 {
        let value = self.volume.value(p);
        let depth = (p - self.bounds.min).min(self.bounds.max - p).min_element();
        let range = f64::from(self.volume.range()[1] - self.volume.range()[0]).max(1e-30);
        let inside = if value.is_nan() { -range } else { value - self.level };
        let cut = (inside / range).min(depth / self.bounds.radius());
        self.volume.shell.as_ref().map_or(cut, |shell| cut.min(shell.form().value(p)))
    }
    fn gradient(&self, p: DVec3) -> DVec3 {
        let h = self.volume.spacing().min_element() * 0.5;
        let slope = |axis: DVec3| self.value(p + axis * h) - self.value(p - axis * h);
        DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z))
    }
}

/// Triangulates a free form; the resolution is doubled until the tolerance is met or `finest` is reached.
///
/// The bound is the greatest distance found at the middles of edges and faces (first order, `|F| / |grad F|`),
/// half as much again for what lies between.
pub(super) fn of_form(
    form: &FreeForm,
    tolerance: f64,
    finest: u32,
    control: &Control<'_>,
) -> Result<(Mesh, f64), Cancelled> {
    let form = &form.lowered();
    let mut resolution = 32.min(finest.max(4));
    let mut last_worst = f64::INFINITY;
    loop {
        let grid = Grid::around(&form.bounds(), resolution);
        let cells = grid.cells_by_intervals(form, control)?;
        let mesh = contour(form, &grid, &cells, control)?;
        let (worst, most) = deviation(form, &mesh, grid.cell, control)?;
        // On smooth parts the error falls to a quarter with each halving of the cells; where creases meet, only
        // to a half. For a last hundredth of the surface that is not worth it: the bound says what was reached.
        let at_creases = most * 1.5 <= tolerance && worst > 0.35 * last_worst;
        if worst * 1.5 <= tolerance || at_creases || resolution * 2 > finest {
            return Ok((mesh, worst * 1.5));
        }
        last_worst = worst;
        resolution *= 2;
    }
}

/// Tells how large a mesh [`of_form`] would make, and its bound. A surface cannot be counted without finding it: it is
/// found on coarse grids, and goes on from there as it went so far.
pub(super) fn forecast(
    form: &FreeForm,
    tolerance: f64,
    finest: u32,
    control: &Control<'_>,
) -> Result<(MeshSize, f64), Cancelled> {
    /// Finest grid on which it is found.
    const FOUND: u32 = 64;
    let form = &form.lowered();
    let mut resolution = 32.min(finest.max(4));
    let mut last: Option<(f64, Mesh)> = None;
    loop {
        let grid = Grid::around(&form.bounds(), resolution);
        let mesh = contour(form, &grid, &grid.cells_by_intervals(form, control)?, control)?;
        let (worst, most) = deviation(form, &mesh, grid.cell, control)?;
        let before = last.as_ref().map_or(f64::INFINITY, |(worst, _)| *worst);
        let at_creases = most * 1.5 <= tolerance && worst > 0.35 * before;
        if worst * 1.5 <= tolerance || at_creases || resolution * 2 > finest {
            return Ok((size_of_contour(&mesh, 1.0), worst * 1.5));
        }
        if resolution >= FOUND {
            // Four times as many cells, and errors that fall as they fell, for each further halving.
            let falls = (worst / before).clamp(0.25, 0.5);
            let (mut bound, mut rest, mut times) = (worst * 1.5, most * 1.5, 1.0);
            while resolution * 2 <= finest {
                (bound, rest, times) = (bound * falls, rest * 0.25, times * 4.0);
                resolution *= 2;
                if bound <= tolerance || (rest <= tolerance && falls > 0.27) {
                    break;
                }
            }
            return Ok((size_of_contour(&mesh, times), bound));
        }
        last = Some((worst, mesh));
        resolution *= 2;
    }
}

fn size_of_contour(mesh: &Mesh, times: f64) -> MeshSize {
    let (vertices, triangles) = (mesh.positions.len() as f64 * times, mesh.triangles.len() as f64 * times);
    MeshSize { vertices, triangles, each: [24.0, 12.0], is_exact: times == 1.0 }
}

/// Tells how large a mesh [`of_volume`] would make: two triangles for each edge between a sample inside and one outside,
/// and for each cell that the surface crosses a vertex with a color, or several at a crease. How many is found out in
/// some layers of cells.
pub(super) fn forecast_of_volume(volume: &Volume, control: &Control<'_>) -> Result<MeshSize, Cancelled> {
    let level = volume.transfer.surface_value();
    let [nx, ny, nz] = volume.size().map(|s| s as usize);
    let is_inside = |i: usize| volume.samples().get(i) >= level;
    let mut edges = 0u64;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let i = (z * ny + y) * nx + x;
                let own = is_inside(i);
                // The last along an axis ends at nothing; so does the first on its other side.
                let next = [(x + 1 < nx, i + 1), (y + 1 < ny, i + nx), (z + 1 < nz, i + nx * ny)];
                edges += next.iter().filter(|&&(there, j)| own != (there && is_inside(j))).count() as u64;
                edges += u64::from(own) * [x, y, z].iter().filter(|&&c| c == 0).count() as u64;
            }
        }
    }
    let cells = surface_cells(volume, control)?;
    let vertices = cells.len() as f64 * vertices_a_cell(volume, &cells, control)?;
    Ok(MeshSize { vertices, triangles: edges as f64 * 2.0, each: [36.0, 12.0], is_exact: false })
}

/// Finds the surface in some layers of cells, and counts the vertices of a cell.
fn vertices_a_cell(volume: &Volume, cells: &[[u32; 3]], control: &Control<'_>) -> Result<f64, Cancelled> {
    /// Layers that lie together; the outer ones only serve those between.
    const LAYERS: u32 = 6;
    /// Cells in which the surface is found.
    const CELLS: usize = 8192;
    let groups = volume.size()[2] / LAYERS + 1;
    let every = (cells.len() / CELLS) as u32 + 1;
    let first = (groups / 2) % every;
    let few: Vec<[u32; 3]> = cells.iter().copied().filter(|c| c[2] / LAYERS % every == first).collect();
    let is_inner = |layer: u32| every == 1 || (1..LAYERS - 1).contains(&(layer % LAYERS));
    let (surface, grid) = (VolumeSurface::of(volume), Grid::of(volume));
    let mesh = contour(&surface, &grid, &few, control)?;
    let layer_of = |p: &Vec3| ((f64::from(p.z) - grid.first.z) / grid.step.z) as u32;
    let vertices = mesh.positions.iter().filter(|p| is_inner(layer_of(p))).count();
    let inner = few.iter().filter(|c| is_inner(c[2])).count();
    Ok(if inner == 0 { 1.0 } else { vertices as f64 / inner as f64 })
}

/// Triangulates the surface of a volume at the resolution of its samples; the bound is a cell's diagonal.
pub(super) fn of_volume(volume: &Volume, control: &Control<'_>) -> Result<(Mesh, f64), Cancelled> {
    let (surface, grid) = (VolumeSurface::of(volume), Grid::of(volume));
    let cells = surface_cells(volume, control)?;
    let mut mesh = contour(&surface, &grid, &cells, control)?;
    mesh.colors = mesh
        .positions
        .iter()
        .map(|p| {
            let value = volume.value(p.as_dvec3()) as f32;
            // On the cut faces of the box the field is anything above the level.
            volume.transfer.at(value.max(volume.transfer.surface_value())).0
        })
        .collect();
    Ok((mesh, volume.spacing().length()))
}

/// Lists the cells between samples whose corners lie on both sides of the surface; the grid is one sample
/// larger on each side, where the field counts as empty.
fn surface_cells(volume: &Volume, control: &Control<'_>) -> Result<Vec<[u32; 3]>, Cancelled> {
    let level = volume.transfer.surface_value();
    let [nx, ny, nz] = volume.size().map(|s| s as usize);
    // A sample on the level itself may come out on either side when it is interpolated: it counts as both.
    let range = volume.range();
    let slack = (range[1] - range[0]).abs() * 1e-6;
    let at = |x: usize, y: usize, z: usize| -> (bool, bool) {
        if x == 0 || y == 0 || z == 0 || x > nx || y > ny || z > nz {
            return (false, true);
        }
        let value = volume.samples().get(((z - 1) * ny + y - 1) * nx + x - 1);
        // What is not a number is outside.
        (value >= level - slack, value.is_nan() || value <= level + slack)
    };
    let mut cells = Vec::new();
    for z in 0..=nz {
        for y in 0..=ny {
            control.check()?;
            for x in 0..=nx {
                let corners = (0..8).map(|c| at(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)));
                let (inside, outside) =
                    corners.fold((false, false), |all, one| (all.0 | one.0, all.1 | one.1));
                if inside && (outside || volume.shell.is_some()) {
                    cells.push([x as u32, y as u32, z as u32]);
                }
            }
        }
    }
    Ok(cells)
}

/// Cells or triangles for one worker at a time: less than a millisecond's work where a form has few parts.
const PIECE: usize = 128;
/// Cells along the edge of what one thread looks through.
const BLOCK: u32 = 32;

/// A box of cells.
struct Grid {
    first: DVec3,
    step: DVec3,
    cell: f64,
    size: [u32; 3],
}

impl Grid {
    /// Cuts a box into cubes, `resolution` along its longest edge, with a margin of one cell all around.
    fn around(bounds: &Aabb, resolution: u32) -> Self {
        let step = bounds.size().max_element() / f64::from(resolution);
        let size = bounds.size().to_array().map(|edge| (edge / step).ceil() as u32 + 2);
        let covered = DVec3::from_array(size.map(f64::from)) * step;
        // An odd offset keeps flat faces, which like to lie on simple fractions, off the grid planes.
        let first = bounds.center() - covered * 0.5 + DVec3::new(0.0131, 0.0077, 0.0109) * step;
        Self { first, step: DVec3::splat(step), cell: step, size }
    }

    /// Lays cells between the samples of a volume, and around them.
    fn of(volume: &Volume) -> Self {
        Self {
            first: volume.bounds().min - volume.spacing() * 0.5,
            step: volume.spacing(),
            cell: volume.spacing().length(),
            size: volume.size().map(|s| s + 1),
        }
    }

    fn corner(&self, cell: [u32; 3]) -> DVec3 {
        self.first + DVec3::from_array(cell.map(f64::from)) * self.step
    }

    fn index(&self, cell: [u32; 3]) -> u64 {
        (u64::from(cell[2]) * u64::from(self.size[1]) + u64::from(cell[1])) * u64::from(self.size[0])
            + u64::from(cell[0])
    }

    /// Lists the cells in which the form may vanish.
    fn cells_by_intervals(&self, form: &FreeForm, control: &Control<'_>) -> Result<Vec<[u32; 3]>, Cancelled> {
        let count = self.size.map(|edge| edge.div_ceil(BLOCK) as usize);
        let mut blocks = vec![Vec::new(); count.iter().product()];
        control.for_each_mut(&mut blocks, 1, &|i, cells| {
            let block = [i % count[0], i / count[0] % count[1], i / (count[0] * count[1])];
            let from = block.map(|b| b as u32 * BLOCK);
            let to = std::array::from_fn(|a| (from[a] + BLOCK).min(self.size[a]));
            self.subdivide(form, from, to, cells, control);
        })?;
        let mut cells = blocks.concat();
        cells.sort_unstable_by_key(|&c| self.index(c));
        Ok(cells)
    }

    fn subdivide(
        &self,
        form: &FreeForm,
        from: [u32; 3],
        to: [u32; 3],
        cells: &mut Vec<[u32; 3]>,
        control: &Control<'_>,
    ) {
        if control.is_cancelled() || (0..3).any(|a| from[a] >= to[a]) {
            return;
        }
        let range = form.form().interval(&Aabb::new(self.corner(from), self.corner(to)));
        if !range.contains(0.0) {
            return;
        }
        let longest = (0..3).max_by_key(|&a| to[a] - from[a]).unwrap_or(0);
        if to[longest] - from[longest] == 1 {
            cells.push(from);
            return;
        }
        let middle = from[longest] + (to[longest] - from[longest]) / 2;
        let (mut left_to, mut right_from) = (to, from);
        left_to[longest] = middle;
        right_from[longest] = middle;
        self.subdivide(form, from, left_to, cells, control);
        self.subdivide(form, right_from, to, cells, control);
    }
}

/// What a cell contributes: its vertex, and which of its three edges at the low corner cross the surface.
#[derive(Clone, Copy, Default)]
struct CellSurface {
    vertex: Option<DVec3>,
    /// For each axis: 0 no crossing, 1 from inside to outside along the axis, -1 the other way.
    crossing: [i8; 3],
}

/// Ends of the twelve edges of a cell as corner numbers (bit 0 = x, bit 1 = y, bit 2 = z).
const EDGES: [(usize, usize); 12] =
    [(0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)];

fn contour(
    field: &impl Field,
    grid: &Grid,
    cells: &[[u32; 3]],
    control: &Control<'_>,
) -> Result<Mesh, Cancelled> {
    let mut surfaces = vec![CellSurface::default(); cells.len()];
    control.for_each_mut(&mut surfaces, PIECE, &|i, surface| {
        *surface = cell_surface(field, grid, cells[i]);
    })?;

    let mut positions = Vec::new();
    let mut vertex_of: HashMap<u64, u32> = HashMap::new();
    for (cell, surface) in cells.iter().zip(&surfaces) {
        control.check()?;
        if let Some(vertex) = surface.vertex {
            vertex_of.insert(grid.index(*cell), positions.len() as u32);
            positions.push(vertex);
        }
    }
    let mut quads = Vec::new();
    for (cell, surface) in cells.iter().zip(&surfaces) {
        control.check()?;
        for axis in 0..3 {
            if surface.crossing[axis] != 0
                && let Some(quad) = quad_around_edge(grid, &vertex_of, *cell, axis, surface.crossing[axis])
            {
                quads.push((quad, [[0; 3]; 2]));
            }
        }
    }
    control.for_each_mut(&mut quads, PIECE, &|_, (quad, halves)| {
        *halves = split_quad(*quad, &positions, field);
    })?;
    let triangles: Vec<[u32; 3]> = quads.into_iter().flat_map(|(_, halves)| halves).collect();
    with_normals(field, &positions, &triangles, control)
}

fn cell_surface(field: &impl Field, grid: &Grid, cell: [u32; 3]) -> CellSurface {
    let corner = |i: usize| {
        grid.corner([cell[0] + (i & 1) as u32, cell[1] + (i >> 1 & 1) as u32, cell[2] + (i >> 2 & 1) as u32])
    };
    let values: [f64; 8] = std::array::from_fn(|i| field.value(corner(i)));
    let inside = values.map(|v| v >= 0.0);
    let crossing = [1, 2, 4].map(|far| i8::from(inside[0]) - i8::from(inside[far]));
    let mut points = [(DVec3::ZERO, DVec3::ZERO); 12];
    let mut count = 0;
    for (a, b) in EDGES {
        if inside[a] != inside[b] {
            let p = crossing_point(field, corner(a), corner(b), values[a], values[b]);
            points[count] = (p, field.gradient(p).normalize_or_zero());
            count += 1;
        }
    }
    if count == 0 {
        return CellSurface { vertex: None, crossing };
    }
    let vertex = meet(&points[..count]);
    let low = corner(0);
    CellSurface { vertex: Some(vertex.clamp(low, low + grid.step)), crossing }
}

/// Finds where an edge crosses the surface, to 2^-24 of the edge: by the regula falsi, which halves the value of
/// an end that stays (Illinois), and by bisection where that is slow.
fn crossing_point(field: &impl Field, a: DVec3, b: DVec3, value_a: f64, value_b: f64) -> DVec3 {
    const CLOSE: f64 = 1.0 / (1 << 24) as f64;
    let inside = value_a >= 0.0;
    let (mut near, mut far) = ((0.0, value_a), (1.0, value_b));
    let (mut at, mut moved_near) = (0.5, None);
    for step in 0..48 {
        let share: f64 = near.1 / (near.1 - far.1);
        // Every third step halves: a crease may hold the others back.
        let next = if step % 3 == 2 || !share.is_finite() { 0.5 } else { share.clamp(0.0, 1.0) };
        let next = near.0 + (far.0 - near.0) * next;
        let is_close = (next - at).abs() < CLOSE && step > 0;
        at = next;
        if is_close || far.0 - near.0 < CLOSE {
            break;
        }
        let value = field.value(a.lerp(b, at));
        if (value >= 0.0) == inside {
            near = (at, value);
            far.1 *= if moved_near == Some(true) { 0.5 } else { 1.0 };
            moved_near = Some(true);
        } else {
            far = (at, value);
            near.1 *= if moved_near == Some(false) { 0.5 } else { 1.0 };
            moved_near = Some(false);
        }
    }
    a.lerp(b, at)
}

/// Finds the point nearest to all tangent planes, and among those as near as possible to the middle of the
/// crossings: the least squares of `n_i . (x - p_i)` plus a hundredth of the distance to the middle.
fn meet(points: &[(DVec3, DVec3)]) -> DVec3 {
    let middle = points.iter().map(|(p, _)| *p).sum::<DVec3>() / points.len() as f64;
    let mut matrix = DMat3::from_diagonal(DVec3::splat(0.01));
    let mut right = DVec3::ZERO;
    for (p, n) in points {
        matrix += DMat3::from_cols(*n * n.x, *n * n.y, *n * n.z);
        right += *n * n.dot(*p - middle);
    }
    middle + matrix.inverse() * right
}

/// Returns the vertices of the four cells around an edge, wound so that the face looks outward.
fn quad_around_edge(
    grid: &Grid,
    vertex_of: &HashMap<u64, u32>,
    cell: [u32; 3],
    axis: usize,
    crossing: i8,
) -> Option<[u32; 4]> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    if cell[u] == 0 || cell[v] == 0 {
        return None;
    }
    let at = |back_u: u32, back_v: u32| {
        let mut c = cell;
        c[u] -= back_u;
        c[v] -= back_v;
        vertex_of.get(&grid.index(c)).copied()
    };
    let ring = [at(1, 1)?, at(0, 1)?, at(0, 0)?, at(1, 0)?];
    Some(if crossing > 0 { ring } else { [ring[0], ring[3], ring[2], ring[1]] })
}

/// Cuts a quad along the diagonal whose middle is nearer to the surface.
fn split_quad(quad: [u32; 4], positions: &[DVec3], field: &impl Field) -> [[u32; 3]; 2] {
    let p = quad.map(|i| positions[i as usize]);
    let off = |a: DVec3, b: DVec3| field.value((a + b) * 0.5).abs();
    let [a, b, c, d] = quad;
    if off(p[0], p[2]) <= off(p[1], p[3]) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
}

/// Cosine of the angle up to which the corners of neighboring faces share a normal: 30 degrees.
const SAME_NORMAL: f32 = 0.866;

/// Gives each corner the gradient a little inside its own triangle, so that creases stay sharp.
fn with_normals(
    field: &impl Field,
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    control: &Control<'_>,
) -> Result<Mesh, Cancelled> {
    let mut normals: Vec<Option<[Vec3; 3]>> = vec![None; triangles.len()];
    control.for_each_mut(&mut normals, PIECE, &|t, normals| {
        let [a, b, c] = triangles[t].map(|i| positions[i as usize]);
        let flat = (b - a).cross(c - a);
        let middle = (a + b + c) / 3.0;
        let normal_at = |p: DVec3| {
            let normal = -field.gradient(p.lerp(middle, 0.3)).normalize_or_zero();
            if normal.dot(flat) > 0.0 { normal } else { flat.normalize_or(DVec3::Y) }.as_vec3()
        };
        *normals = (flat.length_squared() != 0.0).then(|| [a, b, c].map(normal_at));
    })?;
    let mut mesh = Mesh::default();
    let mut variants: Vec<Vec<u32>> = vec![Vec::new(); positions.len()];
    for (triangle, normals) in triangles.iter().zip(normals) {
        control.check()?;
        let Some(normals) = normals else { continue };
        let corners = std::array::from_fn(|k| {
            let (i, normal) = (triangle[k] as usize, normals[k]);
            let known = &mut variants[i];
            let same = known.iter().find(|&&k| mesh.normals[k as usize].dot(normal) > SAME_NORMAL);
            same.copied().unwrap_or_else(|| {
                mesh.positions.push(positions[i].as_vec3());
                mesh.normals.push(normal);
                known.push(mesh.positions.len() as u32 - 1);
                mesh.positions.len() as u32 - 1
            })
        });
        mesh.triangles.push(corners);
    }
    Ok(mesh)
}

/// Returns the greatest distance of the middles of edges and faces from the surface, to first order, and the one
/// below which 99 of 100 lie.
fn deviation(
    field: &impl Field,
    mesh: &Mesh,
    cell: f64,
    control: &Control<'_>,
) -> Result<(f64, f64), Cancelled> {
    let mut by_triangle = vec![[0.0_f64; 5]; mesh.triangles.len()];
    control.for_each_mut(&mut by_triangle, PIECE, &|t, distances| {
        let [a, b, c] = mesh.corners(t).map(glam::Vec3::as_dvec3);
        let places = [(a + b) * 0.5, (b + c) * 0.5, (a + c) * 0.5, (a + b + c) / 3.0, a];
        *distances = places.map(|p| {
            let (value, gradient) = field.value_and_gradient(p);
            let slope = gradient.length();
            let distance = if slope > 0.0 { value.abs() / slope } else { cell };
            distance.min(cell * 2.0)
        });
    })?;
    let distances = by_triangle.as_flattened_mut();
    if distances.is_empty() {
        return Ok((cell, cell));
    }
    let worst = distances.iter().copied().fold(0.0, f64::max);
    let at = distances.len() * 99 / 100;
    Ok((worst, *distances.select_nth_unstable_by(at, f64::total_cmp).1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Form, Primitive, Samples};

    /// Counts edges that do not belong to two triangles, vertices welded by position.
    fn open_edges(mesh: &Mesh) -> usize {
        let key = |i: u32| mesh.positions[i as usize].to_array().map(f32::to_bits);
        let mut edges = HashMap::new();
        for t in &mesh.triangles {
            for k in 0..3 {
                let (a, b) = (key(t[k]), key(t[(k + 1) % 3]));
                *edges.entry(if a < b { (a, b) } else { (b, a) }).or_insert(0) += 1;
            }
        }
        edges.values().filter(|&&n| n % 2 == 1).count()
    }

    #[test]
    fn a_sphere_and_a_torus_close_and_agree_with_closed_forms() {
        use std::f64::consts::PI;
        let sphere =
            FreeForm::new(Form::Ellipsoid { center: DVec3::new(0.1, 0.2, 0.3), radii: DVec3::ONE }).unwrap();
        let torus = FreeForm::new(Form::Torus { major: 0.7, minor: 0.3 }).unwrap();
        for (form, volume) in [(sphere, 4.0 / 3.0 * PI), (torus, 2.0 * PI * PI * 0.7 * 0.09)] {
            let (mesh, bound) = of_form(&form, 2e-3, 256, &Control::simple()).unwrap();
            assert!(bound <= 2e-3, "{bound}");
            assert_eq!(open_edges(&mesh), 0);
            assert!((mesh.volume() - volume).abs() < mesh.area() * bound, "{} for {volume}", mesh.volume());
        }
    }

    #[test]
    fn creases_of_a_box_stay_sharp() {
        let form = FreeForm::from_primitive(&Primitive::Box { size: DVec3::new(1.0, 0.7, 1.3) }).unwrap();
        let (mesh, _) = of_form(&form, 1e-3, 32, &Control::simple()).unwrap();
        assert!((mesh.volume() - 0.91).abs() < 2e-3, "{}", mesh.volume());
        assert!((mesh.area() - 2.0 * (0.7 + 1.3 + 0.91)).abs() < 1e-2, "{}", mesh.area());
        let slanted = mesh.normals.iter().filter(|n| n.abs().max_element() < 0.999).count();
        assert!(
            slanted * 100 < mesh.normals.len(),
            "{slanted} of {} normals are not a face's",
            mesh.normals.len()
        );
    }

    #[test]
    fn the_surface_of_a_volume_closes_at_the_level() {
        let n = 24u32;
        let mut samples = Vec::new();
        for z in 0..n {
            for y in 0..n {
                for x in 0..n {
                    let p = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) + 0.5 - 12.0;
                    samples.push((8.0 - p.length()) as f32);
                }
            }
        }
        let mut volume = Volume::new([n; 3], DVec3::ONE, Samples::F32(samples)).unwrap();
        volume.transfer.points = vec![
            crate::scene::TransferPoint { value: -0.5, color: glam::Vec3::ONE, opacity: 0.0 },
            crate::scene::TransferPoint { value: 0.5, color: glam::Vec3::ONE, opacity: 1.0 },
        ];
        let (mesh, bound) = of_volume(&volume, &Control::simple()).unwrap();
        assert_eq!(open_edges(&mesh), 0);
        let worst = mesh.positions.iter().map(|p| (p.as_dvec3().length() - 8.0).abs()).fold(0.0, f64::max);
        assert!(worst < 0.1 && worst < bound, "{worst}");
    }
}
