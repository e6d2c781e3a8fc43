//! Is the whole back end right? Checks against closed forms, and of its promises to the host.

use crate::{Factory, Reference};
use glam::{DAffine3, DVec2, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::parallel::Pool;
use polyptych_core::scene::*;
use polyptych_core::seam::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

fn random(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
}

fn unit(state: &mut u64) -> DVec3 {
    DVec3::new(random(state), random(state), random(state)).normalize_or(DVec3::X)
}

/// A scene whose light is all from one place and whose background is black.
fn dark() -> Scene {
    let mut scene = Scene::default();
    scene.environment.background = Background::Solid(Vec3::ZERO);
    scene.environment.ambient = Vec3::ZERO;
    scene
}

/// A material that shows its own color, whatever the light.
fn glowing(color: Vec3, opacity: f32) -> Material {
    Material {
        emission: color,
        opacity,
        ambient: 0.0,
        diffuse: 0.0,
        specular: 0.0,
        ..Material::new(Vec3::ONE)
    }
}

fn camera(eye: [f64; 3], target: [f64; 3]) -> Camera {
    Camera::look_at(eye.into(), target.into(), DVec3::Y, Projection::Perspective { fov_y: 0.8 })
}

fn draw_with(scene: &Arc<Scene>, need: &Need, control: &Control<'_>) -> Framebuffer {
    let mut renderer = Reference::new();
    renderer.prepare(scene, need, &Converter::default(), control).unwrap();
    let mut picture = Framebuffer::new(need.width, need.height, need.channels);
    renderer.render(&need.frame(), &mut picture, control).unwrap();
    picture
}

fn draw(scene: Scene, camera: Camera, width: u32, height: u32) -> Framebuffer {
    let need = Need { channels: Channels::ALL, ..Need::new(camera, width, height) };
    draw_with(&Arc::new(scene), &need, &Control::simple())
}

/// What the ray of a single orthographic pixel sees.
fn probe(scene: &Arc<Scene>, renderer: &mut Reference, eye: DVec3, direction: DVec3) -> (f64, u32, Vec3) {
    let camera = Camera::look_at(eye, eye + direction, DVec3::Y, Projection::Orthographic { height: 1e-9 });
    let mut picture = Framebuffer::new(1, 1, Channels::ALL);
    let _ = scene;
    renderer.render(&Frame { camera }, &mut picture, &Control::simple()).unwrap();
    (f64::from(picture.distance()[0]), picture.id()[0], picture.color()[0])
}

fn prepared(scene: &Arc<Scene>) -> Reference {
    let need = Need { channels: Channels::ALL, ..Need::new(camera([0.0, 0.0, 5.0], [0.0; 3]), 1, 1) };
    let mut renderer = Reference::new();
    renderer.prepare(scene, &need, &Converter::default(), &Control::simple()).unwrap();
    renderer
}

mod depth {
    use super::*;
    use crate::line::{Line, Span, Start};
    use crate::shapes::Geometry;

    const BODIES: [Primitive; 8] = [
        Primitive::Box { size: DVec3::new(1.0, 2.0, 0.5) },
        Primitive::Sphere { radius: 1.0 },
        Primitive::Cylinder { radius: 0.7, height: 1.5 },
        Primitive::Cone { radius: 0.9, height: 1.3 },
        Primitive::Torus { major: 1.0, minor: 0.3 },
        Primitive::Frustum { sides: 7, lower_radius: 1.0, upper_radius: 0.4, height: 1.2 },
        Primitive::Frustum { sides: 3, lower_radius: 0.0, upper_radius: 1.0, height: 0.8 },
        Primitive::Frustum { sides: 4096, lower_radius: 1.0, upper_radius: 1.0, height: 1.0 },
    ];

    fn line(origin: DVec3, direction: DVec3) -> Line {
        Line { origin, direction, start: Start::Eye }
    }

    fn first(geometry: &Geometry, line: &Line) -> Option<(f64, DVec3)> {
        geometry.first(line, &Span::WHOLE, &mut |_| true).map(|h| (h.t, h.normal.normalize_or_zero()))
    }

    /// A point of the surface with its outward normal: where a ray from the middle of the body comes out.
    fn surface_point(geometry: &Geometry, form: &Form, state: &mut u64) -> (DVec3, DVec3) {
        let Shape::Primitive(body) = &*geometry.shape else { panic!("a primitive") };
        let center = match *body {
            Primitive::Torus { major, .. } => {
                let a = random(state) * 3.2;
                DVec3::new(a.cos(), 0.0, a.sin()) * major
            }
            _ => DVec3::new(0.0, 0.05, 0.0),
        };
        let direction = unit(state);
        // Bisection on the implicit function, which this module does not use for primitives.
        let (mut a, mut b) = (0.0, 0.0);
        while form.value(center + direction * b) >= 0.0 {
            (a, b) = (b, b + 0.05);
        }
        for _ in 0..80 {
            let m = 0.5 * (a + b);
            if form.value(center + direction * m) >= 0.0 { a = m } else { b = m }
        }
        let p = center + direction * a;
        (p, -form.value_and_gradient(p).1.normalize_or_zero())
    }

    #[test]
    fn every_body_is_met_where_its_surface_is_even_from_afar() {
        let mut s = 1234;
        for body in BODIES {
            let geometry = Geometry::new(&Arc::new(Shape::Primitive(body)));
            let form = body.form().unwrap();
            let convex = !matches!(body, Primitive::Torus { .. });
            for distance in [3.0, 1e3, 1e6] {
                for _ in 0..400 {
                    let (point, normal) = surface_point(&geometry, &form, &mut s);
                    let mut direction = unit(&mut s);
                    direction *= -direction.dot(normal).signum();
                    if direction.dot(normal) > -0.01 {
                        continue;
                    }
                    let line = line(point - direction * distance, direction);
                    let (t, n) =
                        first(&geometry, &line).unwrap_or_else(|| panic!("{body:?}: {line:?} missed"));
                    let error = (t - distance) / distance;
                    assert!(error < 1e-9, "{body:?} from {distance}: behind the surface by {error:e}");
                    if convex {
                        assert!(error.abs() < 1e-9, "{body:?} from {distance}: {error:e}");
                        let turn = (n - normal).length();
                        assert!(
                            turn < 1e-4 || form_is_creased(&form, point),
                            "{body:?}: normal off by {turn}"
                        );
                    } else {
                        let size = form.value_and_gradient(line.at(t)).1.length();
                        let off = form.value(line.at(t)).abs() / size;
                        assert!(off < 1e-9 * distance, "{body:?} from {distance}: off by {off:e}");
                    }
                }
            }
        }
    }

    /// Tells whether two faces meet nearby.
    fn form_is_creased(form: &Form, p: DVec3) -> bool {
        let normal = |p: DVec3| form.value_and_gradient(p).1.normalize_or_zero();
        (0..6).any(|i| {
            let step = DVec3::AXES[i % 3] * if i < 3 { 1e-3 } else { -1e-3 };
            (normal(p + step) - normal(p)).length() > 1e-2
        })
    }

    #[test]
    fn a_body_and_its_free_form_are_met_at_the_same_distance() {
        let mut s = 4321;
        for body in BODIES.into_iter().take(7) {
            let geometry = Geometry::new(&Arc::new(Shape::Primitive(body)));
            let form = FreeForm::from_primitive(&body).unwrap();
            let implicit = Geometry::new(&Arc::new(Shape::FreeForm(form)));
            let (mut both, mut one) = (0, 0);
            for i in 0..1500 {
                let distance = [2.5, 40.0, 1e5][i % 3];
                let origin = unit(&mut s) * distance;
                let target = DVec3::new(random(&mut s), random(&mut s), random(&mut s)) * 1.1;
                let line = line(origin, (target - origin).normalize_or(DVec3::X));
                match (first(&geometry, &line), first(&implicit, &line)) {
                    (Some((a, m)), Some((b, n))) => {
                        let slant = m.dot(line.direction).abs().max(1e-4);
                        let error = (a - b).abs() / a * slant;
                        assert!(error < 1e-9, "{body:?}: {a} and {b} for {line:?}");
                        assert!((m - n).length() < 1e-3 || both > 0, "{body:?}: {m} and {n}");
                        both += 1;
                    }
                    (None, None) => {}
                    _ => one += 1,
                }
            }
            assert!(both > 300 && one <= 2, "{body:?}: {both} by both, {one} by one only");
        }
    }

    #[test]
    fn a_torus_has_as_many_crossings_as_by_dense_sampling() {
        let body = Primitive::Torus { major: 1.0, minor: 0.35 };
        let geometry = Geometry::new(&Arc::new(Shape::Primitive(body)));
        let form = body.form().unwrap();
        let mut s = 8;
        let mut four = 0;
        for _ in 0..3000 {
            let origin = unit(&mut s) * 4.0;
            let target = DVec3::new(random(&mut s), 0.3 * random(&mut s), random(&mut s));
            let line = line(origin, (target - origin).normalize_or(DVec3::X));
            let mut found = Vec::new();
            geometry.first(&line, &Span::WHOLE, &mut |h| {
                found.push(h.t);
                false
            });
            let step = 2e-3;
            let inside = |i: i32| form.value(line.at(f64::from(i) * step)) >= 0.0;
            let changes = (0..4000).filter(|&i| inside(i) != inside(i + 1)).count();
            assert!(found.len() >= changes && (found.len() - changes).is_multiple_of(2));
            // More than sampling sees only where a pair is closer than a step.
            if found.len() > changes {
                assert!(found.windows(2).any(|w| w[1] - w[0] < step), "{found:?}");
            }
            assert!(found.windows(2).all(|w| w[0] < w[1]));
            four += usize::from(found.len() == 4);
        }
        assert!(four > 100, "{four}");
    }
}

mod light {
    use super::*;

    #[test]
    fn the_shadow_of_a_ball_is_an_ellipse() {
        // A light along (1, -2, 0) stretches the shadow of a ball over y = 0 to an ellipse.
        let mut scene = dark();
        let material = scene.add_material(Material::default());
        scene.objects.push(Object::new(
            "floor",
            Shape::Primitive(Primitive::Plane { width: 20.0, depth: 20.0 }),
            material,
        ));
        let ball = Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), material);
        scene.objects.push(ball.at(DVec3::new(0.0, 4.0, 0.0)));
        let light = DVec3::new(1.0, -2.0, 0.0).normalize_or_zero();
        scene.lights.push(Light::directional(light));
        let from_above = Camera::look_at(
            DVec3::new(0.0, 2.5, 0.0),
            DVec3::ZERO,
            DVec3::NEG_Z,
            Projection::Orthographic { height: 6.0 },
        );
        let (width, height) = (200, 150);
        let picture = draw(scene, from_above.clone(), width, height);
        let view = from_above.view(width, height);
        let (mut dark, mut wrong) = (0, 0);
        for (i, &shadow) in picture.shadow().iter().enumerate() {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let p = view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5).unwrap().at(2.5);
            let offset = DVec3::new(0.0, 4.0, 0.0) - p;
            let inside = offset.length_squared() - offset.dot(light).powi(2) - 1.0;
            dark += usize::from(shadow == 0.0);
            wrong += usize::from(inside.abs() > 1e-6 && (inside < 0.0) != (shadow == 0.0));
        }
        assert_eq!(wrong, 0);
        let area = dark as f64 * (6.0 / 150.0_f64).powi(2);
        let exact = std::f64::consts::PI * 5.0_f64.sqrt() / 2.0;
        assert!((area / exact - 1.0).abs() < 0.01, "{area} for {exact}");
    }

    #[test]
    fn no_surface_darkens_itself() {
        let heights = (0..40 * 40).map(|i: i32| ((i % 40 - 20).pow(2) + (i / 40 - 20).pow(2)) as f32 * -2e-3);
        let field = HeightField::new(40, 40, DVec2::splat(4.0), heights.collect()).unwrap();
        let shapes = [
            Shape::Primitive(Primitive::Sphere { radius: 1.0 }),
            Shape::Primitive(Primitive::Frustum {
                sides: 50,
                lower_radius: 1.0,
                upper_radius: 0.4,
                height: 1.0,
            }),
            Shape::FreeForm(FreeForm::from_primitive(&Primitive::Sphere { radius: 1.0 }).unwrap()),
            Shape::HeightField(field),
            Shape::Voxels(Voxels::from_fn([3, 3, 3], |_, _, _| 1)),
        ];
        for shape in shapes {
            for far in [0.0, 1e5] {
                let mut scene = dark();
                let material = scene.add_material(Material::default());
                let offset = DVec3::new(far, -far, 0.5 * far);
                scene.objects.push(Object::new("body", shape.clone(), material).at(offset));
                scene.lights.push(Light::directional(DVec3::new(-0.2, -1.0, -0.3)));
                let eye = DVec3::new(3.0, 5.0, 6.0) + offset;
                let projection = Projection::Perspective { fov_y: 0.6 };
                let camera = Camera::look_at(eye, offset + 0.5, DVec3::Y, projection);
                let picture = draw(scene, camera, 90, 70);
                let to_light = Vec3::new(0.2, 1.0, 0.3).normalize_or_zero();
                let mut lit = 0;
                for i in 0..90 * 70 {
                    if picture.id()[i] == 0 {
                        continue;
                    }
                    let facing = picture.normal()[i].dot(to_light);
                    if facing.abs() > 1e-5 {
                        assert_eq!(picture.shadow()[i] == 1.0, facing > 0.0, "{:?} at {far}", shape.kind());
                        lit += usize::from(facing > 0.0);
                    }
                }
                assert!(lit > 300, "{:?}: {lit}", shape.kind());
            }
        }
    }

    #[test]
    fn a_glowing_voxel_lights_the_floor_and_does_not_block_itself() {
        let mut scene = dark();
        let floor = scene.add_material(Material { specular: 0.0, diffuse: 1.0, ..Material::new(Vec3::ONE) });
        let lamp = scene.add_material(glowing(Vec3::new(8.0, 4.0, 2.0), 1.0));
        scene.objects.push(Object::new(
            "floor",
            Shape::Primitive(Primitive::Plane { width: 40.0, depth: 40.0 }),
            floor,
        ));
        let voxel = Object::new("lamp", Shape::Voxels(Voxels::from_bytes([1, 1, 1], &[1])), lamp);
        scene.objects.push(voxel.at(DVec3::new(-0.5, 2.0, -0.5)));
        let scene = Arc::new(scene);
        let mut renderer = prepared(&scene);
        let (_, id, color) = probe(&scene, &mut renderer, DVec3::new(3.0, 1.0, 1.0), DVec3::NEG_Y);
        // The light is at (0, 2.5, 0): d^2 = 9 + 6.25 + 1, cosine 2.5 / d.
        let d2 = 16.25_f64;
        let expected = 8.0 / d2 * 2.5 / d2.sqrt();
        assert_eq!(id, 1);
        assert!((f64::from(color.x) / expected - 1.0).abs() < 1e-5, "{color} for {expected}");
        assert!((color.y / color.x - 0.5).abs() < 1e-6);
    }
}

