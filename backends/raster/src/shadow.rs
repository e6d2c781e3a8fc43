//! Which triangles does each light see, and does one of them stand between a point and the light?
//!
//! A map holds for each texel the triangle that the light sees there: the visibility buffer of the light's view.
//! A lookup takes the four texels around a point and holds the *named triangles* against the exact point, so
//! there is no bias and no acne: a triangle blocks
//!
//! 1. if the segment from the point to the light runs through it: exact edges wherever triangles are larger
//!    than texels; or
//! 2. if all four texels show something in front, for triangles too small to be named under the point. In front
//!    means on both sides: the triangle's plane is in front of the point, and the triangle at the texel is in
//!    front of the point's plane. The neighbor across a convex fold fails the second, the one across a concave
//!    fold the first, one in the same plane both.
//!
//! Source of storing names instead of depths: J. C. Hourcade, A. Nicolas, *Algorithms for antialiased cast
//! shadows*, Computers & Graphics 9(3), 1985; comparing planes instead of equal names is ours.

use crate::bin::{Bins, Pass, Without};
use crate::casters::Casters;
use crate::face::{Face, Place};
use crate::lens::{Lens, Rays, cube_axes, cube_face};
use crate::light::Lamp;
use crate::model::{Class, Model, Role};
use crate::tile::{NO_TRIANGLE, TILE_HEIGHT, TILE_PIXELS, TILE_WIDTH, TileBuffer, TileGrid};
use crate::transform::{ScreenVertex, transform};
use glam::{DMat3, DVec3, Vec3};
use polyptych_core::lanes::{DVec3x8, LANES, Mask8};
use polyptych_core::math::{Aabb, orthonormal_basis};
use polyptych_core::parallel::{Threads, for_each_mut};
use polyptych_core::scene::{LightKind, Scene};
use polyptych_core::seam::{Cancelled, Control};

/// Most texels of all maps of point and spot lights together: 128 MiB.
const MOST_TEXELS: u64 = 32 << 20;
/// Smallest edge of such a map that is worth drawing.
const LEAST_EDGE: u32 = 64;
/// Widest spot light (half angle) that one map serves.
const WIDEST_SPOT: f64 = 1.1;
/// Share of the largest coordinate below which points count as on a plane: several roundings of f32 corners.
const ON_PLANE: f64 = 4e-7;

/// The maps of all lights that cast shadows.
pub(crate) struct Shadows {
    /// Planes and maps are relative to this point.
    pub(crate) origin: DVec3,
    /// One for each lamp; without faces for those that cast no shadow.
    maps: Vec<Map>,
    /// One for each triangle of the model.
    blockers: Vec<Blocker>,
    tolerance: f64,
}

/// What a light sees: through one face, or six.
#[derive(Default)]
struct Map {
    faces: Vec<MapFace>,
}

pub(crate) struct MapFace {
    lens: Lens,
    grid: TileGrid,
    tiles: Vec<[u32; TILE_PIXELS]>,
}

/// The corners of a triangle, relative to [`Shadows::origin`]: close together in memory, since lookups jump.
/// Neighbors round a corner alike, so the way to a light finds no gap between them.
#[derive(Clone, Copy, Default)]
struct Blocker([Vec3; 3]);

/// `normal . p = offset`.
struct Plane {
    normal: DVec3,
    offset: f64,
}

impl Blocker {
    fn plane(&self) -> Plane {
        let [a, b, c] = self.0.map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        Plane { normal, offset: normal.dot(a) }
    }

    /// Tells whether a line through a point passes through the triangle.
    #[inline(always)]
    fn is_crossed(&self, place: DVec3, direction: DVec3) -> bool {
        let [a, b, c] = self.0;
        let (a, b, c) = (a.as_dvec3() - place, b.as_dvec3() - place, c.as_dvec3() - place);
        // Volumes spanned by the line and each edge, of one sign inside (edges belong to both neighbors).
        let u = b.cross(c).dot(direction);
        let v = c.cross(a).dot(direction);
        let w = a.cross(b).dot(direction);
        ((u >= 0.0) & (v >= 0.0) & (w >= 0.0)) | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0))
    }
}

