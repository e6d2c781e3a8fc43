//! Are the pictures right? Scenes whose pixels can be reckoned by hand.

use crate::{Factory, Voxel};
use glam::{DAffine3, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{
    Background, Fog, Light, Material, Mesh, Object, Primitive, Scene, Shape, Voxels,
};
use polyptych_core::seam::{
    BackendFactory, Control, Decision, Need, Origin, Registry, RenderError, Renderer, Report,
};
use std::sync::Arc;

/// Looks down on 32x32 cells: pixel (x, y) sees the column of cells (x, z = y).
fn from_above() -> Camera {
    let eye = DVec3::new(16.0, 40.0, 16.0);
    Camera::look_at(eye, eye - DVec3::Y, -DVec3::Z, Projection::Orthographic { height: 32.0 })
}

/// Looks along -z at the cells (x, 31 - y) of a grid 32 cells wide and high.
fn from_front() -> Camera {
    let eye = DVec3::new(16.0, 16.0, 100.0);
    Camera::look_at(eye, eye - DVec3::Z, DVec3::Y, Projection::Orthographic { height: 32.0 })
}

fn matte(color: Vec3) -> Material {
    Material { specular: 0.0, diffuse: 1.0, ..Material::new(color) }
}

fn scene(voxels: Voxels, materials: Vec<Material>) -> Scene {
    let mut scene = Scene { materials, ..Scene::default() };
    scene.environment.background = Background::Solid(Vec3::ZERO);
    scene.environment.ambient = Vec3::ZERO;
    let mut object = Object::new("grid", Shape::Voxels(voxels), 0);
    object.materials = (0..scene.materials.len()).collect();
    scene.objects.push(object);
    scene
}

fn need(camera: Camera, width: u32, height: u32) -> Need {
    Need { channels: Channels::ALL, ..Need::new(camera, width, height) }
}

fn draw_with(voxel: &mut Voxel, scene: &Scene, need: &Need) -> (Framebuffer, Report) {
    let converter = Converter::default();
    voxel.prepare(&Arc::new(scene.clone()), need, &converter, &Control::simple()).unwrap();
    let mut picture = Framebuffer::new(need.width, need.height, need.channels);
    let report = voxel.render(&need.frame(), &mut picture, &Control::simple()).unwrap();
    assert_eq!(picture.count_not_finite(), 0);
    (picture, report)
}

fn draw(scene: &Scene, need: &Need) -> Framebuffer {
    draw_with(&mut Voxel::new(), scene, need).0
}

/// A floor of one cell with a tower of 2x2x8 cells on it.
fn tower() -> Voxels {
    Voxels::from_fn([32, 16, 32], |x, y, z| {
        let tower = (10..12).contains(&x) && (10..12).contains(&z) && y < 9;
        if tower { 2 } else { u8::from(y == 0) }
    })
}

#[test]
fn a_tower_shades_exactly_the_cells_behind_it() {
    let mut scene = scene(tower(), vec![matte(Vec3::ONE), matte(Vec3::X)]);
    // Light falls at 45 degrees along +x: eight cells of height shade eight cells of floor.
    scene.lights.push(Light::directional(DVec3::new(1.0, -1.0, 0.0)));
    let need = need(from_above(), 32, 32);
    let picture = draw(&scene, &need);
    let lit = 0.5f32.sqrt();
    for z in 0..32usize {
        for x in 0..32usize {
            let i = z * 32 + x;
            let on_tower = (10..12).contains(&x) && (10..12).contains(&z);
            let shaded = (12..20).contains(&x) && (10..12).contains(&z);
            assert_eq!(picture.shadow()[i], if shaded { 0.0 } else { 1.0 }, "cell {x}, {z}");
            assert_eq!(picture.distance()[i], if on_tower { 31.0 } else { 39.0 });
            assert_eq!((picture.normal()[i], picture.id()[i]), (Vec3::Y, 1));
            let color = if on_tower { Vec3::X } else { Vec3::ONE };
            assert_eq!(picture.albedo()[i], color);
            let expected = if shaded { Vec3::ZERO } else { color * lit };
            assert!((picture.color()[i] - expected).length() < 1e-6, "cell {x}, {z}");
        }
    }
    // A light that casts no shadow, and shadows switched off.
    scene.lights[0].casts_shadow = false;
    let unshaded = draw(&scene, &need);
    assert!(unshaded.color().iter().all(|c| c.x > 0.7) && unshaded.shadow().iter().all(|&s| s == 1.0));
    scene.lights[0].casts_shadow = true;
    let mut off = need.clone();
    off.settings.set("voxel", &Factory.info().parameters, "shadow", "off").unwrap();
    assert!(draw(&scene, &off).color().iter().all(|c| c.x > 0.7));
}

#[test]
fn an_emissive_cell_lights_its_surroundings_and_a_wall_blocks_it() {
    let voxels = Voxels::from_fn([32, 16, 32], |x, y, z| match (x, y, z) {
        (16, 5, 16) => 2,
        (12, 1..8, _) => 3,
        (_, 0, _) => 1,
        _ => 0,
    });
    let lamp = Material { emission: Vec3::new(30.0, 20.0, 10.0), ..matte(Vec3::ONE) };
    let picture =
        draw(&scene(voxels, vec![matte(Vec3::ONE), lamp, matte(Vec3::ONE)]), &need(from_above(), 32, 32));
    // The light shines from the middle of its cell, 4.5 above the floor.
    for (x, z) in [(20usize, 16usize), (16, 12), (13, 13), (30, 30)] {
        let (dx, dz) = (x as f32 - 16.0, z as f32 - 16.0);
        let square = dx * dx + dz * dz + 4.5 * 4.5;
        let expected = Vec3::new(30.0, 20.0, 10.0) * (4.5 / square.powf(1.5));
        let color = picture.color()[z * 32 + x];
        assert!((color - expected).length() < 1e-5, "cell {x}, {z}: {color}, expected {expected}");
        assert_eq!(picture.shadow()[z * 32 + x], 1.0);
    }
    for (x, z) in [(11usize, 16usize), (3, 16), (0, 0)] {
        assert_eq!(picture.color()[z * 32 + x], Vec3::ZERO, "cell {x}, {z} lies behind the wall");
    }
}

#[test]
fn glass_lets_the_wall_through_and_equal_cells_are_one_body() {
    // From the front: nothing, thin glass, thick glass, two kinds of glass, glass with a gap.
    let voxels = Voxels::from_fn([32, 32, 40], |x, _, z| match (x / 4, z) {
        (_, 0) => 1,
        (1, 20) => 2,
        (2, 10..30) => 2,
        (3, 10..15) => 2,
        (3, 15..30) => 3,
        (4, 10 | 20) => 2,
        _ => 0,
    });
    let glass = |color, opacity| Material { opacity, ..matte(color) };
    let mut scene = scene(voxels, vec![matte(Vec3::ONE), glass(Vec3::X, 0.25), glass(Vec3::Y, 0.5)]);
    scene.environment.ambient = Vec3::ONE;
    let picture = draw(&scene, &need(from_front(), 32, 32));
    let see = |x: usize| (picture.color()[16 * 32 + x], picture.distance()[16 * 32 + x]);
    let through = |behind: Vec3, glass: Vec3, opacity: f32| glass * opacity + behind * (1.0 - opacity);
    let red = |behind| through(behind, Vec3::X, 0.25);
    assert_eq!(see(0), (Vec3::ONE, 99.0));
    assert_eq!(see(5), (red(Vec3::ONE), 79.0));
    assert_eq!(see(9), (red(Vec3::ONE), 70.0));
    assert_eq!(see(13), (through(red(Vec3::ONE), Vec3::Y, 0.5), 70.0));
    assert_eq!(see(17), (red(red(Vec3::ONE)), 79.0));
}

#[test]
fn glass_casts_no_shadow() {
    let voxels = Voxels::from_fn([32, 16, 32], |x, y, _| match (x, y) {
        (_, 0) => 1,
        (4..8, 12) => 2,
        (20..24, 12) => 1,
        _ => 0,
    });
    let glass = Material { opacity: 0.5, ..matte(Vec3::ONE) };
    let mut scene = scene(voxels, vec![matte(Vec3::ONE), glass]);
    scene.lights.push(Light::directional(DVec3::new(1.0, -1.0, 0.0)));
    let picture = draw(&scene, &need(from_above(), 32, 32));
    // Roofs at height 12 over a floor at height 1 shade the floor 11 to 12 cells further along x; the glass roof
    // lets everything through.
    let shadows: Vec<usize> = (0..32).filter(|&x| picture.shadow()[16 * 32 + x] == 0.0).collect();
    assert_eq!(shadows, [31]);
}

#[test]
fn a_mirror_shows_what_is_in_front_of_it_as_often_as_it_may() {
    // A mirror in the back, looked at from the front along -z, sees the wall behind the eye.
    let voxels = Voxels::from_fn([32, 32, 40], |x, _, z| match (x / 16, z) {
        (_, 0) => 2,
        (1, 20) => 1,
        _ => 0,
    });
    let mirror = Material { reflectivity: 0.5, ..matte(Vec3::ONE) };
    let mut scene = scene(voxels, vec![matte(Vec3::X), mirror]);
    scene.environment.ambient = Vec3::ONE;
    scene.environment.background = Background::Solid(Vec3::Z);
    let eye = DVec3::new(16.0, 16.0, 10.0);
    let camera = Camera::look_at(eye, eye - DVec3::Z, DVec3::Y, Projection::Orthographic { height: 32.0 });
    let mut need = need(camera, 32, 32);
    let picture = draw(&scene, &need);
    assert_eq!(picture.color()[16 * 32 + 4], Vec3::new(0.5, 0.5, 1.0));
    assert_eq!(picture.color()[16 * 32 + 20], Vec3::new(1.0, 0.5, 0.5));
    need.settings.set("voxel", &Factory.info().parameters, "bounces", "0").unwrap();
    assert_eq!(draw(&scene, &need).color()[16 * 32 + 20], Vec3::ONE);
}

#[test]
fn the_nearest_of_many_turned_objects_is_seen_and_fog_veils_it() {
    let mut scene = scene(Voxels::from_fn([4, 4, 4], |_, _, _| 1), vec![matte(Vec3::ONE)]);
    let shape = scene.objects[0].shape.clone();
    scene.objects.clear();
    for i in 0..3000u32 {
        // Quarters of a turn keep faces on the axes; a negative scale mirrors.
        let turn = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2 * f64::from(i % 4));
        let flip = DAffine3::from_scale(DVec3::new(if i % 3 == 0 { -0.5 } else { 0.5 }, 0.5, 0.5));
        let middle = DAffine3::from_translation(DVec3::splat(-2.0));
        let column = DVec3::new(f64::from(i % 10), f64::from(i / 10 % 10), 0.0) * 3.2 + 1.6;
        let place = DAffine3::from_translation(column - DVec3::Z * f64::from(i / 100) * 7.0);
        let mut object = Object::new(format!("box {i}"), Shape::Voxels(Voxels::new([1, 1, 1])), 0);
        object.shape = shape.clone();
        scene.objects.push(object.placed(place * turn * flip * middle));
    }
    scene.environment.ambient = Vec3::ONE;
    scene.environment.fog = Some(Fog { color: Vec3::X, density: 0.01 });
    let (picture, report) = draw_with(&mut Voxel::new(), &scene, &need(from_front(), 320, 320));
    let veil = (-0.01f32 * 97.4).exp();
    for column in 0..100usize {
        // Through the middle of each column the front box is seen: its face lies 1 in front of its middle.
        let (x, y) = (column % 10 * 32 + 16, 319 - (column / 10 * 32 + 16));
        let i = y * 320 + x;
        assert_eq!(picture.id()[i] as usize, column + 1);
        assert!((picture.distance()[i] - (100.0 - 2.6)).abs() < 1e-4, "{}", picture.distance()[i]);
        assert!((picture.normal()[i] - Vec3::Z).length() < 1e-6);
        assert!((picture.color()[i] - Vec3::X.lerp(Vec3::ONE, veil)).length() < 1e-5);
    }
    assert!(report.counters.iter().flatten().any(|c| c.name == "chunks built" && c.count == 1));
}

