//! What does a ray meet first among all grids of a scene, and is anything between a point and a light?

use crate::beam::{Beam, Bundle, Span};
use crate::grid::{Grid, Layer};
use crate::lamps::Lamp;
use crate::levels::{BLOCK, Coarse, Footprint};
use crate::tree::{Tree, WorldRay};
use crate::walk::packet::Order;
use crate::walk::{Found, GridRay, Moment, Walk, fixed};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use polyptych_core::math::{Aabb, Ray};
use polyptych_core::scene::{AlphaMode, Material, Scene};
use std::cell::Cell;
use std::sync::Arc;

/// A scene made ready to be met by rays.
#[derive(Debug)]
pub(crate) struct World {
    /// All of its shapes that are drawn are grids.
    pub(crate) scene: Arc<Scene>,
    /// Rising by the index of their objects.
    pub(crate) items: Vec<Item>,
    tree: Tree,
    pub(crate) lamps: Vec<Lamp>,
    pub(crate) walk: Numbers,
}

/// In which numbers rays of tiles are walked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Numbers {
    /// In single precision, as it is rounded.
    Fast,
    /// In single precision, and in double where that is in doubt.
    Exact,
    /// In double precision, ray by ray.
    Double,
    /// In fixed point, ray by ray.
    Fixed,
}

impl Numbers {
    /// Returns how eight rays are walked at once, if they are.
    pub(crate) fn order(self) -> Option<Order> {
        match self {
            Self::Fast => Some(Order::Rounded),
            Self::Exact => Some(Order::Exact),
            Self::Double | Self::Fixed => None,
        }
    }
}

/// A grid in its place.
#[derive(Debug)]
pub(crate) struct Item {
    pub(crate) object: usize,
    pub(crate) grid: Arc<Grid>,
    pub(crate) grid_from_world: DAffine3,
    /// Unit outward normals of a cell's faces in world space: -x, +x, -y, +y, -z, +z.
    pub(crate) normals: [DVec3; 6],
    pub(crate) radius: f64,
    /// Whether each cell that may be seen is seen, so that no texture need be asked for holes.
    pub(crate) without_holes: bool,
    /// Longest edge of a cell in the world.
    pub(crate) edge: f64,
    /// Which item holds the blocks that stand for cells of this one from afar.
    pub(crate) coarser: Option<u32>,
    /// Colors of cells that are blocks of others, x fastest.
    pub(crate) colors: Option<Arc<[Vec3]>>,
}

/// How many rays were followed, and how many cells and empty blocks they left.
#[derive(Debug, Default)]
pub(crate) struct Counts {
    pub(crate) rays: Cell<u64>,
    pub(crate) shadow_rays: Cell<u64>,
    pub(crate) steps: Cell<u64>,
}

/// The place of a surface in the order in which a ray meets them: by distance, object, and cell.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(crate) struct Place {
    pub(crate) t: f64,
    pub(crate) item: i64,
    pub(crate) rank: i64,
}

impl Place {
    /// Before everything.
    pub(crate) const START: Self = Self { t: 0.0, item: -1, rank: -1 };
}

/// Where a ray begins.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Start<'a> {
    /// Anywhere; a cell around its origin is seen.
    Eye,
    /// On a surface that it leaves.
    Surface(&'a Site),
}

/// A point of a surface from which rays leave.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site {
    pub(crate) item: usize,
    /// In the space of the item's grid, exactly in the face.
    pub(crate) origin: DVec3,
    /// The cell in front of the face, or the one that was entered where a ray began in it.
    pub(crate) cell: [i32; 3],
    pub(crate) is_within_solid: bool,
}

/// The surface that a ray met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Met {
    pub(crate) place: Place,
    /// Where the walk entered the cell; see [`Walk::point`].
    pub(crate) origin: DVec3,
    /// See [`Walk::cell_before`].
    pub(crate) cell_before: [i32; 3],
    /// See [`Walk::face`].
    pub(crate) face: u8,
    pub(crate) value: u8,
    pub(crate) began_inside: bool,
}

