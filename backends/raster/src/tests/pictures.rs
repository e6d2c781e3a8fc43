//! Do distance, attributes and layers agree with what a ray sees?

use super::{camera, cube, draw, plane, scene_of, triangle};
use glam::{DVec3, Vec2, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::math::Aabb;
use polyptych_core::scene::{
    AlphaMode, Background, Material, Mesh, Object, Scene, Shape, Texture, TextureWrap,
};

/// Visits the ray and the index of every pixel.
fn for_each_ray(
    camera: &Camera,
    picture: &Framebuffer,
    mut visit: impl FnMut(usize, polyptych_core::math::Ray),
) {
    let view = camera.view(picture.width(), picture.height());
    for y in 0..picture.height() {
        for x in 0..picture.width() {
            if let Some(ray) = view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5) {
                visit((y * picture.width() + x) as usize, ray);
            }
        }
    }
}

#[test]
fn distances_to_a_box_and_a_plane_are_those_of_closed_forms() {
    let scene = scene_of(vec![(cube(1.0), [0.2, 0.1, -0.3]), (plane(40.0), [0.0, -0.5, 0.0])]);
    for projection in [Projection::Perspective { fov_y: 0.8 }, Projection::Orthographic { height: 3.0 }] {
        let camera = Camera { projection, ..camera([1.5, 1.2, 3.0], [0.0; 3]) };
        let picture = draw(&scene, camera.clone(), 121, 83);
        let bounds = Aabb::new(DVec3::splat(-0.5), DVec3::splat(0.5));
        let (mut worst, mut boxes, mut planes) = (0.0_f64, 0, 0);
        for_each_ray(&camera, &picture, |i, ray| {
            let distance = f64::from(picture.distance()[i]);
            let truth = match picture.id()[i] {
                1 => {
                    boxes += 1;
                    let Some((near, _)) = bounds.clip(ray.origin - DVec3::new(0.2, 0.1, -0.3), ray.direction)
                    else {
                        return; // a corner snapped over the pixel's center
                    };
                    near
                }
                2 => {
                    planes += 1;
                    (-0.5 - ray.origin.y) / ray.direction.y
                }
                _ => return,
            };
            worst = worst.max((distance / truth - 1.0).abs());
        });
        assert!(boxes > 800 && planes > 3000, "{boxes} {planes}");
        assert!(worst < 1e-5, "{worst}");
    }
}

#[test]
fn of_equal_depths_the_lower_object_wins_whatever_the_order() {
    let corners = [[-2.0, -1.0, 0.3], [2.0, -1.0, -0.4], [0.0, 2.0, 0.9]];
    let turned = [corners[1], corners[2], corners[0]];
    let shapes = [corners, turned].map(|c| (Shape::Mesh(triangle(c)), [0.0; 3]));
    for order in [[0, 1], [1, 0]] {
        let scene = scene_of(order.map(|i| shapes[i].clone()).to_vec());
        let picture = draw(&scene, camera([0.3, 0.4, 5.0], [0.0; 3]), 97, 61);
        let count = |id: u32| picture.id().iter().filter(|&&i| i == id).count();
        assert!(count(1) > 500 && count(2) == 0, "{} {}", count(1), count(2));
    }
}

