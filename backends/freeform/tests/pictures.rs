//! Do pictures of volumes, shells and thin things hold the light that they must?

use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::parallel::OneThread;
use polyptych_core::scene::{
    Background, Form, FreeForm, Material, Object, Primitive, Samples, Scene, Shape, TransferPoint, Volume,
};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_freeform::Freeform;
use std::sync::Arc;

const SIZE: [u32; 2] = [96, 72];

fn look(eye: DVec3, target: DVec3, fov_y: f64) -> Camera {
    Camera::look_at(eye, target, DVec3::Y, Projection::Perspective { fov_y })
}

fn draw(scene: &Scene, camera: Camera, [width, height]: [u32; 2], settings: &[(&str, &str)]) -> Framebuffer {
    let mut need = Need::new(camera, width, height);
    need.channels = Channels::COLOR.with(Channel::Coverage);
    let mut freeform = Freeform::new();
    let declared = freeform.info().parameters.clone();
    for (name, value) in settings {
        need.settings.set("freeform", &declared, name, value).expect("a parameter");
    }
    let control = Control::new(&OneThread);
    freeform.prepare(&Arc::new(scene.clone()), &need, &Converter::default(), &control).expect("a scene");
    let mut picture = Framebuffer::new(width, height, need.channels);
    freeform.render(&need.frame(), &mut picture, &control).expect("a picture");
    picture
}

/// A black world in which things shine by their own color alone.
fn dark() -> Scene {
    let mut scene = Scene::default();
    scene.environment.background = Background::Solid(Vec3::ZERO);
    scene.environment.ambient = Vec3::ONE;
    scene
}

/// Fog of one color in a cube, of which a meter holds back so much.
fn fog(scene: &mut Scene, color: Vec3, opacity: f32) -> Volume {
    scene.materials.resize(1, Material { ambient: 1.0, ..Material::new(Vec3::ONE) });
    let mut volume = Volume::new([20; 3], DVec3::splat(0.1), Samples::U8(vec![7; 8000])).expect("a volume");
    volume.transfer.points = vec![TransferPoint { value: 0.0, color, opacity }];
    volume.transfer.reference_length = 1.0;
    volume
}

#[test]
fn fog_in_a_shell_holds_back_what_its_length_along_each_ray_says() {
    let mut scene = dark();
    let mut volume = fog(&mut scene, Vec3::ONE, 0.6);
    let ball = |x: f64| Form::Ellipsoid { center: DVec3::new(x, 0.0, 0.0), radii: DVec3::splat(0.4) };
    volume.shell = Some(FreeForm::new(Form::Union(vec![ball(-0.5), ball(0.5)])).expect("a form"));
    scene.objects.push(Object::new("fog", Shape::Volume(volume), 0));
    // From the side, so that some rays pass both balls, some one, in perspective.
    let camera = look(DVec3::new(3.0, 0.1, 0.6), DVec3::ZERO, 0.5);
    let picture = draw(&scene, camera.clone(), SIZE, &[("volume.step", "0.05")]);
    let view = camera.view(SIZE[0], SIZE[1]);
    let (mut met, mut worst) = (0, 0.0f64);
    for (i, color) in picture.color().iter().enumerate() {
        let (x, y) = (i as u32 % SIZE[0], i as u32 / SIZE[0]);
        let ray = view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5).expect("a ray");
        let chord = |middle: f64| {
            let away = DVec3::new(middle, 0.0, 0.0) - ray.origin;
            let along = away.dot(ray.direction);
            2.0 * (0.16 - (away.length_squared() - along * along)).max(0.0).sqrt()
        };
        let length = chord(-0.5) + chord(0.5);
        met += usize::from(length > 0.9);
        worst = worst.max((1.0 - 0.4f64.powf(length) - f64::from(color.x)).abs());
    }
    // A sample more or less at each border of the shell.
    assert!(met > 100 && worst < 0.012, "{met} rays through both, {worst} off");
}

