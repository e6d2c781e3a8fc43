//! Which triangles does each light see?
//!
//! A map holds for each texel the triangle that the light sees there: the visibility buffer of the light's view.
//! Source of storing names instead of depths: J. C. Hourcade, A. Nicolas, *Algorithms for antialiased cast
//! shadows*, Computers & Graphics 9(3), 1985. What stands before a point is found by [`lookup`](crate::lookup).

use crate::bin::{Bins, Pass, Without};
use crate::casters::Casters;
use crate::exact::{Cells, edge_for};
use crate::face::{Face, Place};
use crate::grid::{TILE_PIXELS, TileGrid};
use crate::info::Tier;
use crate::lens::{Lens, Rays, cube_axes};
use crate::light::Lamp;
use crate::lookup::{Aims, Looks, Sights};
use crate::model::{Model, Part, Role};
use crate::tile::{NO_TRIANGLE, TileBuffer};
use crate::transform::{ScreenVertices, transform};
use glam::{DMat3, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::lanes::{DVec3x8, F32x8, Mask8};
use polyptych_core::math::{Aabb, orthonormal_basis};
use polyptych_core::scene::{LightKind, Scene};
use polyptych_core::seam::{Cancelled, Control, Need};

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
    /// Corners and maps are relative to this point.
    pub(crate) origin: DVec3,
    /// One for each lamp; without faces for those that cast no shadow.
    pub(crate) maps: Vec<Map>,
    /// One for each triangle of the model.
    pub(crate) blockers: Vec<Blocker>,
    /// Whether some of them have holes.
    pub(crate) any_holes: bool,
    /// How far from a plane points count as on it.
    pub(crate) tolerance: f64,
}

/// What a light sees: through one face, or six.
#[derive(Default)]
pub(crate) struct Map {
    pub(crate) faces: Vec<MapFace>,
    /// Instead of faces, where shadows are found exactly.
    cells: Vec<Cells>,
    is_plain: bool,
}

pub(crate) struct MapFace {
    pub(crate) lens: Lens,
    pub(crate) grid: TileGrid,
    pub(crate) tiles: Vec<[u32; TILE_PIXELS]>,
}

