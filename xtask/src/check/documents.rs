//! Documents that must exist, links that must resolve, messages that must be described.

use std::path::Path;

use super::law::Check;
use crate::source::comments_only;
use crate::tree::{SourceFile, Tree};

pub(super) const CHECK: Check = Check {
    name: "documents",
    law: "the documents exist, and all that links, prose and comments name; docs/reference/protocol.md names every \
          message",
    remedy: "write the missing document or section, or mend its name; comments name documents from the repository's \
             root",
    run: |tree| Ok(run(tree)),
};

const REQUIRED: [&str; 13] = [
    "README.md",
    "ARCHITECTURE.md",
    "GLOSSARY.md",
    "CHANGELOG.md",
    "LICENSE-MIT",
    "LICENSE-APACHE",
    PROTOCOL,
    "docs/README.md",
    "docs/definition.md",
    "docs/algorithms.md",
    "docs/map.md",
    "docs/reference/store-format.md",
    "docs/adr/0001-sort-last.md",
];
const PROTOCOL: &str = "docs/reference/protocol.md";

fn run(tree: &Tree) -> Vec<String> {
    let missing = REQUIRED.iter().filter(|path| tree.file(path).is_none()).map(|path| format!("{path} is missing"));
    let broken = tree.with_extension("md").flat_map(|file| broken_links(tree, file));
    let unknown = tree.files.iter().flat_map(|file| unknown_documents(tree, file));
    missing.chain(broken).chain(unknown).chain(undescribed(tree)).collect()
}

/// Names of documents that are not there, in prose and in comments. Links are [`broken_links`]' business.
fn unknown_documents(tree: &Tree, file: &SourceFile) -> Vec<String> {
    let is_document = file.name().ends_with(".md");
    let Some(text) = prose(file) else { return Vec::new() };
    let folder = if is_document { folder_of(file) } else { "" };
    let mut problems = Vec::new();
    for (line, name) in named_documents(&text) {
        let at = |folder: &str| resolve(folder, &name).is_some_and(|path| tree.file(&path).is_some());
        if !at("") && !at(folder) {
            problems.push(format!("{}:{line}: there is no document {name}", file.path));
        }
    }
    problems
}

/// What a file says to its readers: all of a document, the comments of a source; nothing of other files.
fn prose(file: &SourceFile) -> Option<String> {
    let extension = file.name().rsplit_once('.').map_or("", |(_, e)| e);
    match extension {
        "md" => Some(file.text.clone()),
        "rs" | "wgsl" | "proto" => Some(comments_only(&file.text)),
        "toml" | "sh" | "yml" | "py" => Some(behind_hashes(&file.text)),
        _ if file.name().starts_with("Dockerfile") => Some(behind_hashes(&file.text)),
        _ => None,
    }
}

/// The comments of languages in which `#` starts one; each on its line.
fn behind_hashes(text: &str) -> String {
    let comment = |line: &str| {
        let start =
            line.match_indices('#').find(|(at, _)| line[..*at].chars().next_back().is_none_or(char::is_whitespace));
        start.map_or_else(String::new, |(at, _)| line[at..].to_owned())
    };
    text.lines().map(comment).collect::<Vec<_>>().join("\n")
}

/// `(line, path)` of every path that ends as documents do; of links, whose targets are checked, and addresses of the
/// web none.
fn named_documents(text: &str) -> Vec<(usize, String)> {
    let in_path = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.' | '/');
    let mut found = Vec::new();
    for (number, line) in text.lines().enumerate() {
        for (at, _) in line.match_indices(".md") {
            let end = at + ".md".len();
            let start =
                line[..at].rfind(|c| !in_path(c)).map_or(0, |p| p + line[p..].chars().next().map_or(1, char::len_utf8));
            let (before, name) = (&line[..start], &line[start..end]);
            let goes_on =
                line[end..].chars().next().is_some_and(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'));
            let is_link = line[end..].starts_with("](") || ["](", "](<", ":"].iter().any(|sign| before.ends_with(sign));
            if start < at && !goes_on && !is_link {
                found.push((number + 1, name.to_owned()));
            }
        }
    }
    found
}

fn folder_of(file: &SourceFile) -> &str {
    file.path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

fn broken_links(tree: &Tree, file: &SourceFile) -> Vec<String> {
    let folder = folder_of(file);
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
        for bad in ["[a](LICENSE.md)", "![p](../picture.png)", "[out](../../x.md)", "[a](adr/0001) [b](../README.md)"] {
            assert_eq!(broken("docs/a.md", bad), 1, "{bad}");
        }
    }

    #[test]
    fn documents_that_prose_and_comments_name_must_be_there() {
        let found = |path: &'static str, text: &'static str| {
            let mut files = complete();
            files.push((path, text));
            run(&Tree::of(&files))
        };
        for (path, text) in [
            ("a.rs", "// docs/definition.md, Camera 3; see (`README.md`).\nlet x = \"nowhere.md\"; // ok"),
            ("a.wgsl", "/* docs/adr/0001-sort-last.md */"),
            ("a.proto", "// https://example.org/nowhere.md and *.md, a.mdx, x.md-y"),
            ("a.toml", "x = \"nowhere.md\" # README.md"),
            ("a.sh", "cat nowhere.md\n# docs/README.md"),
            (
                "docs/adr/x.md",
                "See ../definition.md, `docs/algorithms.md`, 0001-sort-last.md, [definition.md](../definition.md).",
            ),
            ("a.json", "nowhere.md"),
        ] {
            assert_eq!(found(path, text), [""; 0], "{path}: {text}");
        }
        for (path, text) in [
            ("a.rs", "\n/// nowhere.md, section 1"),
            ("node/a.rs", "\n//! The laws (architecture.md, law 3)."),
            ("docs/a.rs", "\n// definition.md: comments name documents from the root"),
            ("a.wgsl", "\n/* docs/nowhere.md */"),
            ("a.proto", "\nmessage Tile {} // docs/adr/0001.md"),
            ("a.toml", "\n# (conventions.md)"),
            ("a.sh", "\nls # docs/nowhere.md"),
            ("Dockerfile", "\n# nowhere.md"),
            ("docs/a.md", "\nThe goal of nowhere.md, or `docs/adr/nowhere.md`?"),
        ] {
            let problems: Vec<_> =
                found(path, text).into_iter().filter(|p| p.contains("there is no document")).collect();
            assert!(!problems.is_empty() && problems[0].starts_with(&format!("{path}:2: ")), "{text}: {problems:?}");
        }
    }

    #[test]
    fn every_message_must_be_described() {
        let mut files = complete();
        files.push(("proto/a.proto", "message Tile {\n}\nmessage Receipt{}\n// message Old {\n"));
        files.iter_mut().filter(|f| f.0 == PROTOCOL).for_each(|f| f.1 = "A `Tile` and the Receipts.");
        let found = run(&Tree::of(&files));
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains("Receipt"));
    }
}
