//! A store is finished or absent: it is written in a working directory beside its target and renamed at the end.
//!
//! `.NAME.brickcast-tmp-PID-N/` holds `lock` (held while its writer lives), `store/` (being written), scratch files and, for the moment
//! of replacing one, `old/`. A working directory whose lock is free was left by a writer that was killed: the next
//! writer for the same target puts `old/` back where the target is gone, and removes the rest.

use std::ffi::OsString;
use std::fs::{self, File, TryLockError};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::error::StoreError;
use super::manifest::Manifest;
use super::manifest_file;
use super::profile::MANIFEST_FILE;
use crate::leftovers::Listed;
use crate::small_file::open_regular;

#[derive(Debug)]
pub(super) struct WorkDir {
    target: PathBuf,
    parent: PathBuf,
    dir: PathBuf,
    force: bool,
    /// Kept open, and so locked, as long as the directory is ours.
    lock: Option<File>,
    /// Set where the directory holds something that must not be removed.
    keep: bool,
    /// A signal that ends the process removes the directory.
    listed: Option<Listed>,
}

impl WorkDir {
    /// Checks the target, and makes an empty directory for the store beside it.
    pub(super) fn create(target: &Path, force: bool) -> Result<Self, StoreError> {
        let unusable = |why| StoreError::Target { path: target.to_path_buf(), why };
        let name = target.file_name().ok_or_else(|| unusable("it has no last component"))?;
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        if !parent.is_dir() {
            return Err(unusable("the directory that it would be in does not exist; create it first"));
        }
        let mut prefix = OsString::from(".");
        prefix.push(name);
        prefix.push(".brickcast-tmp-");
        recover(target, &parent, &prefix);
        check_replaceable(target, force)?;
        for n in 0..10_000u32 {
            let mut dir_name = prefix.clone();
            dir_name.push(format!("{}-{n}", std::process::id()));
            let dir = parent.join(dir_name);
            let listed = match Listed::making(&dir, || fs::create_dir(&dir)) {
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => continue,
                made => Some(made.map_err(StoreError::io("create", &dir))?.1),
            };
            let mut work = Self { target: target.to_path_buf(), parent, dir, force, lock: None, keep: false, listed };
            let lock_path = work.dir.join("lock");
            let lock = File::create(&lock_path).map_err(StoreError::io("create", &lock_path))?;
            // File systems without locks: the directory is then never taken for a dead one either.
            let _ = lock.try_lock();
            work.lock = Some(lock);
            fs::create_dir(work.store()).map_err(StoreError::io("create", &work.store()))?;
            return Ok(work);
        }
        Err(unusable("ten thousand working directories of killed writers lie beside it; remove them"))
    }

    /// Where the store's files are written until it is published.
    pub(super) fn store(&self) -> PathBuf {
        self.dir.join("store")
    }

    /// Where files are that live no longer than the work.
    pub(super) fn scratch(&self) -> PathBuf {
        self.dir.clone()
    }

    /// Makes the finished store appear at its target, in place of an old one where that was allowed.
    pub(super) fn publish(mut self) -> Result<(), StoreError> {
        sync_directories(&self.store())?;
        // A signal in the middle would take the old store with the directory.
        match self.listed.take() {
            Some(listed) => listed.settle(|| self.put_in_place())?,
            None => self.put_in_place()?,
        }
        sync_directory(&self.parent)
    }

    fn put_in_place(&mut self) -> Result<(), StoreError> {
        let staged = self.store();
        if check_replaceable(&self.target, self.force)? {
            let old = self.dir.join("old");
            fs::rename(&self.target, &old).map_err(StoreError::io("move away", &self.target))?;
            if let Err(source) = fs::rename(&staged, &self.target) {
                if fs::rename(&old, &self.target).is_err() {
                    self.keep = true;
                    return Err(StoreError::Stranded { target: self.target.clone(), old, source });
                }
                return Err(StoreError::io("put the finished store at", &self.target)(source));
            }
        } else {
            fs::rename(&staged, &self.target).map_err(StoreError::io("put the finished store at", &self.target))?;
        }
        Ok(())
    }
}

impl Drop for WorkDir {
    fn drop(&mut self) {
        if !self.keep {
            // What cannot be removed now is removed by the next writer.
            drop(self.lock.take());
            // An old store that was replaced takes a while: a signal goes on with it.
            let list = || Listed::making(&self.dir, || Ok::<_, io::Error>(())).ok().map(|made| made.1);
            let _listed = self.listed.take().or_else(list);
            let _ = fs::remove_dir_all(&self.dir);
        }
    }
}

