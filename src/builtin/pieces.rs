//! The pieces on show: each adds one thing with its materials to a scene.

use super::figure;
use super::noise::fractal;
use crate::scene::{
    Form, FreeForm, HeightField, Mesh, Object, Perturbation, Power, Primitive, Samples, Scene, Shape,
    Texture, TransferFunction, TransferPoint, Volume, color_text,
};
use crate::scene::{Mapping, Material};
use glam::{DAffine3, DQuat, DVec2, DVec3, Vec2, Vec3};
use std::f64::consts::{PI, TAU};

fn material(scene: &mut Scene, name: &str, color: &str) -> usize {
    let base_color = color_text::parse_hex(color).unwrap_or(Vec3::ONE);
    scene.add_material(Material { name: name.to_owned(), ..Material::new(base_color) })
}

fn shiny(scene: &mut Scene, name: &str, color: &str, specular: f32, shininess: f32) -> usize {
    let index = material(scene, name, color);
    let m = &mut scene.materials[index];
    (m.specular, m.shininess) = (specular, shininess);
    index
}

fn add(scene: &mut Scene, name: &str, shape: Primitive, material: usize, place: DAffine3) {
    scene.objects.push(Object::new(name, Shape::Primitive(shape), material).placed(place));
}

/// A round stone to put something on; its top is at `height` over `foot`.
pub(super) fn plinth(scene: &mut Scene, name: &str, foot: DVec3, radius: f64, height: f64) {
    let stone = material(scene, "stone", "#b8afa2");
    let place = DAffine3::from_translation(foot + DVec3::Y * (height * 0.5));
    add(scene, name, Primitive::Cylinder { radius, height }, stone, place);
}

/// Hills around a clearing, 10 m x 10 m, grass and rock by a generated texture.
pub(super) fn terrain(scene: &mut Scene) {
    const SAMPLES: u32 = 129;
    let extent = 10.0;
    let mut heights = Vec::with_capacity((SAMPLES * SAMPLES) as usize);
    for row in 0..SAMPLES {
        for column in 0..SAMPLES {
            let place = DVec2::new(f64::from(column), f64::from(row)) / f64::from(SAMPLES - 1) * extent
                - extent * 0.5;
            let hills = ((place - DVec2::new(0.0, 0.6)).length() / 2.9 - 0.75).clamp(0.0, 1.0);
            let rough = fractal(DVec3::new(place.x * 0.8, 3.7, place.y * 0.8), 5);
            heights.push((hills * hills * (0.3 + 2.0 * rough) - 0.03 + 0.05 * rough * (1.0 - hills)) as f32);
        }
    }
    let texture = scene.add_texture(meadow(&heights, SAMPLES));
    let ground = material(scene, "meadow", "#ffffff");
    scene.materials[ground].texture = Some(texture);
    scene.materials[ground].specular = 0.0;
    if let Ok(field) = HeightField::new(SAMPLES, SAMPLES, DVec2::splat(extent), heights) {
        scene.objects.push(Object::new("terrain", Shape::HeightField(field), ground));
    }
}

/// Paints grass on flat ground, rock on slopes, with a little noise.
fn meadow(heights: &[f32], samples: u32) -> Texture {
    let size = 256;
    let height = |x: u32, y: u32| heights[(y.min(samples - 1) * samples + x.min(samples - 1)) as usize];
    let mut pixels = Vec::with_capacity((size * size * 4) as usize);
    for y in 0..size {
        for x in 0..size {
            let (column, row) = (x * (samples - 1) / size, y * (samples - 1) / size);
            let slope = (height(column + 1, row) - height(column, row)).abs()
                + (height(column, row + 1) - height(column, row)).abs();
            let rock = (slope * 14.0 - 0.35).clamp(0.0, 1.0);
            let grain = fractal(DVec3::new(f64::from(x) * 0.11, 0.0, f64::from(y) * 0.11), 4) as f32;
            let grass = Vec3::new(96.0, 128.0, 62.0) * (0.75 + 0.5 * grain);
            let stone = Vec3::new(142.0, 132.0, 120.0) * (0.75 + 0.5 * grain);
            let color = grass.lerp(stone, rock).to_array().map(|c| c.clamp(0.0, 255.0) as u8);
            pixels.extend([color[0], color[1], color[2], 255]);
        }
    }
    let mut texture = Texture::from_srgb8("meadow", size, size, &pixels);
    texture.wrap = [crate::scene::TextureWrap::Clamp; 2];
    texture
}

