//! Does the picture agree with the reference's picture of the same triangles?

use super::{camera, cube, plane, scene_of};
use crate::Raster;
use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::metrics::{Errors, Gate};
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{
    HeightField, Light, Material, Mesh, NormalMap, Primitive, Scene, Shape, Texture, Voxels,
};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_reference::Reference;
use std::sync::Arc;

fn scene() -> Scene {
    let body = Shape::Primitive;
    let voxels = Voxels::from_fn([5, 4, 5], |x, y, z| u8::from(x.abs_diff(2) + z.abs_diff(2) + y < 4));
    let wave =
        |i: u32| (f64::from(i % 24) * 0.8).sin() as f32 * 0.2 + (f64::from(i / 24) * 0.5).cos() as f32 * 0.2;
    let hills = HeightField::new(24, 24, DVec2::new(2.4, 2.4), (0..24 * 24).map(wave).collect()).unwrap();
    let mut scene = scene_of(vec![
        (plane(30.0), [0.0; 3]),
        (body(Primitive::Sphere { radius: 0.7 }), [-1.2, 0.7, 0.6]),
        (cube(0.9), [0.3, 0.45, 2.4]),
        (body(Primitive::Torus { major: 0.7, minor: 0.25 }), [1.4, 0.95, 0.6]),
        (body(Primitive::Cone { radius: 0.6, height: 1.3 }), [-2.6, 0.65, -0.4]),
        (Shape::Voxels(voxels), [-1.6, 0.0, 2.6]),
        (cube(1.1), [1.4, 0.55, 3.4]),
        (Shape::HeightField(hills), [-3.4, 0.4, 2.6]),
    ]);
    scene.objects[2].world_from_object.matrix3 = DMat3::from_rotation_y(0.6);
    scene.objects[3].world_from_object.matrix3 = DMat3::from_rotation_x(1.1);
    scene.objects[5].world_from_object.matrix3 = DMat3::from_diagonal(DVec3::new(0.15, 0.15, -0.15));
    let colors = [[0.7, 0.1, 0.1], [0.1, 0.5, 0.5], [0.8, 0.6, 0.2]].map(Vec3::from_array);
    for (i, object) in scene.objects.iter_mut().enumerate().skip(1) {
        object.materials = vec![scene.materials.len()];
        let opacity = if i == 6 { 0.4 } else { 1.0 };
        scene.materials.push(Material { opacity, ..Material::new(colors[i % 3]) });
    }
    scene.lights = vec![
        Light { intensity: 0.9, ..Light::directional(DVec3::new(-0.5, -1.0, -0.45)) },
        Light::point(DVec3::new(0.2, 2.6, 1.2), 1.5),
    ];
    scene
}

#[test]
fn pictures_agree_with_the_reference_on_the_same_triangles() {
    let scene = Arc::new(scene());
    let pool = Pool::new(2).unwrap();
    let control = Control::new(&pool);
    for projection in [Projection::Perspective { fov_y: 0.62 }, Projection::Orthographic { height: 5.0 }] {
        let camera = Camera { projection, ..camera([1.5, 4.2, 9.5], [0.0, 0.6, 0.0]) };
        let (width, height) = (320, 200);
        let need = Need { channels: Channels::ALL, ..Need::new(camera, width, height) };
        let mut raster = Raster::new();
        raster.prepare(&scene, &need, &Converter::default(), &control).unwrap();
        let mut picture = Framebuffer::new(width, height, need.channels);
        raster.render(&need.frame(), &mut picture, &control).unwrap();
        let mut reference = Reference::new();
        let model = raster.model().unwrap();
        reference.prepare(&model, &need, &Converter::default(), &control).unwrap();
        let mut truth = Framebuffer::new(width, height, need.channels);
        reference.render(&need.frame(), &mut truth, &control).unwrap();
        show(&picture, &truth);
        let errors = Errors::between(&picture, &truth);
        let verdict = Gate::EDGE_TOLERANT.judge(&errors, u64::from(width * height));
        assert!(verdict.passed, "{:?}\n{errors:?}", verdict.failed);
        assert!(errors.shadow_agreement.unwrap() > 0.9995, "{errors:?}");
        assert!(errors.silhouette_iou.unwrap() > 0.999, "{errors:?}");
    }
}

