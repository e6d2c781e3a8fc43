//! How much light leaves a point towards the eye, and how many lights reach it?

use crate::batch::Batch;
use crate::gouraud::Gouraud;
use crate::info::Tier;
use crate::lookup::Sights;
use crate::model::Model;
use crate::shadow::Shadows;
use glam::{DAffine3, DVec3, Vec3};
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, Mask8, Vec3x8};
use polyptych_core::math::Aabb;
use polyptych_core::scene::{Arriving, Light, LightKind, LightingModel, Material, Scene, Shape};
use polyptych_core::shade::{Surfaces, lit_by_material};

/// A light, made ready.
pub(crate) struct Lamp {
    pub(crate) light: Light,
    /// Its light where that is the same everywhere.
    steady: Option<Arriving>,
    /// The voxel that gives it off.
    pub(crate) cell: Option<Cell>,
    /// Whether anything can stand between it and a surface, so that its shadows must be found.
    pub(crate) is_blocked: bool,
    /// How they are found.
    pub(crate) tier: Tier,
}

/// The place of an emissive voxel: its own faces do not block its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
    pub(crate) object: usize,
    pub(crate) bounds: Aabb,
    pub(crate) object_from_world: DAffine3,
}

/// What is asked of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wants {
    pub(crate) color: bool,
    pub(crate) shadow: bool,
}

impl Lamp {
    /// Lists all lights of a scene; those of voxels stand behind its own, by object and cell.
    pub(crate) fn all(scene: &Scene) -> Vec<Self> {
        let lights = scene.all_lights();
        let own = scene.lights.len();
        let mut cells = if lights.len() > own { cells(scene) } else { Vec::new() }.into_iter();
        let lamp = |(i, light): (usize, Light)| Self {
            steady: match light.kind {
                LightKind::Directional { .. } => light.arriving(DVec3::ZERO),
                LightKind::Point { .. } | LightKind::Spot { .. } => None,
            },
            cell: if i < own { None } else { cells.next() },
            is_blocked: light.casts_shadow,
            tier: Tier::Id,
            light,
        };
        lights.into_iter().enumerate().map(lamp).collect()
    }
}

impl Lamp {
    /// Lists the lights themselves.
    pub(crate) fn lights(lamps: &[Self]) -> Vec<Light> {
        lamps.iter().map(|lamp| lamp.light.clone()).collect()
    }
}

fn cells(scene: &Scene) -> Vec<Cell> {
    let mut cells = Vec::new();
    for (object, thing) in scene.objects.iter().enumerate().filter(|(_, o)| o.is_drawable()) {
        let Shape::Voxels(voxels) = &*thing.shape else { continue };
        let shines = |v: u8| scene.material(thing, usize::from(v) - 1).emission.max_element() > 0.0;
        let object_from_world = thing.world_from_object.inverse();
        for (cell, _) in voxels.exposed_where(shines) {
            let min = DVec3::from_array(cell.map(f64::from));
            cells.push(Cell { object, bounds: Aabb::new(min, min + 1.0), object_from_world });
        }
    }
    cells
}

/// Lights points of a scene.
#[derive(Clone, Copy)]
pub(crate) struct Illumination<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) model: &'a Model,
    pub(crate) lamps: &'a [Lamp],
    pub(crate) shadows: Option<&'a Shadows>,
    pub(crate) lighting: LightingModel,
}

