//! How far is each point of a grid from a mesh, and on which side?
//!
//! Distances are exact within a band around the surface. The side is found by counting crossings along the
//! three axes, two of three win, so small holes do no harm. Sheets that enclose nothing get a thickness of one
//! and a half steps instead.

use super::palette::{ColorCollector, ColorKey, triangle_color};
use super::{ConvertError, DistanceModel};
use crate::math::Aabb;
use crate::scene::{Mesh, Object, Scene};
use crate::seam::{Cancelled, Control};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// Samples that are colored by one worker at a time: less than a millisecond's work.
const COLORED: usize = 1024;

/// Returns the number of samples along each axis and their distance.
pub(super) fn grid_size(bounds: &Aabb, tolerance: f64, max_resolution: u32) -> ([u32; 3], f64) {
    let longest = bounds.size().max_element().max(1e-300);
    let wanted = longest * bound(1.0) / tolerance.max(1e-300);
    let resolution = wanted.ceil().clamp(8.0, f64::from(max_resolution.max(8)));
    let step = longest / resolution;
    let margin = 2.0 * (DistanceModel::BAND + 1.0);
    (bounds.size().to_array().map(|edge| (edge / step + margin).ceil() as u32 + 1), step)
}

/// Returns the greatest distance between the surface and the zero level of its interpolated distances: half a
/// cell's diagonal, at corners; on smooth parts the error is of second order in the step.
pub(super) fn bound(step: f64) -> f64 {
    step * 3f64.sqrt() * 0.5
}

pub(super) fn of_mesh(
    scene: &Scene,
    object: &Object,
    mesh: &Mesh,
    tolerance: f64,
    max_resolution: u32,
    control: &Control<'_>,
) -> Result<DistanceModel, ConvertError> {
    let bounds = mesh.bounds();
    if bounds.is_empty() || mesh.triangles.is_empty() {
        return Err(ConvertError::of(object, "it has no triangles"));
    }
    let (size, step) = grid_size(&bounds, tolerance, max_resolution);
    let covered = DVec3::from_array(size.map(|s| f64::from(s - 1))) * step;
    let first = bounds.center() - covered * 0.5;
    let grid = Grid { size, step, first };
    let mut nearest = nearest_triangles(mesh, &grid, control)?;
    let open = is_open(mesh, control)?;
    let inside = if open { vec![false; nearest.len()] } else { inside_votes(mesh, &grid, control)? };
    let band = step * DistanceModel::BAND;
    let half_sheet = if open { step * 0.75 } else { 0.0 };

    let mut noted: Vec<Option<(ColorKey, Vec3)>> = vec![None; nearest.len()];
    let mut pairs: Vec<_> = nearest.iter_mut().zip(&mut noted).collect();
    control.for_each_mut(&mut pairs, COLORED, &|i, (near, noted)| {
        let Some(triangle) = near.triangle else { return };
        let corners = mesh.corners(triangle as usize).map(glam::Vec3::as_dvec3);
        let weights = closest_weights(corners, grid.sample(i)).as_vec3();
        match triangle_color(scene, object, mesh, triangle as usize, weights) {
            Some(color) => {
                let slot = mesh.slot(triangle as usize) as u16;
                **noted = Some((ColorCollector::key(slot, color), color));
            }
            // A hole of the texture: nothing is near.
            None => near.distance = band,
        }
    })?;
    drop(pairs);
    let mut colors = ColorCollector::default();
    for &(key, color) in noted.iter().flatten() {
        control.check()?;
        colors.note(key, color, 1);
    }
    let palette = colors.choose(scene, object);
    let distances = nearest
        .iter()
        .zip(&inside)
        .map(|(near, &inside)| {
            let distance = near.distance.min(band);
            let signed = if open {
                half_sheet - distance
            } else if inside {
                distance
            } else {
                -distance
            };
            signed as f32
        })
        .collect();
    let [x, y, z] = size;
    let sheet = if open { ", open: drawn as a sheet 1.5 steps thick" } else { "" };
    Ok(DistanceModel {
        size,
        first,
        step,
        distances,
        colors: noted.iter().map(|noted| noted.map_or(0, |(key, _)| palette.byte(key))).collect(),
        palette: palette.materials,
        half_sheet,
        bound: bound(step) + half_sheet,
        why: format!("{x}x{y}x{z} signed distances{sheet}"),
    })
}

struct Grid {
    size: [u32; 3],
    step: f64,
    first: DVec3,
}

