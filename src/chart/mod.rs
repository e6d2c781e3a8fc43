//! How right is a picture for the time it takes: back ends along their quality axes, over scenes?
//!
//! For each scene and back end every quality axis is walked from coarse to fine, the others at their defaults; then
//! combinations are tried, but only next to settings that nothing dominates. Each point holds time (median and spread
//! of warm frames), memory, errors against the reference, and the picture.

mod axes;
mod front;
mod growth;
mod measure;
mod sweep;

pub use axes::{QualityAxis, quality_axes};
pub use front::{best_within, fastest_under, front, undominated};
pub(crate) use growth::ball;
pub use growth::{Growth, Quantity};
pub use sweep::AxisWalk;

use crate::camera::Camera;
use crate::scene::Scene;
use crate::seam::{Settings, Value};
use crate::studio::{Studio, StudioError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The name under which a point's settings hold the tolerance of its need, in pixels.
pub const TOLERANCE: &str = "tolerance";

/// A scene to be charted.
#[derive(Clone, Debug)]
pub struct Subject {
    /// What it is called on the command line: a file or `builtin:NAME`.
    pub name: String,
    /// The scene.
    pub scene: Arc<Scene>,
    /// From where.
    pub camera: Camera,
}

/// What to chart.
#[derive(Clone, Debug)]
pub struct Request {
    /// Scenes.
    pub subjects: Vec<Subject>,
    /// Back ends; the reference may be one of them.
    pub backends: Vec<String>,
    /// Settings that hold for all points of a back end; what is set here is not swept.
    pub settings: BTreeMap<String, Settings>,
    /// Columns of the pictures.
    pub width: u32,
    /// Rows of the pictures.
    pub height: u32,
    /// Samples a pixel of the antialiased ruler.
    pub ruler_samples: u32,
    /// Whether cost is also measured against triangles, voxels, functions, lights, pixels and threads.
    pub growth: bool,
    /// Points of an earlier run that was stopped; they are not drawn again.
    pub known: Vec<Point>,
}

impl Request {
    /// Asks for scenes and back ends at a size that draws a chart of the built-in scenes within three minutes.
    #[must_use]
    pub fn new(subjects: Vec<Subject>, backends: Vec<String>) -> Self {
        Self {
            subjects,
            backends,
            settings: BTreeMap::new(),
            width: 256,
            height: 144,
            ruler_samples: 32,
            growth: false,
            known: Vec::new(),
        }
    }
}

/// One back end's picture of one scene under some settings, measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The scene's name.
    pub scene: String,
    /// Id of the back end.
    pub backend: String,
    /// What differs from the defaults, [`TOLERANCE`] among it.
    pub settings: BTreeMap<String, Value>,
    /// Time to prepare, milliseconds.
    pub prepare_ms: f64,
    /// Time of a frame in color alone, milliseconds.
    pub ms: Spread,
    /// Bytes held for the scene.
    pub bytes: u64,
    /// Objects drawn exactly, converted, approximated, skipped.
    pub objects: [usize; 4],
    /// Errors against the ruler.
    pub errors: PointErrors,
    /// Equal for equal pictures.
    pub fingerprint: u64,
    /// The picture as JPEG.
    #[serde(with = "base64_bytes")]
    pub picture: Vec<u8>,
}

/// The middle of some times and how far they spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Median.
    pub median: f64,
    /// Shortest.
    pub low: f64,
    /// Longest.
    pub high: f64,
    /// How many.
    pub count: usize,
}

impl Spread {
    fn of(times: &mut [f64]) -> Self {
        times.sort_unstable_by(f64::total_cmp);
        match (times.first(), times.last()) {
            (Some(&low), Some(&high)) => {
                Self { median: times[times.len() / 2], low, high, count: times.len() }
            }
            _ => Self::default(),
        }
    }
}

/// Errors of a point; nothing where there is nothing to hold it against.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointErrors {
    /// Root mean square difference of displayed color to the reference at the pixels' centers, full scale 1.
    pub color: Option<f64>,
    /// The same against the reference with many samples a pixel: aliasing counts, too.
    pub antialiased: Option<f64>,
    /// Mean difference of distance over distance where both see the same object.
    pub distance: Option<f64>,
    /// Mean angle between normals there, degrees.
    pub normal_deg: Option<f64>,
    /// Share of the seen area in which only one of the two sees something.
    pub silhouette: Option<f64>,
}

