//! Scenes and pictures for the tests of the shader.

#![allow(dead_code, reason = "each test uses some")]

use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::parallel::{OneThread, Threads};
use polyptych_core::scene::{Background, Light, Material, Mesh, Object, Scene, Shape};
use polyptych_core::seam::{Control, Need, Origin, Registry, Renderer};
use polyptych_stylized::{Stroke, Stylized};
use std::sync::Arc;

/// Settings that leave nothing but black lines on white.
pub(crate) const LINES: [(&str, &str); 8] = [
    ("tone.cool", "#ffffff"),
    ("tone.warm", "#ffffff"),
    ("tone.alpha", "0"),
    ("tone.beta", "0"),
    ("specular", "off"),
    ("shadow", "false"),
    ("paper", "true"),
    ("paper.color", "#ffffff"),
];

pub(crate) fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.add(Arc::new(polyptych_raster::Factory), Origin::BuiltIn);
    registry.add(Arc::new(polyptych_reference::Factory), Origin::BuiltIn);
    registry.add(Arc::new(polyptych_voxel::Factory), Origin::BuiltIn);
    registry.add(Arc::new(polyptych_freeform::Factory), Origin::BuiltIn);
    registry
}

/// A renderer that has prepared a picture.
pub(crate) struct Easel {
    pub(crate) renderer: Stylized,
    pub(crate) need: Need,
}

impl Easel {
    pub(crate) fn new(
        scene: &Arc<Scene>,
        camera: Camera,
        [width, height]: [u32; 2],
        settings: &[(&str, &str)],
    ) -> Self {
        Self::with_channels(scene, camera, [width, height], settings, Channels::COLOR)
    }

    pub(crate) fn with_channels(
        scene: &Arc<Scene>,
        camera: Camera,
        [width, height]: [u32; 2],
        settings: &[(&str, &str)],
        channels: Channels,
    ) -> Self {
        let mut renderer = Stylized::new(registry());
        let mut need = Need { channels, ..Need::new(camera, width, height) };
        let declared = renderer.info().parameters.clone();
        for (name, value) in settings {
            need.settings.set("stylized", &declared, name, value).unwrap();
        }
        renderer.prepare(scene, &need, &Converter::default(), &Control::simple()).unwrap();
        Self { renderer, need }
    }

    pub(crate) fn picture(&mut self) -> Framebuffer {
        self.picture_from(&self.need.camera.clone(), &OneThread)
    }

    pub(crate) fn picture_from(&mut self, camera: &Camera, threads: &dyn Threads) -> Framebuffer {
        let mut picture = Framebuffer::new(self.need.width, self.need.height, self.need.channels);
        let frame = polyptych_core::seam::Frame { camera: camera.clone() };
        self.renderer.render(&frame, &mut picture, &Control::new(threads)).unwrap();
        picture
    }

    pub(crate) fn strokes(&mut self) -> Vec<Stroke> {
        let (frame, control) = (self.need.frame(), Control::simple());
        self.renderer.strokes(&frame, self.need.width, self.need.height, &control).unwrap().to_vec()
    }
}

/// A scene of some shapes, lit from `to_light`, before a plain background.
pub(crate) fn scene(shapes: Vec<(Shape, DVec3)>, to_light: DVec3) -> Arc<Scene> {
    let mut scene = Scene::default();
    scene.environment.background = Background::Solid(Vec3::ONE);
    for (i, (shape, at)) in shapes.into_iter().enumerate() {
        let material = scene.add_material(Material::new(Vec3::splat(0.5)));
        scene.objects.push(Object::new(format!("thing {i}"), shape, material).at(at));
    }
    scene.lights.push(Light::directional(-to_light));
    Arc::new(scene)
}

pub(crate) fn parallel(direction: DVec3, height: f64) -> Camera {
    Camera::look_at(direction * 10.0, DVec3::ZERO, DVec3::Y, Projection::Orthographic { height })
}

pub(crate) fn central(eye: DVec3, fov_y: f64) -> Camera {
    Camera::look_at(eye, DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y })
}

/// Directions all around, by the golden angle.
pub(crate) fn direction(i: usize, count: usize) -> DVec3 {
    let y = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
    let angle = (i as f64 + 0.37) * std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let around = (1.0 - y * y).sqrt();
    DVec3::new(angle.cos() * around, y, angle.sin() * around)
}

/// A cube around the origin whose faces have corners of their own.
pub(crate) fn cube(size: f32) -> Mesh {
    let mut mesh = Mesh::default();
    let half = size * 0.5;
    for axis in 0..3 {
        for side in [-half, half] {
            let first = mesh.positions.len() as u32;
            for (u, v) in [(-half, -half), (half, -half), (half, half), (-half, half)] {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, u, v);
                mesh.positions.push(Vec3::from_array(p));
            }
            let turn = |t: [u32; 3]| if side > 0.0 { t } else { [t[0], t[2], t[1]] };
            mesh.triangles.push(turn([0, 1, 2]).map(|i| first + i));
            mesh.triangles.push(turn([0, 2, 3]).map(|i| first + i));
        }
    }
    mesh
}

/// A ball of quads around the origin, shared corners, smooth normals if asked for.
pub(crate) fn ball(radius: f32, rings: u32, smooth: bool) -> Mesh {
    let columns = rings * 2;
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        let polar = std::f32::consts::PI * ring as f32 / rings as f32;
        for column in 0..columns {
            let angle = std::f32::consts::TAU * column as f32 / columns as f32;
            let out = Vec3::new(polar.sin() * angle.cos(), polar.cos(), polar.sin() * angle.sin());
            mesh.positions.push(if ring == 0 || ring == rings {
                Vec3::new(0.0, out.y.signum(), 0.0) * radius
            } else {
                out * radius
            });
            if smooth {
                mesh.normals.push(out);
            }
        }
    }
    for ring in 0..rings {
        for column in 0..columns {
            let [a, b] = [column, (column + 1) % columns].map(|c| ring * columns + c);
            mesh.triangles.extend([[a, b, a + columns], [b, b + columns, a + columns]]);
        }
    }
    mesh
}

/// Joins meshes into one.
pub(crate) fn joined(parts: &[(Mesh, Vec3)]) -> Mesh {
    let mut all = Mesh::default();
    for (mesh, at) in parts {
        let first = all.positions.len() as u32;
        all.positions.extend(mesh.positions.iter().map(|p| *p + *at));
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    all
}

pub(crate) fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::splat(1.0 / 3.0))
}
