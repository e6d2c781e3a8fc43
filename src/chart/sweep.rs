//! Which settings are drawn: every axis by itself, then combinations beside what nothing dominates.

use super::axes::{QualityAxis, quality_axes};
use super::front::front;
use super::measure::Bench;
use super::{Measure, Point};
use crate::seam::Value;
use crate::studio::StudioError;
use std::collections::BTreeMap;
use std::time::Instant;

/// An axis is left where a point took so long, or the next one would if cost goes on to grow as it did, milliseconds.
const PATIENCE_MS: f64 = 2500.0;

/// Most combinations of a back end in a scene, and the time after which no more are tried, milliseconds.
const COMBINATIONS: usize = 6;
const COMBINING_MS: f64 = 3000.0;

/// After so many equal pictures an axis counts as one without effect.
const EQUAL: usize = 3;

/// An error that rises by more than this factor from a point to the next finer one breaks monotony.
const RISE: f64 = 1.05;

/// What one axis did in one scene, the others at their defaults.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct AxisWalk {
    /// The scene's name.
    pub scene: String,
    /// Id of the back end.
    pub backend: String,
    /// The axis.
    pub axis: String,
    /// Values that were drawn, in order.
    pub values: Vec<Value>,
    /// Time at each, milliseconds.
    pub ms: Vec<f64>,
    /// Error at each, by the measure of the walk.
    pub errors: Vec<f64>,
    /// Error of the first kind that the back end has: color at the centers, or with aliasing.
    pub measure: Measure,
    /// Whether the error never rises by more than a twentieth from coarse to fine.
    pub is_monotone: bool,
    /// What a reader must know of it: that it has no effect, why it was left early, why it is not monotone.
    pub note: String,
}

/// All points of a back end in a scene.
pub(super) struct Swept {
    pub(super) points: Vec<Point>,
    pub(super) walks: Vec<AxisWalk>,
}

struct Sweep<'a, 'b> {
    bench: &'a mut Bench<'b>,
    backend: String,
    points: Vec<Point>,
    measured: &'a mut dyn FnMut(&Point),
}

pub(super) fn sweep(
    bench: &mut Bench<'_>,
    backend: &str,
    measured: &mut dyn FnMut(&Point),
) -> Result<Swept, StudioError> {
    let info = bench.studio.registry().info(backend)?.clone();
    let fixed = bench.request.settings.get(backend).cloned().unwrap_or_default();
    let mut axes = quality_axes(&info, &bench.subject.scene, bench.request.ruler_samples);
    axes.retain(|axis| fixed.iter().all(|(name, _)| name != axis.name));
    let mut sweep = Sweep { bench, backend: backend.to_owned(), points: Vec::new(), measured };
    sweep.point(&BTreeMap::new())?;
    let mut walks = Vec::new();
    for axis in &mut axes {
        walks.push(sweep.walk(axis)?);
    }
    axes.retain(|axis| axis.values.len() > 1);
    if axes.len() > 1 {
        sweep.combine(&axes)?;
    }
    Ok(Swept { points: sweep.points, walks })
}

impl Sweep<'_, '_> {
    /// Measures settings, once; returns the index of the point.
    fn point(&mut self, settings: &BTreeMap<String, Value>) -> Result<usize, StudioError> {
        if let Some(index) = self.points.iter().position(|p| p.settings == *settings) {
            return Ok(index);
        }
        let point = self.bench.measure(&self.backend, settings)?;
        (self.measured)(&point);
        self.points.push(point);
        Ok(self.points.len() - 1)
    }

