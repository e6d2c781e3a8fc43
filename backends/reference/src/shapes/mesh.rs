//! Which triangle of a mesh does a ray meet first, without slipping through shared edges?
//!
//! Source: S. Woop, C. Benthin, I. Wald, *Watertight Ray/Triangle Intersection*, JCGT 2(1), 2013, in double
//! precision and double-sided. An edge function of zero belongs to both neighbors; the lower triangle wins.

use super::Finish;
use crate::bvh::{Bounded, Bvh};
use crate::line::{Hit, Line, Span};
use glam::{DVec3, Vec3};
use polyptych_core::math::Aabb;
use polyptych_core::scene::Mesh;

/// Most triangles in a leaf.
const LEAF: usize = 4;

/// The triangles of a mesh in a tree; triangles with a corner that is not finite are left out.
#[derive(Debug)]
pub(crate) struct MeshTree {
    tree: Bvh,
    /// Corners in the order of the tree's leaves.
    corners: Vec<[Vec3; 3]>,
}

impl MeshTree {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let finite = (0..mesh.triangles.len()).filter(|&t| mesh.corners(t).iter().all(|c| c.is_finite()));
        let bounds = |t: usize| Aabb::of_points(mesh.corners(t).map(Vec3::as_dvec3));
        let tree = Bvh::build(finite.map(|t| Bounded::new(&bounds(t), t)).collect(), LEAF);
        let corners = tree.order().iter().map(|&t| mesh.corners(t as usize)).collect();
        Self { tree, corners }
    }

    /// Foretells [`MeshTree::bytes`].
    pub(crate) fn planned_bytes(mesh: &Mesh) -> u64 {
        Bvh::planned_bytes(mesh.triangles.len(), LEAF) + mesh.triangles.len() as u64 * 36
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.tree.bytes() + self.corners.len() as u64 * 36
    }

    pub(crate) fn first(
        &self,
        mesh: &Mesh,
        line: &Line,
        mut span: Span,
        accept: &mut impl FnMut(&Hit) -> bool,
    ) -> Option<Hit> {
        let shear = Shear::new(line.direction)?;
        let mut best = None;
        self.tree.walk(line, span.after, span.before, &mut |leaf| {
            for place in leaf {
                let corners = self.corners[place].map(|c| c.as_dvec3() - line.origin);
                let Some((t, weights)) = shear.meet(&corners) else { continue };
                let triangle = self.tree.order()[place];
                if !span.holds(t, i64::from(triangle)) {
                    continue;
                }
                let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                let slot = mesh.slot(triangle as usize);
                let hit = Hit { t, part: i64::from(triangle), normal, weights, slot };
                if accept(&hit) {
                    best = Some(hit);
                    span.end_before(&hit);
                }
            }
            span.before
        });
        best
    }
}

/// Turns space so that the ray runs along the last axis.
struct Shear {
    axes: [usize; 3],
    x: f64,
    y: f64,
    z: f64,
}

impl Shear {
    fn new(direction: DVec3) -> Option<Self> {
        let d = direction.abs();
        let long = if d.x > d.y && d.x > d.z {
            0
        } else if d.y > d.z {
            1
        } else {
            2
        };
        let axes = [(long + 1) % 3, (long + 2) % 3, long];
        let z = 1.0 / direction[long];
        z.is_finite().then_some(Self { axes, x: direction[axes[0]] * z, y: direction[axes[1]] * z, z })
    }

    /// Returns distance and the weights of the second and third corner; corners are seen from the origin.
    fn meet(&self, corners: &[DVec3; 3]) -> Option<(f64, [f64; 2])> {
        let [kx, ky, kz] = self.axes;
        let x = corners.map(|c| c[kx] - self.x * c[kz]);
        let y = corners.map(|c| c[ky] - self.y * c[kz]);
        let u = x[2] * y[1] - y[2] * x[1];
        let v = x[0] * y[2] - y[0] * x[2];
        let w = x[1] * y[0] - y[1] * x[0];
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let sum = u + v + w;
        if sum == 0.0 {
            return None;
        }
        let depth = u * corners[0][kz] + v * corners[1][kz] + w * corners[2][kz];
        Some((depth * self.z / sum, [v / sum, w / sum]))
    }
}

