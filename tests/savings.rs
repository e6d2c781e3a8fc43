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
    // Left out are converted free forms, whose meshes nobody can foresee without making them.
    let cases = [
        ("raster", "polyhedra"),
        ("raster", "figure"),
        ("raster", "terrain"),
        ("voxel", "atelier"),
        ("voxel", "polyhedra"),
        ("voxel", "figure"),
        ("voxel", "terrain"),
        ("voxel", "cloud"),
        ("freeform", "terrain"),
        ("freeform", "cloud"),
    ];
    let mut off = Vec::new();
    for (backend, name) in cases {
        let scene = builtin(name);
        let mut studio = studio(2);
        let need = Need { width: 480, height: 270, ..need(&scene, Channels::COLOR) };
        let planned = studio.renderer(backend).unwrap().plan(&scene, &need).bytes as f64;
        let held = studio.prepare(backend, &scene, &need).unwrap().0.bytes as f64;
        if !(0.9..=1.1).contains(&(planned / held)) {
            off.push(format!("{backend}, {name}: {planned} planned, {held} held"));
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
