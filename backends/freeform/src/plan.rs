//! What would be built for a need, and what would that cost?

use crate::renderer::{converted, unconverted, with_material};
use crate::volume::Drawing;
use crate::world::Geometry;
use polyptych_core::convert::{Converter, Detail};
use polyptych_core::scene::{Object, Scene, Shape};
use polyptych_core::seam::{self, Decision, Demand, Need, ObjectPlan, PassPlan, Plan, Survey};
use std::collections::HashSet;
use std::sync::Arc;

/// Nanoseconds on one thread of the machine that all back ends' constants were measured on.
mod nanoseconds {
    /// A pixel.
    pub(super) const PIXEL: f64 = 25.0;
    /// A ray against a form, and against each function in it.
    pub(super) const FORM: f64 = 50.0;
    pub(super) const FUNCTION: f64 = 11.0;
    /// A ray against a plane.
    pub(super) const PLANE: f64 = 20.0;
    /// A ray against a height field, for each doubling of its columns.
    pub(super) const HEIGHTS: f64 = 80.0;
    /// A ray into a grid of distances, for each sample along its longest edge.
    pub(super) const FIELD: f64 = 9.0;
    /// A sample of a volume, with what it takes to light it.
    pub(super) const SAMPLE: f64 = 56.25;
    /// A surface.
    pub(super) const SURFACE: f64 = 60.0;
    /// A light on it.
    pub(super) const LIGHT: f64 = 20.0;
}

pub(crate) fn plan(
    scene: &Scene,
    need: &Need,
    demand: &Demand,
    volumes: Drawing,
    detail: impl Fn(&Object) -> Detail,
) -> Plan {
    let converter = Converter::default();
    let mut known = HashSet::new();
    // Samples along the longest edge of what is converted.
    let mut edges = vec![0.0; scene.objects.len()];
    let objects: Vec<ObjectPlan> = scene
        .objects
        .iter()
        .zip(&mut edges)
        .map(|(object, edge)| {
            let is_new = known.insert(Arc::as_ptr(&object.shape));
            plan_object(scene, object, &converter, detail(object), volumes, (is_new, edge))
        })
        .collect();
    let mut passes =
        vec![PassPlan { name: "primary rays".to_owned(), needed: true, why: "one a pixel".to_owned() }];
    passes.extend(demand.passes());
    passes.push(demand.shadow_rays());
    Plan {
        bytes: objects.iter().map(|o| o.bytes).sum(),
        passes,
        estimated_ms: milliseconds(scene, need, demand, volumes.step, &edges),
        objects,
    }
}

fn plan_object(
    scene: &Scene,
    object: &Object,
    converter: &Converter,
    detail: Detail,
    volumes: Drawing,
    (is_new, edge): (bool, &mut f64),
) -> ObjectPlan {
    let (decision, builds, bytes) = match (seam::why_not_drawn(object), &*object.shape) {
        (Some(why), _) => (Decision::Skipped { why: why.to_owned() }, String::new(), 0),
        (None, Shape::Mesh(_) | Shape::Voxels(_)) => {
            let forecast = converter.distance_forecast(scene, object, detail);
            let size = match &*object.shape {
                Shape::Voxels(voxels) => voxels.filled_bounds().size(),
                shape => shape.bounds().size(),
            };
            let samples = forecast.bytes as f64 / 5.0;
            *edge =
                (samples * (size.max_element() / size.element_product().cbrt()).powi(3)).cbrt().min(512.0);
            let decision = converted(object, forecast.bound, "drawn as the zero level of signed distances");
            (with_material(scene, object, decision), forecast.builds, forecast.bytes)
        }
        (None, shape) => {
            let bytes = Geometry::planned_bytes(shape, volumes);
            (with_material(scene, object, unconverted(shape, volumes)), String::new(), bytes)
        }
    };
    let bytes = if is_new { bytes } else { 0 };
    ObjectPlan { name: object.name.clone(), shape: object.shape.kind().name(), decision, builds, bytes }
}

fn milliseconds(scene: &Scene, need: &Need, demand: &Demand, volume_step: f64, edges: &[f64]) -> f64 {
    use nanoseconds::{FIELD, FORM, FUNCTION, HEIGHTS, LIGHT, PIXEL, PLANE, SAMPLE, SURFACE};
    let survey = Survey::of(scene, need);
    let surface_of = |index: usize, object: &Object| match &*object.shape {
        Shape::Primitive(polyptych_core::scene::Primitive::Plane { .. }) => PLANE,
        Shape::Primitive(body) => FORM + FUNCTION * body.faces().len().max(1) as f64,
        Shape::FreeForm(form) => FORM + FUNCTION * form.form().node_count() as f64,
        Shape::HeightField(field) => HEIGHTS * f64::from(field.columns().max(2)).log2(),
        Shape::Mesh(_) | Shape::Voxels(_) => FIELD * edges[index],
        Shape::Volume(_) => 0.0,
    };
    let volume_of = |index: usize, object: &Object| SAMPLE * survey.samples(index, object, volume_step);
    let rays = survey.sum(scene, surface_of);
    // A shadow ray passes what a ray of the picture passes, where there is anything.
    let shadow = rays / survey.entered.max(1e-3);
    let lights = demand.shadows.len() as f64 * LIGHT + demand.shadow_count() as f64 * shadow;
    let surface = SURFACE + if demand.shading { lights } else { 0.0 };
    let pixels = f64::from(need.width) * f64::from(need.height);
    pixels * (PIXEL + rays + survey.sum(scene, volume_of) + survey.seen * surface) * 1e-6
}
