//! What was guessed, mapped, counted or left aside on the way from an input: it belongs to the volume, so stores carry
//! it. Texts come from foreign files and nodes, and go to terminals.

use super::checks::{MAX_TEXT, field};
use crate::store::error::ManifestError;

/// The most notes that a manifest holds.
pub const MAX_NOTES: usize = 32;
/// The longest note, bytes.
pub const MAX_NOTE_BYTES: usize = 600;

/// As a manifest holds them: each once, harmless, and no more than it may.
pub(crate) fn kept(notes: impl IntoIterator<Item = String>) -> Vec<String> {
    let mut kept: Vec<String> = Vec::new();
    let mut more = 0usize;
    for note in notes.into_iter().map(|note| harmless(&note)).filter(|note| !note.is_empty()) {
        if kept.contains(&note) {
            continue;
        }
        // The last place is for the number of those that found none.
        if kept.len() + 1 < MAX_NOTES {
            kept.push(note);
        } else {
            more += 1;
        }
    }
    if more > 0 {
        kept.push(format!("{more} more notes were left out"));
    }
    kept
}

/// Without characters that a terminal obeys or hides, cut to the longest that a note may be.
fn harmless(text: &str) -> String {
    const MORE: &str = "...";
    let (mut shown, mut whole) = (String::new(), 0);
    for c in text.chars() {
        let escaped: String = match c {
            '"' | '\'' | '\\' => c.into(),
            c => c.escape_debug().collect(),
        };
        if shown.len() + escaped.len() > MAX_NOTE_BYTES {
            shown.truncate(whole);
            return shown + MORE;
        }
        shown.push_str(&escaped);
        if shown.len() + MORE.len() <= MAX_NOTE_BYTES {
            whole = shown.len();
        }
    }
    shown
}

/// Those of a manifest that was read.
pub(crate) fn checked(notes: Vec<String>) -> Result<Vec<String>, ManifestError> {
    if notes.len() > MAX_NOTES {
        return Err(field("notes", format!("{} notes, at most {MAX_NOTES} are allowed", notes.len())));
    }
    for note in &notes {
        if note.len() > MAX_NOTE_BYTES {
            return Err(field("notes", format!("{} bytes, at most {MAX_NOTE_BYTES} are allowed", note.len())));
        }
        if harmless(note) != *note {
            return Err(field("notes", "control characters are not allowed"));
        }
    }
    Ok(notes)
}

/// The last component of a path of either kind: manifests carry no directories of the machine that made them.
pub(crate) fn bare_name(path: &str) -> String {
    shortened(path.rsplit(['/', '\\']).next().unwrap_or(path))
}

/// Cut at a character to what a manifest may hold.
pub(crate) fn shortened(text: &str) -> String {
    text.chars()
        .scan(0, |bytes, c| {
            *bytes += c.len_utf8();
            (*bytes <= MAX_TEXT).then_some(c)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_are_harmless_few_and_short_and_what_is_kept_is_accepted() {
        let foreign = "a\x1b[31m\nb\u{202e}c \"µm\" 'x' C:\\y";
        let kept_notes = kept([foreign.to_owned(), "twice".to_owned(), "twice".to_owned(), "é".repeat(1000)]);
        assert_eq!(kept_notes.len(), 3);
        assert_eq!(kept_notes[0], "a\\u{1b}[31m\\nb\\u{202e}c \"µm\" 'x' C:\\y");
        assert!(kept_notes[2].len() <= MAX_NOTE_BYTES && kept_notes[2].ends_with("é..."), "{}", kept_notes[2]);
        assert_eq!(checked(kept_notes.clone()), Ok(kept_notes));

        let many = kept((0..100).map(|i| i.to_string()));
        assert_eq!((many.len(), many[MAX_NOTES - 1].as_str()), (MAX_NOTES, "69 more notes were left out"));
        for bad in [vec!["\x1b".to_owned()], vec!["x".repeat(MAX_NOTE_BYTES + 1)], vec![String::new(); MAX_NOTES + 1]] {
            assert!(checked(bad).is_err());
        }
    }
}