mod layers {
    use super::*;

    fn sheet(scene: &mut Scene, name: &str, height: f64, material: Material) {
        let material = scene.add_material(material);
        let plane = Shape::Primitive(Primitive::Plane { width: 2.0, depth: 2.0 });
        scene.objects.push(Object::new(name, plane, material).at(DVec3::new(0.0, height, 0.0)));
    }

    #[test]
    fn two_sheets_before_a_wall_add_up_front_to_back() {
        let (red, green, blue) = (Vec3::X, Vec3::Y, Vec3::Z);
        let mut scene = dark();
        sheet(&mut scene, "wall", 0.0, glowing(blue, 1.0));
        sheet(&mut scene, "far", 1.0, glowing(green, 0.5));
        sheet(&mut scene, "near", 2.0, glowing(red, 0.25));
        // Two more in the very place of the wall: the lower object comes first, so they are hidden.
        sheet(&mut scene, "twin", 0.0, glowing(Vec3::ONE, 0.5));
        sheet(&mut scene, "clear", 2.5, glowing(Vec3::ONE, 0.0));
        let scene = Arc::new(scene);
        let (distance, id, color) =
            probe(&scene, &mut prepared(&scene), DVec3::new(0.1, 5.0, 0.2), DVec3::NEG_Y);
        assert_eq!((distance, id), (3.0, 3), "a sheet of opacity 0 is not seen");
        assert!((color - Vec3::new(0.25, 0.375, 0.375)).length() < 1e-6, "{color}");
    }