/// A free form: a body of second order with bumps, dents and a hole, and a ring through it.
pub(super) fn sculpture(scene: &mut Scene, foot: DVec3) {
    let ball = |center: [f64; 3], radii: [f64; 3]| Form::Ellipsoid {
        center: DVec3::from_array(center),
        radii: DVec3::from_array(radii),
    };
    let bend = |weight: f64, power: Power, function: Form| Perturbation { weight, power, function };
    let body = Form::Perturbed {
        base: Box::new(ball([0.0, 0.62, 0.0], [0.36, 0.56, 0.30])),
        terms: vec![
            bend(2.4, Power::Cube, ball([0.26, 1.02, 0.05], [0.34, 0.30, 0.30])),
            bend(1.9, Power::Square, ball([-0.28, 0.35, 0.10], [0.30, 0.26, 0.28])),
            bend(-2.2, Power::Square, ball([-0.22, 0.86, 0.24], [0.30, 0.26, 0.30])),
            bend(-1.5, Power::Cube, ball([0.30, 0.52, 0.22], [0.28, 0.24, 0.26])),
            bend(
                1.4,
                Power::Square,
                Form::Perturbed {
                    base: Box::new(ball([0.05, 0.18, -0.05], [0.42, 0.16, 0.38])),
                    terms: vec![bend(-0.8, Power::Square, ball([0.2, 0.2, 0.25], [0.2, 0.2, 0.2]))],
                },
            ),
        ],
    };
    let hole = Form::Cylinder {
        center: DVec3::new(0.03, 0.68, 0.0),
        axis: DVec3::new(0.25, 0.1, 1.0),
        radius: 0.10,
    };
    let bronze = shiny(scene, "bronze", "#b4763c", 0.55, 48.0);
    let form = Form::Difference(Box::new(body), Box::new(hole));
    if let Ok(form) = FreeForm::new(form) {
        scene.objects.push(Object::new("sculpture", Shape::FreeForm(form), bronze).at(foot));
    }
}

/// A voxel figure, 1.4 m high.
pub(super) fn figure(scene: &mut Scene, foot: DVec3) {
    let grid = figure::robot();
    let size = DVec3::from_array(grid.size().map(f64::from));
    let edge = 1.4 / size.y;
    let first = scene.materials.len();
    for color in figure::COLORS {
        shiny(scene, "voxel paint", color, 0.15, 24.0);
    }
    let mut object = Object::new("gardener", Shape::Voxels(grid), first);
    object.materials = (first..first + figure::COLORS.len()).collect();
    let turn = DQuat::from_rotation_y(0.35);
    let place = DAffine3::from_rotation_translation(turn, foot)
        * DAffine3::from_scale(DVec3::splat(edge))
        * DAffine3::from_translation(DVec3::new(-size.x * 0.5, 0.0, -size.z * 0.5));
    scene.objects.push(object.placed(place));
}

/// A still life of parametric bodies on the ground.
pub(super) fn polyhedra(scene: &mut Scene) {
    let at = |x: f64, y: f64, z: f64, turn: f64| {
        DAffine3::from_rotation_translation(DQuat::from_rotation_y(turn), DVec3::new(x, y, z))
    };
    let red = shiny(scene, "lacquer", "#b5382d", 0.4, 64.0);
    let blue = shiny(scene, "glaze", "#33608f", 0.4, 64.0);
    let ocher = shiny(scene, "clay", "#cf9c4a", 0.1, 16.0);
    let white = shiny(scene, "plaster", "#dcd7cb", 0.05, 16.0);
    add(scene, "hexagonal prism", Primitive::prism(6, 0.26, 0.5), blue, at(-0.55, 0.25, 0.15, 0.2));
    let pyramid = Primitive::Frustum { sides: 4, lower_radius: 0.36, upper_radius: 0.0, height: 0.56 };
    add(scene, "pyramid", pyramid, ocher, at(0.1, 0.28, -0.3, 0.5));
    let frustum = Primitive::Frustum { sides: 8, lower_radius: 0.27, upper_radius: 0.16, height: 0.32 };
    add(scene, "octagonal frustum", frustum, white, at(0.62, 0.16, 0.2, 0.1));
    add(scene, "ball", Primitive::Sphere { radius: 0.17 }, red, at(0.62, 0.49, 0.2, 0.0));
    let ring =
        DAffine3::from_rotation_translation(DQuat::from_rotation_x(1.25), DVec3::new(0.02, 0.21, 0.42));
    add(scene, "ring", Primitive::Torus { major: 0.17, minor: 0.055 }, red, ring);
    add(scene, "cone", Primitive::Cone { radius: 0.2, height: 0.42 }, white, at(-0.18, 0.21, 0.02, 0.0));
    let tilted =
        DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.9), DVec3::new(-0.72, 0.11, 0.72));
    add(scene, "box", Primitive::Box { size: DVec3::new(0.3, 0.22, 0.24) }, ocher, tilted);
}