impl Met {
    fn new(place: Place, walk: &Walk, value: u8) -> Self {
        Self {
            place,
            origin: walk.point(),
            cell_before: walk.cell_before(),
            face: walk.face() as u8,
            value,
            began_inside: walk.entered.is_none(),
        }
    }
}

/// The grids that the rays of a tile may meet, and where.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    count: usize,
    pub(crate) grids: [Option<(u32, Span)>; MOST_GRIDS],
}

/// A tile that sees more grids has its rays go through the tree.
const MOST_GRIDS: usize = 8;

impl Reach {
    /// Tells whether there is nothing to be met.
    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }
}

/// A point of a surface with all that shading needs, in world space.
#[derive(Clone, Debug)]
pub(crate) struct Point<'a> {
    pub(crate) object: usize,
    pub(crate) position: DVec3,
    /// Unit, on the viewer's side.
    pub(crate) normal: DVec3,
    pub(crate) material: &'a Material,
    pub(crate) color: Vec3,
    pub(crate) opacity: f32,
    /// Where rays to other grids leave: a little above the surface.
    pub(crate) lifted: DVec3,
    pub(crate) site: Site,
}

/// Rays to other grids leave a surface this share of the largest number at hand above it: far above rounding
/// (2e-16), far below any cell.
pub(crate) const LIFT: f64 = 1e-10;

/// Returns the outward normal of a cell's face in the space of its grid.
fn outward(face: usize) -> DVec3 {
    let axis = DVec3::AXES[face / 2];
    if face.is_multiple_of(2) { -axis } else { axis }
}

impl Item {
    pub(crate) fn new(scene: &Scene, object: usize, grid: Arc<Grid>, without_holes: bool) -> Self {
        let thing = &scene.objects[object];
        let grid_from_world = thing.world_from_object.inverse();
        let world_from_normal: DMat3 = grid_from_world.matrix3.transpose();
        let normals =
            std::array::from_fn(|face| (world_from_normal * outward(face)).normalize_or(outward(face)));
        let matrix = thing.world_from_object.matrix3;
        let edge = matrix.x_axis.length().max(matrix.y_axis.length()).max(matrix.z_axis.length());
        let radius = thing.bounds().radius();
        let (coarser, colors) = (None, None);
        Self { object, grid, grid_from_world, normals, radius, without_holes, edge, coarser, colors }
    }

    /// Returns the blocks of this grid as an item of their own.
    fn coarse(&self, level: &Coarse) -> Self {
        let scale = f64::from(BLOCK);
        Self {
            grid: level.grid.clone(),
            grid_from_world: DAffine3::from_scale(DVec3::splat(1.0 / scale)) * self.grid_from_world,
            edge: self.edge * scale,
            colors: Some(level.colors.clone()),
            coarser: None,
            ..*self
        }
    }

    /// Returns the color of a cell that stands for others.
    pub(crate) fn color_of(&self, cell: [i32; 3]) -> Option<Vec3> {
        let colors = self.colors.as_ref()?;
        let [nx, ny, _] = self.grid.seen.size.map(|s| s as usize);
        let [x, y, z] = cell.map(|c| c as usize);
        colors.get((z * ny + y) * nx + x).copied()
    }

    /// Returns from where to where along a ray the cells of this grid are looked for: before, they are larger than a
    /// pixel, and behind, blocks of them are not.
    pub(crate) fn range(&self, items: &[Self], footprint: &Footprint) -> [f64; 2] {
        let begins = if self.colors.is_some() {
            (footprint.distance(self.edge) - self.edge * 3f64.sqrt()).max(0.0)
        } else {
            0.0
        };
        let coarser = self.coarser.and_then(|c| items.get(c as usize));
        [begins, coarser.map_or(f64::INFINITY, |coarser| footprint.distance(coarser.edge))]
    }

    #[inline(always)]
    fn grid_ray(&self, ray: &Ray) -> Option<GridRay> {
        let direction = self.grid_from_world.transform_vector3(ray.direction);
        GridRay::new(self.grid_from_world.transform_point3(ray.origin), direction)
    }

