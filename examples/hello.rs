//! The library in ten lines: a red ball, drawn by a back end that is chosen by name.
//!
//! `cargo run --release --example hello` writes `out/hello.png`.

use polyptych::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scene = Scene::default();
    let red = scene.add_material(Material::new(Vec3::new(0.8, 0.1, 0.1)));
    scene.objects.push(Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), red));
    scene.lights.push(Light::directional(DVec3::new(-1.0, -2.0, -1.5)));
    let camera = Camera::framing(&scene.bounds(), 0.5, 0.3, 1.5, Projection::Perspective { fov_y: 0.7 });
    let mut studio = Studio::new(Registry::builtin(), 0)?;
    let picture = studio.draw("freeform", &scene.into(), &Need::new(camera, 480, 320))?;
    polyptych::picture::save(&picture.framebuffer, Channel::Color, "out/hello.png".as_ref())?;
    Ok(())
}