#[test]
fn fogs_in_one_place_share_the_light_and_one_behind_another_is_dimmed() {
    let mut scene = dark();
    let red = fog(&mut scene, Vec3::X, 0.6);
    let blue = fog(&mut scene, Vec3::Z, 0.3);
    let mut behind = Object::new("blue", Shape::Volume(blue), 0);
    scene.objects.push(Object::new("red", Shape::Volume(red), 0));
    scene.objects.push(behind.clone());
    let camera = look(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, 0.2);
    let settings = [("volume.step", "0.05")];
    let middle = |picture: &Framebuffer| picture.color()[(SIZE[1] / 2 * SIZE[0] + SIZE[0] / 2) as usize];
    let both = middle(&draw(&scene, camera.clone(), SIZE, &settings));
    let (dims_red, dims_blue) = (-(0.4f32.ln()), -(0.7f32.ln()));
    let held = 1.0 - (0.4f32 * 0.7).powi(2);
    let share = dims_red / (dims_red + dims_blue);
    assert!((both.x - share * held).abs() < 0.005 && (both.z - (1.0 - share) * held).abs() < 0.005, "{both}");

    behind.world_from_object.translation.z = -2.5;
    scene.objects[1] = behind;
    let apart = middle(&draw(&scene, camera, SIZE, &settings));
    assert!((apart.x - (1.0 - 0.4f32.powi(2))).abs() < 0.005, "{apart}");
    assert!((apart.z - 0.4f32.powi(2) * (1.0 - 0.7f32.powi(2))).abs() < 0.005, "{apart}");
}

#[test]
fn coarser_samples_keep_the_light_of_fine_patterns_and_do_not_glitter() {
    let mut scene = dark();
    let _ = fog(&mut scene, Vec3::ONE, 0.5);
    // Layers of light and dark, far smaller than a pixel.
    let size = [64u32; 3];
    let samples = (0..64 * 64 * 64).map(|i: u32| ((i / 2 + i / 128 + i / 8192) % 2 * 200) as u8).collect();
    let mut volume = Volume::new(size, DVec3::splat(0.02), Samples::U8(samples)).expect("a volume");
    let point = |value: f32, color: Vec3| TransferPoint { value, color, opacity: 0.9 };
    volume.transfer.points = vec![point(0.0, Vec3::ZERO), point(200.0, Vec3::ONE)];
    volume.transfer.reference_length = 0.02;
    scene.objects.push(Object::new("pattern", Shape::Volume(volume), 0));
    let spread = |settings: &[(&str, &str)]| {
        let camera = look(DVec3::new(1.0, 2.0, 30.0), DVec3::ZERO, 0.2);
        let picture = draw(&scene, camera, SIZE, settings);
        let seen: Vec<f64> = picture
            .color()
            .iter()
            .zip(picture.coverage())
            .filter(|(_, c)| **c > 0.0)
            .map(|(c, _)| f64::from(c.x))
            .collect();
        // What lies at the border of the cube is not of the pattern alone.
        let seen: Vec<f64> = seen.into_iter().filter(|v| *v > 0.05).collect();
        let mean = seen.iter().sum::<f64>() / seen.len() as f64;
        let spread = (seen.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / seen.len() as f64).sqrt();
        (mean, spread)
    };
    let (_, fine) = spread(&[]);
    let (mean, coarse) = spread(&[("volume.levels", "true")]);
    assert!((mean - 0.5).abs() < 0.06, "{mean}");
    assert!(coarse * 3.0 < fine, "{coarse} against {fine}");
}