    /// Walks an axis, the others at their defaults, and cuts it to the values that are worth combining.
    fn walk(&mut self, axis: &mut QualityAxis) -> Result<AxisWalk, StudioError> {
        let mut indices = Vec::new();
        let mut note = String::new();
        for value in &axis.values {
            let settings = with(&BTreeMap::new(), axis, value);
            let index = self.point(&settings)?;
            indices.push(index);
            let first = self.points[indices[0]].fingerprint;
            if indices.len() == EQUAL && indices.iter().all(|&i| self.points[i].fingerprint == first) {
                // The other end tells whether the axis is idle or only begins late.
                let end = axis.values.last().map(|v| with(&BTreeMap::new(), axis, v)).unwrap_or_default();
                let end = self.point(&end)?;
                if self.points[end].fingerprint == first {
                    "changes nothing in this picture".clone_into(&mut note);
                    break;
                }
            }
            let point = &self.points[index];
            let cost = |i: usize| self.points[i].prepare_ms + self.points[i].ms.median * 3.0;
            let growth = match indices[..] {
                [.., before, last] if last > before => (cost(last) / cost(before)).max(1.0),
                _ => 1.0,
            };
            // Four points make a line; for them there is more patience.
            let patience = if indices.len() < 4 { PATIENCE_MS * 3.0 } else { PATIENCE_MS };
            if cost(index) * growth > patience && indices.len() < axis.values.len() {
                note = format!(
                    "finer values were left out: {value} took {:.1} s to prepare and {:.2} s a frame",
                    point.prepare_ms / 1e3,
                    point.ms.median / 1e3
                );
                break;
            }
        }
        axis.values.truncate(indices.len());
        let points: Vec<&Point> = indices.iter().map(|&i| &self.points[i]).collect();
        let walk = describe(self.bench, &self.backend, axis, &points, note);
        if walk.note.starts_with("changes nothing") {
            axis.values.truncate(1);
        }
        Ok(walk)
    }

    /// Tries neighbors of what nothing dominates, in every direction, until the front stays as it is.
    fn combine(&mut self, axes: &[QualityAxis]) -> Result<(), StudioError> {
        let mut expanded: Vec<usize> = Vec::new();
        let mut left = COMBINATIONS;
        let begin = Instant::now();
        loop {
            let all: Vec<&Point> = self.points.iter().collect();
            let measure = measure_of(&all);
            let next = front(&all, measure).into_iter().find(|i| !expanded.contains(i));
            let Some(index) = next else { return Ok(()) };
            expanded.push(index);
            let settings = self.points[index].settings.clone();
            for axis in axes {
                let own = settings.get(&axis.name).unwrap_or(&axis.default);
                let near = nearest(&axis.values, own);
                for at in [near.checked_sub(1), Some(near + 1)].into_iter().flatten() {
                    let Some(value) = axis.values.get(at) else { continue };
                    let beside = with(&settings, axis, value);
                    if self.points.iter().any(|p| p.settings == beside) {
                        continue;
                    }
                    if left == 0 || begin.elapsed().as_secs_f64() * 1e3 > COMBINING_MS {
                        return Ok(());
                    }
                    left -= 1;
                    self.point(&beside)?;
                }
            }
        }
    }
}

/// Sets an axis in settings that hold only what differs from the defaults.
fn with(settings: &BTreeMap<String, Value>, axis: &QualityAxis, value: &Value) -> BTreeMap<String, Value> {
    let mut settings = settings.clone();
    if *value == axis.default {
        settings.remove(&axis.name);
    } else {
        settings.insert(axis.name.clone(), value.clone());
    }
    settings
}

/// Returns the index of the value that is nearest to one: words by equality, numbers by ratio.
fn nearest(values: &[Value], own: &Value) -> usize {
    let as_number = |v: &Value| match v {
        Value::Int(v) => Some((*v as f64).max(1e-9).ln()),
        Value::Float(v) => Some(v.max(1e-9).ln()),
        _ => None,
    };
    let off = |v: &Value| match (as_number(v), as_number(own)) {
        (Some(a), Some(b)) => (a - b).abs(),
        _ => f64::from(u8::from(v != own)),
    };
    (0..values.len()).min_by(|&a, &b| off(&values[a]).total_cmp(&off(&values[b]))).unwrap_or(0)
}

