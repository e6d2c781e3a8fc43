//! How does cost grow with what a scene holds, with pixels, and with threads?

use super::Spread;
use crate::builtin;
use crate::camera::{Camera, Projection};
use crate::framebuffer::{Channels, Framebuffer};
use crate::prelude::{
    DVec3, Form, FreeForm, Light, Material, Mesh, Need, Object, Primitive, Scene, Shape, Vec3, Voxels,
};
use crate::scene::{Perturbation, Power};
use crate::studio::{Studio, StudioError};
use serde::Serialize;
use std::sync::Arc;

/// What grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Triangles of a ball, the picture stays the same.
    Triangles,
    /// Cells of a grid that holds a ball.
    Voxels,
    /// Perturbations of a free form.
    Functions,
    /// Point lights around a still life.
    Lights,
    /// Pixels of a picture of the default scene.
    Pixels,
    /// Threads, on the default scene.
    Threads,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Triangles, Self::Voxels, Self::Functions, Self::Lights, Self::Pixels, Self::Threads];

    /// Returns the word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Voxels => "voxels",
            Self::Functions => "functions",
            Self::Lights => "lights",
            Self::Pixels => "pixels",
            Self::Threads => "threads",
        }
    }

    fn counts(self) -> Vec<u32> {
        match self {
            // Rings of a ball; it has 4 n^2 triangles.
            Self::Triangles => vec![16, 32, 64, 128],
            // Edge of the grid.
            Self::Voxels => vec![16, 32, 64, 128],
            Self::Functions => vec![1, 4, 16, 64],
            Self::Lights => vec![1, 4, 16],
            // Rows of the picture.
            Self::Pixels => vec![45, 90, 180, 288],
            Self::Threads => {
                let cores = std::thread::available_parallelism().map_or(1, |n| n.get() as u32);
                [1, 2, 4, 8, 16].into_iter().filter(|&n| n <= cores).collect()
            }
        }
    }
}

/// Cost of a back end against one quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// What grows.
    pub quantity: Quantity,
    /// Id of the back end.
    pub backend: String,
    /// How much of it.
    pub counts: Vec<f64>,
    /// Time of a frame at each.
    pub ms: Vec<Spread>,
    /// Time to prepare at each, milliseconds.
    pub prepare_ms: Vec<f64>,
    /// Bytes held at each.
    pub bytes: Vec<u64>,
    /// Exponent of the time over the upper half of the counts; -1 would be perfect for threads.
    pub time_exponent: f64,
    /// Exponent of the bytes there; nothing where nothing is held.
    pub bytes_exponent: Option<f64>,
}

/// One line of growth, to be measured.
pub(super) struct Run {
    quantity: Quantity,
    backend: String,
}

/// Lists what is measured: what a back end does not draw natively it converts first, and then what grows is that.
pub(super) fn runs(backends: &[String]) -> Vec<Run> {
    let photometric = |b: &&String| b.as_str() != "stylized";
    Quantity::ALL
        .into_iter()
        .flat_map(|quantity| {
            backends.iter().filter(photometric).map(move |b| Run { quantity, backend: b.clone() })
        })
        .collect()
}

impl Run {
    pub(super) fn name(&self) -> String {
        format!("{}, {}", self.quantity.name(), self.backend)
    }

