//! What does the surface look like where a ray meets a visible triangle?
//!
//! Visibility only names the triangle. Distance and attributes come from meeting the ray of the pixel's center
//! with the triangle's own plane in double precision, so they owe nothing to snapped corners or stored depths.

use crate::lens::{Lens, PixelRay};
use crate::model::{Model, Part};
use glam::{DVec2, DVec3, Vec2, Vec3};
use polyptych_core::scene::{Mapping, Material, Mesh, Scene, Texture};

/// Weights of corners that a snapped corner may cause outside of the triangle are extrapolated up to here;
/// beyond (narrow slivers) the nearest point of the triangle is taken.
const OUTSIDE: f64 = -1.0 / 64.0;

/// Finds surface points; keeps what it knows of the last triangle, since neighbors often show the same one.
pub(crate) struct Resolver<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) model: &'a Model,
    pub(crate) lens: &'a Lens,
    face: Option<Face<'a>>,
}

/// A triangle set up to be met by rays, relative to the lens's origin.
struct Face<'a> {
    id: u32,
    part: &'a Part,
    mesh: &'a Mesh,
    material: &'a Material,
    corners: [usize; 3],
    origin: DVec3,
    edges: [DVec3; 2],
    /// Across the triangle, not of unit length; not turned to the viewer.
    normal: DVec3,
    /// The same as a unit vector, on the side that its author calls outside.
    outward: DVec3,
    height: f64,
    /// Slopes of the weights of the second and third corner.
    weights: [DVec3; 2],
}

/// A point of a surface with what shading needs.
#[derive(Clone, Copy)]
pub(crate) struct Point<'a> {
    pub(crate) part: &'a Part,
    pub(crate) material: &'a Material,
    pub(crate) triangle: u32,
    /// Relative to the lens's origin, never outside of the triangle.
    pub(crate) place: DVec3,
    /// Along the ray, meters.
    pub(crate) distance: f64,
    /// Unit true normal on the viewer's side.
    pub(crate) true_normal: DVec3,
    /// Unit shading normal, turned along with the true one.
    pub(crate) normal: Vec3,
    pub(crate) color: Vec3,
    pub(crate) opacity: f32,
}

/// What is asked of a point beyond its place and normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ask {
    /// Nothing: color is black, opacity 1.
    Geometry,
    /// Color and opacity.
    Color,
}

impl<'a> Resolver<'a> {
    pub(crate) fn new(scene: &'a Scene, model: &'a Model, lens: &'a Lens) -> Self {
        Self { scene, model, lens, face: None }
    }

    /// Finds the point of a triangle that a ray meets.
    #[inline]
    pub(crate) fn resolve(&mut self, id: u32, ray: &PixelRay, ask: Ask) -> Point<'a> {
        if self.face.as_ref().is_none_or(|face| face.id != id) {
            self.face = Some(Face::new(self.scene, self.model, self.lens.origin, id));
        }
        let Some(face) = &self.face else { unreachable!("the face was just set up") };
        let met = face.meet(ray);
        let away = face.outward.dot(ray.direction) > 0.0;
        let true_normal = if away { -face.outward } else { face.outward };
        let smooth = face.shading_normal(&met.weights);
        let normal = if away { -smooth } else { smooth };
        let (color, opacity) = match ask {
            Ask::Geometry => (Vec3::ZERO, 1.0),
            Ask::Color if face.material.texture.is_none() && face.mesh.colors.is_empty() => {
                let material = face.material;
                (material.base_color, material.effective_opacity(material.opacity).min(1.0))
            }
            Ask::Color => self.color(face, &met, ray),
        };
        Point {
            part: face.part,
            material: face.material,
            triangle: id,
            place: met.inside,
            distance: met.t * ray.length,
            true_normal,
            normal,
            color,
            opacity,
        }
    }

    /// Returns base color and effective opacity.
    fn color(&self, face: &Face<'_>, met: &Met, ray: &PixelRay) -> (Vec3, f32) {
        let (mesh, material) = (face.mesh, face.material);
        let [a, b, c] = face.corners;
        let weights = met.weights;
        let texture = material.texture.and_then(|t| self.scene.textures.get(t));
        let (base, opacity) = match texture {
            None => (material.base_color, material.opacity),
            Some(texture) => {
                let uv = (!mesh.uvs.is_empty()).then(|| {
                    let [u, v, w] = [a, b, c].map(|i| mesh.uvs[i].as_dvec2());
                    (u * weights[0] + v * weights[1] + w * weights[2]).as_vec2()
                });
                let [p, q, r] = [a, b, c].map(|i| mesh.positions[i].as_dvec3());
                let position = (p * weights[0] + q * weights[1] + r * weights[2]).as_vec3();
                let normal = (q - p).cross(r - p).normalize_or_zero().as_vec3();
                let lod = self.lod(face, texture, met, ray);
                self.scene.base_color(material, uv.map(|v| v.to_array()), position, normal, lod)
            }
        };
        let tint = if mesh.colors.is_empty() {
            Vec3::ONE
        } else {
            let w = weights.map(|w| w as f32);
            mesh.colors[a] * w[0] + mesh.colors[b] * w[1] + mesh.colors[c] * w[2]
        };
        (base * tint, material.effective_opacity(opacity).min(1.0))
    }

    /// Returns the mip level at which a texel is as large as the pixel, from the exact change of the point over
    /// one pixel to the right and one down.
    fn lod(&self, face: &Face<'_>, texture: &Texture, met: &Met, ray: &PixelRay) -> f32 {
        let (mesh, material) = (face.mesh, face.material);
        let (right, down) = self.lens.change(met.t);
        let share = 1.0 / face.normal.dot(ray.direction);
        let moved = [right, down].map(|d| d - ray.direction * (face.normal.dot(d) * share));
        let scale = match material.mapping {
            Mapping::Uv if !mesh.uvs.is_empty() => {
                let [a, b, c] = face.corners.map(|i| mesh.uvs[i].as_dvec2());
                let [x, y] = moved.map(|d| -> DVec2 {
                    (b - a) * d.dot(face.weights[0]) + (c - a) * d.dot(face.weights[1])
                });
                return texture.lod(x.as_vec2(), y.as_vec2());
            }
            Mapping::Uv => 1.0,
            Mapping::Triplanar { scale } => scale,
        };
        // In object space lengths are those before the part's transform.
        let back = face.part.object_from_vector;
        let [x, y] = moved.map(|d| Vec2::new((back * d).length() as f32 * scale, 0.0));
        texture.lod(x, y)
    }
}

