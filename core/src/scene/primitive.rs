//! Parametric bodies.

use super::form::{Form, Quadric};
use crate::math::Aabb;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// A parametric body around the origin; axes of revolution are the y axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum Primitive {
    /// A box by its edge lengths.
    Box {
        /// Edge lengths.
        #[schemars(with = "[f64; 3]")]
        size: DVec3,
    },
    /// A sphere.
    Sphere {
        /// Its radius.
        radius: f64,
    },
    /// A closed cylinder.
    Cylinder {
        /// Its radius.
        radius: f64,
        /// Its height, half of it below the origin.
        height: f64,
    },
    /// A closed cone, the apex at the top.
    Cone {
        /// Radius of the base.
        radius: f64,
        /// Its height, half of it below the origin.
        height: f64,
    },
    /// A ring.
    Torus {
        /// Radius of the ring.
        major: f64,
        /// Radius of the tube, at most that of the ring.
        minor: f64,
    },
    /// A rectangle in the xz plane that looks up; it has no inside.
    Plane {
        /// Length along x.
        width: f64,
        /// Length along z.
        depth: f64,
    },
    /// A frustum of a regular pyramid: a prism where the radii are equal, a pyramid where the upper is 0.
    Frustum {
        /// Number of sides, at least 3.
        sides: u32,
        /// Circumradius of the lower base; edge length `a` gives `a / (2 sin(pi / sides))`.
        lower_radius: f64,
        /// Circumradius of the upper base.
        upper_radius: f64,
        /// Its height, half of it below the origin.
        height: f64,
    },
}

