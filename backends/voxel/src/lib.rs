//! The voxel back end.
