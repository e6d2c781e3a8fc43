//! What would be built for a need, and what would that cost?

use crate::decide::{RESAMPLED, decision, demand, detail, is_resampled, losses, losses_of_all, why_skipped};
use crate::info::Options;
use crate::light::Lamp;
use crate::shadow::{MapSizes, Shadows};
use polyptych_core::convert::Converter;
use polyptych_core::scene::{Object, Scene, Shape};
use polyptych_core::seam::{Decision, Demand, Need, ObjectPlan, PassPlan, Plan, Survey};
use std::collections::HashSet;
use std::sync::Arc;

/// Nanoseconds on one thread of the machine that all back ends' constants were measured on.
mod nanoseconds {
    /// A vertex, transformed.
    pub(super) const VERTEX: f64 = 4.0;
    /// A triangle, set up and drawn.
    pub(super) const TRIANGLE: f64 = 52.0;
    /// A pixel of the background.
    pub(super) const PIXEL: f64 = 8.0;
    /// A pixel of a surface, resolved.
    pub(super) const SURFACE: f64 = 30.0;
    /// A pixel of what lets light through.
    pub(super) const LAYER: f64 = 120.0;
    /// What a texture adds to that.
    pub(super) const TEXEL: f64 = 40.0;
    /// A light on a surface.
    pub(super) const LIGHT: f64 = 20.0;
    /// The look into its shadow map.
    pub(super) const SHADOW: f64 = 30.0;
}

/// What would be drawn.
#[derive(Default)]
struct Amount {
    vertices: f64,
    triangles: f64,
}

pub(crate) fn plan(scene: &Scene, need: &Need, options: Options) -> Plan {
    let mut lamps = Lamp::all(scene);
    let sizes = MapSizes::new(options.map_size, &lamps);
    sizes.choose_tiers(&mut lamps, options.tier, scene, need);
    let demand = demand(scene, need, &lamps, options);
    let of_all = losses_of_all(scene, &lamps, options, sizes);
    let bends = is_resampled(&need.camera.projection);
    let forecasts = Converter::default();
    let (mut amount, mut known) = (Amount::default(), HashSet::new());
    let objects: Vec<ObjectPlan> = scene
        .objects
        .iter()
        .map(|object| {
            let mut plan = plan_object(&forecasts, scene, object, need, options, &mut amount);
            // Objects of one shape and size share its triangles.
            let size = object.world_from_object.matrix3.to_cols_array().map(f64::to_bits);
            if !known.insert((Arc::as_ptr(&object.shape), detail(object, need).class(object), size)) {
                plan.bytes = 0;
            }
            for loss in of_all.iter().copied().chain(bends.then_some(RESAMPLED)) {
                plan.decision = plan.decision.weakened(loss);
            }
            plan
        })
        .collect();
    let mut passes = vec![PassPlan {
        name: "visibility".to_owned(),
        needed: true,
        why: "nearest triangle of a pixel".to_owned(),
    }];
    passes.extend(demand.passes());
    let mut bytes: u64 = objects.iter().map(|o| o.bytes).sum();
    let mut of_blockers = 0;
    for (index, (lamp, shadow)) in lamps.iter().zip(&demand.shadows).enumerate() {
        if shadow.is_ok() {
            let (map, of_triangle) = Shadows::planned_bytes(lamp, sizes, amount.triangles as u64);
            bytes += map;
            of_blockers = of_triangle * amount.triangles as u64;
        }
        passes.push(PassPlan {
            name: format!("shadow map of light {index}"),
            needed: shadow.is_ok(),
            why: shadow.err().unwrap_or("the light casts shadows").to_owned(),
        });
    }
    bytes += of_blockers;
    let estimated_ms = milliseconds(scene, need, &demand, &amount, options.samples);
    Plan { objects, passes, bytes, estimated_ms }
}

fn milliseconds(scene: &Scene, need: &Need, demand: &Demand, amount: &Amount, samples: u32) -> f64 {
    use nanoseconds::{LAYER, LIGHT, PIXEL, SHADOW, SURFACE, TEXEL, TRIANGLE, VERTEX};
    let survey = Survey::of(scene, need);
    let seen = survey.seen;
    let layers = survey.sum(scene, |_, o| if scene.material(o, 0).is_see_through() { LAYER } else { 0.0 });
    let texture = if demand.textures.is_some() { TEXEL } else { 0.0 };
    let lights = demand.shadows.len() as f64 * LIGHT + demand.shadow_count() as f64 * SHADOW;
    let shading = if demand.shading { texture + lights } else { 0.0 };
    let pixels = f64::from(need.width) * f64::from(need.height);
    // Visibility is found at every sample, a triangle shaded once in a pixel.
    let triangles = amount.triangles * TRIANGLE * f64::from(samples).sqrt();
    let of_pixel = PIXEL * f64::from(samples) + layers + seen * (SURFACE + shading);
    (amount.vertices * VERTEX + triangles + pixels * of_pixel) * 1e-6
}

fn plan_object(
    forecasts: &Converter,
    scene: &Scene,
    object: &Object,
    need: &Need,
    options: Options,
    amount: &mut Amount,
) -> ObjectPlan {
    let mut plan = ObjectPlan {
        name: object.name.clone(),
        shape: object.shape.kind().name(),
        decision: Decision::Exact,
        builds: String::new(),
        bytes: 0,
    };
    let draws_lines = options.mode.draws_lines();
    if let Some(why) = why_skipped(object, draws_lines) {
        plan.decision = Decision::Skipped { why };
        return plan;
    }
    let mut converted = None;
    if let Shape::Mesh(mesh) = &*object.shape {
        amount.vertices += mesh.positions.len() as f64;
        amount.triangles += mesh.triangles.len() as f64;
        if options.spares_triangles {
            // How many are left is known when they are found.
            plan.builds = format!("at most {} triangles", mesh.triangles.len());
            plan.bytes = mesh.bytes();
            converted = Some((detail(object, need).tolerance, plan.builds.clone()));
        }
    } else {
        let forecast = forecasts.mesh_forecast(scene, object, detail(object, need));
        amount.vertices += forecast.vertices as f64;
        amount.triangles += forecast.triangles as f64;
        plan.builds = forecast.builds.clone();
        plan.bytes = forecast.bytes;
        converted = Some((forecast.bound, forecast.builds));
    }
    plan.decision = decision(object, converted, losses(scene, object, draws_lines));
    plan
}
