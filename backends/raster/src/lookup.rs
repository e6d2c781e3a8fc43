//! Does something stand between a point and a light?
//!
//! A lookup takes the four texels around a point and holds the triangles that they name against the exact point, so
//! there is no bias and no acne: a triangle blocks
//!
//! 1. if the segment from the point to the light runs through it: exact edges wherever triangles are larger
//!    than texels; or
//! 2. if all four texels show something in front, for triangles too small to be named under the point. In front
//!    means on both sides: the triangle's plane is in front of the point, and the triangle at the texel is in
//!    front of the point's plane. The neighbor across a convex fold fails the second, the one across a concave
//!    fold the first, one in the same plane both.
//!
//! Comparing planes instead of equal names is ours. Points are placed on the map eight at once; triangles are held
//! against them one by one, since gathering them for lanes takes longer than what is then reckoned, and most points see
//! no triangle but their own.

use crate::face::{Face, Place};
use crate::grid::{TILE_HEIGHT, TILE_PIXELS, TILE_WIDTH};
use crate::lens::{Lens, cube_face};
use crate::model::{Class, Model, Role};
use crate::shadow::{MapFace, Shadows, looking};
use crate::tile::NO_TRIANGLE;
use glam::DVec3;
use polyptych_core::lanes::{DVec3x8, F64x8, LANES, Mask8};
use polyptych_core::registers::fetch;
use polyptych_core::scene::Scene;

/// The ways from eight points to a light.
pub(crate) struct Sights {
    /// Relative to [`Shadows::origin`].
    pub(crate) place: DVec3x8,
    /// The triangles that the points are on.
    pub(crate) triangle: [u32; LANES],
    pub(crate) to_light: DVec3x8,
    pub(crate) distance: F64x8,
}

/// Where eight points fall on a map with one face.
pub(crate) struct Aims<'a> {
    face: &'a MapFace,
    /// Which of them it sees.
    sees: Mask8,
    /// See [`Looks::texel`].
    texel: [[i32; 2]; LANES],
    /// Where the four texels begin among all, if they are on one tile.
    square: [usize; LANES],
    is_whole: [bool; LANES],
}

/// What the map of a light shows around eight points.
pub(crate) struct Looks<'a> {
    /// Nothing where the light does not see the point.
    face: [Option<&'a MapFace>; LANES],
    /// Column and row of the first of the texels whose centers are the corners of the square around the point.
    texel: [[i32; 2]; LANES],
    ids: [[u32; 4]; LANES],
}

/// A triangle as seen from a point.
pub(crate) struct Blocker {
    /// Relative to the point.
    pub(crate) corners: [DVec3; 3],
    /// Not of unit length.
    pub(crate) normal: DVec3,
    /// `normal . p` of the points of its plane.
    pub(crate) offset: f64,
}

/// The way from a point to a light.
pub(crate) struct Sight {
    pub(crate) place: DVec3,
    pub(crate) triangle: u32,
    pub(crate) to_light: DVec3,
    distance: f64,
}

impl Sights {
    #[inline(always)]
    pub(crate) fn of(&self, lane: usize) -> Sight {
        Sight {
            place: self.place.get(lane),
            triangle: self.triangle[lane],
            to_light: self.to_light.get(lane),
            distance: self.distance.0[lane],
        }
    }
}

impl<'a> Aims<'a> {
    /// Finds where eight points fall on a face, and asks for the texels there. Maps are larger than caches: other work
    /// should be done before they are [read](Looks::read).
    #[inline(always)]
    pub(crate) fn at(face: &'a MapFace, places: DVec3x8) -> Self {
        let [x, y, ahead] = face.lens.places(places - DVec3x8::splat(face.lens.origin));
        let at = F64x8::splat;
        let (right, bottom) = (f64::from(face.lens.width) + 0.5, f64::from(face.lens.height) + 0.5);
        let within = |v: F64x8, end: f64| v.at_least(at(-0.5)) & at(end).at_least(v);
        let sees = ahead.above(at(0.0)) & within(x, right) & within(y, bottom);
        // The corners of a square of four texels' centers are around the point.
        let (column, row) = (x.nearest().0, y.nearest().0);
        let (width, height) = (face.lens.width as i32, face.lens.height as i32);
        let mut aims =
            Self { face, sees, texel: [[0; 2]; LANES], square: [0; LANES], is_whole: [false; LANES] };
        let texels = face.tiles.as_flattened();
        for i in 0..LANES {
            let (column, row) = (column[i].wrapping_sub(1), row[i].wrapping_sub(1));
            aims.texel[i] = [column, row];
            let is_on_map = (column >= 0) & (row >= 0) & (column < width - 1) & (row < height - 1);
            aims.is_whole[i] = is_on_map & (sees.0[i] != 0) & MapFace::is_in_one_tile(column, row);
            aims.square[i] = if aims.is_whole[i] { face.place_of(column, row) } else { 0 };
            fetch(&texels[aims.square[i]]);
            fetch(&texels[aims.square[i] + TILE_WIDTH as usize]);
        }
        aims
    }
}

