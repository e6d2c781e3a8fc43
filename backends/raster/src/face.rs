//! Where does the ray of a pixel meet a triangle, and what does its surface look like there?
//!
//! Visibility only names the triangle. Distance and attributes come from meeting the ray of the pixel's center
//! with the triangle's own plane in double precision, so they owe nothing to snapped corners or stored depths.
//! Along the rays of a picture every linear function of a point is affine in column and row; a triangle is set
//! up once for all pixels of a tile that show it.

use crate::affine::OnRays;
use crate::color::{Changes, ChangesAll, Spots, changes, changes_all, color_of_first};
use crate::lens::Lens;
use crate::model::{Model, Part};
use crate::octet::Names;
use crate::tile::NO_TRIANGLE;
use glam::{DVec3, Vec3};
use polyptych_core::lanes::{F64x8, LANES, Vec3x8};
use polyptych_core::scene::{Material, Mesh, Scene};

/// Weights of corners that a snapped corner may cause outside of the triangle are extrapolated up to here;
/// beyond (narrow slivers) the nearest point of the triangle is taken.
const OUTSIDE: f64 = -1.0 / 64.0;

/// A triangle set up to be met by the rays of a lens, relative to the lens's origin.
pub(crate) struct Face {
    /// Along the normal; the plane is where it reaches `height`.
    across: OnRays,
    height: f64,
    /// The weights of the second and third corner, less by their offsets.
    weights: [OnRays; 2],
    offsets: [f64; 2],
    /// The normal as a unit vector, on the side that its author calls outside.
    pub(crate) outward: DVec3,
    /// The shading normal of the first corner, and how those of the others differ; not of unit length.
    normals: [Vec3; 3],
    origin: DVec3,
    edges: [DVec3; 2],
    /// Index of its part, and the triangle's in it.
    pub(crate) part: u32,
    pub(crate) triangle: u32,
    is_mirrored: bool,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy)]
pub(crate) struct Met {
    /// Along the ray, in lengths of its direction.
    pub(crate) t: f64,
    pub(crate) weights: [f64; 3],
    /// Whether the ray comes from the side that is not outside.
    pub(crate) from_within: bool,
    /// The nearest point of the triangle, where the ray passes beside it.
    pub(crate) held: Option<DVec3>,
}

/// Where eight rays meet a triangle, all of them inside and from one side.
pub(crate) struct MetAll {
    pub(crate) t: F64x8,
    /// Of the second and third corner.
    pub(crate) weights: [F64x8; 2],
    pub(crate) from_within: bool,
}

/// A place of the picture of a scene.
#[derive(Clone, Copy)]
pub(crate) struct Place<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) model: &'a Model,
    pub(crate) lens: &'a Lens,
    pub(crate) x: f64,
    pub(crate) y: f64,
}

impl Face {
    pub(crate) fn new(model: &Model, lens: &Lens, id: u32) -> Self {
        let (index, triangle) = model.find(id);
        let part = &model.parts[index];
        let [a, b, c] = part.corners(triangle, lens.origin);
        let edges = [b - a, c - a];
        let normal = edges[0].cross(edges[1]);
        let share = 1.0 / normal.length_squared();
        let slopes = [edges[1].cross(normal) * share, normal.cross(edges[0]) * share];
        let mesh = part.mesh();
        let corners = mesh.triangles[triangle];
        let turned = if part.mirrored { -normal } else { normal };
        let outward = turned.normalize_or_zero();
        Self {
            across: lens.on_rays(normal),
            height: a.dot(normal),
            weights: [lens.on_rays(slopes[0]), lens.on_rays(slopes[1])],
            offsets: [a.dot(slopes[0]), a.dot(slopes[1])],
            outward,
            normals: shading_normals(part, mesh, corners, outward),
            origin: a,
            edges,
            part: index as u32,
            triangle: triangle as u32,
            is_mirrored: part.mirrored,
        }
    }

