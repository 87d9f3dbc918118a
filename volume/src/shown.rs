//! Text that others wrote, as people may see it: names of files, errors of nodes, notes of stores.
//!
//! A terminal obeys control characters, and bidirectional ones let a line read as what it does not say. They are
//! escaped where text is printed, not where it comes from: what travels, is compared or is written to files stays as it
//! is.

use std::borrow::Cow;
use std::error::Error;
use std::io::{self, Write};

/// True for what a terminal obeys or hides: control characters, line and paragraph separators, bidirectional and other
/// format characters that take no place.
fn is_unsafe(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

fn escaped(text: &str, keep: impl Fn(char) -> bool) -> Cow<'_, str> {
    let bad = |c: char| is_unsafe(c) && !keep(c);
    if !text.contains(bad) {
        return text.into();
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            '\n' | '\r' | '\t' if bad(c) => out.extend(c.escape_default()),
            c if bad(c) => out.extend(c.escape_unicode()),
            c => out.push(c),
        }
    }
    out.into()
}

/// On one line.
#[must_use]
pub fn shown(text: &str) -> Cow<'_, str> {
    escaped(text, |_| false)
}

/// As [`shown`], of text of our own making that has several lines.
#[must_use]
pub fn shown_lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c == '\n')
}

/// An error with its causes, each told once: some tell their causes themselves.
#[must_use]
pub fn causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let words = cause.to_string();
        if !text.contains(&words) {
            text = format!("{text}: {words}");
        }
        next = cause.source();
    }
    text
}

/// A log whose lines are [`shown`]; each write is one entry, as the log layer makes them.
#[derive(Debug)]
pub struct ShownLog<W> {
    inner: W,
    /// The log layer colours its entries: it escapes what could be taken for that in the texts themselves.
    colours: bool,
}

impl<W: Write> ShownLog<W> {
    pub fn new(inner: W, colours: bool) -> Self {
        Self { inner, colours }
    }
}

impl<W: Write> Write for ShownLog<W> {
    fn write(&mut self, entry: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(entry);
        let (line, end) = match text.strip_suffix('\n') {
            Some(line) => (line, "\n"),
            None => (&*text, ""),
        };
        let line = escaped(line, |c| c == '\x1b' && self.colours);
        self.inner.write_all(line.as_bytes())?;
        self.inner.write_all(end.as_bytes())?;
        Ok(entry.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_and_bidi_characters_are_escaped_and_letters_are_not() {
        for (text, want) in [
            ("Prüfling 3 – ∅ 試料 \"x\\y\"", "Prüfling 3 – ∅ 試料 \"x\\y\""),
            ("\x1b[2Jgone", "\\u{1b}[2Jgone"),
            ("a\u{202e}gnp.b", "a\\u{202e}gnp.b"),
            ("a\nbrickcast: all is well", "a\\nbrickcast: all is well"),
            ("a\rb\tc\u{7f}\u{9b}1m", "a\\rb\\tc\\u{7f}\\u{9b}1m"),
            ("\u{2066}x\u{2069}\u{200f}\u{2028}\u{feff}", "\\u{2066}x\\u{2069}\\u{200f}\\u{2028}\\u{feff}"),
        ] {
            assert_eq!(shown(text), want);
        }
        assert_eq!(shown_lines("a\nb\x07"), "a\nb\\u{7}");
    }

    #[test]
    fn a_log_entry_is_one_line_whatever_a_node_says() {
        let logged = |colours, text: &str| {
            let mut out = Vec::new();
            ShownLog::new(&mut out, colours).write_all(text.as_bytes()).unwrap();
            String::from_utf8(out).unwrap()
        };
        assert_eq!(logged(false, "WARN a\nb\x1b[31m\u{202e}\n"), "WARN a\\nb\\u{1b}[31m\\u{202e}\n");
        assert_eq!(logged(true, "\x1b[33m WARN\x1b[0m a\u{202e}\x07\n"), "\x1b[33m WARN\x1b[0m a\\u{202e}\\u{7}\n");
    }

    #[derive(Debug, thiserror::Error)]
    #[error("{text}")]
    struct Cause {
        text: &'static str,
        source: Option<Box<Cause>>,
    }

    #[test]
    fn what_an_error_says_itself_is_not_said_again() {
        let chain = |texts: &[&'static str]| {
            let inner = texts.iter().rev().fold(None, |source, text| Some(Box::new(Cause { text, source })));
            causes(&*inner.unwrap())
        };
        assert_eq!(chain(&["a.nrrd: no such file", "no such file"]), "a.nrrd: no such file");
        assert_eq!(chain(&["reading", "a.nrrd: gone", "gone"]), "reading: a.nrrd: gone");
        assert_eq!(chain(&["outer", "middle", "inner"]), "outer: middle: inner");
    }
}
