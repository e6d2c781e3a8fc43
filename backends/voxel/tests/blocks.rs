//! Do blocks of cells that are no larger than a pixel look like their cells, without gaps between the levels?

use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::metrics::color_rmse;
use polyptych_core::parallel::{OneThread, Pool, Threads};
use polyptych_core::scene::{Light, Material, Object, Scene, Shape, Voxels};
use polyptych_core::seam::{Control, Decision, Need, Renderer};
use polyptych_voxel::Voxel;
use std::sync::Arc;

fn draw_on(
    threads: &dyn Threads,
    scene: &Scene,
    camera: &Camera,
    settings: &[(&str, &str)],
) -> (Framebuffer, Decision) {
    let mut voxel = Voxel::new();
    let mut need = Need { channels: Channels::ALL, ..Need::new(camera.clone(), 160, 90) };
    for (name, value) in settings {
        need.settings.set("voxel", &voxel.info().parameters.clone(), name, value).unwrap();
    }
    let control = Control::new(threads);
    let prepared = voxel.prepare(&Arc::new(scene.clone()), &need, &Converter::default(), &control).unwrap();
    let mut picture = Framebuffer::new(need.width, need.height, need.channels);
    voxel.render(&need.frame(), &mut picture, &control).unwrap();
    (picture, prepared.objects[0].clone())
}

fn draw(scene: &Scene, camera: &Camera, settings: &[(&str, &str)]) -> Framebuffer {
    draw_on(&OneThread, scene, camera, settings).0
}

const BLOCKS: (&str, &str) = ("detail.blocks", "true");

fn hash(x: u32, y: u32, z: u32) -> u32 {
    let mixed = (x.wrapping_mul(73_856_093) ^ y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791))
        .wrapping_mul(0x9e37_79b9);
    mixed ^ mixed >> 15
}

/// Gentle hills of three colors, as confetti, 900 cells deep and wide.
fn hills() -> Scene {
    let height = |x: u32, z: u32| {
        20.0 + 12.0 * (f64::from(x) * 0.021).sin() + 9.0 * (f64::from(z) * 0.017 + 1.0).cos()
    };
    let grid = Voxels::from_fn([900, 48, 900], |x, y, z| {
        if f64::from(y) < height(x, z) { 1 + (hash(x, y, z) % 3) as u8 } else { 0 }
    });
    let mut scene = Scene::default();
    let colors = [Vec3::new(0.9, 0.9, 0.1), Vec3::new(0.0, 0.1, 0.6), Vec3::new(0.1, 0.5, 0.1)];
    let materials = colors.map(|color| scene.add_material(Material::new(color))).to_vec();
    scene.objects.push(Object { materials, ..Object::new("hills", Shape::Voxels(grid), 0) });
    scene.lights.push(Light::directional(DVec3::new(-0.4, -1.0, -0.3)));
    scene
}

/// Over the hills: near cells are larger than pixels, the farthest are a sixteenth of one.
fn over() -> Camera {
    let lens = Projection::Perspective { fov_y: 0.9 };
    Camera::look_at(DVec3::new(450.0, 150.0, 940.0), DVec3::new(450.0, 0.0, 300.0), DVec3::Y, lens)
}

#[test]
fn blocks_are_nearer_to_the_mean_of_many_samples_and_leave_no_hole() {
    let (scene, camera) = (hills(), over());
    let plain = draw(&scene, &camera, &[]);
    let blocks = draw(&scene, &camera, &[BLOCKS]);
    let mean = draw(&scene, &camera, &[("samples", "36")]);
    // From 373 meters on blocks of 4 cells are no larger than a pixel.
    let far = |picture: &Framebuffer| {
        let pixels =
            (0..mean.id().len()).filter(|&i| mean.distance()[i] > 400.0 && mean.distance()[i] < 800.0);
        let squares: Vec<f32> =
            pixels.map(|i| (picture.color()[i] - mean.color()[i]).length_squared()).collect();
        (squares.iter().sum::<f32>() / squares.len() as f32).sqrt()
    };
    let [before, after] = [far(&plain), far(&blocks)];
    assert!(after < 0.6 * before, "{after} for {before}");
    let mut farther = 0.0f32;
    for i in 0..plain.id().len() {
        // Blocks hold their cells: what was seen is seen, and no farther away.
        assert!(blocks.id()[i] >= plain.id()[i], "a hole at {i}");
        if plain.id()[i] != 0 {
            farther = farther.max(blocks.distance()[i] / plain.distance()[i]);
        }
    }
    assert!(farther < 1.000_01, "{farther}");
    let more = blocks.id().iter().zip(plain.id()).filter(|(a, b)| a > b).count();
    assert!(more < 200, "{more} pixels more are covered");
}

#[test]
fn near_cells_are_drawn_as_they_are() {
    let scene = hills();
    let lens = Projection::Perspective { fov_y: 0.9 };
    let camera =
        Camera::look_at(DVec3::new(450.0, 60.0, 450.0), DVec3::new(452.0, 0.0, 440.0), DVec3::Y, lens);
    assert!(draw(&scene, &camera, &[]).same_bits(&draw(&scene, &camera, &[BLOCKS])));
}

#[test]
fn threads_and_numbers_change_no_block() {
    let (scene, camera) = (hills(), over());
    let (one, decision) = draw_on(&OneThread, &scene, &camera, &[BLOCKS]);
    let Decision::Approximated { why } = decision else { panic!("{decision:?}") };
    assert!(why.contains("blocks of 4 and 16 cells"), "{why}");
    let three = draw_on(&Pool::new(3).unwrap(), &scene, &camera, &[BLOCKS]).0;
    assert!(one.same_bits(&three));
    let double = draw(&scene, &camera, &[BLOCKS, ("walk", "f64")]);
    let other = (0..one.id().len()).filter(|&i| one.distance()[i] != double.distance()[i]).count();
    // A ray through the very edge of a block may begin in either.
    assert!(other < 8, "{other} pixels differ");
}

#[test]
fn blocks_in_parallel_views_and_of_glass() {
    let mut scene = hills();
    let lens = Projection::Orthographic { height: 900.0 };
    let camera =
        Camera::look_at(DVec3::new(450.0, 800.0, 900.0), DVec3::new(450.0, 0.0, 450.0), DVec3::Y, lens);
    let [plain, blocks, mean] =
        [&[][..], &[BLOCKS], &[("samples", "36")]].map(|settings| draw(&scene, &camera, settings));
    let [before, after] = [&plain, &blocks].map(|picture| color_rmse(picture, &mean).unwrap());
    assert!(after < 0.6 * before, "{after} for {before}");
    // Where light goes through, cells stay what they are.
    scene.materials[1].opacity = 0.5;
    let (glass, decision) = draw_on(&OneThread, &scene, &over(), &[BLOCKS]);
    assert_eq!(decision, Decision::Exact);
    assert!(glass.same_bits(&draw(&scene, &over(), &[])));
}