impl Grid {
    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] as usize + y) * self.size[0] as usize + x
    }

    fn sample(&self, index: usize) -> DVec3 {
        let [nx, ny, _] = self.size.map(|s| s as usize);
        let cell = [index % nx, index / nx % ny, index / (nx * ny)];
        self.first + DVec3::from_array(cell.map(|c| c as f64)) * self.step
    }

    /// Returns the samples from `low` to `high` along an axis, widened by a margin.
    fn span(&self, axis: usize, low: f64, high: f64, margin: f64) -> std::ops::Range<usize> {
        let place = |c: f64| (c - self.first[axis]) / self.step;
        let last = f64::from(self.size[axis] - 1);
        let from = (place(low) - margin).ceil().clamp(0.0, last + 1.0);
        let to = (place(high) + margin).floor().clamp(-1.0, last);
        from as usize..(to + 1.0) as usize
    }
}

#[derive(Clone, Copy)]
struct Nearest {
    distance: f64,
    triangle: Option<u32>,
}

/// Finds the nearest triangle of every sample within the band, slab by slab; ties go to the lower index.
fn nearest_triangles(mesh: &Mesh, grid: &Grid, control: &Control<'_>) -> Result<Vec<Nearest>, Cancelled> {
    let far = Nearest { distance: f64::INFINITY, triangle: None };
    let slab = grid.size[0] as usize * grid.size[1] as usize;
    // Triangles by the slabs that they can reach, so that threads need not share anything.
    let mut of_slab: Vec<Vec<u32>> = vec![Vec::new(); grid.size[2] as usize];
    for t in 0..mesh.triangles.len() {
        control.check()?;
        let corners = mesh.corners(t);
        if corners.iter().all(|p| p.is_finite()) {
            let box_ = Aabb::of_points(corners.map(glam::Vec3::as_dvec3));
            for z in grid.span(2, box_.min.z, box_.max.z, DistanceModel::BAND) {
                of_slab[z].push(t as u32);
            }
        }
    }
    let mut nearest = vec![far; slab * grid.size[2] as usize];
    let mut slabs: Vec<(&mut [Nearest], &[u32])> =
        nearest.chunks_mut(slab).zip(of_slab.iter().map(Vec::as_slice)).collect();
    control.for_each_mut(&mut slabs, 1, &|z, (samples, triangles)| {
        for &t in *triangles {
            if control.is_cancelled() {
                return;
            }
            let corners = mesh.corners(t as usize).map(glam::Vec3::as_dvec3);
            let box_ = Aabb::of_points(corners);
            for y in grid.span(1, box_.min.y, box_.max.y, DistanceModel::BAND) {
                for x in grid.span(0, box_.min.x, box_.max.x, DistanceModel::BAND) {
                    let p = grid.first + DVec3::new(x as f64, y as f64, z as f64) * grid.step;
                    let w = closest_weights(corners, p);
                    let distance = p.distance(corners[0] * w.x + corners[1] * w.y + corners[2] * w.z);
                    let sample = &mut samples[grid.index([x, y, 0])];
                    if distance < sample.distance {
                        *sample = Nearest { distance, triangle: Some(t) };
                    }
                }
            }
        }
    })?;
    Ok(nearest)
}

/// Returns the barycentric coordinates of the point of a triangle that is nearest to `p`.
///
/// Source: C. Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5.
pub(super) fn closest_weights([a, b, c]: [DVec3; 3], p: DVec3) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return DVec3::X;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return DVec3::Y;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return DVec3::new(1.0 - v, v, 0.0);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return DVec3::Z;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return DVec3::new(1.0 - w, 0.0, w);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return DVec3::new(0.0, 1.0 - w, w);
    }
    let sum = va + vb + vc;
    if sum > 0.0 { DVec3::new(va, vb, vc) / sum } else { DVec3::X }
}

/// Tells whether more than one in a hundred edges belongs to one triangle only.
fn is_open(mesh: &Mesh, control: &Control<'_>) -> Result<bool, Cancelled> {
    let (border, all) = border_edges(mesh, control)?;
    Ok(border * 100 > all)
}

/// Counts the edges that belong to one triangle only, and all edges, vertices welded to a millionth of the size.
pub(super) fn border_edges(mesh: &Mesh, control: &Control<'_>) -> Result<(usize, usize), Cancelled> {
    let grid = mesh.bounds().radius().max(1e-30) * 1e-6;
    let key = |i: u32| (mesh.positions[i as usize].as_dvec3() / grid).round().to_array().map(|c| c as i64);
    let mut edges: HashMap<_, u32> = HashMap::with_capacity(mesh.triangles.len() * 2);
    for t in &mesh.triangles {
        control.check()?;
        for k in 0..3 {
            let (a, b) = (key(t[k]), key(t[(k + 1) % 3]));
            *edges.entry(if a < b { (a, b) } else { (b, a) }).or_insert(0) += 1;
        }
    }
    Ok((edges.values().filter(|&&n| n == 1).count(), edges.len()))
}

