//! The raster back end.
