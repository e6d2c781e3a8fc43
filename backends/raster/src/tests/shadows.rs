//! Is what a light sees lit, and nothing else?

use super::{Random, camera, cube, draw, draw_with, plane, scene_of};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::math::Aabb;
use polyptych_core::scene::{Light, LightKind, Mesh, Primitive, Scene, Shape};

fn share_in_shadow(picture: &Framebuffer) -> f64 {
    let seen = picture.id().iter().filter(|&&id| id > 0).count();
    let dark = picture.id().iter().zip(picture.shadow()).filter(|&(&id, &s)| id > 0 && s < 1.0).count();
    dark as f64 / seen.max(1) as f64
}

/// A square in the xz plane of many triangles with shaken corners.
fn crumbs(cells: u32) -> Shape {
    let (mut mesh, mut random) = (Mesh::default(), Random(3));
    for i in 0..(cells + 1) * (cells + 1) {
        let (x, z) = (i % (cells + 1), i / (cells + 1));
        let mut shaken = |v: u32| (f64::from(v) + (random.next() - 0.5) * 0.6) / f64::from(cells) * 4.0 - 2.0;
        mesh.positions.push(Vec3::new(shaken(x) as f32, 0.0, shaken(z) as f32));
    }
    for row in 0..cells {
        for column in 0..cells {
            let i = row * (cells + 1) + column;
            mesh.triangles.extend([[i, i + cells + 1, i + 1], [i + 1, i + cells + 1, i + cells + 2]]);
        }
    }
    Shape::Mesh(mesh)
}

#[test]
fn a_plane_does_not_shadow_itself_at_any_slope() {
    for shape in [plane(4.0), crumbs(1), crumbs(23)] {
        let mut scene = scene_of(vec![(shape, [0.0; 3])]);
        for slope in [0.0_f64, 15.0, 45.0, 60.0, 75.0, 85.0, 89.0, 89.9] {
            let place = DVec3::new(0.4, 0.2, 0.1);
            let turned = DMat3::from_rotation_x(0.3) * DMat3::from_rotation_z(0.2);
            scene.objects[0].world_from_object = DAffine3::from_mat3_translation(turned, place);
            let s = slope.to_radians();
            let azimuth = DVec3::new(0.5_f64.cos(), 0.0, 0.5_f64.sin());
            let to_light = turned * (azimuth * s.sin() + DVec3::Y * s.cos());
            scene.lights = vec![Light::directional(-to_light), Light::point(place + to_light * 30.0, 100.0)];
            for tier in ["id", "exact", "plain"] {
                let settings = [("shadow.tier", tier)];
                let picture = draw_with(&scene, camera([1.0, 4.0, 3.0], [0.0; 3]), 150, 100, &settings);
                let count = scene.objects[0].shape.bytes();
                assert_eq!(share_in_shadow(&picture), 0.0, "{tier}: slope {slope} of {count} bytes");
            }
        }
    }
}

/// Compares the shadow of a box on a floor with rays against the box; returns (wrong pixels, floor pixels).
fn wrong_on_floor(light: &Light, camera: &Camera, offset: DVec3, tier: &str) -> (usize, usize) {
    let mut scene = scene_of(vec![(plane(12.0), [0.0, 0.0, 0.0]), (cube(1.0), [0.0, 0.5, 0.0])]);
    scene.objects.iter_mut().for_each(|o| o.world_from_object.translation += offset);
    scene.lights = vec![light.clone()];
    let picture = draw_with(&scene, camera.clone(), 240, 160, &[("shadow.tier", tier)]);
    let bounds = Aabb::new(DVec3::new(-0.5, 0.0, -0.5) + offset, DVec3::new(0.5, 1.0, 0.5) + offset);
    let view = camera.view(240, 160);
    let (mut wrong, mut seen) = (0, 0);
    for (i, (&id, &shadow)) in picture.id().iter().zip(picture.shadow()).enumerate() {
        if id != 1 {
            continue;
        }
        let ray = view.ray((i % 240) as f64 + 0.5, (i / 240) as f64 + 0.5).unwrap();
        let point = ray.at((offset.y - ray.origin.y) / ray.direction.y);
        let arriving = light.arriving(point).unwrap();
        let blocked = bounds.clip(point, arriving.to_light).is_some_and(|(near, far)| far > near.max(1e-9));
        seen += 1;
        wrong += usize::from(blocked != (shadow < 0.5));
    }
    (wrong, seen)
}