fn varied() -> Scene {
    let voxels = Voxels::from_fn([70, 40, 66], |x, y, z| {
        let hill = 6 + (x * 7 + z * 3) % 11 / 2;
        match y {
            y if y < hill => 1,
            y if y < 20 && x % 23 == 5 && z % 19 == 7 => 2 + (x % 3) as u8,
            _ => 0,
        }
    });
    let glass = Material { opacity: 0.4, ..matte(Vec3::Y) };
    let mirror = Material { reflectivity: 0.7, ..matte(Vec3::splat(0.3)) };
    let lamp = Material { emission: Vec3::new(9.0, 6.0, 3.0), ..matte(Vec3::ONE) };
    let mut scene = scene(voxels, vec![Material::default(), glass, mirror, lamp]);
    scene.environment.ambient = Vec3::splat(0.2);
    scene.lights.push(Light::directional(DVec3::new(0.4, -1.0, 0.3)));
    scene.lights.push(Light::point(DVec3::new(30.0, 60.0, 30.0), 900.0));
    let ball = Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 8.0 }), 2);
    scene.objects.push(ball.at(DVec3::new(35.0, 30.0, 30.0)));
    scene
}

fn around() -> Camera {
    let eye = DVec3::new(90.0, 60.0, 95.0);
    Camera::look_at(eye, DVec3::new(35.0, 10.0, 33.0), DVec3::Y, Projection::Perspective { fov_y: 0.8 })
}

