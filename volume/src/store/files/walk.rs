//! What lies in a store's folder: its own files, and others, which are listed and never removed.

use std::fs;
use std::path::{Path, PathBuf};

use super::shape::StoreShape;
use crate::shown::shown;
use crate::store::error::StoreError;
use crate::store::profile::{MANIFEST_FILE, SERIES_FILE};

/// How many of the things that are not the store's are named; the rest is counted.
const NAMED: usize = 10;

/// What lies in a store's folder. Links are not followed.
#[derive(Debug, Default)]
pub(crate) struct Found {
    /// The store's own files, and what all of them take.
    files: Vec<PathBuf>,
    pub(crate) bytes: u64,
    /// The store's own folders, outer ones first.
    folders: Vec<PathBuf>,
    /// What is not the store's, by its path below the folder; of a folder, not what is in it.
    pub(crate) foreign: Vec<String>,
    /// Links where the store has a file or a folder.
    pub(crate) links: Vec<String>,
}

impl Found {
    /// Everything in `root`.
    pub(crate) fn below(root: &Path, shape: &StoreShape) -> Result<Self, StoreError> {
        let mut found = Self::default();
        let mut open = vec![(root.to_path_buf(), String::new())];
        while let Some((folder, within)) = open.pop() {
            for entry in fs::read_dir(&folder).map_err(StoreError::io("list", &folder))? {
                let entry = entry.map_err(StoreError::io("list", &folder))?;
                let (path, name) = (entry.path(), entry.file_name());
                let kind = entry.file_type().map_err(StoreError::io("look at", &path))?;
                let within = match name.to_str() {
                    Some(name) if within.is_empty() => name.to_owned(),
                    Some(name) => format!("{within}/{name}"),
                    None => {
                        found.foreign.push(shown(&format!("{within}/{}", name.to_string_lossy())).into_owned());
                        continue;
                    }
                };
                if kind.is_symlink() && (shape.has_file(&within) || shape.has_folder(&within)) {
                    found.links.push(within);
                } else if kind.is_file() && shape.has_file(&within) {
                    found.bytes += entry.metadata().map_err(StoreError::io("look at", &path))?.len();
                    found.files.push(path);
                } else if kind.is_dir() && shape.has_folder(&within) {
                    found.folders.push(path.clone());
                    open.push((path, within));
                } else {
                    found.foreign.push(shown(&if kind.is_dir() { format!("{within}/") } else { within }).into_owned());
                }
            }
        }
        found.foreign.sort();
        found.links.sort();
        Ok(found)
    }

    /// Nothing where all is the store's own; else what is not, named or counted.
    pub(crate) fn not_ours(&self) -> Option<String> {
        let links = self.links.iter().map(|link| format!("{link} (a link)"));
        let all: Vec<String> = self.foreign.iter().cloned().chain(links).collect();
        let named = all.iter().take(NAMED).cloned().collect::<Vec<_>>().join(", ");
        match all.len() {
            0 => None,
            count if count > NAMED => Some(format!("{named} and {} more", count - NAMED)),
            _ => Some(named),
        }
    }

    /// Removes the store's own files, then its folders and `root`, as far as they are empty then. The manifest goes
    /// last: where this ends half way, what is left is known for a store's.
    fn remove(&self, root: &Path) -> Result<(), StoreError> {
        let manifests = [MANIFEST_FILE, SERIES_FILE].map(|name| root.join(name));
        let (last, first): (Vec<_>, Vec<_>) = self.files.iter().partition(|file| manifests.contains(file));
        for file in first.into_iter().chain(last) {
            fs::remove_file(file).map_err(StoreError::io("remove", file))?;
        }
        for folder in self.folders.iter().rev() {
            fs::remove_dir(folder).map_err(StoreError::io("remove", folder))?;
        }
        fs::remove_dir(root).map_err(StoreError::io("remove", root))
    }
}

/// Removes what a store of this shape has in `root`, and `root`; nothing at all where anything else lies in it.
pub(crate) fn remove(root: &Path, shape: &StoreShape) -> Result<u64, StoreError> {
    let found = Found::below(root, shape)?;
    match found.not_ours() {
        Some(what) => Err(StoreError::Foreign { path: root.to_path_buf(), what }),
        None => found.remove(root).map(|()| found.bytes),
    }
}

/// Removes the store at `path`. What is not its own is never removed: then all of it stays.
///
/// # Errors
/// No store, something in its folder that is not the store's, a disk that refuses.
pub fn remove_store(path: &Path) -> Result<u64, StoreError> {
    match StoreShape::in_folder(path) {
        Some(shape) if !path.is_symlink() => remove(path, &shape),
        _ => Err(StoreError::NotAStore { path: path.to_path_buf() }),
    }
}

/// What the files of the store at `path` take on the disk; 0 where there is none.
#[must_use]
pub fn stored_bytes(path: &Path) -> u64 {
    let shape = StoreShape::in_folder(path).unwrap_or_else(StoreShape::any);
    Found::below(path, &shape).map_or(0, |found| found.bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::profile::LABEL_IMAGE_FILE;

    #[test]
    fn what_is_not_the_stores_is_named_counted_and_kept() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().join("s");
        fs::create_dir_all(root.join("labels/regions/0/c/3/0")).unwrap();
        for file in [MANIFEST_FILE, LABEL_IMAGE_FILE, "labels/regions/0/c/3/0/1"] {
            fs::write(root.join(file), b"12").unwrap();
        }
        fs::write(root.join("labels/a\x1b[31m"), b"").unwrap();
        fs::create_dir_all(root.join("pictures/of/mine")).unwrap();
        for n in 0..9 {
            fs::write(root.join(format!("x{n}")), b"").unwrap();
        }
        let error = remove(&root, &StoreShape::small()).unwrap_err().to_string();
        for word in ["labels/a\\u{1b}[31m, pictures/, x0, x1", "and 1 more", "--force"] {
            assert!(error.contains(word), "{error}");
        }
        assert!(root.join("labels/regions/0/c/3/0/1").is_file() && root.join("pictures/of/mine").is_dir());
        fs::remove_dir_all(root.join("pictures")).unwrap();
        fs::remove_file(root.join("labels/a\x1b[31m")).unwrap();
        (0..9).for_each(|n| fs::remove_file(root.join(format!("x{n}"))).unwrap());
        assert_eq!(remove(&root, &StoreShape::small()).unwrap(), 6);
        assert!(!root.exists());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_neither_followed_nor_removed() {
        let dir = tempfile::tempdir().unwrap();
        let (root, elsewhere) = (dir.path().join("s"), dir.path().join("elsewhere"));
        fs::create_dir_all(elsewhere.join("regions/0/c/0/0")).unwrap();
        fs::write(elsewhere.join("regions/0/c/0/0/0"), b"12").unwrap();
        fs::create_dir(&root).unwrap();
        std::os::unix::fs::symlink(&elsewhere, root.join("labels")).unwrap();
        let error = remove(&root, &StoreShape::small()).unwrap_err().to_string();
        assert!(error.contains("labels (a link)"), "{error}");
        assert!(elsewhere.join("regions/0/c/0/0/0").is_file() && root.join("labels").is_symlink());
    }
}