/// Interpolates what a mesh has at its corners.
pub(crate) fn finish(mesh: &Mesh, hit: &Hit) -> Finish {
    let corners = mesh.triangles[hit.part as usize].map(|i| i as usize);
    let [v, w] = hit.weights;
    let weights = [1.0 - v - w, v, w];
    let mix = |of: &[Vec3]| (0..3).map(|i| of[corners[i]].as_dvec3() * weights[i]).sum::<DVec3>();
    let smooth = if mesh.normals.is_empty() { None } else { mix(&mesh.normals).try_normalize() };
    let uv = (!mesh.uvs.is_empty()).then(|| {
        let uv = (0..3).map(|i| mesh.uvs[corners[i]].as_dvec2() * weights[i]).sum::<glam::DVec2>();
        uv.as_vec2().to_array()
    });
    let color = if mesh.colors.is_empty() { Vec3::ONE } else { mix(&mesh.colors).as_vec3() };
    Finish { uv, normal: smooth.filter(|n| n.is_finite()).unwrap_or(hit.normal), color }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line::Start;

    /// A closed ball of triangles over a grid of angles, poles included.
    fn ball(rows: u32, columns: u32) -> Mesh {
        let mut mesh = Mesh { positions: vec![Vec3::Y, Vec3::NEG_Y], ..Mesh::default() };
        for row in 1..rows {
            for column in 0..columns {
                let (a, b) = (
                    std::f32::consts::PI * row as f32 / rows as f32,
                    std::f32::consts::TAU * column as f32 / columns as f32,
                );
                mesh.positions.push(Vec3::new(a.sin() * b.cos(), a.cos(), a.sin() * b.sin()));
            }
        }
        let at = |row: u32, column: u32| match row {
            0 => 0,
            r if r == rows => 1,
            r => 2 + (r - 1) * columns + column % columns,
        };
        for row in 0..rows {
            for c in 0..columns {
                let quad = [at(row, c), at(row, c + 1), at(row + 1, c + 1), at(row + 1, c)];
                mesh.triangles.push([quad[0], quad[1], quad[2]]);
                mesh.triangles.push([quad[0], quad[2], quad[3]]);
            }
        }
        mesh
    }

    #[test]
    fn rays_through_edges_and_corners_never_slip_through() {
        let mesh = ball(17, 23);
        let tree = MeshTree::new(&mesh);
        let eye = DVec3::new(0.013, -0.021, 0.034);
        let mut checked = 0;
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
            for i in 0..40 {
                let s = f64::from(i) / 39.0;
                for target in [a.lerp(b, s), b.lerp(c, s), c.lerp(a, s)] {
                    for origin in [eye, DVec3::ZERO, target + (target - eye) * 3e3] {
                        let direction = if origin.length() > 2.0 { eye - origin } else { target - origin };
                        let line =
                            Line { origin, direction: direction.normalize_or_zero(), start: Start::Eye };
                        assert!(
                            tree.first(&mesh, &line, Span::WHOLE, &mut |_| true).is_some(),
                            "{line:?} slipped through"
                        );
                        checked += 1;
                    }
                }
            }
        }
        assert!(checked > 200_000);
    }

    #[test]
    fn equal_distances_go_to_the_lower_triangle() {
        let mut mesh = ball(5, 7);
        let twice = mesh.triangles.clone();
        mesh.triangles.extend(twice.iter().rev());
        let tree = MeshTree::new(&mesh);
        let half = twice.len() as i64;
        for i in 0..200 {
            let a = f64::from(i) * 0.1 + 0.013;
            let line =
                Line { origin: DVec3::ZERO, direction: DVec3::new(a.cos(), 0.3, a.sin()), start: Start::Eye };
            let hit = tree.first(&mesh, &line, Span::WHOLE, &mut |_| true).unwrap();
            assert!(hit.part < half);
            let next = Span { after: hit.t, after_part: hit.part, ..Span::WHOLE };
            let twin = tree.first(&mesh, &line, next, &mut |_| true).unwrap();
            assert!(twin.t == hit.t && twin.part >= half, "the twin comes next");
        }
    }
}
