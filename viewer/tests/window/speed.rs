//! Does the window go on whatever is drawn in it?

use crate::harness::{rest, window, window_of, window_sized};
use eframe::egui::Vec2;
use glam::Vec3;
use polyptych::BuiltinBackends;
use polyptych::scene::{Light, Material, Mesh, Object, Scene, Shape};
use polyptych::seam::Registry;
use polyptych_viewer::{Action, Viewer};
use std::time::{Duration, Instant};

/// A wavy sheet of a million triangles.
fn million() -> Scene {
    const EDGE: u32 = 708;
    let mut mesh = Mesh::default();
    for z in 0..EDGE {
        for x in 0..EDGE {
            let (x, z) = (x as f32 / 100.0, z as f32 / 100.0);
            mesh.positions.push(Vec3::new(x, (x * 3.0).sin() * (z * 2.0).cos() * 0.3, z));
        }
    }
    for z in 0..EDGE - 1 {
        for x in 0..EDGE - 1 {
            let i = z * EDGE + x;
            mesh.triangles.extend([[i, i + EDGE, i + 1], [i + 1, i + EDGE, i + EDGE + 1]]);
        }
    }
    let mut scene = Scene::default();
    let gray = scene.add_material(Material::new(Vec3::splat(0.6)));
    scene.objects.push(Object::new("sheet", Shape::Mesh(mesh), gray));
    scene.lights.push(Light::directional(glam::DVec3::new(-0.5, -1.0, -0.3)));
    scene
}

#[test]
fn a_million_triangles_are_drawn_and_the_window_goes_on() {
    let viewer = Viewer::new(Registry::builtin(), million()).unwrap();
    let mut harness = window_of(viewer);
    let (pixels, _) = harness.state().picture(0).unwrap();
    let sky = pixels[0];
    assert!(pixels.iter().filter(|p| **p != sky).count() * 5 > pixels.len(), "the sheet is seen");
    let ctx = harness.ctx.clone();
    harness.state_mut().perform(Action::Turntable, &ctx);
    for _ in 0..20 {
        harness.step();
    }
    harness.state_mut().perform(Action::Turntable, &ctx);
    rest(&mut harness);
}

#[test]
fn a_window_without_room_draws_again_when_it_has_some() {
    let mut harness = window_sized("polyhedra", Vec2::ZERO);
    harness.run_steps(3);
    harness.set_size(Vec2::new(1.0, 1.0));
    harness.run_steps(3);
    harness.set_size(Vec2::new(400.0, 300.0));
    rest(&mut harness);
    assert!(harness.state().picture(0).unwrap().1[0] > 100);
}

#[test]
fn a_picture_that_the_graphics_card_lost_is_handed_over_again() {
    let mut harness = window("polyhedra");
    let textures = harness.ctx.tex_manager();
    let lost: Vec<_> = {
        let manager = textures.read();
        manager.allocated().filter(|(_, meta)| meta.name == "picture").map(|(id, _)| *id).collect()
    };
    assert_eq!(lost.len(), 2);
    lost.iter().for_each(|id| textures.write().free(*id));
    harness.run_steps(2);
    let pictures = || textures.read().allocated().filter(|(_, meta)| meta.name == "picture").count();
    assert_eq!(pictures(), 2, "there again");
}

#[test]
fn slow_pictures_stop_when_the_camera_moves() {
    let mut harness = window("atelier");
    let ctx = harness.ctx.clone();
    harness.state_mut().perform(Action::Turntable, &ctx);
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(2) {
        harness.step();
        // Slower than the reference's coarse pictures, faster than its full ones.
        std::thread::sleep(Duration::from_millis(120));
    }
    harness.state_mut().perform(Action::Turntable, &ctx);
    rest(&mut harness);
    let stops = harness.state().stops();
    println!("from stop to free: {stops}");
    assert!(stops.count() > 0, "nothing was stopped");
}