    /// Returns the ray that leaves a surface of this grid.
    #[inline(always)]
    fn ray_from(&self, site: &Site, direction: DVec3) -> Option<GridRay> {
        GridRay::new(site.origin, self.grid_from_world.transform_vector3(direction))
    }

    /// Returns the largest number at hand for a point of this grid seen from a distance.
    #[inline(always)]
    fn reach_of(&self, position: DVec3, t: f64) -> f64 {
        position.abs().max_element().max(t).max(self.radius)
    }

    /// Tells whether a surface is there at all, and whether it blocks light.
    fn opacity(&self, scene: &Scene, value: u8, walk: &Walk) -> (f32, bool) {
        let material = scene.material(&scene.objects[self.object], usize::from(value) - 1);
        let normal = outward(walk.face());
        let position = walk.point().as_vec3();
        let (_, opacity) = scene.base_color(material, None, position, normal.as_vec3(), 0.0);
        let opacity = material.effective_opacity(opacity).min(1.0);
        (opacity, opacity >= 1.0 && material.alpha != AlphaMode::Blend)
    }
}

impl World {
    /// `levels` are the coarser grids of some items, finest first.
    pub(crate) fn new(
        scene: Arc<Scene>,
        mut items: Vec<Item>,
        levels: &[(usize, [Coarse; 2])],
        lamps: Vec<Lamp>,
        walk: Numbers,
    ) -> Self {
        let boxes: Vec<Aabb> = items
            .iter()
            .map(|item| {
                let bounds = scene.objects[item.object].bounds();
                let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
                bounds.grown(largest * 1e-12 + f64::MIN_POSITIVE)
            })
            .collect();
        // The tree holds the grids as they are: what goes through glass or comes from mirrors, and what seeks light.
        for (index, levels) in levels {
            let mut finer = *index;
            for level in levels {
                let coarse = items[finer].coarse(level);
                items[finer].coarser = Some(items.len() as u32);
                finer = items.len();
                items.push(coarse);
            }
        }
        Self { scene, tree: Tree::new(&boxes), items, lamps, walk }
    }

    /// Returns what [`World::bytes`] will be for so many objects and lights.
    pub(crate) fn planned_bytes(objects: usize, lamps: usize) -> u64 {
        (objects * size_of::<Item>() + lamps * size_of::<Lamp>()) as u64 + Tree::planned_bytes(objects)
    }

    /// Returns the bytes held without what grids hold.
    pub(crate) fn bytes(&self) -> u64 {
        (self.items.len() * size_of::<Item>() + self.lamps.len() * size_of::<Lamp>()) as u64
            + self.tree.bytes()
    }

    /// Finds which grids rays may meet, and where in them cells are marked in a layer. Nothing where the rays go
    /// apart too far, or see too many grids.
    pub(crate) fn reach(
        &self,
        bundle: &Bundle<'_>,
        layer: fn(&Grid) -> &Layer,
        footprint: &Footprint,
    ) -> Option<Reach> {
        let mut reach = Reach { count: 0, grids: [None; MOST_GRIDS] };
        let beam = Beam::of(bundle, &DAffine3::IDENTITY)?;
        let is_whole = self.tree.visit_beam(&beam, &mut |index| {
            let mut level = Some(index as u32);
            while let Some(index) = level {
                let item = &self.items[index as usize];
                let Some(beam) = Beam::of(bundle, &item.grid_from_world) else { return false };
                if let Some(span) = beam.span(layer(&item.grid)) {
                    let Some(place) = reach.grids.get_mut(reach.count) else { return false };
                    *place = Some((index, span));
                    reach.count += 1;
                }
                level = item.coarser.filter(|_| item.range(&self.items, footprint)[1] < f64::INFINITY);
            }
            true
        });
        is_whole.then_some(reach)
    }