/// A glowing rod, so many pixels thick, that leans, and is moved aside by a part of a pixel.
fn rod(pixels: f64, shift: f64) -> (Scene, Camera) {
    let mut scene = dark();
    let glow = scene.add_material(Material {
        ambient: 1.0,
        diffuse: 0.0,
        specular: 0.0,
        ..Material::new(Vec3::ONE)
    });
    let camera = look(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO, 0.2);
    let pixel = camera.view(SIZE[0], SIZE[1]).pixel_size(10.0);
    let shape = Primitive::Cylinder { radius: pixels * pixel * 0.5, height: 8.0 };
    let mut object = Object::new("rod", Shape::Primitive(shape), glow);
    object.world_from_object = glam::DAffine3::from_rotation_translation(
        glam::DQuat::from_rotation_z(0.2),
        DVec3::new(shift * pixel, 0.0, 0.0),
    );
    scene.objects.push(object);
    (scene, camera)
}

#[test]
fn thin_rods_neither_vanish_nor_flicker_where_edges_have_more_rays() {
    for (pixels, rays, tolerance) in [(0.5, "4", 0.12), (0.25, "8", 0.12), (1.3, "4", 0.06)] {
        let expected = pixels / f64::from(0.2f32).cos();
        let mut last: Option<Vec<f64>> = None;
        for step in 0..8 {
            let (scene, camera) = rod(pixels, f64::from(step) / 16.0);
            let picture = draw(&scene, camera, SIZE, &[("edge.rays", rays)]);
            // The light of each four rows, which the rod passes in about one column.
            let rows: Vec<f64> = picture
                .color()
                .chunks((SIZE[0] * 4) as usize)
                .map(|rows| rows.iter().map(|c| f64::from(c.x)).sum::<f64>() / 4.0)
                .collect();
            for (row, light) in rows.iter().enumerate() {
                let off = (light / expected - 1.0).abs();
                assert!(off < tolerance * 1.5, "{pixels} px, rows {row}: {light} for {expected}");
            }
            let whole = rows.iter().sum::<f64>() / rows.len() as f64;
            assert!((whole / expected - 1.0).abs() < 0.03, "{pixels} px: {whole} for {expected}");
            if let Some(last) = last {
                let change = rows.iter().zip(&last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(change < 2.0 * tolerance * expected, "{pixels} px: changed by {change}");
            }
            let covered: f64 = picture.coverage().iter().map(|&c| f64::from(c)).sum();
            assert!((covered / f64::from(SIZE[1]) / expected - 1.0).abs() < 0.03);
            last = Some(rows);
        }
        // One ray a pixel misses most of it.
        let (scene, camera) = rod(pixels, 0.0);
        let plain = draw(&scene, camera, SIZE, &[]);
        let empty =
            plain.color().chunks(SIZE[0] as usize).filter(|row| row.iter().all(|c| c.x == 0.0)).count();
        assert!(pixels > 1.0 || empty > 10, "{empty} rows");
    }
}

#[test]
fn edges_of_bodies_are_smooth_and_all_else_is_as_it_was() {
    let mut scene = dark();
    let glow = scene.add_material(Material {
        ambient: 1.0,
        diffuse: 0.0,
        specular: 0.0,
        ..Material::new(Vec3::ONE)
    });
    scene.objects.push(Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), glow));
    let camera = look(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO, 0.3);
    let (plain, smooth) =
        (draw(&scene, camera.clone(), SIZE, &[]), draw(&scene, camera.clone(), SIZE, &[("edge.rays", "8")]));
    // The silhouette of a ball of radius 1 from 10 meters.
    let pixel = camera.view(SIZE[0], SIZE[1]).pixel_size(1.0);
    let area = std::f64::consts::PI * (1.0 / 99f64.sqrt() / pixel).powi(2);
    let covered = |p: &Framebuffer| p.coverage().iter().map(|&c| f64::from(c)).sum::<f64>();
    assert!((covered(&smooth) / area - 1.0).abs() < 0.001, "{} for {area}", covered(&smooth));
    let mut between = 0;
    for (a, b) in plain.color().iter().zip(smooth.color()) {
        if b.x > 0.01 && b.x < 0.99 {
            between += 1;
        } else {
            assert_eq!(a, b);
        }
    }
    assert!(between > 100, "{between} pixels of the edge");
}
