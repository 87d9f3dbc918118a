//! The lock of a working directory: held as long as its writer lives, and no longer there than the directory.

//!
//! A directory that has none is of a writer that is just beginning, or was killed before it had one or after it had
//! removed it. Nobody can tell which: such a directory may be removed as long as nothing but a lock that was begun is
//! in it, and a writer that finds its own gone begins again.

use std::fs::{self, File};
use std::io;
use std::path::Path;

const LOCK: &str = "lock";
const BEGUN: &str = "lock-begun";

/// Makes it; nothing where the directory was taken for a dead writer's meanwhile. It gets its name once it is held:
/// whoever finds a free one has found that of a dead writer.
pub(super) fn locked(dir: &Path) -> io::Result<Option<File>> {
    let (begun, path) = (dir.join(BEGUN), dir.join(LOCK));
    let made = File::create_new(&begun).and_then(|lock| match lock.try_lock() {
        // By whoever removes it.
        Err(fs::TryLockError::WouldBlock) => Err(io::ErrorKind::NotFound.into()),
        // Or the file system has no locks: the directory is then never taken for a dead one either.
        _ => fs::rename(&begun, &path).map(|()| lock),
    });
    match made {
        // Not where another writer has taken the name of what was removed.
        Ok(lock) => Ok(is_at(&lock, &path).then_some(lock)),
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::AlreadyExists) => Ok(None),
        Err(error) => Err(error),
    }
}

/// The lock of a working directory whose writer is dead. One without a lock is removed here, if it is empty but for one
/// that was begun and is free.
pub(super) fn dead(dir: &Path) -> Option<File> {
    let lock = free(&dir.join(LOCK));
    if lock.is_none() && !dir.join(LOCK).exists() {
        let begun = dir.join(BEGUN);
        if let Some(_begun) = free(&begun) {
            let _ = fs::remove_file(&begun);
        }
        let _ = fs::remove_dir(dir);
    }
    lock
}

/// The lock at `path`, where nobody holds it; held now.
fn free(path: &Path) -> Option<File> {
    let lock = File::options().write(true).open(path).ok()?;
    lock.try_lock().ok()?;
    // Its writer may have ended in the meantime, and another one have taken the name.
    is_at(&lock, path).then_some(lock)
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let identity = |data: fs::Metadata| (data.dev(), data.ino());
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(file), Ok(there)) => identity(file) == identity(there),
        _ => false,
    }
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::files::workdir::WorkDir;

    /// Killed before it had a lock, while it got it, and after it had removed it.
    #[test]
    fn what_has_no_lock_goes_and_its_writer_begins_again() {
        let dir = tempfile::tempdir().unwrap();
        let names = || std::fs::read_dir(dir.path()).unwrap().flatten().map(|e| e.file_name()).collect::<Vec<_>>();
        let work = dir.path().join(".s.brickcast-tmp-1-0");
        for left in [&[][..], &[BEGUN]] {
            std::fs::create_dir(&work).unwrap();
            left.iter().for_each(|name| std::fs::write(work.join(name), b"").unwrap());
            drop(WorkDir::create(&dir.path().join("s"), false).unwrap());
            assert!(names().is_empty(), "{left:?}: {:?}", names());
            assert!(locked(&work).unwrap().is_none());
        }
        // Of one that lives.
        std::fs::create_dir(&work).unwrap();
        let begun = File::create(work.join(BEGUN)).unwrap();
        begun.try_lock().unwrap();
        drop(WorkDir::create(&dir.path().join("s"), false).unwrap());
        assert!(work.join(BEGUN).exists());
        assert!(locked(&work).unwrap().is_none());
    }

    #[test]
    fn writers_that_begin_at_once_leave_each_other_alone() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s");
        let begin = || {
            for _ in 0..400 {
                let work = WorkDir::create(&target, false).unwrap();
                std::thread::yield_now();
                assert!(work.store().is_dir() && work.scratch().join("lock").is_file());
            }
        };
        std::thread::scope(|scope| (0..6).for_each(|_| drop(scope.spawn(begin))));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
