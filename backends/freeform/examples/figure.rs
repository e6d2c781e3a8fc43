//! How much smaller is a figure of 45 functions than its mesh of the same error?
//!
//! `cargo run --release -p polyptych-freeform --example figure -- FOLDER` draws a bear of one ellipsoid and 44 bumps and
//! dents, and tells how many bytes describe it, and its meshes.

mod common;

use common::{Easel, arguments};
use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::{Converter, Detail};
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{
    Background, Form, FreeForm, Light, Material, Mesh, Object, Perturbation, Power, Primitive, Scene, Shape,
};
use polyptych_core::seam::Control;
use std::error::Error;

/// Middle, half axes and weight of bumps and dents; those aside of the middle come twice, mirrored.
const TERMS: [([f64; 3], [f64; 3], f64); 26] = [
    // Head, muzzle, nose, mouth, neck.
    ([0.0, 1.35, 0.10], [0.78, 0.70, 0.72], 40.0),
    ([0.0, 1.18, 0.62], [0.36, 0.30, 0.40], 30.0),
    ([0.0, 1.30, 0.93], [0.15, 0.11, 0.12], 60.0),
    ([0.0, 1.06, 0.98], [0.22, 0.06, 0.20], -25.0),
    ([0.0, 0.85, 0.05], [0.55, 0.35, 0.50], 6.0),
    // Belly, navel, tail.
    ([0.0, -0.25, 0.45], [0.65, 0.65, 0.50], 1.5),
    ([0.0, -0.20, 0.98], [0.09, 0.09, 0.20], -8.0),
    ([0.0, -0.55, -0.80], [0.25, 0.25, 0.25], 30.0),
    // Ears and what is within, eyes and their sockets, brows, cheeks.
    ([0.50, 1.88, 0.05], [0.30, 0.30, 0.17], 90.0),
    ([0.51, 1.89, 0.20], [0.17, 0.17, 0.12], -60.0),
    ([0.25, 1.50, 0.66], [0.13, 0.13, 0.16], -25.0),
    ([0.25, 1.49, 0.64], [0.10, 0.10, 0.12], 90.0),
    ([0.26, 1.64, 0.58], [0.16, 0.07, 0.12], 12.0),
    ([0.40, 1.20, 0.45], [0.28, 0.24, 0.28], 5.0),
    // Shoulders, arms, paws and fingers.
    ([0.62, 0.55, 0.10], [0.40, 0.35, 0.38], 12.0),
    ([0.92, 0.30, 0.28], [0.36, 0.36, 0.34], 25.0),
    ([1.08, 0.10, 0.60], [0.30, 0.28, 0.36], 45.0),
    ([1.05, 0.10, 0.92], [0.26, 0.24, 0.24], 90.0),
    ([0.93, 0.06, 1.12], [0.10, 0.10, 0.12], 200.0),
    ([1.13, 0.06, 1.12], [0.10, 0.10, 0.12], 200.0),
    // Thighs, shins, feet and toes.
    ([0.48, -0.75, 0.30], [0.46, 0.42, 0.50], 12.0),
    ([0.62, -0.92, 0.78], [0.36, 0.34, 0.44], 40.0),
    ([0.66, -0.80, 1.20], [0.32, 0.42, 0.26], 70.0),
    ([0.50, -0.52, 1.36], [0.11, 0.11, 0.12], 200.0),
    ([0.68, -0.46, 1.36], [0.11, 0.11, 0.12], 200.0),
    ([0.86, -0.54, 1.36], [0.11, 0.11, 0.12], 200.0),
];

fn bear() -> Form {
    let mut terms = Vec::new();
    for ([x, y, z], radii, weight) in TERMS {
        let sides: &[f64] = if x == 0.0 { &[1.0] } else { &[1.0, -1.0] };
        terms.extend(sides.iter().map(|side| Perturbation {
            weight,
            power: Power::Cube,
            function: Form::Ellipsoid { center: DVec3::new(side * x, y, z), radii: DVec3::from_array(radii) },
        }));
    }
    let base = Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::new(0.80, 1.0, 0.75) };
    Form::Perturbed { base: Box::new(base), terms }
}