/// Where a ray meets a triangle.
struct Met {
    /// Along the ray, in lengths of its direction.
    t: f64,
    weights: [f64; 3],
    /// The nearest point of the triangle.
    inside: DVec3,
}

impl<'a> Face<'a> {
    #[inline(never)]
    fn new(scene: &'a Scene, model: &'a Model, origin: DVec3, id: u32) -> Self {
        let (index, triangle) = model.find(id);
        let part = &model.parts[index];
        let [a, b, c] = part.corners(triangle, origin);
        let edges = [b - a, c - a];
        let normal = edges[0].cross(edges[1]);
        let share = 1.0 / normal.length_squared();
        let mesh = part.mesh();
        let [i, j, k] = mesh.triangles[triangle];
        let turned = if part.mirrored { -normal } else { normal };
        Self {
            id,
            part,
            mesh,
            material: scene.material(&scene.objects[part.object], mesh.slot(triangle)),
            corners: [i as usize, j as usize, k as usize],
            origin: a,
            edges,
            normal,
            outward: turned.normalize_or_zero(),
            height: a.dot(normal),
            weights: [edges[1].cross(normal) * share, normal.cross(edges[0]) * share],
        }
    }

    #[inline]
    fn meet(&self, ray: &PixelRay) -> Met {
        let t = (self.height - self.normal.dot(ray.start)) / self.normal.dot(ray.direction);
        let r = ray.start + ray.direction * t - self.origin;
        let (v, w) = (r.dot(self.weights[0]), r.dot(self.weights[1]));
        let weights = [1.0 - v - w, v, w];
        let lowest = weights[0].min(v).min(w);
        if lowest >= 0.0 {
            return Met { t, weights, inside: self.origin + r };
        }
        let held = hold(weights);
        let inside = self.origin + self.edges[0] * held[1] + self.edges[1] * held[2];
        if lowest >= OUTSIDE {
            return Met { t, weights, inside };
        }
        let t = (inside - ray.start).dot(ray.direction) / ray.direction.length_squared();
        Met { t, weights: held, inside }
    }

    /// Returns the interpolated normal, or the true one where the mesh has none.
    #[inline]
    fn shading_normal(&self, weights: &[f64; 3]) -> Vec3 {
        let normals = &self.mesh.normals;
        if normals.is_empty() {
            return self.outward.as_vec3();
        }
        let [a, b, c] = self.corners;
        let mixed =
            normals[a] * weights[0] as f32 + normals[b] * weights[1] as f32 + normals[c] * weights[2] as f32;
        let turned = self.part.world_from_normal * mixed;
        turned.try_normalize().unwrap_or_else(|| self.outward.as_vec3())
    }
}

/// Moves weights to the nearest that are not negative; equal ones where they are not finite.
fn hold(weights: [f64; 3]) -> [f64; 3] {
    let held = weights.map(|w| w.max(0.0));
    let sum = held[0] + held[1] + held[2];
    if sum.is_finite() && sum > 0.0 { held.map(|w| w / sum) } else { [1.0 / 3.0; 3] }
}
