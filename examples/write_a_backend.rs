//! A back end in forty lines: it draws the bounding box of each object in its color, nearest first.
//!
//! `cargo run --release --example write_a_backend` writes `out/boxes.png`.

use polyptych::convert::Converter;
use polyptych::framebuffer::Pixel;
use polyptych::prelude::*;
use polyptych::seam::{
    BackendFactory, BackendInfo, Control, Decision, Frame, ObjectPlan, Origin, Plan, Prepared, RenderError,
    Report,
};
use std::sync::Arc;

#[derive(Default)]
struct Boxes(Option<Arc<Scene>>);

struct BoxesFactory;

impl BackendFactory for BoxesFactory {
    fn info(&self) -> BackendInfo {
        let (id, name, version) = ("boxes".into(), "Bounding boxes".into(), "0.1.0".into());
        BackendInfo {
            id,
            name,
            version,
            native: vec![],
            channels: Channels::ALL,
            photometric: false,
            parameters: vec![],
        }
    }
    fn create(&self, _: &Registry) -> Box<dyn Renderer> {
        Box::new(Boxes::default())
    }
}

fn decision(_: &Object) -> Decision {
    Decision::Approximated { why: "drawn as its bounding box".into() }
}

impl Renderer for Boxes {
    fn info(&self) -> &BackendInfo {
        static INFO: std::sync::OnceLock<BackendInfo> = std::sync::OnceLock::new();
        INFO.get_or_init(|| BoxesFactory.info())
    }
    fn plan(&self, scene: &Scene, _: &Need) -> Plan {
        let object = |o: &Object| {
            let (name, shape) = (o.name.clone(), o.shape.kind().name());
            ObjectPlan { name, shape, decision: decision(o), builds: String::new(), bytes: 0 }
        };
        Plan { objects: scene.objects.iter().map(object).collect(), ..Plan::default() }
    }
    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        _: &Need,
        _: &Converter,
        _: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        self.0 = Some(scene.clone());
        Ok(Prepared { objects: scene.objects.iter().map(decision).collect(), bytes: 0 })
    }
    fn render(
        &mut self,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError> {
        let scene = self.0.as_ref().ok_or(RenderError::NotPrepared)?;
        let view = frame.camera.view(target.width(), target.height());
        target.for_each_band(control.threads, 16, &|mut band| {
            let (width, rows) = (band.width, band.rows);
            for (x, row) in (0..width).flat_map(|x| (0..rows).map(move |row| (x, row))) {
                let place = (f64::from(x) + 0.5, f64::from(band.first_row + row) + 0.5);
                let Some(ray) = view.ray(place.0, place.1) else { continue };
                let mut pixel = Pixel::background(scene.environment.background.color(ray.direction));
                for (i, object) in scene.objects.iter().enumerate().filter(|(_, o)| o.is_drawable()) {
                    if let Some((near, _)) = object.bounds().clip(ray.origin, ray.direction)
                        && (near as f32) < pixel.distance
                    {
                        let color = scene.material(object, 0).base_color;
                        pixel = Pixel { color, distance: near as f32, id: i as u32 + 1, ..pixel };
                    }
                }
                band.put(x, row, &pixel);
            }
        });
        control.check()?;
        Ok(Report::default())
    }
}

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut registry = Registry::builtin();
    registry.add(Arc::new(BoxesFactory), Origin::BuiltIn);
    let scene = Arc::new(polyptych::builtin::scene("polyhedra")?);
    let need = Need::new(scene.cameras[0].1.clone(), 480, 270);
    let picture = Studio::new(registry, 2)?.draw("boxes", &scene, &need)?;
    polyptych::picture::save(&picture.framebuffer, Channel::Color, "out/boxes.png".as_ref())?;
    println!("out/boxes.png: {} objects", picture.prepared.objects.len());
    Ok(())
}
