//! Which triangles approximate a parametric body?

use super::MeshSize;
use crate::scene::{Mesh, Primitive};
use glam::{DVec2, DVec3, Vec2};
use std::f64::consts::{PI, TAU};

/// Most steps around a circle: an error of 5e-7 of the radius.
const MOST_STEPS: u32 = 2048;

/// Rows of rings of a cone.
const CONE_ROWS: u32 = 8;

/// Tessellates a body; returns the greatest distance from its surface. Polyhedra are exact.
pub(super) fn tessellate(primitive: &Primitive, tolerance: f64) -> (Mesh, f64) {
    let mut mesh = Mesh::default();
    let bound = match *primitive {
        Primitive::Box { .. } | Primitive::Frustum { .. } => {
            polyhedron(primitive, &mut mesh);
            0.0
        }
        Primitive::Plane { width, depth } => {
            let half = DVec3::new(width * 0.5, 0.0, depth * 0.5);
            let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
            face(primitive, &mut mesh, DVec3::Y, &corners.map(|(x, z)| half * DVec3::new(x, 0.0, z)));
            0.0
        }
        Primitive::Sphere { radius } => {
            let steps = circle_steps(radius, tolerance * 0.5);
            let rings = steps.div_ceil(2).max(2);
            let profile: Vec<_> = (0..=rings)
                .map(|i| {
                    let angle = PI * f64::from(i) / f64::from(rings);
                    // The poles lie exactly on the axis, so that the sphere is closed.
                    let pole = i == 0 || i == rings;
                    let normal = DVec2::new(if pole { 0.0 } else { angle.sin() }, angle.cos());
                    ProfilePoint { place: normal * radius, normal, v: angle / PI }
                })
                .collect();
            revolve(&mut mesh, &profile, steps);
            sagitta(radius, steps) + sagitta(radius, rings * 2)
        }
        Primitive::Cylinder { radius, height } => {
            let steps = circle_steps(radius, tolerance);
            let half = height * 0.5;
            let side =
                |y: f64| ProfilePoint { place: DVec2::new(radius, y), normal: DVec2::X, v: 0.5 - y / height };
            revolve(&mut mesh, &[side(half), side(-half)], steps);
            cap(primitive, &mut mesh, radius, half, DVec3::Y, steps);
            cap(primitive, &mut mesh, radius, -half, DVec3::NEG_Y, steps);
            sagitta(radius, steps)
        }
        Primitive::Cone { radius, height } => {
            let steps = circle_steps(radius, tolerance);
            let half = height * 0.5;
            let normal = DVec2::new(height, radius).normalize_or(DVec2::X);
            // Rows of rings keep the interpolated normals and textures of the long triangles right.
            let rows = CONE_ROWS;
            let profile: Vec<_> = (0..=rows)
                .map(|i| {
                    let v = f64::from(i) / f64::from(rows);
                    ProfilePoint { place: DVec2::new(radius * v, half - height * v), normal, v }
                })
                .collect();
            revolve(&mut mesh, &profile, steps);
            cap(primitive, &mut mesh, radius, -half, DVec3::NEG_Y, steps);
            sagitta(radius, steps)
        }
        Primitive::Torus { major, minor } => {
            let steps = circle_steps(major + minor, tolerance * 0.5);
            let tube = circle_steps(minor, tolerance * 0.5);
            let profile: Vec<_> = (0..=tube)
                .map(|i| {
                    // From the top outwards and down, like every other profile.
                    let turn = f64::from(i) / f64::from(tube);
                    let normal = DVec2::from_angle(PI * 0.5 - TAU * turn);
                    ProfilePoint { place: DVec2::new(major, 0.0) + normal * minor, normal, v: turn }
                })
                .collect();
            revolve(&mut mesh, &profile, steps);
            sagitta(major + minor, steps) + sagitta(minor, tube)
        }
    };
    (mesh, bound)
}

