//! Why a file was refused, in one line that says what is wrong, where, and what to do.

use std::borrow::Cow;
use std::path::Path;

/// Why a file was not loaded. Each message is one line: `FILE: what is wrong and where: what to do`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file is missing, not a regular file, or may not be read.
    #[error("{file}: {what}: {advice}")]
    Unreadable {
        /// The file as it was named.
        file: String,
        /// What is wrong and where.
        what: String,
        /// What to do.
        advice: String,
    },
    /// The file's bytes contradict its format.
    #[error("{file}: {what}: {advice}")]
    Malformed {
        /// The file as it was named.
        file: String,
        /// What is wrong and where.
        what: String,
        /// What to do.
        advice: String,
    },
    /// The file is right, but needs something that is not read here.
    #[error("{file}: {what}: {advice}")]
    Unsupported {
        /// The file as it was named.
        file: String,
        /// What is wrong and where.
        what: String,
        /// What to do.
        advice: String,
    },
    /// The file would need more than [`super::Limits`] allow.
    #[error("{file}: {what}: {advice}")]
    OverLimit {
        /// The file as it was named.
        file: String,
        /// What is wrong and where.
        what: String,
        /// What to do.
        advice: String,
    },
}

/// A [`LoadError`] that does not know its file yet: what readers of bytes return.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    kind: FaultKind,
    what: String,
    advice: Cow<'static, str>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FaultKind {
    Unreadable,
    Malformed,
    Unsupported,
    OverLimit,
}

impl Fault {
    pub(crate) fn unreadable(what: impl Into<String>, advice: impl Into<Cow<'static, str>>) -> Self {
        Self { kind: FaultKind::Unreadable, what: what.into(), advice: advice.into() }
    }

    pub(crate) fn malformed(what: impl Into<String>) -> Self {
        let advice = Cow::Borrowed("the file is damaged, export it again");
        Self { kind: FaultKind::Malformed, what: what.into(), advice }
    }

    pub(crate) fn unsupported(what: impl Into<String>, advice: impl Into<Cow<'static, str>>) -> Self {
        Self { kind: FaultKind::Unsupported, what: what.into(), advice: advice.into() }
    }

    /// `limit` is the name of the field of [`super::Limits`] that is exceeded.
    pub(crate) fn over(what: impl Into<String>, limit: &str) -> Self {
        let advice = Cow::Owned(format!("use a smaller file, or raise `Limits::{limit}`"));
        Self { kind: FaultKind::OverLimit, what: what.into(), advice }
    }

    pub(crate) fn advise(mut self, advice: impl Into<Cow<'static, str>>) -> Self {
        self.advice = advice.into();
        self
    }

    /// Says where the fault is, in front of what is wrong.
    pub(crate) fn at(mut self, place: impl std::fmt::Display) -> Self {
        self.what = format!("{place}: {}", self.what);
        self
    }

    /// Returns the message without the file and the advice, for notes.
    pub(crate) fn what(&self) -> String {
        one_line(&self.what)
    }

    /// Names the file.
    pub(crate) fn in_file(self, path: &Path) -> LoadError {
        let file = one_line(&path.to_string_lossy());
        let (what, advice) = (one_line(&self.what), one_line(&self.advice));
        match self.kind {
            FaultKind::Unreadable => LoadError::Unreadable { file, what, advice },
            FaultKind::Malformed => LoadError::Malformed { file, what, advice },
            FaultKind::Unsupported => LoadError::Unsupported { file, what, advice },
            FaultKind::OverLimit => LoadError::OverLimit { file, what, advice },
        }
    }
}

/// Longest part of a message; a name from a file may be a hundred kilobytes long.
const LONGEST: usize = 240;

/// Makes text from a file safe to print: one line, no control or direction-changing characters, not endless.
pub(crate) fn one_line(text: &str) -> String {
    let unsafe_char = |c: char| {
        c.is_control()
            || matches!(c, '\u{2028}' | '\u{2029}' | '\u{200e}' | '\u{200f}')
            || ('\u{202a}'..='\u{202e}').contains(&c)
            || ('\u{2066}'..='\u{2069}').contains(&c)
    };
    let mut line: String =
        text.trim().chars().take(LONGEST).map(|c| if unsafe_char(c) { ' ' } else { c }).collect();
    if text.trim().chars().nth(LONGEST).is_some() {
        line.push('…');
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_one_line_with_file_place_and_advice() {
        let error = Fault::malformed("index 0\nis illegal").at("line 7").in_file(Path::new("a\nb.obj"));
        let text = error.to_string();
        assert_eq!(text, "a b.obj: line 7: index 0 is illegal: the file is damaged, export it again");
    }

    #[test]
    fn wild_names_are_tamed() {
        let name = format!("{}\u{202e}\0", "x".repeat(1000));
        assert!(one_line(&name).chars().count() <= LONGEST + 1);
        assert_eq!(one_line("a\u{202e}b\0c"), "a b c");
    }
}
