//! What writers of stores leave in a folder when they are killed, and what becomes of it.
//!
//! A working directory whose lock is free has no writer any more. An old store in it goes back to its place where that
//! is empty; what a store has and scratch files go, and nothing else does.

use std::ffi::OsString;
use std::fs;
use std::path::Path;

use super::lock::dead;
use super::shape::StoreShape;
use super::walk as store_walk;
use crate::unfinished::is_settled;

/// Between a target's name and a writer's number in the name of a working directory.
pub(super) const MARK: &str = ".brickcast-tmp-";

/// An old store that was replaced, while it is removed.
pub(super) const GONE: &str = "gone";

/// Removes a working directory: what a store has, scratch files, and nothing else.
pub(super) fn clear(dir: &Path) {
    let of = |name| (name, StoreShape::in_folder(&dir.join(name)));
    for (name, shape) in [("store", Some(StoreShape::any())), of("old"), of(GONE)] {
        let part = dir.join(name);
        // A store that is removed in part has lost its manifest, perhaps.
        let shape = shape.unwrap_or_else(StoreShape::any);
        if part.is_dir() && !part.is_symlink() {
            let _ = store_walk::remove(&part, &shape);
        }
    }
    clear_scratch(dir);
    // The lock stays with what could not be removed, so that the next writer looks at it again.
    let only_lock = fs::read_dir(dir).is_ok_and(|entries| entries.flatten().all(|e| e.file_name() == "lock"));
    if only_lock {
        let _ = fs::remove_file(dir.join("lock"));
        let _ = fs::remove_dir(dir);
    }
}

/// Removes the scratch files of a working directory.
pub(super) fn clear_scratch(dir: &Path) {
    for entry in fs::read_dir(dir).into_iter().flatten().flatten() {
        if entry.file_type().is_ok_and(|kind| kind.is_file()) && entry.file_name() != "lock" {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Puts back and removes what killed writers for `target` left. Failures are left to the next writer.
pub(super) fn recover(target: &Path, parent: &Path, prefix: &OsString) {
    let prefix = prefix.as_encoded_bytes();
    for dir in entries(parent).filter(|name| name.as_encoded_bytes().starts_with(prefix)).map(|name| parent.join(name))
    {
        let Some(_lock) = dead(&dir) else { continue };
        let old = dir.join("old");
        if old.is_dir() && fs::symlink_metadata(target).is_err() && fs::rename(&old, target).is_err() {
            continue;
        }
        clear(&dir);
    }
}

/// Removes what killed writers for any target in `folder` left, old stores that should be put back first apart. A
/// writer on another machine that shares the folder holds its lock; one that has only just begun here is not taken for
/// dead.
pub fn remove_leftovers(folder: &Path) {
    for name in entries(folder) {
        let Some(process) = process_of(&name) else { continue };
        let dir = folder.join(&name);
        if is_settled(&dir, process)
            && let Some(_lock) = dead(&dir)
            && !dir.join("old").exists()
        {
            clear(&dir);
        }
    }
}

/// The process that a working directory's name speaks of.
fn process_of(name: &OsString) -> Option<u32> {
    let (_, writer) = name.to_str()?.strip_prefix('.')?.rsplit_once(MARK)?;
    let (process, count) = writer.split_once('-')?;
    count.parse::<u32>().ok()?;
    process.parse().ok()
}

fn entries(folder: &Path) -> impl Iterator<Item = OsString> {
    fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.file_name())
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs::File;

    use super::*;

    /// Whatever is written beside it: its target may never be written again.
    #[test]
    fn what_a_killed_writer_of_another_target_left_goes_and_that_of_a_living_one_stays() {
        let dir = tempfile::tempdir().unwrap();
        let mut gone = std::process::Command::new("true").spawn().unwrap();
        gone.wait().unwrap();
        let make = |name: &str| {
            let made = dir.path().join(name);
            fs::create_dir_all(made.join("store/0/c")).unwrap();
            fs::create_dir_all(made.join("store/2/c/0")).unwrap();
            fs::create_dir_all(made.join("store/levels/2/distances")).unwrap();
            fs::write(made.join("store/levels/2/halos.bin"), b"half").unwrap();
            fs::write(made.join("voxels-2"), b"scratch").unwrap();
            fs::write(made.join("lock"), b"").unwrap();
            fs::write(made.join("phantom.nrrd"), b"scratch").unwrap();
            made
        };
        let dead = format!(".other.brickcast-tmp-{}-0", gone.id());
        make(&dead);
        // A writer elsewhere: its number means nothing here, its lock does.
        let elsewhere = format!(".far.brickcast-tmp-{}-1", gone.id());
        let lock = File::options().write(true).open(make(&elsewhere).join("lock")).unwrap();
        lock.try_lock().unwrap();
        // One of this machine that has not got its lock yet.
        let begun = format!(".near.brickcast-tmp-{}-99", std::process::id());
        make(&begun);
        fs::create_dir(dir.path().join(format!(".mine.brickcast-tmp-{}", gone.id()))).unwrap();
        remove_leftovers(dir.path());
        let mut want = [elsewhere, begun, format!(".mine.brickcast-tmp-{}", gone.id())];
        want.sort();
        let mut left: Vec<_> = entries(dir.path()).map(|name| name.into_string().unwrap()).collect();
        left.sort();
        assert_eq!(left, want);
    }
}