impl Primitive {
    /// Builds a regular prism from the edge length of its base.
    #[must_use]
    pub fn prism(sides: u32, edge: f64, height: f64) -> Self {
        let radius = edge / (2.0 * (PI / f64::from(sides.max(3))).sin());
        Self::Frustum { sides, lower_radius: radius, upper_radius: radius, height }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the parameter that is not positive and finite, or the rule it breaks.
    pub fn check(&self) -> Result<(), String> {
        let positive = |name: &str, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(format!("`{name}` must be positive, got {value}"))
            }
        };
        match *self {
            Self::Box { size } => {
                positive("size.x", size.x)?;
                positive("size.y", size.y)?;
                positive("size.z", size.z)
            }
            Self::Sphere { radius } => positive("radius", radius),
            Self::Cylinder { radius, height } | Self::Cone { radius, height } => {
                positive("radius", radius)?;
                positive("height", height)
            }
            Self::Torus { major, minor } => {
                positive("major", major)?;
                positive("minor", minor)?;
                if minor > major {
                    return Err(format!("`minor` {minor} must not exceed `major` {major}"));
                }
                Ok(())
            }
            Self::Plane { width, depth } => {
                positive("width", width)?;
                positive("depth", depth)
            }
            Self::Frustum { sides, lower_radius, upper_radius, height } => {
                if !(3..=4096).contains(&sides) {
                    return Err(format!("`sides` must be 3 to 4096, got {sides}"));
                }
                positive("height", height)?;
                positive("lower_radius + upper_radius", lower_radius + upper_radius)?;
                if lower_radius < 0.0 || upper_radius < 0.0 {
                    return Err(format!("radii must not be negative, got {lower_radius} and {upper_radius}"));
                }
                Ok(())
            }
        }
    }

    /// Bounds the body.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let half = match *self {
            Self::Box { size } => size * 0.5,
            Self::Sphere { radius } => DVec3::splat(radius),
            Self::Cylinder { radius, height } | Self::Cone { radius, height } => {
                DVec3::new(radius, height * 0.5, radius)
            }
            Self::Torus { major, minor } => DVec3::new(major + minor, minor, major + minor),
            Self::Plane { width, depth } => DVec3::new(width * 0.5, 0.0, depth * 0.5),
            Self::Frustum { lower_radius, upper_radius, height, .. } => {
                let radius = lower_radius.max(upper_radius);
                DVec3::new(radius, height * 0.5, radius)
            }
        };
        Aabb::new(-half, half)
    }

    /// Returns the outward planes of a polyhedron as `(unit normal, offset)` with `normal . p = offset` on the
    /// face; empty for bodies with curved faces and for the plane.
    ///
    /// Order: box -x +x -y +y -z +z; frustum bottom, top, then the sides.
    #[must_use]
    pub fn faces(&self) -> Vec<(DVec3, f64)> {
        match *self {
            Self::Box { size } => [DVec3::X, DVec3::Y, DVec3::Z]
                .iter()
                .flat_map(|&axis| [(-axis, size.dot(axis) * 0.5), (axis, size.dot(axis) * 0.5)])
                .collect(),
            Self::Frustum { sides, lower_radius, upper_radius, height } => {
                let mut faces = vec![(-DVec3::Y, height * 0.5), (DVec3::Y, height * 0.5)];
                let inner = (PI / f64::from(sides)).cos();
                let (lower, upper) = (lower_radius * inner, upper_radius * inner);
                for side in 0..sides {
                    let angle = TAU * (f64::from(side) + 0.5) / f64::from(sides);
                    let outward = DVec3::new(angle.cos(), 0.0, angle.sin());
                    let normal = (outward * height + DVec3::Y * (lower - upper)).normalize_or(outward);
                    faces.push((normal, normal.dot(outward * lower - DVec3::Y * (height * 0.5))));
                }
                faces
            }
            _ => Vec::new(),
        }
    }

    /// Returns the body as an implicit function, positive inside; nothing for the plane.
    #[must_use]
    pub fn form(&self) -> Option<Form> {
        let slab = |height: f64| {
            [DVec3::Y, -DVec3::Y].map(|normal| Form::HalfSpace { normal, offset: height * 0.5 })
        };
        Some(match *self {
            Self::Box { .. } | Self::Frustum { .. } => Form::Intersection(
                self.faces().into_iter().map(|(normal, offset)| Form::HalfSpace { normal, offset }).collect(),
            ),
            Self::Sphere { radius } => Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::splat(radius) },
            Self::Cylinder { radius, height } => {
                let [top, bottom] = slab(height);
                let side = Form::Cylinder { center: DVec3::ZERO, axis: DVec3::Y, radius };
                Form::Intersection(vec![side, top, bottom])
            }
            Self::Cone { radius, height } => {
                // radius of the section at y is s (height/2 - y), s = radius / height
                let (s2, apex) = ((radius / height).powi(2), height * 0.5);
                let side =
                    Quadric([-1.0, s2, -1.0, 0.0, 0.0, 0.0, 0.0, -2.0 * s2 * apex, 0.0, s2 * apex * apex]);
                let [top, bottom] = slab(height);
                Form::Intersection(vec![Form::Quadric(side), top, bottom])
            }
            Self::Torus { major, minor } => Form::Torus { major, minor },
            Self::Plane { .. } => return None,
        })
    }

    /// Returns the texture coordinates of a point of the surface with its outward normal.
    ///
    /// Revolved bodies: u runs once around from +x through +z, v from the top down; caps, boxes, frusta and
    /// planes: the face's own plane, 0 to 1 over the bounding box.
    #[must_use]
    pub fn uv(&self, p: DVec3, normal: DVec3) -> [f32; 2] {
        let around = (p.z.atan2(p.x) / TAU).rem_euclid(1.0);
        let (u, v) = match *self {
            Self::Sphere { radius } => (around, (p.y / radius).clamp(-1.0, 1.0).acos() / PI),
            Self::Cylinder { height, .. } | Self::Cone { height, .. } if normal.y.abs() < 0.999_999 => {
                (around, 0.5 - p.y / height)
            }
            Self::Torus { major, .. } => {
                let ring = (p.x * p.x + p.z * p.z).sqrt() - major;
                (around, (0.25 - p.y.atan2(ring) / TAU).rem_euclid(1.0))
            }
            _ => {
                let size = self.bounds().size();
                let n = normal.abs();
                if n.y >= n.x && n.y >= n.z {
                    (p.x / size.x + 0.5, p.z / size.z + 0.5)
                } else if n.x >= n.z {
                    (p.z / size.z + 0.5, 0.5 - p.y / size.y)
                } else {
                    (p.x / size.x + 0.5, 0.5 - p.y / size.y)
                }
            }
        };
        [u as f32, v as f32]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prism_is_built_from_its_edge() {
        let Primitive::Frustum { lower_radius, .. } = Primitive::prism(6, 2.0, 1.0) else {
            panic!("a frustum")
        };
        assert!((lower_radius - 2.0).abs() < 1e-15, "a hexagon's circumradius is its edge");
    }

    #[test]
    fn forms_vanish_on_the_surface() {
        let cases = [
            (Primitive::Sphere { radius: 2.0 }, DVec3::new(0.0, 2.0, 0.0)),
            (Primitive::Cone { radius: 1.0, height: 4.0 }, DVec3::new(0.5, 0.0, 0.0)),
            (Primitive::Cylinder { radius: 1.5, height: 1.0 }, DVec3::new(0.0, 0.2, 1.5)),
            (Primitive::Torus { major: 0.7, minor: 0.3 }, DVec3::new(0.0, 0.3, -0.7)),
            (Primitive::Box { size: DVec3::new(1.0, 2.0, 3.0) }, DVec3::new(0.1, 1.0, 0.2)),
            (
                Primitive::Frustum { sides: 4, lower_radius: 2.0, upper_radius: 1.0, height: 2.0 },
                DVec3::new(1.5 * 0.5, 0.0, 1.5 * 0.5),
            ),
        ];
        for (primitive, p) in cases {
            let form = primitive.form().unwrap();
            assert!(form.value(p).abs() < 1e-12, "{primitive:?} at {p}: {}", form.value(p));
            assert!(
                form.value(p * 0.9) > 0.0 && form.value(p * 1.1) < 0.0
                    || matches!(primitive, Primitive::Torus { .. })
            );
        }
    }

    #[test]
    fn wrong_parameters_are_named() {
        let error = Primitive::Sphere { radius: f64::NAN }.check().unwrap_err();
        assert_eq!(error, "`radius` must be positive, got NaN");
    }
}
