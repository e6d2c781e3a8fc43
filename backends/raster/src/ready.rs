//! What is kept of a prepared scene, and what of it serves the next one?

use crate::decide::is_resampled;
use crate::info::Options;
use crate::light::Lamp;
use crate::lines::Lines;
use crate::model::{Model, Part, Source};
use crate::shadow::{Before, MapSizes, Shadows};
use polyptych_core::camera::Camera;
use polyptych_core::framebuffer::Channels;
use polyptych_core::scene::{AlphaMode, Scene, Shape};
use polyptych_core::seam::{Decision, Need};
use std::sync::{Arc, OnceLock};

/// What is nearer to the eye than this share of the scene's size and distance is not drawn.
const NEAR: f64 = 1e-6;

/// A prepared scene.
pub(crate) struct Ready {
    pub(crate) scene: Arc<Scene>,
    /// Those that were needed.
    pub(crate) channels: Channels,
    pub(crate) model: Arc<Model>,
    /// What each object loses by being triangles.
    pub(crate) given: Arc<[Decision]>,
    /// Made when they are drawn.
    pub(crate) lines: Option<Arc<Lines>>,
    pub(crate) lamps: Vec<Lamp>,
    /// Of samples in a pixel, in steps from its center.
    pub(crate) places: Vec<[i32; 2]>,
    pub(crate) shadows: Option<Arc<Shadows>>,
    /// Those of a mode without shadows, which may be switched back.
    pub(crate) resting_shadows: Option<Arc<Shadows>>,
    pub(crate) sizes: MapSizes,
    pub(crate) options: Options,
    pub(crate) decisions: Arc<[Decision]>,
    /// The same for cameras that bend straight lines.
    pub(crate) decisions_resampled: Arc<[Decision]>,
    pub(crate) as_drawn: OnceLock<Option<Arc<Scene>>>,
    /// Bytes of what was converted.
    pub(crate) triangle_bytes: u64,
}

/// Returns the bytes of all converted triangles; objects of one shape share theirs.
pub(crate) fn triangle_bytes(model: &Model) -> u64 {
    let mut seen = std::collections::HashSet::new();
    let of = |part: &Part| match &part.source {
        Source::Converted(m) if seen.insert(Arc::as_ptr(m)) => m.mesh.bytes(),
        _ => 0,
    };
    model.parts.iter().map(of).sum()
}

impl Ready {
    /// Tells whether a picture of it is one of another need, too.
    pub(crate) fn draws(
        &self,
        scene: &Arc<Scene>,
        model: &Arc<Model>,
        need: &Need,
        options: Options,
    ) -> bool {
        Arc::ptr_eq(&self.scene, scene)
            && Arc::ptr_eq(&self.model, model)
            && self.options == options
            && self.channels == need.channels
    }

    pub(crate) fn decisions(&self, camera: &Camera) -> Arc<[Decision]> {
        let bent = is_resampled(&camera.projection);
        if bent { self.decisions_resampled.clone() } else { self.decisions.clone() }
    }

    pub(crate) fn near(&self, camera: &Camera) -> f64 {
        let bounds = &self.model.bounds;
        let near = NEAR * (bounds.radius() + bounds.center().distance(camera.eye));
        if near > 0.0 && near.is_finite() { near } else { NEAR }
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.triangle_bytes
            + self.shadows.as_ref().or(self.resting_shadows.as_ref()).map_or(0, |s| s.bytes())
            + self.lines.as_ref().map_or(0, |lines| lines.bytes())
    }

    /// Returns the shadow maps if they are those of another scene, too: same lights, same things that block. Where
    /// some are not, returns them with what is still right.
    pub(crate) fn shadows_for(self, other: &Self) -> (Option<Arc<Shadows>>, Option<Before>) {
        let Some(shadows) = self.shadows.or(self.resting_shadows) else { return (None, None) };
        let same_parts = self.model.parts.len() == other.model.parts.len()
            && self.model.parts.iter().zip(&other.model.parts).all(|(a, b)| a.blocks_like(b));
        let has_masks = other.scene.materials.iter().any(|m| m.alpha != AlphaMode::Opaque);
        let same_masks = !has_masks || Arc::ptr_eq(&self.scene, &other.scene);
        let same_map = |(a, b): (&Lamp, &Lamp)| {
            same_parts
                && same_masks
                && self.sizes == other.sizes
                && a.light == b.light
                && a.cell == b.cell
                && a.is_blocked == b.is_blocked
                && a.tier == b.tier
        };
        let same_maps: Vec<bool> = self.lamps.iter().zip(&other.lamps).map(same_map).collect();
        if self.lamps.len() == other.lamps.len() && same_parts && same_maps.iter().all(|same| *same) {
            return (Some(shadows), None);
        }
        let shadows = Arc::try_unwrap(shadows).ok();
        (None, shadows.map(|shadows| Before { shadows, same_blockers: same_parts, same_maps }))
    }

    /// Returns the scene with converted shapes as meshes. Polyhedra and voxels are drawn by their true faces
    /// and stay what they are.
    pub(crate) fn as_drawn(&self) -> Option<Arc<Scene>> {
        let mut scene = (*self.scene).clone();
        let mut changed = false;
        for part in &self.model.parts {
            let object = &mut scene.objects[part.object];
            let Source::Converted(model) = &part.source else { continue };
            let true_faces = matches!(*object.shape, Shape::Primitive(_) | Shape::Voxels(_) | Shape::Mesh(_));
            if !(true_faces && model.bound == 0.0) {
                object.shape = Arc::new(Shape::Mesh(model.mesh.clone()));
                changed = true;
            }
        }
        changed.then(|| Arc::new(scene))
    }
}