    pub(super) fn measure(&self, studio: &mut Studio) -> Result<Growth, StudioError> {
        let mut growth = Growth {
            quantity: self.quantity,
            backend: self.backend.clone(),
            counts: Vec::new(),
            ms: Vec::new(),
            prepare_ms: Vec::new(),
            bytes: Vec::new(),
            time_exponent: 0.0,
            bytes_exponent: None,
        };
        for count in self.quantity.counts() {
            let scene = Arc::new(scene_of(self.quantity, count));
            let rows = if self.quantity == Quantity::Pixels { count } else { 144 };
            let need = Need {
                channels: Channels::COLOR,
                ..Need::new(scene.cameras[0].1.clone(), rows * 16 / 9, rows)
            };
            let mut own;
            let studio = if self.quantity == Quantity::Threads {
                own = Studio::pinned(studio.registry().clone(), count as usize)?;
                &mut own
            } else {
                &mut *studio
            };
            let (prepared, prepare_ms) = studio.prepare(&self.backend, &scene, &need)?;
            let mut target = Framebuffer::new(need.width, need.height, need.channels);
            let mut times = Vec::new();
            let warm = studio.render(&self.backend, &need.frame(), &mut target)?.1;
            let wanted = if warm > 200.0 { 1 } else { 3 };
            while times.len() < wanted || (times.iter().sum::<f64>() < 40.0 && times.len() < 9) {
                times.push(studio.render(&self.backend, &need.frame(), &mut target)?.1);
            }
            growth.counts.push(self.count(count));
            growth.ms.push(Spread::of(&mut times));
            growth.prepare_ms.push(prepare_ms);
            growth.bytes.push(prepared.bytes);
            if prepare_ms + growth.ms.last().map_or(0.0, |m| m.median) * 4.0 > 2000.0 {
                break;
            }
        }
        let times: Vec<f64> = growth.ms.iter().map(|m| m.median).collect();
        growth.time_exponent = exponent(&growth.counts, &times).unwrap_or(0.0);
        let bytes: Vec<f64> = growth.bytes.iter().map(|&b| b as f64).collect();
        growth.bytes_exponent = exponent(&growth.counts, &bytes);
        Ok(growth)
    }

    /// Returns how much of the quantity a scene of that size has.
    fn count(&self, count: u32) -> f64 {
        let n = f64::from(count);
        match self.quantity {
            Quantity::Triangles => 4.0 * n * n,
            Quantity::Voxels => n * n * n,
            Quantity::Pixels => n * f64::from(count * 16 / 9),
            _ => n,
        }
    }
}

/// Fits `log cost = a + exponent * log count` by least squares over the upper half of the counts, where what does not
/// grow weighs least. Nothing when a cost is zero or there are less than two counts.
fn exponent(counts: &[f64], costs: &[f64]) -> Option<f64> {
    let from = (counts.len() / 2).min(counts.len().saturating_sub(2));
    let (counts, costs) = (&counts[from..], &costs[from..]);
    if counts.len() < 2 || costs.iter().any(|&c| c <= 0.0) {
        return None;
    }
    let n = counts.len() as f64;
    let mean = |v: &[f64]| v.iter().map(|c| c.ln()).sum::<f64>() / n;
    let (x, y) = (mean(counts), mean(costs));
    let both: f64 = counts.iter().zip(costs).map(|(a, b)| (a.ln() - x) * (b.ln() - y)).sum();
    let own: f64 = counts.iter().map(|a| (a.ln() - x).powi(2)).sum();
    (own > 0.0).then(|| both / own)
}

fn scene_of(quantity: Quantity, count: u32) -> Scene {
    let mut scene = match quantity {
        Quantity::Pixels | Quantity::Threads => {
            return builtin::scene("atelier").unwrap_or_default();
        }
        Quantity::Lights => {
            let mut scene = builtin::scene("polyhedra").unwrap_or_default();
            scene.lights = (0..count)
                .map(|i| {
                    let angle = f64::from(i) * 2.399_963; // the golden angle spreads any number evenly
                    let place =
                        DVec3::new(angle.cos() * 2.0, 1.5 + f64::from(i % 3) * 0.5, angle.sin() * 2.0);
                    Light::point(place, 4.0 / count as f32)
                })
                .collect();
            return scene;
        }
        _ => Scene::default(),
    };
    let stone = scene.add_material(Material::new(Vec3::new(0.7, 0.65, 0.55)));
    let shape = match quantity {
        Quantity::Triangles => Shape::Mesh(ball(count)),
        Quantity::Voxels => Shape::Voxels(voxel_ball(count)),
        _ => free_form(count),
    };
    let scale = if quantity == Quantity::Voxels { 2.0 / f64::from(count) } else { 1.0 };
    let corner = if quantity == Quantity::Voxels { DVec3::splat(-1.0) } else { DVec3::ZERO };
    let place =
        glam::DAffine3::from_scale_rotation_translation(DVec3::splat(scale), glam::DQuat::IDENTITY, corner);
    scene.objects.push(Object::new("thing", shape, stone).placed(place));
    scene.lights.push(Light::directional(DVec3::new(-0.6, -1.0, -0.5)));
    let view = Projection::Perspective { fov_y: 0.7 };
    scene.cameras.push(("front".to_owned(), Camera::framing(&scene.bounds(), 0.4, 0.3, 16.0 / 9.0, view)));
    scene
}