    #[test]
    fn equal_distances_of_transparent_sheets_are_all_laid_in_order() {
        let mut scene = dark();
        sheet(&mut scene, "a", 0.0, glowing(Vec3::X, 0.5));
        sheet(&mut scene, "b", 0.0, glowing(Vec3::Y, 0.5));
        sheet(&mut scene, "c", 0.0, glowing(Vec3::Z, 1.0));
        let scene = Arc::new(scene);
        let (_, id, color) = probe(&scene, &mut prepared(&scene), DVec3::new(0.1, 5.0, 0.2), DVec3::NEG_Y);
        assert_eq!((id, color), (1, Vec3::new(0.5, 0.25, 0.25)));
    }

    #[test]
    fn a_mirror_mixes_in_what_it_sees_and_fog_counts_both_legs() {
        let mut scene = dark();
        let mirror = Material { reflectivity: 0.75, ..glowing(Vec3::X, 1.0) };
        sheet(&mut scene, "mirror", 0.0, mirror);
        sheet(&mut scene, "ceiling", 3.0, glowing(Vec3::Y, 1.0));
        scene.environment.fog = Some(Fog { color: Vec3::Z, density: 0.1 });
        let scene = Arc::new(scene);
        let (_, id, color) = probe(&scene, &mut prepared(&scene), DVec3::new(0.1, 2.0, 0.2), DVec3::NEG_Y);
        let fade = |leg: f32| (-0.1 * leg).exp();
        let seen = Vec3::Y * fade(3.0) + Vec3::Z * (1.0 - fade(3.0));
        let mixed = Vec3::X * 0.25 + seen * 0.75;
        let expected = mixed * fade(2.0) + Vec3::Z * (1.0 - fade(2.0));
        assert_eq!(id, 1);
        assert!((color - expected).length() < 1e-6, "{color} for {expected}");
    }

