//! Do layers, mirrors, fog and volumes add up?

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
    let (distance, id, color) = probe(&scene, &mut prepared(&scene), DVec3::new(0.1, 5.0, 0.2), DVec3::NEG_Y);
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