#[test]
fn any_number_of_threads_draws_the_same_bytes() {
    let scene = Arc::new(varied());
    let need = need(around(), 131, 77);
    let mut voxel = Voxel::new();
    let draw = |voxel: &mut Voxel, threads: usize| {
        let pool = Pool::new(threads).unwrap();
        let control = Control::new(&pool);
        voxel.prepare(&scene, &need, &Converter::default(), &control).unwrap();
        let mut picture = Framebuffer::new(need.width, need.height, Channels::ALL);
        voxel.render(&need.frame(), &mut picture, &control).unwrap();
        picture
    };
    let one = draw(&mut voxel, 1);
    assert!(one.id().contains(&1) && one.id().contains(&2) && one.id().contains(&0));
    for threads in [2, 4] {
        assert!(draw(&mut voxel, threads).same_bits(&one), "{threads} threads");
    }
    // The model is the scene as it was drawn.
    let model = voxel.model().unwrap();
    assert!(draw_with(&mut Voxel::new(), &model, &need).0.same_bits(&one));
}

#[test]
fn any_size_and_any_channels_are_drawn() {
    let scene = varied();
    for (width, height) in [(0, 0), (1, 1), (1, 7), (13, 11)] {
        let all = draw(&scene, &need(around(), width, height));
        for channel in Channel::ALL {
            let channels = Channels::of(&[channel]);
            let one = draw(&scene, &Need { channels, ..need(around(), width, height) });
            assert_eq!(one.channels(), channels);
            let same = match channel {
                Channel::Color => one.color() == all.color(),
                Channel::Distance => one.distance() == all.distance(),
                Channel::Normal => one.normal() == all.normal(),
                Channel::Id => one.id() == all.id(),
                Channel::Albedo => one.albedo() == all.albedo(),
                Channel::Shadow => one.shadow() == all.shadow(),
                Channel::Coverage => one.coverage() == all.coverage(),
            };
            assert!(same, "{channel:?} alone at {width}x{height}");
        }
    }
}

