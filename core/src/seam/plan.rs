//! What a back end would do with a scene, before it does anything.

use serde::Serialize;

/// How an object is drawn.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "decision", rename_all = "snake_case")]
pub enum Decision {
    /// As it was given.
    Exact,
    /// In another representation, at most `bound` meters off.
    Converted {
        /// Bound on the distance between the surfaces, meters.
        bound: f64,
        /// What was converted into what, and what the bound rests on.
        why: String,
    },
    /// Something about it is left out or simplified.
    Approximated {
        /// What.
        why: String,
    },
    /// Not at all.
    Skipped {
        /// Why.
        why: String,
    },
}

impl Decision {
    /// Returns the word used in tables and JSON.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Converted { .. } => "converted",
            Self::Approximated { .. } => "approximated",
            Self::Skipped { .. } => "skipped",
        }
    }

    /// Adds that something is left out or simplified.
    #[must_use]
    pub fn weakened(&self, loss: &str) -> Self {
        let why = match self {
            Self::Skipped { .. } => return self.clone(),
            Self::Exact => loss.to_owned(),
            Self::Approximated { why } => format!("{why}; {loss}"),
            Self::Converted { bound, why } => format!("{loss}; {why}, at most {bound:.2e} m off"),
        };
        Self::Approximated { why }
    }

    /// Returns the reason, empty for exact objects.
    #[must_use]
    pub fn why(&self) -> &str {
        match self {
            Self::Exact => "",
            Self::Converted { why, .. } | Self::Approximated { why } | Self::Skipped { why } => why,
        }
    }

    /// Returns the bound of a conversion.
    #[must_use]
    pub fn bound(&self) -> Option<f64> {
        match self {
            Self::Exact => Some(0.0),
            Self::Converted { bound, .. } => Some(*bound),
            _ => None,
        }
    }
}

/// What would be done with one object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObjectPlan {
    /// The object's name.
    pub name: String,
    /// Its kind of shape.
    pub shape: &'static str,
    /// How it would be drawn.
    #[serde(flatten)]
    pub decision: Decision,
    /// What would be built for it: `"mesh of 1,280 triangles"`, or empty.
    pub builds: String,
    /// Bytes of that.
    pub bytes: u64,
}

/// A pass over the picture, or the reason why it is not needed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassPlan {
    /// `"shadow map of light 0"`.
    pub name: String,
    /// Whether it would run.
    pub needed: bool,
    /// Why or why not.
    pub why: String,
}

/// What a back end would build for a need, and what that costs. Making a plan builds nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Plan {
    /// One for each object of the scene, in order.
    pub objects: Vec<ObjectPlan>,
    /// Passes in order.
    pub passes: Vec<PassPlan>,
    /// Bytes of everything that would be built.
    pub bytes: u64,
    /// Estimated time of a frame on one thread, milliseconds.
    pub estimated_ms: f64,
}
