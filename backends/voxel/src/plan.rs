//! What would be built for a need, and what would that cost?

use crate::lamps::Lamp;
use crate::model;
use crate::occupancy::Occupancy;
use crate::trace::Shadows;
use crate::world::World;
use polyptych_core::convert::Converter;
use polyptych_core::scene::{AlphaMode, CHUNK, Chunk, Object, Scene, Shape, Voxels};
use polyptych_core::seam::{Decision, Demand, Need, ObjectPlan, PassPlan, Plan, Surfaces, Survey};
use std::collections::HashSet;
use std::sync::Arc;

/// Nanoseconds on one thread of the machine that all back ends' constants were measured on.
mod nanoseconds {
    /// A pixel.
    pub(super) const PIXEL: f64 = 6.0;
    /// A ray into a grid, and each doubling of its cells.
    pub(super) const GRID: f64 = 4.0;
    pub(super) const DOUBLING: f64 = 4.0;
    /// How much longer a ray walks through what it does not end in.
    pub(super) const CLEAR: f64 = 6.0;
    /// A surface, lit.
    pub(super) const SURFACE: f64 = 25.0;
    /// A light on it.
    pub(super) const LIGHT: f64 = 10.0;
}

pub(crate) fn plan(scene: &Scene, need: &Need, [resolution, samples]: [u32; 2], shadows: Shadows) -> Plan {
    let lamps = Lamp::all(scene);
    let (mut known, mut cells) = (HashSet::new(), vec![0.0; scene.objects.len()]);
    let objects: Vec<ObjectPlan> = scene
        .objects
        .iter()
        .zip(&mut cells)
        .map(|(object, cells)| {
            let is_new = known.insert(Arc::as_ptr(&object.shape).addr());
            plan_object(scene, object, need, resolution, is_new, cells)
        })
        .collect();
    let drawn = objects.iter().filter(|o| !matches!(o.decision, Decision::Skipped { .. })).count();
    let bytes = objects.iter().map(|o| o.bytes).sum::<u64>() + World::planned_bytes(drawn, lamps.len());
    let switch = shadows == Shadows::Hard;
    let demand = Demand::of(scene, need, &Lamp::lights(&lamps), switch, Surfaces::Stepped);
    let mut passes = vec![PassPlan {
        name: "primary rays".to_owned(),
        needed: true,
        why: match samples {
            1 => "one through the middle of each pixel".to_owned(),
            _ => format!("one through the middle of each pixel, and {samples} for its color"),
        },
    }];
    passes.extend(demand.passes());
    passes.push(demand.shadow_rays());
    let rays = if samples > 1 { samples + 1 } else { 1 };
    let estimated_ms = milliseconds(scene, need, &demand, &cells) * f64::from(rays);
    Plan { estimated_ms, objects, passes, bytes }
}

/// `cells` are those along the longest edge of each object's grid.
fn milliseconds(scene: &Scene, need: &Need, demand: &Demand, cells: &[f64]) -> f64 {
    use nanoseconds::{CLEAR, DOUBLING, GRID, LIGHT, PIXEL, SURFACE};
    let survey = Survey::of(scene, need);
    let walks = survey.sum(scene, |i, object| {
        // Through what is not opaque a ray goes on.
        let is_clear = scene.material(object, 0).is_see_through();
        let ragged = if is_clear && !matches!(&*object.shape, Shape::Voxels(_)) { CLEAR } else { 1.0 };
        (GRID + DOUBLING * cells[i].max(1.0).log2()) * ragged
    });
    // A shadow ray passes what a ray of the picture passes, where there is anything.
    let shadow = walks / survey.entered.max(1e-3);
    let lights = demand.shadows.len() as f64 * LIGHT + demand.shadow_count() as f64 * shadow;
    let surface = if demand.shading { SURFACE + lights } else { 0.0 };
    let pixels = f64::from(need.width) * f64::from(need.height);
    pixels * (PIXEL + walks + survey.seen * surface) * 1e-6
}

fn plan_object(
    scene: &Scene,
    object: &Object,
    need: &Need,
    resolution: u32,
    is_new: bool,
    cells: &mut f64,
) -> ObjectPlan {
    let plan = |decision, builds, bytes| ObjectPlan {
        name: object.name.clone(),
        shape: object.shape.kind().name(),
        decision,
        builds,
        bytes,
    };
    if let Some(why) = model::why_skipped(object) {
        return plan(Decision::Skipped { why }, String::new(), 0);
    }
    if let Shape::Voxels(voxels) = &*object.shape {
        *cells = f64::from(voxels.size().into_iter().max().unwrap_or(1));
        if !is_new {
            return plan(Decision::Exact, String::new(), 0);
        }
        let masks = masks(scene, object, voxels);
        let bytes = masks * size_of::<Occupancy>() as u64 + voxels.chunk_count() as u64 * PER_CHUNK;
        return plan(Decision::Exact, format!("{masks} masks of chunks"), bytes);
    }
    let detail = model::detail(object, need, resolution);
    let forecast = Converter::default().voxels_forecast(scene, object, detail);
    *cells = (forecast.bytes as f64).cbrt();
    let decision = model::converted(&object.shape, forecast.bound, &forecast.builds);
    // The converter keeps the voxels, for all who ask; what is held here are masks of their chunks.
    let chunks = forecast.bytes / u64::from(CHUNK).pow(3);
    let bytes = if is_new { chunks * (size_of::<Occupancy>() as u64 + PER_CHUNK) } else { 0 };
    plan(decision, forecast.builds, bytes)
}

/// Bytes of a chunk's place in a grid: two layers and the cells.
const PER_CHUNK: u64 = 32;

/// Counts the masks of a grid: one of what is seen for each chunk that is not empty, and one of what blocks light where
/// that is something else.
fn masks(scene: &Scene, object: &Object, voxels: &Voxels) -> u64 {
    let material = |value: u8| scene.material(object, usize::from(value) - 1);
    let seen: [bool; 256] = std::array::from_fn(|v| v > 0 && material(v as u8).opacity > 0.0);
    let blocks: [bool; 256] = std::array::from_fn(|v| {
        v > 0 && material(v as u8).opacity >= 1.0 && material(v as u8).alpha != AlphaMode::Blend
    });
    let mut uniform = HashSet::new();
    let of = |values: &mut dyn Iterator<Item = u8>| {
        let (mut any_seen, mut any_blocks, mut differ) = (false, false, false);
        for v in values.map(usize::from) {
            (any_seen, any_blocks) = (any_seen | seen[v], any_blocks | blocks[v]);
            differ |= seen[v] != blocks[v];
        }
        u64::from(any_seen) + u64::from(any_blocks && differ)
    };
    voxels
        .chunks()
        .enumerate()
        .map(|(index, chunk)| match chunk {
            Chunk::Uniform(value) => {
                // Equal chunks share their masks; those at the border are cut.
                let first = voxels.chunk_origin(index);
                let end: [u32; 3] = std::array::from_fn(|a| CHUNK.min(voxels.size()[a] - first[a]));
                if uniform.insert((*value, end)) { of(&mut std::iter::once(*value)) } else { 0 }
            }
            Chunk::Cells(cells) => of(&mut cells.iter().copied()),
        })
        .sum()
}