    /// Finds the first surface that a ray from the eye meets in one grid, before a distance.
    pub(crate) fn meet_grid(
        &self,
        index: usize,
        span: &Span,
        ray: &Ray,
        before: f64,
        counts: &Counts,
    ) -> Option<Met> {
        let item = &self.items[index];
        let grid_ray = item.grid_ray(ray)?;
        let (enter, leave) = span.distances(&grid_ray);
        let moment = if enter > 0.0 { Moment::before(enter) } else { Moment::START };
        let walk = Walk::begin(grid_ray, item.grid.seen.size, moment)?;
        self.first_surface(index, walk, None, Place::START, before.min(leave), counts)
    }

    /// Finds the first block that a ray enters in a coarser grid between two distances. The block that it is in at the
    /// first was passed by the finer grid, where it is not the origin.
    pub(crate) fn meet_coarse(
        &self,
        index: usize,
        ray: &Ray,
        [from, to]: [f64; 2],
        counts: &Counts,
    ) -> Option<Met> {
        let item = &self.items[index];
        let moment = if from > 0.0 { Moment::before(from) } else { Moment::START };
        let mut walk = Walk::begin(item.grid_ray(ray)?, item.grid.seen.size, moment)?;
        if from > 0.0 && walk.entered.is_none() && !walk.leave(0) {
            return None;
        }
        self.first_surface(index, walk, None, Place::START, to, counts)
    }

    /// Goes on to the first marked cell in the numbers that were chosen.
    #[inline(always)]
    fn find_marked(&self, walk: &mut Walk, layer: &Layer, before: f64) -> Found {
        if self.walk == Numbers::Fixed {
            return fixed::find_marked(walk, layer, before);
        }
        walk.find_marked(layer, before)
    }

    /// Finds the first surface behind a place.
    pub(crate) fn meet(&self, ray: &Ray, start: Start<'_>, after: Place, counts: &Counts) -> Option<Met> {
        let mut best: Option<Met> = None;
        self.tree.visit(&WorldRay::new(*ray), f64::INFINITY, &mut |index, before| {
            let begun = self.begin(index, ray, start, after);
            let found = begun.and_then(|(walk, previous)| {
                self.first_surface(index, walk, previous, after, before, counts)
            });
            match (&best, found) {
                (Some(old), Some(new)) if new.place >= old.place => {}
                (_, Some(new)) => best = Some(new),
                (_, None) => {}
            }
            best.as_ref().map_or(f64::INFINITY, |met| met.place.t)
        });
        best
    }

    /// Follows a walk to the first surface behind a place; `previous` is the value of the cell before its first.
    #[inline(always)]
    fn first_surface(
        &self,
        index: usize,
        mut walk: Walk,
        mut previous: Option<u8>,
        after: Place,
        before: f64,
        counts: &Counts,
    ) -> Option<Met> {
        let item = &self.items[index];
        let found = loop {
            let marked = self.find_marked(&mut walk, &item.grid.seen, before);
            let Found::Marked { passed_empty } = marked else { break None };
            let value = item.grid.value(walk.cell());
            // Cells of one value are one body: only its outside is a surface.
            let is_surface = passed_empty || previous != Some(value);
            let place = Place { t: walk.t, item: index as i64, rank: walk.rank() };
            if is_surface
                && place > after
                && (item.without_holes || item.opacity(&self.scene, value, &walk).0 > 0.0)
            {
                break Some((place, value));
            }
            previous = Some(value);
            if !walk.leave(0) || walk.t > before {
                break None;
            }
        };
        counts.steps.set(counts.steps.get() + u64::from(walk.steps));
        found.map(|(place, value)| Met::new(place, &walk, value))
    }

    /// Begins a walk at a place of its ray; returns the value of the cell there too, unless the cell is to be
    /// seen itself.
    fn begin(&self, index: usize, ray: &Ray, start: Start<'_>, after: Place) -> Option<(Walk, Option<u8>)> {
        let item = &self.items[index];
        let size = item.grid.seen.size;
        let known = |walk: Walk| {
            let value = item.grid.value(walk.cell());
            Some((walk, Some(value)))
        };
        let grid_ray = match start {
            Start::Surface(site) if site.item == index => {
                let grid_ray = item.ray_from(site, ray.direction)?;
                if after.t <= 0.0 {
                    return known(Walk::begin_in(grid_ray, size, site.cell)?);
                }
                grid_ray
            }
            _ => item.grid_ray(ray)?,
        };
        let moment = if after == Place::START { Moment::START } else { Moment::before(after.t) };
        let walk = Walk::begin(grid_ray, size, moment)?;
        // A mirror ray that begins within glass has entered it already.
        let from_eye = matches!(start, Start::Eye) && after == Place::START;
        if walk.entered.is_some() || from_eye { Some((walk, None)) } else { known(walk) }
    }