/// Builds a ball of radius 1 from 4 n^2 triangles.
pub(crate) fn ball(rings: u32) -> Mesh {
    let around = rings * 2;
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for step in 0..around {
            let turn = std::f64::consts::TAU * f64::from(step) / f64::from(around);
            let p = DVec3::new(polar.sin() * turn.cos(), polar.cos(), polar.sin() * turn.sin());
            mesh.positions.push(p.as_vec3());
            mesh.normals.push(p.as_vec3());
        }
    }
    for ring in 0..rings {
        for step in 0..around {
            let (a, b) = (ring * around + step, ring * around + (step + 1) % around);
            mesh.triangles.push([a, b, a + around]);
            mesh.triangles.push([b, b + around, a + around]);
        }
    }
    mesh
}

fn voxel_ball(edge: u32) -> Voxels {
    let middle = f64::from(edge) * 0.5;
    Voxels::from_fn([edge; 3], |x, y, z| {
        let p = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) + 0.5 - middle;
        u8::from(p.length() < middle)
    })
}

/// Builds a ball with so many bumps.
fn free_form(bumps: u32) -> Shape {
    let terms = (0..bumps).map(|i| {
        let height = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(bumps);
        let (angle, around) = (f64::from(i) * 2.399_963, (1.0 - height * height).sqrt());
        let center = DVec3::new(around * angle.cos(), height, around * angle.sin()) * 0.9;
        let function = Form::Ellipsoid { center, radii: DVec3::splat(0.3) };
        Perturbation { weight: 0.4, power: Power::Square, function }
    });
    let base = Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::ONE };
    let form = Form::Perturbed { base: Box::new(base), terms: terms.collect() };
    // The form is built of constants above and is bounded; a plain ball would still grow nothing.
    FreeForm::new(form).map_or(Shape::Primitive(Primitive::Sphere { radius: 1.0 }), Shape::FreeForm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exponent_is_the_slope_of_the_upper_half() {
        let counts = [1.0, 2.0, 4.0, 8.0, 16.0];
        let cost: Vec<f64> = counts.iter().map(|c: &f64| 0.01 + 3.0 * c.powf(1.5)).collect();
        assert!((exponent(&counts, &cost).unwrap() - 1.5).abs() < 1e-3);
        assert_eq!(exponent(&counts, &[0.0; 5]), None);
        assert_eq!(exponent(&[1.0], &[1.0]), None);
    }

    #[test]
    fn scenes_hold_what_they_are_named_after() {
        assert_eq!(ball(16).triangles.len(), 4 * 16 * 16);
        let scene = scene_of(Quantity::Functions, 16);
        assert!(matches!(&*scene.objects[0].shape, Shape::FreeForm(f) if f.form().node_count() >= 17));
        assert_eq!(scene_of(Quantity::Lights, 8).lights.len(), 8);
        for quantity in [Quantity::Triangles, Quantity::Voxels, Quantity::Functions] {
            assert!((scene_of(quantity, 32).bounds().radius() - 3f64.sqrt()).abs() < 0.3, "{quantity:?}");
        }
    }
}