#[test]
fn the_ball_is_as_round_as_its_bound_says() {
    let mut scene = scene(Voxels::new([0, 0, 0]), vec![matte(Vec3::ONE)]);
    scene.objects = vec![Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), 0)];
    let eye = DVec3::new(0.3, 0.4, 5.0);
    let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 0.5 });
    let need = need(camera, 64, 64);
    let (picture, report) = draw_with(&mut Voxel::new(), &scene, &need);
    let Decision::Converted { bound, .. } = report.objects[0] else { panic!("{:?}", report.objects) };
    assert!(bound > 0.0 && bound < 0.03, "{bound}");
    let view = need.camera.view(64, 64);
    for y in 0..64u32 {
        for x in 0..64u32 {
            let distance = picture.distance()[(y * 64 + x) as usize];
            let ray = view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5).unwrap();
            if distance.is_finite() {
                let off = ray.at(f64::from(distance)).length() - 1.0;
                assert!(off.abs() <= bound * 1.001, "{off} at {x}, {y}");
            } else {
                let middle = ray.origin.cross(ray.direction).length();
                assert!(middle > 1.0 - bound, "a hole at {x}, {y}");
            }
        }
    }
}

#[test]
fn decisions_say_what_happens_to_each_object() {
    let mut scene = varied();
    let mut hidden = scene.objects[1].clone();
    hidden.visible = false;
    let wire = Mesh { positions: vec![Vec3::ZERO, Vec3::ONE], segments: vec![[0, 1]], ..Mesh::default() };
    let flat = scene.objects[0].clone().placed(DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)));
    scene.objects.extend([hidden, Object::new("wire", Shape::Mesh(wire), 0), flat]);
    let need = need(around(), 32, 32);
    let voxel = Voxel::new();
    let plan = voxel.plan(&scene, &need);
    let (_, report) = draw_with(&mut Voxel::new(), &scene, &need);
    let words: Vec<&str> = report.objects.iter().map(Decision::word).collect();
    assert_eq!(words, ["exact", "converted", "skipped", "skipped", "skipped"]);
    assert_eq!(plan.objects.iter().map(|o| o.decision.word()).collect::<Vec<_>>(), words);
    assert_eq!(report.objects[2].why(), "it is invisible");
    assert_eq!(report.objects[4].why(), "its transform squeezes it to nothing");
    assert!(plan.bytes > 0 && report.bytes > 0);

    scene.objects[3].required = true;
    let error =
        Voxel::new().prepare(&Arc::new(scene), &need, &Converter::default(), &Control::simple()).unwrap_err();
    assert_eq!(error.to_string(), "object `wire` is required but line segments have no area");
}

