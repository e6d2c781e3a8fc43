//! Walks through text files as they are, not as they should be: byte-order marks, any line end, continued lines,
//! names in Latin-1, numbers with tails.

use super::error::Fault;
use std::borrow::Cow;

/// A cursor over the words of a text, line by line; nothing is copied.
///
/// Lines end with LF, CR or CR LF. A backslash at the end continues a line. Zero bytes count as spaces.
pub(crate) struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    /// The line break that ends the current line has been passed.
    fresh: bool,
}

impl<'a> Words<'a> {
    /// Begins before the first line; refuses UTF-16.
    pub(crate) fn new(bytes: &'a [u8]) -> Result<Self, Fault> {
        let zeros = bytes.iter().take(64).filter(|&&b| b == 0).count();
        if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) || zeros > 16 {
            return Err(Fault::unsupported("the text is UTF-16 or no text at all", "save it as UTF-8"));
        }
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        Ok(Self { bytes, at: 0, line: 0, fresh: true })
    }

    /// Goes to the next line; false at the end of the text.
    pub(crate) fn next_line(&mut self) -> bool {
        if !self.fresh {
            while self.at < self.bytes.len() && !matches!(self.bytes[self.at], b'\n' | b'\r') {
                self.at += 1;
            }
            self.pass_line_break();
        }
        self.line += 1;
        self.fresh = false;
        self.at < self.bytes.len()
    }

    fn pass_line_break(&mut self) {
        if self.bytes[self.at..].starts_with(b"\r\n") {
            self.at += 2;
        } else if self.at < self.bytes.len() {
            self.at += 1;
        }
    }

    /// Returns the number of the current line, from 1.
    pub(crate) fn line(&self) -> usize {
        self.line
    }

    /// Returns the number of bytes that are left.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Returns the next word of this line or a later one; nothing at the end of the text.
    pub(crate) fn next_word(&mut self) -> Option<&'a [u8]> {
        loop {
            if let Some(word) = self.word() {
                return Some(word);
            }
            if !self.next_line() {
                return None;
            }
        }
    }

    /// Returns the next word of the line; nothing at its end or at a comment.
    pub(crate) fn word(&mut self) -> Option<&'a [u8]> {
        self.pass_spaces();
        let start = self.at;
        if self.bytes.get(start) == Some(&b'#') {
            return None;
        }
        while self.at < self.bytes.len() {
            let byte = self.bytes[self.at];
            let ends = matches!(byte, b' ' | b'\t' | b'\n' | b'\r' | 0 | 0x0b | 0x0c);
            if ends || (byte == b'\\' && self.continuation().is_some()) {
                break;
            }
            self.at += 1;
        }
        (self.at > start).then(|| &self.bytes[start..self.at])
    }

    /// Returns what is left of the line without spaces around it.
    pub(crate) fn rest(&mut self) -> &'a [u8] {
        self.pass_spaces();
        let start = self.at;
        while self.at < self.bytes.len() && !matches!(self.bytes[self.at], b'\n' | b'\r') {
            self.at += 1;
        }
        self.bytes[start..self.at].trim_ascii()
    }

    fn pass_spaces(&mut self) {
        while let Some(&byte) = self.bytes.get(self.at) {
            match byte {
                b' ' | b'\t' | 0 | 0x0b | 0x0c => self.at += 1,
                b'\\' => match self.continuation() {
                    Some(next) => {
                        self.at = next;
                        self.line += 1;
                    }
                    None => break,
                },
                _ => break,
            }
        }
    }

    /// Returns where the next line begins if the backslash under the cursor continues this one.
    fn continuation(&self) -> Option<usize> {
        let after = &self.bytes[self.at + 1..];
        if after.starts_with(b"\r\n") {
            Some(self.at + 3)
        } else if matches!(after.first(), Some(b'\n' | b'\r')) {
            Some(self.at + 2)
        } else {
            None
        }
    }
}

/// Reads text that should be UTF-8 and may be Latin-1.
pub(crate) fn decode_text(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|&b| char::from(b)).collect()),
    }
}

/// Reads a number; with a tail that belongs to no number (`3.1+e2`), the number in front of it, and false.
pub(crate) fn parse_number(word: &[u8]) -> Option<(f64, bool)> {
    let text = std::str::from_utf8(word).ok();
    if let Some(number) = text.and_then(|t| t.parse::<f64>().ok()) {
        return Some((number, true));
    }
    let digits = |from: usize| word[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut end = usize::from(matches!(word.first(), Some(b'+' | b'-')));
    let whole = digits(end);
    end += whole;
    let mut part = 0;
    if word.get(end) == Some(&b'.') {
        part = digits(end + 1);
        end += 1 + part;
    }
    if whole + part == 0 {
        return None;
    }
    if matches!(word.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(word.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits(end + 1 + sign);
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    let number = std::str::from_utf8(&word[..end]).ok()?.parse().ok()?;
    Some((number, false))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &[u8]) -> Vec<(usize, Vec<String>)> {
        let mut words = Words::new(text).unwrap();
        let mut all = Vec::new();
        while words.next_line() {
            let line = words.line();
            let mut list = Vec::new();
            while let Some(word) = words.word() {
                list.push(decode_text(word).into_owned());
            }
            if !list.is_empty() {
                all.push((line, list));
            }
        }
        all
    }

    #[test]
    fn every_line_end_and_continuation_is_understood() {
        let text = b"\xef\xbb\xbfv 1 2\r\n\rf 1 \\\n 2\\\r\n3 # no\nlast";
        let words = |list: &[&str]| list.iter().map(|w| (*w).to_owned()).collect::<Vec<_>>();
        assert_eq!(
            lines(text),
            [(1, words(&["v", "1", "2"])), (3, words(&["f", "1", "2", "3"])), (6, words(&["last"]))]
        );
        assert!(Words::new(b"\xff\xfev\0").is_err());
        assert_eq!(lines(b"a\\b \xe9")[0].1, ["a\\b", "é"]);
    }

    #[test]
    fn numbers_are_read_as_far_as_they_go() {
        for (word, value) in
            [("3.1+e2", 3.1), ("1,5", 1.0), ("-.5x", -0.5), ("2.e1k", 20.0), ("1e", 1.0), ("7.", 7.0)]
        {
            assert_eq!(parse_number(word.as_bytes()).unwrap().0, value, "{word}");
        }
        assert_eq!(parse_number("+1e2".as_bytes()), Some((100.0, true)));
        for word in ["", "-", "x1", ".", "-.e5", "\u{661}"] {
            assert_eq!(parse_number(word.as_bytes()), None, "{word}");
        }
        assert!(parse_number(b"nan").unwrap().0.is_nan());
    }
}
