//! How is a plugin's text read, and kept where names must live for ever?

#![expect(unsafe_code, reason = "the border to plugins")]

use std::collections::BTreeSet;
use std::ffi::c_char;
use std::sync::{Mutex, PoisonError};

/// Longest text that is taken from a plugin, bytes.
const LONGEST: usize = 4096;
/// Most names that are kept; a plugin that makes new ones for ever gets `...`.
const MOST_NAMES: usize = 65_536;

/// Reads a plugin's text as one line; null is empty.
///
/// # Safety
/// The text ends with a zero byte, or is longer than is read.
pub(crate) unsafe fn words(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    let mut bytes = Vec::new();
    while bytes.len() < LONGEST {
        // SAFETY: no zero byte was met so far, so the text goes on.
        let byte = unsafe { text.add(bytes.len()).read() } as u8;
        if byte == 0 {
            break;
        }
        bytes.push(byte);
    }
    let text = String::from_utf8_lossy(&bytes);
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// Keeps a name for ever; the same name once.
pub(crate) fn keep(name: &str) -> &'static str {
    static NAMES: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = names.get(name) {
        return known;
    }
    if names.len() >= MOST_NAMES {
        return "...";
    }
    let kept: &'static str = name.to_owned().leak();
    names.insert(kept);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_one_line_and_names_are_kept_once() {
        // SAFETY: ends with a zero byte.
        assert_eq!(unsafe { words(c"a\nb".as_ptr()) }, "a b");
        // SAFETY: null is allowed.
        assert_eq!(unsafe { words(std::ptr::null()) }, "");
        assert!(std::ptr::eq(keep("rays"), keep(&String::from("rays"))));
    }
}
