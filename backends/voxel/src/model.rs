//! Which objects are grids already, which become one, and what scene results?

use crate::grid::Grid;
use polyptych_core::convert::{ConvertError, Converter, Detail, Filling, VoxelModel};
use polyptych_core::scene::{Object, Scene, Shape, Voxels};
use polyptych_core::seam::{self, Control, Decision, Need, RenderError};
use std::collections::HashMap;
use std::sync::Arc;

/// A scene in which everything that is drawn is a grid.
pub(crate) struct Model {
    pub(crate) scene: Arc<Scene>,
    pub(crate) decisions: Vec<Decision>,
    /// Whether the scene differs from the one given.
    pub(crate) is_converted: bool,
}

/// Returns how fine an object is converted.
pub(crate) fn detail(object: &Object, need: &Need, resolution: u32) -> Detail {
    seam::detail(object, need, resolution)
}

/// Says why an object is not drawn, if that can be told before converting it.
pub(crate) fn why_skipped(object: &Object) -> Option<String> {
    if let Some(why) = seam::why_not_drawn(object) {
        return Some(why.to_owned());
    }
    match &*object.shape {
        Shape::Voxels(voxels) if voxels.size().iter().any(|&edge| edge > Grid::LONGEST) => {
            Some(format!("it is longer than {} cells", Grid::LONGEST))
        }
        _ => None,
    }
}

/// Says how a converted object is drawn.
pub(crate) fn converted(shape: &Shape, bound: f64, what: &str) -> Decision {
    match shape {
        Shape::Volume(_) => {
            Decision::Approximated { why: format!("its surface as {what}; what is translucent is lost") }
        }
        _ if !seam::left_out(shape).is_empty() => {
            Decision::Approximated { why: format!("{what}; {}", seam::left_out(shape).join("; ")) }
        }
        _ => Decision::Converted { bound, why: what.to_owned() },
    }
}

/// Turns everything into grids that is none.
///
/// # Errors
/// When a required object cannot be drawn, or the host cancelled.
pub(crate) fn build(
    scene: &Arc<Scene>,
    need: &Need,
    (resolution, filling): (u32, Filling),
    converter: &Converter,
    control: &Control<'_>,
) -> Result<Model, RenderError> {
    let mut decisions = Vec::with_capacity(scene.objects.len());
    let mut changed: Option<Scene> = None;
    // Instances of one model share its grid and its materials.
    let mut known: HashMap<usize, (Arc<Shape>, Vec<usize>)> = HashMap::new();
    for (index, object) in scene.objects.iter().enumerate() {
        control.check()?;
        let skipped = why_skipped(object);
        if skipped.is_none() && matches!(&*object.shape, Shape::Voxels(_)) {
            decisions.push(Decision::Exact);
            continue;
        }
        let made = match skipped {
            Some(why) => Err(Ok(why)),
            None => converter
                .voxels_filled(scene, object, detail(object, need, resolution), filling, control)
                .map_err(ConvertError::reason),
        };
        match made {
            Err(why) => {
                let why = why?;
                if object.required && object.visible {
                    return Err(RenderError::Required { object: object.name.clone(), reason: why });
                }
                decisions.push(Decision::Skipped { why });
            }
            Ok(model) => {
                decisions.push(converted(&object.shape, model.bound, &model.why));
                let scene = changed.get_or_insert_with(|| (**scene).clone());
                replace(scene, index, &model, &mut known);
            }
        }
    }
    let is_converted = changed.is_some();
    let scene = match changed {
        None => scene.clone(),
        Some(mut scene) => {
            for (object, decision) in scene.objects.iter_mut().zip(&decisions) {
                object.visible &= !matches!(decision, Decision::Skipped { .. });
            }
            Arc::new(scene)
        }
    };
    Ok(Model { scene, decisions, is_converted })
}

/// Puts a grid in the place of an object's shape.
fn replace(
    scene: &mut Scene,
    index: usize,
    model: &Arc<VoxelModel>,
    known: &mut HashMap<usize, (Arc<Shape>, Vec<usize>)>,
) {
    let (shape, materials) = known.entry(Arc::as_ptr(model).addr()).or_insert_with(|| {
        let first = scene.materials.len();
        scene.materials.extend(model.palette.iter().cloned());
        (Arc::new(Shape::Voxels(model.voxels.clone())), (first..scene.materials.len()).collect())
    });
    let object = &mut scene.objects[index];
    object.shape = shape.clone();
    object.materials = materials.clone();
    object.world_from_object *= model.object_from_voxels;
}

/// Returns the grid of an object that is drawn.
pub(crate) fn grid_of<'a>(object: &'a Object, decision: &Decision) -> Option<&'a Voxels> {
    match &*object.shape {
        Shape::Voxels(voxels) if !matches!(decision, Decision::Skipped { .. }) => Some(voxels),
        _ => None,
    }
}