/// The way from a point to a light.
#[derive(Clone, Copy)]
pub(crate) struct Sight {
    /// Relative to [`Shadows::origin`].
    pub(crate) place: DVec3,
    /// The triangle that the point is on.
    pub(crate) triangle: u32,
    pub(crate) to_light: DVec3,
    pub(crate) distance: f64,
}

/// What the map of a light shows around the points of a batch.
pub(crate) struct Looks<'a> {
    /// Nothing where the light does not see the point.
    face: [Option<&'a MapFace>; LANES],
    /// Column and row of the first of the texels whose centers are the corners of the square around the point.
    texel: [[i32; 2]; LANES],
    ids: [[u32; 4]; LANES],
}

impl<'a> Looks<'a> {
    pub(crate) fn none() -> Self {
        Self { face: [None; LANES], texel: [[0; 2]; LANES], ids: [[NO_TRIANGLE; 4]; LANES] }
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

    /// Tells whether the light sees more than one triangle around a point.
    #[inline(always)]
    pub(crate) fn see_more_than(&self, i: usize, triangle: u32) -> bool {
        self.ids[i].iter().any(|&id| (id != NO_TRIANGLE) & (id != triangle))
    }
}

/// Edge of the maps of each kind of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MapSizes {
    pub(crate) directional: u32,
    /// Nothing where there are too many lights for maps.
    pub(crate) local: Option<u32>,
}

impl MapSizes {
    /// Shares the memory among the lights that cast shadows.
    pub(crate) fn new(map_size: u32, lamps: &[Lamp]) -> Self {
        let faces: u64 = lamps.iter().filter(|l| l.light.casts_shadow).map(|l| faces_of(&l.light.kind)).sum();
        let fair = (MOST_TEXELS / faces.max(1)).isqrt() as u32;
        let edge = fair.min(map_size / 2).max(LEAST_EDGE.min(map_size));
        let fits = u64::from(edge) * u64::from(edge) * faces <= MOST_TEXELS;
        Self { directional: map_size, local: fits.then_some(edge) }
    }
}

/// Returns how many maps a light that is somewhere needs.
fn faces_of(kind: &LightKind) -> u64 {
    match kind {
        LightKind::Directional { .. } => 0,
        LightKind::Spot { outer, .. } if *outer <= WIDEST_SPOT => 1,
        LightKind::Point { .. } | LightKind::Spot { .. } => 6,
    }
}

/// Maps of before.
pub(crate) struct Before {
    pub(crate) shadows: Shadows,
    /// Whether the triangles that block are the same.
    pub(crate) same_blockers: bool,
    /// For each lamp whether its map is the same.
    pub(crate) same_maps: Vec<bool>,
}