/// Tells how large a mesh [`tessellate`] would make, and its bound.
pub(super) fn forecast(primitive: &Primitive, tolerance: f64) -> (MeshSize, f64) {
    // A profile of so many points turned around the axis: each row of a step has two triangles, but one at a tip.
    let revolved =
        |points: u32, steps: u32, tips: u32| [points * (steps + 1), steps * (2 * (points - 1) - tips)];
    let disk = |corners: u32| [corners, corners - 2];
    let sum = |parts: &[[u32; 2]]| {
        let total = |k: usize| parts.iter().map(|p| p[k]).sum();
        MeshSize::exact(total(0), total(1))
    };
    match *primitive {
        Primitive::Box { .. } => (MeshSize::exact(24, 12), 0.0),
        Primitive::Plane { .. } => (MeshSize::exact(4, 2), 0.0),
        Primitive::Frustum { sides, lower_radius, upper_radius, .. } => {
            let (quads, caps) = match (lower_radius > 0.0, upper_radius > 0.0) {
                (true, true) => ([4, 2], 2),
                _ => ([3, 1], 1),
            };
            let walls = quads.map(|n| n * sides);
            (sum(&[walls, disk(sides).map(|n| n * caps)]), 0.0)
        }
        Primitive::Sphere { radius } => {
            let steps = circle_steps(radius, tolerance * 0.5);
            let rings = steps.div_ceil(2).max(2);
            (sum(&[revolved(rings + 1, steps, 2)]), sagitta(radius, steps) + sagitta(radius, rings * 2))
        }
        Primitive::Cylinder { radius, .. } => {
            let steps = circle_steps(radius, tolerance);
            (sum(&[revolved(2, steps, 0), disk(steps), disk(steps)]), sagitta(radius, steps))
        }
        Primitive::Cone { radius, .. } => {
            let steps = circle_steps(radius, tolerance);
            (sum(&[revolved(CONE_ROWS + 1, steps, 1), disk(steps)]), sagitta(radius, steps))
        }
        Primitive::Torus { major, minor } => {
            let steps = circle_steps(major + minor, tolerance * 0.5);
            let tube = circle_steps(minor, tolerance * 0.5);
            (sum(&[revolved(tube + 1, steps, 0)]), sagitta(major + minor, steps) + sagitta(minor, tube))
        }
    }
}

/// Returns into how many chords a circle must be cut.
fn circle_steps(radius: f64, tolerance: f64) -> u32 {
    let share = (1.0 - tolerance / radius).clamp(-1.0, 1.0);
    let steps = PI / share.acos().max(1e-9);
    (steps.ceil().max(12.0) as u32).min(MOST_STEPS)
}

/// Returns how far a chord is from its arc at most.
fn sagitta(radius: f64, steps: u32) -> f64 {
    radius * (1.0 - (PI / f64::from(steps)).cos())
}

/// A point of the outline of a body of revolution: (distance from the axis, height).
struct ProfilePoint {
    place: DVec2,
    normal: DVec2,
    v: f64,
}

/// Turns a profile, given from the top down, around the y axis.
fn revolve(mesh: &mut Mesh, profile: &[ProfilePoint], steps: u32) {
    let first = mesh.positions.len() as u32;
    let columns = steps + 1;
    for point in profile {
        for i in 0..columns {
            let turn = f64::from(i) / f64::from(steps);
            // The last column lies exactly on the first.
            let angle = TAU * f64::from(i % steps) / f64::from(steps);
            let around = DVec3::new(angle.cos(), 0.0, angle.sin());
            mesh.positions.push((around * point.place.x + DVec3::Y * point.place.y).as_vec3());
            mesh.normals.push((around * point.normal.x + DVec3::Y * point.normal.y).as_vec3());
            mesh.uvs.push(Vec2::new(turn as f32, point.v as f32));
        }
    }
    for row in 0..profile.len() as u32 - 1 {
        let (upper, lower) = (&profile[row as usize], &profile[row as usize + 1]);
        for i in 0..steps {
            let a = first + row * columns + i;
            let (b, c, d) = (a + 1, a + columns, a + columns + 1);
            if upper.place.x > 1e-12 * lower.place.x.abs() {
                mesh.triangles.push([a, b, c]);
            }
            if lower.place.x > 1e-12 * upper.place.x.abs() {
                mesh.triangles.push([b, d, c]);
            }
        }
    }
}

/// Closes a body of revolution by a disk.
fn cap(primitive: &Primitive, mesh: &mut Mesh, radius: f64, y: f64, normal: DVec3, steps: u32) {
    let rim: Vec<_> = (0..steps)
        .map(|i| {
            let angle = -normal.y * TAU * f64::from(i) / f64::from(steps);
            DVec3::new(angle.cos() * radius, y, angle.sin() * radius)
        })
        .collect();
    face(primitive, mesh, normal, &rim);
}

/// Adds a flat convex face, corners counter-clockwise seen from outside.
fn face(primitive: &Primitive, mesh: &mut Mesh, normal: DVec3, corners: &[DVec3]) {
    let first = mesh.positions.len() as u32;
    for &corner in corners {
        mesh.positions.push(corner.as_vec3());
        mesh.normals.push(normal.as_vec3());
        mesh.uvs.push(Vec2::from_array(primitive.uv(corner, normal)));
    }
    for i in 1..corners.len() as u32 - 1 {
        mesh.triangles.push([first, first + i, first + i + 1]);
    }
}

