//! The default scene: every kind of shape, shown in a clearing among hills.

use super::{pieces, sun};
use crate::camera::{Camera, Projection};
use crate::scene::{Background, Scene};
use glam::{DVec3, Vec3};

pub(super) fn scene() -> Scene {
    let mut scene = Scene::default();
    pieces::terrain(&mut scene);
    pieces::polyhedra(&mut scene);

    let stand = DVec3::new(-0.25, 0.0, -1.25);
    pieces::plinth(&mut scene, "plinth of the sculpture", stand, 0.62, 0.45);
    let stone = scene.materials.len() - 1;
    pieces::speckle(&mut scene, stone);
    pieces::sculpture(&mut scene, stand + DVec3::Y * 0.43);

    pieces::figure(&mut scene, DVec3::new(-1.75, 0.02, -0.35));

    let stand = DVec3::new(1.25, 0.0, -0.85);
    pieces::plinth(&mut scene, "plinth of the vase", stand, 0.38, 0.35);
    pieces::vase(&mut scene, stand + DVec3::Y * 0.35);

    let stand = DVec3::new(1.75, 0.0, 0.35);
    pieces::plinth(&mut scene, "plinth of the cloud", stand, 0.34, 0.3);
    pieces::cloud(&mut scene, stand + DVec3::Y * 0.29);

    scene.lights.push(sun());
    scene.environment.background = Background::Gradient {
        below: Vec3::new(0.20, 0.22, 0.22),
        horizon: Vec3::new(0.62, 0.70, 0.78),
        above: Vec3::new(0.14, 0.28, 0.55),
    };
    scene.environment.ambient = Vec3::new(0.20, 0.22, 0.25);

    let look = |eye: [f64; 3], target: [f64; 3], fov_y: f64| {
        let (eye, target) = (DVec3::from_array(eye), DVec3::from_array(target));
        Camera::look_at(eye, target, DVec3::Y, Projection::Perspective { fov_y })
    };
    scene.cameras = vec![
        ("front".to_owned(), look([0.35, 1.75, 4.3], [0.0, 0.55, -0.3], 0.72)),
        ("bird".to_owned(), look([-3.2, 4.2, 3.6], [0.1, 0.3, -0.2], 0.62)),
        ("close".to_owned(), look([0.6, 0.9, 2.0], [-0.1, 0.45, -0.4], 0.85)),
    ];
    scene
}
