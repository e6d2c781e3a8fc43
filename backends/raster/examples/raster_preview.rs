//! What does the rasterizer draw? Writes the channels of a small scene, or of a model, as PNGs.
//!
//! `cargo run -p polyptych-raster --example raster_preview -- FOLDER [WIDTH [MODEL.obj]]`

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{
    AlphaMode, HeightField, Light, Material, Mesh, Object, Primitive, Scene, Shape, Texture, Voxels,
};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_core::shade::srgb_from_linear;
use polyptych_raster::Raster;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("name a folder for the pictures")?;
    let width: u32 = arguments.next().map_or(Ok(960), |a| a.parse())?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let perspective = Projection::Perspective { fov_y: 0.62 };
    if let Some(model) = arguments.next() {
        let scene = Arc::new(of_model(&std::fs::read_to_string(model)?)?);
        let camera = Camera::framing(&scene.objects[0].bounds(), 0.3, 0.25, 16.0 / 9.0, perspective);
        return draw(&scene, camera, width, folder, "model");
    }
    let scene = Arc::new(scene()?);
    let eye = DVec3::new(1.5, 4.2, 9.5);
    let look = |projection| Camera::look_at(eye, DVec3::new(0.0, 0.6, 0.0), DVec3::Y, projection);
    draw(&scene, look(perspective), width, folder, "perspective")?;
    draw(&scene, look(Projection::Orthographic { height: 6.0 }), width / 2, folder, "orthographic")?;
    let inside = |projection| Camera { eye: DVec3::new(-0.4, 1.2, 4.2), ..look(projection) };
    draw(&scene, inside(Projection::Fisheye { fov: 3.6 }), width / 2, folder, "fisheye")?;
    let around = Projection::Cylindrical { fov_x: 6.2, fov_y: 1.4 };
    draw(&scene, inside(around), width / 2, folder, "cylindrical")
}

fn draw(
    scene: &Arc<Scene>,
    camera: Camera,
    width: u32,
    folder: &Path,
    name: &str,
) -> Result<(), Box<dyn Error>> {
    let need = Need { channels: Channels::ALL, ..Need::new(camera, width, width * 9 / 16) };
    let pool = Pool::new(0)?;
    let control = Control::new(&pool);
    let mut renderer = Raster::new();
    let started = std::time::Instant::now();
    let prepared = renderer.prepare(scene, &need, &Converter::default(), &control)?;
    println!("{name}: prepared in {:.2?}", started.elapsed());
    for (object, decision) in scene.objects.iter().zip(prepared.objects.iter()) {
        println!("  {}: {} {}", object.name, decision.word(), decision.why());
    }
    for channels in [Channels::ALL, Channels::COLOR] {
        let mut picture = Framebuffer::new(need.width, need.height, channels);
        let mut best = std::time::Duration::MAX;
        for _ in 0..10 {
            let started = std::time::Instant::now();
            let report = renderer.render(&need.frame(), &mut picture, &control)?;
            if started.elapsed() < best {
                best = started.elapsed();
                let phases: Vec<_> = report.phases.iter().map(|(p, t)| format!("{p} {t:.2?}")).collect();
                let counts: Vec<_> =
                    report.counters.iter().flatten().map(|c| format!("{} {}", c.count, c.name)).collect();
                println!(
                    "  {best:.2?}: {}; {}; {} bytes",
                    phases.join(", "),
                    counts.join(", "),
                    report.bytes
                );
            }
        }
        if channels == Channels::ALL {
            write(folder, name, &picture)?;
        }
    }
    Ok(())
}

fn write(folder: &Path, name: &str, picture: &Framebuffer) -> Result<(), Box<dyn Error>> {
    let save = |channel: &str, color: &dyn Fn(usize) -> Vec3| {
        let image = image::RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
            let c = color((y * picture.width() + x) as usize);
            image::Rgb(c.to_array().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8))
        });
        image.save(folder.join(format!("{name}_{channel}.png")))
    };
    let encode = |c: Vec3| Vec3::from_array(c.to_array().map(srgb_from_linear));
    save("color", &|i| encode(picture.color()[i]))?;
    save("normal", &|i| picture.normal()[i] * 0.5 + 0.5)?;
    save("shadow", &|i| Vec3::splat(picture.shadow()[i]))?;
    Ok(())
}

/// Reads positions and faces, and shades them smoothly.
fn of_model(text: &str) -> Result<Scene, Box<dyn Error>> {
    let mut mesh = Mesh::default();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Vec<f32> = words.map(str::parse).collect::<Result<_, _>>()?;
                mesh.positions.push(Vec3::new(numbers[0], numbers[1], numbers[2]));
            }
            Some("f") => {
                let corner = |w: &str| w.split('/').next().unwrap_or("").parse::<u32>().map(|i| i - 1);
                let corners: Vec<u32> = words.map(corner).collect::<Result<_, _>>()?;
                for pair in corners[1..].windows(2) {
                    mesh.triangles.push([corners[0], pair[0], pair[1]]);
                }
            }
            _ => {}
        }
    }
    mesh.normals = vec![Vec3::ZERO; mesh.positions.len()];
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t);
        for i in mesh.triangles[t] {
            mesh.normals[i as usize] += (b - a).cross(c - a);
        }
    }
    mesh.normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    let bounds = mesh.bounds();
    let mut scene = Scene::default();
    let clay = scene.add_material(Material::default());
    scene.objects.push(Object::new("model", Shape::Mesh(mesh), clay));
    let size = bounds.radius() * 4.0;
    let floor = Shape::Primitive(Primitive::Plane { width: size, depth: size });
    let place = DVec3::new(bounds.center().x, bounds.min.y, bounds.center().z);
    scene.objects.push(Object::new("floor", floor, clay).at(place));
    scene.lights.push(Light::directional(DVec3::new(-0.5, -1.0, -0.6)));
    Ok(scene)
}

