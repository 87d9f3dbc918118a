//! Lines that an editor, a diff and a review show whole. rustfmt wraps neither comments nor strings.

use super::law::Check;
use crate::source::raw_strings;
use crate::tree::{SourceFile, Tree};

pub(super) const CHECK: Check = Check {
    name: "line-width",
    law: "no line of .rs, .wgsl, .proto and .toml is wider than 120 characters, no prose in .md than 130",
    remedy: "wrap the comment or paragraph, end a string's line with a backslash, take an argument to a line of its \
             own",
    run: |tree| Ok(run(tree)),
};

const CODE: usize = 120;
const PROSE: usize = 130;

fn run(tree: &Tree) -> Vec<String> {
    let too_wide = |file: &SourceFile| {
        let wide = match file.name().rsplit_once('.').map(|(_, extension)| extension) {
            Some("rs") => wide_rust(&file.text),
            Some("wgsl" | "proto" | "toml") => wide_lines(&file.text, CODE),
            Some("md") => wide_prose(&file.text),
            _ => Vec::new(),
        };
        let path = file.path.clone();
        wide.into_iter().map(move |(line, width)| format!("{path}:{line}: {width} characters"))
    };
    tree.files.iter().flat_map(too_wide).collect()
}

/// `(line, width)` of every line wider than `most`.
fn wide_lines(text: &str, most: usize) -> Vec<(usize, usize)> {
    let widths = text.lines().map(|line| line.chars().count());
    (1..).zip(widths).filter(|(_, width)| *width > most).collect()
}

/// But for raw strings, which cannot be broken without becoming others.
fn wide_rust(text: &str) -> Vec<(usize, usize)> {
    let wide = wide_lines(text, CODE);
    if wide.is_empty() {
        return wide;
    }
    let raw = raw_strings(text);
    let starts: Vec<usize> = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
    let is_raw = |line: usize| {
        let start = starts[line - 1];
        // What closes behind a raw string stands in no line of its own: `"#,` or `"#);`.
        let over = text[start..].char_indices().nth(CODE - 2).map_or(start, |(at, _)| start + at);
        raw.iter().any(|literal| literal.contains(&over))
    };
    wide.into_iter().filter(|(line, _)| !is_raw(*line)).collect()
}

/// But for tables, code blocks, and lines that are one link, picture or address.
fn wide_prose(text: &str) -> Vec<(usize, usize)> {
    let mut in_code = false;
    let mut wide = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let content = line.trim();
        if content.starts_with("```") || content.starts_with("~~~") {
            in_code = !in_code;
            continue;
        }
        let width = line.chars().count();
        if width > PROSE && !in_code && !content.starts_with('|') && !is_one_piece(content) {
            wide.push((number, width));
        }
    }
    wide
}

/// Nothing of it could go to another line.
fn is_one_piece(content: &str) -> bool {
    let content = content.trim_start_matches(['-', '*', ' ']).trim_end_matches(['.', ':', ';', ',']);
    let is_link = (content.starts_with('[') || content.starts_with("!["))
        && content.ends_with(')')
        && content.matches("](").count() == 1;
    is_link || !content.contains(char::is_whitespace)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(path: &str, text: &str) -> Vec<String> {
        run(&Tree::of(&[(path, text)]))
    }

    #[test]
    fn wide_lines_are_named_with_their_width() {
        for (path, most) in [("a.rs", CODE), ("a.wgsl", CODE), ("a.proto", CODE), ("a.toml", CODE), ("a.md", PROSE)] {
            let line = |width: usize| format!("// é {}", "x".repeat(width - 5));
            assert_eq!(found(path, &format!("{}\n", line(most))), [""; 0], "{path}");
            let text = format!("\n{}\n{}\n", line(most + 1), line(most));
            assert_eq!(found(path, &text), [format!("{path}:2: {} characters", most + 1)]);
        }
        assert_eq!(found("a.json", &"x ".repeat(200)), [""; 0]);
    }

    #[test]
    fn raw_strings_may_be_wide_and_others_not() {
        let words = "words ".repeat(30);
        for (text, count) in [
            (format!("let x = r#\"{words}\"#;"), 0),
            (format!("let x = r\"\n{words}\n\";"), 0),
            (format!("    r#\"{}\"#,", "x".repeat(110)), 0),
            (format!("let x = \"{words}\";"), 1),
            (format!("let x = r\"y\"; // {words}"), 1),
            (format!("// r\"{words}\""), 1),
            (format!("let x = [r\"y\", {}];", "1, ".repeat(50)), 1),
        ] {
            assert_eq!(found("a.rs", &text).len(), count, "{text}");
        }
    }

    #[test]
    fn tables_code_and_what_is_one_piece_may_be_wide_in_prose() {
        let (words, word) = ("words ".repeat(30), "x".repeat(140));
        for text in [
            format!("| {words} |"),
            format!("```\n{words}\n```"),
            format!("- [{words}](https://example.org/{word})."),
            format!("![{words}](images/x.png)"),
            format!("<https://example.org/{word}>"),
        ] {
            assert_eq!(found("a.md", &text), [""; 0], "{text}");
        }
        for text in [format!("- {words}"), format!("# {words}"), format!("[a](b.md) {words} [c](d.md)")] {
            assert_eq!(found("a.md", &text).len(), 1, "{text}");
        }
    }
}