/// A floor with texture coordinates equal to x and z.
fn textured_floor(texture: Texture) -> Scene {
    let mut scene = Scene::default();
    let texture = Some(scene.add_texture(texture));
    let material = scene.add_material(Material { texture, ..Material::new(Vec3::ONE) });
    let corners = [[-9.0, 9.0], [9.0, 9.0], [9.0, -90.0], [-9.0, -90.0]];
    let mesh = Mesh {
        positions: corners.map(|[x, z]| Vec3::new(x, 0.0, z)).into(),
        uvs: corners.map(Vec2::from_array).into(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    scene.objects.push(Object::new("floor", Shape::Mesh(mesh), material));
    scene
}

#[test]
fn texture_coordinates_are_right_in_perspective() {
    // A texture whose color is a ramp over u, read between the middles of its first and last texel.
    let ramp: Vec<u8> = (0..256).flat_map(|i| [i as u8, i as u8, i as u8, 255]).collect();
    let texture = Texture::from_srgb8("ramp", 256, 1, &ramp);
    let scene = textured_floor(texture.clone());
    let camera = camera([0.0, 0.7, 4.0], [0.3, 0.4, 0.0]);
    let picture = draw(&scene, camera.clone(), 100, 100);
    let mut checked = 0;
    for_each_ray(&camera, &picture, |i, ray| {
        let near = ray.direction.y < -0.15;
        if near && picture.id()[i] == 1 {
            let hit = ray.at(-ray.origin.y / ray.direction.y);
            let wanted = texture.sample([hit.x as f32, hit.z as f32], 0.0).x;
            let turns_over = (hit.x - hit.x.floor() - 0.5).abs() > 0.4;
            if !turns_over {
                checked += 1;
                // One texel of the ramp is at least 1e-4 here; at the near end of the floor mips do not matter.
                assert!((picture.albedo()[i].x - wanted).abs() < 2e-2, "{:?} {wanted}", picture.albedo()[i]);
            }
        }
    });
    assert!(checked > 1000, "{checked}");
}

#[test]
fn weights_agree_with_rays_to_a_thousandth_of_a_texel() {
    use crate::face::Face;
    use crate::lens::Lens;
    use crate::model::{Model, Source};
    let scene = textured_floor(Texture::from_srgb8("white", 1, 1, &[255; 4]));
    let mut model = Model::default();
    assert!(model.add(&scene, 0, Source::Given(scene.objects[0].shape.clone()), None));
    let camera = camera([0.0, 0.05, 4.0], [0.0, 0.0, -30.0]);
    let lens = Lens::of_camera(&camera, 640, 480, 1e-6).unwrap();
    let face = Face::new(&model, &lens, 0);
    for (x, y) in [(320.5, 260.5), (10.5, 479.5), (600.5, 241.5), (320.5, 240.5)] {
        let direction = lens.line(x, y).1;
        let met = face.meet(&lens, x, y);
        let truth = camera.eye + direction * (-camera.eye.y / direction.y);
        if truth.z > -80.0 && truth.x < truth.z * -0.1 - 0.1 {
            assert!(met.held.is_none(), "the ray passes through the triangle");
            let off = (camera.eye + direction * met.t - truth).length();
            assert!(off * 1024.0 < 1e-3, "{off} at {truth}");
        }
    }
}

#[test]
fn grazing_textures_fade_to_their_mean() {
    let checker: Vec<u8> = (0..64)
        .flat_map(|i: u32| [if (i / 8 + i).is_multiple_of(2) { 255 } else { 0 }; 3].into_iter().chain([255]))
        .collect();
    let scene = textured_floor(Texture::from_srgb8("checker", 8, 8, &checker));
    let picture = draw(&scene, camera([0.0, 0.3, 9.0], [0.0, 0.3, 0.0]), 100, 100);
    let far: Vec<f32> = (52 * 100 + 45..52 * 100 + 55).map(|i| picture.albedo()[i].x).collect();
    assert!(far.iter().all(|v| (v - 0.5).abs() < 0.01), "{far:?}");
}

#[test]
fn grazing_stripes_that_run_away_stay_sharp() {
    // Half a meter wide, which is four pixels there, of which each is five meters long.
    let stripes: Vec<u8> = (0..8).flat_map(|i: u8| [[255; 4], [0, 0, 0, 255]][usize::from(i % 2)]).collect();
    let scene = textured_floor(Texture::from_srgb8("stripes", 2, 4, &stripes));
    let picture = draw(&scene, camera([0.0, 0.3, 9.0], [0.0, 0.3, 0.0]), 100, 100);
    let row: Vec<f32> = (52 * 100 + 40..52 * 100 + 60).map(|i| picture.albedo()[i].x).collect();
    let [least, most] = [row.iter().copied().fold(1.0, f32::min), row.iter().copied().fold(0.0, f32::max)];
    // Between the middles of two texels their colors are mixed.
    assert!(least < 0.15 && most > 0.85, "{row:?}");
}

#[test]
fn beyond_a_border_that_is_drawn_out_nothing_but_the_border_is_seen() {
    let at_border = |i: usize| [0, 7].contains(&(i % 8)) || [0, 7].contains(&(i / 8));
    let framed: Vec<u8> =
        (0..64).flat_map(|i| [[0, 0, 0, 255], [255; 4]][usize::from(at_border(i))]).collect();
    let mut texture = Texture::from_srgb8("frame", 8, 8, &framed);
    texture.wrap = [TextureWrap::Clamp; 2];
    let scene = textured_floor(texture);
    let camera = camera([4.0, 0.3, 9.0], [4.0, 0.3, 0.0]);
    let picture = draw(&scene, camera.clone(), 100, 100);
    let mut checked = 0;
    for_each_ray(&camera, &picture, |i, ray| {
        let hit = ray.at(-ray.origin.y / ray.direction.y);
        if picture.id()[i] == 1 && !(-0.5..1.5).contains(&hit.x) {
            checked += 1;
            assert!(picture.albedo()[i].x > 0.999, "{hit}: {}", picture.albedo()[i]);
        }
    });
    assert!(checked > 2000, "{checked}");
}

#[test]
fn layers_are_blended_front_to_back_in_any_order() {
    let quad = |z: f64, material: usize| {
        let positions = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]];
        let mesh = Mesh {
            positions: positions.map(|[x, y]| Vec3::new(x, y, 0.0)).into(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        };
        Object::new("quad", Shape::Mesh(mesh), material).at(DVec3::new(0.0, 0.0, z))
    };
    let glow = |color: Vec3, opacity: f32| Material {
        emission: color,
        ambient: 0.0,
        opacity,
        ..Material::new(Vec3::ZERO)
    };
    let mut scene = Scene::default();
    scene.environment.background = Background::Solid(Vec3::new(0.0, 0.0, 1.0));
    scene.materials =
        vec![glow(Vec3::X, 0.5), glow(Vec3::Y, 0.25), glow(Vec3::ONE, 1.0), glow(Vec3::ONE, 0.5)];
    let quads = [quad(1.0, 0), quad(0.0, 1), quad(-1.0, 2), quad(-2.0, 3)];
    // 0.5 red, then 0.25 of the rest green, then white hides the last.
    let wanted = Vec3::new(0.5, 0.0, 0.0) + Vec3::Y * 0.125 + Vec3::splat(0.375);
    for order in [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]] {
        scene.objects = order.iter().map(|&i| quads[i].clone()).collect();
        let picture = draw(&scene, camera([0.3, 0.2, 6.0], [0.0; 3]), 64, 48);
        let place = order.iter().position(|&i| i == 0).unwrap() as u32 + 1;
        assert!(picture.color().iter().all(|c| (*c - wanted).length() < 1e-6), "{:?}", picture.color()[0]);
        assert!(picture.id().iter().all(|&id| id == place), "the nearest layer is what is seen");
        assert!(picture.coverage().iter().all(|&c| c == 1.0));
    }
    scene.objects = vec![quads[1].clone(), quads[0].clone()];
    let wanted = Vec3::new(0.5, 0.125, 0.375);
    let picture = draw(&scene, camera([0.3, 0.2, 6.0], [0.0; 3]), 64, 48);
    assert!(picture.color().iter().all(|c| (*c - wanted).length() < 1e-6), "{:?}", picture.color()[0]);
}

