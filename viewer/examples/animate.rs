//! A scene that a program changes while it is shown: bodies circle, space adds one, backspace takes one away.
//!
//! `cargo run --release -p polyptych-viewer --example animate`

use polyptych::prelude::*;
use polyptych_viewer::{Key, ViewerError, show_with};

fn main() -> Result<(), ViewerError> {
    let mut scene = Scene::default();
    let red = scene.add_material(Material::new(Vec3::new(0.7, 0.15, 0.1)));
    scene.objects.push(ball(red));
    scene.lights.push(Light::directional(DVec3::new(-1.0, -2.0, -1.5)));
    show_with(scene, move |scene, time, input| {
        if input.key_pressed(Key::Space) {
            scene.objects.push(ball(red));
        }
        if input.key_pressed(Key::Backspace) && scene.objects.len() > 1 {
            scene.objects.pop();
        }
        let count = scene.objects.len() as f64;
        for (index, object) in scene.objects.iter_mut().enumerate() {
            let angle = time + index as f64 / count * std::f64::consts::TAU;
            object.world_from_object.translation =
                DVec3::new(angle.cos(), 0.3 * (2.0 * angle).sin(), angle.sin());
        }
    })
}

fn ball(material: usize) -> Object {
    Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 0.3 }), material)
}