/// The corners of a triangle, relative to [`Shadows::origin`]: close together in memory, since lookups jump.
/// Neighbors round a corner alike, so the way to a light finds no gap between them.
#[derive(Clone, Copy, Default)]
pub(crate) struct Blocker(pub(crate) [Vec3; 3]);

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

    /// Returns the sizes of pictures whose tiles serve as cells.
    fn for_cells(self, triangles: u32) -> Self {
        let edge = edge_for(triangles);
        Self { directional: edge, local: self.local.map(|_| edge / 2) }
    }

    /// Chooses how shadows are found: as asked, or so that no edge of one is coarser than the pixels of a picture.
    pub(crate) fn choose_tiers(self, lamps: &mut [Lamp], asked: Option<Tier>, scene: &Scene, need: &Need) {
        let bounds = if asked.is_none() { scene.bounds() } else { Aabb::EMPTY };
        for lamp in lamps {
            let suited = || self.tier_for(&lamp.light.kind, &bounds, &need.camera, need.height);
            lamp.tier = asked.unwrap_or_else(suited);
        }
    }

    /// Compares the sizes of texels and pixels in the middle of what is seen.
    fn tier_for(self, kind: &LightKind, bounds: &Aabb, camera: &Camera, height: u32) -> Tier {
        let center = bounds.center();
        let pixel = match camera.projection {
            Projection::Orthographic { height: meters } => meters / f64::from(height.max(1)),
            Projection::Perspective { fov_y } => {
                let away = center.distance(camera.eye).max(bounds.radius());
                2.0 * (fov_y * 0.5).tan() * away / f64::from(height.max(1))
            }
            // Bent pictures are looked up in faces whose pixels are finer.
            Projection::Fisheye { .. } | Projection::Cylindrical { .. } | Projection::Warp(_) => 0.0,
        };
        let around = Aabb::new(bounds.min - center, bounds.max - center);
        let lens = lenses(kind, self, &around, center).into_iter().next();
        let texel = lens.map_or(0.0, |lens| lens.meters_of_pixel(-lens.origin).abs());
        if texel > pixel { Tier::Exact } else { Tier::Id }
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
        vertices: &mut Vec<ScreenVertices>,
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
            if same_blockers { old_blockers } else { blockers(model, origin, old_blockers, control)? };
        let any_holes = model.parts.iter().any(Part::has_holes);
        let mut shadows =
            Self { origin, maps: Vec::with_capacity(lamps.len()), blockers, any_holes, tolerance };
        let mut old_maps = old_maps.into_iter();
        for lamp in lamps {
            if let Some(map) = old_maps.next().flatten() {
                shadows.maps.push(map);
                continue;
            }
            let mut map = Map { is_plain: lamp.tier == Tier::Plain, ..Map::default() };
            let (bounds, left_out) = casters.of_light(model, &lamp.light.kind, lamp.cell);
            if lamp.is_blocked && !bounds.is_empty() {
                let bounds = Aabb::new(bounds.min - origin, bounds.max - origin);
                let exact = lamp.tier == Tier::Exact;
                let sizes = if exact { sizes.for_cells(model.triangles) } else { sizes };
                for mut lens in lenses(&lamp.light.kind, sizes, &bounds, origin) {
                    control.check()?;
                    lens.origin += origin;
                    let role = Role::Light;
                    let (culls_back, without) = (false, Some(&left_out as &dyn Without));
                    // A cell lists all that touches it; a map shows what its texels' centers show.
                    let pass = Pass { model, lens: &lens, role, culls_back, smooth: exact, without };
                    transform(model, &lens, vertices, control)?;
                    let grid = TileGrid::new(lens.width, lens.height).smooth(exact);
                    bins.fill(&pass, vertices, &grid, control)?;
                    if exact {
                        lens.origin -= origin;
                        map.cells.push(Cells::of(lens, grid, bins));
                        continue;
                    }
                    let mut tiles: Vec<[u32; TILE_PIXELS]> = spare.pop().unwrap_or_default();
                    tiles.resize(grid.count(), [NO_TRIANGLE; TILE_PIXELS]);
                    draw(scene, &pass, bins, &grid, &mut tiles, control)?;
                    lens.origin -= origin;
                    map.faces.push(MapFace { lens, grid, tiles });
                }
            }
            shadows.maps.push(map);
        }
        Ok(shadows)
    }

    /// Finds where points, relative to the origin of the shadows, fall on the map of a light that has one face and
    /// names triangles.
    #[inline(always)]
    pub(crate) fn aim(&self, lamp: usize, places: DVec3x8) -> Option<Aims<'_>> {
        let map = &self.maps[lamp];
        if let (false, [face]) = (map.is_plain, &*map.faces) { Some(Aims::at(face, places)) } else { None }
    }

    /// Returns which share of a light arrives at each of the wanted points; `normal` are their true normals, `aims` what
    /// [`Shadows::aim`] returned for them.
    #[inline(always)]
    pub(crate) fn shares(
        &self,
        (lamp, aims): (usize, Option<Aims<'_>>),
        of: (&Scene, &Model),
        sights: &Sights,
        normal: &DVec3x8,
        wanted: Mask8,
    ) -> F32x8 {
        let map = &self.maps[lamp];
        if map.is_plain {
            return self.shares_of_depths(&map.faces, sights, normal, wanted);
        }
        let blocked = if map.cells.is_empty() {
            let looks = match &aims {
                Some(aims) => Looks::read(aims, wanted),
                None => self.look(&map.faces, sights.place, wanted),
            };
            self.blocked(of, &looks, sights, wanted)
        } else {
            self.blocked_exactly(of, &map.cells, sights, wanted)
        };
        blocked.pick(F32x8::ZERO, F32x8::splat(1.0))
    }

    /// Returns the bytes of the maps or cells of a light, and those of a triangle that may block.
    pub(crate) fn planned_bytes(lamp: &Lamp, sizes: MapSizes, triangles: u64) -> (u64, u64) {
        let exact = lamp.tier == Tier::Exact;
        let sizes = if exact { sizes.for_cells(u32::try_from(triangles).unwrap_or(u32::MAX)) } else { sizes };
        let square = |edge: u32| {
            let cells = TileGrid::new(edge, edge).count() as u64;
            if exact { Cells::planned_bytes(cells, triangles) } else { cells * TILE_PIXELS as u64 * 4 }
        };
        let map = match &lamp.light.kind {
            LightKind::Directional { .. } => square(sizes.directional),
            kind @ (LightKind::Point { .. } | LightKind::Spot { .. }) => {
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
        let cells: u64 = self.maps.iter().flat_map(|m| &m.cells).map(Cells::bytes).sum();
        (tiles * TILE_PIXELS * 4 + self.blockers.len() * size_of::<Blocker>()) as u64 + cells
    }
}

/// Lists the corners of all triangles, in memory that was used before.
fn blockers(
    model: &Model,
    origin: DVec3,
    memory: Vec<Blocker>,
    control: &Control<'_>,
) -> Result<Vec<Blocker>, Cancelled> {
    let mut blockers = memory;
    blockers.resize(model.triangles as usize, Blocker::default());
    for part in &model.parts {
        let count = part.mesh().triangles.len();
        let of_part = &mut blockers[part.first_triangle as usize..][..count];
        control.for_each_mut(of_part, 1024, &|triangle, blocker| {
            *blocker = Blocker(part.corners(triangle, origin).map(DVec3::as_vec3));
        })?;
    }
    Ok(blockers)
}

/// Returns axes (right, up, backward) of a view along a direction.
pub(crate) fn looking(forward: DVec3) -> DMat3 {
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
    control: &Control<'_>,
) -> Result<(), Cancelled> {
    debug_assert!(pass.lens.rays == Rays::Parallel || pass.lens.near > 0.0);
    control.for_each_mut(tiles, 4, &|index, tile| {
        if bins.is_empty(index) {
            tile.fill(NO_TRIANGLE);
            return;
        }
        let area = grid.area(index);
        let mut buffer = TileBuffer::of(bins, index, &area, [0; 2]);
        for record in bins.runs().iter().flat_map(|run| run.layers.of_tile(index)) {
            let face = Face::new(pass.model, pass.lens, record.id);
            buffer.draw_where(record, &area, |x, y| {
                Place { scene, model: pass.model, lens: pass.lens, x, y }.is_solid(&face)
            });
        }
        *tile = buffer.id;
    })
}
