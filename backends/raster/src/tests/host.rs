//! Does it keep the promises of the seam: sizes, threads, reports, reuse, cancelling?

use super::{camera, cube, draw, plane, scene_of};
use crate::Raster;
use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::parallel::{OneThread, Pool, Threads};
use polyptych_core::scene::{Background, Light, Material, Mesh, Primitive, Scene, Shape, Voxels};
use polyptych_core::seam::{Control, Decision, Need, RenderError, Renderer};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A bit of everything.
fn mixed() -> Scene {
    let torus = Shape::Primitive(Primitive::Torus { major: 0.7, minor: 0.25 });
    let voxels = Voxels::from_fn([4, 3, 4], |x, y, z| u8::from((x + y + z) % 2 == 0));
    let mut scene = scene_of(vec![
        (plane(30.0), [0.0, -0.5, 0.0]),
        (cube(1.0), [0.0; 3]),
        (torus, [1.3, 0.2, 0.4]),
        (Shape::Voxels(voxels), [-4.0, -0.4, -3.0]),
        (cube(0.8), [0.4, 0.0, 1.2]),
    ]);
    let glass = scene.add_material(Material { opacity: 0.4, ..Material::new(Vec3::new(0.2, 0.8, 0.4)) });
    scene.objects[4].materials = vec![glass];
    scene.lights =
        vec![Light::directional(DVec3::new(-0.4, -1.0, -0.2)), Light::point(DVec3::new(1.0, 3.0, 2.0), 5.0)];
    scene
}

fn need_of(camera: Camera, width: u32, height: u32) -> Need {
    Need { channels: Channels::ALL, ..Need::new(camera, width, height) }
}

#[test]
fn every_number_of_threads_gives_the_same_bytes() {
    let scene = Arc::new(mixed());
    for projection in [Projection::Perspective { fov_y: 0.8 }, Projection::Fisheye { fov: 3.0 }] {
        let camera = Camera { projection, ..camera([2.0, 1.7, 4.0], [0.0; 3]) };
        let need = need_of(camera, 157, 103);
        let pools = [2, 4].map(|n| Pool::new(n).unwrap());
        let all: Vec<Framebuffer> = [&OneThread as &dyn Threads, &pools[0], &pools[1]]
            .into_iter()
            .map(|threads| {
                let (control, mut raster) = (Control::new(threads), Raster::new());
                raster.prepare(&scene, &need, &Converter::default(), &control).unwrap();
                let mut picture = Framebuffer::new(157, 103, need.channels);
                raster.render(&need.frame(), &mut picture, &control).unwrap();
                picture
            })
            .collect();
        assert!(all.iter().all(|p| p.same_bits(&all[0])));
        assert_eq!(all[0].count_not_finite(), 0);
    }
}

#[test]
fn pictures_of_any_size_are_drawn() {
    let scene = mixed();
    let camera = camera([2.0, 1.7, 4.0], [0.0; 3]);
    for (width, height) in [(0, 0), (0, 5), (1, 1), (1, 7), (13, 11), (20_001, 1), (1, 3001)] {
        let picture = draw(&scene, camera.clone(), width, height);
        assert_eq!(picture.count_not_finite(), 0);
        assert!(width == 0 || picture.id().iter().any(|&id| id > 0), "{width}x{height}");
    }
}

#[test]
fn channels_that_were_not_asked_for_change_nothing() {
    let scene = mixed();
    let camera = camera([2.0, 1.7, 4.0], [0.0; 3]);
    let all = draw(&scene, camera.clone(), 61, 47);
    for channel in Channel::ALL {
        let need = Need { channels: Channels::of(&[channel]), ..Need::new(camera.clone(), 61, 47) };
        let (mut raster, control) = (Raster::new(), Control::simple());
        raster.prepare(&Arc::new(scene.clone()), &need, &Converter::default(), &control).unwrap();
        let mut picture = Framebuffer::new(61, 47, need.channels);
        raster.render(&need.frame(), &mut picture, &control).unwrap();
        let same = match channel {
            Channel::Color => picture.color() == all.color(),
            Channel::Distance => picture.distance() == all.distance(),
            Channel::Normal => picture.normal() == all.normal(),
            Channel::Id => picture.id() == all.id(),
            Channel::Albedo => picture.albedo() == all.albedo(),
            Channel::Shadow => picture.shadow() == all.shadow(),
            Channel::Coverage => picture.coverage() == all.coverage(),
        };
        assert!(same, "{channel:?}");
    }
}

