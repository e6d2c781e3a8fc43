//! Are lines where edges are, and are hidden ones hidden?

use super::{camera, cube, draw_with, plane, scene_of, triangle};
use crate::Raster;
use crate::lens::Lens;
use glam::{DVec3, Vec3};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::scene::{Background, Light, Mesh, Scene, Shape};
use polyptych_core::seam::{Control, Need, Renderer};
use std::sync::Arc;

/// The picture of a cube seen from a corner, on white paper.
fn corner_view(mode: &str) -> (Framebuffer, Lens) {
    let mut scene = scene_of(vec![(cube(1.0), [0.0; 3])]);
    scene.environment.background = Background::Solid(Vec3::ONE);
    let camera = camera([2.0, 1.5, 2.5], [0.0; 3]);
    let lens = Lens::of_camera(&camera, 160, 120, 1e-6).unwrap();
    (draw_with(&scene, camera, 160, 120, &[("mode", mode)]), lens)
}

/// Counts the points along the way between two corners of the cube that show a line.
fn inked(picture: &Framebuffer, lens: &Lens, from: [f64; 3], to: [f64; 3]) -> f64 {
    let (from, to) = (DVec3::from_array(from) * 0.5, DVec3::from_array(to) * 0.5);
    let shown = (0..=100).filter(|&i| {
        let (x, y, _) = lens.place(from.lerp(to, f64::from(i) / 100.0) - lens.origin);
        picture.color()[y as usize * 160 + x as usize].x < 0.9
    });
    shown.count() as f64 / 101.0
}

/// The corners at the ends of an edge.
type Ends = [[f64; 3]; 2];

/// The edges of a cube whose middle edges can be seen from its corner 1, 1, 1, and those that meet at the far one.
fn edges() -> (Vec<Ends>, Vec<Ends>) {
    let mut all = Vec::new();
    for axis in 0..3 {
        for (u, v) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let end = |w: f64| {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (w, u, v);
                p
            };
            all.push([end(-1.0), end(1.0)]);
        }
    }
    all.into_iter().partition(|[a, _]| a.iter().filter(|&&c| c > 0.0).count() > 0)
}

#[test]
fn of_a_cube_nine_edges_are_seen_and_three_hidden() {
    let (seen, hidden) = edges();
    assert_eq!((seen.len(), hidden.len()), (9, 3));
    let (picture, lens) = corner_view("hidden-line");
    for [a, b] in &seen {
        assert!(inked(&picture, &lens, *a, *b) > 0.97, "{a:?} {b:?}: {}", inked(&picture, &lens, *a, *b));
    }
    for [a, b] in &hidden {
        assert!(inked(&picture, &lens, *a, *b) < 0.15, "{a:?} {b:?}: {}", inked(&picture, &lens, *a, *b));
    }
    let (picture, lens) = corner_view("wireframe");
    for [a, b] in seen.iter().chain(&hidden) {
        assert!(inked(&picture, &lens, *a, *b) > 0.97, "{a:?} {b:?}");
    }
    // Nothing but lines: a cube of triangles has no diagonals.
    let share = picture.color().iter().filter(|c| c.x < 0.9).count() as f64 / (160.0 * 120.0);
    assert!(share < 0.08, "{share}");
    assert_eq!(picture.count_not_finite(), 0);
}

#[test]
fn bodies_show_where_they_cross() {
    let mut scene = scene_of(vec![(cube(1.0), [0.0; 3]), (plane(4.0), [0.0, 0.1, 0.0])]);
    scene.environment.background = Background::Solid(Vec3::ONE);
    let camera = camera([0.0, 2.0, 4.0], [0.0; 3]);
    let lens = Lens::of_camera(&camera, 160, 120, 1e-6).unwrap();
    let picture = draw_with(&scene, camera, 160, 120, &[("mode", "hidden-line")]);
    let (a, b) = ([-0.9, 0.2, 1.0], [0.9, 0.2, 1.0]);
    assert!(inked(&picture, &lens, a, b) > 0.97, "the plane crosses the front at a height of 0.1");
    let (a, b) = ([-0.9, 0.6, 1.0], [0.9, 0.6, 1.0]);
    assert!(inked(&picture, &lens, a, b) < 0.03, "nothing is above");
}