    #[test]
    fn a_homogeneous_cloud_lets_through_what_the_exponential_law_says() {
        let mut volume = Volume::new([8, 8, 8], DVec3::splat(0.25), Samples::U8(vec![100; 512])).unwrap();
        let point = TransferPoint { value: 100.0, color: Vec3::ONE, opacity: 0.2 };
        volume.transfer = TransferFunction { points: vec![point], reference_length: 0.5 };
        let mut scene = dark();
        sheet(&mut scene, "wall", -5.0, glowing(Vec3::X, 1.0));
        let material = scene.add_material(Material { ambient: 0.0, diffuse: 0.0, ..Material::default() });
        let scale = DAffine3::from_scale(DVec3::new(1.0, 3.0, 1.0));
        scene.objects.push(Object::new("cloud", Shape::Volume(volume.clone()), material).placed(scale));
        let scene = Arc::new(scene);
        let mut renderer = prepared(&scene);
        let (distance, id, color) = probe(&scene, &mut renderer, DVec3::new(0.1, 7.0, 0.2), DVec3::NEG_Y);
        // The box is 2 long in its own space: four reference lengths.
        let through = 0.8_f64.powf(4.0);
        assert!((f64::from(color.x) - through).abs() < 1e-6, "{color} for {through}");
        assert_eq!(color.y, 0.0);
        // Half is reached after ln 0.5 / ln 0.8 reference lengths of 0.5, three times as long in the world.
        let half = 4.0 + 1.5 * 0.5_f64.ln() / 0.8_f64.ln();
        assert!((distance - half).abs() < 1e-5 && id == 2, "{distance} for {half}");
        // In a ball of radius 0.8 the way is 1.6 long.
        volume.shell = Some(FreeForm::from_primitive(&Primitive::Sphere { radius: 0.8 }).unwrap());
        let mut scene = (*scene).clone();
        scene.objects[1].shape = Arc::new(Shape::Volume(volume));
        let scene = Arc::new(scene);
        let (_, _, color) = probe(&scene, &mut prepared(&scene), DVec3::new(0.0, 7.0, 0.0), DVec3::NEG_Y);
        assert!((f64::from(color.x) - 0.8_f64.powf(3.2)).abs() < 1e-6, "{color}");
    }