/// Lists where the pictures differ, for a failing run.
fn show(picture: &Framebuffer, truth: &Framebuffer) {
    let width = picture.width() as usize;
    for i in 0..picture.id().len() {
        let shadow = (picture.shadow()[i] - truth.shadow()[i]).abs() > 0.01;
        let distance = (picture.distance()[i] / truth.distance()[i] - 1.0).abs() > 1e-5;
        if picture.id()[i] != truth.id()[i] || shadow || distance {
            println!(
                "({}, {}): id {} for {}, shadow {} for {}, distance {} for {}, normal {} for {}",
                i % width,
                i / width,
                picture.id()[i],
                truth.id()[i],
                picture.shadow()[i],
                truth.shadow()[i],
                picture.distance()[i],
                truth.distance()[i],
                picture.normal()[i],
                truth.normal()[i],
            );
        }
    }
}

/// A square that stands, of two triangles that share corners, twice as dense in texture coordinates to the right.
fn board() -> Shape {
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.2 * x * y);
    Shape::Mesh(Mesh {
        positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        normals: [-0.2, 0.2, 0.2, -0.2].map(|x| Vec3::new(x, 0.1, 1.0).normalize_or_zero()).to_vec(),
        uvs: [[0.0, 1.0], [2.0, 1.0], [2.0, 0.0], [0.0, 0.0]].map(Vec2::from_array).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    })
}

#[test]
fn normal_maps_turn_normals_as_in_the_reference() {
    let mut random = super::Random(77);
    let texels: Vec<u8> =
        (0..16 * 4).map(|i| 255 - (random.next() * if i % 4 < 2 { 255.0 } else { 90.0 }) as u8).collect();
    // One as it is, one mirrored, one turned away.
    let mut scene = scene_of([-2.2, 0.0, 2.2].map(|x| (board(), [x, 0.0, 0.0])).to_vec());
    let texture = scene.add_texture(Texture::from_linear8("bumps", 4, 4, &texels));
    scene.materials[0].normal_map = Some(NormalMap { texture, scale: 0.8 });
    scene.objects[1].world_from_object.matrix3 = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    scene.objects[2].world_from_object.matrix3 = DMat3::from_rotation_y(2.8);
    scene.lights = vec![Light { intensity: 0.9, ..Light::directional(DVec3::new(-0.5, -1.0, -0.45)) }];
    let (scene, pool) = (Arc::new(scene), Pool::new(2).unwrap());
    let control = Control::new(&pool);
    let need = Need { channels: Channels::ALL, ..Need::new(camera([0.3, 0.4, 5.0], [0.0; 3]), 480, 200) };
    let draw = |renderer: &mut dyn Renderer, need: &Need| {
        renderer.prepare(&scene, need, &Converter::default(), &control).unwrap();
        let mut picture = Framebuffer::new(need.width, need.height, need.channels);
        renderer.render(&need.frame(), &mut picture, &control).unwrap();
        picture
    };
    let (picture, truth) = (draw(&mut Raster::new(), &need), draw(&mut Reference::new(), &need));
    let mut flat = need.clone();
    let declared = Raster::new().info().parameters.clone();
    flat.settings.set("raster", &declared, "shading", "flat").unwrap();
    let flat = draw(&mut Raster::new(), &flat);
    let (mut seen, mut turned, mut others) = ([0; 3], 0, 0);
    for i in 0..truth.id().len() {
        if truth.id()[i] == 0 || picture.id()[i] != truth.id()[i] {
            continue;
        }
        seen[truth.id()[i] as usize - 1] += 1;
        let (normal, color) = (truth.normal()[i], truth.color()[i]);
        turned += usize::from(normal.dot(flat.normal()[i]) < 0.9);
        let same =
            (picture.normal()[i] - normal).length() < 1e-4 && (picture.color()[i] - color).length() < 1e-3;
        others += usize::from(!same);
    }
    // Where a pixel's center is on a diagonal the other triangle may be seen.
    assert!(others <= 2, "{others} pixels differ");
    assert!(seen.iter().all(|&seen| seen > 5000) && turned > 5000, "{seen:?} {turned}");
}
