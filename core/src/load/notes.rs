//! What a loader repaired, replaced or left out: a bounded list of lines without repetition.

use super::error::one_line;
use std::collections::BTreeSet;

/// Most lines kept; a damaged file could give one for every face.
const MOST: usize = 40;

/// Lines for [`crate::scene::Scene::notes`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes {
    lines: Vec<String>,
    seen: BTreeSet<String>,
    dropped: usize,
}

impl Notes {
    /// Adds a line, unless it was said before.
    pub(crate) fn add(&mut self, line: impl AsRef<str>) {
        let line = one_line(line.as_ref());
        if self.seen.contains(&line) {
            return;
        }
        if self.lines.len() >= MOST {
            self.dropped += 1;
            return;
        }
        self.seen.insert(line.clone());
        self.lines.push(line);
    }

    /// Returns the lines, with one more that counts what was not kept.
    pub(crate) fn into_lines(mut self) -> Vec<String> {
        if self.dropped > 0 {
            self.lines.push(format!("and {} more notes", self.dropped));
        }
        self.lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_are_said_once_and_not_without_end() {
        let mut notes = Notes::default();
        for i in 0..1000 {
            notes.add(format!("note {}", i / 2));
        }
        let lines = notes.into_lines();
        assert_eq!(lines.len(), MOST + 1);
        assert_eq!((lines[1].as_str(), lines[MOST].as_str()), ("note 1", "and 920 more notes"));
    }
}