/// True where there is a store of ours at `target` that may be replaced, false where there is nothing.
fn check_replaceable(target: &Path, force: bool) -> Result<bool, StoreError> {
    let not_ours = |why| Err(StoreError::NotOurs { path: target.to_path_buf(), why });
    let metadata = match fs::symlink_metadata(target) {
        Ok(metadata) => metadata,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(false),
        Err(e) => return Err(StoreError::io("look at", target)(e)),
    };
    if !force {
        return Err(StoreError::Exists { path: target.to_path_buf() });
    }
    if metadata.is_symlink() {
        return not_ours("it is a symbolic link; name the store itself");
    }
    if !metadata.is_dir() {
        return not_ours("it is no directory");
    }
    let mut bytes = Vec::new();
    // Whatever is called so may be anything.
    let read = open_regular(&target.join(MANIFEST_FILE))
        .ok()
        .map(|file| file.take(Manifest::MAX_BYTES + 1).read_to_end(&mut bytes));
    match read {
        Some(Ok(_)) if manifest_file::is_ours(&bytes) => Ok(true),
        _ => not_ours("it has no manifest of one"),
    }
}

/// Puts back and removes what killed writers for `target` left. Failures are left to the next writer.
fn recover(target: &Path, parent: &Path, prefix: &OsString) {
    let Ok(entries) = fs::read_dir(parent) else { return };
    let prefix = prefix.as_encoded_bytes();
    for entry in entries.flatten().filter(|e| e.file_name().as_encoded_bytes().starts_with(prefix)) {
        let dir = entry.path();
        // Without a lock file its writer is just starting.
        let Ok(lock) = File::options().write(true).open(dir.join("lock")) else { continue };
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock | TryLockError::Error(_)) => continue,
        }
        let old = dir.join("old");
        if old.is_dir() && fs::symlink_metadata(target).is_err() && fs::rename(&old, target).is_err() {
            continue;
        }
        let _ = fs::remove_dir_all(&dir);
    }
}

/// Brings a directory's entries to the disk.
fn sync_directory(path: &Path) -> Result<(), StoreError> {
    if cfg!(unix) {
        #[expect(clippy::disallowed_methods, reason = "a folder, to bring its entries to the disk")]
        let synced = File::open(path).and_then(|dir| dir.sync_all());
        synced.map_err(StoreError::io("sync", path))?;
    }
    Ok(())
}

/// [`sync_directory`] for `root` and every directory below; at most five levels, as a store has.
fn sync_directories(root: &Path) -> Result<(), StoreError> {
    let mut open = vec![root.to_path_buf()];
    while let Some(dir) = open.pop() {
        for entry in fs::read_dir(&dir).map_err(StoreError::io("list", &dir))? {
            let entry = entry.map_err(StoreError::io("list", &dir))?;
            if entry.file_type().map_err(StoreError::io("look at", &entry.path()))?.is_dir() {
                open.push(entry.path());
            }
        }
        sync_directory(&dir)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const OURS: &str = r#"{ "format": "brickcast-store", "version": 1 }"#;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn an_abandoned_writer_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let work = WorkDir::create(&dir.path().join("s"), false).unwrap();
        fs::write(work.store().join("x"), b"half").unwrap();
        assert_eq!(names(dir.path()).len(), 1);
        drop(work);
        assert!(names(dir.path()).is_empty());
    }

    #[test]
    fn a_killed_writer_is_cleaned_up_and_its_old_store_put_back() {
        let dir = tempfile::tempdir().unwrap();
        let dead = dir.path().join(".s.brickcast-tmp-1-0");
        fs::create_dir_all(dead.join("old")).unwrap();
        fs::write(dead.join("old").join(MANIFEST_FILE), OURS).unwrap();
        fs::write(dead.join("lock"), b"").unwrap();
        let target = dir.path().join("s");
        assert!(matches!(WorkDir::create(&target, false), Err(StoreError::Exists { .. })));
        assert_eq!(names(dir.path()), ["s"]);
        assert_eq!(fs::read_to_string(target.join(MANIFEST_FILE)).unwrap(), OURS);
    }

    #[test]
    fn a_living_writer_is_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s");
        let first = WorkDir::create(&target, false).unwrap();
        let second = WorkDir::create(&target, false).unwrap();
        assert!(first.store().is_dir() && second.store().is_dir());
        first.publish().unwrap();
        assert!(matches!(second.publish(), Err(StoreError::Exists { .. })));
        assert_eq!(names(dir.path()), ["s"]);
    }

    #[test]
    fn force_replaces_only_stores() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s");
        fs::create_dir(&target).unwrap();
        fs::write(target.join("thesis.tex"), b"years of work").unwrap();
        assert!(matches!(WorkDir::create(&target, false), Err(StoreError::Exists { .. })));
        assert!(matches!(WorkDir::create(&target, true), Err(StoreError::NotOurs { .. })));
        fs::write(target.join(MANIFEST_FILE), OURS).unwrap();
        let work = WorkDir::create(&target, true).unwrap();
        assert_eq!(names(&target), [MANIFEST_FILE, "thesis.tex"], "the old store stays until the end");
        fs::write(work.store().join("new"), b"").unwrap();
        work.publish().unwrap();
        assert_eq!(names(&target), ["new"]);
        assert_eq!(names(dir.path()), ["s"]);
    }

    #[test]
    fn targets_without_name_or_parent_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        for bad in [dir.path().join(".."), dir.path().join("a/b"), PathBuf::from("/")] {
            assert!(matches!(WorkDir::create(&bad, true), Err(StoreError::Target { .. })), "{bad:?}");
        }
    }
}
