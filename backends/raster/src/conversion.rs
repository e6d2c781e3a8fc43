//! Which conversion of an earlier call serves an object again?

use polyptych_core::convert::{Detail, MeshModel};
use polyptych_core::scene::{Object, Scene, Shape};
use std::sync::Arc;

/// A converted shape with all that it was made from.
pub(crate) struct Conversion {
    shape: Arc<Shape>,
    matrix: glam::DMat3,
    /// Which slots let light through: it decides which faces of voxels are seen.
    see_through: Vec<bool>,
    /// The converter's class of the tolerance.
    class: i32,
    pub(crate) model: Arc<MeshModel>,
}

impl Conversion {
    /// Makes a record of a conversion.
    pub(crate) fn new(scene: &Scene, object: &Object, detail: Detail, model: Arc<MeshModel>) -> Self {
        Self {
            shape: object.shape.clone(),
            matrix: object.world_from_object.matrix3,
            see_through: see_through(scene, object),
            class: detail.class(object),
            model,
        }
    }

    /// Tells whether the conversion of an object would be the same.
    pub(crate) fn serves(&self, scene: &Scene, object: &Object, detail: Detail) -> bool {
        Arc::ptr_eq(&self.shape, &object.shape)
            && self.class == detail.class(object)
            && self.matrix == object.world_from_object.matrix3
            && self.see_through == see_through(scene, object)
    }
}

fn see_through(scene: &Scene, object: &Object) -> Vec<bool> {
    (0..object.materials.len()).map(|slot| scene.material(object, slot).is_see_through()).collect()
}