impl Illumination<'_> {
    /// Lights all samples of a batch; `corners` is the light at the corners of its faces if that is to be interpolated.
    #[inline(always)]
    pub(crate) fn light(
        &self,
        batch: &mut Batch<'_>,
        corners: Option<&Gouraud>,
        origin: DVec3,
        wants: Wants,
    ) {
        self.fill_ambient(batch, wants);
        let used = Mask8::first(batch.count);
        let taking = self.taking_shadow(batch) & used;
        let (mut casting, mut reaching, one) = (F32x8::ZERO, F32x8::ZERO, F32x8::splat(1.0));
        for (index, lamp) in self.lamps.iter().enumerate() {
            let arrivals = Arrivals::of(lamp, batch, origin);
            let (casts, zero) = (lamp.light.casts_shadow, F64x8::splat(0.0));
            let comes = arrivals.distance.above(zero) & used;
            let faces_light = !turned_away_all(batch.true_normal, arrivals.to_light);
            // Asked for before the light is reckoned, read after it.
            let shadows = self.shadows.filter(|_| casts && (comes & faces_light & taking).any());
            let from = shadows.map_or(DVec3::ZERO, |shadows| origin - shadows.origin);
            let place = batch.place + DVec3x8::splat(from);
            let aims = if let Some(shadows) = shadows { shadows.aim(index, place) } else { None };
            let added = match corners {
                _ if !wants.color => Vec3x8::splat(Vec3::ZERO),
                None => self.added(batch, &arrivals),
                Some(corners) => self.interpolated(batch, corners, index),
            };
            let counts = if wants.shadow && casts { Mask8::ALL } else { is_not_black(added) };
            let mut arrives = comes & faces_light & counts;
            let crosses = if casts { arrives & taking } else { Mask8::NONE };
            let mut share = one;
            if let Some(shadows) = shadows.filter(|_| crosses.any()) {
                let sights = Sights {
                    place,
                    triangle: batch.names.id,
                    to_light: arrivals.to_light,
                    distance: arrivals.distance,
                };
                let of = (self.scene, self.model);
                share = crosses
                    .pick(shadows.shares((index, aims), of, &sights, &batch.true_normal, crosses), one);
                arrives = arrives & share.above(F32x8::ZERO);
            }
            batch.lit = Vec3x8::pick(arrives, batch.lit + added.scaled(share), batch.lit);
            if casts {
                casting = comes.pick(casting + one, casting);
                reaching = arrives.pick(reaching + share, reaching);
            }
        }
        let counts = taking & casting.above(F32x8::ZERO);
        batch.shadow = counts.pick(reaching / casting, one);
    }

    /// Tells on which samples light can be blocked on its way.
    #[inline(always)]
    fn taking_shadow(&self, batch: &Batch<'_>) -> Mask8 {
        let mut mask = Mask8::NONE;
        for i in 0..batch.count {
            let takes = self.model.parts[batch.names.part[i] as usize].takes_shadow;
            mask.0[i] = if takes { u32::MAX } else { 0 };
        }
        mask
    }

    #[inline(always)]
    fn fill_ambient(&self, batch: &mut Batch<'_>, wants: Wants) {
        let ambient = self.scene.environment.ambient;
        let light = |material: &Material, color: Vec3| material.emission + ambient * color * material.ambient;
        batch.lit = Vec3x8::splat(Vec3::ZERO);
        if batch.has_one_material && wants.color {
            let Some(material) = batch.material[0] else { return };
            let share = Vec3x8::splat(ambient) * batch.color * Vec3x8::splat(Vec3::splat(material.ambient));
            batch.lit = Vec3x8::splat(material.emission) + share;
            return;
        }
        for i in 0..batch.count {
            if let Some(material) = batch.material[i].filter(|_| wants.color) {
                batch.lit.set(i, light(material, batch.color.get(i)));
            }
        }
    }

    /// Returns what an unshadowed light adds to all samples, material by material.
    #[inline(always)]
    fn added(&self, batch: &Batch<'_>, arrivals: &Arrivals) -> Vec3x8 {
        let Batch { color, normal, to_eye, .. } = *batch;
        if let (true, Some(material)) = (batch.has_one_material, batch.material[0]) {
            let surfaces = Surfaces { material, color, normal, to_eye };
            return surfaces.lit_by(self.lighting, arrivals.direction, arrivals.radiance);
        }
        let materials = std::array::from_fn(|i| batch.material[i].filter(|_| i < batch.count));
        let seen = (color, normal, to_eye);
        lit_by_material(materials, seen, self.lighting, arrivals.direction, arrivals.radiance)
    }

    /// Returns what an unshadowed light adds to all samples, interpolated between corners.
    fn interpolated(&self, batch: &Batch<'_>, corners: &Gouraud, lamp: usize) -> Vec3x8 {
        let mut added = Vec3x8::splat(Vec3::ZERO);
        for i in 0..batch.count {
            let of = (usize::from(batch.face[i]), lamp);
            let weights = batch.weights.map(|w| w.0[i]);
            added.set(i, corners.added(of, self.lamps.len(), batch.color.get(i), weights));
        }
        added
    }
}

/// [`turned_away`] of eight points.
#[inline(always)]
fn turned_away_all(true_normal: DVec3x8, to_light: DVec3x8) -> Mask8 {
    F64x8::splat(0.0).at_least(true_normal.dot(to_light))
}

#[inline(always)]
fn is_not_black(color: Vec3x8) -> Mask8 {
    let zero = F32x8::ZERO;
    !(color.x.equal(zero) & color.y.equal(zero) & color.z.equal(zero))
}

/// The light of a lamp at all samples of a batch.
struct Arrivals {
    to_light: DVec3x8,
    /// The same in single precision.
    direction: Vec3x8,
    radiance: Vec3x8,
    /// 0 where no light arrives.
    distance: F64x8,
}

impl Arrivals {
    #[inline(always)]
    fn of(lamp: &Lamp, batch: &Batch<'_>, origin: DVec3) -> Self {
        let of = |arriving: &Arriving| Self {
            to_light: DVec3x8::splat(arriving.to_light),
            direction: Vec3x8::splat(arriving.to_light.as_vec3()),
            radiance: Vec3x8::splat(arriving.radiance),
            distance: F64x8::splat(arriving.distance),
        };
        let none = Arriving { to_light: DVec3::ZERO, distance: 0.0, radiance: Vec3::ZERO };
        if let LightKind::Directional { .. } = lamp.light.kind {
            return of(lamp.steady.as_ref().unwrap_or(&none));
        }
        let mut all = of(&none);
        for i in 0..batch.count {
            if let Some(arriving) = lamp.light.arriving(origin + batch.place.get(i)) {
                all.distance.0[i] = arriving.distance;
                all.to_light.set(i, arriving.to_light);
                all.direction.set(i, arriving.to_light.as_vec3());
                all.radiance.set(i, arriving.radiance);
            }
        }
        all
    }
}