/// Returns the first measure that all of some points have and that tells them apart from the ruler: the reference
/// itself is held against many samples a pixel.
fn measure_of(points: &[&Point]) -> Measure {
    let has_error =
        |m: Measure| points.iter().all(|p| m.of(p).is_some()) && points.iter().any(|p| m.of(p) > Some(0.0));
    Measure::ALL.into_iter().find(|&m| has_error(m)).unwrap_or(Measure::Color)
}

/// Says what an axis did.
fn describe(
    bench: &Bench<'_>,
    backend: &str,
    axis: &QualityAxis,
    points: &[&Point],
    note: String,
) -> AxisWalk {
    let measure = measure_of(points);
    let errors: Vec<f64> = points.iter().map(|p| measure.of(p).unwrap_or(0.0)).collect();
    // Words have no order of their own; the table shows them as they are declared.
    let is_ordered = !matches!(axis.default, Value::Text(_));
    let rise = errors.windows(2).position(|w| w[1] > w[0] * RISE && w[1] > 1e-9);
    let is_monotone = !is_ordered || rise.is_none();
    let mut walk = AxisWalk {
        scene: bench.subject.name.clone(),
        backend: backend.to_owned(),
        axis: axis.name.clone(),
        values: axis.values.clone(),
        ms: points.iter().map(|p| p.ms.median).collect(),
        errors,
        measure,
        is_monotone,
        note,
    };
    if let Some(at) = rise.filter(|_| is_ordered) {
        let reason = why_it_rises(points, at, &axis.values, &walk);
        walk.note = if walk.note.is_empty() { reason } else { format!("{reason}; {}", walk.note) };
    }
    walk
}

/// Reads from the other errors why one rises from a point to the next finer one.
fn why_it_rises(points: &[&Point], at: usize, values: &[Value], walk: &AxisWalk) -> String {
    let (coarse, fine) = (points[at], points[at + 1]);
    let step = format!(
        "from {} to {} the error rises from {:.2e} to {:.2e}",
        values[at],
        values[at + 1],
        walk.errors[at],
        walk.errors[at + 1]
    );
    let falls = |m: Measure| match (m.of(coarse), m.of(fine)) {
        (Some(a), Some(b)) if b < a => Some(format!("{a:.2e} to {b:.2e}")),
        _ => None,
    };
    let nearer = falls(Measure::Distance).map(|f| format!("the surface comes nearer (distance error {f})"));
    let outline =
        falls(Measure::Silhouette).map(|f| format!("the outline comes nearer (silhouette error {f})"));
    let turned = match (coarse.errors.normal_deg, fine.errors.normal_deg) {
        (Some(a), Some(b)) if b > a => {
            Some(format!("its normals turn away ({a:.2} to {b:.2} degrees), and with them the light"))
        }
        _ => None,
    };
    let reason = match (nearer.or(outline), turned) {
        (Some(nearer), Some(turned)) => format!("{nearer}, but {turned}"),
        (None, Some(turned)) => turned,
        (Some(nearer), None) => {
            format!("{nearer}; colors at edges and in shadows of single pixels fall on the other side")
        }
        (None, None) => {
            "few pixels decide: edges of shapes and shadows fall now on one side, now on the other".to_owned()
        }
    };
    format!("{step}: {reason}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_hold_what_differs_from_the_defaults() {
        let axis = QualityAxis {
            name: "detail".to_owned(),
            unit: String::new(),
            values: vec![Value::Int(16), Value::Int(128), Value::Int(1024)],
            default: Value::Int(128),
        };
        let fine = with(&BTreeMap::new(), &axis, &Value::Int(1024));
        assert_eq!(fine["detail"], Value::Int(1024));
        assert!(with(&fine, &axis, &Value::Int(128)).is_empty());
        assert_eq!(nearest(&axis.values, &Value::Int(200)), 1);
    }
}
