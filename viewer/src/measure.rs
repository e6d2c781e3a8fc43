//! How long did things take, and how often?

use std::collections::VecDeque;
use std::fmt::{Display, Formatter, Result};
use std::time::Duration;

/// Most times that are kept: the newest.
const MOST: usize = 1 << 14;
/// Upper ends of the classes of a histogram, milliseconds.
const CLASSES: [f32; 7] = [1.0, 2.0, 5.0, 10.0, 16.0, 33.0, f32::INFINITY];

/// Times, the newest last.
#[derive(Clone, Debug, Default)]
pub struct Times {
    ms: VecDeque<f32>,
}

impl Times {
    /// Adds a time.
    pub fn add(&mut self, time: Duration) {
        if self.ms.len() == MOST {
            self.ms.pop_front();
        }
        self.ms.push_back(time.as_secs_f32() * 1e3);
    }

    /// Adds all times of another list.
    pub(crate) fn extend(&mut self, other: &Self) {
        self.ms.extend(&other.ms);
    }

    /// Returns how many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.ms.len()
    }

    /// Returns the time that a share of all does not exceed, milliseconds; 0 of none.
    #[must_use]
    pub fn percentile(&self, share: f64) -> f32 {
        let mut sorted: Vec<_> = self.ms.iter().copied().collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let last = sorted.len().saturating_sub(1);
        sorted.get((last as f64 * share).round() as usize).copied().unwrap_or(0.0)
    }
}

impl Display for Times {
    /// Prints a histogram in one line.
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let (p50, p99, most) = (self.percentile(0.5), self.percentile(0.99), self.percentile(1.0));
        write!(f, "{} times, median {p50:.2} ms, p99 {p99:.2} ms, most {most:.2} ms", self.count())?;
        let mut low = 0.0;
        for high in CLASSES {
            let count = self.ms.iter().filter(|&&ms| low <= ms && ms < high).count();
            if high.is_finite() {
                write!(f, "; under {high} ms: {count}")?;
            } else {
                write!(f, "; longer: {count}")?;
            }
            low = high;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histograms_count_every_time_once() {
        let mut times = Times::default();
        (0..100).for_each(|i| times.add(Duration::from_micros(i * 200 + 100)));
        assert_eq!(times.percentile(1.0), 19.9);
        assert_eq!(
            times.to_string(),
            "100 times, median 10.10 ms, p99 19.70 ms, most 19.90 ms; under 1 ms: 5; under 2 ms: 5; under 5 ms: 15; \
             under 10 ms: 25; under 16 ms: 30; under 33 ms: 20; longer: 0"
        );
    }
}