/// Returns how far the middles of triangles are from the surface of a form, at most.
fn farthest(mesh: &Mesh, form: &Form) -> f64 {
    let off = |corners: [u32; 3]| {
        let [a, b, c] = corners.map(|i| mesh.positions[i as usize].as_dvec3());
        let (value, gradient) = form.value_and_gradient((a + b + c) / 3.0);
        value.abs() / gradient.length()
    };
    // A fold, where the gradient vanishes, tells nothing of distances: one triangle in a thousand may be off by more.
    let mut all: Vec<f64> = mesh.triangles.iter().map(|&t| off(t)).filter(|off| off.is_finite()).collect();
    all.sort_unstable_by(f64::total_cmp);
    all.get(all.len().saturating_sub(1) * 999 / 1000).copied().unwrap_or_default()
}

fn main() -> Result<(), Box<dyn Error>> {
    let (folder, _) = arguments()?;
    let mut scene = Scene::default();
    scene.environment.background = Background::Gradient {
        below: Vec3::splat(0.5),
        horizon: Vec3::new(0.8, 0.85, 0.9),
        above: Vec3::new(0.55, 0.7, 0.9),
    };
    let fur = scene.add_material(Material::new(Vec3::new(0.42, 0.22, 0.10)));
    let floor = scene.add_material(Material::new(Vec3::new(0.5, 0.55, 0.45)));
    scene.objects.push(Object::new("bear", Shape::FreeForm(FreeForm::new(bear())?), fur));
    let mut ground =
        Object::new("floor", Shape::Primitive(Primitive::Plane { width: 30.0, depth: 30.0 }), floor);
    ground.world_from_object.translation = DVec3::new(0.0, -1.25, 0.0);
    scene.objects.push(ground);
    scene.lights.push(Light::directional(DVec3::new(-0.5, -0.9, -0.6)));

    let Form::Perturbed { terms, .. } = bear() else { return Err("no perturbed form".into()) };
    let functions = terms.len() + 1;
    // Middle, half axes and weight of each, in single precision.
    let bytes = functions * 7 * 4;
    let object = &scene.objects[0];
    let size = object.bounds().size().max_element();
    println!("{functions} functions in {bytes} bytes; errors are shares of the figure's longest edge");
    let (converter, pool) = (Converter::default(), Pool::new(2)?);
    let mut last = (0.0, 0.0);
    for share in [3e-2, 1e-2, 3e-3] {
        let detail = Detail { tolerance: share * size, max_resolution: 2048 };
        let model = converter.mesh(&scene, object, detail, &Control::new(&pool))?;
        let (mesh, error) = (&model.mesh, farthest(&model.mesh, &bear()) / size);
        let bytes_of_mesh = mesh.positions.len() * 12 + mesh.triangles.len() * 12;
        println!(
            "a mesh of {} triangles is off by {error:.1e}: {bytes_of_mesh} bytes, {} times as many",
            mesh.triangles.len(),
            bytes_of_mesh / bytes
        );
        last = (error, bytes_of_mesh as f64);
    }
    // Errors of triangles shrink as their number grows. What the caster promises of its distances:
    let [error, promised] = [last.0, 2e-5];
    let ratio = last.1 * (error / promised) / bytes as f64;
    println!(
        "at the {promised:.0e} of the caster's distances a mesh takes about {ratio:.0} times as many bytes"
    );

    let camera = Camera::look_at(
        DVec3::new(3.1, 2.2, 5.6),
        DVec3::new(0.0, 0.35, 0.2),
        DVec3::Y,
        Projection::Perspective { fov_y: 0.62 },
    );
    Easel::new(scene, folder, &[("edge.rays", "4")])?.draw("figure", camera, [1024, 1024])
}