#[test]
fn an_edit_builds_the_chunk_it_touched_and_shows() {
    let mut scene = varied();
    scene.objects.truncate(1);
    let need = need(around(), 40, 30);
    let mut voxel = Voxel::new();
    let built =
        |report: &Report| report.counters.iter().flatten().find(|c| c.name == "chunks built").unwrap().count;
    assert_eq!(built(&draw_with(&mut voxel, &scene, &need).1), 4);
    assert_eq!(built(&draw_with(&mut voxel, &scene, &need).1), 0);
    let Shape::Voxels(voxels) = &*scene.objects[0].shape else { panic!("the first object is a grid") };
    let mut voxels = voxels.clone();
    for y in 0..40 {
        voxels.set(69, y, 65, 3);
    }
    scene.objects[0].shape = Arc::new(Shape::Voxels(voxels));
    let (edited, report) = draw_with(&mut voxel, &scene, &need);
    assert_eq!(built(&report), 1);
    assert!(edited.same_bits(&draw(&scene, &need)), "edited and built anew are the same");
}

#[test]
fn hosts_that_hurry_or_stop_are_answered() {
    let mut registry = Registry::default();
    registry.add(Arc::new(Factory), Origin::BuiltIn);
    let mut voxel = registry.create("voxel").unwrap();
    let need = need(around(), 32, 32);
    let mut picture = Framebuffer::new(32, 32, Channels::ALL);
    let early = voxel.render(&need.frame(), &mut picture, &Control::simple());
    assert_eq!(early.unwrap_err(), RenderError::NotPrepared);
    let scene = Arc::new(varied());
    let stop = std::sync::atomic::AtomicBool::new(true);
    let stopped = || Control::simple().cancelled_by(&stop);
    let converter = Converter::default();
    assert_eq!(voxel.prepare(&scene, &need, &converter, &stopped()).unwrap_err(), RenderError::Cancelled);
    voxel.prepare(&scene, &need, &converter, &Control::simple()).unwrap();
    let cancelled = voxel.render(&need.frame(), &mut picture, &stopped());
    assert_eq!(cancelled.unwrap_err(), RenderError::Cancelled);
    voxel.render(&need.frame(), &mut picture, &Control::simple()).unwrap();
}

