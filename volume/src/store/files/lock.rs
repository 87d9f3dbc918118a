//! The lock of a working directory: held as long as its writer lives, and no longer there than the directory.

use std::fs::{self, File};
use std::path::Path;

use crate::store::error::StoreError;

/// Makes it. It gets its name once it is held: whoever finds a free one has found that of a dead writer.
pub(super) fn locked(dir: &Path) -> Result<File, StoreError> {
    let (begun, path) = (dir.join("lock-begun"), dir.join("lock"));
    let lock = File::create(&begun).map_err(StoreError::io("create", &begun))?;
    // File systems without locks: the directory is then never taken for a dead one either.
    let _ = lock.try_lock();
    fs::rename(&begun, &path).map_err(StoreError::io("create", &path))?;
    Ok(lock)
}

/// The lock of a working directory whose writer is dead. Without a lock file its writer is just starting.
pub(super) fn dead(dir: &Path) -> Option<File> {
    let path = dir.join("lock");
    let lock = File::options().write(true).open(&path).ok()?;
    lock.try_lock().ok()?;
    // Its writer may have ended in the meantime, and another one have taken the name.
    is_at(&lock, &path).then_some(lock)
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
    use crate::store::files::workdir::WorkDir;

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
