//! Where do eight rays meet eight triangles, one each?
//!
//! What a [`Face`](crate::face::Face) finds once for all pixels of a triangle is found here in lanes for pixels of
//! triangles that hardly show more than one.

use crate::color::{ChangesAll, changes_all};
use crate::lens::Lens;
use crate::model::Model;
use glam::{DVec3, Vec3};
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, LANES, Mask8, Vec3x8};

/// Which triangle each lane shows.
#[derive(Clone, Copy)]
pub(crate) struct Names {
    pub(crate) id: [u32; LANES],
    /// Index of its part, and the triangle's in it.
    pub(crate) part: [u32; LANES],
    pub(crate) triangle: [u32; LANES],
}

/// Eight triangles.
pub(crate) struct Octet {
    /// Relative to the lens's origin.
    first: DVec3x8,
    /// From the first corner to the others.
    edges: [DVec3x8; 2],
    /// Shading normals of the corners, in the world and on the outside; zero where there are none.
    normals: [Vec3x8; 3],
    /// Which are turned over by their part's transform.
    mirrored: Mask8,
}

/// Where the rays meet them.
pub(crate) struct OctetMet {
    /// Along the rays, in lengths of their directions.
    pub(crate) t: F64x8,
    /// Of the second and third corner.
    pub(crate) weights: [F64x8; 2],
    /// Which rays pass through their triangle; what is said of others means nothing.
    pub(crate) inside: Mask8,
    /// Unit true normals on the side where the rays come from.
    pub(crate) true_normal: DVec3x8,
    /// Shading normals on the same side, not of unit length; zero where there are none.
    pub(crate) normal: Vec3x8,
    /// How the weights change over a pixel, where that is asked for.
    pub(crate) changes: Option<ChangesAll>,
}

impl Octet {
    /// Gathers the triangles of the first `count` lanes.
    #[inline(always)]
    pub(crate) fn of(model: &Model, origin: DVec3, names: &Names, count: usize, with_normals: bool) -> Self {
        let (nowhere, none) = (DVec3x8::splat(DVec3::ZERO), Vec3x8::splat(Vec3::ZERO));
        let mut octet =
            Self { first: nowhere, edges: [nowhere; 2], normals: [none; 3], mirrored: Mask8::NONE };
        let mut waits = Mask8::first(count);
        for lead in 0..count {
            if !waits.has(lead) {
                continue;
            }
            // All that are of one part.
            let part = &model.parts[names.part[lead] as usize];
            let mesh = part.mesh();
            let has_normals = with_normals && !mesh.normals.is_empty();
            let (mut corners, mut normals, mut of_part) = ([none; 3], [none; 3], Mask8::NONE);
            for lane in lead..count {
                if names.part[lane] == names.part[lead] {
                    of_part.0[lane] = u32::MAX;
                    for (k, corner) in mesh.triangles[names.triangle[lane] as usize].into_iter().enumerate() {
                        corners[k].set(lane, mesh.positions[corner as usize]);
                        if has_normals {
                            normals[k].set(lane, mesh.normals[corner as usize]);
                        }
                    }
                }
            }
            waits = waits & !of_part;
            let matrix = &part.world_from_object.matrix3;
            let offset = DVec3x8::splat(part.world_from_object.translation - origin);
            let [a, b, c] = corners;
            let (a, b, c) = (a.to_f64().turned(matrix), b.to_f64().turned(matrix), c.to_f64().turned(matrix));
            octet.first = DVec3x8::pick(of_part, a + offset, octet.first);
            octet.edges[0] = DVec3x8::pick(of_part, b - a, octet.edges[0]);
            octet.edges[1] = DVec3x8::pick(of_part, c - a, octet.edges[1]);
            if has_normals {
                let matrix = &part.world_from_normal;
                let (x, y, z) = (
                    Vec3x8::splat(matrix.x_axis),
                    Vec3x8::splat(matrix.y_axis),
                    Vec3x8::splat(matrix.z_axis),
                );
                for (all, normal) in octet.normals.iter_mut().zip(normals) {
                    let turned = x.scaled(normal.x) + y.scaled(normal.y) + z.scaled(normal.z);
                    *all = Vec3x8::pick(of_part, turned, *all);
                }
            }
            if part.mirrored {
                octet.mirrored = octet.mirrored | of_part;
            }
        }
        octet
    }

    /// Meets the rays through eight places of the picture.
    #[inline(always)]
    pub(crate) fn meet(&self, lens: &Lens, x: F64x8, y: F64x8, with_changes: bool) -> OctetMet {
        let (zero, one) = (F64x8::ZERO, F64x8::splat(1.0));
        let (start, direction) = lens.lines(x, y);
        let [ab, ac] = self.edges;
        let normal = ab.cross(ac);
        let share = one / normal.dot(normal);
        let (slope, from_start) = (direction.dot(normal), self.first - start);
        let t = from_start.dot(normal) / slope;
        let place = direction.scaled(t) - from_start;
        let to_weights = [ac.cross(normal).scaled(share), normal.cross(ab).scaled(share)];
        let [v, w] = [place.dot(to_weights[0]), place.dot(to_weights[1])];
        let inside = (one - v - w).at_least(zero) & v.at_least(zero) & w.at_least(zero);
        let along = slope.above(zero);
        let from_within = (along & !self.mirrored) | (!along & self.mirrored);
        let length = share.sqrt();
        let true_normal = normal.scaled(F64x8::pick(along, -length, length));
        let [a, b, c] = self.normals;
        let outside = a + (b - a).scaled(v.round()) + (c - a).scaled(w.round());
        let flipped = F32x8::ZERO - F32x8::splat(1.0);
        let shading = outside.scaled(from_within.pick(flipped, F32x8::splat(1.0)));
        let changes = if with_changes {
            let [right, down] = lens.steps();
            let (right, down) = (DVec3x8::splat(right), DVec3x8::splat(down));
            let [v, w] = to_weights;
            let slopes = (slope, [direction.dot(v), direction.dot(w)]);
            let steps_of_weights = [[v.dot(right), v.dot(down)], [w.dot(right), w.dot(down)]];
            Some(changes_all(lens, t, slopes, ([normal.dot(right), normal.dot(down)], steps_of_weights)))
        } else {
            None
        };
        OctetMet { t, weights: [v, w], inside, true_normal, normal: shading, changes }
    }
}
