//! How much of a light arrives by the usual shadow map: depths of four texels, compared and mixed?
//!
//! The point is moved off its surface, along the true normal, by what the four texels around it can be deeper: their
//! centers are up to a texel away along both axes. So it needs no bias that somebody sets. (Percentage-closer filtering:
//! W. T. Reeves, D. H. Salesin, R. L. Cook, *Rendering antialiased shadows with depth maps*, SIGGRAPH 1987; offset along
//! the normal: D. Holbert, *Normal offset shadows*, GDC 2011.) Shadows have soft edges of a texel's width, begin that
//! much behind what throws them, and miss what is thinner.

use crate::lens::cube_face;
use crate::lookup::{Blocker, Sights};
use crate::shadow::{MapFace, Shadows};
use crate::tile::NO_TRIANGLE;
use glam::DVec3;
use polyptych_core::lanes::{DVec3x8, F32x8, LANES, Mask8};

/// How far a point is moved off its surface, in texels, at right angles to the light: the diagonal of a texel, and a
/// tenth more.
const OFFSET: f64 = 1.1 * std::f64::consts::SQRT_2;

impl Shadows {
    /// Returns which share of the light arrives at each of the wanted points; `normal` are their true normals.
    pub(crate) fn shares_of_depths(
        &self,
        faces: &[MapFace],
        sights: &Sights,
        normal: &DVec3x8,
        wanted: Mask8,
    ) -> F32x8 {
        let mut shares = F32x8::splat(1.0);
        let Some(first) = faces.first() else { return shares };
        for i in (0..LANES).filter(|&i| wanted.has(i)) {
            let (place, to_light) = (sights.place.get(i), sights.to_light.get(i));
            let face = if faces.len() == 1 { first } else { &faces[cube_face(place - first.lens.origin)] };
            let normal = normal.get(i);
            let sine = normal.cross(to_light).length();
            let texel = face.lens.meters_of_pixel(place - face.lens.origin);
            shares.0[i] = self.share_at(face, place + normal * (OFFSET * texel * sine));
        }
        shares
    }

    /// Mixes what the four texels around a point say, by their distance from it.
    fn share_at(&self, face: &MapFace, place: DVec3) -> f32 {
        let (x, y, ahead) = face.lens.place(place - face.lens.origin);
        let (right, bottom) = (f64::from(face.lens.width) + 0.5, f64::from(face.lens.height) + 0.5);
        if !((ahead > 0.0) & (x >= -0.5) & (x <= right) & (y >= -0.5) & (y <= bottom)) {
            return 1.0;
        }
        let (column, row) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (u, v) = ((x - 0.5 - column) as f32, (y - 0.5 - row) as f32);
        let ids = face.square(column as i32, row as i32);
        let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let mut share = 0.0;
        for (k, (id, weight)) in ids.into_iter().zip(weights).enumerate() {
            let texel = (column + (k % 2) as f64 + 0.5, row + (k / 2) as f64 + 0.5);
            if id == NO_TRIANGLE || self.depth_at(face, id, texel) >= ahead {
                share += weight;
            }
        }
        share.clamp(0.0, 1.0)
    }

    /// Returns how far ahead of the light a texel shows a triangle.
    fn depth_at(&self, face: &MapFace, id: u32, (x, y): (f64, f64)) -> f64 {
        let (start, direction) = face.lens.line(x, y);
        let plane = Blocker::of(self, id, face.lens.origin + start);
        // Triangles that the light sees from the edge reach no farther than their corners.
        let t = plane.offset / plane.normal.dot(direction);
        let ahead = plane.corners.map(|corner| face.lens.ahead_of(corner + start));
        let nearest = ahead[0].min(ahead[1]).min(ahead[2]);
        if t.is_finite() { t.clamp(nearest, ahead[0].max(ahead[1]).max(ahead[2])) } else { nearest }
    }
}
