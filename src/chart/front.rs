//! Which points does nothing dominate?

use super::{Measure, Point};

/// Returns the indices of points that no other beats in both time and error, fastest first.
#[must_use]
pub fn front(points: &[&Point], measure: Measure) -> Vec<usize> {
    let known = points.iter().enumerate().filter_map(|(i, p)| Some((i, p.ms.median, measure.of(p)?)));
    undominated(known.collect())
}

/// Returns which of some things, each with its time and its error, no other beats in both, fastest first.
#[must_use]
pub fn undominated(mut order: Vec<(usize, f64, f64)>) -> Vec<usize> {
    order.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2)));
    let mut least = f64::INFINITY;
    order.retain(|&(_, _, error)| {
        let is_better = error < least;
        least = least.min(error);
        is_better
    });
    order.into_iter().map(|(i, _, _)| i).collect()
}

/// Returns the index of the point with the least error within a time; nothing when none is so fast.
#[must_use]
pub fn best_within(points: &[&Point], measure: Measure, ms: f64) -> Option<usize> {
    front(points, measure).into_iter().rfind(|&i| points[i].ms.median <= ms)
}

/// Returns the index of the fastest point with at most an error; nothing when none is so right.
#[must_use]
pub fn fastest_under(points: &[&Point], measure: Measure, error: f64) -> Option<usize> {
    front(points, measure).into_iter().find(|&i| measure.of(points[i]).is_some_and(|e| e <= error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::{PointErrors, Spread};
    use std::collections::BTreeMap;

    fn point(ms: f64, error: f64) -> Point {
        Point {
            scene: String::new(),
            backend: String::new(),
            settings: BTreeMap::new(),
            prepare_ms: 0.0,
            ms: Spread { median: ms, low: ms, high: ms, count: 1 },
            bytes: 0,
            objects: [0; 4],
            errors: PointErrors { color: Some(error), ..PointErrors::default() },
            fingerprint: 0,
            picture: Vec::new(),
        }
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let points = [point(4.0, 0.1), point(1.0, 0.5), point(2.0, 0.6), point(8.0, 0.1), point(16.0, 0.0)];
        let points: Vec<&Point> = points.iter().collect();
        assert_eq!(front(&points, Measure::Color), [1, 0, 4]);
        assert_eq!(best_within(&points, Measure::Color, 9.0), Some(0));
        assert_eq!(best_within(&points, Measure::Color, 0.5), None);
        assert_eq!(fastest_under(&points, Measure::Color, 0.3), Some(0));
        assert_eq!(fastest_under(&points, Measure::Color, 0.0), Some(4));
        assert!(front(&points, Measure::Distance).is_empty());
    }
}