/// A vase turned from a profile, with a painted meander.
pub(super) fn vase(scene: &mut Scene, foot: DVec3) {
    let (rings, around) = (48u32, 96u32);
    let radius =
        |t: f64| 0.15 + 0.17 * (PI * (t * 0.92 + 0.02)).sin().powf(1.3) + 0.09 * (t - 0.86).max(0.0) / 0.14;
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        let t = f64::from(ring) / f64::from(rings);
        let slope = (radius(t + 1e-4) - radius(t - 1e-4)) / 2e-4 / 0.85;
        for step in 0..=around {
            let angle = TAU * f64::from(step % around) / f64::from(around);
            let outward = DVec3::new(angle.cos(), 0.0, angle.sin());
            mesh.positions.push((outward * radius(t) + DVec3::Y * (t * 0.85)).as_vec3());
            mesh.normals.push((outward - DVec3::Y * slope).normalize_or(outward).as_vec3());
            mesh.uvs.push(Vec2::new(step as f32 / around as f32 * 6.0, 1.0 - t as f32));
        }
    }
    let columns = around + 1;
    for ring in 0..rings {
        for step in 0..around {
            let a = ring * columns + step;
            mesh.triangles.push([a, a + columns, a + 1]);
            mesh.triangles.push([a + 1, a + columns, a + columns + 1]);
        }
    }
    let texture = scene.add_texture(meander());
    let clay = shiny(scene, "painted clay", "#ffffff", 0.35, 40.0);
    scene.materials[clay].texture = Some(texture);
    scene.objects.push(Object::new("vase", Shape::Mesh(mesh), clay).at(foot));
}

/// Bands and a Greek meander on clay.
fn meander() -> Texture {
    const KEY: [&str; 8] =
        ["########", "#.......", "#.#####.", "#.#...#.", "#.###.#.", "#.....#.", "#######.", "........"];
    let (width, height) = (128u32, 256u32);
    let (clay, black, cream) = ([196, 110, 62], [38, 32, 34], [232, 208, 168]);
    let mut pixels = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        for x in 0..width {
            let color = match y {
                0..=15 | 240..=255 => black,
                30..=35 | 130..=135 | 208..=213 => cream,
                60..=123 => {
                    let (column, row) = ((x / 8 % 8) as usize, ((y - 60) / 8) as usize);
                    if KEY[row].as_bytes()[column] == b'#' { black } else { clay }
                }
                150..=195 if (x / 16 + (y - 150) / 16).is_multiple_of(2) => black,
                _ => clay,
            };
            pixels.extend([color[0], color[1], color[2], 255u8]);
        }
    }
    Texture::from_srgb8("meander", width, height, &pixels)
}

/// A cloud in a glass ball, 0.9 m across.
pub(super) fn cloud(scene: &mut Scene, foot: DVec3) {
    const SAMPLES: u32 = 48;
    let (radius, spacing) = (0.45, 0.9 / f64::from(SAMPLES));
    let mut values = Vec::with_capacity((SAMPLES as usize).pow(3));
    for z in 0..SAMPLES {
        for y in 0..SAMPLES {
            for x in 0..SAMPLES {
                let p = (DVec3::new(f64::from(x), f64::from(y), f64::from(z)) + 0.5) * spacing - radius;
                let fall = 1.0 - (p * DVec3::new(1.0, 1.35, 1.0)).length() / 0.40;
                let billow = fractal(p * 9.0 + 5.0, 4) - 0.5;
                values.push(((fall + billow * 1.3).clamp(0.0, 1.0) * 255.0) as u8);
            }
        }
    }
    let center = foot + DVec3::Y * radius;
    if let Ok(mut volume) = Volume::new([SAMPLES; 3], DVec3::splat(spacing), Samples::U8(values)) {
        let point = |value: f32, color: &str, opacity: f32| TransferPoint {
            value,
            color: color_text::parse_hex(color).unwrap_or(Vec3::ONE),
            opacity,
        };
        volume.transfer = TransferFunction {
            points: vec![
                point(20.0, "#c9d3e6", 0.0),
                point(70.0, "#e6e2ea", 0.16),
                point(150.0, "#ffffff", 0.5),
                point(220.0, "#fff1d6", 0.7),
            ],
            reference_length: spacing,
        };
        let shell = Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::splat(radius * 0.97) };
        volume.shell = FreeForm::new(shell).ok();
        let vapor = material(scene, "vapor", "#ffffff");
        scene.materials[vapor].specular = 0.0;
        scene.objects.push(Object::new("cloud", Shape::Volume(volume), vapor).at(center));
    }
    let glass = shiny(scene, "glass", "#d8ecf2", 0.7, 180.0);
    scene.materials[glass].opacity = 0.16;
    let place = DAffine3::from_translation(center);
    add(scene, "glass ball", Primitive::Sphere { radius }, glass, place);
}

/// Lays a texture on a material by triplanar projection.
pub(super) fn speckle(scene: &mut Scene, material: usize) {
    let size = 128u32;
    let mut pixels = Vec::with_capacity((size * size * 4) as usize);
    for y in 0..size {
        for x in 0..size {
            // Around a torus in noise space, so that the picture repeats without a seam.
            let (a, b) = (TAU * f64::from(x) / f64::from(size), TAU * f64::from(y) / f64::from(size));
            let p = DVec3::new(a.cos() * 2.0 + b.cos() * 1.3, a.sin() * 2.0 + b.sin() * 1.3, (a + b).sin());
            let v = (190.0 + 65.0 * (fractal(p * 3.0, 4) - 0.2)).clamp(0.0, 255.0) as u8;
            pixels.extend([v, v, v, 255]);
        }
    }
    let texture = scene.add_texture(Texture::from_srgb8("speckle", size, size, &pixels));
    scene.materials[material].texture = Some(texture);
    scene.materials[material].mapping = Mapping::Triplanar { scale: 1.5 };
}
