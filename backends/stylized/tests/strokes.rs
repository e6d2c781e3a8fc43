//! Do strokes stick to bodies and keep their width, and are pictures of strokes taken?

mod common;

use common::{Easel, central, luminance, scene};
use glam::{DMat3, DVec3, Vec3};
use polyptych_core::camera::Camera;
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::scene::{Mesh, Primitive, Shape};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_stylized::Stylized;

const SIZE: u32 = 256;

/// Black strokes on white, of one direction, wherever the light does not fall straight.
const STROKES: [(&str, &str); 14] = [
    ("tone.cool", "#ffffff"),
    ("tone.warm", "#ffffff"),
    ("tone.alpha", "0"),
    ("tone.beta", "0"),
    ("specular", "off"),
    ("shadow", "false"),
    ("contours", "false"),
    ("hatch", "ink"),
    ("hatch.color", "#000000"),
    ("hatch.width", "2"),
    ("hatch.thresholds", "0.05,0.1,1,1"),
    ("paper", "true"),
    ("paper.color", "#ffffff"),
    ("preset", "gooch"),
];

/// Returns the widths of strokes across a picture: the upper quartile, as those that are about to go are thinner.
fn width_of_strokes(picture: &Framebuffer) -> f32 {
    let mut widths = Vec::new();
    for y in (8..SIZE - 8).step_by(7) {
        let row = &picture.color()[(y * SIZE) as usize..((y + 1) * SIZE) as usize];
        let ink: Vec<f32> = row.iter().map(|c| 1.0 - luminance(*c)).collect();
        for run in ink.split(|i| *i < 0.02) {
            // A run that is nowhere dark is the end of a stroke; the lines lean by half a right angle.
            if run.iter().any(|i| *i > 0.9) {
                widths.push(run.iter().sum::<f32>() / 2f32.sqrt());
            }
        }
    }
    widths.sort_by(f32::total_cmp);
    assert!(widths.len() > 50, "{} strokes", widths.len());
    widths[widths.len() * 3 / 4]
}

