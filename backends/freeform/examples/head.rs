//! How does a head from tomography look within a free form that cuts it open?
//!
//! `cargo run --release -p polyptych-freeform --example head -- FOLDER [FILE]` draws shells of noise that it makes, or the
//! volume of a file in Hounsfield units: as a whole, within a form so that rays begin at its surface, and as the surface
//! of the bone alone.

mod common;

use common::{Easel, arguments};
use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::load::{LoadOptions, load};
use polyptych_core::scene::{
    Form, FreeForm, Light, Material, Object, Perturbation, Power, Samples, Scene, Shape, TransferFunction,
    TransferPreset, Volume,
};
use std::error::Error;

/// Skin, bone and what is within, as noisy shells.
fn shells() -> Result<Volume, String> {
    let size = [160u32, 160, 140];
    let value = |i: u32| {
        let cell = [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])].map(f64::from);
        let p = (DVec3::from_array(cell) - DVec3::new(79.5, 79.5, 69.5)) / DVec3::new(62.0, 76.0, 64.0);
        let ripple: f64 = (p * 9.0).to_array().map(f64::sin).iter().product();
        let r = p.length() + 0.04 * ripple;
        // Borders are as soft as tomography makes them.
        let within = |border: f64| ((border - r) * 40.0 + 0.5).clamp(0.0, 1.0);
        let skin = -1000.0 + (1030.0 + 20.0 * ripple) * within(0.97);
        let bone = skin + 900.0 * within(0.86) * (1.0 - within(0.78));
        (bone + 30.0 * ripple * within(0.78)) as i16
    };
    Volume::new(size, DVec3::ONE, Samples::I16((0..size.iter().product()).map(value).collect()))
}

fn main() -> Result<(), Box<dyn Error>> {
    let (folder, file) = arguments()?;
    let mut volume = match file {
        None => shells()?,
        Some(file) => {
            let shapes = load(&file, &LoadOptions::default())?.objects;
            let found = shapes.iter().find_map(|o| match &*o.shape {
                Shape::Volume(volume) => Some(volume.clone()),
                _ => None,
            });
            found.ok_or("no volume in that file")?
        }
    };
    let (half, spacing) = (volume.bounds().size() * 0.5, volume.spacing().min_element());
    let camera = Camera::look_at(
        DVec3::new(-0.75, 0.9, 0.35).normalize_or_zero() * half.length() * 2.2,
        DVec3::ZERO,
        DVec3::Z,
        Projection::Perspective { fov_y: 0.7 },
    );
    // An ellipsoid with a bite: a dent is a bump of negative weight.
    let bite = Form::Ellipsoid { center: half * DVec3::new(-0.7, 0.5, 0.8), radii: half * 0.95 };
    let shell = Form::Perturbed {
        base: Box::new(Form::Ellipsoid { center: DVec3::ZERO, radii: half * 1.25 }),
        terms: vec![Perturbation { weight: -12.0, power: Power::Square, function: bite }],
    };
    let shell = FreeForm::within(shell, volume.bounds())?;
    let mut draw = |name: &str, preset: TransferPreset, shell: Option<FreeForm>, settings| {
        volume.transfer = TransferFunction::preset(preset, spacing);
        volume.shell = shell;
        let mut scene = Scene::default();
        let tissue = scene.add_material(Material::new(Vec3::ONE));
        scene.objects.push(Object::new("head", Shape::Volume(volume.clone()), tissue));
        scene.lights.push(Light::directional(DVec3::new(0.3, -0.9, -0.6)));
        Easel::new(scene, folder.clone(), settings)?.draw(name, camera.clone(), [1280, 720])
    };
    draw("skin", TransferPreset::CtSkin, None, &[("volume.step", "1")])?;
    draw("tissue", TransferPreset::CtTissue, None, &[("volume.step", "1")])?;
    draw("shell", TransferPreset::CtTissue, Some(shell.clone()), &[("volume.step", "0.5")])?;
    draw(
        "shell_kept",
        TransferPreset::CtTissue,
        Some(shell),
        &[("volume.step", "0.5"), ("volume.gradients", "kept")],
    )?;
    draw("bone", TransferPreset::CtBone, None, &[("volume.step", "1")])?;
    draw("bone_surface", TransferPreset::CtBone, None, &[("volume.surface", "true")])
}
