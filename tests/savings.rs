//! Is no more built than a picture needs, and is the picture the same without it?

mod common;

use common::{builtin, studio};
use polyptych::framebuffer::{Channel, Channels};
use polyptych::prelude::*;
use std::sync::Arc;

const BACKENDS: [&str; 5] = ["reference", "raster", "voxel", "freeform", "stylized"];

fn need(scene: &Scene, channels: Channels) -> Need {
    Need { channels, ..Need::new(scene.cameras[0].1.clone(), 96, 54) }
}

fn pass(plan: &polyptych::seam::Plan, name: &str) -> bool {
    plan.passes.iter().any(|p| p.name.contains(name) && p.needed)
}

#[test]
fn no_shadow_is_prepared_where_no_light_casts_one_or_no_channel_shows_it() {
    let scene = builtin("polyhedra");
    let mut unlit = (*scene).clone();
    unlit.lights.iter_mut().for_each(|l| l.casts_shadow = false);
    let unlit = Arc::new(unlit);
    let seen = Channels::of(&[Channel::Distance, Channel::Id]);
    for backend in ["raster", "voxel", "freeform"] {
        let mut studio = studio(2);
        let plan = |studio: &mut Studio, scene: &Scene, channels| {
            studio.renderer(backend).unwrap().plan(scene, &need(scene, channels))
        };
        assert!(pass(&plan(&mut studio, &scene, Channels::COLOR), "shadow"), "{backend}");
        assert!(!pass(&plan(&mut studio, &unlit, Channels::COLOR), "shadow"), "{backend}");
        assert!(pass(&plan(&mut studio, &scene, Channels::COLOR), "normals"), "{backend}");
        assert!(!pass(&plan(&mut studio, &scene, seen), "normals"), "{backend}: nothing is lit");
        let bytes = |studio: &mut Studio, scene: &Arc<Scene>, channels| {
            studio.draw(backend, scene, &need(scene, channels)).unwrap()
        };
        let all = bytes(&mut studio, &scene, Channels::ALL);
        let few = bytes(&mut studio, &scene, seen);
        let dark = bytes(&mut studio, &unlit, Channels::ALL);
        assert!(few.prepared.bytes <= all.prepared.bytes && dark.prepared.bytes <= all.prepared.bytes);
        if backend == "raster" {
            // A map of 2048 x 2048 texels of four bytes.
            assert!(all.prepared.bytes - few.prepared.bytes >= 1 << 24, "distance alone needs no shadow map");
            assert!(all.prepared.bytes - dark.prepared.bytes >= 1 << 24, "no light needs one");
        }
        assert_eq!(few.framebuffer.distance(), all.framebuffer.distance(), "{backend}");
        assert_eq!(few.framebuffer.id(), all.framebuffer.id(), "{backend}");
        assert_eq!((few.framebuffer.color().len(), few.framebuffer.normal().len()), (0, 0), "{backend}");
    }
}

#[test]
fn what_is_far_away_is_converted_more_coarsely_and_stays_within_the_tolerance() {
    let scene = builtin("polyhedra");
    for backend in ["raster", "voxel"] {
        let drawn = |factor: f64| {
            // Large enough that a pixel is little of what is seen far away.
            let mut need = Need { width: 384, height: 216, ..need(&scene, Channels::ALL) };
            let center = scene.bounds().center();
            need.camera.eye = center + (need.camera.eye - center) * factor;
            let mut studio = studio(2);
            let drawing = studio.draw(backend, &scene, &need).unwrap();
            let reference = studio.draw("reference", &scene, &need).unwrap();
            let bounds: Vec<f64> =
                drawing.prepared.objects.iter().filter_map(polyptych::seam::Decision::bound).collect();
            let allowed: Vec<f64> = scene.objects.iter().map(|o| need.world_tolerance(&o.bounds())).collect();
            let seen = |f: &Framebuffer| f.id().iter().filter(|id| **id != 0).count() as f64;
            let area = (seen(&drawing.framebuffer) - seen(&reference.framebuffer)).abs()
                / seen(&reference.framebuffer);
            (drawing.prepared.bytes, bounds, allowed, area)
        };
        let (near, ..) = drawn(1.0);
        let (far, bounds, allowed, area) = drawn(6.0);
        // The rasterizer's shadow map, which does not depend on distance, is not counted.
        let map = if backend == "raster" { 1 << 24 } else { 0 };
        assert!(far - map < near - map - (near - map) / 3, "{backend}: {far} bytes far away, {near} near");
        assert!(bounds.iter().zip(&allowed).all(|(b, a)| b <= a), "{backend}: {bounds:?} of {allowed:?}");
        assert!(area < 0.15, "{backend}: {area}");
    }
}