#[test]
fn decisions_say_what_was_done() {
    let mut scene = mixed();
    scene.objects[1].visible = false;
    let mirror = scene.add_material(Material { reflectivity: 0.5, ..Material::default() });
    scene.objects[0].materials = vec![mirror];
    let scene = Arc::new(scene);
    let camera = camera([2.0, 1.7, 4.0], [0.0; 3]);
    let need = need_of(camera.clone(), 61, 47);
    let mut raster = Raster::new();
    let planned = raster.plan(&scene, &need);
    let prepared = raster.prepare(&scene, &need, &Converter::default(), &Control::simple()).unwrap();
    let words: Vec<_> = prepared.objects.iter().map(Decision::word).collect();
    assert_eq!(words, ["approximated", "skipped", "converted", "exact", "exact"]);
    assert_eq!(planned.objects.iter().map(|o| o.decision.word()).collect::<Vec<_>>(), words);
    assert_eq!(prepared.objects[0].why(), "reflections are not drawn");
    assert_eq!(prepared.objects[1].why(), "it is invisible");
    assert!(prepared.objects[2].bound().is_some_and(|b| b > 0.0 && b < 0.05));
    assert!(planned.passes.iter().any(|p| p.needed && p.name == "shadow map of light 1"));
    let model = raster.model().unwrap();
    assert!(matches!(*model.objects[2].shape, Shape::Mesh(_)));
    assert!(Arc::ptr_eq(&model.objects[3].shape, &scene.objects[3].shape));
    let bent = Camera { projection: Projection::Fisheye { fov: 2.0 }, ..camera };
    let planned = raster.plan(&scene, &need_of(bent, 61, 47));
    assert_eq!(planned.objects[3].decision.why(), "resampled from perspective faces");
}

#[test]
fn a_required_object_that_cannot_be_drawn_is_refused() {
    let mut scene = mixed();
    scene.objects[2].required = true;
    scene.objects[2].world_from_object.matrix3 = glam::DMat3::ZERO;
    let need = need_of(camera([2.0, 1.7, 4.0], [0.0; 3]), 8, 8);
    let mut raster = Raster::new();
    let error =
        raster.prepare(&Arc::new(scene), &need, &Converter::default(), &Control::simple()).unwrap_err();
    assert!(matches!(error, RenderError::Required { ref object, .. } if object == "object 2"), "{error}");
    let mut picture = Framebuffer::new(8, 8, Channels::COLOR);
    let error = raster.render(&need.frame(), &mut picture, &Control::simple()).unwrap_err();
    assert_eq!(error, RenderError::NotPrepared);
}

#[test]
fn what_did_not_change_is_kept() {
    let mut scene = mixed();
    let need = need_of(camera([2.0, 1.7, 4.0], [0.0; 3]), 61, 47);
    let (mut raster, control) = (Raster::new(), Control::simple());
    raster.prepare(&Arc::new(scene.clone()), &need, &Converter::default(), &control).unwrap();
    let maps_of = |raster: &Raster| raster.shadows().unwrap();
    let maps = maps_of(&raster);
    // A color makes no new maps.
    scene.materials[0].base_color = Vec3::X;
    raster.prepare(&Arc::new(scene.clone()), &need, &Converter::default(), &control).unwrap();
    assert!(Arc::ptr_eq(&maps, &maps_of(&raster)));
    scene.objects[1].world_from_object.translation.x += 0.1;
    raster.prepare(&Arc::new(scene), &need, &Converter::default(), &control).unwrap();
    assert!(!Arc::ptr_eq(&maps, &maps_of(&raster)), "a thing that blocks light moved");
}

