//! The repository's own files, as text.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context as _;

/// A file of the repository: path relative to its root with `/`, and its text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct SourceFile {
    pub(crate) path: String,
    pub(crate) text: String,
}

impl SourceFile {
    #[cfg(test)]
    pub(crate) fn new(path: &str, text: &str) -> Self {
        Self { path: path.to_owned(), text: text.to_owned() }
    }

    /// The name behind the last `/`.
    pub(crate) fn name(&self) -> &str {
        self.path.rsplit('/').next().unwrap_or_default()
    }
}

/// All files that git knows or would add; pictures and other binaries are left out.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tree {
    pub(crate) root: PathBuf,
    pub(crate) files: Vec<SourceFile>,
    /// Paths of all files, binaries included.
    pub(crate) paths: Vec<String>,
}

impl Tree {
    /// The tree that this program was built in.
    pub(crate) fn of_repository() -> anyhow::Result<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask has no folder above it")?.to_owned();
        let mut paths = match listed_by_git(&root) {
            Some(paths) => paths,
            // An unpacked archive has no git folder.
            None => walked(&root)?,
        };
        paths.retain(|path| root.join(path).is_file());
        paths.sort();
        let files = paths
            .iter()
            .filter_map(|path| {
                #[expect(
                    clippy::disallowed_methods,
                    reason = "the repository's own files; this is no part of the product"
                )]
                let text = String::from_utf8(std::fs::read(root.join(path)).ok()?).ok()?;
                Some(SourceFile { path: path.clone(), text })
            })
            .collect();
        Ok(Self { root, files, paths })
    }

    #[cfg(test)]
    pub(crate) fn of(files: &[(&str, &str)]) -> Self {
        let files: Vec<_> = files.iter().map(|(path, text)| SourceFile::new(path, text)).collect();
        Self { root: PathBuf::new(), paths: files.iter().map(|f| f.path.clone()).collect(), files }
    }

    pub(crate) fn file(&self, path: &str) -> Option<&SourceFile> {
        self.files.iter().find(|f| f.path == path)
    }

    pub(crate) fn with_extension<'a>(&'a self, extension: &'a str) -> impl Iterator<Item = &'a SourceFile> {
        self.files.iter().filter(move |f| f.name().rsplit_once('.').is_some_and(|(_, e)| e == extension))
    }
}

fn listed_by_git(root: &Path) -> Option<Vec<String>> {
    let list = ["ls-files", "-z", "--cached", "--others", "--exclude-standard"];
    let output = Command::new("git").current_dir(root).args(list).output().ok()?;
    let paths = String::from_utf8(output.stdout).ok()?;
    let paths: Vec<_> = paths.split('\0').filter(|p| !p.is_empty()).map(str::to_owned).collect();
    (output.status.success() && !paths.is_empty()).then_some(paths)
}

fn walked(root: &Path) -> anyhow::Result<Vec<String>> {
    let mut paths = Vec::new();
    let mut folders = vec![String::new()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root.join(&folder))? {
            let entry = entry?;
            let Ok(name) = entry.file_name().into_string() else { continue };
            let path = if folder.is_empty() { name.clone() } else { format!("{folder}/{name}") };
            match entry.file_type()? {
                kind if kind.is_dir() && name != "target" && name != ".git" => folders.push(path),
                kind if kind.is_file() => paths.push(path),
                _ => {}
            }
        }
    }
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_holds_this_very_file_by_both_ways() {
        let tree = Tree::of_repository().unwrap();
        let own = tree.file("xtask/src/tree.rs").unwrap();
        assert!(own.text.contains("the_tree_holds_this_very_file"));
        assert_eq!(own.name(), "tree.rs");
        assert!(tree.paths.iter().all(|p| !p.starts_with("target/")));
        assert!(walked(&tree.root).unwrap().contains(&"xtask/src/tree.rs".to_owned()));
    }
}