#[test]
fn shapes_that_are_drawn_as_given_are_not_converted() {
    let cases =
        [("voxel", "figure"), ("freeform", "quadrics"), ("freeform", "terrain"), ("freeform", "cloud")];
    for (backend, name) in cases {
        let scene = builtin(name);
        let mut studio = studio(2);
        let drawing = studio.draw(backend, &scene, &need(&scene, Channels::COLOR)).unwrap();
        let shapes: u64 = scene.objects.iter().map(|o| o.shape.bytes()).sum();
        let given = drawing.prepared.objects.iter().all(|d| d.bound().is_none_or(|b| b == 0.0));
        assert!(given, "{backend} converts in {name}: {:?}", drawing.prepared.objects);
        assert!(
            drawing.prepared.bytes < shapes * 12 + 65_536,
            "{backend}, {name}: {}",
            drawing.prepared.bytes
        );
        assert!(studio.renderer(backend).unwrap().model().is_none(), "{backend} draws {name} as given");
    }
}

#[test]
fn a_camera_that_moves_a_little_finds_everything_there() {
    let scene = builtin("atelier");
    for backend in BACKENDS {
        let mut studio = studio(2);
        let mut need = need(&scene, Channels::COLOR);
        let (first, _) = studio.prepare(backend, &scene, &need).unwrap();
        need.camera.eye += need.camera.right() * 1e-3;
        let (again, _) = studio.prepare(backend, &scene, &need).unwrap();
        // The same bounds are the same conversions: a class of tolerance is half an octave wide.
        assert_eq!(first.objects, again.objects, "{backend}");
        assert_eq!(first.bytes, again.bytes, "{backend}");
        let mut kept = Framebuffer::new(need.width, need.height, need.channels);
        studio.render(backend, &need.frame(), &mut kept).unwrap();
        let fresh = common::studio(2).draw(backend, &scene, &need).unwrap().framebuffer;
        assert!(kept.same_bits(&fresh), "{backend}: the picture is that of a scene prepared anew");
    }
}

#[test]
fn plans_build_nothing_and_name_what_is_built() {
    for name in ["polyhedra", "figure", "terrain"] {
        let scene = builtin(name);
        let mut studio = studio(2);
        let need = need(&scene, Channels::COLOR);
        for backend in ["raster", "freeform"] {
            let plan = studio.renderer(backend).unwrap().plan(&scene, &need);
            let built = studio.prepare(backend, &scene, &need).unwrap().0;
            let words = |d: &polyptych::seam::Decision| d.word();
            let planned: Vec<_> = plan.objects.iter().map(|o| words(&o.decision)).collect();
            let done: Vec<_> = built.objects.iter().map(words).collect();
            assert_eq!(planned, done, "{backend}, {name}");
        }
    }
}

#[test]
fn planned_bytes_are_those_that_are_held() {
    // Surfaces that must be found before they can be counted: how many chunks a form fills, and how often vertices of a
    // cloud's surface are split at creases.
    let unknown = [("voxel", "quadrics"), ("raster", "cloud")];
    let mut off = Vec::new();
    for backend in BACKENDS {
        for name in polyptych::builtin::NAMES {
            let scene = builtin(name);
            let mut studio = studio(2);
            let need = Need { width: 480, height: 270, ..need(&scene, Channels::COLOR) };
            let planned = studio.renderer(backend).unwrap().plan(&scene, &need).bytes as f64;
            let held = studio.prepare(backend, &scene, &need).unwrap().0.bytes as f64;
            let slack = if unknown.contains(&(backend, name)) { 0.6 } else { 0.1 };
            if (planned / held - 1.0).abs() > slack {
                off.push(format!("{backend}, {name}: {planned} planned, {held} held"));
            }
        }
    }
    assert!(off.is_empty(), "{}", off.join("\n"));
}

#[test]
fn no_shadow_map_is_planned_or_held_where_nothing_blocks_light() {
    let scene = builtin("cloud");
    let mut studio = studio(2);
    let need = need(&scene, Channels::COLOR);
    assert!(!pass(&studio.renderer("raster").unwrap().plan(&scene, &need), "shadow map"));
    assert!(studio.prepare("raster", &scene, &need).unwrap().0.bytes < 1 << 24);
}

