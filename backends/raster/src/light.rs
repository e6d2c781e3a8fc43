//! How much light leaves a point towards the eye, and how many lights reach it?

use crate::batch::{BATCH, Batch, OCTETS, at};
use crate::face::Face;
use crate::gouraud::Gouraud;
use crate::model::Model;
use crate::shadow::{Looks, Shadows, Sight};
use glam::{DAffine3, DVec3, Vec3};
use polyptych_core::lanes::{DVec3x8, F32x8, LANES, Vec3x8};
use polyptych_core::math::Aabb;
use polyptych_core::scene::{Arriving, Light, LightKind, LightingModel, Scene, Shape};
use polyptych_core::shade::{lit_by_material, turned_away};

/// A light, made ready.
pub(crate) struct Lamp {
    pub(crate) light: Light,
    /// Its light where that is the same everywhere.
    steady: Option<Arriving>,
    /// The voxel that gives it off.
    pub(crate) cell: Option<Cell>,
    /// Whether anything can stand between it and a surface, so that its shadows must be found.
    pub(crate) is_blocked: bool,
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
    /// Lights all samples of a batch; `faces` are those that it names, and `corners` the light at their corners if
    /// that is to be interpolated.
    #[inline(always)]
    pub(crate) fn light(
        &self,
        batch: &mut Batch<'_>,
        faces: &[Face],
        corners: Option<&Gouraud>,
        origin: DVec3,
        wants: Wants,
    ) {
        self.fill_ambient(batch, wants);
        let (mut casting, mut reaching) = ([0u32; BATCH], [0u32; BATCH]);
        for (index, lamp) in self.lamps.iter().enumerate() {
            let arrivals = Arrivals::of(lamp, batch, origin);
            let added = match corners {
                _ if !wants.color => [BLACK; OCTETS],
                None => self.added(batch, &arrivals),
                Some(corners) => self.interpolated(batch, corners, index),
            };
            let casts = lamp.light.casts_shadow;
            let (mut arrives, mut crosses) = ([false; BATCH], [false; BATCH]);
            for i in (0..batch.count).filter(|&i| arrivals.distance[i] > 0.0) {
                casting[i] += u32::from(casts);
                let away = turned_away(at!(batch.true_normal, i), at!(arrivals.to_light, i));
                let adds = at!(added, i) != Vec3::ZERO;
                arrives[i] = !away && ((wants.shadow && casts) || adds);
                crosses[i] = arrives[i] && casts && self.takes_shadow(&faces[usize::from(batch.face[i])]);
            }
            let looks = match self.shadows.filter(|_| crosses.contains(&true)) {
                Some(shadows) => shadows.look(index, &batch.place, origin, &crosses),
                None => Looks::none(),
            };
            for i in (0..batch.count).filter(|&i| arrives[i]) {
                let triangle = faces[usize::from(batch.face[i])].id;
                if looks.see_more_than(i, triangle)
                    && self.is_blocked(&looks, i, (at!(batch.place, i), origin), triangle, &arrivals)
                {
                    continue;
                }
                batch.lit[i / LANES].set(i % LANES, at!(batch.lit, i) + at!(added, i));
                reaching[i] += u32::from(casts);
            }
        }
        for i in 0..batch.count {
            let takes = casting[i] > 0 && self.takes_shadow(&faces[usize::from(batch.face[i])]);
            batch.shadow[i] = if takes { reaching[i] as f32 / casting[i] as f32 } else { 1.0 };
        }
    }

    #[inline(always)]
    fn fill_ambient(&self, batch: &mut Batch<'_>, wants: Wants) {
        let ambient = self.scene.environment.ambient;
        for i in 0..batch.count {
            let light = batch.material[i].filter(|_| wants.color).map_or(Vec3::ZERO, |material| {
                material.emission + ambient * at!(batch.color, i) * material.ambient
            });
            batch.lit[i / LANES].set(i % LANES, light);
        }
    }