#[test]
fn the_shadow_of_a_box_begins_at_the_box() {
    let camera = camera([2.5, 2.0, 3.0], [0.3, 0.2, 0.2]);
    let directions = [[-0.5, -1.0, -0.3], [0.7, -0.2, 0.4], [-1.0, -1.0, 0.0], [0.3, -0.05, 1.0]];
    let places = [[2.0, 3.0, 1.0], [-0.2, 1.6, 0.9], [4.0, 0.4, -2.0]];
    let suns = directions.map(|direction| Light::directional(DVec3::from_array(direction)));
    let lamps = places.map(|place| Light::point(DVec3::from_array(place), 9.0));
    for light in suns.iter().chain(&lamps) {
        for (tier, most) in [("id", 0.0), ("exact", 0.0), ("plain", 0.01)] {
            let (wrong, seen) = wrong_on_floor(light, &camera, DVec3::ZERO, tier);
            let share = wrong as f64 / seen as f64;
            assert!(seen > 10_000 && share <= most, "{tier}: {wrong} of {seen} for {:?}", light.kind);
        }
    }
}

#[test]
fn far_from_the_origin_shadows_are_as_good() {
    let offset = DVec3::new(3e5, -2e5, 1e5);
    let mut camera = camera([2.5, 2.0, 3.0], [0.3, 0.2, 0.2]);
    camera.eye += offset;
    for tier in ["id", "exact"] {
        let sun = Light::directional(DVec3::new(-0.5, -1.0, -0.3));
        let (wrong, seen) = wrong_on_floor(&sun, &camera, offset, tier);
        assert!(seen > 10_000 && wrong == 0, "{tier}: {wrong} of {seen}");
    }
}

fn ball_under(light: Light, radius: f64) -> Scene {
    let mut scene = scene_of(vec![(Shape::Primitive(Primitive::Sphere { radius }), [0.0; 3])]);
    scene.lights = vec![light];
    scene
}

#[test]
fn a_ball_is_lit_on_all_faces_that_look_at_the_light() {
    let lights = [
        Light::directional(DVec3::new(-0.5, -1.0, -0.7)),
        Light::point(DVec3::new(2.0, 3.0, 2.5), 10.0),
        Light {
            kind: LightKind::Spot {
                position: DVec3::new(2.0, 3.0, 2.5),
                direction: DVec3::new(-2.0, -3.0, -2.5),
                inner: 0.5,
                outer: 0.6,
            },
            ..Light::point(DVec3::ZERO, 10.0)
        },
    ];
    for light in lights {
        let scene = ball_under(light.clone(), 1.0);
        let mut lit = 0;
        for eye in [[0.0, 0.0, 4.0], [3.0, 2.0, 2.0], [-2.0, 3.0, -1.0]] {
            let camera =
                Camera { projection: Projection::Orthographic { height: 2.2 }, ..camera(eye, [0.0; 3]) };
            let picture = draw(&scene, camera.clone(), 200, 200);
            let view = camera.view(200, 200);
            for (i, (&shadow, &distance)) in picture.shadow().iter().zip(picture.distance()).enumerate() {
                if !distance.is_finite() {
                    continue;
                }
                let ray = view.ray((i % 200) as f64 + 0.5, (i / 200) as f64 + 0.5).unwrap();
                let point = ray.at(f64::from(distance));
                let Some(arriving) = light.arriving(point) else { continue };
                // Facets differ from the ball by some degrees.
                let cosine = point.normalize_or_zero().dot(arriving.to_light);
                if cosine > 0.15 {
                    lit += 1;
                    assert_eq!(shadow, 1.0, "pixel {i} from {eye:?}, cosine {cosine}");
                } else if cosine < -0.15 {
                    assert_eq!(shadow, 0.0, "pixel {i} from {eye:?}, cosine {cosine}");
                }
            }
        }
        assert!(lit > 20_000, "{lit}");
    }
}

#[test]
fn clear_things_and_lights_without_shadow_block_nothing() {
    let light = Light::directional(DVec3::new(-0.5, -1.0, -0.3));
    let mut scene = scene_of(vec![(plane(12.0), [0.0; 3]), (cube(1.0), [0.0, 0.6, 0.0])]);
    let camera = camera([-2.5, 5.0, -3.0], [0.0; 3]);
    let dark = |scene: &Scene| {
        let picture = draw(scene, camera.clone(), 120, 80);
        picture.id().iter().zip(picture.shadow()).filter(|&(&id, &s)| id == 1 && s < 1.0).count()
    };
    scene.lights = vec![light.clone()];
    assert!(dark(&scene) > 100);
    scene.lights[0].casts_shadow = false;
    assert_eq!(dark(&scene), 0);
    scene.lights[0].casts_shadow = true;
    let glass = scene.add_material(polyptych_core::scene::Material { opacity: 0.5, ..Default::default() });
    scene.objects[1].materials = vec![glass];
    assert_eq!(dark(&scene), 0);
}

