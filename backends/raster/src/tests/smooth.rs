//! Are edges smooth, and is everything else as it was?

use super::{camera, cube, draw, draw_with, plane, scene_of, triangle};
use glam::Vec3;
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::scene::{Background, Material, Scene, Shape};

/// Looks at a picture of 40x30 meters, one meter a pixel.
fn flat_view() -> Camera {
    Camera { projection: Projection::Orthographic { height: 30.0 }, ..camera([0.0, 0.0, 9.0], [0.0; 3]) }
}

fn white_on_black(corners: [[f32; 3]; 3]) -> Scene {
    let mut scene = scene_of(vec![(Shape::Mesh(triangle(corners)), [0.0; 3])]);
    scene.environment.background = Background::Solid(Vec3::ZERO);
    scene.materials[0] =
        Material { emission: Vec3::ONE, diffuse: 0.0, ambient: 0.0, ..Material::new(Vec3::ONE) };
    scene
}

#[test]
fn coverage_is_the_area_of_a_pixel_that_a_triangle_takes() {
    // A needle: most of its pixels' centers lie outside.
    let needle = [[-15.3, -7.2, 0.0], [16.1, 3.9, 0.0], [16.2, 4.7, 0.0]];
    let area = f64::from((31.4 * 11.9 - 31.5 * 11.1) / 2.0_f32).abs();
    let scene = white_on_black(needle);
    let mut last = f64::INFINITY;
    for (samples, bound) in [("4", 0.08), ("16", 0.02), ("64", 0.005)] {
        let picture = draw_with(&scene, flat_view(), 40, 30, &[("samples", samples)]);
        let covered: f64 = picture.coverage().iter().map(|&c| f64::from(c)).sum();
        let shown: f64 = picture.color().iter().map(|c| f64::from(c.x)).sum();
        let off = (covered / area - 1.0).abs();
        assert!(off < bound && off < last + 0.01, "{samples} samples: {covered} of {area}");
        assert!((shown - covered).abs() < 1e-3, "{samples} samples: {shown} {covered}");
        last = off;
    }
}

#[test]
fn geometry_and_the_inside_of_faces_stay_as_they_are() {
    let scene = scene_of(vec![(cube(1.0), [0.0; 3]), (plane(4.0), [0.0, -0.5, 0.0])]);
    let view = || camera([2.0, 1.5, 2.5], [0.0; 3]);
    let plain = draw(&scene, view(), 64, 48);
    let smooth = draw_with(&scene, view(), 64, 48, &[("samples", "8")]);
    assert_eq!(plain.id(), smooth.id());
    assert_eq!(plain.distance(), smooth.distance());
    assert_eq!(plain.normal(), smooth.normal());
    let differ = |a: &Framebuffer, b: &Framebuffer| {
        a.color().iter().zip(b.color()).map(|(a, b)| *a != *b).collect::<Vec<_>>()
    };
    let different = differ(&plain, &smooth);
    let count = different.iter().filter(|d| **d).count();
    assert!(count > 20 && count < 64 * 48 / 5, "{count}");
    let far_from_edges = (0..64 * 48usize).filter(|&i| {
        let (x, y) = (i % 64, i / 64);
        let inside = (1..63).contains(&x) && (1..47).contains(&y);
        let like = |n: usize| plain.normal()[n] == plain.normal()[i] && plain.id()[n] == plain.id()[i];
        inside && [i - 1, i + 1, i - 64, i + 64, i - 65, i + 65].into_iter().all(like)
    });
    assert!(far_from_edges.filter(|&i| different[i]).count() == 0);
}

#[test]
fn glass_before_an_edge_is_mixed_place_by_place() {
    // The pane covers the left half of the picture's middle pixel, the wall behind it the right half.
    let half = |left: f32, right: f32, z: f32| {
        Shape::Mesh(polyptych_core::scene::Mesh {
            positions: [[left, -9.0, z], [right, -9.0, z], [right, 9.0, z], [left, 9.0, z]]
                .map(Vec3::from_array)
                .into(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Default::default()
        })
    };
    let mut scene = scene_of(vec![(half(-9.0, 0.5, 1.0), [0.0; 3]), (half(0.5, 9.0, 0.0), [0.0; 3])]);
    scene.environment.background = Background::Solid(Vec3::ZERO);
    let glow = |color: Vec3| Material { emission: color, diffuse: 0.0, ambient: 0.0, ..Material::new(color) };
    let pane = scene.add_material(Material { opacity: 0.5, ..glow(Vec3::X) });
    let wall = scene.add_material(glow(Vec3::Y));
    scene.objects[0].materials = vec![pane];
    scene.objects[1].materials = vec![wall];
    let picture = draw_with(&scene, flat_view(), 40, 30, &[("samples", "16")]);
    let middle = 15 * 40 + 20;
    // Half of the pixel: red through half a pane over black; the other half: green.
    assert!(
        (picture.color()[middle] - Vec3::new(0.25, 0.5, 0.0)).length() < 1e-6,
        "{}",
        picture.color()[middle]
    );
    assert!((picture.color()[middle - 1] - Vec3::new(0.5, 0.0, 0.0)).length() < 1e-6);
    assert_eq!(picture.coverage()[middle], 1.0);
}
