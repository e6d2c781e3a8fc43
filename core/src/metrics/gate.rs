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
    /// There may be noise, but it must be noise: its mean in each part of the picture is zero.
    Stochastic,
    /// Lines and the borders of tones may be off by a pixel, but none may be missing.
    Stylized,
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
    /// Largest share of the reference's pixels that are missing in the picture.
    pub missing_share: f64,
    /// Largest mean difference of a tile in standard errors.
    pub worst_z: f64,
    /// Whether outliers must stand out of the noise around them to count.
    pub forgives_noise: bool,
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
        missing_share: 0.0,
        worst_z: 0.0,
        forgives_noise: false,
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
        missing_share: 1.0,
        worst_z: f64::INFINITY,
        forgives_noise: false,
    };

    /// Noise without bias.
    ///
    /// The limit of the z-test lies between the largest of 25,000 normal numbers (4.2: a picture of 1920x1080) and an
    /// object of 4x4 pixels gone (7); noise widens tiles and blobs, so those are bounded by what is loud.
    pub const STOCHASTIC: Self = Self {
        class: GateClass::Stochastic,
        largest_blob: u64::MAX,
        worst_z: 6.0,
        forgives_noise: true,
        ..Self::EDGE_TOLERANT
    };

    /// Lines and tones.
    ///
    /// What may be missing lies between lines that moved by less than a pixel (0.0002) and one of 60 pixels that is
    /// gone in 256x256 (0.0009).
    pub const STYLIZED: Self =
        Self { class: GateClass::Stylized, missing_share: 0.0006, ..Self::EDGE_TOLERANT };

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
        let allow = |share: f64| ((pixels as f64 * share) as u64).max(self.outliers_always);
        let (outliers, word) =
            if self.forgives_noise { (color.loud, "loud outliers") } else { (color.outliers, "outliers") };
        let allowed = allow(self.outlier_share);
        if outliers > allowed {
            failed.push(format!("{word} {outliers} > {allowed}"));
        }
        let allowed = allow(self.missing_share);
        if color.missing > allowed {
            failed.push(format!("missing {} > {allowed}", color.missing));
        }
        if color.worst_z > self.worst_z {
            failed.push(format!("worst z {:.1} > {}", color.worst_z, self.worst_z));
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