impl<'a> Looks<'a> {
    fn none() -> Self {
        Self { face: [None; LANES], texel: [[0; 2]; LANES], ids: [[NO_TRIANGLE; 4]; LANES] }
    }

    /// Reads the texels at the wanted points.
    #[inline(always)]
    pub(crate) fn read(aims: &Aims<'a>, wanted: Mask8) -> Self {
        let mut looks = Self { texel: aims.texel, ..Self::none() };
        let texels = aims.face.tiles.as_flattened();
        for (ids, &square) in looks.ids.iter_mut().zip(&aims.square) {
            let (upper, lower) = (&texels[square..][..2], &texels[square + TILE_WIDTH as usize..][..2]);
            *ids = [upper[0], upper[1], lower[0], lower[1]];
        }
        let sees = aims.sees & wanted;
        for i in 0..LANES {
            if !sees.has(i) {
                looks.ids[i] = [NO_TRIANGLE; 4];
                continue;
            }
            looks.face[i] = Some(aims.face);
            if !aims.is_whole[i] {
                looks.ids[i] = aims.face.square(aims.texel[i][0], aims.texel[i][1]);
            }
        }
        looks
    }

    /// Looks where a point falls on a column and row of a face, if the light sees them.
    #[inline(always)]
    fn look(&mut self, i: usize, face: &'a MapFace, x: f64, y: f64, ahead: f64) {
        let (right, bottom) = (f64::from(face.lens.width) + 0.5, f64::from(face.lens.height) + 0.5);
        if (ahead > 0.0) & (x >= -0.5) & (x <= right) & (y >= -0.5) & (y <= bottom) {
            self.texel[i] = [(x + 0.5) as i32 - 1, (y + 0.5) as i32 - 1];
            self.ids[i] = face.square(self.texel[i][0], self.texel[i][1]);
            self.face[i] = Some(face);
        }
    }
}

impl Blocker {
    #[inline(always)]
    pub(crate) fn of(shadows: &Shadows, id: u32, place: DVec3) -> Self {
        let [a, b, c] = shadows.blockers[id as usize].0;
        let corners = [a.as_dvec3() - place, b.as_dvec3() - place, c.as_dvec3() - place];
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        Self { corners, normal, offset: normal.dot(corners[0]) }
    }

    /// Tells whether a line through the point passes through the triangle.
    #[inline(always)]
    pub(crate) fn is_crossed(&self, direction: DVec3) -> bool {
        let [a, b, c] = self.corners;
        // Volumes spanned by the line and each edge, of one sign inside (edges belong to both neighbors).
        let u = b.cross(c).dot(direction);
        let v = c.cross(a).dot(direction);
        let w = a.cross(b).dot(direction);
        ((u >= 0.0) & (v >= 0.0) & (w >= 0.0)) | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0))
    }

    /// Tells whether its plane is between the point and the light.
    #[inline(always)]
    pub(crate) fn is_before(&self, sight: &Sight, tolerance: f64) -> bool {
        let (gap, slope) = (self.offset, self.normal.dot(sight.to_light));
        gap * slope > 0.0
            && gap.abs() < slope.abs() * sight.distance
            && gap * gap > self.normal.length_squared() * (tolerance * tolerance)
    }
}

