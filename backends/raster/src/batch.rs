//! How are many pixels resolved at once? As arrays, one number of each in a row, which the compiler turns into
//! the widest registers there are.

use crate::face::{Face, Place};
use crate::info::Shading;
use crate::lens::Lens;
use crate::model::Model;
use glam::{DVec3, Vec3};
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, LANES, Vec3x8};
use polyptych_core::scene::{Material, Scene};

/// Samples of a batch.
pub(crate) const BATCH: usize = 32;

/// Groups of eight in a batch.
pub(crate) const OCTETS: usize = BATCH / LANES;

/// Reads the vector of a sample.
macro_rules! at {
    ($vectors:expr, $i:expr) => {
        $vectors[$i / LANES].get($i % LANES)
    };
}
pub(crate) use at;

/// Places of the picture with the triangle seen there, and what resolving and lighting found out.
pub(crate) struct Batch<'a> {
    pub(crate) count: usize,
    /// Place in the picture.
    x: [f64; BATCH],
    y: [f64; BATCH],
    /// Index of the triangle in the tile's table.
    pub(crate) face: [u16; BATCH],
    /// What the painter needs to know to put the sample where it belongs.
    pub(crate) tag: [u32; BATCH],
    /// Along the ray, in lengths of its direction.
    t: [f64; BATCH],
    /// Of the triangle's second and third corner.
    pub(crate) weights: [[f32; 2]; BATCH],
    /// Along the ray, meters.
    pub(crate) distance: [f64; BATCH],
    /// Relative to the lens's origin, never outside of the triangle.
    pub(crate) place: [DVec3x8; OCTETS],
    /// Unit true normal on the viewer's side.
    pub(crate) true_normal: [DVec3x8; OCTETS],
    /// Unit shading normal, turned along with the true one.
    pub(crate) normal: [Vec3x8; OCTETS],
    /// Unit vector to the eye.
    pub(crate) to_eye: [Vec3x8; OCTETS],
    pub(crate) color: [Vec3x8; OCTETS],
    pub(crate) opacity: [f32; BATCH],
    pub(crate) material: [Option<&'a Material>; BATCH],
    /// Light that leaves towards the eye.
    pub(crate) lit: [Vec3x8; OCTETS],
    /// Share of the shadow-casting lights that arrive.
    pub(crate) shadow: [f32; BATCH],
}

/// What is asked of a point beyond its place and normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ask {
    /// Nothing: color is black, opacity 1.
    Geometry,
    /// Color and opacity.
    Color,
}

impl Batch<'_> {
    pub(crate) fn new() -> Self {
        Self {
            count: 0,
            x: [0.0; BATCH],
            y: [0.0; BATCH],
            face: [0; BATCH],
            tag: [0; BATCH],
            t: [1.0; BATCH],
            weights: [[0.0; 2]; BATCH],
            distance: [1.0; BATCH],
            place: [DVec3x8::splat(DVec3::ZERO); OCTETS],
            true_normal: [DVec3x8::splat(DVec3::ZERO); OCTETS],
            normal: [Vec3x8::splat(Vec3::ZERO); OCTETS],
            to_eye: [Vec3x8::splat(Vec3::ZERO); OCTETS],
            color: [Vec3x8::splat(Vec3::ZERO); OCTETS],
            opacity: [1.0; BATCH],
            material: [None; BATCH],
            lit: [Vec3x8::splat(Vec3::ZERO); OCTETS],
            shadow: [1.0; BATCH],
        }
    }

    pub(crate) fn push(&mut self, x: f64, y: f64, face: u16, tag: u32) {
        let i = self.count;
        (self.x[i], self.y[i], self.face[i], self.tag[i]) = (x, y, face, tag);
        self.count += 1;
    }

    pub(crate) fn is_full(&self) -> bool {
        self.count == BATCH
    }
}

impl<'a> Batch<'a> {
    /// Finds the surface points of all samples.
    #[inline(always)]
    pub(crate) fn resolve(
        &mut self,
        scene: &'a Scene,
        model: &Model,
        lens: &Lens,
        faces: &[Face],
        (ask, shading): (Ask, Shading),
    ) {
        let (mut held, mut any_held) = ([DVec3::NAN; BATCH], false);
        for i in 0..self.count {
            let (face, x, y) = (&faces[usize::from(self.face[i])], self.x[i], self.y[i]);
            let met = face.meet(lens, x, y);
            self.t[i] = met.t;
            self.weights[i] = [met.weights[1] as f32, met.weights[2] as f32];
            if let Some(place) = met.held {
                (held[i], any_held) = (place, true);
            }
            let outward = face.outward;
            let normal = if shading == Shading::Flat { outward.as_vec3() } else { face.normal(&met) };
            let (normal, outward) = if met.from_within { (-normal, -outward) } else { (normal, outward) };
            self.normal[i / LANES].set(i % LANES, normal);
            self.true_normal[i / LANES].set(i % LANES, outward);
            self.material[i] = Some(face.material(scene, model));
            if ask == Ask::Color {
                let (color, opacity) = face.color(&Place { scene, model, lens, x, y }, &met);
                self.opacity[i] = opacity;
                self.color[i / LANES].set(i % LANES, color);
            }
        }
        self.reach(lens);
        for i in (0..self.count).filter(|_| any_held) {
            if held[i].is_finite() {
                self.place[i / LANES].set(i % LANES, held[i]);
            }
        }
        self.straighten();
    }

    /// Goes along all rays: places, distances, directions to the eye.
    #[inline(always)]
    fn reach(&mut self, lens: &Lens) {
        for o in 0..self.count.div_ceil(LANES) {
            let of = |numbers: &[f64; BATCH]| F64x8::load(&numbers[o * LANES..]);
            let (start, direction) = lens.lines(of(&self.x), of(&self.y));
            let (t, length) = (of(&self.t), direction.length());
            (t * length).store(&mut self.distance[o * LANES..]);
            self.to_eye[o] = direction.scaled(F64x8::splat(-1.0) / length).round();
            self.place[o] = start + direction.scaled(t);
        }
    }

    /// Gives shading normals unit length; the true normal where there is none.
    #[inline(always)]
    fn straighten(&mut self) {
        let (zero, infinity) = (F32x8::splat(0.0), F32x8::splat(f32::INFINITY));
        for o in 0..self.count.div_ceil(LANES) {
            let share = F32x8::splat(1.0) / self.normal[o].length();
            let good = share.above(zero) & infinity.above(share);
            let straight = self.normal[o].scaled(share);
            self.normal[o] = Vec3x8::pick(good, straight, self.true_normal[o].round());
        }
    }
}
