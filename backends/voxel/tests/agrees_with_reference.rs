//! Has the method no error of its own? On grids it must show what the exact reference shows.

use glam::{DAffine3, DVec3, EulerRot, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::metrics::{Errors, Gate};
use polyptych_core::scene::{Fog, Light, LightKind, Material, Object, Primitive, Scene, Shape, Voxels};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_reference::Reference;
use polyptych_voxel::Voxel;
use std::sync::Arc;

fn draw(renderer: &mut dyn Renderer, scene: &Arc<Scene>, need: &Need) -> Framebuffer {
    renderer.prepare(scene, need, &Converter::default(), &Control::simple()).unwrap();
    let mut picture = Framebuffer::new(need.width, need.height, need.channels);
    renderer.render(&need.frame(), &mut picture, &Control::simple()).unwrap();
    picture
}

/// Holds a picture against the reference: every pixel but those on the silhouettes of objects must show the same
/// object at the same distance, on the same side, in the same light.
fn assert_same(picture: &Framebuffer, reference: &Framebuffer, what: &str) {
    let errors = Errors::between(picture, reference);
    let pixels = u64::from(picture.width()) * u64::from(picture.height());
    let verdict = Gate::EDGE_TOLERANT.judge(&errors, pixels);
    assert!(verdict.passed, "{what}: {:?}", verdict.failed);
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let (mut different, mut shades) = (Vec::new(), 0);
    for y in 1..height.saturating_sub(1) {
        for x in 1..width - 1 {
            let i = y * width + x;
            let id = reference.id()[i];
            let is_edge = (0..9).any(|k| reference.id()[i + k / 3 * width + k % 3 - width - 1] != id);
            if is_edge {
                continue;
            }
            let (a, b) = (picture.distance()[i], reference.distance()[i]);
            let same_distance = a == b || (a - b).abs() <= 1e-6 * b;
            let same_side = (picture.normal()[i] - reference.normal()[i]).length() < 1e-6;
            let same_albedo = picture.albedo()[i] == reference.albedo()[i];
            if picture.id()[i] != id || !same_distance || !same_side || !same_albedo {
                different.push((x, y));
            }
            let off = (picture.color()[i] - reference.color()[i]).abs().max_element();
            shades += usize::from(off > 1e-4 || picture.shadow()[i] != reference.shadow()[i]);
        }
    }
    assert!(different.is_empty(), "{what}: {} pixels see another cell: {different:?}", different.len());
    // A ray to a light may pass exactly through an edge of cells, where either side is right.
    assert!(shades * 2000 <= width * height, "{what}: {shades} pixels in another light");
}

/// Hills, pillars of glass, mirror and light, and turned and squeezed instances of a small body.
fn scene(lamps: u32) -> Scene {
    let mut scene = Scene::default();
    let matte = |r: f32, g: f32, b: f32| Material::new(Vec3::new(r, g, b));
    let materials = [
        matte(0.2, 0.4, 0.1),
        Material { opacity: 0.4, ..matte(0.3, 0.6, 0.9) },
        Material { reflectivity: 0.5, ..matte(0.2, 0.2, 0.2) },
        Material { emission: Vec3::new(90.0, 60.0, 30.0), ..matte(1.0, 1.0, 1.0) },
        Material { opacity: 0.0, ..matte(1.0, 0.0, 1.0) },
    ];
    let slots: Vec<usize> = materials.into_iter().map(|m| scene.add_material(m)).collect();
    let hills = Voxels::from_fn([90, 40, 70], |x, y, z| {
        let ground = 8 + (x * 5 + z * 3) % 13 / 3 + (x / 9 + z / 7) % 4;
        match (x % 17, z % 15) {
            (0..3, 0..3) if y < 26 => 2 + (x / 17 % 2) as u8,
            (8, 8) if y == 30 && x / 17 + z / 15 * 5 < lamps => 4,
            (12, 4..9) if y < 30 && y > 18 => 5,
            _ => u8::from(y < ground),
        }
    });
    let mut land = Object::new("land", Shape::Voxels(hills), slots[0]);
    land.materials = slots.clone();
    scene.objects.push(land);
    let body = Voxels::from_fn([9, 9, 9], |x, y, z| {
        let middle = |c: u32| c.abs_diff(4);
        if middle(x) + middle(y) + middle(z) < 6 { 1 + (x / 3 % 3) as u8 } else { 0 }
    });
    let body = Arc::new(Shape::Voxels(body));
    for i in 0..6u32 {
        let t = f64::from(i);
        let turn = DAffine3::from_quat(glam::DQuat::from_euler(EulerRot::YXZ, t * 0.7, t * 0.5, t * 0.3));
        let size = DAffine3::from_scale(DVec3::new(if i % 2 == 0 { 1.3 } else { -0.9 }, 1.0, 0.7 + 0.1 * t));
        let place = DAffine3::from_translation(DVec3::new(10.3 + 13.0 * t, 33.1, 20.7 + 4.0 * t));
        let mut object = Object::new(format!("body {i}"), Shape::Voxels(Voxels::new([1, 1, 1])), slots[0]);
        object.shape = body.clone();
        object.materials = slots.clone();
        scene.objects.push(object.placed(place * turn * size));
    }
    scene.lights.push(Light { intensity: 0.8, ..Light::directional(DVec3::new(-0.41, -0.73, -0.27)) });
    scene.lights.push(Light {
        kind: LightKind::Spot {
            position: DVec3::new(40.1, 70.3, 60.2),
            direction: DVec3::new(0.0, -1.0, -0.4),
            inner: 0.2,
            outer: 0.5,
        },
        ..Light::point(DVec3::ZERO, 1500.0)
    });
    scene
}

fn cameras() -> Vec<(&'static str, Camera)> {
    let at = |eye: [f64; 3], target: [f64; 3], projection| {
        Camera::look_at(eye.into(), target.into(), DVec3::Y, projection)
    };
    let perspective = Projection::Perspective { fov_y: 0.8 };
    vec![
        ("over the hills", at([113.3, 58.1, 97.7], [43.0, 14.0, 33.0], perspective.clone())),
        ("among them", at([43.4, 24.7, 30.6], [10.0, 14.0, 50.0], Projection::Fisheye { fov: 2.5 })),
        ("inside of glass", at([1.3, 20.2, 1.7], [40.0, 15.0, 30.0], perspective)),
        (
            "inside of a hill",
            at([45.3, 3.2, 31.7], [40.0, 15.0, 30.0], Projection::Perspective { fov_y: 1.0 }),
        ),
        ("far off", at([3e5, 2e5, 4e5], [43.0, 14.0, 33.0], Projection::Orthographic { height: 90.0 })),
    ]
}

fn need(camera: Camera) -> Need {
    Need { channels: Channels::ALL, ..Need::new(camera, 160, 120) }
}

#[test]
fn grids_look_as_the_reference_sees_them() {
    let mut land = scene(3);
    land.environment.fog = Some(Fog { color: Vec3::new(0.5, 0.55, 0.6), density: 0.004 });
    let land = Arc::new(land);
    for (name, camera) in cameras() {
        let mut need = need(camera);
        // Both mirror as often.
        let mut voxel = Voxel::new();
        need.settings.set("voxel", &voxel.info().parameters, "bounces", "4").unwrap();
        let picture = draw(&mut voxel, &land, &need);
        assert_same(&picture, &draw(&mut Reference::new(), &land, &need), name);
        assert!(voxel.model().is_none(), "nothing was converted");
    }
}

#[test]
fn the_model_of_other_shapes_is_drawn_without_error() {
    let mut converted = scene(0);
    converted.objects.truncate(2);
    for (i, shape) in [
        Primitive::Sphere { radius: 9.0 },
        Primitive::Torus { major: 9.0, minor: 3.0 },
        Primitive::Box { size: DVec3::new(9.0, 4.0, 13.0) },
    ]
    .into_iter()
    .enumerate()
    {
        let place = DAffine3::from_rotation_x(0.4 * i as f64);
        let mut object = Object::new(format!("shape {i}"), Shape::Primitive(shape), i).placed(place);
        object.world_from_object.translation = DVec3::new(20.0 + 25.0 * i as f64, 32.0, 34.0);
        converted.objects.push(object);
    }
    let (name, camera) = cameras().swap_remove(0);
    let mut need = need(camera);
    let mut voxel = Voxel::new();
    need.settings.set("voxel", &voxel.info().parameters, "detail.resolution", "40").unwrap();
    need.settings.set("voxel", &voxel.info().parameters, "bounces", "4").unwrap();
    let picture = draw(&mut voxel, &Arc::new(converted), &need);
    let model = voxel.model().unwrap();
    assert_same(&picture, &draw(&mut Reference::new(), &model, &need), name);
}

/// Counts pixels of which anything differs.
fn different(a: &Framebuffer, b: &Framebuffer) -> usize {
    let pixels = 0..a.distance().len();
    let is_same = |i: usize| {
        a.distance()[i].to_bits() == b.distance()[i].to_bits()
            && a.normal()[i] == b.normal()[i]
            && a.color()[i] == b.color()[i]
            && a.shadow()[i] == b.shadow()[i]
    };
    pixels.filter(|&i| !is_same(i)).count()
}

#[test]
fn numbers_of_the_walk_change_nothing_but_where_they_say_so() {
    let land = Arc::new(scene(3));
    let (mut pixels, mut off) = (0, [0, 0]);
    for (name, camera) in cameras() {
        let picture = |walk: &str| {
            let mut need = need(camera.clone());
            let mut voxel = Voxel::new();
            need.settings.set("voxel", &voxel.info().parameters, "walk", walk).unwrap();
            draw(&mut voxel, &land, &need)
        };
        let double = picture("f64");
        assert!(
            picture("exact").same_bits(&double),
            "{name}: {} pixels",
            different(&picture("exact"), &double)
        );
        for (walk, off) in ["fast", "fixed"].into_iter().zip(&mut off) {
            *off += different(&picture(walk), &double);
        }
        pixels += double.distance().len();
    }
    // In the far view light and surfaces meet cells along their edges: which of two is seen is then a matter of rounding.
    assert!(off[0] * 1000 <= pixels && off[1] * 1000 <= pixels, "{off:?} of {pixels}");
}
