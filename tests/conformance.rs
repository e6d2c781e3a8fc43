//! What every back end promises, whatever it draws: one suite, one line for each back end.

mod common;

use common::{builtin, need, studio};
use polyptych::framebuffer::{Channel, Channels, Framebuffer};
use polyptych::prelude::*;
use polyptych::seam::{Control, RenderError};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The default scene, at a size that is no multiple of anything.
fn everything() -> Arc<Scene> {
    builtin("atelier")
}

/// Settings that keep conversions small.
fn coarse(backend: &str, scene: &Scene, width: u32, height: u32) -> Need {
    let mut need = Need { tolerance_px: 2.0, ..need(scene, width, height) };
    let info = studio(1).registry().info(backend).expect("a built-in back end").clone();
    if info.parameters.iter().any(|p| p.name == "detail.resolution") {
        need.settings.set(backend, &info.parameters, "detail.resolution", "32").expect("a valid value");
    }
    need
}

fn draw(backend: &str, threads: usize, scene: &Arc<Scene>, need: &Need) -> Drawing {
    studio(threads).draw(backend, scene, need).unwrap_or_else(|e| panic!("{e}"))
}

fn same_bytes_for_any_number_of_threads(backend: &str) {
    let scene = everything();
    let need = coarse(backend, &scene, 97, 61);
    let one = draw(backend, 1, &scene, &need).framebuffer;
    for threads in [2, 4] {
        assert!(
            draw(backend, threads, &scene, &need).framebuffer.same_bits(&one),
            "{threads} threads differ"
        );
    }
}

fn a_second_frame_is_the_same(backend: &str) {
    let scene = everything();
    let need = coarse(backend, &scene, 40, 30);
    let mut studio = studio(2);
    let first = studio.draw(backend, &scene, &need).unwrap().framebuffer;
    let mut second = Framebuffer::new(40, 30, need.channels);
    studio.render(backend, &need.frame(), &mut second).unwrap();
    assert!(second.same_bits(&first));
    // Prepared anew, nothing changes either.
    assert!(studio.draw(backend, &scene, &need).unwrap().framebuffer.same_bits(&first));
}

fn every_size_is_drawn(backend: &str) {
    let scene = builtin("polyhedra");
    let mut studio = studio(2);
    for (width, height) in [(0, 0), (0, 5), (1, 1), (1, 7), (13, 11), (257, 3)] {
        let picture =
            studio.draw(backend, &scene, &coarse(backend, &scene, width, height)).unwrap().framebuffer;
        assert_eq!((picture.width(), picture.height()), (width, height));
        assert_eq!(picture.count_not_finite(), 0, "{width}x{height}");
    }
}

fn channels_do_not_depend_on_each_other(backend: &str) {
    let scene = everything();
    let all_needed = coarse(backend, &scene, 48, 27);
    let mut studio = studio(2);
    let all = studio.draw(backend, &scene, &all_needed).unwrap().framebuffer;
    for channel in Channel::ALL {
        let need = Need { channels: Channels::of(&[channel]), ..all_needed.clone() };
        let alone = studio.draw(backend, &scene, &need).unwrap().framebuffer;
        let same = match channel {
            Channel::Color => alone.color() == all.color(),
            Channel::Distance => alone.distance() == all.distance(),
            Channel::Normal => alone.normal() == all.normal(),
            Channel::Id => alone.id() == all.id(),
            Channel::Albedo => alone.albedo() == all.albedo(),
            Channel::Shadow => alone.shadow() == all.shadow(),
            Channel::Coverage => alone.coverage() == all.coverage(),
        };
        assert!(same, "{} alone differs from {0} among others", channel.name());
    }
}

fn every_object_is_accounted_for(backend: &str) {
    let mut scene = (*everything()).clone();
    scene.objects[1].visible = false;
    scene.objects[2].world_from_object = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let scene = Arc::new(scene);
    let need = coarse(backend, &scene, 32, 18);
    let drawing = draw(backend, 1, &scene, &need);
    assert_eq!(drawing.report.objects.len(), scene.objects.len());
    assert_eq!(drawing.prepared.objects, drawing.report.objects);
    for index in [1, 2] {
        let decision = &drawing.report.objects[index];
        assert!(decision.word() == "skipped" && !decision.why().is_empty(), "{decision:?}");
    }
    assert!(drawing.report.objects.iter().all(|d| d.word() == "exact" || !d.why().is_empty()));
    let plan = studio(1).renderer(backend).unwrap().plan(&scene, &need);
    let planned: Vec<_> = plan.objects.iter().map(|o| o.decision.word()).collect();
    let done: Vec<_> = drawing.report.objects.iter().map(polyptych::seam::Decision::word).collect();
    assert_eq!(planned, done, "the plan says what is then done");
}