impl Shadows {
    /// Draws the maps of all lights that cast shadows, but for those that are still right. The memory of others is
    /// used again: fresh pages cost more than what is drawn into them.
    pub(crate) fn build(
        (scene, model): (&Scene, &Model),
        lamps: &[Lamp],
        sizes: MapSizes,
        before: Option<Before>,
        vertices: &mut Vec<ScreenVertex>,
        bins: &mut Bins,
        control: &Control<'_>,
    ) -> Result<Self, Cancelled> {
        let origin = model.bounds.center();
        let tolerance = ON_PLANE * model.reach.max(model.bounds.radius());
        let casters = Casters::of(model, tolerance);
        let (mut spare, mut old_blockers, mut old_maps) = (Vec::new(), Vec::new(), Vec::new());
        let mut same_blockers = false;
        if let Some(before) = before {
            (old_blockers, same_blockers) = (before.shadows.blockers, before.same_blockers);
            for (map, same) in before.shadows.maps.into_iter().zip(before.same_maps) {
                if same {
                    old_maps.push(Some(map));
                } else {
                    old_maps.push(None);
                    spare.extend(map.faces.into_iter().map(|face| face.tiles));
                }
            }
        }
        let blockers =
            if same_blockers { old_blockers } else { blockers(model, origin, old_blockers, control.threads) };
        let mut shadows = Self { origin, maps: Vec::with_capacity(lamps.len()), blockers, tolerance };
        let mut old_maps = old_maps.into_iter();
        for lamp in lamps {
            if let Some(map) = old_maps.next().flatten() {
                shadows.maps.push(map);
                continue;
            }
            let mut map = Map::default();
            let (bounds, left_out) = casters.of_light(model, &lamp.light.kind, lamp.cell);
            if lamp.is_blocked && !bounds.is_empty() {
                let bounds = Aabb::new(bounds.min - origin, bounds.max - origin);
                for mut lens in lenses(&lamp.light.kind, sizes, &bounds, origin) {
                    control.check()?;
                    lens.origin += origin;
                    let role = Role::Light;
                    let (culls_back, without) = (false, Some(&left_out as &dyn Without));
                    let pass = Pass { model, lens: &lens, role, culls_back, smooth: false, without };
                    transform(model, &lens, vertices, control.threads);
                    let grid = TileGrid::new(lens.width, lens.height);
                    bins.fill(&pass, vertices, &grid, control.threads);
                    let mut tiles: Vec<[u32; TILE_PIXELS]> = spare.pop().unwrap_or_default();
                    tiles.resize(grid.count(), [NO_TRIANGLE; TILE_PIXELS]);
                    draw(scene, &pass, bins, &grid, &mut tiles, control.threads);
                    lens.origin -= origin;
                    map.faces.push(MapFace { lens, grid, tiles });
                }
            }
            shadows.maps.push(map);
        }
        Ok(shadows)
    }

    /// Returns the bytes of the map of a light, and those of a triangle that may block.
    pub(crate) fn planned_bytes(kind: &LightKind, sizes: MapSizes) -> (u64, u64) {
        let square = |edge: u32| (TileGrid::new(edge, edge).count() * TILE_PIXELS * 4) as u64;
        let map = match kind {
            LightKind::Directional { .. } => square(sizes.directional),
            LightKind::Point { .. } | LightKind::Spot { .. } => {
                sizes.local.map_or(0, |edge| faces_of(kind) * square(edge))
            }
        };
        (map, size_of::<Blocker>() as u64)
    }

    /// Returns where the maps are in memory, to tell whether they were kept.
    #[cfg(test)]
    pub(crate) fn memory(&self) -> Vec<*const [u32; TILE_PIXELS]> {
        self.maps.iter().flat_map(|map| &map.faces).map(|face| face.tiles.as_ptr()).collect()
    }

    /// Returns the bytes held.
    pub(crate) fn bytes(&self) -> u64 {
        let tiles: usize = self.maps.iter().flat_map(|m| &m.faces).map(|f| f.tiles.len()).sum();
        (tiles * TILE_PIXELS * 4 + self.blockers.len() * size_of::<Blocker>()) as u64
    }

