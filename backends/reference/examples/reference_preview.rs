//! What does the reference draw? Writes color, normal, distance and id of a scene with every shape as PNGs.
//!
//! `cargo run -p polyptych-reference --example reference_preview -- FOLDER [WIDTH [SAMPLES]]`

use glam::{DAffine3, DQuat, DVec2, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{
    Form, FreeForm, HeightField, Light, LightKind, Mapping, Material, Mesh, Object, Perturbation, Power,
    Primitive, Samples, Scene, Shape, Texture, TransferFunction, TransferPoint, Volume, Voxels,
};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_core::shade::srgb_from_linear;
use polyptych_reference::Reference;
use std::path::Path;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("name a folder for the pictures")?;
    let width: u32 = arguments.next().map_or(Ok(960), |a| a.parse())?;
    let samples: u32 = arguments.next().map_or(Ok(4), |a| a.parse())?;
    let scene = Arc::new(scene()?);
    let eye = DVec3::new(1.5, 5.2, 11.5);
    let camera =
        Camera::look_at(eye, DVec3::new(0.0, 0.6, 0.0), DVec3::Y, Projection::Perspective { fov_y: 0.62 });
    let need = Need { channels: Channels::ALL, samples, ..Need::new(camera, width, width * 9 / 16) };
    let pool = Pool::new(0)?;
    let control = Control::new(&pool);
    let mut renderer = Reference::new();
    let started = std::time::Instant::now();
    renderer.prepare(&scene, &need, &Converter::default(), &control)?;
    println!("prepared in {:.2?}", started.elapsed());
    let mut picture = Framebuffer::new(need.width, need.height, need.channels);
    let report = renderer.render(&need.frame(), &mut picture, &control)?;
    for (phase, time) in report.phases.iter() {
        println!("{phase}: {time:.2?}");
    }
    for counter in report.counters.iter().flatten() {
        println!("{} {}", counter.count, counter.name);
    }
    write(Path::new(&folder), &picture)
}

fn write(folder: &Path, picture: &Framebuffer) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder)?;
    let save = |name: &str, color: &dyn Fn(usize) -> Vec3| {
        let image = image::RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
            let c = color((y * picture.width() + x) as usize);
            image::Rgb(c.to_array().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8))
        });
        image.save(folder.join(name))
    };
    let encode = |c: Vec3| Vec3::from_array(c.to_array().map(srgb_from_linear));
    save("color.png", &|i| encode(picture.color()[i]))?;
    save("albedo.png", &|i| encode(picture.albedo()[i]))?;
    save("normal.png", &|i| picture.normal()[i] * 0.5 + 0.5)?;
    save("shadow.png", &|i| Vec3::splat(picture.shadow()[i]))?;
    save("coverage.png", &|i| Vec3::splat(picture.coverage()[i]))?;
    let seen = || picture.distance().iter().copied().filter(|d| d.is_finite());
    let (near, far) = (seen().fold(f32::INFINITY, f32::min), seen().fold(0.0, f32::max));
    save("distance.png", &|i| Vec3::splat(1.0 - (picture.distance()[i] - near) / (far - near)))?;
    save("id.png", &|i| {
        let id = picture.id()[i].wrapping_mul(0x9e37_79b1);
        Vec3::new((id >> 24) as f32, (id >> 16 & 255) as f32, (id >> 8 & 255) as f32) / 255.0
    })?;
    Ok(())
}

