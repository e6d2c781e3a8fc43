//! Is a texture read only where it is seen? Alone in its program, since reads are counted for all of it.

mod common;

use common::studio;
use polyptych::framebuffer::{Channel, Channels};
use polyptych::prelude::*;
use polyptych::scene::{Mesh, NormalMap, Primitive, texture_lookups};
use std::sync::Arc;

const SIZE: [u32; 2] = [96, 64];

/// A textured box, and a wall that hides it or stands beside.
fn scene(wall_z: f64) -> Arc<Scene> {
    let mut scene = Scene::default();
    let checks: Vec<u8> = (0..64).flat_map(|i| [if (i + i / 8) % 2 == 0 { 230 } else { 30 }; 4]).collect();
    let texture = Some(scene.add_texture(Texture::from_srgb8("checks", 8, 8, &checks)));
    let checked = scene.add_material(Material { texture, ..Material::new(Vec3::ONE) });
    let plain = scene.add_material(Material::new(Vec3::new(0.5, 0.6, 0.7)));
    let body = |size: DVec3| Shape::Primitive(Primitive::Box { size });
    scene.objects.push(Object::new("checked", body(DVec3::splat(1.5)), checked));
    scene.objects.push(Object::new("wall", body(DVec3::new(9.0, 9.0, 0.1)), plain).at(DVec3::Z * wall_z));
    scene.lights.push(Light::directional(DVec3::new(-0.4, -1.0, -0.7)));
    let view = Projection::Perspective { fov_y: 0.8 };
    let eye = DVec3::new(0.6, 0.8, 5.0);
    scene.cameras.push(("front".to_owned(), Camera::look_at(eye, DVec3::ZERO, DVec3::Y, view)));
    Arc::new(scene)
}

#[test]
fn textures_are_read_once_where_they_are_seen_and_never_elsewhere() {
    let (seen, hidden) = (scene(-2.0), scene(2.0));
    for backend in ["reference", "raster", "voxel", "freeform"] {
        let mut studio = studio(1);
        let mut lookups = |scene: &Arc<Scene>, channels: Channels| {
            let need = Need { channels, ..Need::new(scene.cameras[0].1.clone(), SIZE[0], SIZE[1]) };
            studio.prepare(backend, scene, &need).unwrap();
            let mut picture = Framebuffer::new(SIZE[0], SIZE[1], channels);
            let before = texture_lookups();
            studio.render(backend, &need.frame(), &mut picture).unwrap();
            (texture_lookups() - before, picture)
        };
        let id = Channels::COLOR.with(Channel::Id);
        let (count, picture) = lookups(&seen, id);
        let pixels = picture.id().iter().filter(|&&id| id == 1).count() as u64;
        assert!(pixels > 500, "{backend}: the box is seen on {pixels} pixels");
        if backend == "voxel" {
            // What became voxels has one color each: no texture is left to be read.
            assert_eq!(count, 0);
            continue;
        }
        assert!(
            count >= pixels && count <= pixels + pixels / 10,
            "{backend}: {count} reads for {pixels} pixels"
        );
        assert_eq!(lookups(&hidden, id).0, 0, "{backend}: nobody sees it");
        let shape = Channels::of(&[Channel::Distance, Channel::Normal, Channel::Id]);
        assert_eq!(lookups(&seen, shape).0, 0, "{backend}: nobody asks for its color");
    }
    let map = relief();
    for backend in ["reference", "raster"] {
        let mut studio = studio(1);
        let mut lookups = |channels: &[Channel]| {
            let channels = Channels::of(channels);
            let need = Need { channels, ..Need::new(map.cameras[0].1.clone(), SIZE[0], SIZE[1]) };
            studio.prepare(backend, &map, &need).unwrap();
            let before = texture_lookups();
            studio.render(backend, &need.frame(), &mut Framebuffer::new(SIZE[0], SIZE[1], channels)).unwrap();
            texture_lookups() - before
        };
        for sees in [Channel::Color, Channel::Normal] {
            assert!(lookups(&[sees]) > 500, "{backend}: {sees:?} is seen to be turned");
        }
        let others = [Channel::Distance, Channel::Id, Channel::Albedo, Channel::Shadow];
        assert_eq!(lookups(&others), 0, "{backend}: nobody asks for a normal");
    }
}

/// A square with a normal map.
fn relief() -> Arc<Scene> {
    let mut scene = (*scene(-2.0)).clone();
    let texture = scene.add_texture(Texture::from_linear8("relief", 1, 1, &[200, 128, 230, 255]));
    let map = Some(NormalMap { texture, scale: 1.0 });
    let bumpy = scene.add_material(Material { normal_map: map, ..Material::new(Vec3::ONE) });
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mesh = Mesh {
        positions: corners.map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec(),
        uvs: corners.map(|[x, y]| [x, -y].into()).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    scene.objects = vec![Object::new("relief", Shape::Mesh(mesh), bumpy)];
    Arc::new(scene)
}