    /// Tells whether anything blocks light between a surface and a distance along a ray; `reach` are the grids
    /// that it may meet, where that is known.
    #[inline(always)]
    pub(crate) fn is_blocked(
        &self,
        ray: &Ray,
        site: &Site,
        before: f64,
        reach: Option<&Reach>,
        counts: &Counts,
    ) -> bool {
        if let Some(reach) = reach {
            // A plain loop: what it calls is to be compiled for the processor at hand, too.
            for (index, span) in reach.grids.iter().flatten() {
                if self.blocks(*index as usize, ray, site, before, Some(span), counts) {
                    return true;
                }
            }
            return false;
        }
        let mut blocked = false;
        self.tree.visit(&WorldRay::new(*ray), before, &mut |index, before| {
            blocked = blocked || self.blocks(index, ray, site, before, None, counts);
            if blocked { f64::NEG_INFINITY } else { before }
        });
        blocked
    }

    #[inline(always)]
    pub(crate) fn blocks(
        &self,
        index: usize,
        ray: &Ray,
        site: &Site,
        before: f64,
        span: Option<&Span>,
        counts: &Counts,
    ) -> bool {
        let item = &self.items[index];
        let layer = &item.grid.blocking;
        let own = site.item == index;
        let grid_ray = if own { item.ray_from(site, ray.direction) } else { item.grid_ray(ray) };
        let Some(grid_ray) = grid_ray else { return false };
        let walk = if own {
            Walk::begin_in(grid_ray, layer.size, site.cell)
        } else {
            Walk::begin(grid_ray, layer.size, Moment::START)
        };
        let last = span.map_or(before, |span| span.distances(&grid_ray).1.min(before));
        let Some(mut walk) = walk else { return false };
        // The cell in front of a surface was passed before: what it holds let the ray through.
        let mut previous = (own && !site.is_within_solid).then(|| item.grid.value(walk.cell()));
        let blocked = loop {
            let Found::Marked { passed_empty } = self.find_marked(&mut walk, layer, last) else {
                break false;
            };
            if walk.t >= before {
                break false;
            }
            if item.without_holes && previous.is_none() {
                break true;
            }
            let value = item.grid.value(walk.cell());
            let is_surface = passed_empty || previous != Some(value);
            if is_surface && (item.without_holes || item.opacity(&self.scene, value, &walk).1) {
                break true;
            }
            previous = Some(value);
            if !walk.leave(0) {
                break false;
            }
        };
        counts.steps.set(counts.steps.get() + u64::from(walk.steps));
        blocked
    }

    /// Returns what shading needs of a surface that a ray met.
    #[inline(always)]
    pub(crate) fn point(&self, ray: &Ray, met: &Met) -> Point<'_> {
        let index = met.place.item as usize;
        let item = &self.items[index];
        let (origin, face) = (met.origin, usize::from(met.face));
        let material = self.scene.material(&self.scene.objects[item.object], usize::from(met.value) - 1);
        let outward = outward(face);
        let (color, opacity) =
            self.scene.base_color(material, None, origin.as_vec3(), outward.as_vec3(), 0.0);
        let position = ray.at(met.place.t);
        let reach = item.reach_of(position, met.place.t);
        Point {
            object: item.object,
            position,
            normal: item.normals[face],
            material,
            color,
            opacity: material.effective_opacity(opacity).min(1.0),
            lifted: position + item.normals[face] * (reach * LIFT),
            site: Site { item: index, origin, cell: met.cell_before, is_within_solid: met.began_inside },
        }
    }
}
