//! A back end in a library that draws nothing but the background: copy it, and draw.

use polyptych_plugin::core::convert::Converter;
use polyptych_plugin::core::framebuffer::{Channels, Framebuffer, Pixel};
use polyptych_plugin::core::scene::{Object, Scene, ShapeKind};
use polyptych_plugin::core::seam::{
    BackendInfo, Control, Decision, Frame, Need, ObjectPlan, Parameter, ParameterKind, Plan, Prepared,
    RenderError, Report, Value,
};
use polyptych_plugin::{Renderer, export_backend};
use std::sync::Arc;

export_backend!(Template, accepts: [Mesh]);

/// What is prepared, and how each object will be drawn.
pub struct Template {
    info: BackendInfo,
    ready: Option<(Arc<Scene>, f32, Arc<[Decision]>)>,
}

impl Default for Template {
    fn default() -> Self {
        let info = BackendInfo {
            id: "template".into(),
            name: "Draws the background".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            native: vec![ShapeKind::Mesh],
            channels: Channels::ALL,
            photometric: false,
            parameters: vec![Parameter {
                name: "brightness",
                kind: ParameterKind::Float { min: 0.0, max: 10.0 },
                default: Value::Float(1.0),
                unit: "",
                help: "factor of the background's color",
                tag: "",
                quality_axis: false,
            }],
        };
        Self { info, ready: None }
    }
}

/// Says how an object is drawn: here, not at all. Draw it, and return `Decision::Exact`.
fn decision(_: &Object) -> Decision {
    Decision::Skipped { why: "the template draws nothing".into() }
}

impl Renderer for Template {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, scene: &Scene, _: &Need) -> Plan {
        let object = |o: &Object| ObjectPlan {
            name: o.name.clone(),
            shape: o.shape.kind().name(),
            decision: decision(o),
            builds: String::new(),
            bytes: 0,
        };
        Plan { objects: scene.objects.iter().map(object).collect(), ..Plan::default() }
    }

    fn prepare(
        &mut self,
        scene: &Arc<Scene>,
        need: &Need,
        _: &Converter,
        _: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        if let Some(object) = scene.objects.iter().find(|o| o.required && o.visible) {
            let reason = "the template draws nothing".to_owned();
            return Err(RenderError::Required { object: object.name.clone(), reason });
        }
        let brightness = need.settings.float(&self.info.parameters, "brightness") as f32;
        let objects: Arc<[Decision]> = scene.objects.iter().map(decision).collect();
        self.ready = Some((scene.clone(), brightness, objects.clone()));
        Ok(Prepared { objects, bytes: 0 })
    }

    fn render(
        &mut self,
        frame: &Frame,
        target: &mut Framebuffer,
        control: &Control<'_>,
    ) -> Result<Report, RenderError> {
        let (scene, brightness, objects) = self.ready.as_ref().ok_or(RenderError::NotPrepared)?;
        let view = frame.camera.view(target.width(), target.height());
        target.for_each_band(control.threads, 16, &|mut band| {
            for row in 0..band.rows {
                if control.is_cancelled() {
                    return;
                }
                for x in 0..band.width {
                    let (u, v) = (f64::from(x) + 0.5, f64::from(band.first_row + row) + 0.5);
                    let color = match view.ray(u, v) {
                        Some(ray) => scene.environment.background.color(ray.direction) * *brightness,
                        None => Default::default(),
                    };
                    band.put(x, row, &Pixel::background(color));
                }
            }
            control.finished(&band);
        });
        control.check()?;
        Ok(Report { objects: objects.clone(), ..Report::default() })
    }
}
