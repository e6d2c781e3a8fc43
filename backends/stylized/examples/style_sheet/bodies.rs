//! Which bodies stand on the sheet of styles?

use glam::{DAffine3, DMat3, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::{Converter, Detail};
use polyptych_core::load::{LoadOptions, load};
use polyptych_core::scene::{
    Background, Form, FreeForm, Light, Mapping, Material, Mesh, Object, Perturbation, Power, Scene, Shape,
    Texture, Voxels, color_text,
};
use polyptych_core::seam::Control;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// A scene and the direction from which it is seen, degrees.
pub(crate) type Stand = (Arc<Scene>, [f64; 2]);

/// Returns five bodies: a hare, a bird, an aircraft with a texture, a figure of voxels and a free form. Where there is
/// a folder of models, the first three are read from it.
pub(crate) fn all(models: Option<&Path>) -> Result<Vec<Stand>, Box<dyn Error>> {
    let read = |name: &str, color: Option<&str>| -> Result<Scene, Box<dyn Error>> {
        let folder = models.ok_or("there is no folder of models")?;
        let mut scene = load(&folder.join(name), &LoadOptions::default())?;
        if let (Some(color), Some(material)) = (color, scene.materials.first_mut()) {
            material.base_color = color_text::parse_hex(color)?;
            material.specular = 0.25;
        }
        Ok(scene)
    };
    let mut stands = if models.is_some() {
        vec![
            (read("stanford-bunny.obj", Some("#b98a62"))?, [20.0, 14.0]),
            (read("spot/spot.obj", None)?, [215.0, 14.0]),
            (read("F-15-lowpoly/F-15-lowpoly.obj", None)?, [125.0, 22.0]),
        ]
    } else {
        vec![(hare()?, [-38.0, 12.0]), (bird()?, [-52.0, 10.0]), (aircraft(), [140.0, 24.0])]
    };
    stands.push((figure()?, [28.0, 14.0]));
    stands.push((sculpture()?, [30.0, 16.0]));
    let light = |(mut scene, [azimuth, elevation]): (Scene, [f64; 2])| {
        // From over the viewer's left shoulder, so that light and shade lie alike on all of them.
        let camera = Camera::framing(
            &scene.bounds(),
            azimuth.to_radians(),
            elevation.to_radians(),
            1.0,
            Projection::Perspective { fov_y: 0.5 },
        );
        let from = camera.right() * -0.62 + camera.up() * 0.62 - camera.forward() * 0.48;
        scene.lights = vec![Light::directional(-from)];
        scene.environment.background = Background::Solid(Vec3::splat(0.86));
        (Arc::new(scene), [azimuth, elevation])
    };
    Ok(stands.into_iter().map(light).collect())
}

fn blob(center: [f64; 3], radii: [f64; 3]) -> Form {
    Form::Ellipsoid { center: center.into(), radii: radii.into() }
}

/// Melts bodies together.
fn melted(parts: Vec<Form>, k: f64) -> Form {
    let mut parts = parts.into_iter();
    let first = parts.next().unwrap_or(Form::Union(Vec::new()));
    parts.fold(first, |a, b| Form::SmoothUnion { a: Box::new(a), b: Box::new(b), k })
}

/// Turns a form into a mesh, so that it is drawn as one.
fn mesh_of(name: &str, form: Form, color: &str) -> Result<Scene, Box<dyn Error>> {
    let mut scene = Scene { name: name.to_owned(), ..Scene::default() };
    let material = Material { specular: 0.25, ..Material::new(color_text::parse_hex(color)?) };
    let material = scene.add_material(material);
    let object = Object::new(name, Shape::FreeForm(FreeForm::new(form)?), material);
    let detail = Detail { tolerance: object.bounds().radius() * 1e-3, max_resolution: 128 };
    let model = Converter::default().mesh(&scene, &object, detail, &Control::simple())?;
    scene.objects.push(Object::new(name, Shape::Mesh(model.mesh.clone()), material));
    Ok(scene)
}

fn hare() -> Result<Scene, Box<dyn Error>> {
    let body = melted(
        vec![
            blob([0.0, 0.46, -0.12], [0.4, 0.42, 0.5]),
            blob([0.0, 0.62, 0.22], [0.27, 0.34, 0.27]),
            blob([0.0, 0.98, 0.36], [0.22, 0.22, 0.27]),
            blob([0.0, 0.9, 0.58], [0.12, 0.1, 0.12]),
            blob([0.3, 0.26, -0.2], [0.2, 0.27, 0.33]),
            blob([-0.3, 0.26, -0.2], [0.2, 0.27, 0.33]),
            blob([0.3, 0.07, 0.08], [0.1, 0.075, 0.27]),
            blob([-0.3, 0.07, 0.08], [0.1, 0.075, 0.27]),
            blob([0.12, 0.24, 0.42], [0.09, 0.28, 0.1]),
            blob([-0.12, 0.24, 0.42], [0.09, 0.28, 0.1]),
            blob([0.0, 0.34, -0.66], [0.13, 0.13, 0.12]),
        ],
        0.16,
    );
    let ears =
        [blob([0.13, 1.42, 0.18], [0.085, 0.34, 0.06]), blob([-0.13, 1.42, 0.18], [0.085, 0.34, 0.06])];
    let [left, right] = ears;
    let whole = melted(vec![body, left, right], 0.05);
    let eyes = vec![blob([0.185, 1.03, 0.47], [0.045; 3]), blob([-0.185, 1.03, 0.47], [0.045; 3])];
    mesh_of("hare", Form::Union([vec![whole], eyes].concat()), "#b98a62")
}

fn bird() -> Result<Scene, Box<dyn Error>> {
    let body = melted(
        vec![
            blob([0.0, 0.62, 0.0], [0.3, 0.34, 0.46]),
            blob([0.0, 0.98, 0.3], [0.22, 0.22, 0.22]),
            blob([0.0, 0.72, -0.62], [0.11, 0.06, 0.36]),
            blob([0.0, 0.78, -0.66], [0.2, 0.035, 0.2]),
        ],
        0.14,
    );
    let wings =
        vec![blob([0.3, 0.68, -0.12], [0.06, 0.19, 0.38]), blob([-0.3, 0.68, -0.12], [0.06, 0.19, 0.38])];
    let rest = vec![
        blob([0.0, 0.96, 0.57], [0.055, 0.05, 0.17]),
        blob([0.16, 1.04, 0.42], [0.05; 3]),
        blob([-0.16, 1.04, 0.42], [0.05; 3]),
        blob([0.1, 0.16, 0.06], [0.035, 0.2, 0.035]),
        blob([-0.1, 0.16, 0.06], [0.035, 0.2, 0.035]),
        blob([0.1, 0.02, 0.12], [0.08, 0.025, 0.14]),
        blob([-0.1, 0.02, 0.12], [0.08, 0.025, 0.14]),
    ];
    mesh_of("bird", Form::Union([vec![body], wings, rest].concat()), "#5f9bb5")
}

/// A small jet of quads: a fuselage lofted through rings, and flat surfaces with a thickness.
fn aircraft() -> Scene {
    let mut mesh = Mesh::default();
    // Along the fuselage: place, half width, half height, height of the axis.
    let rings: [[f32; 4]; 10] = [
        [2.0, 0.015, 0.015, 0.0],
        [1.75, 0.09, 0.08, 0.0],
        [1.4, 0.17, 0.15, 0.01],
        [1.0, 0.23, 0.24, 0.05],
        [0.7, 0.26, 0.3, 0.08],
        [0.3, 0.3, 0.25, 0.04],
        [-0.4, 0.33, 0.22, 0.02],
        [-1.0, 0.3, 0.2, 0.02],
        [-1.5, 0.22, 0.18, 0.02],
        [-1.62, 0.17, 0.14, 0.02],
    ];
    const SIDES: u32 = 20;
    for [z, wide, high, up] in rings {
        for side in 0..=SIDES {
            let angle = side as f32 / SIDES as f32 * std::f32::consts::TAU;
            let (sin, cos) = angle.sin_cos();
            mesh.positions.push(Vec3::new(sin * wide, up + cos * high, z));
            mesh.normals
                .push(Vec3::new(sin / wide.max(0.05), cos / high.max(0.05), 0.0).normalize_or(Vec3::Z));
            mesh.uvs.push([(2.0 - z) / 3.62, side as f32 / SIDES as f32 * 0.5].into());
        }
    }
    let row = SIDES + 1;
    for ring in 0..rings.len() as u32 - 1 {
        for side in 0..SIDES {
            let [a, b] = [ring * row + side, ring * row + side + 1];
            mesh.triangles.extend([[a, a + row, b], [b, a + row, b + row]]);
        }
    }
    let last = (rings.len() as u32 - 1) * row;
    for side in 1..SIDES - 1 {
        mesh.triangles.push([last, last + side, last + side + 1].map(|i| i));
    }
    // Wings, tail planes, fins: outlines from above as [across, along], with a height and a lean.
    let wing = [[0.2, 0.75], [0.3, 0.35], [1.55, -0.75], [1.55, -1.05], [0.25, -0.8]];
    let tail = [[0.2, -1.1], [0.75, -1.55], [0.75, -1.78], [0.18, -1.62]];
    let fin = [[0.1, -0.7], [0.62, -1.5], [0.62, -1.78], [0.1, -1.6]];
    for side in [1.0, -1.0f32] {
        plate(&mut mesh, &wing, |[x, z]| Vec3::new(x * side, 0.0 - x * 0.04, z), Vec3::Y * 0.035, side);
        plate(&mut mesh, &tail, |[x, z]| Vec3::new(x * side, 0.02, z), Vec3::Y * 0.025, side);
        let lean = |[up, z]: [f32; 2]| Vec3::new((0.2 + up * 0.22) * side, up + 0.05, z);
        plate(&mut mesh, &fin, lean, Vec3::X * 0.025, -side);
    }
    let mut scene = Scene { name: "aircraft".to_owned(), ..Scene::default() };
    let texture = scene.add_texture(livery());
    let paint =
        Material { specular: 0.3, texture: Some(texture), mapping: Mapping::Uv, ..Material::new(Vec3::ONE) };
    let paint = scene.add_material(paint);
    scene.objects.push(Object::new("aircraft", Shape::Mesh(mesh), paint));
    scene
}

/// Adds a flat surface of some thickness with sharp edges.
fn plate(
    mesh: &mut Mesh,
    outline: &[[f32; 2]],
    place: impl Fn([f32; 2]) -> Vec3,
    thickness: Vec3,
    side: f32,
) {
    let corner = |mesh: &mut Mesh, at: [f32; 2], shift: f32, normal: Vec3| {
        mesh.positions.push(place(at) + thickness * shift);
        mesh.normals.push(normal);
        mesh.uvs.push([(1.0 - at[1]) / 3.0, 0.55 + 0.43 * at[0] / 1.6].into());
        mesh.positions.len() as u32 - 1
    };
    let up = thickness.normalize_or(Vec3::Y);
    for shift in [0.5, -0.5f32] {
        let corners: Vec<u32> = outline.iter().map(|&at| corner(mesh, at, shift, up * shift * 2.0)).collect();
        for i in 1..corners.len() - 1 {
            let [a, b, c] = [corners[0], corners[i], corners[i + 1]];
            mesh.triangles.push(if shift * side > 0.0 { [a, b, c] } else { [a, c, b] });
        }
    }
    for i in 0..outline.len() {
        let (from, to) = (outline[i], outline[(i + 1) % outline.len()]);
        let out = (place(to) - place(from)).cross(up).normalize_or(Vec3::X) * -side;
        let [a, b] = [0.5, -0.5].map(|shift| corner(mesh, from, shift, out));
        let [c, d] = [0.5, -0.5].map(|shift| corner(mesh, to, shift, out));
        let quad = if side > 0.0 { [[a, b, c], [c, b, d]] } else { [[a, c, b], [c, d, b]] };
        mesh.triangles.extend(quad);
    }
}

/// Paints the aircraft: two grays in splinters, a cockpit, bands and a red nose.
fn livery() -> Texture {
    let size = 256u32;
    let mut pixels = Vec::with_capacity((size * size * 4) as usize);
    for y in 0..size {
        for x in 0..size {
            let [u, v] = [x, y].map(|c| c as f32 / size as f32);
            let splinter = ((u * 7.0 + v * 3.0).floor() as i32 + (u * 4.0 - v * 6.0).floor() as i32) % 3;
            let mut color = if splinter == 0 { [118, 134, 148] } else { [172, 182, 188] };
            if v < 0.5 {
                let around = (v * 2.0 + 0.5).fract() - 0.5;
                let is_cockpit = (0.24..0.44).contains(&u) && around.abs() < 0.16;
                color = match u {
                    u if u < 0.1 => [196, 62, 44],
                    _ if is_cockpit => [34, 46, 66],
                    u if (0.2..0.22).contains(&u) || u > 0.93 => [58, 62, 70],
                    _ => color,
                };
            } else {
                let out = (v - 0.55) / 0.43;
                if (0.82..0.93).contains(&out) {
                    color = [196, 62, 44];
                }
                let [p, q] = [u - 0.47, (out - 0.55) * 0.53];
                match p.hypot(q) {
                    r if r < 0.03 => color = [240, 236, 224],
                    r if r < 0.062 => color = [38, 66, 128],
                    _ => {}
                }
            }
            pixels.extend([color[0], color[1], color[2], 255]);
        }
    }
    Texture::from_srgb8("livery", size, size, &pixels)
}

/// A gnome of cubes with a lantern.
fn figure() -> Result<Scene, Box<dyn Error>> {
    const COLORS: [&str; 8] =
        ["#b8342c", "#f2cda4", "#f4f1ea", "#35658c", "#5a3d28", "#2c2a2e", "#e6b84a", "#7d9a4f"];
    let voxels = Voxels::from_fn([20, 36, 16], |x, y, z| {
        let [dx, dz] = [x as i32 * 2 - 18, z as i32 * 2 - 15];
        let round = dx * dx + dz * dz;
        let is_in = |x0: u32, x1: u32, y0: u32, y1: u32, z0: u32, z1: u32| {
            (x0..=x1).contains(&x) && (y0..=y1).contains(&y) && (z0..=z1).contains(&z)
        };
        let color = match y {
            _ if is_in(16, 18, 9, 12, 11, 13) => 7,
            _ if is_in(16, 18, 13, 13, 11, 13) || is_in(17, 17, 14, 16, 12, 12) => 6,
            0..=1 if is_in(5, 8, 0, 1, 5, 11) || is_in(10, 13, 0, 1, 5, 11) => 6,
            2..=5 if is_in(5, 8, 2, 5, 5, 9) || is_in(10, 13, 2, 5, 5, 9) => 5,
            _ if is_in(2, 3, 9, 15, 6, 9) || is_in(15, 16, 14, 16, 6, 13) => 4,
            _ if is_in(2, 3, 7, 8, 6, 9) => 2,
            11..=18 if z > 10 && (dx * dx) < 10 * (y as i32 - 9) && z < 14 - (18 - y) / 4 => 3,
            19..=20 if z > 11 && z < 14 && dx.abs() < 3 => 2,
            6..=7 if round < 120 => 6,
            8..=16 if round < 120 - (y as i32 - 8) * 4 => 4,
            17..=21 if round < 90 => 2,
            22..=23 if round < 150 => 1,
            24..=34 if round < (36 - y as i32) * (36 - y as i32) / 2 + 2 => 1,
            35 if round < 8 => 3,
            _ => 0,
        };
        // Eyes.
        if y == 21 && z == 11 && (x == 7 || x == 11) { 6 } else { color }
    });
    let mut scene = Scene { name: "figure".to_owned(), ..Scene::default() };
    let mut slots = Vec::new();
    for color in COLORS {
        slots.push(scene.add_material(Material::new(color_text::parse_hex(color)?)));
    }
    let place = DAffine3::from_mat3(DMat3::from_diagonal(DVec3::splat(1.0 / 36.0)));
    let object = Object::new("figure", Shape::Voxels(voxels), 0).placed(place);
    scene.objects.push(Object { materials: slots, ..object });
    Ok(scene)
}

/// A quadric that is bent, with a hole.
fn sculpture() -> Result<Scene, Box<dyn Error>> {
    let bend = |weight: f64, function: Form| Perturbation { weight, power: Power::Square, function };
    let bent = Form::Perturbed {
        base: Box::new(blob([0.0, 0.6, 0.0], [0.5, 0.62, 0.42])),
        terms: vec![
            bend(1.6, blob([0.34, 1.0, 0.1], [0.34, 0.42, 0.4])),
            bend(1.3, blob([-0.36, 0.34, 0.12], [0.36, 0.34, 0.42])),
            bend(-1.2, blob([-0.3, 1.0, 0.24], [0.34, 0.36, 0.4])),
        ],
    };
    let hole = Form::Cylinder {
        center: DVec3::new(0.04, 0.62, 0.0),
        axis: DVec3::new(0.15, 0.1, 1.0),
        radius: 0.19,
    };
    let form = Form::Difference(Box::new(bent), Box::new(hole));
    let mut scene = Scene { name: "sculpture".to_owned(), ..Scene::default() };
    let bronze =
        Material { specular: 0.5, shininess: 40.0, ..Material::new(color_text::parse_hex("#b5773c")?) };
    let bronze = scene.add_material(bronze);
    scene.objects.push(Object::new("sculpture", Shape::FreeForm(FreeForm::new(form)?), bronze));
    Ok(scene)
}