/// A way to measure the error of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// [`PointErrors::color`].
    Color,
    /// [`PointErrors::antialiased`].
    Antialiased,
    /// [`PointErrors::distance`].
    Distance,
    /// [`PointErrors::normal_deg`].
    NormalDeg,
    /// [`PointErrors::silhouette`].
    Silhouette,
}

impl Measure {
    /// All measures, the default first.
    pub const ALL: [Self; 5] =
        [Self::Color, Self::Antialiased, Self::Distance, Self::NormalDeg, Self::Silhouette];

    /// Returns the name used in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Antialiased => "antialiased",
            Self::Distance => "distance",
            Self::NormalDeg => "normal_deg",
            Self::Silhouette => "silhouette",
        }
    }

    /// Returns the label of an axis, with the unit.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::Color => "color error (RMSE, full scale = 1)",
            Self::Antialiased => "color error with aliasing (RMSE, full scale = 1)",
            Self::Distance => "distance error (mean, share of the distance)",
            Self::NormalDeg => "normal error (mean, degrees)",
            Self::Silhouette => "silhouette error (share of the area)",
        }
    }

    /// Returns the error of a point.
    #[must_use]
    pub fn of(self, point: &Point) -> Option<f64> {
        let errors = &point.errors;
        match self {
            Self::Color => errors.color,
            Self::Antialiased => errors.antialiased,
            Self::Distance => errors.distance,
            Self::NormalDeg => errors.normal_deg,
            Self::Silhouette => errors.silhouette,
        }
    }
}

/// Everything that was measured.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Names of the scenes.
    pub scenes: Vec<String>,
    /// Ids and names of the back ends.
    pub backends: Vec<(String, String)>,
    /// Columns of the pictures.
    pub width: u32,
    /// Rows of the pictures.
    pub height: u32,
    /// Threads that were used.
    pub threads: usize,
    /// Whether each of them stayed on a core of its own.
    pub pinned: bool,
    /// Samples a pixel of the antialiased ruler.
    pub ruler_samples: u32,
    /// The ruler's picture of each scene at the pixels' centers, as JPEG.
    pub rulers: Vec<Vec<u8>>,
    /// The points, scene by scene.
    pub points: Vec<Point>,
    /// What each axis did in each scene.
    pub walks: Vec<AxisWalk>,
    /// How cost grows.
    pub growth: Vec<Growth>,
}

/// What a chart is at.
#[derive(Clone, Copy, Debug)]
pub enum Step<'a> {
    /// Begins with a part: so many are done, of so many.
    Begun {
        /// Parts done.
        done: usize,
        /// All parts.
        all: usize,
        /// What it is about.
        what: &'a str,
    },
    /// A point was measured.
    Measured(&'a Point),
}

/// Measures a chart; `progress` hears of each step.
///
/// # Errors
/// When a back end is unknown or refuses a scene.
pub fn chart(
    studio: &mut Studio,
    request: &Request,
    progress: &mut dyn FnMut(Step<'_>),
) -> Result<Chart, StudioError> {
    let mut chart = Chart {
        scenes: request.subjects.iter().map(|s| s.name.clone()).collect(),
        backends: Vec::new(),
        width: request.width,
        height: request.height,
        threads: crate::parallel::Threads::count(studio.pool()),
        pinned: studio.pool().is_pinned(),
        ruler_samples: request.ruler_samples,
        rulers: Vec::new(),
        points: Vec::new(),
        walks: Vec::new(),
        growth: Vec::new(),
    };
    for id in &request.backends {
        chart.backends.push((id.clone(), studio.registry().info(id)?.name.clone()));
    }
    let growths = if request.growth { growth::runs(&request.backends) } else { Vec::new() };
    let all = request.subjects.len() * request.backends.len() + growths.len();
    let mut done = 0;
    for subject in &request.subjects {
        let mut bench = measure::Bench::new(studio, request, subject)?;
        chart.rulers.push(bench.ruler_picture());
        for backend in &request.backends {
            progress(Step::Begun { done, all, what: &format!("{}: {backend}", subject.name) });
            let swept = sweep::sweep(&mut bench, backend, &mut |point| progress(Step::Measured(point)))?;
            chart.points.extend(swept.points);
            chart.walks.extend(swept.walks);
            done += 1;
        }
    }
    for run in &growths {
        progress(Step::Begun { done, all, what: &format!("growth: {}", run.name()) });
        chart.growth.push(run.measure(studio)?);
        done += 1;
    }
    Ok(chart)
}

/// Pictures as text in files of points.
mod base64_bytes {
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&STANDARD.encode(bytes))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
        let text = String::deserialize(deserializer)?;
        STANDARD.decode(text).map_err(serde::de::Error::custom)
    }
}