    /// Meets the ray through a place of the picture.
    #[inline(always)]
    pub(crate) fn meet(&self, lens: &Lens, x: f64, y: f64) -> Met {
        let (start, slope) = self.across.at(lens.rays, x, y);
        let t = (self.height - start) / slope;
        let weight = |i: usize| {
            let (start, slope) = self.weights[i].at(lens.rays, x, y);
            (start - self.offsets[i]) + slope * t
        };
        let (v, w) = (weight(0), weight(1));
        let weights = [1.0 - v - w, v, w];
        let from_within = (slope > 0.0) != self.is_mirrored && slope != 0.0;
        let met = Met { t, weights, from_within, held: None };
        let lowest = weights[0].min(v).min(w);
        if lowest >= 0.0 { met } else { self.hold(&met, lowest, lens, x, y) }
    }

    /// Meets the rays through eight places; nothing if one of them passes beside the triangle.
    #[inline(always)]
    pub(crate) fn meet_all(&self, lens: &Lens, x: F64x8, y: F64x8) -> Option<MetAll> {
        let zero = F64x8::splat(0.0);
        let (start, slope) = self.across.at_all(lens.rays, x, y);
        let t = (F64x8::splat(self.height) - start) / slope;
        let (start_v, slope_v) = self.weights[0].at_all(lens.rays, x, y);
        let (start_w, slope_w) = self.weights[1].at_all(lens.rays, x, y);
        let v = (start_v - F64x8::splat(self.offsets[0])) + slope_v * t;
        let w = (start_w - F64x8::splat(self.offsets[1])) + slope_w * t;
        let inside = (F64x8::splat(1.0) - v - w).at_least(zero) & v.at_least(zero) & w.at_least(zero);
        let (up, down) = (slope.above(zero), zero.above(slope));
        if (!inside).any() || ((!up).any() && (!down).any()) {
            return None;
        }
        let from_within = up.has(0) != self.is_mirrored;
        Some(MetAll { t, weights: [v, w], from_within })
    }

    /// Returns the interpolated shading normals, not of unit length, on the outside.
    #[inline(always)]
    pub(crate) fn normals_of(&self, met: &MetAll) -> Vec3x8 {
        let [a, b, c] = self.normals.map(Vec3x8::splat);
        a + b.scaled(met.weights[0].round()) + c.scaled(met.weights[1].round())
    }

    /// Returns a corner relative to the lens's origin, and its shading normal, not of unit length.
    pub(crate) fn raw_corner(&self, corner: usize) -> (DVec3, Vec3) {
        match corner {
            0 => (self.origin, self.normals[0]),
            i => (self.origin + self.edges[i - 1], self.normals[0] + self.normals[i]),
        }
    }

    /// Returns how far ahead the triangle's plane is at a place of the picture.
    pub(crate) fn ahead(&self, lens: &Lens, x: f64, y: f64) -> f64 {
        let (start, slope) = self.across.at(lens.rays, x, y);
        (self.height - start) / slope
    }

    /// Keeps to the triangle where snapped corners made a pixel show it that its ray passes beside.
    #[inline(never)]
    fn hold(&self, met: &Met, lowest: f64, lens: &Lens, x: f64, y: f64) -> Met {
        let held = nearest(met.weights);
        let inside = self.origin + self.edges[0] * held[1] + self.edges[1] * held[2];
        if lowest >= OUTSIDE {
            return Met { held: Some(inside), ..*met };
        }
        let (start, direction) = lens.line(x, y);
        let t = (inside - start).dot(direction) / direction.length_squared();
        Met { t, weights: held, held: Some(inside), ..*met }
    }

    /// Returns the interpolated shading normal, not of unit length, on the outside.
    #[inline(always)]
    pub(crate) fn normal(&self, met: &Met) -> Vec3 {
        self.normals[0] + self.normals[1] * met.weights[1] as f32 + self.normals[2] * met.weights[2] as f32
    }

