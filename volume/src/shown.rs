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

/// As [`shown`], within JSON that has escaped what it must: of the rest, what [`is_unsafe`] names.
fn shown_json(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unsafe) {
        return text.into();
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_unsafe(c) {
            c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| out.push_str(&format!("\\u{unit:04x}")));
        } else {
            out.push(c);
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

/// Without the links that libraries put into their words, and what leads to them: they are for whoever writes programs
/// with the library, and lead whoever runs one to the wrong door. JSON stays JSON.
#[must_use]
pub fn without_links(text: &str) -> Cow<'_, str> {
    let link = |text: &str| text.find("https://").into_iter().chain(text.find("http://")).min();
    if link(text).is_none() {
        return text.into();
    }
    let (mut out, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(at) = link(rest) {
        out.push_str(&rest[..at]);
        let link = &rest[at..];
        let end = link.find(|c: char| c.is_whitespace() || "\"'`()<>[]{}\\,;".contains(c)).unwrap_or(link.len());
        rest = &link[link[..end].trim_end_matches(['.', ':']).len()..];
        out.truncate(without_leading(&out).len());
        if let (Some(before), Some(behind)) = (out.strip_suffix('('), rest.strip_prefix(')')) {
            out.truncate(before.trim_end().len());
            rest = behind;
        } else if !rest.starts_with(' ') {
            out.truncate(out.trim_end_matches([' ', ',', ';', ':']).len());
        }
    }
    out.push_str(rest);
    out.into()
}

/// Without the words that stand before a link and say nothing without it.
fn without_leading(text: &str) -> &str {
    const LEADING: [&str; 6] = ["see", "at", "to", "visit", "also", "here"];
    let kept = text.trim_end();
    let start = kept.rfind([' ', '(']).map_or(0, |at| at + 1);
    let word = kept[start..].trim_end_matches(':').to_lowercase();
    if LEADING.contains(&word.as_str()) { without_leading(&kept[..start]) } else { kept }
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
    form: Form,
}

#[derive(Debug)]
enum Form {
    /// With `colours`, the log layer colours its entries: it escapes what could be taken for that in the texts
    /// themselves.
    Text {
        colours: bool,
    },
    Json,
}

impl<W: Write> ShownLog<W> {
    pub fn new(inner: W, colours: bool) -> Self {
        Self { inner, form: Form::Text { colours } }
    }

    /// Of entries that are JSON, and stay JSON.
    pub fn json(inner: W) -> Self {
        Self { inner, form: Form::Json }
    }
}

impl<W: Write> Write for ShownLog<W> {
    fn write(&mut self, entry: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(entry);
        let (line, end) = match text.strip_suffix('\n') {
            Some(line) => (line, "\n"),
            None => (&*text, ""),
        };
        let line = &*without_links(line);
        let line = match self.form {
            Form::Text { colours } => escaped(line, |c| c == '\x1b' && colours),
            Form::Json => shown_json(line),
        };
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

    #[test]
    fn links_of_libraries_are_left_out() {
        for (text, want) in [
            ("nothing to leave out", "nothing to leave out"),
            ("Please report it to https://github.com/gfx-rs/wgpu", "Please report it"),
            ("no driver (see https://example.org/x), so none", "no driver, so none"),
            ("it failed; see http://a.b/c. It ends", "it failed. It ends"),
            ("see also: https://a.b/c and http://d.e, both", " and, both"),
            ("{\"m\":\"broken, see https://a.b/c\",\"n\":1}", "{\"m\":\"broken\",\"n\":1}"),
        ] {
            assert_eq!(without_links(text), want);
        }
        let mut out = Vec::new();
        ShownLog::new(&mut out, false).write_all(b"ERROR wgpu: broken, see https://a.b/c\n").unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), "ERROR wgpu: broken\n");
    }

    #[test]
    fn an_entry_in_json_stays_json_that_says_the_same() {
        let said = "a\nb\u{202e}c\u{e0041}\u{1b}[2J";
        let mut out = Vec::new();
        ShownLog::json(&mut out).write_all(format!("{}\n", serde_json::json!({ "m": said })).as_bytes()).unwrap();
        let line = String::from_utf8(out).unwrap();
        assert!(line.ends_with("}\n") && !line.trim_end().contains(is_unsafe), "{line}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&line).unwrap()["m"], said);
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
