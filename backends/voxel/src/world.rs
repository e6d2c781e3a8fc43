//! What does a ray meet first among all grids of a scene, and is anything between a point and a light?

use crate::grid::Grid;
use crate::lamps::Lamp;
use crate::tree::{Tree, WorldRay};
use crate::walk::{Found, GridRay, Moment, Walk};
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
    items: Vec<Item>,
    tree: Tree,
    pub(crate) lamps: Vec<Lamp>,
}

/// A grid in its place.
#[derive(Debug)]
pub(crate) struct Item {
    pub(crate) object: usize,
    grid: Arc<Grid>,
    grid_from_world: DAffine3,
    /// Unit outward normals of a cell's faces in world space: -x, +x, -y, +y, -z, +z.
    normals: [DVec3; 6],
    radius: f64,
    /// Whether each cell that may be seen is seen, so that no texture need be asked for holes.
    without_holes: bool,
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
    item: i64,
    rank: i64,
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
    item: usize,
    /// In the space of the item's grid, exactly in the face.
    origin: DVec3,
    /// The cell in front of the face, or the one that was entered where a ray began in it.
    cell: [i32; 3],
    is_within_solid: bool,
}

/// The surface that a ray met.
#[derive(Clone, Debug)]
pub(crate) struct Met {
    pub(crate) place: Place,
    walk: Walk,
    value: u8,
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
const LIFT: f64 = 1e-10;

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
        Self { object, grid, grid_from_world, normals, radius: thing.bounds().radius(), without_holes }
    }

    fn grid_ray(&self, ray: &Ray) -> Option<GridRay> {
        let direction = self.grid_from_world.transform_vector3(ray.direction);
        GridRay::new(self.grid_from_world.transform_point3(ray.origin), direction)
    }

    /// Begins the walk of a ray that leaves a surface of this grid.
    fn walk_from(&self, site: &Site, direction: DVec3) -> Option<Walk> {
        let direction = self.grid_from_world.transform_vector3(direction);
        Walk::begin_in(GridRay::new(site.origin, direction)?, self.grid.seen.size, site.cell)
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
    pub(crate) fn new(scene: Arc<Scene>, items: Vec<Item>, lamps: Vec<Lamp>) -> Self {
        let boxes: Vec<Aabb> = items
            .iter()
            .map(|item| {
                let bounds = scene.objects[item.object].bounds();
                let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
                bounds.grown(largest * 1e-12 + f64::MIN_POSITIVE)
            })
            .collect();
        Self { scene, tree: Tree::new(&boxes), items, lamps }
    }

    /// Returns the bytes held without what grids hold.
    pub(crate) fn bytes(&self) -> u64 {
        (self.items.len() * size_of::<Item>() + self.lamps.len() * size_of::<Lamp>()) as u64
            + self.tree.bytes()
    }

    /// Finds the first surface behind a place.
    pub(crate) fn meet(
        &self,
        ray: &WorldRay,
        start: Start<'_>,
        after: Place,
        counts: &Counts,
    ) -> Option<Met> {
        let mut best: Option<Met> = None;
        self.tree.visit(ray, f64::INFINITY, &mut |index, before| {
            let found = self.meet_one(index, ray, start, after, before, counts);
            match (&best, found) {
                (Some(old), Some(new)) if new.place >= old.place => {}
                (_, Some(new)) => best = Some(new),
                (_, None) => {}
            }
            best.as_ref().map_or(f64::INFINITY, |met| met.place.t)
        });
        best
    }

    fn meet_one(
        &self,
        index: usize,
        ray: &WorldRay,
        start: Start<'_>,
        after: Place,
        before: f64,
        counts: &Counts,
    ) -> Option<Met> {
        let item = &self.items[index];
        let (mut walk, mut previous) = self.begin(index, &ray.ray, start, after)?;
        let found = loop {
            let marked = walk.find_marked(&item.grid.seen, before);
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
        found.map(|(place, value)| Met { place, walk, value })
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
                if after.t <= 0.0 {
                    return known(item.walk_from(site, ray.direction)?);
                }
                let direction = item.grid_from_world.transform_vector3(ray.direction);
                GridRay::new(site.origin, direction)?
            }
            _ => item.grid_ray(ray)?,
        };
        let moment = if after == Place::START { Moment::START } else { Moment::before(after.t) };
        let walk = Walk::begin(grid_ray, size, moment)?;
        // A mirror ray that begins within glass has entered it already.
        let from_eye = matches!(start, Start::Eye) && after == Place::START;
        if walk.entered.is_some() || from_eye { Some((walk, None)) } else { known(walk) }
    }

    /// Tells whether anything blocks light between a surface and a distance along a ray.
    pub(crate) fn is_blocked(&self, ray: &WorldRay, site: &Site, before: f64, counts: &Counts) -> bool {
        let mut blocked = false;
        self.tree.visit(ray, before, &mut |index, before| {
            blocked = blocked || self.blocks(index, ray, site, before, counts);
            if blocked { f64::NEG_INFINITY } else { before }
        });
        blocked
    }

    fn blocks(&self, index: usize, ray: &WorldRay, site: &Site, before: f64, counts: &Counts) -> bool {
        let item = &self.items[index];
        let layer = &item.grid.blocking;
        let own = site.item == index;
        let walk = if own {
            item.walk_from(site, ray.ray.direction)
        } else {
            item.grid_ray(&ray.ray).and_then(|r| Walk::begin(r, layer.size, Moment::START))
        };
        let Some(mut walk) = walk else { return false };
        // The cell in front of a surface was passed before: what it holds let the ray through.
        let mut previous = (own && !site.is_within_solid).then(|| item.grid.value(walk.cell()));
        let blocked = loop {
            let Found::Marked { passed_empty } = walk.find_marked(layer, before) else { break false };
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
    pub(crate) fn point(&self, ray: &Ray, met: &Met) -> Point<'_> {
        let index = met.place.item as usize;
        let item = &self.items[index];
        let (walk, face) = (&met.walk, met.walk.face());
        let origin = walk.point();
        let material = self.scene.material(&self.scene.objects[item.object], usize::from(met.value) - 1);
        let outward = outward(face);
        let (color, opacity) =
            self.scene.base_color(material, None, origin.as_vec3(), outward.as_vec3(), 0.0);
        let position = ray.at(met.place.t);
        let reach = position.abs().max_element().max(met.place.t).max(item.radius);
        Point {
            object: item.object,
            position,
            normal: item.normals[face],
            material,
            color,
            opacity: material.effective_opacity(opacity).min(1.0),
            lifted: position + item.normals[face] * (reach * LIFT),
            site: Site {
                item: index,
                origin,
                cell: walk.cell_before(),
                is_within_solid: walk.entered.is_none(),
            },
        }
    }
}