#[test]
fn no_map_is_drawn_that_nobody_needs() {
    let scene = Arc::new(mixed());
    let (mut raster, control) = (Raster::new(), Control::simple());
    let need =
        Need { channels: Channels::of(&[Channel::Id]), ..need_of(camera([2.0, 1.7, 4.0], [0.0; 3]), 9, 9) };
    raster.prepare(&scene, &need, &Converter::default(), &control).unwrap();
    assert!(raster.shadows().is_none());
    let mut need = need_of(need.camera, 9, 9);
    let declared = raster.info().parameters.clone();
    need.settings.set("raster", &declared, "mode", "lit").unwrap();
    let prepared = raster.prepare(&scene, &need, &Converter::default(), &control).unwrap();
    assert!(raster.shadows().is_none());
    assert_eq!(prepared.objects[1].why(), "shadows are switched off");
}

#[test]
fn a_cancelled_frame_can_be_drawn_again() {
    let scene = Arc::new(mixed());
    let need = need_of(camera([2.0, 1.7, 4.0], [0.0; 3]), 61, 47);
    let (mut raster, control) = (Raster::new(), Control::simple());
    let stop = AtomicBool::new(true);
    let stopped = Control::simple().cancelled_by(&stop);
    let error = raster.prepare(&scene, &need, &Converter::default(), &stopped).unwrap_err();
    assert_eq!(error, RenderError::Cancelled);
    raster.prepare(&scene, &need, &Converter::default(), &control).unwrap();
    let mut picture = Framebuffer::new(61, 47, need.channels);
    assert_eq!(raster.render(&need.frame(), &mut picture, &stopped).unwrap_err(), RenderError::Cancelled);
    let report = raster.render(&need.frame(), &mut picture, &control).unwrap();
    assert!(report.counters[0].is_some_and(|c| c.count > 100));
    assert!(picture.same_bits(&draw(&scene, need.camera.clone(), 61, 47)));
}

#[test]
fn an_eye_inside_of_things_and_empty_scenes_are_fine() {
    let picture = draw(&mixed(), camera([0.0; 3], [0.0, 0.0, -1.0]), 31, 31);
    assert!(picture.id().iter().all(|&id| id == 2), "the inside of the box");
    let empty = draw(&Scene::default(), camera([0.0; 3], [0.0, 0.0, -1.0]), 31, 31);
    assert!(empty.id().iter().all(|&id| id == 0) && empty.count_not_finite() == 0);
}

#[test]
fn a_light_that_moves_has_its_map_redrawn_in_the_same_memory_and_others_are_kept() {
    let mut scene = mixed();
    scene.lights = vec![
        Light::directional(DVec3::new(0.3, -1.0, 0.2)),
        Light::directional(DVec3::new(-0.4, -1.0, 0.1)),
        Light::point(DVec3::new(1.0, 3.0, 2.0), 4.0),
    ];
    let need = need_of(camera([2.0, 1.7, 4.0], [0.0; 3]), 61, 47);
    let (mut raster, control) = (Raster::new(), Control::simple());
    let mut prepare = |scene: &Scene| {
        raster.prepare(&Arc::new(scene.clone()), &need, &Converter::default(), &control).unwrap();
        let memory = raster.shadows().unwrap().memory();
        let mut picture = Framebuffer::new(61, 47, need.channels);
        raster.render(&need.frame(), &mut picture, &control).unwrap();
        assert!(picture.same_bits(&draw(scene, need.camera.clone(), 61, 47)));
        memory
    };
    let before = prepare(&scene);
    scene.lights[1] = Light::directional(DVec3::new(-0.4, -1.0, -0.3));
    let after = prepare(&scene);
    assert_eq!(before.len(), 8, "two maps, and six faces of a cube");
    assert_eq!(before, after);
    // A light less: the last one's map is gone, those before it stay where they are.
    scene.lights.pop();
    assert_eq!(before[..1], prepare(&scene)[..1]);
}

