//! Is a style the same over every back end, every number of threads, and each object's own?

mod common;

use common::{Easel, ball, central, cube, scene};
use glam::{DVec3, Vec3};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::parallel::{OneThread, Pool};
use polyptych_core::scene::{Primitive, Scene, Shape, Voxels};
use polyptych_core::seam::{Control, RenderError, Renderer};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const SIZE: u32 = 120;

fn still_life() -> Arc<Scene> {
    let blocks = Voxels::from_fn([4, 4, 4], |x, y, z| u8::from(x + y + z < 6));
    scene(
        vec![
            (Shape::Mesh(cube(0.9)), DVec3::new(-1.2, 0.0, 0.0)),
            (Shape::Primitive(Primitive::Sphere { radius: 0.6 }), DVec3::new(0.1, 0.1, 0.0)),
            (Shape::Primitive(Primitive::Torus { major: 0.5, minor: 0.18 }), DVec3::new(1.4, 0.2, 0.1)),
            (Shape::Primitive(Primitive::Plane { width: 6.0, depth: 4.0 }), DVec3::new(0.0, -0.7, 0.0)),
            (Shape::Voxels(blocks), DVec3::new(-6.0, -3.5, -9.0)),
        ],
        DVec3::new(0.5, 0.8, 0.6),
    )
}

#[test]
fn the_same_regions_are_seen_through_every_back_end() {
    let scene = still_life();
    let channels = Channels::of(&[Channel::Color, Channel::Id]);
    let picture = |visibility: &str| {
        let camera = central(DVec3::new(0.8, 1.6, 4.6), 0.7);
        let settings = [("preset", "toon"), ("visibility", visibility)];
        Easel::with_channels(&scene, camera, [SIZE; 2], &settings, channels).picture()
    };
    let truth = picture("reference");
    for visibility in ["raster", "voxel", "freeform"] {
        let other = picture(visibility);
        let (mut wrong, mut compared) = (0, 0);
        for y in 1..SIZE - 1 {
            for x in 1..SIZE - 1 {
                let at = |dx: u32, dy: u32| ((y + dy - 1) * SIZE + x + dx - 1) as usize;
                let is_inner = |ids: &[u32]| (0..9).all(|k| ids[at(k % 3, k / 3)] == ids[at(1, 1)]);
                // Off a band of one pixel on both sides of each edge.
                if is_inner(truth.id()) && is_inner(other.id()) {
                    compared += 1;
                    wrong += usize::from(truth.id()[at(1, 1)] != other.id()[at(1, 1)]);
                }
            }
        }
        println!("{visibility}: {wrong} of {compared} pixels differ");
        assert!(compared > 11_000 && wrong == 0, "{visibility}: {wrong} of {compared} pixels differ");
    }
}

#[test]
fn every_style_is_the_same_for_any_number_of_threads_and_in_every_frame() {
    let scene = still_life();
    let (two, three) = (Pool::new(2).unwrap(), Pool::new(3).unwrap());
    for style in polyptych_stylized::STYLES {
        let camera = central(DVec3::new(0.8, 1.6, 4.6), 0.7);
        // Neither a multiple of eight nor of the rows of a band.
        let mut easel =
            Easel::with_channels(&scene, camera.clone(), [101, 67], &[("preset", style)], Channels::ALL);
        let first = easel.picture_from(&camera, &OneThread);
        for _ in 0..2 {
            assert!(first.same_bits(&easel.picture_from(&camera, &two)), "{style}");
            assert!(first.same_bits(&easel.picture_from(&camera, &three)), "{style}");
        }
        assert_eq!(first.count_not_finite(), 0);
        let mut fresh =
            Easel::with_channels(&scene, camera.clone(), [101, 67], &[("preset", style)], Channels::ALL);
        assert!(first.same_bits(&fresh.picture_from(&camera, &two)), "{style}: another renderer");
    }
}

#[test]
fn an_object_may_have_a_style_of_its_own() {
    let scene = scene(
        vec![
            (Shape::Mesh(ball(0.6, 16, true)), DVec3::new(-0.8, 0.0, 0.0)),
            (Shape::Mesh(ball(0.6, 16, true)), DVec3::new(0.8, 0.0, 0.0)),
        ],
        DVec3::new(0.3, 0.8, 0.6),
    );
    let draw = |settings: &[(&str, &str)]| {
        Easel::new(&scene, central(DVec3::Z * 4.0, 0.7), [SIZE; 2], settings).picture()
    };
    let (gooch, toon) = (draw(&[]), draw(&[("preset", "toon")]));
    let both = draw(&[("styles", "thing 1 = toon")]);
    let half = |picture: &Framebuffer, right: bool| -> Vec<Vec3> {
        let own = |i: &usize| (*i as u32 % SIZE >= SIZE / 2) == right;
        (0..(SIZE * SIZE) as usize).filter(own).map(|i| picture.color()[i]).collect()
    };
    assert_eq!(half(&both, false), half(&gooch, false));
    assert_eq!(half(&both, true), half(&toon, true));
    assert_ne!(half(&gooch, true), half(&toon, true));
}

