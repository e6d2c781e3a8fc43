//! How do the volumes along a ray add up, and where does their opacity reach one half?

use crate::line::{Line, Start};
use crate::shapes::Geometry;
use crate::trace::{Layers, OPAQUE};
use crate::world::World;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use polyptych_core::math::Ray;
use polyptych_core::scene::{Scene, Shape, Volume};
use polyptych_core::shade::{Surface, facing, fogged};
use std::sync::Arc;

/// Stretches of volumes that one ray can pass; what lies behind more of them is not drawn.
const STRETCHES: usize = 96;
/// Gradients below this share of the field's range a spacing have no direction worth shading by.
const FLAT: f64 = 1e-3;

/// An object that is a volume.
#[derive(Debug)]
pub(crate) struct Cloud {
    /// Index in the scene.
    pub(crate) object: usize,
    geometry: Arc<Geometry>,
    object_from_world: DAffine3,
    world_from_normal: DMat3,
    /// Smallest spacing in world units.
    spacing: f64,
}

/// The part of a ray in one volume.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    from: f64,
    to: f64,
    cloud: usize,
}

/// All parts of a ray in volumes, by the place where they begin.
#[derive(Debug)]
pub(crate) struct Stretches {
    list: [Stretch; STRETCHES],
    count: usize,
}

impl Cloud {
    pub(crate) fn new(scene: &Scene, object: usize, geometry: Arc<Geometry>) -> Self {
        let matrix = scene.objects[object].world_from_object;
        let object_from_world = matrix.inverse();
        let spacing = match &*geometry.shape {
            Shape::Volume(volume) => volume.spacing(),
            _ => DVec3::ONE,
        };
        let scale = DVec3::new(
            matrix.matrix3.x_axis.length(),
            matrix.matrix3.y_axis.length(),
            matrix.matrix3.z_axis.length(),
        );
        Self {
            object,
            geometry,
            object_from_world,
            world_from_normal: object_from_world.matrix3.transpose(),
            spacing: (spacing * scale).min_element(),
        }
    }

    fn volume(&self) -> Option<&Volume> {
        match &*self.geometry.shape {
            Shape::Volume(volume) => Some(volume),
            _ => None,
        }
    }

    /// Calls `add` for every stretch of the ray in the box and in the shell.
    fn stretches(&self, ray: &Ray, add: &mut impl FnMut(f64, f64)) {
        let Some(volume) = self.volume() else { return };
        let line = Line {
            origin: self.object_from_world.transform_point3(ray.origin),
            direction: self.object_from_world.transform_vector3(ray.direction),
            start: Start::Eye,
        };
        let Some((near, far)) = volume.bounds().clip(line.origin, line.direction) else { return };
        let Some(shell) = self.geometry.volume().and_then(|(shell, _)| shell) else {
            add(near, far);
            return;
        };
        let mut from = near;
        let mut piece = |from: f64, to: f64| {
            if to > from && shell.contains(line.at(from * 0.5 + to * 0.5)) {
                add(from, to);
            }
        };
        shell.crossings(&line, far, &mut |t, _| {
            if t >= far {
                return false;
            }
            if t > from {
                piece(from, t);
                from = t;
            }
            true
        });
        piece(from, far);
    }
}

impl Stretches {
    /// Finds all stretches of a ray, none in a scene without volumes.
    pub(crate) fn of(world: &World, ray: &Ray) -> Self {
        let nothing = Stretch { from: 0.0, to: 0.0, cloud: 0 };
        let mut found = Self { list: [nothing; STRETCHES], count: 0 };
        for (cloud, c) in world.clouds.iter().enumerate() {
            c.stretches(ray, &mut |from, to| {
                if found.count < STRETCHES && from < to {
                    found.list[found.count] = Stretch { from, to, cloud };
                    found.count += 1;
                }
            });
        }
        found.list[..found.count]
            .sort_unstable_by(|a, b| a.from.total_cmp(&b.from).then(a.cloud.cmp(&b.cloud)));
        found
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Calls `piece` for parts of the ray between two distances that lie in the same volumes throughout.
    fn for_each_piece(&self, from: f64, to: f64, mut piece: impl FnMut(f64, f64, &[usize]) -> bool) {
        let list = &self.list[..self.count];
        let mut inside = [0usize; STRETCHES];
        let mut at = from;
        while at < to {
            let mut next = to;
            let mut count = 0;
            for s in list {
                if s.from > at {
                    next = next.min(s.from);
                } else if s.to > at {
                    next = next.min(s.to);
                    inside[count] = s.cloud;
                    count += 1;
                }
            }
            inside[..count].sort_unstable();
            if count > 0 && !piece(at, next, &inside[..count]) {
                return;
            }
            if next == to {
                return;
            }
            at = next;
        }
    }
}

/// The place in a volume where opacity reaches one half.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Haze {
    pub(crate) distance: f64,
    pub(crate) object: usize,
    pub(crate) normal: DVec3,
    pub(crate) color: Vec3,
}

