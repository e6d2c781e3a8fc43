//! LIMITS.md: where does each method break, in words; and has anything got worse since it was written?

use super::super::page::{machine, today};
use super::super::plot::number;
use super::{breaks, command_of};
use crate::stability::{Case, Outcome};
use std::fmt::Write as _;

const HEAD: &str = "# Limits: where each method breaks

Written by `polyptych stability`; do not edit. One parameter is swept in each case, easy values first, in pictures of
96 x 72 pixels. A method *breaks* at the first value at which its error passes the limit; \"never\" means not within the
values that were tried, the last of which stands in the command. Where a better way is known, it is told with its price:
the time of a frame against the plain way's at the same value. The command beside each line draws that value again and
tells its worst pixel; `--pixel X,Y` tells about any other. `polyptych stability --check LIMITS.md` fails where something
breaks earlier than here.
";

/// Writes LIMITS.md.
#[must_use]
pub fn limits(cases: &[Case], outcomes: &[Outcome]) -> String {
    let mut text = format!("{HEAD}\nMeasured on {}, {}.\n", machine(), today());
    text.push_str(&in_short(cases, outcomes));
    for case in cases {
        let own: Vec<&Outcome> = outcomes.iter().filter(|o| o.case == case.id).collect();
        let (Some(first), Some(last)) = (case.values.first(), case.values.last()) else { continue };
        if own.is_empty() {
            continue;
        }
        let against = if case.is_method { ", against the reference's picture of the same model" } else { "" };
        let promise = if case.is_promise { " Nothing may break it." } else { "" };
        let _ = write!(
            text,
            "\n## {}: {}\n\nSwept: {}, from {} to {}. Counted: {}{against}; limit {}.{promise}\n\n\
             | back end | way | breaks at | error there | price | command |\n|---|---|---|---|---|---|\n",
            case.id,
            case.title,
            case.parameter,
            number(*first),
            number(*last),
            case.counted,
            number(case.limit)
        );
        for outcome in &own {
            let index = outcome.breaks_at.and_then(|at| outcome.values.iter().position(|v| *v == at));
            let index = index.unwrap_or(outcome.values.len().saturating_sub(1));
            let at = outcome.values.get(index).copied().unwrap_or(0.0);
            let error = outcome.error.get(index).copied().unwrap_or(0.0);
            let error = if error.is_finite() { number(error) } else { "-".to_owned() };
            let _ = writeln!(
                text,
                "| {} | {} | {} | {error} | {} | `{}` |",
                outcome.backend,
                outcome.method.unwrap_or("plain"),
                breaks(outcome),
                price(outcome, &own),
                command_of(outcome, at)
            );
        }
    }
    text
}

/// Lists what breaks, a line for each case, and names the cases that nothing breaks.
fn in_short(cases: &[Case], outcomes: &[Outcome]) -> String {
    let (mut broken, mut whole) = (String::new(), Vec::new());
    for case in cases {
        let own = || outcomes.iter().filter(|o| o.case == case.id && o.method.is_none());
        let places: Vec<String> = own()
            .filter(|o| o.breaks_at.is_some())
            .map(|o| format!("{} at {}", o.backend, breaks(o)))
            .collect();
        match (places.is_empty(), own().next()) {
            (true, Some(_)) => whole.push(case.id),
            (true, None) => {}
            (false, _) => {
                let _ = writeln!(broken, "- {} ({}): {}", case.id, case.parameter, places.join(", "));
            }
        }
    }
    format!("\n## In short\n\n{broken}\nNothing breaks: {}.\n", whole.join(", "))
}

/// Says what a better way costs: its time over the plain way's at the last value that both drew.
pub(super) fn price(outcome: &Outcome, all: &[&Outcome]) -> String {
    let plain = all.iter().find(|o| o.backend == outcome.backend && o.method.is_none());
    let Some(plain) = plain.filter(|_| outcome.method.is_some()) else { return String::new() };
    let common = outcome.values.iter().rposition(|v| plain.values.contains(v));
    let ratio = common.and_then(|i| {
        let j = plain.values.iter().position(|v| *v == outcome.values[i])?;
        (plain.ms[j] > 0.0).then(|| outcome.ms[i] / plain.ms[j])
    });
    ratio.map_or(String::new(), |r| format!("{r:.1} x time"))
}

