//! Light reckoned at corners and interpolated between them (H. Gouraud, *Continuous shading of curved surfaces*, IEEE
//! Transactions on Computers C-20(6), 1971). Color and shadow are those of the pixel.

use crate::face::{Face, Faces};
use crate::lens::Lens;
use crate::light::{Illumination, Lamp};
use glam::{DVec3, Vec3};
use polyptych_core::scene::{LightingModel, Material};
use polyptych_core::shade::Surface;

/// What a lamp adds at a corner: a share of the surface's color, and a highlight.
#[derive(Clone, Copy, Default)]
pub(crate) struct CornerLight {
    diffuse: Vec3,
    highlight: Vec3,
}

/// The light of each lamp at the corners of the triangles of a tile.
#[derive(Default)]
pub(crate) struct Gouraud {
    /// Lamp by lamp for each triangle.
    corners: Vec<[CornerLight; 3]>,
}

impl Gouraud {
    pub(crate) fn clear(&mut self) {
        self.corners.clear();
    }

    /// Lights the corners of triangles that came since the last call.
    pub(crate) fn light(&mut self, illumination: &Illumination<'_>, lens: &Lens, faces: &Faces) {
        let lamps = illumination.lamps;
        for face in faces.faces.iter().skip(self.corners.len() / lamps.len().max(1)) {
            let material = face.material(illumination.scene, illumination.model);
            let at = |lamp: &Lamp| {
                std::array::from_fn(|corner| {
                    at_corner(face, corner, material, lamp, lens, illumination.lighting)
                })
            };
            self.corners.extend(lamps.iter().map(at));
        }
    }

    /// Returns what a lamp adds to a sample of a triangle.
    pub(crate) fn added(
        &self,
        (face, lamp): (usize, usize),
        lamps: usize,
        color: Vec3,
        weights: [f32; 2],
    ) -> Vec3 {
        let corners = &self.corners[face * lamps + lamp];
        let shares = [1.0 - weights[0] - weights[1], weights[0], weights[1]];
        let mut sum = CornerLight::default();
        for (corner, share) in corners.iter().zip(shares) {
            sum.diffuse += corner.diffuse * share;
            sum.highlight += corner.highlight * share;
        }
        color * sum.diffuse + sum.highlight
    }

    pub(crate) fn bytes(&self) -> usize {
        self.corners.capacity() * size_of::<[CornerLight; 3]>()
    }
}

fn at_corner(
    face: &Face,
    corner: usize,
    material: &Material,
    lamp: &Lamp,
    lens: &Lens,
    model: LightingModel,
) -> CornerLight {
    let (place, normal) = face.corner(corner);
    let to_eye = lens.to_eye(place);
    let outside = if face.outward.dot(to_eye) < 0.0 { -1.0 } else { 1.0 };
    let Some(arriving) = lamp.light.arriving(place + lens.origin) else { return CornerLight::default() };
    let lit = |color: Vec3| {
        let to_eye = to_eye.as_vec3();
        let surface = Surface { material, color, normal: normal * outside, to_eye };
        surface.lit_by(model, arriving.to_light.as_vec3(), arriving.radiance)
    };
    let highlight = lit(Vec3::ZERO);
    CornerLight { diffuse: lit(Vec3::ONE) - highlight, highlight }
}

impl Face {
    /// Returns a corner relative to the lens's origin and the unit shading normal there, on the outside.
    fn corner(&self, corner: usize) -> (DVec3, Vec3) {
        let (place, normal) = self.raw_corner(corner);
        let normal = normal.normalize_or_zero();
        (place, if normal == Vec3::ZERO { self.outward.as_vec3() } else { normal })
    }
}