fn scene() -> Result<Scene, String> {
    let mut scene = Scene { name: "preview".to_owned(), ..Scene::default() };
    let color = |r: f32, g: f32, b: f32| Material::new(Vec3::new(r, g, b));
    let checker: Vec<u8> = (0..64)
        .flat_map(|i: i32| if (i / 8 + i) % 2 == 0 { [205, 200, 190, 255] } else { [120, 125, 130, 255] })
        .collect();
    let texture = Some(scene.add_texture(Texture::from_srgb8("checker", 8, 8, &checker)));
    let mapping = Mapping::Triplanar { scale: 0.125 };
    let floor = Material { texture, mapping, specular: 0.0, reflectivity: 0.06, ..color(0.8, 0.8, 0.8) };
    let floor = scene.add_material(floor);
    let red = scene.add_material(color(0.7, 0.12, 0.08));
    let gold = scene.add_material(Material { specular: 0.6, shininess: 60.0, ..color(0.8, 0.55, 0.15) });
    let teal = scene.add_material(color(0.08, 0.45, 0.5));
    let mirror = scene.add_material(Material { reflectivity: 0.8, specular: 0.8, ..color(0.6, 0.6, 0.65) });
    let glass = scene.add_material(Material { opacity: 0.35, reflectivity: 0.15, ..color(0.3, 0.7, 0.4) });
    let leaf = scene.add_material(color(0.25, 0.5, 0.15));
    let lava = scene.add_material(Material { emission: Vec3::new(40.0, 14.0, 3.0), ..color(0.9, 0.4, 0.1) });
    let smoke = scene.add_material(Material { specular: 0.1, ..color(1.0, 1.0, 1.0) });

    let body = |p: Primitive| Shape::Primitive(p);
    let mut add = |name: &str, shape: Shape, material: usize, at: [f64; 3]| {
        scene.objects.push(Object::new(name, shape, material).at(at.into()));
        scene.objects.len() - 1
    };
    add("floor", body(Primitive::Plane { width: 30.0, depth: 30.0 }), floor, [0.0; 3]);
    add("sphere", body(Primitive::Sphere { radius: 0.7 }), mirror, [-1.2, 0.7, 1.6]);
    add("glass", body(Primitive::Sphere { radius: 0.6 }), glass, [0.5, 0.6, 3.2]);
    add("cylinder", body(Primitive::Cylinder { radius: 0.45, height: 1.3 }), red, [2.6, 0.65, 2.4]);
    add("cone", body(Primitive::Cone { radius: 0.6, height: 1.4 }), teal, [3.9, 0.7, 2.2]);
    add("prism", body(Primitive::prism(6, 0.5, 0.9)), gold, [-2.8, 0.45, 2.8]);
    let pyramid = Primitive::Frustum { sides: 4, lower_radius: 0.8, upper_radius: 0.25, height: 1.0 };
    add("frustum", body(pyramid), leaf, [-4.2, 0.5, 2.0]);
    let torus = add("torus", body(Primitive::Torus { major: 0.6, minor: 0.22 }), gold, [1.2, 0.85, 1.2]);
    let cube = add("box", body(Primitive::Box { size: DVec3::new(0.9, 0.9, 0.9) }), red, [-0.6, 0.45, 3.6]);
    add("free form", Shape::FreeForm(blob()?), teal, [2.9, 1.0, -0.6]);
    add("height field", Shape::HeightField(hills()?), leaf, [-3.8, 0.05, -1.6]);
    add("volume", Shape::Volume(cloud()?), smoke, [0.0, 1.5, -2.0]);
    add("mesh", Shape::Mesh(ball(24, 48, true)), red, [5.2, 0.6, 0.8]);
    add("flat mesh", Shape::Mesh(ball(6, 9, false)), gold, [4.6, 0.6, -2.4]);
    let voxels = Voxels::from_fn([12, 12, 12], |x, y, z| {
        let r2 = [x, y, z].iter().map(|&c| (f64::from(c) - 5.5).powi(2)).sum::<f64>();
        if r2 < 1.0 {
            2
        } else if r2 < 36.0 && !(x > 5 && z > 5) {
            1
        } else {
            0
        }
    });
    let grid = add("voxels", Shape::Voxels(voxels), teal, [-2.0, 0.0, -0.6]);
    scene.objects[grid].materials = vec![teal, lava];
    scene.objects[grid].world_from_object = DAffine3::from_scale_rotation_translation(
        DVec3::splat(0.12),
        DQuat::from_rotation_y(-0.4),
        DVec3::new(-1.9, 0.0, -0.4),
    );
    scene.objects[torus].world_from_object.matrix3 =
        glam::DMat3::from_quat(DQuat::from_rotation_x(1.1) * DQuat::from_rotation_z(0.4));
    scene.objects[cube].world_from_object.matrix3 = glam::DMat3::from_rotation_y(0.6);
    scene.lights.push(Light { intensity: 0.9, ..Light::directional(DVec3::new(-0.5, -1.0, -0.45)) });
    let spot = LightKind::Spot {
        position: DVec3::new(-4.0, 6.0, 5.0),
        direction: DVec3::new(0.5, -0.9, -0.4),
        inner: 0.25,
        outer: 0.45,
    };
    scene.lights.push(Light { kind: spot, intensity: 22.0, ..Light::point(DVec3::ZERO, 1.0) });
    Ok(scene)
}