/// Compares outcomes with a LIMITS.md and lists what breaks earlier than it says, and what breaks though it is promised.
/// Cases of time (`load-...`) depend on the machine and are not held against it.
#[must_use]
pub fn check(cases: &[Case], outcomes: &[Outcome], limits: &str) -> Vec<String> {
    let mut worse = Vec::new();
    for outcome in outcomes.iter().filter(|o| !o.case.starts_with("load-")) {
        let Some(case) = cases.iter().find(|c| c.id == outcome.case) else { continue };
        let place = |at: Option<f64>| {
            at.and_then(|at| case.values.iter().position(|v| (v - at).abs() <= at.abs() * 1e-6))
                .unwrap_or(case.values.len())
        };
        let before = recorded(limits, outcome, case);
        let now = place(outcome.breaks_at);
        match before {
            _ if !outcome.passed => worse.push(format!("{}: promised not to break", told(outcome))),
            Some(before) if now < place(before) => {
                let before = before.map_or("never".to_owned(), number);
                worse.push(format!("{}, before: {before}", told(outcome)));
            }
            _ => {}
        }
    }
    worse
}

fn told(outcome: &Outcome) -> String {
    format!(
        "{}: {} ({}) breaks at {}",
        outcome.case,
        outcome.backend,
        outcome.method.unwrap_or("plain"),
        breaks(outcome)
    )
}

/// Reads where an outcome broke before: nothing when it does not stand there, `Some(None)` for never.
fn recorded(limits: &str, outcome: &Outcome, case: &Case) -> Option<Option<f64>> {
    let (_, section) = limits.split_once(&format!("\n## {}: ", outcome.case))?;
    let section = section.split("\n## ").next()?;
    let line = section.lines().find(|line| {
        let mut cells = line.split('|').map(str::trim).skip(1);
        cells.next() == Some(outcome.backend.as_str())
            && cells.next() == Some(outcome.method.unwrap_or("plain"))
    })?;
    let cell = line.split('|').nth(3)?.trim();
    if cell == "never" {
        return Some(None);
    }
    // What was written is the value as `number` writes it, perhaps with a failure behind.
    let value = cell.split(" (").next()?;
    Some(case.values.iter().copied().find(|v| number(*v) == value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::cases;

    fn outcome(breaks_at: Option<f64>) -> Outcome {
        Outcome {
            case: "coplanar",
            backend: "raster".to_owned(),
            method: None,
            parameter: "separation, m",
            values: vec![0.1, 0.01],
            error: vec![0.0, 0.5],
            ms: vec![1.0, 1.0],
            breaks_at,
            limit: 0.01,
            passed: true,
            failure: None,
            is_cut_short: false,
            pictures: Vec::new(),
        }
    }

    #[test]
    fn what_breaks_earlier_than_written_is_told() {
        let cases = cases();
        let written = limits(&cases, &[outcome(Some(1e-7))]);
        assert!(written.contains("| raster | plain | 10⁻⁷ |"), "{written}");
        assert!(check(&cases, &[outcome(Some(1e-7))], &written).is_empty());
        assert!(check(&cases, &[outcome(Some(1e-8))], &written).is_empty(), "later is better");
        assert!(check(&cases, &[outcome(None)], &written).is_empty());
        let worse = check(&cases, &[outcome(Some(1e-3))], &written);
        assert_eq!(worse, ["coplanar: raster (plain) breaks at 0.001, before: 10⁻⁷"]);
        let never = limits(&cases, &[outcome(None)]);
        assert_eq!(check(&cases, &[outcome(Some(1e-9))], &never).len(), 1);
    }
}
