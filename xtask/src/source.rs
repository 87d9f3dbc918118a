//! Rust source without what is not code: enough of a lexer to find names.

/// `text` with comments, string and character literals blanked out; line breaks stay, so lines keep their numbers.
pub(crate) fn code_only(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut out = bytes.to_vec();
    let mut i = 0;
    while i < bytes.len() {
        let end = match literal_end(bytes, i) {
            Some(end) => end,
            None => {
                i = word_end(bytes, i);
                continue;
            }
        };
        for byte in &mut out[i..end] {
            if *byte != b'\n' {
                *byte = b' ';
            }
        }
        i = end;
    }
    // Only whole characters were blanked, byte by byte.
    String::from_utf8_lossy(&out).into_owned()
}

/// `text` with all but its comments blanked out; line breaks stay, so lines keep their numbers.
pub(crate) fn comments_only(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut out: Vec<u8> = bytes.iter().map(|&b| if b == b'\n' { b } else { b' ' }).collect();
    let mut i = 0;
    while i < bytes.len() {
        match literal_end(bytes, i) {
            Some(end) => {
                if matches!(bytes[i..], [b'/', b'/' | b'*', ..]) {
                    out[i..end].copy_from_slice(&bytes[i..end]);
                }
                i = end;
            }
            None => i = word_end(bytes, i),
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

/// Where the raw string literals of `text` lie.
pub(crate) fn raw_strings(text: &str) -> Vec<std::ops::Range<usize>> {
    let bytes = text.as_bytes();
    let (mut found, mut i) = (Vec::new(), 0);
    while i < bytes.len() {
        match literal_end(bytes, i) {
            Some(end) => {
                if matches!(bytes[i..], [b'r', ..] | [b'b' | b'c', b'r', ..]) {
                    found.push(i..end);
                }
                i = end;
            }
            None => i = word_end(bytes, i),
        }
    }
    found
}

/// The string literals of `text`, without those in comments: escapes of quotes and of line breaks are resolved, others
/// are not.
pub(crate) fn strings(text: &str) -> Vec<String> {
    let bytes = text.as_bytes();
    let (mut found, mut i) = (Vec::new(), 0);
    while i < bytes.len() {
        match literal_end(bytes, i) {
            Some(end) => {
                if let Some(inner) = text.get(i..end).and_then(|t| t.strip_prefix('"')?.strip_suffix('"')) {
                    // A backslash at the end of a line swallows the next line's indentation.
                    let mut lines = inner.split("\\\n");
                    let mut whole = lines.next().unwrap_or_default().to_owned();
                    lines.for_each(|line| whole.push_str(line.trim_start()));
                    found.push(whole.replace("\\\"", "\""));
                }
                i = end;
            }
            None => i = word_end(bytes, i),
        }
    }
    found
}

/// Behind what stands at `i`: a whole word at once, so that the r of `for` does not open a raw string.
fn word_end(bytes: &[u8], mut i: usize) -> usize {
    i += 1;
    while is_word(bytes[i - 1]) && bytes.get(i).copied().is_some_and(is_word) {
        i += 1;
    }
    i
}

fn is_word(byte: u8) -> bool {
    byte == b'_' || byte.is_ascii_alphanumeric() || byte >= 0x80
}

/// Where the comment or literal that starts at `i` ends; `None` where none starts.
fn literal_end(bytes: &[u8], i: usize) -> Option<usize> {
    let rest = &bytes[i..];
    let find = |needle: &[u8], from: usize| {
        rest.get(from..)?.windows(needle.len()).position(|w| w == needle).map(|p| i + from + p + needle.len())
    };
    match rest {
        [b'/', b'/', ..] => Some(rest.iter().position(|b| *b == b'\n').map_or(bytes.len(), |p| i + p)),
        [b'/', b'*', ..] => Some(block_comment_end(bytes, i)),
        [b'"', ..] => Some(quoted_end(bytes, i + 1)),
        [b'b' | b'c', b'"', ..] => Some(quoted_end(bytes, i + 2)),
        [b'r', b'"' | b'#', ..] | [b'b' | b'c', b'r', b'"' | b'#', ..] => {
            let hashes_at = if rest[0] == b'r' { 1 } else { 2 };
            let hashes = rest[hashes_at..].iter().take_while(|b| **b == b'#').count();
            if rest.get(hashes_at + hashes) != Some(&b'"') {
                return None; // a raw identifier, r#type
            }
            let close = [b"\"".to_vec(), vec![b'#'; hashes]].concat();
            Some(find(&close, hashes_at + hashes + 1).unwrap_or(bytes.len()))
        }
        // 'x' and '\n' but not the lifetime 'x.
        [b'\'', b'\\', ..] => Some(find(b"'", 3).unwrap_or(bytes.len())),
        [b'\'', first, ..] => {
            let width = match first {
                0..0x80 => 1,
                0x80..0xe0 => 2,
                0xe0..0xf0 => 3,
                _ => 4,
            };
            (rest.get(1 + width) == Some(&b'\'')).then_some(i + width + 2)
        }
        _ => None,
    }
}

fn block_comment_end(bytes: &[u8], start: usize) -> usize {
    let (mut depth, mut i) = (0_u32, start);
    while i < bytes.len() {
        match &bytes[i..] {
            [b'/', b'*', ..] => (depth, i) = (depth + 1, i + 2),
            [b'*', b'/', ..] => {
                (depth, i) = (depth - 1, i + 2);
                if depth == 0 {
                    return i;
                }
            }
            _ => i += 1,
        }
    }
    i
}

fn quoted_end(bytes: &[u8], mut i: usize) -> usize {
    while i < bytes.len() {
        match bytes[i] {
            b'\\' => i += 2,
            b'"' => return i + 1,
            _ => i += 1,
        }
    }
    bytes.len()
}

/// `(line, word, text before it on the line, text behind it)` of every word of code.
pub(crate) fn words(code: &str) -> impl Iterator<Item = (usize, &str, &str, &str)> {
    code.lines().enumerate().flat_map(|(number, line)| {
        let inside = |c: char| c == '_' || c.is_alphanumeric();
        let mut at = 0;
        std::iter::from_fn(move || {
            let start = at + line[at..].find(inside)?;
            let end = line[start..].find(|c| !inside(c)).map_or(line.len(), |p| start + p);
            at = end;
            Some((number + 1, &line[start..end], &line[..start], &line[end..]))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> Vec<(usize, String)> {
        words(&code_only(text)).map(|(line, word, ..)| (line, word.to_owned())).collect()
    }

    #[test]
    fn comments_and_literals_are_no_code() {
        let text = "a // wgpu\n/* wgpu /* nested */ wgpu */ b \"wgpu \\\" wgpu\" c r#\"wgpu \" wgpu\"# d b\"wgpu\" 'w' \
                    '\\'' e";
        let names: Vec<_> = found(text).into_iter().map(|(_, w)| w).collect();
        assert_eq!(names, ["a", "b", "c", "d", "e"]);
    }

    #[test]
    fn code_around_lifetimes_and_raw_names_survives() {
        let text = "fn f<'a>(x: &'a str) -> r#type { for_each(\"é\"); 'é'; wgpu::x }\nlet r = br\"//\"; wire";
        let names: Vec<_> = found(text).into_iter().map(|(_, w)| w).collect();
        assert!(names.contains(&"wgpu".to_owned()) && names.contains(&"wire".to_owned()), "{names:?}");
        assert!(names.contains(&"for_each".to_owned()) && names.contains(&"type".to_owned()), "{names:?}");
    }

    #[test]
    fn comments_are_what_is_left() {
        let text = "a // é one\n\"// no\" /* two\nlines */ b r#\"/* no */\"# '/' // end";
        let left = comments_only(text);
        assert_eq!(left.lines().count(), text.lines().count());
        assert_eq!(left.split_whitespace().collect::<Vec<_>>().join(" "), "// é one /* two lines */ // end");
    }

    #[test]
    fn raw_strings_are_found_whole() {
        let text = "x r\"a\" // r\"no\"\n\"r\" br##\"b\"#\"## for r#type";
        let found: Vec<_> = raw_strings(text).into_iter().map(|range| &text[range]).collect();
        assert_eq!(found, ["r\"a\"", "br##\"b\"#\"##"]);
    }

    #[test]
    fn strings_are_whole_and_comments_are_none() {
        let text = "// \"no\"\nf(\"a \\\n    b \\\"c\\\"\", 'x', r\"raw\"); /* \"no\" */ g(\"\")";
        assert_eq!(strings(text), ["a b \"c\"", ""]);
    }

    #[test]
    fn lines_keep_their_numbers_and_open_ends_do_not_hang() {
        assert_eq!(found("/*\n\n*/ x\n\"\n\" y"), [(3, "x".to_owned()), (5, "y".to_owned())]);
        for open in ["/* a", "\"a", "r#\"a", "'\\", "'", "a//", "\"\\"] {
            code_only(open);
        }
    }
}
