//! Which parts can stand between a light and anything else?
//!
//! A floor under everything blocks no light from above. Left out of the maps it does not stretch them over its
//! whole size, and what stands on it gets all their texels.

use crate::bin::Without;
use crate::light::Cell;
use crate::model::{Class, Model, Part, Role};
use glam::DVec3;
use polyptych_core::math::Aabb;
use polyptych_core::scene::LightKind;

/// A plane with everything on one side of it.
#[derive(Clone, Copy, Debug)]
struct Ground {
    /// To the side where everything is.
    normal: DVec3,
    /// `normal . p` of its points, in the world.
    offset: f64,
}

/// What can block light, found once for all lights of a model.
pub(crate) struct Casters {
    /// For each part whether it has triangles that block light.
    blocks: Vec<bool>,
    grounds: Vec<Option<Ground>>,
}

/// The parts that can block one light.
pub(crate) struct LeftOut {
    /// By object.
    objects: Vec<bool>,
    /// The voxel that gives off the light: its own faces do not block it.
    pub(crate) cell: Option<Cell>,
}

impl Casters {
    pub(crate) fn of(model: &Model, tolerance: f64) -> Self {
        let blocks = model.parts.iter().map(Part::blocks_light).collect();
        let grounds = (0..model.parts.len()).map(|part| ground(model, part, tolerance)).collect();
        Self { blocks, grounds }
    }

    /// Returns bounds of all that can block a light, and what the light's pass leaves out.
    pub(crate) fn of_light(&self, model: &Model, kind: &LightKind, cell: Option<Cell>) -> (Aabb, LeftOut) {
        let objects = model.parts.last().map_or(0, |p| p.object + 1);
        let mut left_out = LeftOut { objects: vec![true; objects], cell };
        let mut bounds = Aabb::EMPTY;
        for (i, part) in model.parts.iter().enumerate() {
            let useless = self.grounds[i].is_some_and(|ground| ground.is_lit_from_above(kind));
            if self.blocks[i] && !useless {
                left_out.objects[part.object] = false;
                bounds = bounds.union(part.bounds);
            }
        }
        (bounds, left_out)
    }
}

impl Ground {
    /// Tells whether a light is on the side where everything is.
    fn is_lit_from_above(&self, kind: &LightKind) -> bool {
        match *kind {
            LightKind::Directional { direction } => self.normal.dot(direction) < 0.0,
            LightKind::Point { position } | LightKind::Spot { position, .. } => {
                self.normal.dot(position) > self.offset
            }
        }
    }
}

/// Returns the plane of a part if it is flat and everything else lies on one side.
fn ground(model: &Model, index: usize, tolerance: f64) -> Option<Ground> {
    let part = &model.parts[index];
    let origin = model.bounds.center();
    let mut normal = DVec3::ZERO;
    let mut height = 0.0;
    for triangle in 0..part.mesh().triangles.len() {
        let corners = part.corners(triangle, origin);
        if normal == DVec3::ZERO {
            let [a, b, c] = corners;
            normal = (b - a).cross(c - a).normalize_or_zero();
            height = normal.dot(a);
        }
        if corners.iter().any(|p| (normal.dot(*p) - height).abs() > tolerance) {
            return None;
        }
    }
    let others = || model.parts.iter().enumerate().filter(|&(i, _)| i != index).map(|(_, p)| &p.bounds);
    let heights = |b: &Aabb| b.corners().map(|c| normal.dot(c - origin) - height);
    let all_above = others().all(|b| heights(b).iter().all(|&h| h >= -tolerance));
    let all_below = others().all(|b| heights(b).iter().all(|&h| h <= tolerance));
    let side = match (normal == DVec3::ZERO, all_above, all_below) {
        (false, true, _) => 1.0,
        (false, false, true) => -1.0,
        _ => return None,
    };
    let normal = normal * side;
    Some(Ground { normal, offset: normal.dot(origin) + height * side })
}

impl Without for LeftOut {
    fn leaves_out(&self, part: &Part, triangle: usize) -> bool {
        self.objects[part.object] || self.cell.is_some_and(|cell| cell.has(part, triangle))
    }
}

impl Cell {
    /// Tells whether a triangle is a face of the voxel.
    fn has(&self, part: &Part, triangle: usize) -> bool {
        part.object == self.object
            && part.mesh().corners(triangle).iter().all(|p| {
                let p = p.as_dvec3();
                p.cmpge(self.bounds.min).all() && p.cmple(self.bounds.max).all()
            })
    }
}

impl Part {
    /// Tells whether any slot blocks light.
    fn blocks_light(&self) -> bool {
        self.slots().any(|classes| classes[Role::Light as usize] != Class::Nothing)
    }
}
