//! Patterns and lists: many files by one name.

use std::path::{Path, PathBuf};

use brickcast_volume::format::FormatError;

use crate::input::Input;
use crate::wrong::Wrong;

/// A list may name a million files.
const LONGEST_LIST: u64 = 64 << 20;

/// A file of that very name is no pattern.
pub(crate) fn is_pattern(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.contains(['*', '?', '[']) && !path.exists()
}

/// Does `name` fit? `*` is any text, `?` one character, `[a-c]` one of them.
pub(crate) fn fits(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    let (mut p, mut n, mut back) = (0, 0, None);
    while n < name.len() {
        match one(&pattern[p..], name[n]) {
            Some(0) => {
                back = Some((p, n));
                p += 1;
            }
            Some(length) => (p, n) = (p + length, n + 1),
            None => {
                // The last star takes one character more.
                let Some((star, from)) = back else { return false };
                back = Some((star, from + 1));
                (p, n) = (star + 1, from + 1);
            }
        }
    }
    pattern[p..].iter().all(|c| *c == '*')
}

/// How much of the pattern takes the character; 0 for a star.
fn one(pattern: &[char], c: char) -> Option<usize> {
    match *pattern.first()? {
        '*' => Some(0),
        '?' => Some(1),
        '[' => match pattern.iter().skip(2).position(|c| *c == ']') {
            Some(end) => {
                let set = &pattern[1..end + 2];
                let in_range = set.windows(3).any(|w| w[1] == '-' && (w[0]..=w[2]).contains(&c));
                (in_range || (c != '-' && set.contains(&c))).then_some(end + 3)
            }
            None => (c == '[').then_some(1),
        },
        own => (own == c).then_some(1),
    }
}

/// The files that a list names, one a line, relative to it; lines with `#` and empty ones aside. Nothing where the file
/// is no such list: its name must end so.
pub(crate) fn list(input: &Input) -> Result<Option<Vec<PathBuf>>, FormatError> {
    let extension = input.path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !["txt", "lst", "list"].contains(&extension.as_str()) {
        return Ok(None);
    }
    let wrong = |problem: String, remedy| Wrong::new("names", problem, remedy).of(&input.path, "list of slices");
    let text = String::from_utf8(input.head(LONGEST_LIST)?)
        .map_err(|_| wrong("it is no UTF-8 text".into(), "write one file name a line"))?;
    let folder = input.path.parent().unwrap_or(Path::new(""));
    let mut files = Vec::new();
    for (number, line) in (1..).zip(text.lines().map(str::trim)) {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let file = folder.join(line);
        if !file.is_file() {
            let shown = brickcast_volume::format::excerpt(line);
            return Err(wrong(
                format!("line {number}, `{shown}`: no such file"),
                "name one slice a line, from the first to the last",
            ));
        }
        files.push(file);
    }
    match files.is_empty() {
        true => Err(wrong("no file is named".into(), "name one slice a line")),
        false => Ok(Some(files)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_fit_as_a_shell_has_them() {
        for (pattern, name, want) in [
            ("scan_*.tif", "scan_12.tif", true),
            ("scan_*.tif", "scan_.tif", true),
            ("scan_*.tif", "scan_12.tiff", false),
            ("s??.png", "s12.png", true),
            ("s??.png", "s1.png", false),
            ("s[0-4]*", "s3x", true),
            ("s[0-4]*", "s5x", false),
            ("s[-a]", "s-", false),
            ("*a*b*", "xaxxbxab", true),
            ("[", "[", true),
            ("*", "", true),
            ("", "x", false),
        ] {
            assert_eq!(fits(pattern, name), want, "{pattern} {name}");
        }
        // Stars do not multiply.
        assert!(!fits(&"*a".repeat(50), &"a".repeat(49)));
        assert!(!fits(&"a*".repeat(25), &"b".repeat(4000)));
    }
}