fn scene() -> Result<Scene, String> {
    let mut scene = Scene { name: "preview".to_owned(), ..Scene::default() };
    let color = |r: f32, g: f32, b: f32| Material::new(Vec3::new(r, g, b));
    let checker: Vec<u8> = (0..64)
        .flat_map(|i: i32| if (i / 8 + i) % 2 == 0 { [205, 200, 190, 255] } else { [60, 70, 90, 255] })
        .collect();
    let checker = Some(scene.add_texture(Texture::from_srgb8("checker", 8, 8, &checker)));
    let dots: Vec<u8> = (0..32 * 32)
        .flat_map(|i: i32| {
            let (x, y) = (f64::from(i % 16) - 7.5, f64::from(i / 32 % 16) - 7.5);
            [90, 160, 60, if x * x + y * y < 40.0 { 0 } else { 255 }]
        })
        .collect();
    let dots = Some(scene.add_texture(Texture::from_srgb8("dots", 32, 32, &dots)));
    let floor = scene.add_material(Material { specular: 0.0, ..color(0.75, 0.75, 0.75) });
    let red = scene.add_material(color(0.7, 0.12, 0.08));
    let gold = scene.add_material(Material { specular: 0.6, shininess: 60.0, ..color(0.8, 0.55, 0.15) });
    let teal = scene.add_material(color(0.08, 0.45, 0.5));
    let glass = scene.add_material(Material { opacity: 0.35, ..color(0.3, 0.7, 0.4) });
    let tiles = scene.add_material(Material { texture: checker, ..color(1.0, 1.0, 1.0) });
    let sieve =
        scene.add_material(Material { texture: dots, alpha: AlphaMode::Mask(0.5), ..color(1.0, 1.0, 1.0) });
    let lava = scene.add_material(Material { emission: Vec3::new(3.0, 1.1, 0.2), ..color(0.9, 0.4, 0.1) });
    let mut add = |name: &str, shape: Shape, material: usize, at: [f64; 3], turned: DMat3| {
        let place = DAffine3::from_mat3_translation(turned, at.into());
        scene.objects.push(Object::new(name, shape, material).placed(place));
    };
    let body = Shape::Primitive;
    let still = DMat3::IDENTITY;
    add("floor", body(Primitive::Plane { width: 30.0, depth: 30.0 }), floor, [0.0; 3], still);
    add("sphere", body(Primitive::Sphere { radius: 0.7 }), red, [-1.2, 0.7, 0.6], still);
    let turned = DMat3::from_rotation_y(0.6);
    add("box", body(Primitive::Box { size: DVec3::splat(0.9) }), teal, [0.3, 0.45, 2.4], turned);
    add("glass", body(Primitive::Box { size: DVec3::splat(1.1) }), glass, [1.0, 0.55, 3.6], turned);
    let torus = body(Primitive::Torus { major: 0.7, minor: 0.25 });
    add("torus", torus, gold, [1.4, 0.95, 0.6], DMat3::from_rotation_x(1.1));
    let wall = Mesh {
        positions: [[-1.0, 0.0], [1.0, 0.0], [1.0, 1.6], [-1.0, 1.6]]
            .map(|[x, y]| Vec3::new(x, y, 0.0))
            .into(),
        uvs: [[0.0, 1.6], [2.0, 1.6], [2.0, 0.0], [0.0, 0.0]].map(Vec2::from_array).into(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    add("textured", Shape::Mesh(wall.clone()), tiles, [-2.8, 0.0, -0.8], DMat3::from_rotation_y(0.5));
    add("sieve", Shape::Mesh(wall), sieve, [3.6, 0.0, 0.8], DMat3::from_rotation_y(-0.6));
    let height =
        |i: u32| (f64::from(i % 24) * 0.8).sin() as f32 * 0.2 + (f64::from(i / 24) * 0.5).cos() as f32 * 0.2;
    let hills = HeightField::new(24, 24, DVec2::new(2.4, 2.4), (0..24 * 24).map(height).collect())?;
    add("hills", Shape::HeightField(hills), teal, [-3.4, 0.4, 2.6], still);
    let voxels = Voxels::from_fn([5, 4, 5], |x, y, z| match (x, y, z) {
        (2, 3, 2) => 2,
        (x, y, z) if x.abs_diff(2) + z.abs_diff(2) + y < 4 => 1,
        _ => 0,
    });
    add("voxels", Shape::Voxels(voxels), teal, [-1.0, 0.0, 3.0], DMat3::from_diagonal(DVec3::splat(0.15)));
    if let Some(object) = scene.objects.last_mut() {
        object.materials = vec![teal, lava];
    }
    scene.lights.push(Light { intensity: 0.9, ..Light::directional(DVec3::new(-0.5, -1.0, -0.45)) });
    scene.lights.push(Light::point(DVec3::new(0.2, 2.6, 1.2), 1.5));
    Ok(scene)
}
