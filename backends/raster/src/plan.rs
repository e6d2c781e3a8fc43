//! What would be built for a need, and what would that cost?

use crate::decide::{
    RESAMPLED, decision, detail, is_resampled, losses, losses_of_all, why_skipped, with_loss,
};
use crate::info::{Mode, Options};
use crate::light::Lamp;
use crate::shadow::MapSizes;
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::Channel;
use polyptych_core::scene::{LightKind, Object, Scene, Shape};
use polyptych_core::seam::{Decision, Need, ObjectPlan, PassPlan, Plan};

/// Milliseconds for a triangle and for a pixel on one thread, measured.
const PER_TRIANGLE: f64 = 60e-6;
const PER_PIXEL: f64 = 25e-6;
/// Bytes of a triangle with its share of vertices.
const TRIANGLE_BYTES: f64 = 30.0;

pub(crate) fn plan(scene: &Scene, need: &Need, options: Options) -> Plan {
    let lamps = Lamp::all(scene);
    let sizes = MapSizes::new(options.map_size, &lamps);
    let of_all = losses_of_all(scene, &lamps, options, sizes);
    let bends = is_resampled(&need.camera.projection);
    let forecasts = Converter::default();
    let mut triangles = 0.0;
    let objects: Vec<ObjectPlan> = scene
        .objects
        .iter()
        .map(|object| {
            let mut plan =
                plan_object(&forecasts, scene, object, need, options.mode.draws_lines(), &mut triangles);
            for loss in of_all.iter().copied().chain(bends.then_some(RESAMPLED)) {
                plan.decision = with_loss(&plan.decision, loss);
            }
            plan
        })
        .collect();
    let mut passes = vec![
        PassPlan {
            name: "visibility".to_owned(),
            needed: true,
            why: "nearest triangle of a pixel".to_owned(),
        },
        see_through(scene),
    ];
    let mut bytes: u64 = objects.iter().map(|o| o.bytes).sum();
    let blocks = scene.objects.iter().any(|object| blocks_light(scene, object));
    for (index, lamp) in lamps.iter().enumerate() {
        let pass = plan_map(index, lamp, need, options, blocks);
        if pass.needed {
            bytes += map_bytes(&lamp.light.kind, sizes);
        }
        passes.push(pass);
    }
    let pixels = f64::from(need.width) * f64::from(need.height);
    Plan { objects, passes, bytes, estimated_ms: triangles * PER_TRIANGLE + pixels * PER_PIXEL }
}

fn plan_object(
    forecasts: &Converter,
    scene: &Scene,
    object: &Object,
    need: &Need,
    draws_lines: bool,
    triangles: &mut f64,
) -> ObjectPlan {
    let mut plan = ObjectPlan {
        name: object.name.clone(),
        shape: object.shape.kind().name(),
        decision: Decision::Exact,
        builds: String::new(),
        bytes: 0,
    };
    if let Some(why) = why_skipped(object, draws_lines) {
        plan.decision = Decision::Skipped { why };
        return plan;
    }
    let mut converted = None;
    if let Shape::Mesh(mesh) = &*object.shape {
        *triangles += mesh.triangles.len() as f64;
    } else {
        let forecast = forecasts.mesh_forecast(scene, object, detail(object, need));
        *triangles += forecast.bytes as f64 / TRIANGLE_BYTES;
        plan.builds = forecast.builds.clone();
        plan.bytes = forecast.bytes;
        converted = Some((forecast.bound, forecast.builds));
    }
    plan.decision = decision(object, converted, losses(scene, object, draws_lines));
    plan
}

fn see_through(scene: &Scene) -> PassPlan {
    let used = |o: &Object| (0..o.materials.len().max(1)).any(|s| scene.material(o, s).is_see_through());
    let needed = scene.objects.iter().filter(|o| o.is_drawable()).any(used);
    let why = if needed { "a material lets light through" } else { "everything is opaque" };
    PassPlan { name: "see-through layers".to_owned(), needed, why: why.to_owned() }
}

/// Tells whether an object can block light: volumes and what is see-through let it pass.
fn blocks_light(scene: &Scene, object: &Object) -> bool {
    why_skipped(object, false).is_none()
        && !matches!(&*object.shape, Shape::Volume(_))
        && (0..object.materials.len().max(1)).any(|slot| !scene.material(object, slot).is_see_through())
}

fn plan_map(index: usize, lamp: &Lamp, need: &Need, options: Options, blocks: bool) -> PassPlan {
    let asked = need.channels.has(Channel::Color) || need.channels.has(Channel::Shadow);
    let (needed, why) = match (options.mode == Mode::Shadowed, asked, lamp.light.casts_shadow) {
        (false, _, _) => (false, "shadows are switched off"),
        (_, false, _) => (false, "neither color nor shadow is asked for"),
        (_, _, false) => (false, "the light casts no shadow"),
        _ if !blocks => (false, "nothing blocks light"),
        _ => (true, "the light casts shadows"),
    };
    PassPlan { name: format!("shadow map of light {index}"), needed, why: why.to_owned() }
}

fn map_bytes(kind: &LightKind, sizes: MapSizes) -> u64 {
    let square = |edge: u32| u64::from(edge) * u64::from(edge) * 4;
    match kind {
        LightKind::Directional { .. } => square(sizes.directional),
        LightKind::Point { .. } | LightKind::Spot { .. } => sizes.local.map_or(0, |edge| 6 * square(edge)),
    }
}