#[test]
fn a_floor_under_everything_takes_no_texels() {
    use crate::casters::Casters;
    use crate::model::{Model, Source};
    let model_of = |floor_at: f64| {
        let scene = scene_of(vec![(crumbs(9), [0.0, floor_at, 0.0]), (tetrahedron(), [0.0, 0.0, 0.0])]);
        let mut model = Model::default();
        for (i, object) in scene.objects.iter().enumerate() {
            assert!(model.add(&scene, i, Source::Given(object.shape.clone()), None));
        }
        model
    };
    let height = |floor_at: f64, kind: LightKind| {
        let model = model_of(floor_at);
        Casters::of(&model, 1e-6).of_light(&model, &kind, None).0.size().x
    };
    let sun = |y: f64| LightKind::Directional { direction: DVec3::new(0.3, y, 0.1) };
    assert!(height(-0.5, sun(-1.0)) < 1.1, "only the tetrahedron");
    assert!(height(-0.5, sun(1.0)) > 3.5, "the floor is between");
    assert!(height(0.2, sun(-1.0)) > 3.5, "it reaches through the floor");
    assert!(height(-0.5, LightKind::Point { position: DVec3::new(0.0, -0.4, 1.0) }) < 1.1);
    assert!(height(-0.5, LightKind::Point { position: DVec3::new(0.0, -0.6, 1.0) }) > 3.5);
}

/// A tetrahedron half a meter below and above the origin.
fn tetrahedron() -> Shape {
    let corners = [[-0.5, -0.5, -0.5], [0.5, -0.5, -0.5], [0.0, -0.5, 0.5], [0.0, 0.5, 0.0]];
    Shape::Mesh(Mesh {
        positions: corners.map(Vec3::from_array).into(),
        triangles: vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]],
        ..Mesh::default()
    })
}

#[test]
fn exact_shadows_of_crumbs_are_those_of_rays() {
    // Far smaller than a texel, in front of a wall: each point of it is held against every crumb.
    let (mut mesh, mut random) = (Mesh::default(), Random(8));
    for i in 0..3000 {
        let mut around = |size: f64| (random.next() - 0.5) * size;
        let at = DVec3::new(around(2.0), around(2.0), 1.0 + around(1.0));
        for _ in 0..3 {
            let corner = at + DVec3::new(around(0.09), around(0.09), around(0.09));
            mesh.positions.push(corner.as_vec3());
        }
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let corners: Vec<[DVec3; 3]> =
        mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize].as_dvec3())).collect();
    let wall = Shape::Primitive(Primitive::Box { size: DVec3::new(3.0, 3.0, 0.5) });
    let mut scene = scene_of(vec![(wall, [0.0, 0.0, -0.25]), (Shape::Mesh(mesh), [0.0; 3])]);
    let camera = camera([3.5, 0.5, 2.5], [0.0; 3]);
    let view = camera.view(120, 90);
    for light in
        [Light::directional(DVec3::new(0.1, -0.2, -1.0)), Light::point(DVec3::new(0.3, 0.2, 4.0), 9.0)]
    {
        scene.lights = vec![light.clone()];
        let wrong = |tier: &str| {
            let settings = [("shadow.tier", tier), ("shadow.map_size", "256")];
            let picture = draw_with(&scene, camera.clone(), 120, 90, &settings);
            let (mut wrong, mut dark) = (0, 0);
            for (i, (&id, &shadow)) in picture.id().iter().zip(picture.shadow()).enumerate() {
                if id != 1 {
                    continue;
                }
                let ray = view.ray((i % 120) as f64 + 0.5, (i / 120) as f64 + 0.5).unwrap();
                let point = ray.at(-ray.origin.z / ray.direction.z);
                if point.x.abs() >= 1.5 || point.y.abs() >= 1.5 {
                    continue;
                }
                let to_light = light.arriving(point).unwrap().to_light;
                let is_crossed = |[a, b, c]: &[DVec3; 3]| {
                    let [a, b, c] = [*a - point, *b - point, *c - point];
                    let sides = [b.cross(c), c.cross(a), a.cross(b)].map(|n| n.dot(to_light) >= 0.0);
                    sides == [true; 3] || sides == [false; 3]
                };
                let blocked = corners.iter().any(is_crossed);
                wrong += usize::from(blocked != (shadow < 0.5));
                dark += usize::from(blocked);
            }
            assert!(dark > 500, "{dark} dark pixels");
            wrong
        };
        assert_eq!(wrong("exact"), 0);
        assert!(wrong("id") > 0, "a map has too few texels for them");
    }
}

#[test]
fn shadows_are_exact_where_texels_would_be_larger_than_pixels() {
    let mut scene = scene_of(vec![(plane(6.0), [0.0; 3]), (cube(1.0), [0.0, 0.9, 0.0])]);
    for light in
        [Light::directional(DVec3::new(-0.5, -1.0, -0.3)), Light::point(DVec3::new(1.0, 3.0, 2.0), 9.0)]
    {
        scene.lights = vec![light];
        for (height, suited) in [(20, "id"), (500, "exact")] {
            let picture = |tier: &str| {
                let settings = [("shadow.tier", tier), ("shadow.map_size", "256")];
                draw_with(&scene, camera([2.5, 2.0, 3.0], [0.0; 3]), height, height, &settings)
            };
            assert!(picture("auto").same_bits(&picture(suited)), "{height} rows");
            assert!(!picture("exact").same_bits(&picture("plain")));
        }
    }
}