#[test]
fn a_picture_that_shows_the_frame_already_is_not_drawn_again() {
    let mut scene = Arc::new(mixed());
    let need = need_of(camera([2.0, 1.7, 4.0], [0.0; 3]), 61, 47);
    let (mut raster, control) = (Raster::new(), Control::simple());
    let mut picture = Framebuffer::new(61, 47, need.channels);
    let prepare = |raster: &mut Raster, scene: &Arc<Scene>, need: &Need| {
        raster.prepare(scene, need, &Converter::default(), &control).unwrap();
    };
    // A frame that is drawn has phases, and gives the bytes that a new renderer draws.
    let draws = |raster: &mut Raster, need: &Need, picture: &mut Framebuffer| {
        raster.render(&need.frame(), picture, &control).unwrap().phases.iter().count() > 0
    };
    prepare(&mut raster, &scene, &need);
    assert!(draws(&mut raster, &need, &mut picture));
    let first = picture.clone();
    assert!(!draws(&mut raster, &need, &mut picture));
    prepare(&mut raster, &scene, &need);
    assert!(!draws(&mut raster, &need, &mut picture));
    assert!(picture.same_bits(&first));
    // Something was written to it, it is another picture, or another frame.
    picture.band().color.fill(Vec3::ONE);
    assert!(draws(&mut raster, &need, &mut picture) && picture.same_bits(&first));
    assert!(draws(&mut raster, &need, &mut Framebuffer::new(61, 47, need.channels)));
    let aside = Need { camera: camera([2.0, 1.7, 4.001], [0.0; 3]), ..need.clone() };
    assert!(draws(&mut raster, &aside, &mut picture) && !picture.same_bits(&first));
    assert!(draws(&mut raster, &need, &mut picture) && picture.same_bits(&first));
    // The host stopped it halfway.
    let flag = AtomicBool::new(true);
    let stopped = raster.render(&aside.frame(), &mut picture, &Control::simple().cancelled_by(&flag));
    assert_eq!(stopped.unwrap_err(), RenderError::Cancelled);
    assert!(draws(&mut raster, &need, &mut picture) && picture.same_bits(&first));
    // Another scene, or other settings.
    Arc::make_mut(&mut scene).lights[1].intensity = 1.0;
    prepare(&mut raster, &scene, &need);
    assert!(draws(&mut raster, &need, &mut picture) && !picture.same_bits(&first));
    let mut flat = need.clone();
    flat.settings.set("raster", &raster.info().parameters.clone(), "shading", "flat").unwrap();
    prepare(&mut raster, &scene, &flat);
    assert!(draws(&mut raster, &flat, &mut picture));
}