    /// Looks points up in the map of a light. `origin` is what the places are relative to.
    #[inline(always)]
    pub(crate) fn look(&self, lamp: usize, places: DVec3x8, origin: DVec3, wanted: Mask8) -> Looks<'_> {
        let mut looks = Looks::none();
        let faces = &self.maps[lamp].faces[..];
        let Some(first) = faces.first() else { return looks };
        let places = places + DVec3x8::splat(origin - self.origin);
        let [x, y, ahead] = first.lens.places(places - DVec3x8::splat(first.lens.origin));
        for i in (0..LANES).filter(|&i| wanted.has(i)) {
            if faces.len() == 1 {
                looks.look(i, first, x.0[i], y.0[i], ahead.0[i]);
            } else {
                let place = places.get(i);
                let face = &faces[cube_face(place - first.lens.origin)];
                let (x, y, ahead) = face.lens.place(place - face.lens.origin);
                looks.look(i, face, x, y, ahead);
            }
        }
        looks
    }

    /// Tells whether one of the triangles at the texels around a point stands between it and the light.
    pub(crate) fn is_blocked(
        &self,
        scene: &Scene,
        model: &Model,
        looks: &Looks<'_>,
        i: usize,
        sight: &Sight,
    ) -> bool {
        let (Some(face), [column, row], ids) = (looks.face[i], looks.texel[i], &looks.ids[i]) else {
            return false;
        };
        let foreign = |id: u32| (id != NO_TRIANGLE) & (id != sight.triangle);
        for (i, &id) in ids.iter().enumerate().filter(|(_, id)| foreign(**id)) {
            let is_new = !ids[..i].contains(&id);
            let blocker = &self.blockers[id as usize];
            if is_new
                && blocker.is_crossed(sight.place, sight.to_light)
                && self.is_before(&blocker.plane(), sight)
                && self.is_solid(scene, model, id, sight)
            {
                return true;
            }
        }
        ids.iter().all(|&id| foreign(id))
            && ids.iter().enumerate().all(|(i, &id)| {
                let (x, y) = (f64::from(column) + 0.5, f64::from(row) + 0.5);
                let texel = (x + (i % 2) as f64, y + (i / 2) as f64);
                let plane = self.blockers[id as usize].plane();
                self.is_before(&plane, sight) && self.is_above(face, &plane, texel, sight)
            })
    }

    /// Tells whether a plane is between the point and the light.
    fn is_before(&self, plane: &Plane, sight: &Sight) -> bool {
        let gap = plane.offset - plane.normal.dot(sight.place);
        let slope = plane.normal.dot(sight.to_light);
        gap.abs() > self.tolerance && gap * slope > 0.0 && gap.abs() < slope.abs() * sight.distance
    }

    /// Tells whether the point of a plane at a texel's center is on the light's side of the plane of the
    /// point's own triangle.
    fn is_above(&self, face: &MapFace, plane: &Plane, texel: (f64, f64), sight: &Sight) -> bool {
        let own = self.blockers[sight.triangle as usize].plane();
        let (start, direction) = face.lens.line(texel.0, texel.1);
        let start = start + face.lens.origin;
        let t = (plane.offset - plane.normal.dot(start)) / plane.normal.dot(direction);
        let height = own.normal.dot(start + direction * t) - own.offset;
        height * own.normal.dot(sight.to_light).signum() > self.tolerance
    }

    /// Tells whether a triangle is no hole where the way to the light crosses it.
    fn is_solid(&self, scene: &Scene, model: &Model, id: u32, sight: &Sight) -> bool {
        let (index, triangle) = model.find(id);
        let part = &model.parts[index];
        if part.class(Role::Light, part.mesh().slot(triangle)) == Class::Solid {
            return true;
        }
        let lens = Lens::parallel(self.origin + sight.place, looking(sight.to_light), [1.0; 2], [0; 2]);
        let place = Place { scene, model, lens: &lens, x: 0.0, y: 0.0 };
        place.is_solid(&Face::new(scene, model, &lens, id))
    }
}

impl MapFace {
    /// Returns the triangles at a texel, its right neighbor, and the two below.
    #[inline(always)]
    fn square(&self, column: i32, row: i32) -> [u32; 4] {
        let (x, y) = (column as u32, row as u32);
        let (in_tile_x, in_tile_y) = (x % TILE_WIDTH, y % TILE_HEIGHT);
        let in_one_tile = in_tile_x + 1 < TILE_WIDTH && in_tile_y + 1 < TILE_HEIGHT;
        if in_one_tile && x + 1 < self.lens.width && y + 1 < self.lens.height {
            let tile = &self.tiles[(y / TILE_HEIGHT * self.grid.columns + x / TILE_WIDTH) as usize];
            let i = (in_tile_y * TILE_WIDTH + in_tile_x) as usize;
            let below = i + TILE_WIDTH as usize;
            return [tile[i], tile[i + 1], tile[below], tile[below + 1]];
        }
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| self.triangle(column + dx, row + dy))
    }

    fn triangle(&self, column: i32, row: i32) -> u32 {
        if column < 0 || row < 0 || column >= self.lens.width as i32 || row >= self.lens.height as i32 {
            return NO_TRIANGLE;
        }
        let (column, row) = (column as u32, row as u32);
        let tile = (row / TILE_HEIGHT) * self.grid.columns + column / TILE_WIDTH;
        self.tiles[tile as usize][(row % TILE_HEIGHT * TILE_WIDTH + column % TILE_WIDTH) as usize]
    }
}