    #[test]
    fn two_clouds_in_one_place_are_as_dense_as_both() {
        let mut volume = Volume::new([4, 4, 4], DVec3::splat(0.5), Samples::U8(vec![1; 64])).unwrap();
        let point = TransferPoint { value: 1.0, color: Vec3::ONE, opacity: 0.1 };
        volume.transfer = TransferFunction { points: vec![point], reference_length: 1.0 };
        let mut scene = dark();
        sheet(&mut scene, "wall", -5.0, glowing(Vec3::X, 1.0));
        let material = scene.add_material(Material { ambient: 0.0, diffuse: 0.0, ..Material::default() });
        for height in [0.0, 0.5] {
            let cloud = Object::new("cloud", Shape::Volume(volume.clone()), material);
            scene.objects.push(cloud.at(DVec3::new(0.0, height, 0.0)));
        }
        let scene = Arc::new(scene);
        let (_, _, color) = probe(&scene, &mut prepared(&scene), DVec3::new(0.1, 7.0, 0.2), DVec3::NEG_Y);
        assert!((f64::from(color.x) - 0.9_f64.powf(4.0)).abs() < 1e-6, "{color}");
    }

    #[test]
    fn holes_of_a_mask_are_looked_and_shone_through() {
        let mut scene = dark();
        let rgba = [255, 255, 255, 255, 255, 255, 255, 0];
        let mut texture = Texture::from_srgb8("stripes", 2, 1, &rgba);
        texture.wrap = [TextureWrap::Clamp; 2];
        let texture = Some(scene.add_texture(texture));
        let masked = Material { texture, alpha: AlphaMode::Mask(0.5), ..glowing(Vec3::X, 1.0) };
        sheet(&mut scene, "floor", 0.0, Material::default());
        sheet(&mut scene, "fence", 1.0, masked);
        scene.lights.push(Light::directional(DVec3::NEG_Y));
        let scene = Arc::new(scene);
        let mut renderer = prepared(&scene);
        let mut seen = |x: f64, y: f64| probe(&scene, &mut renderer, DVec3::new(x, y, 0.0), DVec3::NEG_Y);
        assert_eq!(seen(-0.5, 3.0).1, 2, "the fence");
        assert_eq!(seen(0.5, 3.0).1, 1, "the floor through the hole");
        assert_eq!(seen(-0.5, 0.9).2, Vec3::ZERO, "shadow of the fence");
        assert!(seen(0.5, 0.9).2.x > 0.1, "light through the hole");
    }
}

