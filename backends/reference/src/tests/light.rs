//! Do lights and shadows fall where closed forms say?

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
        Shape::Primitive(Primitive::Frustum { sides: 50, lower_radius: 1.0, upper_radius: 0.4, height: 1.0 }),
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
