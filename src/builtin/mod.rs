//! Which scenes does the program carry in itself?

mod atelier;
mod figure;
mod noise;
mod pieces;

use crate::camera::{Camera, Projection};
use crate::scene::{Light, Scene};
use glam::DVec3;

/// Names of the built-in scenes; the first is the default.
pub const NAMES: [&str; 6] = ["atelier", "polyhedra", "figure", "quadrics", "terrain", "cloud"];

/// Builds a built-in scene.
///
/// # Errors
/// Lists the names when there is none of that name.
pub fn scene(name: &str) -> Result<Scene, String> {
    let mut scene = match name {
        "atelier" => atelier::scene(),
        "polyhedra" => alone(pieces::polyhedra),
        "figure" => alone(|scene| pieces::figure(scene, DVec3::ZERO)),
        "quadrics" => alone(|scene| pieces::sculpture(scene, DVec3::ZERO)),
        "terrain" => alone(pieces::terrain),
        "cloud" => alone(|scene| pieces::cloud(scene, DVec3::ZERO)),
        _ => {
            return Err(format!("builtin:{name}: there is no such scene: use one of {}", NAMES.join(", ")));
        }
    };
    name.clone_into(&mut scene.name);
    Ok(scene)
}

/// Direction of the sun in all built-in scenes.
fn sun() -> Light {
    Light { intensity: 0.85, ..Light::directional(DVec3::new(-0.55, -0.75, -0.45)) }
}

/// Builds a scene of one piece, framed.
fn alone(piece: impl FnOnce(&mut Scene)) -> Scene {
    let mut scene = Scene::default();
    piece(&mut scene);
    scene.lights.push(sun());
    let view = Projection::Perspective { fov_y: 0.7 };
    scene.cameras.push(("front".to_owned(), Camera::framing(&scene.bounds(), 0.5, 0.35, 16.0 / 9.0, view)));
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Object, ShapeKind};

    #[test]
    fn the_atelier_holds_every_kind_of_shape_and_three_cameras() {
        let scene = scene("atelier").unwrap();
        for kind in ShapeKind::ALL {
            assert!(scene.objects.iter().any(|o| o.shape.kind() == kind), "no {}", kind.name());
        }
        assert_eq!(scene.cameras.len(), 3);
        assert!(scene.objects.iter().all(Object::is_drawable));
        assert!(
            scene.objects.iter().any(|o| scene.material(o, 0).texture.is_some()),
            "something is textured"
        );
    }

    #[test]
    fn every_name_is_a_scene_and_others_are_refused() {
        for name in NAMES {
            assert!(!scene(name).unwrap().objects.is_empty());
        }
        assert!(scene("studio").unwrap_err().contains("atelier, polyhedra"));
    }
}
