//! The reference back end.