    /// Returns the material.
    #[inline]
    pub(crate) fn material<'a>(&self, scene: &'a Scene, model: &Model) -> &'a Material {
        let part = &model.parts[self.part as usize];
        scene.material(&scene.objects[part.object], part.mesh().slot(self.triangle as usize))
    }

    /// Returns base color and effective opacity where a ray met it.
    pub(crate) fn color(&self, at: &Place<'_>, met: &Met) -> (Vec3, f32) {
        color_of_first(&Spots {
            scene: at.scene,
            model: at.model,
            count: 1,
            is_one: false,
            names: &Names { id: [0; LANES], part: [self.part; LANES], triangle: [self.triangle; LANES] },
            materials: &[Some(self.material(at.scene, at.model)); LANES],
            weights: &[F64x8::splat(met.weights[1]), F64x8::splat(met.weights[2])],
            changes: &ChangesAll::splat(self.changes_at(at.lens, at.x, at.y, met.t)),
        })
    }

    /// Returns how the weights change over a pixel where a ray met it.
    pub(crate) fn changes_at(&self, lens: &Lens, x: f64, y: f64, t: f64) -> Changes {
        changes(lens, &self.across, &self.weights, (x, y), t)
    }

    /// Returns how the weights change over a pixel where eight rays met it.
    #[inline(always)]
    pub(crate) fn changes(&self, lens: &Lens, x: F64x8, y: F64x8, met: &MetAll) -> ChangesAll {
        let [v, w] = &self.weights;
        let (plane, v_slope, w_slope) =
            (self.across.at_all(lens.rays, x, y).1, v.at_all(lens.rays, x, y).1, w.at_all(lens.rays, x, y).1);
        let steps = (self.across.steps(), [v.steps(), w.steps()]);
        changes_all(lens, met.t, (plane, [v_slope, w_slope]), steps)
    }
}

impl Place<'_> {
    /// Tells whether a triangle is no hole at a place of the picture.
    pub(crate) fn is_solid(&self, face: &Face) -> bool {
        face.color(self, &face.meet(self.lens, self.x, self.y)).1 > 0.0
    }
}

/// Returns the first corner's normal in the world and how the others differ; the true one where there are none.
fn shading_normals(part: &Part, mesh: &Mesh, corners: [u32; 3], outward: DVec3) -> [Vec3; 3] {
    if mesh.normals.is_empty() {
        return [outward.as_vec3(), Vec3::ZERO, Vec3::ZERO];
    }
    let turned = |i: u32| part.world_from_normal * mesh.normals[i as usize];
    let [a, b, c] = [turned(corners[0]), turned(corners[1]), turned(corners[2])];
    [a, b - a, c - a]
}

/// Moves weights to the nearest that are not negative; equal ones where they are not finite.
fn nearest(weights: [f64; 3]) -> [f64; 3] {
    let held = weights.map(|w| w.max(0.0));
    let sum = held[0] + held[1] + held[2];
    if sum.is_finite() && sum > 0.0 { held.map(|w| w / sum) } else { [1.0 / 3.0; 3] }
}

/// The triangles that a tile shows, each set up once.
pub(crate) struct Faces {
    pub(crate) faces: Vec<Face>,
    /// A hash table of their ids and indices.
    ids: Box<[u32; SLOTS]>,
    indices: Box<[u16; SLOTS]>,
}

const SLOTS: usize = 4096;
/// Most triangles at once: the table stays a quarter empty.
const MOST_FACES: usize = SLOTS / 4 * 3;

impl Default for Faces {
    fn default() -> Self {
        Self { faces: Vec::new(), ids: Box::new([NO_TRIANGLE; SLOTS]), indices: Box::new([0; SLOTS]) }
    }
}

impl Faces {
    /// Forgets all triangles.
    pub(crate) fn clear(&mut self) {
        if !self.faces.is_empty() {
            self.faces.clear();
            self.ids.fill(NO_TRIANGLE);
        }
    }

    pub(crate) fn is_full(&self) -> bool {
        self.faces.len() >= MOST_FACES
    }

    /// Returns the index of a triangle, set up where it was not yet.
    #[inline]
    pub(crate) fn find(&mut self, model: &Model, lens: &Lens, id: u32) -> u16 {
        // Neighbors have ids close together: spread them by Knuth's multiplicative hash.
        let mut slot = (id.wrapping_mul(2_654_435_769) >> 20) as usize;
        while self.ids[slot] != id {
            if self.ids[slot] == NO_TRIANGLE {
                self.ids[slot] = id;
                self.indices[slot] = self.faces.len() as u16;
                self.faces.push(Face::new(model, lens, id));
                break;
            }
            slot = (slot + 1) % SLOTS;
        }
        self.indices[slot]
    }

    pub(crate) fn bytes(&self) -> usize {
        self.faces.capacity() * size_of::<Face>() + SLOTS * 6
    }
}