#[test]
fn strokes_keep_their_width_over_sixteen_times_the_distance() {
    let wall = Mesh {
        positions: [[-40.0, -40.0], [40.0, -40.0], [40.0, 40.0], [-40.0, 40.0]]
            .map(|[x, y]| Vec3::new(x, y, 0.0))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let scene = scene(vec![(Shape::Mesh(wall), DVec3::ZERO)], DVec3::X);
    let mut easel = Easel::new(&scene, central(DVec3::Z * 4.0, 0.5), [SIZE; 2], &STROKES);
    let threads = polyptych_core::parallel::OneThread;
    let widths: Vec<f32> = (0..=16)
        .map(|i| central(DVec3::Z * 4.0 * 2f64.powf(f64::from(i) * 0.25), 0.5))
        .map(|camera| width_of_strokes(&easel.picture_from(&camera, &threads)))
        .collect();
    println!("{widths:.2?}");
    for width in &widths {
        assert!((width / 2.0 - 1.0).abs() < 0.2, "{widths:?}");
    }
}

/// Warps each picture of an orbit onto the next by what is seen, and returns how much their ink differs on average.
fn swimming(mapping: &str) -> f64 {
    let body = Shape::Primitive(Primitive::Sphere { radius: 1.0 });
    let scene = scene(vec![(body, DVec3::ZERO)], DVec3::Y);
    let settings =
        [&STROKES[..], &[("hatch.mapping", mapping), ("hatch.thresholds", "0.1,0.2,0.5,0.6")]].concat();
    let channels = Channels::of(&[Channel::Color, Channel::Distance, Channel::Id]);
    let camera = |i: u32| {
        let turn = DMat3::from_rotation_y(f64::from(i) / 64.0 * 0.5);
        central(turn * DVec3::new(0.0, 0.4, 3.2), 0.7)
    };
    let mut easel = Easel::with_channels(&scene, camera(0), [SIZE; 2], &settings, channels);
    let mut draw = |camera: &Camera| easel.picture_from(camera, &polyptych_core::parallel::OneThread);
    let (mut sum, mut count) = (0.0, 0);
    let mut before = (camera(0), draw(&camera(0)));
    for i in 1..64 {
        let now = camera(i);
        let picture = draw(&now);
        let view = before.0.view(SIZE, SIZE);
        for p in (0..SIZE * SIZE).step_by(3) {
            if before.1.id()[p as usize] == 0 {
                continue;
            }
            let (x, y) = (f64::from(p % SIZE) + 0.5, f64::from(p / SIZE) + 0.5);
            let Some(ray) = view.ray(x, y) else { continue };
            let place = ray.at(f64::from(before.1.distance()[p as usize]));
            let v = now.world_from_camera.transpose() * (place - now.eye);
            let half = 0.35f64.tan() * -v.z;
            let [u, w] = [
                (v.x / half + 1.0) * 0.5 * f64::from(SIZE) - 0.5,
                (1.0 - v.y / half) * 0.5 * f64::from(SIZE) - 0.5,
            ];
            let (x0, y0) = (u.floor() as i64, w.floor() as i64);
            // Near the silhouette what is seen turns away.
            let facing = place.normalize_or_zero().dot((now.eye - place).normalize_or_zero());
            if x0 < 0 || y0 < 0 || x0 + 1 >= i64::from(SIZE) || y0 + 1 >= i64::from(SIZE) || facing < 0.4 {
                continue;
            }
            let at = |dx: i64, dy: i64| {
                f64::from(luminance(picture.color()[((y0 + dy) * i64::from(SIZE) + x0 + dx) as usize]))
            };
            let (fx, fy) = (u - u.floor(), w - w.floor());
            let (top, low) = (at(0, 0) + (at(1, 0) - at(0, 0)) * fx, at(0, 1) + (at(1, 1) - at(0, 1)) * fx);
            sum += (top + (low - top) * fy - f64::from(luminance(before.1.color()[p as usize]))).abs();
            count += 1;
        }
        before = (now, picture);
    }
    sum / f64::from(count)
}

/// Comes nearer by a hundredth with every picture, and returns the greatest change of ink from one to the next, each the
/// mean over the wall.
fn popping() -> f32 {
    let wall = Mesh {
        positions: [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]
            .map(|[x, y]| Vec3::new(x, y, 0.0))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let scene = scene(vec![(Shape::Mesh(wall), DVec3::ZERO)], DVec3::X);
    let settings = [&STROKES[..], &[("hatch.thresholds", "0.1,0.2,0.3,0.4")]].concat();
    let mut easel = Easel::new(&scene, central(DVec3::Z * 12.0, 0.5), [128, 128], &settings);
    let mut mean = |i: i32| {
        let camera = central(DVec3::Z * 12.0 * 0.99f64.powi(i), 0.5);
        let picture = easel.picture_from(&camera, &polyptych_core::parallel::OneThread);
        picture.color().iter().map(|c| 1.0 - luminance(*c)).sum::<f32>() / (128.0 * 128.0)
    };
    let means: Vec<f32> = (0..150).map(&mut mean).collect();
    means.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
}

#[test]
fn strokes_do_not_pop_on_the_way_from_map_to_map() {
    // Over two halvings of the distance; a map that is changed at once would take or bring half of the ink, a fifth of
    // the picture.
    let greatest = popping();
    println!("the greatest change of ink is {greatest}");
    assert!(greatest < 0.02, "{greatest}");
}

/// Most that pictures of an orbit may differ when warped onto each other. Reading between pixels blurs lines two pixels
/// wide, by about as much; strokes that stay on the picture instead differ by three times that.
const SWIMS: f64 = 0.06;

#[test]
fn strokes_stick_to_a_body_that_turns_and_screens_do_not() {
    let (stuck, screen) = (swimming("triplanar"), swimming("screen"));
    println!("warped pictures differ by {stuck:.4} when strokes stick, by {screen:.4} on the screen");
    assert!(stuck < SWIMS && screen > 2.0 * SWIMS, "{stuck} and {screen}");
}

#[test]
fn texture_coordinates_and_pictures_of_strokes_are_taken() {
    let folder = std::env::temp_dir().join(format!("polyptych-strokes-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let half = |name: &str, dark: u32| {
        let file = folder.join(name);
        let picture = image::GrayImage::from_fn(64, 64, |x, _| image::Luma([if x < dark { 0 } else { 255 }]));
        picture.save(&file).unwrap();
        file.display().to_string()
    };
    let images = format!("{}, {}", half("a.png", 16), half("b.png", 32));
    let mut wall = Mesh {
        positions: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| Vec3::new(x, y, 0.0))
            .to_vec(),
        uvs: [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]].map(glam::Vec2::from_array).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    wall.normals = vec![Vec3::Z; 4];
    let scene = scene(vec![(Shape::Mesh(wall), DVec3::ZERO)], DVec3::X);
    for visibility in ["raster", "reference"] {
        let settings = [
            &STROKES[..10],
            // One period over the whole wall.
            &[("hatch", "images"), ("hatch.images", &images), ("hatch.thresholds", "0.3,0.9")],
            &[("hatch.mapping", "uv"), ("hatch.scale", "6"), ("visibility", visibility)],
        ]
        .concat();
        let camera = central(DVec3::Z * 2.0, 2.0 * 0.5f64.atan());
        let picture = Easel::new(&scene, camera, [128, 128], &settings).picture();
        let row = &picture.color()[64 * 128..65 * 128];
        // Half darkness has the ink of the first picture only: a quarter of the wall.
        let dark = row.iter().filter(|c| luminance(**c) < 0.5).count();
        assert!(
            dark.abs_diff(32) <= 2 && luminance(row[10]) < 0.5 && luminance(row[50]) > 0.5,
            "{visibility}: {dark}"
        );
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn pictures_that_are_none_are_refused_in_one_line() {
    let scene = scene(vec![(Shape::Primitive(Primitive::Sphere { radius: 1.0 }), DVec3::ZERO)], DVec3::Y);
    for (images, says) in [("", "name 1 to 64 pictures"), ("/nowhere/a.png", "/nowhere/a.png: ")] {
        let mut renderer = Stylized::new(common::registry());
        let mut need = Need::new(central(DVec3::Z * 3.0, 0.7), 8, 8);
        let declared = renderer.info().parameters.clone();
        need.settings.set("stylized", &declared, "hatch", "images").unwrap();
        need.settings.set("stylized", &declared, "hatch.images", images).unwrap();
        let refused = renderer
            .prepare(&scene, &need, &Converter::default(), &Control::simple())
            .unwrap_err()
            .to_string();
        assert!(refused.contains(says) && !refused.contains('\n'), "{refused}");
    }
}