#[test]
fn study_views_show_distance_normals_and_the_edges_of_triangles() {
    let scene = scene(vec![(Shape::Mesh(ball(1.0, 8, true)), DVec3::ZERO)], DVec3::Y);
    let draw = |settings: &[(&str, &str)]| {
        Easel::new(&scene, central(DVec3::Z * 3.0, 0.8), [SIZE; 2], settings).picture()
    };
    let middle = (SIZE / 2 * SIZE + SIZE / 2) as usize;
    let edge = (SIZE / 2 * SIZE + 18) as usize;
    let depth = draw(&[("show", "depth"), ("contours", "false")]);
    assert!(depth.color()[middle].x > depth.color()[edge].x && depth.color()[edge].x > 0.1);
    let normals = draw(&[("show", "normals"), ("contours", "false")]);
    assert!((normals.color()[middle] - Vec3::new(0.5, 0.5, 1.0)).length() < 0.15);
    let blue = |picture: &polyptych_core::framebuffer::Framebuffer| {
        picture.color().iter().filter(|c| c.z > 0.5 && c.x < 0.2).count()
    };
    let wires = draw(&[("wireframe", "true"), ("wireframe.color", "#0000ff"), ("contours", "false")]);
    assert!(blue(&wires) > 300 && blue(&draw(&[("contours", "false")])) == 0, "{}", blue(&wires));
}

#[test]
fn sides_that_look_away_are_left_out_where_that_is_asked_for() {
    let mut sheet = cube(1.0);
    sheet.triangles.truncate(2);
    let scene = scene(vec![(Shape::Mesh(sheet), DVec3::ZERO)], DVec3::Y);
    let channels = Channels::of(&[Channel::Id]);
    let seen = |from: f64, cull: &str| {
        let camera = central(DVec3::new(from, 0.1, 0.1) * 4.0, 0.5);
        let picture = Easel::with_channels(&scene, camera, [32, 32], &[("cull", cull)], channels).picture();
        picture.id().iter().any(|&id| id != 0)
    };
    assert!(seen(1.0, "none") && seen(-1.0, "none"));
    assert!(seen(1.0, "back") != seen(-1.0, "back"), "one side only");
}

#[test]
fn any_back_end_may_see_but_the_shader_itself() {
    let scene = still_life();
    let refused = |other: &str| {
        let mut registry = common::registry();
        registry.add(Arc::new(polyptych_stylized::Factory), polyptych_core::seam::Origin::BuiltIn);
        let mut renderer = polyptych_stylized::Stylized::new(registry);
        let mut need = polyptych_core::seam::Need::new(central(DVec3::Z * 4.0, 0.7), 8, 8);
        let declared = renderer.info().parameters.clone();
        need.settings.set("stylized", &declared, "visibility.other", other).unwrap();
        let converter = polyptych_core::convert::Converter::default();
        renderer.prepare(&scene, &need, &converter, &Control::simple()).err().map(|e| e.to_string())
    };
    assert_eq!(refused("freeform"), None);
    assert!(refused("stylized").unwrap().contains("cannot see through itself"));
    assert!(refused("rastr").unwrap().contains("the nearest is `raster`"));
}

#[test]
fn a_frame_is_stopped_and_the_next_one_is_whole() {
    let scene = still_life();
    let camera = central(DVec3::new(0.8, 1.6, 4.6), 0.7);
    let mut easel = Easel::with_channels(&scene, camera, [SIZE; 2], &[("preset", "ink")], Channels::ALL);
    let whole = easel.picture();
    let stop = AtomicBool::new(true);
    let mut target = Framebuffer::new(SIZE, SIZE, Channels::ALL);
    let control = Control::new(&OneThread).cancelled_by(&stop);
    let frame = easel.need.frame();
    assert_eq!(easel.renderer.render(&frame, &mut target, &control).unwrap_err(), RenderError::Cancelled);
    assert!(whole.same_bits(&easel.picture()));
}