fn polyhedron(primitive: &Primitive, mesh: &mut Mesh) {
    let faces = primitive.faces();
    match *primitive {
        Primitive::Box { size } => {
            for (normal, _) in faces {
                let (u, v) = crate::math::orthonormal_basis(normal);
                let h = size * 0.5;
                let corner = |a: f64, b: f64| (normal + u * a + v * b).signum_or_zero() * h;
                let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
                face(primitive, mesh, normal, &corners);
            }
        }
        Primitive::Frustum { sides, lower_radius, upper_radius, height } => {
            let rim = |radius: f64, y: f64| -> Vec<DVec3> {
                (0..sides)
                    .map(|i| {
                        let angle = TAU * f64::from(i) / f64::from(sides);
                        DVec3::new(angle.cos() * radius, y, angle.sin() * radius)
                    })
                    .collect()
            };
            let (lower, mut upper) = (rim(lower_radius, -height * 0.5), rim(upper_radius, height * 0.5));
            for i in 0..sides as usize {
                let j = (i + 1) % sides as usize;
                let normal = faces[i + 2].0;
                let corners = [lower[i], upper[i], upper[j], lower[j]];
                let distinct: Vec<_> = match (upper_radius > 0.0, lower_radius > 0.0) {
                    (true, true) => corners.to_vec(),
                    (false, _) => vec![corners[0], corners[1], corners[3]],
                    (true, false) => corners[..3].to_vec(),
                };
                face(primitive, mesh, normal, &distinct);
            }
            if lower_radius > 0.0 {
                face(primitive, mesh, DVec3::NEG_Y, &lower);
            }
            if upper_radius > 0.0 {
                upper.reverse();
                face(primitive, mesh, DVec3::Y, &upper);
            }
        }
        _ => {}
    }
}

/// Snaps directions that are combinations of axes to -1, 0 and 1.
trait SignumOrZero {
    fn signum_or_zero(self) -> Self;
}

impl SignumOrZero for DVec3 {
    fn signum_or_zero(self) -> Self {
        self.map(|c| if c.abs() < 0.5 { 0.0 } else { c.signum() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every body with its volume and area.
    fn bodies() -> Vec<(Primitive, f64)> {
        vec![
            (Primitive::Box { size: DVec3::new(1.0, 2.0, 3.0) }, 6.0),
            (Primitive::Sphere { radius: 1.5 }, 4.0 / 3.0 * PI * 1.5f64.powi(3)),
            (Primitive::Cylinder { radius: 0.5, height: 2.0 }, PI * 0.25 * 2.0),
            (Primitive::Cone { radius: 1.0, height: 3.0 }, PI),
            (Primitive::Torus { major: 0.7, minor: 0.3 }, 2.0 * PI * PI * 0.7 * 0.09),
            (Primitive::Frustum { sides: 4, lower_radius: 2f64.sqrt(), upper_radius: 0.0, height: 3.0 }, 4.0),
            (Primitive::Frustum { sides: 4, lower_radius: 0.0, upper_radius: 2f64.sqrt(), height: 3.0 }, 4.0),
            (Primitive::prism(6, 1.0, 2.0), 3f64.sqrt() * 3.0),
        ]
    }

    #[test]
    fn volumes_agree_with_closed_forms_and_faces_look_outward() {
        for (body, volume) in bodies() {
            let (mesh, bound) = tessellate(&body, 1e-4);
            mesh.check().unwrap();
            assert!(bound <= 1.001e-4, "{body:?}: {bound}");
            // The volume of a layer as thick as the bound.
            let slack = mesh.area() * bound + 1e-6 * volume;
            assert!((mesh.volume() - volume).abs() <= slack, "{body:?}: {} for {volume}", mesh.volume());
        }
    }

    #[test]
    fn no_point_is_farther_from_the_surface_than_the_bound() {
        for (body, _) in bodies() {
            let Some(form) = body.form() else { continue };
            let (mesh, bound) = tessellate(&body, 0.02);
            for t in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(t).map(glam::Vec3::as_dvec3);
                for p in [(a + b) * 0.5, (b + c) * 0.5, (a + c) * 0.5, (a + b + c) / 3.0] {
                    let (value, gradient) = form.value_and_gradient(p);
                    let distance = value.abs() / gradient.length().max(1e-3);
                    assert!(distance <= bound * 1.1 + 1e-6, "{body:?}: {distance} over {bound} at {p}");
                }
            }
        }
    }

    #[test]
    fn triangles_wind_like_their_normals() {
        for (body, _) in bodies() {
            let (mesh, _) = tessellate(&body, 0.05);
            for t in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(t);
                let normals = mesh.triangles[t].map(|i| mesh.normals[i as usize]);
                let sum = normals[0] + normals[1] + normals[2];
                assert!((b - a).cross(c - a).dot(sum) > 0.0, "{body:?} triangle {t}");
            }
        }
    }
}
