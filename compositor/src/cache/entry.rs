//! One entry of the cache: found, or made by one process while others wait.

use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use anyhow::{Context as _, anyhow};
use brickcast_volume::StoreHash;
use brickcast_volume::small_file::{FileError, read_text};
use brickcast_volume::store::Store;
use brickcast_volume::unfinished::Unfinished;

use super::key::Key;
use super::lock::{Lock, Wait};
use super::opened::Cache;
use crate::stored;

/// Entries that are used, until the process ends: frames, nodes inside this process and further passes open files of a
/// store again and again.
static USED: Mutex<Vec<Lock>> = Mutex::new(Vec::new());

fn used() -> MutexGuard<'static, Vec<Lock>> {
    USED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// How often an entry may vanish between the one who made it and the one who uses it, before that is no accident.
const MAX_MADE: u32 = 3;
/// The longest `.key` file that is read, bytes: paths of tens of thousands of data files.
pub(super) const MAX_KEY_BYTES: u64 = 64 << 20;

/// What an entry is made of and how.
pub(crate) struct Wanted<'a> {
    /// For messages.
    pub(crate) input: &'a Path,
    /// What the store will take, about.
    pub(crate) bytes: u64,
    /// The key as it is now.
    pub(crate) key: &'a dyn Fn() -> anyhow::Result<Key>,
    /// Makes the store.
    pub(crate) make: &'a dyn Fn(&Path) -> anyhow::Result<()>,
}

impl Cache {
    /// The entry's store, which stays until this process ends.
    ///
    /// # Errors
    /// The input changes, cannot be read, or has no room; a folder that cannot be written.
    pub(crate) fn obtain(&self, wanted: &Wanted<'_>) -> anyhow::Result<Store> {
        let key = (wanted.key)()?;
        let lock_path = self.lock_path(&key.name);
        let mut wait = Wait::new(format!(
            "another brickcast that prepares {}, or still renders what it replaces ({})",
            wanted.input.display(),
            lock_path.display()
        ));
        let mut made = 0;
        loop {
            if let Some(lock) = Lock::shared(&lock_path)?
                && let Ok(Some(store)) = self.found(&key, wanted)
            {
                self.touch(&key.name);
                used().push(lock);
                tracing::info!("using the prepared store {}", store.path().display());
                return Ok(store);
            }
            // A broken entry that this process itself used before must not keep it from making another.
            used().retain(|held| held.path() != lock_path);
            if let Some(mut lock) = Lock::alone(&lock_path)? {
                match self.found(&key, wanted) {
                    // Made while this one waited.
                    Ok(Some(_)) => continue,
                    Ok(None) => {}
                    Err(why) => tracing::warn!("the cached store cannot be used and is made again: {why}"),
                }
                if made == MAX_MADE {
                    return Err(anyhow!(
                        "{}: what was prepared does not stay in the cache; is another program removing it? Name \
                         another folder with --cache-dir",
                        self.folder.display()
                    ));
                }
                made += 1;
                let kept = self.make(&key, wanted, &mut lock);
                // The room that was kept for it is needed no longer.
                let _ = lock.write_number(0);
                if kept.is_err() && !self.store_path(&key.name).exists() {
                    let _ = std::fs::remove_file(self.key_path(&key.name));
                    lock.remove();
                }
                kept?;
                continue;
            }
            wait.pause();
        }
    }

    /// Makes the entry, whose lock this process holds alone.
    fn make(&self, key: &Key, wanted: &Wanted<'_>, lock: &mut Lock) -> anyhow::Result<()> {
        // Empty: whatever store is there or comes is of no use yet, and yet counted and removed as an entry.
        self.write_key(key, b"")?;
        self.make_room(wanted, &key.name, lock)?;
        let target = self.store_path(&key.name);
        (wanted.make)(&target)?;
        if (wanted.key)()? != *key {
            // What was read before and after the change is in one store.
            let _ = brickcast_volume::store::remove_store(&target);
            return Err(anyhow!(
                "{} changed while it was read; run it again when nothing writes to it any more",
                wanted.input.display()
            ));
        }
        let store = stored::open_folder(&target)?;
        self.write_key(key, entry_text(key, store.hash()).as_bytes())?;
        self.keep_limit(&key.name)
    }

    /// The entry's store, where it is whole and was made of what `key` says; why not, where it is something else.
    fn found(&self, key: &Key, wanted: &Wanted<'_>) -> Result<Option<Store>, String> {
        let (path, target) = (self.key_path(&key.name), self.store_path(&key.name));
        let text = match read_text("cache key", &path, MAX_KEY_BYTES) {
            Err(FileError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => {
                return if target.exists() { Err(format!("{} is missing", path.display())) } else { Ok(None) };
            }
            read => read.map_err(|error| error.to_string())?,
        };
        if text.is_empty() {
            return Ok(None);
        }
        let store = stored::open_folder(&target).map_err(|e| e.to_string())?;
        if text != entry_text(key, store.hash()) {
            return Err(format!("{} is not made of {}", target.display(), wanted.input.display()));
        }
        match store.lacking() {
            Some((_, error)) => Err(error.to_string()),
            None => Ok(Some(store)),
        }
    }

    /// Marks the entry as just used.
    fn touch(&self, name: &str) {
        let path = self.key_path(name);
        let touched = std::fs::File::options().write(true).open(&path);
        if let Err(error) = touched.and_then(|file| file.set_modified(std::time::SystemTime::now())) {
            tracing::debug!("{}: {error}", path.display());
        }
    }

    fn write_key(&self, key: &Key, bytes: &[u8]) -> anyhow::Result<()> {
        let path = self.key_path(&key.name);
        write_whole(&path, bytes).with_context(|| format!("{}: cannot be written", path.display()))
    }

    pub(super) fn store_path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    pub(super) fn key_path(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.key"))
    }

    pub(super) fn lock_path(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.lock"))
    }
}

/// What stands in the file beside an entry's store.
fn entry_text(key: &Key, store: StoreHash) -> String {
    format!("store {store}\n{}", key.text)
}

/// All of a file or nothing, also after a power cut.
fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = Unfinished::create(path)?;
    file.write_all(bytes)?;
    file.finish()
}