#[test]
fn segments_are_lines_and_surfaces_hide_them() {
    let segments = |z: f32| {
        let positions = vec![Vec3::new(-1.0, 0.0, z), Vec3::new(1.0, 0.0, z)];
        Shape::Mesh(Mesh { positions, segments: vec![[0, 1]], ..Mesh::default() })
    };
    let wall = triangle([[-3.0, -3.0, 0.0], [3.0, -3.0, 0.0], [0.0, 4.0, 0.0]]);
    let inks = |z: f32, mode: &str| {
        let mut scene: Scene = scene_of(vec![(segments(z), [0.0; 3]), (Shape::Mesh(wall.clone()), [0.0; 3])]);
        scene.environment.background = Background::Solid(Vec3::ONE);
        let picture = draw_with(&scene, camera([0.0, 0.0, 4.0], [0.0; 3]), 80, 60, &[("mode", mode)]);
        picture.color()[30 * 80 + 30..30 * 80 + 50].iter().filter(|c| c.x < 0.9).count()
    };
    assert_eq!(inks(0.5, "hidden-line"), 20, "before the wall");
    assert_eq!(inks(-0.5, "hidden-line"), 0, "behind the wall");
    assert_eq!(inks(-0.5, "wireframe"), 20, "through the wall");
}

#[test]
fn gouraud_is_exact_at_corners_and_flat_has_one_tone() {
    let mut mesh = triangle([[-2.0, -1.5, 0.0], [2.0, -1.5, 0.0], [0.0, 2.0, 0.0]]);
    mesh.normals = [[-0.6, 0.0, 0.8], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8]].map(Vec3::from_array).into();
    let mut scene = scene_of(vec![(Shape::Mesh(mesh), [0.0; 3])]);
    scene.lights.push(Light::directional(DVec3::new(0.3, -0.5, -1.0)));
    let draw = |shading: &str| {
        let settings = [("shading", shading), ("lighting", "lambert"), ("mode", "lit")];
        draw_with(&scene, camera([0.0, 0.0, 4.0], [0.0; 3]), 81, 61, &settings)
    };
    let [phong, gouraud, flat] = ["phong", "gouraud", "flat"].map(draw);
    let inside: Vec<usize> = (0..81 * 61).filter(|&i| phong.id()[i] == 1).collect();
    assert!(inside.len() > 1000);
    let tone = flat.color()[inside[0]];
    assert!(inside.iter().all(|&i| (flat.color()[i] - tone).length() < 1e-6));
    let difference = |i: usize| (phong.color()[i] - gouraud.color()[i]).length();
    let (most, corner) = (inside.iter().map(|&i| difference(i)).fold(0.0, f32::max), difference(inside[0]));
    assert!(most > 0.01, "a bent surface is not linear between its corners: {most}");
    assert!(corner < most / 4.0, "near the corner at the top both are the same: {corner} of {most}");
}

#[test]
fn modes_go_over_into_one_another_without_new_models_or_maps() {
    let mut scene = scene_of(vec![(cube(1.0), [0.0; 3]), (plane(4.0), [0.0, -0.5, 0.0])]);
    scene.lights.push(Light::directional(DVec3::new(0.3, -0.5, -1.0)));
    let (scene, control) = (Arc::new(scene), Control::simple());
    let mut need = Need { channels: Channels::ALL, ..Need::new(camera([2.0, 1.5, 2.5], [0.0; 3]), 40, 30) };
    let mut raster = Raster::new();
    let declared = raster.info().parameters.clone();
    raster.prepare(&scene, &need, &Converter::default(), &control).unwrap();
    let (model, maps) = (raster.model_in_use().unwrap(), raster.shadows().unwrap());
    for mode in ["lit", "hidden-line", "wireframe", "shadowed"] {
        need.settings.set("raster", &declared, "mode", mode).unwrap();
        raster.prepare(&scene, &need, &Converter::default(), &control).unwrap();
        assert!(Arc::ptr_eq(&model, &raster.model_in_use().unwrap()), "{mode}");
        assert_eq!(raster.shadows().is_some(), mode == "shadowed");
    }
    assert!(Arc::ptr_eq(&maps, &raster.shadows().unwrap()));
}