mod seam {
    use super::*;

    /// A bit of everything.
    pub(super) fn everything() -> Scene {
        let mut scene = Scene::default();
        let plain = scene.add_material(Material::default());
        let glass =
            scene.add_material(Material { opacity: 0.4, reflectivity: 0.3, ..Material::new(Vec3::Y) });
        let body = |p: Primitive| Shape::Primitive(p);
        let mut add = |name: &str, shape: Shape, material: usize, x: f64, z: f64| {
            scene.objects.push(Object::new(name, shape, material).at(DVec3::new(x, 0.5, z)));
        };
        add("floor", body(Primitive::Plane { width: 9.0, depth: 9.0 }), plain, 0.0, 0.0);
        add("ball", body(Primitive::Sphere { radius: 0.6 }), glass, -1.0, 0.5);
        add("ring", body(Primitive::Torus { major: 0.6, minor: 0.2 }), plain, 1.0, 0.5);
        let voxels = Voxels::from_fn([5, 5, 5], |x, y, z| u8::from((x + y * z) % 3 == 0));
        add("voxels", Shape::Voxels(voxels), plain, -3.0, -4.0);
        let ball = |x: f64| Form::Ellipsoid { center: DVec3::new(x, 0.5, 0.0), radii: DVec3::splat(0.5) };
        let blend = Form::SmoothUnion { a: Box::new(ball(0.0)), b: Box::new(ball(0.6)), k: 0.4 };
        add("blend", Shape::FreeForm(FreeForm::new(blend).unwrap()), glass, 0.0, 1.5);
        let heights = (0..25).map(|i| (i % 3) as f32 * 0.2).collect();
        let field = HeightField::new(5, 5, DVec2::splat(2.0), heights).unwrap();
        add("field", Shape::HeightField(field), plain, 2.5, -1.0);
        let samples = (0..216).map(|i| (i * 37 % 256) as u8).collect();
        let volume = Volume::new([6, 6, 6], DVec3::splat(0.3), Samples::U8(samples)).unwrap();
        add("cloud", Shape::Volume(volume), plain, 0.0, -1.5);
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(f32::NAN, 0.0, 1.0)];
        let triangles = vec![[0, 1, 2], [0, 1, 3]];
        add("broken", Shape::Mesh(Mesh { positions, triangles, ..Mesh::default() }), plain, -2.0, 1.0);
        scene.lights.push(Light::directional(DVec3::new(-0.4, -1.0, -0.3)));
        scene.lights.push(Light::point(DVec3::new(2.0, 4.0, 3.0), 6.0));
        scene
    }

    fn need(width: u32, height: u32) -> Need {
        let camera = camera([3.0, 4.0, 7.0], [0.0, 0.5, 0.0]);
        Need { channels: Channels::ALL, samples: 3, ..Need::new(camera, width, height) }
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bytes_at_any_size() {
        let scene = Arc::new(everything());
        for (width, height) in [(0, 0), (1, 1), (1, 7), (13, 11), (67, 41)] {
            let need = need(width, height);
            let one = draw_with(&scene, &need, &Control::simple());
            assert_eq!(one.count_not_finite(), 0);
            for threads in [2, 4] {
                let pool = Pool::new(threads).unwrap();
                let other = draw_with(&scene, &need, &Control::new(&pool));
                assert!(one.same_bits(&other), "{width}x{height} with {threads} threads");
            }
        }
    }

    #[test]
    fn a_channel_is_the_same_alone_and_among_others() {
        let scene = Arc::new(everything());
        let need = need(53, 37);
        let all = draw_with(&scene, &need, &Control::simple());
        let only =
            |channels: Channels| draw_with(&scene, &Need { channels, ..need.clone() }, &Control::simple());
        use polyptych_core::framebuffer::Channel as C;
        assert_eq!(only(Channels::COLOR).color(), all.color());
        assert_eq!(only(Channels::of(&[C::Distance])).distance(), all.distance());
        assert_eq!(only(Channels::of(&[C::Normal])).normal(), all.normal());
        assert_eq!(only(Channels::of(&[C::Id])).id(), all.id());
        assert_eq!(only(Channels::of(&[C::Albedo])).albedo(), all.albedo());
        assert_eq!(only(Channels::of(&[C::Shadow])).shadow(), all.shadow());
        assert_eq!(only(Channels::of(&[C::Coverage])).coverage(), all.coverage());
    }

    #[test]
    fn a_cancelled_picture_is_an_error_and_the_next_one_is_whole() {
        let scene = Arc::new(everything());
        let need = need(40, 30);
        let mut renderer = Reference::new();
        let mut picture = Framebuffer::new(40, 30, Channels::ALL);
        let missing = renderer.render(&need.frame(), &mut picture, &Control::simple());
        assert_eq!(missing.unwrap_err(), RenderError::NotPrepared);
        renderer.prepare(&scene, &need, &Converter::default(), &Control::simple()).unwrap();
        let flag = AtomicBool::new(true);
        let control = Control::simple().cancelled_by(&flag);
        let stopped = renderer.render(&need.frame(), &mut picture, &control);
        assert_eq!(stopped.unwrap_err(), RenderError::Cancelled);
        flag.store(false, Ordering::Relaxed);
        renderer.render(&need.frame(), &mut picture, &control).unwrap();
        assert!(picture.same_bits(&draw_with(&scene, &need, &Control::simple())));
    }

    #[test]
    fn plan_and_report_say_the_same_and_nothing_is_dropped_in_silence() {
        let mut scene = everything();
        let wire = Mesh { positions: vec![Vec3::ZERO, Vec3::ONE], segments: vec![[0, 1]], ..Mesh::default() };
        scene.objects.push(Object::new("wire", Shape::Mesh(wire), 0));
        let need = need(8, 8);
        let mut renderer = Reference::new();
        let plan = renderer.plan(&scene, &need);
        let shared = Arc::new(scene.clone());
        let done = renderer.prepare(&shared, &need, &Converter::default(), &Control::simple()).unwrap();
        let planned: Vec<_> = plan.objects.iter().map(|o| o.decision.clone()).collect();
        assert_eq!(planned, &*done.objects);
        assert_eq!(planned[8], Decision::Skipped { why: "line segments have no area".to_owned() });
        let why = "1 triangles with corners that are not finite are left out".to_owned();
        assert_eq!(planned[7], Decision::Approximated { why });
        assert!(planned[..7].iter().all(|d| *d == Decision::Exact));
        scene.objects[8].required = true;
        let refused = renderer.prepare(&Arc::new(scene), &need, &Converter::default(), &Control::simple());
        assert!(matches!(refused, Err(RenderError::Required { object, .. }) if object == "wire"));
    }

    #[test]
    fn an_edit_keeps_what_was_built_for_other_shapes_and_matches_a_fresh_start() {
        let mut scene = everything();
        let need = need(31, 23);
        let mut renderer = Reference::new();
        let shared = Arc::new(scene.clone());
        renderer.prepare(&shared, &need, &Converter::default(), &Control::simple()).unwrap();
        scene.objects[1].world_from_object.translation.y += 0.4;
        scene.objects.remove(2);
        let edited = Arc::new(scene);
        renderer.prepare(&edited, &need, &Converter::default(), &Control::simple()).unwrap();
        let mut picture = Framebuffer::new(31, 23, Channels::ALL);
        renderer.render(&need.frame(), &mut picture, &Control::simple()).unwrap();
        assert!(picture.same_bits(&draw_with(&edited, &need, &Control::simple())));
    }

    #[test]
    fn parameters_are_refused_with_the_nearest_name() {
        let declared = Factory.info().parameters;
        let mut settings = Settings::default();
        let error = settings.set("reference", &declared, "sample", "4").unwrap_err();
        assert!(error.to_string().ends_with("the nearest is `samples`"));
        settings.set("reference", &declared, "samples", "4").unwrap();
        assert!(settings.set("reference", &declared, "bounces", "17").is_err());
    }

    #[test]
    fn five_thousand_instances_share_one_shape() {
        let mut scene = Scene::default();
        let material = scene.add_material(Material::default());
        let shape = Arc::new(Shape::Primitive(Primitive::Sphere { radius: 0.4 }));
        for i in 0..5000 {
            let place = DVec3::new(f64::from(i % 100), 0.0, f64::from(i / 100));
            let mut object =
                Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 0.4 }), material);
            object.shape = shape.clone();
            scene.objects.push(object.at(place));
        }
        let from_above = Camera::look_at(
            DVec3::new(49.5, 9.0, 24.5),
            DVec3::new(49.5, 0.0, 24.5),
            DVec3::NEG_Z,
            Projection::Orthographic { height: 50.0 },
        );
        let picture = draw(scene, from_above, 100, 50);
        for (i, &id) in picture.id().iter().enumerate() {
            assert_eq!(id as usize, i + 1);
        }
    }
}