    /// Returns what an unshadowed light adds to all samples, material by material.
    #[inline(always)]
    fn added(&self, batch: &Batch<'_>, arrivals: &Arrivals) -> [Vec3x8; OCTETS] {
        let mut added = [BLACK; OCTETS];
        for (o, added) in added.iter_mut().enumerate() {
            let materials = std::array::from_fn(|lane| {
                batch.material[o * LANES + lane].filter(|_| o * LANES + lane < batch.count)
            });
            *added = lit_by_material(
                materials,
                (batch.color[o], batch.normal[o], batch.to_eye[o]),
                self.lighting,
                arrivals.direction[o],
                arrivals.radiance[o],
            );
        }
        added
    }

    /// Returns what an unshadowed light adds to all samples, interpolated between corners.
    fn interpolated(&self, batch: &Batch<'_>, corners: &Gouraud, lamp: usize) -> [Vec3x8; OCTETS] {
        let mut added = [BLACK; OCTETS];
        for i in 0..batch.count {
            let of = (usize::from(batch.face[i]), lamp);
            let light = corners.added(of, self.lamps.len(), at!(batch.color, i), batch.weights[i]);
            added[i / LANES].set(i % LANES, light);
        }
        added
    }

    fn takes_shadow(&self, face: &Face) -> bool {
        self.model.parts[face.part as usize].takes_shadow
    }

    #[inline(always)]
    fn is_blocked(
        &self,
        looks: &Looks<'_>,
        i: usize,
        (place, origin): (DVec3, DVec3),
        triangle: u32,
        arrivals: &Arrivals,
    ) -> bool {
        let Some(shadows) = self.shadows else { return false };
        let (place, distance) = (place + (origin - shadows.origin), arrivals.distance[i]);
        let sight = Sight { place, triangle, to_light: at!(arrivals.to_light, i), distance };
        shadows.is_blocked(self.scene, self.model, looks, i, &sight)
    }
}

/// The light of a lamp at all samples of a batch.
struct Arrivals {
    to_light: [DVec3x8; OCTETS],
    /// The same in single precision.
    direction: [Vec3x8; OCTETS],
    radiance: [Vec3x8; OCTETS],
    /// 0 where no light arrives.
    distance: [f64; BATCH],
}

impl Arrivals {
    #[inline(always)]
    fn of(lamp: &Lamp, batch: &Batch<'_>, origin: DVec3) -> Self {
        if let LightKind::Directional { .. } = lamp.light.kind {
            let none = Arriving { to_light: DVec3::ZERO, distance: 0.0, radiance: Vec3::ZERO };
            let arriving = lamp.steady.unwrap_or(none);
            return Self {
                to_light: [DVec3x8::splat(arriving.to_light); OCTETS],
                direction: [Vec3x8::splat(arriving.to_light.as_vec3()); OCTETS],
                radiance: [Vec3x8::splat(arriving.radiance); OCTETS],
                distance: [arriving.distance; BATCH],
            };
        }
        let mut all = Self {
            to_light: [DVec3x8::splat(DVec3::ZERO); OCTETS],
            direction: [BLACK; OCTETS],
            radiance: [BLACK; OCTETS],
            distance: [0.0; BATCH],
        };
        for i in 0..batch.count {
            if let Some(arriving) = lamp.light.arriving(origin + at!(batch.place, i)) {
                let (o, lane) = (i / LANES, i % LANES);
                all.distance[i] = arriving.distance;
                all.to_light[o].set(lane, arriving.to_light);
                all.direction[o].set(lane, arriving.to_light.as_vec3());
                all.radiance[o].set(lane, arriving.radiance);
            }
        }
        all
    }
}

const BLACK: Vec3x8 = Vec3x8 { x: F32x8([0.0; 8]), y: F32x8([0.0; 8]), z: F32x8([0.0; 8]) };
