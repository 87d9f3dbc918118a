//! Documents that must exist, links that must resolve, messages that must be described.

use std::path::Path;

use super::law::Check;
use crate::tree::{SourceFile, Tree};

pub(super) const CHECK: Check = Check {
    name: "documents",
    law: "the documents exist, their relative links resolve, docs/protocol.md names every message",
    remedy: "write the missing document or section, or mend the link",
    run: |tree| Ok(run(tree)),
};

const REQUIRED: [&str; 9] = [
    "README.md",
    "ARCHITECTURE.md",
    "GLOSSARY.md",
    "CHANGELOG.md",
    "LICENSE-MIT",
    "LICENSE-APACHE",
    PROTOCOL,
    "docs/store-format.md",
    "docs/adr/0001-sort-last.md",
];
const PROTOCOL: &str = "docs/protocol.md";

fn run(tree: &Tree) -> Vec<String> {
    let missing = REQUIRED.iter().filter(|path| tree.file(path).is_none()).map(|path| format!("{path} is missing"));
    let broken = tree.with_extension("md").flat_map(|file| broken_links(tree, file));
    missing.chain(broken).chain(undescribed(tree)).collect()
}

fn broken_links(tree: &Tree, file: &SourceFile) -> Vec<String> {
    let folder = file.path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut problems = Vec::new();
    for (line, target) in links(&file.text) {
        let path = target.split('#').next().unwrap_or_default();
        if target.contains("://") || target.starts_with("mailto:") || path.is_empty() {
            continue;
        }
        let resolved = resolve(folder, path);
        let exists = resolved.as_deref().is_some_and(|r| {
            let inside = |p: &String| p == r || p.strip_prefix(r).is_some_and(|rest| rest.starts_with('/'));
            r.is_empty() || tree.paths.iter().any(inside)
        });
        if !exists {
            problems.push(format!("{}:{line}: the link to {target} leads nowhere", file.path));
        }
    }
    problems
}

/// `(line, target)` of `[text](target)` and `![text](target)`, outside of code.
fn links(text: &str) -> Vec<(usize, String)> {
    let mut links = Vec::new();
    let mut in_code = false;
    for (number, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") || line.trim_start().starts_with("~~~") {
            in_code = !in_code;
            continue;
        }
        if in_code {
            continue;
        }
        // Every second piece between backticks is code.
        let prose = line.split('`').step_by(2).collect::<Vec<_>>().join("");
        for (at, _) in prose.match_indices("](") {
            let rest = &prose[at + 2..];
            let Some(end) = rest.find(')') else { continue };
            // A title may follow the target.
            let target = rest[..end].split_whitespace().next().unwrap_or_default();
            links.push((number + 1, target.trim_matches(['<', '>']).to_owned()));
        }
    }
    links
}

/// `folder/path` without `.` and `..`; `None` where it leaves the repository.
fn resolve(folder: &str, path: &str) -> Option<String> {
    let mut parts: Vec<&str> = if path.starts_with('/') { Vec::new() } else { folder.split('/').collect() };
    for part in Path::new(path).components() {
        match part {
            std::path::Component::ParentDir => {
                parts.pop().filter(|p| !p.is_empty())?;
            }
            std::path::Component::Normal(name) => parts.push(name.to_str()?),
            _ => {}
        }
    }
    parts.retain(|p| !p.is_empty());
    Some(parts.join("/"))
}

/// Messages of the contract that the protocol's document does not name.
fn undescribed(tree: &Tree) -> Vec<String> {
    let Some(document) = tree.file(PROTOCOL) else { return Vec::new() };
    let known: Vec<_> = document.text.split(|c: char| !(c == '_' || c.is_alphanumeric())).collect();
    let mut problems = Vec::new();
    for file in tree.with_extension("proto") {
        let messages = file.text.lines().filter_map(|line| line.trim().strip_prefix("message "));
        for name in messages.filter_map(|rest| rest.split([' ', '{']).next()) {
            if !known.contains(&name) {
                problems.push(format!("{PROTOCOL} does not name the message {name} of {}", file.path));
            }
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complete() -> Vec<(&'static str, &'static str)> {
        REQUIRED.iter().map(|path| (*path, "words")).collect()
    }

    #[test]
    fn missing_documents_are_named() {
        assert_eq!(run(&Tree::of(&complete())), [""; 0]);
        for i in 0..REQUIRED.len() {
            let mut files = complete();
            let (gone, _) = files.remove(i);
            assert_eq!(run(&Tree::of(&files)), [format!("{gone} is missing")]);
        }
    }

    #[test]
    fn links_resolve_from_the_document_they_stand_in() {
        let broken = |path, text| {
            let mut files = complete();
            files.push((path, text));
            run(&Tree::of(&files)).len()
        };
        for good in [
            "[a](../README.md)",
            "[a](adr/0001-sort-last.md#why \"title\")",
            "[folder](adr) and ![x](<../docs/adr/>)",
            "[web](https://example.org/x) [here](#part)",
            "`[code](nowhere.md)`\n```\n[code](nowhere.md)\n```",
        ] {
            assert_eq!(broken("docs/a.md", good), 0, "{good}");
        }
        for bad in ["[a](README.md)", "![p](../picture.png)", "[out](../../x.md)", "[a](adr/0001) [b](../README.md)"] {
            assert_eq!(broken("docs/a.md", bad), 1, "{bad}");
        }
    }

    #[test]
    fn every_message_must_be_described() {
        let mut files = complete();
        files.push(("proto/a.proto", "message Tile {\n}\nmessage Receipt{}\n// message Old {\n"));
        files[6].1 = "A `Tile` and the Receipts.";
        assert_eq!(files[6].0, PROTOCOL);
        let found = run(&Tree::of(&files));
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains("Receipt"));
    }
}