/// Lists the corners of all triangles, in memory that was used before.
fn blockers(model: &Model, origin: DVec3, memory: Vec<Blocker>, threads: &dyn Threads) -> Vec<Blocker> {
    let mut blockers = memory;
    blockers.resize(model.triangles as usize, Blocker::default());
    for part in &model.parts {
        let count = part.mesh().triangles.len();
        let of_part = &mut blockers[part.first_triangle as usize..][..count];
        for_each_mut(threads, of_part, 1024, &|triangle, blocker| {
            *blocker = Blocker(part.corners(triangle, origin).map(DVec3::as_vec3));
        });
    }
    blockers
}

/// Returns axes (right, up, backward) of a view along a direction.
fn looking(forward: DVec3) -> DMat3 {
    let backward = -forward.normalize_or(DVec3::NEG_Y);
    let (right, up) = orthonormal_basis(backward);
    DMat3::from_cols(right, up, backward)
}

/// Returns the views of a light, relative to the origin of the shadows; `bounds` hold all that blocks.
fn lenses(kind: &LightKind, sizes: MapSizes, bounds: &Aabb, origin: DVec3) -> Vec<Lens> {
    let near = |position: DVec3| 1e-6 * (position.length() + bounds.radius());
    let local = sizes.local;
    match *kind {
        LightKind::Directional { direction } => {
            if direction.try_normalize().is_none() {
                return Vec::new();
            }
            vec![sun_lens(direction, sizes.directional, bounds)]
        }
        LightKind::Spot { position, direction, outer, .. } if faces_of(kind) == 1 => {
            let Some(edge) = local else { return Vec::new() };
            let position = position - origin;
            let scale = f64::from(edge.saturating_sub(4).max(1)) * 0.5 / outer.max(1e-3).tan();
            let lens = Lens::central(position, looking(direction), scale, [edge; 2], near(position));
            vec![lens.with_depths_of(bounds)]
        }
        LightKind::Point { position } | LightKind::Spot { position, .. } => {
            let Some(edge) = local else { return Vec::new() };
            let position = position - origin;
            // Two texels more than a right angle on each side: the four texels of a place lie on one face.
            let scale = f64::from(edge.saturating_sub(4).max(1)) * 0.5;
            let face = |i| Lens::central(position, cube_axes(i), scale, [edge; 2], near(position));
            (0..6).map(|i| face(i).with_depths_of(bounds)).collect()
        }
    }
}

/// Fits a view along parallel light to a box.
fn sun_lens(direction: DVec3, edge: u32, bounds: &Aabb) -> Lens {
    let axes = looking(direction);
    let from_world = axes.transpose();
    let fitted = Aabb::of_points(bounds.corners().map(|c| from_world * c));
    let size = fitted.size().max(DVec3::splat(1e-9 * fitted.radius().max(1e-30)));
    let texels = f64::from(edge.saturating_sub(2).max(1));
    let center = fitted.center();
    let front = fitted.max.z + size.z * 1e-3;
    let origin = axes * DVec3::new(center.x, center.y, front);
    Lens::parallel(origin, axes, [texels / size.x, texels / size.y], [edge; 2])
}

/// Draws what a light sees, tile by tile.
fn draw(
    scene: &Scene,
    pass: &Pass<'_>,
    bins: &Bins,
    grid: &TileGrid,
    tiles: &mut [[u32; TILE_PIXELS]],
    threads: &dyn Threads,
) {
    for_each_mut(threads, tiles, 4, &|index, tile| {
        let area = grid.area(index);
        let mut buffer = TileBuffer::of(bins.solid(index).copied(), &area);
        for record in bins.layers(index) {
            let face = Face::new(scene, pass.model, pass.lens, record.id);
            buffer.draw_where(record, &area, |x, y| {
                Place { scene, model: pass.model, lens: pass.lens, x, y }.is_solid(&face)
            });
        }
        *tile = buffer.id;
    });
    debug_assert!(pass.lens.rays == Rays::Parallel || pass.lens.near > 0.0);
}
