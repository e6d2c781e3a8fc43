//! Polyptych.