impl Shadows {
    /// Looks points, relative to the origin of the shadows, up in the maps of a light, one by one.
    #[inline(always)]
    pub(crate) fn look<'f>(&self, faces: &'f [MapFace], places: DVec3x8, wanted: Mask8) -> Looks<'f> {
        let mut looks = Looks::none();
        let Some(first) = faces.first() else { return looks };
        for i in (0..LANES).filter(|&i| wanted.has(i)) {
            let place = places.get(i);
            let face = &faces[cube_face(place - first.lens.origin)];
            let (x, y, ahead) = face.lens.place(place - face.lens.origin);
            looks.look(i, face, x, y, ahead);
        }
        looks
    }

    /// Tells at which of the wanted points one of the triangles at the texels around it stands between it and the
    /// light.
    #[inline(always)]
    pub(crate) fn blocked(
        &self,
        (scene, model): (&Scene, &Model),
        looks: &Looks<'_>,
        sights: &Sights,
        wanted: Mask8,
    ) -> Mask8 {
        let mut blocked = Mask8::NONE;
        for i in 0..LANES {
            let triangle = sights.triangle[i];
            let any = looks.ids[i].iter().any(|&id| (id != NO_TRIANGLE) & (id != triangle));
            if wanted.has(i) && any && self.is_blocked(scene, model, looks, i, &sights.of(i)) {
                blocked.0[i] = u32::MAX;
            }
        }
        blocked
    }

    fn is_blocked(&self, scene: &Scene, model: &Model, looks: &Looks<'_>, i: usize, sight: &Sight) -> bool {
        let (Some(face), ids) = (looks.face[i], &looks.ids[i]) else { return false };
        let mut all_before = true;
        for (k, &id) in ids.iter().enumerate() {
            if (id == NO_TRIANGLE) | (id == sight.triangle) {
                all_before = false;
            } else if !ids[..k].contains(&id) {
                let blocker = Blocker::of(self, id, sight.place);
                let is_before = blocker.is_before(sight, self.tolerance);
                all_before &= is_before;
                if is_before && blocker.is_crossed(sight.to_light) && self.is_solid(scene, model, id, sight) {
                    return true;
                }
            }
        }
        all_before && self.are_above(face, looks.texel[i], ids, sight)
    }

    /// Tells whether the triangles that texels name are, at the texels' centers, on the light's side of the plane of
    /// the point's own.
    fn are_above(&self, face: &MapFace, [column, row]: [i32; 2], ids: &[u32; 4], sight: &Sight) -> bool {
        let own = Blocker::of(self, sight.triangle, sight.place);
        let lowest = own.normal.length() * self.tolerance;
        let side = own.normal.dot(sight.to_light).signum();
        ids.iter().zip([(0, 0), (1, 0), (0, 1), (1, 1)]).all(|(&id, (right, down))| {
            let there = Blocker::of(self, id, sight.place);
            let (x, y) = (f64::from(column + right) + 0.5, f64::from(row + down) + 0.5);
            let (start, direction) = face.lens.line(x, y);
            let start = start + face.lens.origin - sight.place;
            let t = (there.offset - there.normal.dot(start)) / there.normal.dot(direction);
            let height = own.normal.dot(start + direction * t) - own.offset;
            height * side > lowest
        })
    }

    /// Tells whether a triangle is no hole where the way to the light crosses it.
    #[inline(always)]
    pub(crate) fn is_solid(&self, scene: &Scene, model: &Model, id: u32, sight: &Sight) -> bool {
        !self.any_holes || self.is_no_hole(scene, model, id, sight)
    }

    #[inline(never)]
    fn is_no_hole(&self, scene: &Scene, model: &Model, id: u32, sight: &Sight) -> bool {
        let (index, triangle) = model.find(id);
        let part = &model.parts[index];
        if part.class(Role::Light, part.mesh().slot(triangle)) == Class::Solid {
            return true;
        }
        let lens = Lens::parallel(self.origin + sight.place, looking(sight.to_light), [1.0; 2], [0; 2]);
        let place = Place { scene, model, lens: &lens, x: 0.0, y: 0.0 };
        place.is_solid(&Face::new(model, &lens, id))
    }
}

impl MapFace {
    /// Tells whether a texel, its right neighbor, and the two below are in one tile.
    #[inline(always)]
    fn is_in_one_tile(column: i32, row: i32) -> bool {
        let (last_column, last_row) = (TILE_WIDTH as i32 - 1, TILE_HEIGHT as i32 - 1);
        (column & last_column < last_column) & (row & last_row < last_row)
    }

    /// Returns where a texel on the map is among all.
    #[inline(always)]
    fn place_of(&self, column: i32, row: i32) -> usize {
        let (x, y) = (column as u32, row as u32);
        let tile = y / TILE_HEIGHT * self.grid.columns + x / TILE_WIDTH;
        tile as usize * TILE_PIXELS + (y % TILE_HEIGHT * TILE_WIDTH + x % TILE_WIDTH) as usize
    }

    /// Returns the triangles at a texel, its right neighbor, and the two below.
    #[inline(always)]
    pub(crate) fn square(&self, column: i32, row: i32) -> [u32; 4] {
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| self.triangle(column + dx, row + dy))
    }

    fn triangle(&self, column: i32, row: i32) -> u32 {
        if column < 0 || row < 0 || column >= self.lens.width as i32 || row >= self.lens.height as i32 {
            return NO_TRIANGLE;
        }
        self.tiles.as_flattened()[self.place_of(column, row)]
    }
}