/// A ball in the sun, another one somewhere.
fn two_balls(other: DVec3) -> Arc<Scene> {
    let mut scene = Scene::default();
    let stone = scene.add_material(Material::new(Vec3::new(0.7, 0.6, 0.5)));
    for (name, place) in [("ball", DVec3::ZERO), ("other", other)] {
        let body = Shape::Primitive(polyptych::scene::Primitive::Sphere { radius: 1.0 });
        scene.objects.push(Object::new(name, body, stone).at(place));
    }
    scene.lights.push(Light::directional(DVec3::NEG_Y));
    let view = Projection::Perspective { fov_y: 1.2 };
    scene.cameras.push(("front".to_owned(), Camera::look_at(DVec3::Z * 9.0, DVec3::ZERO, DVec3::Y, view)));
    Arc::new(scene)
}

#[test]
fn no_shadow_is_looked_for_where_no_body_stands_before_another() {
    let (beside, above) = (two_balls(DVec3::X * 4.0), two_balls(DVec3::Y * 2.5));
    for backend in ["raster", "freeform"] {
        let mut studio = studio(2);
        let mut draw = |scene: &Arc<Scene>| {
            let is_planned =
                pass(&studio.renderer(backend).unwrap().plan(scene, &need(scene, Channels::COLOR)), "shadow");
            (studio.draw(backend, scene, &need(scene, Channels::ALL)).unwrap(), is_planned)
        };
        let mut lit = (*beside).clone();
        lit.lights[0].casts_shadow = false;
        let ((saved, is_planned), (without, _)) = (draw(&beside), draw(&Arc::new(lit)));
        assert!(!is_planned, "{backend}");
        assert_eq!(saved.framebuffer.color(), without.framebuffer.color(), "{backend}");
        assert_eq!(saved.prepared.bytes, without.prepared.bytes, "{backend}");
        let rays = |d: &polyptych::Drawing| {
            d.report.counters.iter().flatten().find(|c| c.name == "rays").map(|c| c.count)
        };
        assert_eq!(rays(&saved), rays(&without), "{backend}");
        // And where one does, there is a shadow, as the reference sees it.
        let (shaded, is_planned) = draw(&above);
        assert!(is_planned, "{backend}");
        let reference =
            common::studio(2).draw("reference", &above, &need(&above, Channels::ALL)).unwrap().framebuffer;
        let errors = polyptych::metrics::Errors::of_geometry(&shaded.framebuffer, &reference);
        assert!(errors.shadow_agreement > Some(0.99), "{backend}: {errors:?}");
    }
}

#[test]
fn the_converter_is_asked_for_what_cannot_be_drawn_as_given_and_no_more() {
    let none = [0, 0, 0];
    // What is native to a back end is never converted.
    let native = [
        ("reference", "atelier"),
        ("voxel", "figure"),
        ("freeform", "quadrics"),
        ("freeform", "terrain"),
        ("freeform", "cloud"),
        ("freeform", "polyhedra"),
    ];
    for (backend, name) in native {
        let scene = builtin(name);
        let mut studio = studio(2);
        studio.prepare(backend, &scene, &need(&scene, Channels::ALL)).unwrap();
        assert_eq!(studio.converter().kept(), none, "{backend}, {name}");
    }
    let scene = builtin("atelier");
    let mut studio = studio(2);
    let need = need(&scene, Channels::COLOR);
    for backend in BACKENDS {
        studio.renderer(backend).unwrap().plan(&scene, &need);
    }
    assert_eq!(studio.converter().kept(), none, "plans build nothing");
    studio.prepare("raster", &scene, &need).unwrap();
    let of_raster = studio.converter().kept();
    let shapes: std::collections::HashSet<_> = scene.objects.iter().map(|o| Arc::as_ptr(&o.shape)).collect();
    assert!(of_raster[0] <= shapes.len() && of_raster[1..] == [0, 0], "{of_raster:?}");
    // The stylized shader sees through the rasterizer: what that converted serves it, too. So it does a moved camera.
    studio.prepare("stylized", &scene, &need).unwrap();
    let mut moved = need.clone();
    moved.camera.eye += need.camera.right() * 1e-3;
    studio.prepare("raster", &scene, &moved).unwrap();
    assert_eq!(studio.converter().kept(), of_raster);
    studio.prepare("voxel", &scene, &need).unwrap();
    assert!(studio.converter().kept()[1] > 0 && studio.converter().kept()[2] == 0);
}
