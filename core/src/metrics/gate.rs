//! Is a picture the same picture? Pass or fail by four numbers that catch structural faults.
//!
//! Means and structural similarity let a missing small object, an undrawn tile or sixty crack pixels pass.
//! Bias catches a wrong light, the worst tile what is missing in one place, outliers what is scattered, the
//! largest blob what is small and whole.

use super::{ColorErrors, Errors};
use serde::Serialize;

/// How strictly pictures are held against each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum GateClass {
    /// The same bytes.
    Exact,
    /// Edges may be off by a pixel; surfaces must agree.
    EdgeTolerant,
}

/// Limits of a class.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gate {
    /// The class.
    pub class: GateClass,
    /// Largest mean difference of a channel.
    pub bias: f64,
    /// Largest mean absolute difference in a 32x32 tile.
    pub worst_tile: f64,
    /// Largest share of outliers.
    pub outlier_share: f64,
    /// Outliers that are always allowed, so that small pictures are not held to less than a pixel.
    pub outliers_always: u64,
    /// Largest connected group of outliers.
    pub largest_blob: u64,
    /// Smallest share of pixels off edges with the same id.
    pub id_agreement: f64,
}

impl Gate {
    /// The same bytes.
    pub const EXACT: Self = Self {
        class: GateClass::Exact,
        bias: 0.0,
        worst_tile: 0.0,
        outlier_share: 0.0,
        outliers_always: 0,
        largest_blob: 0,
        id_agreement: 1.0,
    };

    /// Edges may be off by a pixel.
    ///
    /// Each limit lies between two cases: bias between an edge moved by a pixel everywhere (0.002) and light a
    /// tenth too bright (0.01); the tile between a moved edge through fine texture (0.06) and an object of a
    /// quarter tile gone (0.1); outliers between aliased shadow edges (0.0003) and 60 cracks in 256x256 pixels
    /// (0.0009); the blob between a jagged shadow corner (10) and an object of 5x5 pixels (25).
    pub const EDGE_TOLERANT: Self = Self {
        class: GateClass::EdgeTolerant,
        bias: 0.005,
        worst_tile: 0.08,
        outlier_share: 0.0006,
        outliers_always: 8,
        largest_blob: 16,
        id_agreement: 0.999,
    };

    /// Decides about a picture of so many pixels; every limit that does not hold is named with its number.
    #[must_use]
    pub fn judge(&self, errors: &Errors, pixels: u64) -> Verdict {
        let mut failed = Vec::new();
        if let Some(color) = &errors.color {
            self.judge_color(color, pixels, &mut failed);
        }
        if let Some(agreement) = errors.id_agreement
            && agreement < self.id_agreement
        {
            failed.push(format!("id agreement {agreement:.5} < {}", self.id_agreement));
        }
        Verdict { passed: failed.is_empty(), failed, class: self.class }
    }

    fn judge_color(&self, color: &ColorErrors, pixels: u64, failed: &mut Vec<String>) {
        if color.bias > self.bias {
            failed.push(format!("bias {:.5} > {}", color.bias, self.bias));
        }
        if color.worst_tile > self.worst_tile {
            failed.push(format!("worst tile {:.4} > {}", color.worst_tile, self.worst_tile));
        }
        let allowed = ((pixels as f64 * self.outlier_share) as u64).max(self.outliers_always);
        if color.outliers > allowed {
            failed.push(format!("outliers {} > {allowed}", color.outliers));
        }
        if color.largest_blob > self.largest_blob {
            failed.push(format!("largest blob {} > {}", color.largest_blob, self.largest_blob));
        }
    }
}

/// The decision of a [`Gate`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Whether every limit holds.
    pub passed: bool,
    /// The limits that do not, with both numbers.
    pub failed: Vec<String>,
    /// The class of the gate.
    pub class: GateClass,
}
