//! Which cases are about textures, edges and flicker of surfaces?

use super::super::count::Count;
use super::super::scenes::{self, Setup, look, setup, studio};
use super::{Case, base, powers};
use crate::prelude::{DVec3, Material, Mesh, Object, Primitive, Shape, Texture, Vec3};
use crate::scene::TextureWrap;

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case {
            id: "texture-grazing",
            is_method: true,
            title: "Coordinates on a floor from lower and lower",
            parameter: "angle, degrees",
            values: powers(1, -4),
            limit: 0.02,
            counted: "texture lookup, 99th percentile, shares of the texture's edge",
            backends: &["raster", "freeform"],
            build: textured_floor,
            count: Count::Albedo,
            ..base()
        },
        Case {
            id: "slivers",
            title: "A quad cut into thinner and thinner slivers",
            parameter: "triangles",
            values: vec![4.0, 32.0, 256.0, 2048.0, 16_384.0, 131_072.0],
            limit: 0.0,
            counted: "share of holes",
            is_promise: true,
            backends: &["raster"],
            build: slivers,
            ..base()
        },
        Case {
            id: "t-junctions",
            title: "Two strips that share an edge, one of them cut where the other is not",
            parameter: "cuts",
            values: vec![1.0, 4.0, 16.0, 64.0, 256.0, 1024.0],
            limit: 0.0,
            counted: "share of holes",
            backends: &["raster"],
            build: t_junctions,
            count: Count::Hole,
            ..base()
        },
        Case {
            id: "coplanar-flicker",
            title: "One quad before another, nearer and nearer, under a camera that moves by 1/16 pixel",
            parameter: "separation, m",
            values: powers(-1, -9),
            limit: 0.5,
            counted: "toggling pixels beyond the reference's own, over those",
            build: scenes::coplanar,
            count: Count::Toggles,
            ..base()
        },
        Case {
            id: "thin-flicker",
            title: "A thinner and thinner rod under a camera that moves by 1/16 pixel",
            parameter: "thickness, pixels",
            values: vec![10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1],
            limit: 0.5,
            counted: "toggling pixels beyond the reference's own, over those",
            build: scenes::thin,
            count: Count::Toggles,
            ..base()
        },
        Case {
            id: "shadow-swim",
            is_method: true,
            title: "Shadows on a floor under a camera that moves by smaller and smaller steps",
            parameter: "step, pixels",
            values: vec![1.0, 0.5, 0.25, 0.125, 0.0625],
            limit: 0.5,
            counted: "pixels that turn dark or lit beyond the reference's own, over those",
            build: |step_px| Setup { step_px, ..scenes::shadow_slope(60.0) },
            count: Count::ShadowToggles,
            better: Some(("finest shadow map", scenes::fine_shadow)),
            ..base()
        },
    ]
}

/// A floor whose color says where on it one is, from so many degrees above it.
fn textured_floor(degrees: f64) -> Setup {
    const EDGE: u32 = 1024;
    let mut scene = studio();
    let texel =
        |i: u32| [(i % EDGE * 65535 / (EDGE - 1)) as u16, (i / EDGE * 65535 / (EDGE - 1)) as u16, 0, 65535];
    let mut ramp = Texture::from_linear16("ramp", EDGE, EDGE, (0..EDGE * EDGE).map(texel).collect());
    ramp.wrap = [TextureWrap::Clamp; 2];
    let texture = Some(scene.add_texture(ramp));
    let material = scene.add_material(Material { texture, ..Material::new(Vec3::ONE) });
    let floor = Shape::Primitive(Primitive::Plane { width: 20.0, depth: 20.0 });
    scene.objects.push(Object::new("floor", floor, material));
    let angle = degrees.to_radians();
    let eye = DVec3::new(0.0, angle.sin(), angle.cos()) * 9.0;
    setup(scene, look(eye, DVec3::ZERO, (angle * 1.2).clamp(1e-7, 1.0)))
}

/// A quad from corner to corner of the picture, cut into so many slivers that meet in one of them.
fn slivers(triangles: f64) -> Setup {
    let half = (triangles / 2.0).ceil() as u32;
    let mut mesh = Mesh { positions: vec![Vec3::new(-3.0, -3.0, 0.0)], ..Mesh::default() };
    for i in 0..=2 * half {
        let along = |i: u32| 6.0 * i as f32 / half as f32 - 3.0;
        let (x, y) = if i <= half { (3.0, along(i)) } else { (along(2 * half - i), 3.0) };
        mesh.positions.push(Vec3::new(x, y, 0.0));
    }
    mesh.triangles = (1..=2 * half).map(|i| [0, i, i + 1]).collect();
    let mut scene = studio();
    scene.objects.push(Object::new("slivers", Shape::Mesh(mesh), 0));
    setup(scene, look(DVec3::new(0.11, -0.07, 4.0), DVec3::ZERO, 0.6))
}

/// Two halves of a quad that meet in a slanted line; one of them has so many corners on it that the other lacks.
fn t_junctions(cuts: f64) -> Setup {
    let cuts = cuts as u32;
    let (low, high) = (Vec3::new(-0.43, -3.1, 0.0), Vec3::new(0.57, 3.3, 0.0));
    let mut mesh = Mesh {
        positions: vec![
            low,
            high,
            Vec3::new(-6.0, 3.3, 0.0),
            Vec3::new(-6.0, -3.1, 0.0),
            Vec3::new(6.0, 0.1, 0.0),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let first = mesh.positions.len() as u32;
    mesh.positions.extend((0..=cuts + 1).map(|i| low.lerp(high, i as f32 / (cuts + 1) as f32)));
    mesh.triangles.extend((0..=cuts).map(|i| [4, first + i + 1, first + i]));
    let mut scene = studio();
    scene.objects.push(Object::new("strips", Shape::Mesh(mesh), 0));
    setup(scene, look(DVec3::new(0.05, 0.02, 4.0), DVec3::new(0.05, 0.02, 0.0), 0.6))
}