fn a_required_object_that_cannot_be_drawn_is_an_error(backend: &str) {
    let mut scene = (*builtin("polyhedra")).clone();
    scene.objects[0].required = true;
    scene.objects[0].world_from_object = DAffine3::from_scale(DVec3::ZERO);
    let scene = Arc::new(scene);
    let error = studio(1).draw(backend, &scene, &coarse(backend, &scene, 8, 8)).unwrap_err().to_string();
    assert!(error.contains("hexagonal prism") && error.contains("required"), "{error}");
}

fn cancelling_leaves_the_renderer_usable(backend: &str) {
    let scene = builtin("polyhedra");
    let need = coarse(backend, &scene, 64, 64);
    let mut renderer = studio(1).registry().create(backend).unwrap();
    let converter = polyptych::convert::Converter::default();
    let mut target = Framebuffer::new(64, 64, need.channels);
    assert_eq!(
        renderer.render(&need.frame(), &mut target, &Control::simple()).err(),
        Some(RenderError::NotPrepared)
    );
    renderer.prepare(&scene, &need, &converter, &Control::simple()).unwrap();
    let flag = AtomicBool::new(true);
    let cancelled = renderer.render(&need.frame(), &mut target, &Control::simple().cancelled_by(&flag));
    assert_eq!(cancelled.err(), Some(RenderError::Cancelled));
    renderer.render(&need.frame(), &mut target, &Control::simple()).unwrap();
    assert!(target.same_bits(&draw(backend, 1, &scene, &need).framebuffer));
}

fn every_projection_is_drawn(backend: &str) {
    let scene = everything();
    let mut studio = studio(2);
    for projection in [
        Projection::Orthographic { height: 4.0 },
        Projection::Fisheye { fov: 3.0 },
        Projection::Cylindrical { fov_x: 3.0, fov_y: 1.0 },
    ] {
        let mut need = coarse(backend, &scene, 48, 40);
        need.camera.projection = projection.clone();
        let picture = studio.draw(backend, &scene, &need).unwrap().framebuffer;
        assert_eq!(picture.count_not_finite(), 0);
        let seen = picture.id().iter().filter(|&&id| id != 0).count();
        assert!(seen > 48 * 40 / 4, "{projection:?}: {seen} pixels");
    }
}

fn an_empty_scene_is_its_background(backend: &str) {
    let scene = Arc::new(Scene::default());
    let camera = Camera::framing(&scene.bounds(), 0.0, 0.0, 1.0, Projection::Perspective { fov_y: 1.0 });
    let need = Need { channels: Channels::ALL, ..Need::new(camera, 9, 9) };
    let picture = draw(backend, 1, &scene, &need).framebuffer;
    let ray = need.camera.view(9, 9).ray(4.5, 4.5).unwrap();
    assert!((picture.color()[40] - scene.environment.background.color(ray.direction)).length() < 1e-6);
    assert!(picture.distance().iter().all(|d| *d == f32::INFINITY) && picture.id().iter().all(|&id| id == 0));
}

/// Makes the suite's tests for a back end.
macro_rules! conforms {
    ($backend:ident) => {
        mod $backend {
            const ID: &str = stringify!($backend);
            conforms!(
                @tests same_bytes_for_any_number_of_threads a_second_frame_is_the_same every_size_is_drawn
                channels_do_not_depend_on_each_other every_object_is_accounted_for
                a_required_object_that_cannot_be_drawn_is_an_error cancelling_leaves_the_renderer_usable
                every_projection_is_drawn an_empty_scene_is_its_background
            );
        }
    };
    (@tests $($test:ident)*) => {
        $(#[test] fn $test() { super::$test(ID); })*
    };
}

conforms!(reference);
conforms!(raster);
conforms!(voxel);
conforms!(freeform);
conforms!(stylized);
