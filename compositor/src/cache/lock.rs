//! Locks on files: the system lets go of them when their holder ends, however it ends.

use std::fs::{File, TryLockError};
use std::io::{Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use brickcast_volume::small_file::read_text;

/// Nobody is told of shorter waits.
const QUIET: Duration = Duration::from_secs(1);

/// A lock that is held until this is dropped.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    file: File,
}

impl Lock {
    /// Together with others who hold it so; nothing where someone holds it alone.
    pub(super) fn shared(path: &Path) -> anyhow::Result<Option<Self>> {
        Self::held(path, File::try_lock_shared)
    }

    /// Alone; nothing where anyone holds it.
    pub(super) fn alone(path: &Path) -> anyhow::Result<Option<Self>> {
        Self::held(path, File::try_lock)
    }

    fn held(path: &Path, lock: impl Fn(&File) -> Result<(), TryLockError>) -> anyhow::Result<Option<Self>> {
        let failed = || format!("{}: cannot be opened; name another folder with --cache-dir", path.display());
        let open = || File::options().read(true).write(true).create(true).truncate(false).open(path);
        let file = open().with_context(failed)?;
        match lock(&file) {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Ok(None),
            // File systems without locks: what follows is as good as it is without.
            Err(TryLockError::Error(error)) => tracing::debug!("{}: no locks here: {error}", path.display()),
        }
        // Between opening and locking its last holder may have removed it: then others lock another file of this name.
        if is_at(&file, path) { Ok(Some(Self { path: path.to_path_buf(), file })) } else { Ok(None) }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Keeps a number in the file, for those who do not get the lock.
    pub(super) fn write_number(&mut self, number: u64) -> std::io::Result<()> {
        self.file.rewind()?;
        self.file.set_len(0)?;
        self.file.write_all(number.to_string().as_bytes())
    }

    /// Removes the file too. Only who holds it alone may, and who wants it next makes another.
    pub(super) fn remove(self) {
        // Elsewhere another process could hold a removed file's lock unnoticed.
        if cfg!(unix) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// The number that a lock's holder keeps in its file; 0 where there is none.
pub(super) fn number_in(path: &Path) -> u64 {
    read_text("lock", path, 20).ok().and_then(|text| text.parse().ok()).unwrap_or(0)
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let identity = |data: std::fs::Metadata| (data.dev(), data.ino());
    file.metadata().ok().map(identity) == std::fs::metadata(path).ok().map(identity)
}

#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

/// Waits between tries, and says so once it takes long.
#[derive(Debug)]
pub(super) struct Wait {
    since: Instant,
    what: String,
    told: bool,
    tries: u32,
}

impl Wait {
    pub(super) fn new(what: String) -> Self {
        Self { since: Instant::now(), what, told: false, tries: 0 }
    }

    pub(super) fn pause(&mut self) {
        if !self.told && self.since.elapsed() >= QUIET {
            tracing::warn!("waiting for {}", self.what);
            self.told = true;
        }
        self.tries += 1;
        // Not the same for all, lest they meet again and again.
        let spread = u64::from(std::process::id().wrapping_mul(0x9E37_79B1).wrapping_add(self.tries * 7) % 16);
        std::thread::sleep(Duration::from_millis(u64::from(self.tries.min(40)) + spread));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn users_share_and_makers_are_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.lock");
        let first = Lock::shared(&path).unwrap().unwrap();
        let second = Lock::shared(&path).unwrap().unwrap();
        assert!(Lock::alone(&path).unwrap().is_none());
        drop((first, second));
        let mut maker = Lock::alone(&path).unwrap().unwrap();
        assert!(Lock::shared(&path).unwrap().is_none() && Lock::alone(&path).unwrap().is_none());
        maker.write_number(1 << 40).unwrap();
        maker.write_number(77).unwrap();
        assert_eq!(number_in(&path), 77);
        drop(maker);
        assert!(Lock::shared(&path).unwrap().is_some());
    }

    #[cfg(unix)]
    #[test]
    fn a_lock_on_a_file_that_was_removed_is_none() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.lock");
        let removed = Lock::alone(&path).unwrap().unwrap();
        let file = File::open(&path).unwrap();
        removed.remove();
        assert!(!is_at(&file, &path));
        let next = Lock::alone(&path).unwrap().unwrap();
        assert!(is_at(&next.file, &path) && !is_at(&file, &path));
    }
}