#[test]
fn a_background_that_stays_is_the_one_that_would_be_painted() {
    // Wider than two stretches of columns, so that bodies and lines leave some of a row and come to others.
    let size = [200, 70];
    let at = |x: f64| {
        let body = (Shape::Primitive(Primitive::Torus { major: 0.5, minor: 0.18 }), DVec3::new(x, 0.2, 0.1));
        scene(vec![body], DVec3::new(0.5, 0.8, 0.6))
    };
    let camera = |y: f64| central(DVec3::new(0.0, y, 4.6), 0.7);
    let wide = ("silhouette.width", "6");
    let mut target = Framebuffer::new(size[0], size[1], Channels::COLOR);
    let mut easel = Easel::new(&at(0.0), camera(0.5), size, &[]);
    let mut check = |x: f64, y: f64, settings: &[(&str, &str)], spoil: bool| {
        let scene = at(x);
        let mut fresh = Easel::new(&scene, camera(y), size, settings);
        easel.need = fresh.need.clone();
        easel.renderer.prepare(&scene, &easel.need, &Converter::default(), &Control::simple()).unwrap();
        let stop = AtomicBool::new(true);
        let stopped = Control::new(&OneThread).cancelled_by(&stop);
        if spoil {
            target.band().color.fill(Vec3::X);
            easel.renderer.render(&easel.need.frame(), &mut target, &stopped).unwrap_err();
        }
        target.touch();
        easel.renderer.render(&easel.need.frame(), &mut target, &Control::simple()).unwrap();
        assert!(target.same_bits(&fresh.picture()), "{x} {y} {settings:?} {spoil}");
    };
    for settings in
        [&[][..], &[wide], &[("preset", "pencil")], &[("preset", "pencil"), ("paper.color", "#445566")]]
    {
        for (x, y) in [(-1.5, 0.5), (-1.4, 0.5), (1.5, 0.5), (1.5, 0.6), (9.0, 0.6), (0.0, 0.6)] {
            check(x, y, settings, false);
        }
        check(0.1, 0.6, settings, true);
    }
    check(0.1, 0.6, &[("show", "normals")], false);
    check(0.1, 0.6, &[], false);
}

#[test]
fn bodies_smaller_than_a_pixel_and_none_at_all_are_drawn_without_harm() {
    for radius in [1e-1f64, 1e-2, 1e-3, 1e-6] {
        let mesh = Shape::Mesh(ball(radius as f32, 8, true));
        let body = Shape::Primitive(Primitive::Sphere { radius });
        for (shape, style) in
            [(mesh.clone(), "ink"), (body.clone(), "ink"), (mesh, "blueprint"), (body, "comic")]
        {
            let scene = scene(vec![(shape, DVec3::ZERO)], DVec3::Y);
            let camera = central(DVec3::new(0.01, 0.02, 3.0), 0.7);
            let settings = [("preset", style)];
            let picture = Easel::with_channels(&scene, camera, [61, 43], &settings, Channels::ALL).picture();
            assert_eq!(picture.count_not_finite(), 0, "{style} {radius}");
        }
    }
    for size in [[0, 0], [1, 1], [1, 37], [37, 1]] {
        let empty = Arc::new(Scene::default());
        for scene in [still_life(), empty] {
            let camera = central(DVec3::new(0.8, 1.6, 4.6), 0.7);
            let picture =
                Easel::with_channels(&scene, camera, size, &[("preset", "ink")], Channels::ALL).picture();
            assert_eq!(picture.count_not_finite(), 0);
        }
    }
}

#[test]
fn a_body_within_a_pixel_is_a_dot_as_wide_as_its_line() {
    let scene = scene(vec![(Shape::Mesh(ball(0.01, 8, true)), DVec3::ZERO)], DVec3::Y);
    let settings = [&common::LINES[..], &[("silhouette.width", "3")]].concat();
    let picture = Easel::new(&scene, central(DVec3::Z * 3.0, 0.7), [61, 61], &settings).picture();
    let ink: f32 = picture.color().iter().map(|c| 1.0 - common::luminance(*c)).sum();
    // A disk of three pixels, and a little for the body itself.
    assert!((5.0..14.0).contains(&ink), "{ink} pixels of ink");
}

#[test]
fn any_values_that_are_allowed_give_a_picture() {
    use polyptych_core::seam::{ParameterKind, Value};
    let scene = still_life();
    let mut state = 7u64;
    let mut below = |n: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % n
    };
    let declared = polyptych_stylized::Stylized::new(common::registry()).info().parameters.clone();
    for round in 0..40 {
        let mut set: Vec<(&str, String)> = Vec::new();
        for parameter in declared.iter().filter(|p| p.name != "visibility" || round % 8 == 0) {
            if below(2) == 0 {
                continue;
            }
            let value = match (parameter.kind, &parameter.default) {
                (ParameterKind::Bool, _) => (below(2) == 0).to_string(),
                (ParameterKind::Int { min, max }, _) => {
                    (min + below((max - min + 1) as u64) as i64).to_string()
                }
                (ParameterKind::Float { min, max }, _) => {
                    (min + (max - min) * below(101) as f64 / 100.0).to_string()
                }
                (ParameterKind::Choice { choices }, _) => {
                    choices[below(choices.len() as u64) as usize].to_owned()
                }
                (ParameterKind::Color, _) => format!("#{:06x}", below(1 << 24)),
                (_, Value::Text(text)) => text.clone(),
                (_, other) => other.to_string(),
            };
            set.push((parameter.name, value));
        }
        let settings: Vec<(&str, &str)> = set.iter().map(|(n, v)| (*n, v.as_str())).collect();
        let camera = central(DVec3::new(0.8, 1.6, 4.6), 0.7);
        let picture = Easel::with_channels(&scene, camera, [43, 29], &settings, Channels::ALL).picture();
        assert_eq!(picture.count_not_finite(), 0, "{settings:?}");
    }
}