/// A ball with a bump, a dent and a fillet to a ring.
fn blob() -> Result<FreeForm, String> {
    let ball = |at: [f64; 3], r: f64| Form::Ellipsoid { center: at.into(), radii: DVec3::splat(r) };
    let bump = Perturbation { weight: 1.2, power: Power::Cube, function: ball([0.5, 0.4, 0.4], 0.5) };
    let dent = Perturbation { weight: -2.5, power: Power::Square, function: ball([-0.3, 0.3, 0.6], 0.35) };
    let bent = Form::Perturbed { base: Box::new(ball([0.0, 0.1, 0.0], 0.7)), terms: vec![bump, dent] };
    FreeForm::new(Form::SmoothUnion {
        a: Box::new(bent),
        b: Box::new(Form::Torus { major: 0.9, minor: 0.14 }),
        k: 0.25,
    })
}

fn hills() -> Result<HeightField, String> {
    let n = 40;
    let height = |i: u32| {
        let (x, z) = (f64::from(i % n) / f64::from(n) * 9.0, f64::from(i / n) / f64::from(n) * 9.0);
        (0.35 * (x.sin() * z.cos() + 0.3 * (2.3 * x + 1.0).sin() * (2.9 * z).sin() + 1.0)) as f32
    };
    HeightField::new(n, n, DVec2::new(2.8, 2.8), (0..n * n).map(height).collect())
}

/// Puffs in a box, cut by a ball.
fn cloud() -> Result<Volume, String> {
    let n = 48;
    let samples = (0..n * n * n)
        .map(|i| {
            let p = DVec3::new(f64::from(i % n), f64::from(i / n % n), f64::from(i / n / n)) / f64::from(n);
            let q = p * 2.0 - 1.0;
            let waves = (q.x * 7.0).sin() * (q.y * 6.0 + 1.0).sin() * (q.z * 8.0 - 0.5).cos();
            (1.0 - q.length() + 0.35 * waves) as f32
        })
        .collect();
    let mut volume = Volume::new([n; 3], DVec3::splat(2.6 / f64::from(n)), Samples::F32(samples))?;
    let point = |value: f32, color: [f32; 3], opacity: f32| TransferPoint {
        value,
        color: Vec3::from_array(color),
        opacity,
    };
    volume.transfer = TransferFunction {
        points: vec![
            point(0.28, [0.9, 0.9, 1.0], 0.0),
            point(0.4, [0.85, 0.85, 0.95], 0.12),
            point(0.9, [1.0, 0.6, 0.3], 0.6),
        ],
        reference_length: 0.1,
    };
    volume.shell = FreeForm::from_primitive(&Primitive::Sphere { radius: 1.25 });
    Ok(volume)
}

fn ball(rows: u32, columns: u32, smooth: bool) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (a, b) = (
                std::f32::consts::PI * row as f32 / rows as f32,
                std::f32::consts::TAU * column as f32 / columns as f32,
            );
            let n = Vec3::new(a.sin() * b.cos(), a.cos(), a.sin() * b.sin());
            mesh.positions.push(n * 0.6);
            if smooth {
                mesh.normals.push(n);
            }
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let i = row * (columns + 1) + column;
            let j = i + columns + 1;
            mesh.triangles.push([i, i + 1, j + 1]);
            mesh.triangles.push([i, j + 1, j]);
        }
    }
    mesh
}
