//! Which back end? One by its name, one by what it can: the cheapest that draws a volume as given.
//!
//! `cargo run --release --example choose_a_backend [FOLDER]` also looks at the plugins in a folder.

use polyptych::plugins::{PluginBackends, serve};
use polyptych::prelude::*;
use polyptych::seam::Decision;

/// Finds the back end that draws every object as given and expects to take the least time; builds nothing.
fn cheapest_exact(registry: &Registry, scene: &Scene, need: &Need) -> Option<(String, f64)> {
    let mut best: Option<(String, f64)> = None;
    for id in registry.ids() {
        let info = registry.info(id).ok()?;
        // What is stylized shows the scene, but does not draw it as given.
        if !info.photometric {
            continue;
        }
        let plan = registry.create(id).ok()?.plan(scene, need);
        let exact = plan.objects.iter().all(|o| matches!(o.decision, Decision::Exact));
        if exact && best.as_ref().is_none_or(|(_, least)| plan.estimated_ms < *least) {
            best = Some((id.to_owned(), plan.estimated_ms));
        }
    }
    best
}

/// Draws the cloud with the back end that was chosen.
///
/// # Errors
/// When nothing draws volumes as given, or the picture cannot be written.
pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    serve();
    let mut registry = Registry::builtin();
    if let Some(folder) = std::env::args().nth(1).filter(|word| std::path::Path::new(word).is_dir()) {
        registry = registry.with_plugins(folder);
    }
    let by_name = registry.create("voxel")?;
    println!("by name: {}", by_name.info().name);

    let scene = polyptych::builtin::scene("cloud")?;
    let need = Need::new(scene.cameras[0].1.clone(), 480, 270);
    let (id, expected) = cheapest_exact(&registry, &scene, &need).ok_or("nothing draws this as given")?;
    println!("by what it can: {id}, which expects {expected:.0} ms a frame");
    let picture = Studio::new(registry, 0)?.draw(&id, &scene.into(), &need)?;
    polyptych::picture::save(&picture.framebuffer, Channel::Color, "out/cloud.png".as_ref())?;
    Ok(())
}