/// Tells for each sample whether it is inside, by the majority of three parity counts.
fn inside_votes(mesh: &Mesh, grid: &Grid, control: &Control<'_>) -> Result<Vec<bool>, Cancelled> {
    let count = grid.size.iter().map(|&s| s as usize).product();
    let mut votes = [const { Vec::new() }; 3];
    control.for_each_mut(&mut votes, 1, &|axis, votes| {
        *votes = vec![0u8; count];
        count_crossings(mesh, grid, axis, votes, control);
    })?;
    let [x, y, z] = &votes;
    Ok((0..count).map(|i| x[i] + y[i] + z[i] >= 2).collect())
}

/// Casts a line through every row of samples along an axis and adds a vote to those behind an odd number of
/// crossings, until the host wants to stop. Lines are moved by a tiny irrational step so that they miss vertices and
/// edges on the grid.
fn count_crossings(mesh: &Mesh, grid: &Grid, axis: usize, votes: &mut [u8], control: &Control<'_>) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let nudge = [grid.step * 1.234_567e-5, grid.step * 2.718_281e-5];
    let (nu, nv) = (grid.size[u] as usize, grid.size[v] as usize);
    let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); nu * nv];
    for t in 0..mesh.triangles.len() {
        if control.is_cancelled() {
            return;
        }
        let corners = mesh.corners(t).map(glam::Vec3::as_dvec3);
        if corners.iter().any(|p| !p.is_finite()) {
            continue;
        }
        let box_ = Aabb::of_points(corners);
        for j in grid.span(v, box_.min[v], box_.max[v], 0.01) {
            for i in grid.span(u, box_.min[u], box_.max[u], 0.01) {
                let line = [
                    grid.first[u] + i as f64 * grid.step + nudge[0],
                    grid.first[v] + j as f64 * grid.step + nudge[1],
                ];
                if let Some(at) = cross_line(corners, axis, u, v, line) {
                    crossings[j * nu + i].push(at);
                }
            }
        }
    }
    for j in 0..nv {
        if control.is_cancelled() {
            return;
        }
        for i in 0..nu {
            let list = &mut crossings[j * nu + i];
            list.sort_unstable_by(f64::total_cmp);
            for pair in list.chunks_exact(2) {
                for k in grid.span(axis, pair[0], pair[1], 0.0) {
                    let mut cell = [0; 3];
                    (cell[axis], cell[u], cell[v]) = (k, i, j);
                    votes[grid.index(cell)] += 1;
                }
            }
        }
    }
}

/// Returns where a line parallel to an axis crosses a triangle.
fn cross_line(corners: [DVec3; 3], axis: usize, u: usize, v: usize, line: [f64; 2]) -> Option<f64> {
    let side = |a: DVec3, b: DVec3| (b[u] - a[u]) * (line[1] - a[v]) - (b[v] - a[v]) * (line[0] - a[u]);
    let [a, b, c] = corners;
    let w = [side(b, c), side(c, a), side(a, b)];
    let inside = w.iter().all(|&s| s >= 0.0) || w.iter().all(|&s| s <= 0.0);
    let sum = w[0] + w[1] + w[2];
    (inside && sum != 0.0).then(|| (a[axis] * w[0] + b[axis] * w[1] + c[axis] * w[2]) / sum)
}

#[cfg(test)]
mod tests {
    use super::super::primitive_mesh;
    use super::*;
    use crate::scene::{Primitive, Shape};

    fn model_of(primitive: Primitive, resolution: u32) -> DistanceModel {
        let scene = Scene::default();
        let object = Object::new("o", Shape::Primitive(primitive), 0);
        let (mesh, _) = primitive_mesh::tessellate(&primitive, 1e-4);
        of_mesh(&scene, &object, &mesh, 0.0, resolution, &Control::simple()).unwrap()
    }

    fn samples(model: &DistanceModel) -> impl Iterator<Item = (DVec3, f64)> + '_ {
        let grid = Grid { size: model.size, step: model.step, first: model.first };
        model.distances.iter().enumerate().map(move |(i, &d)| (grid.sample(i), f64::from(d)))
    }

    #[test]
    fn distances_to_a_ball_agree_with_the_closed_form() {
        let model = model_of(Primitive::Sphere { radius: 1.0 }, 24);
        let band = model.step * DistanceModel::BAND;
        for (p, d) in samples(&model) {
            let exact = (1.0 - p.length()).clamp(-band, band);
            assert!((d - exact).abs() < 1.1e-4, "{d} for {exact} at {p}");
        }
    }

    #[test]
    fn a_sheet_gets_a_thickness_and_says_so() {
        let model = model_of(Primitive::Plane { width: 1.0, depth: 1.0 }, 16);
        assert!(model.why.contains("open"), "{}", model.why);
        let (p, d) = samples(&model).min_by(|a, b| a.0.length().total_cmp(&b.0.length())).unwrap();
        assert!((d - (model.step * 0.75 - p.y.abs())).abs() < 1e-6, "{d} at {p}");
    }
}