/// One sample: color and opacity, and the gradient in world space where it has a direction.
struct Sample {
    color: Vec3,
    opacity: f64,
    gradient: Option<DVec3>,
}

/// Reads volumes along a ray.
pub(crate) struct March<'a> {
    pub(crate) world: &'a World,
    pub(crate) ray: &'a Ray,
    /// Steps in units of the smallest spacing.
    pub(crate) step: f64,
    /// Whether light is asked for or only opacity.
    pub(crate) shaded: bool,
}

impl March<'_> {
    /// Lays what lies between two distances under the layers; ends early once nothing behind can be seen, and
    /// where no light is asked for, once half of the view is blocked. Returns where half was reached.
    pub(crate) fn run(&self, stretches: &Stretches, from: f64, to: f64, layers: &mut Layers) -> Option<Haze> {
        let mut half = None;
        if stretches.is_empty() {
            return None;
        }
        stretches.for_each_piece(from, to, |a, b, inside| {
            let step = inside.iter().fold(f64::INFINITY, |s, &c| s.min(self.world.clouds[c].spacing));
            let count = ((b - a) / (step * self.step)).ceil().clamp(1.0, 1e7);
            let length = (b - a) / count;
            for i in 0..count as u64 {
                let begin = a + length * i as f64;
                for &cloud in inside {
                    let cloud = &self.world.clouds[cloud];
                    let Some(sample) = self.sample(cloud, begin + length * 0.5, length) else { continue };
                    let clear = layers.clear;
                    self.lay(cloud, begin + length * 0.5, &sample, layers);
                    if clear > 0.5 && layers.clear <= 0.5 {
                        // Within the step the view fades exponentially.
                        let share = ((0.5 / clear).ln() / (layers.clear / clear).ln()).clamp(0.0, 1.0);
                        let normal = self.normal(&sample).unwrap_or(-self.ray.direction);
                        half = half.or(Some(Haze {
                            distance: begin + length * share,
                            object: cloud.object,
                            normal,
                            color: sample.color,
                        }));
                    }
                    if layers.clear < OPAQUE || (!self.shaded && half.is_some()) {
                        return false;
                    }
                }
            }
            true
        });
        half
    }

    fn sample(&self, cloud: &Cloud, t: f64, length: f64) -> Option<Sample> {
        let volume = cloud.volume()?;
        let (_, empty) = cloud.geometry.volume()?;
        let p = cloud.object_from_world.transform_point3(self.ray.at(t));
        if empty.at(volume.grid_from_object(p)) {
            return None;
        }
        let (color, opacity) = volume.transfer.at(volume.value(p) as f32);
        if !(opacity > 0.0) {
            return None;
        }
        // TransferFunction::corrected_opacity in double precision: thousands of thin samples add up.
        let thickness = length * cloud.object_from_world.transform_vector3(self.ray.direction).length();
        let opacity = if opacity >= 1.0 {
            1.0
        } else {
            -((-f64::from(opacity)).ln_1p() * thickness / volume.transfer.reference_length).exp_m1()
        };
        let [lo, hi] = volume.range().map(f64::from);
        let gradient = volume.gradient(p);
        let steep = gradient.length() > FLAT * (hi - lo) / volume.spacing().min_element();
        Some(Sample { color, opacity, gradient: steep.then(|| cloud.world_from_normal * gradient) })
    }

    fn normal(&self, sample: &Sample) -> Option<DVec3> {
        Some(facing(-sample.gradient?.try_normalize()?, self.ray.direction))
    }

    fn lay(&self, cloud: &Cloud, t: f64, sample: &Sample, layers: &mut Layers) {
        if self.shaded {
            let light = self.light(cloud, self.ray.at(t), sample);
            let seen = fogged(&self.world.scene.environment, light, t);
            layers.color += seen.as_dvec3() * (layers.clear * sample.opacity);
        }
        layers.clear *= 1.0 - sample.opacity;
    }

    fn light(&self, cloud: &Cloud, position: DVec3, sample: &Sample) -> Vec3 {
        let scene = &*self.world.scene;
        let normal = self.normal(sample);
        let surface = Surface {
            material: scene.material(&scene.objects[cloud.object], 0),
            color: sample.color,
            normal: normal.unwrap_or(-self.ray.direction).as_vec3(),
            to_eye: -self.ray.direction.as_vec3(),
        };
        let mut sum = surface.ambient(&scene.environment);
        for lamp in &self.world.lamps {
            if let Some(arriving) = lamp.light.arriving(position) {
                sum += match normal {
                    Some(_) => surface.lit_by(
                        scene.environment.lighting,
                        arriving.to_light.as_vec3(),
                        arriving.radiance,
                    ),
                    None => sample.color * surface.material.diffuse * arriving.radiance * 0.5,
                };
            }
        }
        sum
    }
}
