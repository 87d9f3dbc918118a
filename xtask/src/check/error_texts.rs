//! The page of error texts quotes what programs say, not what they once said.

use super::law::Check;
use crate::source::strings;
use crate::tree::{SourceFile, Tree};

pub(super) const CHECK: Check = Check {
    name: "error texts",
    law: "every text quoted in the tables of docs/guide/troubleshooting.md stands in the source, in one string",
    remedy: "quote the text as the source has it now, with … for what is filled in, or drop the row",
    run: |tree| Ok(run(tree)),
};

const PAGE: &str = "docs/guide/troubleshooting.md";
/// Stands for what is filled in.
const GAP: char = '…';
/// Fixed characters of a quote: fewer would be found anywhere.
const MIN_FIXED: usize = 8;

fn run(tree: &Tree) -> Vec<String> {
    let Some(page) = tree.file(PAGE) else { return vec![format!("{PAGE} is missing")] };
    let said: Vec<String> = tree.with_extension("rs").filter(|f| is_program(f)).flat_map(program_strings).collect();
    let (quotes, mut problems) = quotes(&page.text);
    if quotes.is_empty() {
        problems.push(format!("{PAGE} quotes nothing"));
    }
    for (line, quote) in quotes {
        let pieces: Vec<&str> = quote.split(GAP).map(str::trim).filter(|p| !p.is_empty()).collect();
        if pieces.iter().map(|p| p.len()).sum::<usize>() < MIN_FIXED {
            problems.push(format!("{PAGE}:{line}: `{quote}` is too short to be found"));
        } else if !said.iter().any(|text| holds(text, &pieces)) {
            problems.push(format!("{PAGE}:{line}: no string of the source holds `{quote}`"));
        }
    }
    problems
}

/// What may speak to users: the crates of programs, without their tests.
fn is_program(file: &SourceFile) -> bool {
    let in_crate =
        ["volume/src/", "remote/src/", "zarr/src/", "formats/src/", "proto/src/", "node/src/", "compositor/src/"];
    let in_crate = in_crate.iter().any(|c| file.path.starts_with(c));
    in_crate && !file.path.contains("/tests/") && !matches!(file.name(), "tests.rs" | "property.rs" | "testing.rs")
}

fn program_strings(file: &SourceFile) -> Vec<String> {
    let program = file.text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    strings(program)
}

/// True where `text` holds all pieces, one after the other.
fn holds(text: &str, pieces: &[&str]) -> bool {
    let mut rest = text;
    pieces.iter().all(|piece| match rest.find(piece) {
        Some(at) => {
            rest = &rest[at + piece.len()..];
            true
        }
        None => false,
    })
}

/// `(line, quote)` of the code in the first cells of table rows, separated by `<br>`; and rows that quote nothing.
fn quotes(text: &str) -> (Vec<(usize, &str)>, Vec<String>) {
    let (mut quotes, mut problems) = (Vec::new(), Vec::new());
    let mut in_table = false;
    for (number, line) in text.lines().enumerate().map(|(i, l)| (i + 1, l)) {
        let Some(row) = line.strip_prefix('|') else {
            in_table = false;
            continue;
        };
        if row.trim_start().starts_with("---") {
            in_table = true;
        } else if in_table {
            for cell in row.split('|').next().unwrap_or_default().split("<br>").map(str::trim) {
                match unquoted(cell) {
                    Some(quote) => quotes.push((number, quote)),
                    None => problems.push(format!("{PAGE}:{number}: `{cell}` is no quote: put it between backticks")),
                }
            }
        }
    }
    (quotes, problems)
}

/// What stands between one or two backticks on either side; blanks at the ends keep backticks apart and are no part of
/// it.
fn unquoted(cell: &str) -> Option<&str> {
    let marks = cell.len() - cell.trim_start_matches('`').len();
    let inner = cell.get(marks..cell.len().checked_sub(marks)?)?;
    let closed =
        marks > 0 && cell.ends_with(&"`".repeat(marks)) && !inner.is_empty() && !inner.contains(&"`".repeat(marks));
    closed.then(|| inner.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str = r#"
// no comment counts: "commented out text"
#[error("node {address}: cannot be reached ({reason}); \
         is it running?")]
Unreachable { .. }
#[error("`{0}` is no size: \"say\" one")]
#[cfg(test)]
mod tests {
    const ONLY: &str = "only said by tests";
}
"#;

    fn found(rows: &str, source: &str) -> Vec<String> {
        let page = format!("words | words\n\n| text | what |\n| --- | --- |\n{rows}\n");
        run(&Tree::of(&[(PAGE, &page), ("node/src/error.rs", source)]))
    }

    #[test]
    fn quotes_are_found_across_gaps_and_broken_lines() {
        for good in [
            "| `node …: cannot be reached (…); is it running?` | x |",
            "| `cannot be reached` | `nowhere at all` |",
            "| ``…` is no size: \"say\" one`` | x |",
            "| `cannot be reached`<br>`is it running?` | x |",
        ] {
            assert_eq!(found(good, SOURCE), [""; 0], "{good}");
        }
    }

    #[test]
    fn texts_that_nobody_says_are_named_with_their_line() {
        for bad in [
            "| `cannot be reached at all` | x |",
            "| `is it running? … cannot be reached` | x |",
            "| `cannot be reached`<br>`is it sleeping?` | x |",
            "| `only said by tests` | x |",
            "| `commented out text` | x |",
            "| `node …` | x |",
            "| cannot be reached | x |",
        ] {
            let problems = found(bad, SOURCE);
            assert!(
                matches!(&problems[..], [one] if one.contains(":5: ")) || problems.len() == 2,
                "{bad}: {problems:?}"
            );
        }
        // Once the source says it otherwise, the page is wrong.
        assert_eq!(found("| `cannot be reached` | x |", &SOURCE.replace("reached", "found")).len(), 1);
    }

    #[test]
    fn a_page_that_is_missing_or_quotes_nothing_is_a_problem() {
        assert_eq!(run(&Tree::of(&[])).len(), 1);
        assert_eq!(found("", SOURCE).len(), 1);
    }
}