#[test]
fn holes_of_masked_textures_are_looked_through() {
    let half = Texture::from_srgb8("half", 2, 1, &[255, 255, 255, 255, 255, 255, 255, 0]);
    let mut scene = textured_floor(half);
    scene.materials[0].alpha = AlphaMode::Mask(0.5);
    let gray = scene.add_material(Material::default());
    scene.objects.push(Object::new("below", plane(200.0), gray).at(DVec3::new(0.0, -1.0, 0.0)));
    let mut camera = camera([0.0, 5.0, 0.01], [0.0; 3]);
    camera.projection = Projection::Orthographic { height: 4.0 };
    let picture = draw(&scene, camera.clone(), 200, 200);
    let mut wrong = 0;
    for_each_ray(&camera, &picture, |i, ray| {
        let hit = ray.at(-ray.origin.y / ray.direction.y);
        let u = hit.x - hit.x.floor();
        // Alpha falls through one half at u = 0.5 and u = 0 (the texture repeats).
        let solid = u < 0.5;
        let border = [0.0, 0.5, 1.0].iter().any(|b| (u - b).abs() < 0.02);
        wrong += usize::from(!border && (picture.id()[i] == 1) != solid);
    });
    assert_eq!(wrong, 0);
}

#[test]
fn bent_cameras_see_all_around() {
    let scene = scene_of(vec![(cube(10.0), [0.0; 3])]);
    let view = |projection| Camera { projection, ..camera([1.0, 0.5, -0.3], [0.0, 0.0, -9.0]) };
    for projection in [
        Projection::Fisheye { fov: 6.2 },
        Projection::Cylindrical { fov_x: 6.2, fov_y: 2.0 },
        Projection::Perspective { fov_y: 2.0 },
    ] {
        let camera = view(projection);
        let picture = draw(&scene, camera.clone(), 90, 70);
        let bounds = Aabb::new(DVec3::splat(-5.0), DVec3::splat(5.0));
        let (mut worst, mut seen) = (0.0_f64, 0);
        for_each_ray(&camera, &picture, |i, ray| {
            let (_, far) = bounds.clip(ray.origin, ray.direction).unwrap();
            seen += 1;
            assert_eq!(picture.id()[i], 1, "pixel {i} of {:?}", camera.projection);
            worst = worst.max((f64::from(picture.distance()[i]) / far - 1.0).abs());
        });
        assert!(seen > 3500 && worst < 0.1, "{seen} {worst}");
    }
}
