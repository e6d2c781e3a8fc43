//! Which conversion of before is what is asked for again?

use super::{ConvertError, Detail};
use crate::scene::{Material, Object, Scene, Shape};
use crate::seam::Control;
use glam::DAffine3;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Results by shape, class and the materials that went into them.
pub(super) struct Cache<T> {
    entries: Mutex<HashMap<Key, Vec<Entry<T>>>>,
}

/// Address of the shape, class of the tolerance, and resolution.
type Key = (usize, i32, u32);

struct Entry<T> {
    /// Keeps the address of the shape from being used again while the entry stands.
    shape: Weak<Shape>,
    scale: DAffine3,
    materials: Vec<Material>,
    model: Arc<T>,
}

impl<T> Default for Cache<T> {
    fn default() -> Self {
        Self { entries: Mutex::new(HashMap::new()) }
    }
}

impl<T> Cache<T> {
    fn key(object: &Object, detail: Detail) -> Key {
        (Arc::as_ptr(&object.shape) as usize, detail.class(object), detail.max_resolution)
    }

    pub(super) fn count(&self) -> usize {
        let entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        entries.values().map(Vec::len).sum()
    }

    pub(super) fn find(&self, scene: &Scene, object: &Object, detail: Detail) -> Option<Arc<T>> {
        let entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        entries
            .get(&Self::key(object, detail))?
            .iter()
            .find(|e| e.fits(scene, object))
            .map(|e| e.model.clone())
    }

    /// Finds a result or makes it; results of shapes that are gone are dropped. What was stopped halfway is not kept.
    pub(super) fn get(
        &self,
        scene: &Scene,
        object: &Object,
        detail: Detail,
        control: &Control<'_>,
        make: impl FnOnce(f64) -> Result<T, ConvertError>,
    ) -> Result<Arc<T>, ConvertError> {
        if let Some(model) = self.find(scene, object, detail) {
            return Ok(model);
        }
        if let Some(reason) = object.why_undrawable() {
            return Err(ConvertError::of(object, reason));
        }
        let made = make(detail.in_object(object));
        // Once the host wants to stop, it does so until we return: what was made before is whole.
        control.check()?;
        let model = Arc::new(made?);
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        entries.retain(|_, list| {
            list.retain(|e| e.shape.strong_count() > 0);
            !list.is_empty()
        });
        entries.entry(Self::key(object, detail)).or_default().push(Entry {
            shape: Arc::downgrade(&object.shape),
            scale: object.world_from_object,
            materials: object_materials(scene, object),
            model: model.clone(),
        });
        Ok(model)
    }
}

impl<T> Entry<T> {
    fn fits(&self, scene: &Scene, object: &Object) -> bool {
        self.scale.matrix3 == object.world_from_object.matrix3
            && self.materials.len() == object.materials.len()
            && self.materials.iter().enumerate().all(|(slot, m)| m == scene.material(object, slot))
    }
}

fn object_materials(scene: &Scene, object: &Object) -> Vec<Material> {
    (0..object.materials.len()).map(|slot| scene.material(object, slot).clone()).collect()
}
