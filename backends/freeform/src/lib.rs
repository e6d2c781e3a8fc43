//! The freeform back end.
