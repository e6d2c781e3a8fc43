//! What does a plugin get of a scene? Shapes that it takes as they are, the others converted.

use polyptych_core::convert::{Converter, Detail, MeshModel, VoxelModel};
use polyptych_core::scene::{Object, Scene, Shape, ShapeKind};
use polyptych_core::seam::{Control, Decision, Need, RenderError};
use std::sync::{Arc, Weak};

/// Most cells along an edge that free forms are converted on.
const FINEST: u32 = 256;

/// What the host did to an object before the plugin got it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Handing {
    /// Nothing.
    Given,
    /// Converted it, at most `bound` meters off.
    Converted { bound: f64, why: String },
    /// Converted it, with a loss that no bound covers.
    Reduced { why: String },
    /// Left it out.
    Skipped { why: String },
}

/// A scene as a plugin gets it.
pub(crate) struct HandedOver {
    pub(crate) scene: Arc<Scene>,
    pub(crate) objects: Vec<Handing>,
}

/// Converted shapes of the last scene, so that the same conversion is the same shape for the plugin.
#[derive(Default)]
pub(crate) struct Converted {
    meshes: Vec<(Weak<MeshModel>, Arc<Shape>)>,
    voxels: Vec<(Weak<VoxelModel>, Arc<Shape>)>,
}

/// Converts what a plugin does not take. A plugin that takes everything decides about everything itself.
pub(crate) fn hand_over(
    scene: &Arc<Scene>,
    need: &Need,
    accepts: &[ShapeKind],
    converter: &Converter,
    control: &Control<'_>,
    before: &mut Converted,
) -> Result<HandedOver, RenderError> {
    if takes_all(accepts) {
        return Ok(HandedOver { scene: scene.clone(), objects: vec![Handing::Given; scene.objects.len()] });
    }
    let mut handed = (**scene).clone();
    let (mut objects, mut used) = (Vec::new(), Converted::default());
    let mut glowing = Scene { materials: scene.materials.clone(), ..Scene::default() };
    for (index, object) in scene.objects.iter().enumerate() {
        control.check()?;
        if let Some(why) = why_skipped(object) {
            if object.required && object.visible {
                return Err(RenderError::Required { object: object.name.clone(), reason: why });
            }
            objects.push(Handing::Skipped { why });
            continue;
        }
        if accepts.contains(&object.shape.kind()) {
            objects.push(Handing::Given);
            continue;
        }
        if let Shape::Voxels(_) = *object.shape {
            glowing.objects.push(object.clone());
        }
        let detail = detail(object, need);
        if accepts.contains(&ShapeKind::Mesh) {
            let model = converter.mesh(scene, object, detail, control)?;
            handed.objects[index].shape = before.mesh(&model, &mut used);
            objects.push(handing(object, model.bound, &model.why));
        } else {
            let model = converter.voxels(scene, object, detail, control)?;
            let first = handed.materials.len();
            handed.materials.extend(model.palette.iter().cloned());
            let placed = &mut handed.objects[index];
            placed.materials = (first..handed.materials.len()).collect();
            placed.world_from_object = object.world_from_object * model.object_from_voxels;
            placed.shape = before.voxels(&model, &mut used);
            objects.push(handing(object, model.bound, &model.why));
        }
    }
    // Voxels shine; as triangles they would not.
    handed.lights.extend(glowing.all_lights());
    *before = used;
    Ok(HandedOver { scene: Arc::new(handed), objects })
}

/// Tells what [`hand_over`] would do, without doing it; what would be built, and its bytes.
pub(crate) fn forecast(scene: &Scene, need: &Need, accepts: &[ShapeKind]) -> Vec<(Handing, String, u64)> {
    let converter = Converter::default();
    let one = |object: &Object| {
        if takes_all(accepts) {
            return (Handing::Given, String::new(), 0);
        }
        if let Some(why) = why_skipped(object) {
            return (Handing::Skipped { why }, String::new(), 0);
        }
        if accepts.contains(&object.shape.kind()) {
            return (Handing::Given, String::new(), 0);
        }
        let forecast = if accepts.contains(&ShapeKind::Mesh) {
            converter.mesh_forecast(scene, object, detail(object, need))
        } else {
            converter.voxels_forecast(scene, object, detail(object, need))
        };
        (handing(object, forecast.bound, &forecast.builds), forecast.builds, forecast.bytes)
    };
    scene.objects.iter().map(one).collect()
}

fn takes_all(accepts: &[ShapeKind]) -> bool {
    ShapeKind::ALL.iter().all(|kind| accepts.contains(kind))
}

fn why_skipped(object: &Object) -> Option<String> {
    if !object.visible {
        return Some("it is invisible".to_owned());
    }
    object.why_undrawable().map(str::to_owned)
}

fn detail(object: &Object, need: &Need) -> Detail {
    Detail { tolerance: need.world_tolerance(&object.bounds()), max_resolution: FINEST }
}

fn handing(object: &Object, bound: f64, why: &str) -> Handing {
    match *object.shape {
        Shape::Volume(_) => Handing::Reduced { why: why.to_owned() },
        _ => Handing::Converted { bound, why: why.to_owned() },
    }
}

impl Converted {
    fn mesh(&self, model: &Arc<MeshModel>, used: &mut Self) -> Arc<Shape> {
        let shape = find(&self.meshes, model).unwrap_or_else(|| Arc::new(Shape::Mesh(model.mesh.clone())));
        used.meshes.push((Arc::downgrade(model), shape.clone()));
        shape
    }

    fn voxels(&self, model: &Arc<VoxelModel>, used: &mut Self) -> Arc<Shape> {
        let shape =
            find(&self.voxels, model).unwrap_or_else(|| Arc::new(Shape::Voxels(model.voxels.clone())));
        used.voxels.push((Arc::downgrade(model), shape.clone()));
        shape
    }
}

fn find<T>(known: &[(Weak<T>, Arc<Shape>)], model: &Arc<T>) -> Option<Arc<Shape>> {
    known.iter().find(|(weak, _)| weak.as_ptr() == Arc::as_ptr(model)).map(|(_, shape)| shape.clone())
}

impl Handing {
    /// Puts together what the host did and what the plugin says that it did.
    pub(crate) fn and(&self, plugin: Option<&Decision>) -> Decision {
        let silent = Decision::Approximated { why: "the plugin does not say how it is drawn".to_owned() };
        let drawn = plugin.unwrap_or(&silent);
        match (self, drawn) {
            (Self::Skipped { why }, _) => Decision::Skipped { why: why.clone() },
            (Self::Given, drawn) => drawn.clone(),
            (_, Decision::Skipped { .. }) => drawn.clone(),
            (Self::Converted { bound, why }, Decision::Exact) => {
                Decision::Converted { bound: *bound, why: why.clone() }
            }
            (Self::Converted { bound, why }, Decision::Converted { bound: more, why: then }) => {
                Decision::Converted { bound: bound + more, why: format!("{why}; {then}") }
            }
            (Self::Converted { bound, why }, Decision::Approximated { why: lost }) => {
                Decision::Approximated { why: format!("{lost}; {why}, at most {bound:.2e} m off") }
            }
            (Self::Reduced { why }, Decision::Exact) => Decision::Approximated { why: why.clone() },
            (Self::Reduced { why }, other) => {
                Decision::Approximated { why: format!("{why}; {}", other.why()) }
            }
        }
    }
}