#[test]
fn no_more_triangles_are_drawn_than_the_tolerance_asks_for() {
    // Hills so gentle that from far away they are as good as flat.
    let mut mesh = Mesh::default();
    for i in 0..101 * 101 {
        let (x, y) = ((i % 101) as f32 * 0.1, (i / 101) as f32 * 0.1);
        mesh.positions.push(Vec3::new(x - 5.0, y - 5.0, 0.002 * (x * 2.0).sin() * (y * 2.0).cos()));
    }
    for i in (0..100 * 101).filter(|i| i % 101 < 100) {
        mesh.triangles.extend([[i, i + 1, i + 101], [i + 1, i + 102, i + 101]]);
    }
    let count = mesh.triangles.len();
    let mut scene = scene_of(vec![(Shape::Mesh(mesh), [0.0; 3]), (cube(1.0), [0.0, 0.0, 2.0])]);
    scene.lights.push(Light::directional(DVec3::new(-0.3, -0.5, -1.0)));
    let scene = Arc::new(scene);
    let (mut raster, control) = (Raster::new(), Control::simple());
    let declared = raster.info().parameters.clone();
    let mut draw = |triangles: &str, tolerance_px: f64| {
        let mut need = Need::new(camera([0.5, 1.0, 14.0], [0.0; 3]), 240, 160);
        (need.channels, need.tolerance_px) = (Channels::ALL, tolerance_px);
        need.settings.set("raster", &declared, "triangles", triangles).unwrap();
        let prepared = raster.prepare(&scene, &need, &Converter::default(), &control).unwrap();
        let mut picture = Framebuffer::new(240, 160, need.channels);
        let report = raster.render(&need.frame(), &mut picture, &control).unwrap();
        assert_eq!(raster.plan(&scene, &need).objects[1].decision, prepared.objects[1]);
        (prepared.objects[0].clone(), report.counters[0].unwrap().count, picture)
    };
    let (decision, all, given) = draw("all", 0.5);
    assert!(decision == Decision::Exact && all as usize > count / 2, "{decision:?} {all}");
    let (decision, few, picture) = draw("needed", 0.5);
    let Decision::Converted { bound, why } = decision else { panic!("{decision:?}") };
    assert!(
        bound > 0.0 && bound < 0.05 && few * 3 < all && why.contains("of 20000 triangles"),
        "{bound} {few} {why}"
    );
    assert!(picture.id() == given.id(), "borders stay");
    let off = |i: usize| (picture.distance()[i] - given.distance()[i]).abs();
    let most = (0..given.id().len()).filter(|&i| given.id()[i] != 0).map(off).fold(0.0, f32::max);
    assert!(f64::from(most) < 2.0 * bound, "{most} for {bound}");
    let (_, more, _) = draw("needed", 0.001);
    assert!(more > few, "{more} {few}");
}

#[test]
fn what_stays_blank_is_right_whatever_happens_between_two_frames() {
    let mut scene = scene_of(vec![(cube(1.0), [0.0; 3]), (cube(0.3), [1.4, 0.3, 0.0])]);
    let (width, height) = (330, 200);
    let mut need =
        Need { channels: Channels::ALL, ..Need::new(camera([0.0, 0.5, 8.0], [0.0; 3]), width, height) };
    let (mut raster, converter, control) = (Raster::new(), Converter::default(), Control::simple());
    let mut picture = Framebuffer::new(width, height, Channels::ALL);
    let mut other = Framebuffer::new(width, height, Channels::ALL);
    let geometry = Channels::of(&[Channel::Distance, Channel::Id, Channel::Albedo]);
    other.band().id.fill(7);
    for step in 0..14 {
        match step {
            // The same camera, another scene.
            2 => scene.objects[0].world_from_object.translation.x = 1.0,
            3 => scene.environment.background = Background::Solid(Vec3::new(0.1, 0.5, 0.2)),
            // Another camera that looks the same way, and one that does not.
            4 => {
                let (below, horizon, above) = (Vec3::X, Vec3::Y, Vec3::Z);
                scene.environment.background = Background::Gradient { below, horizon, above };
                need.camera.eye.x += 0.5;
            }
            5 => need.camera = camera([5.0, 2.0, 5.0], [0.0; 3]),
            // Somebody else writes to all planes, exchanges some, or exchanges them to and fro.
            6 => picture.band().color.fill(Vec3::ONE),
            7 => picture.exchange(&mut other, Channels::of(&[Channel::Color])),
            8 => picture.exchange(&mut other, geometry),
            9 => {
                picture.exchange(&mut other, geometry);
                picture.exchange(&mut other, geometry);
            }
            10 => picture.touch(),
            11 => need.camera.projection = Projection::Orthographic { height: 6.0 },
            12 => need.camera.projection = Projection::Fisheye { fov: 2.0 },
            13 => need.camera = camera([5.0, 2.0, 5.0], [0.0; 3]),
            _ => {}
        }
        let shared = Arc::new(scene.clone());
        raster.prepare(&shared, &need, &converter, &control).unwrap();
        raster.render(&need.frame(), &mut picture, &control).unwrap();
        let fresh = draw(&scene, need.camera.clone(), width, height);
        assert!(picture.same_bits(&fresh), "step {step}");
    }
}