#[test]
fn a_board_of_pixels_is_whole_at_rest_and_without_ghosts_in_motion() {
    let scene = varied();
    for camera in [around(), Camera { projection: Projection::Fisheye { fov: 2.0 }, ..around() }] {
        for (width, height) in [(67, 35), (1, 9), (17, 1), (16, 16)] {
            let whole = draw(&scene, &need(camera.clone(), width, height));
            let mut moved = camera.clone();
            moved.eye += DVec3::new(3.0, 1.0, -2.0);
            let mut need = need(moved, width, height);
            need.settings.set("voxel", &Factory.info().parameters, "checkerboard", "on").unwrap();
            let mut voxel = Voxel::new();
            let prepared = Arc::new(scene.clone());
            voxel.prepare(&prepared, &need, &Converter::default(), &Control::simple()).unwrap();
            let mut picture = Framebuffer::new(width, height, Channels::ALL);
            let mut frame = need.frame();
            voxel.render(&frame, &mut picture, &Control::simple()).unwrap();
            voxel.render(&frame, &mut picture, &Control::simple()).unwrap();
            // The camera moves: half of the pixels are drawn, and the others say nothing of frames before.
            frame.camera = camera.clone();
            voxel.render(&frame, &mut picture, &Control::simple()).unwrap();
            let mut fresh = Framebuffer::new(width, height, Channels::ALL);
            let mut other = picture.clone();
            voxel.last = None;
            voxel.halves += 1;
            voxel.render(&frame, &mut fresh, &Control::simple()).unwrap();
            assert!(fresh.same_bits(&picture), "{width}x{height}");
            let same = (0..whole.id().len()).filter(|&i| whole.color()[i] == picture.color()[i]).count();
            assert!(same * 2 >= whole.id().len() - width.max(height) as usize, "{same} of {width}x{height}");
            // It rests: the other half comes, and all is as if drawn at once; then there is nothing to do.
            voxel.render(&frame, &mut fresh, &Control::simple()).unwrap();
            assert!(fresh.same_bits(&whole), "{width}x{height}");
            let report = voxel.render(&frame, &mut fresh, &Control::simple()).unwrap();
            assert!(report.counters.iter().all(Option::is_none) && fresh.same_bits(&whole));
            // Another picture of the same camera is begun anew.
            voxel.render(&frame, &mut other, &Control::simple()).unwrap();
            voxel.render(&frame, &mut other, &Control::simple()).unwrap();
            assert!(other.same_bits(&whole));
        }
    }
}

#[test]
fn many_samples_are_the_mean_of_small_pixels() {
    // A wall behind the left of 5.25 pixels: the sixth is covered by a quarter.
    let voxels = Voxels::from_fn([21, 128, 1], |_, _, _| 1);
    let mut scene = scene(voxels, vec![Material { emission: Vec3::ONE, ambient: 0.0, ..matte(Vec3::ZERO) }]);
    scene.objects[0].world_from_object = DAffine3::from_scale(DVec3::splat(0.25));
    let picture = |samples: &str, threads: usize| {
        let mut need = need(from_front(), 32, 32);
        need.settings.set("voxel", &Factory.info().parameters, "samples", samples).unwrap();
        let mut voxel = Voxel::new();
        voxel.prepare(&Arc::new(scene.clone()), &need, &Converter::default(), &Control::simple()).unwrap();
        let mut picture = Framebuffer::new(32, 32, Channels::ALL);
        let pool = Pool::new(threads).unwrap();
        voxel.render(&need.frame(), &mut picture, &Control::new(&pool)).unwrap();
        picture
    };
    let (one, many) = (picture("1", 1), picture("16", 1));
    assert!(many.same_bits(&picture("16", 3)));
    for (x, share) in [(0, 1.0), (4, 1.0), (5, 0.25), (6, 0.0), (31, 0.0)] {
        for y in [0, 7, 31] {
            let i = y * 32 + x;
            assert_eq!((many.coverage()[i], many.color()[i]), (share, Vec3::splat(share)), "{x}, {y}");
            assert_eq!(many.distance()[i], one.distance()[i]);
        }
    }
}
