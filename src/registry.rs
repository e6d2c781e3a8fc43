//! Which back ends are linked into the program?

use crate::seam::{BackendFactory, Origin, Registry};
use std::sync::Arc;

/// Adds the built-in back ends to a registry.
pub trait BuiltinBackends {
    /// Returns a registry with the reference and the four back ends, the reference first.
    #[must_use]
    fn builtin() -> Self;
}

impl BuiltinBackends for Registry {
    fn builtin() -> Self {
        let mut registry = Self::default();
        let factories: [Arc<dyn BackendFactory>; 5] = [
            Arc::new(polyptych_reference::Factory),
            Arc::new(polyptych_raster::Factory),
            Arc::new(polyptych_voxel::Factory),
            Arc::new(polyptych_freeform::Factory),
            Arc::new(polyptych_stylized::Factory),
        ];
        for factory in factories {
            registry.add(factory, Origin::BuiltIn);
        }
        registry
    }
}
