//! The cache's size is bounded: entries that were not used for longest make room for new ones, those in use stay.

use std::path::PathBuf;
use std::time::SystemTime;

use anyhow::anyhow;
use brickcast_volume::store::{remove_leftovers, remove_store, stored_bytes};

use super::entry::Wanted;
use super::lock::{Lock, Wait, number_in};
use super::opened::Cache;
use crate::words::bytes as shown;

/// Held while entries are counted and removed, so that two do not count on the same room.
pub(super) const COUNTING: &str = "brickcast-cache.lock";

/// What became of an entry that was to go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Removal {
    Done,
    /// It stays: a process that lives makes or uses it.
    InUse,
    /// It stays: it holds what is not its own, or the disk refuses.
    Foreign,
}

/// An entry as it lies in the folder.
struct Entry {
    name: String,
    bytes: u64,
    used: SystemTime,
}

impl Cache {
    /// Makes room for an entry and keeps it, in the entry's lock, until that is let go.
    pub(super) fn make_room(&self, wanted: &Wanted<'_>, name: &str, lock: &mut Lock) -> anyhow::Result<()> {
        let (need, limit) = (wanted.bytes, self.limit);
        let (input, text) = (wanted.input.display(), &self.limit_text);
        if need > limit {
            return Err(anyhow!(
                "{input}: prepared, it takes about {}, more than the {text} of --cache-size; give more, or prepare it \
                 yourself with `brickcast prepare` and name the store",
                shown(need)
            ));
        }
        let _counting = self.counting()?;
        let others = self.shrink(name, limit - need);
        if others > limit - need {
            return Err(anyhow!(
                "{input}: prepared, it takes about {}; of the {text} of --cache-size, {} are in use by other renders: \
                 wait for them, or give more",
                shown(need),
                shown(others)
            ));
        }
        if let Err(error) = lock.write_number(need) {
            tracing::debug!("{}: {error}", self.lock_path(name).display());
        }
        Ok(())
    }

    /// The same after an entry was made, which may have become larger than was thought.
    pub(super) fn keep_limit(&self, name: &str) -> anyhow::Result<()> {
        let _counting = self.counting()?;
        let own = stored_bytes(&self.store_path(name));
        self.shrink(name, self.limit.saturating_sub(own));
        Ok(())
    }

    pub(super) fn counting(&self) -> anyhow::Result<Lock> {
        let path = self.folder.join(COUNTING);
        let mut wait = Wait::new(format!("another brickcast that makes room in the cache ({})", path.display()));
        loop {
            if let Some(lock) = Lock::alone(&path)? {
                return Ok(lock);
            }
            wait.pause();
        }
    }

    /// Removes entries but `name` until the others take at most `limit`, as far as they are not in use; what they take
    /// then.
    fn shrink(&self, name: &str, limit: u64) -> u64 {
        remove_leftovers(&self.folder);
        let mut entries: Vec<Entry> = self.entries().filter(|entry| entry.name != name).collect();
        entries.sort_by_key(|entry| entry.used);
        let mut total = entries.iter().fold(self.promised(name), |sum, entry| sum.saturating_add(entry.bytes));
        for entry in entries {
            if total <= limit {
                break;
            }
            if self.remove(&entry) {
                total = total.saturating_sub(entry.bytes);
            }
        }
        total
    }

    /// False where the entry stays.
    fn remove(&self, entry: &Entry) -> bool {
        let path = self.store_path(&entry.name);
        match self.removed(&entry.name) {
            Removal::InUse => false,
            Removal::Foreign => {
                tracing::warn!(
                    "{} stays in the cache: it cannot be removed, or holds other files than a store's",
                    path.display()
                );
                false
            }
            Removal::Done => {
                let days = entry.used.elapsed().map_or(0, |since| since.as_secs() / 86_400);
                tracing::warn!(
                    "removed {} ({}, last used {days} days ago) from the cache, which may hold {} (--cache-size)",
                    path.display(),
                    shown(entry.bytes),
                    self.limit_text
                );
                true
            }
        }
    }

    /// Removes an entry with its key and its lock.
    pub(super) fn removed(&self, name: &str) -> Removal {
        let Ok(Some(lock)) = Lock::alone(&self.lock_path(name)) else { return Removal::InUse };
        let path = self.store_path(name);
        // The key last: without one, nobody would count what is left.
        if remove_store(&path).is_err() && path.exists() {
            return Removal::Foreign;
        }
        let _ = std::fs::remove_file(self.key_path(name));
        lock.remove();
        Removal::Done
    }

    /// Entries by their `.key` files: anything else in the folder is not the cache's.
    fn entries(&self) -> impl Iterator<Item = Entry> {
        self.named(".key").map(|(name, path)| {
            let used = path.metadata().and_then(|data| data.modified()).unwrap_or(SystemTime::UNIX_EPOCH);
            Entry { bytes: stored_bytes(&self.store_path(&name)), name, used }
        })
    }

    /// What others have been promised who are making entries now.
    fn promised(&self, name: &str) -> u64 {
        let others = self.named(".lock").filter(|(other, _)| other != name);
        let promised = others.map(|(_, path)| (number_in(&path), path)).filter(|(bytes, _)| *bytes > 0);
        // A lock that can be had is of one who died at it.
        promised.filter(|(_, path)| matches!(Lock::shared(path), Ok(None))).map(|(bytes, _)| bytes).sum()
    }

    /// Files in the folder that end so, by what stands before it.
    pub(super) fn named(&self, ending: &str) -> impl Iterator<Item = (String, PathBuf)> {
        let files = std::fs::read_dir(&self.folder).into_iter().flatten().flatten();
        files
            .filter_map(move |entry| Some((entry.file_name().to_str()?.strip_suffix(ending)?.to_owned(), entry.path())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::time::Duration;

    /// An entry of so many bytes, last used `age` seconds ago.
    fn entry(cache: &Cache, name: &str, bytes: usize, age: u64) {
        let store = cache.store_path(name);
        fs::create_dir(&store).unwrap();
        let manifest = r#"{ "format": "brickcast-store", "version": 1 }"#;
        fs::write(store.join("brickcast.json"), manifest).unwrap();
        fs::write(store.join("halos.bin"), vec![0; bytes - manifest.len()]).unwrap();
        fs::write(cache.key_path(name), "key").unwrap();
        let key = fs::File::options().write(true).open(cache.key_path(name)).unwrap();
        key.set_modified(SystemTime::now() - Duration::from_secs(age)).unwrap();
    }

    fn cache(dir: &tempfile::TempDir) -> Cache {
        Cache { folder: dir.path().to_path_buf(), limit: 10_000, limit_text: "10000".into() }
    }

    fn left(cache: &Cache) -> Vec<String> {
        let mut names: Vec<_> = cache.entries().map(|e| e.name).collect();
        names.sort();
        names
    }

    #[test]
    fn what_was_not_used_for_longest_goes_first_and_what_is_in_use_stays() {
        let dir = tempfile::tempdir().unwrap();
        let cache = cache(&dir);
        for (name, age) in [("oldest", 50), ("old", 40), ("middle", 30), ("new", 1)] {
            entry(&cache, name, 2000, age);
        }
        let used = Lock::shared(&cache.lock_path("oldest")).unwrap().unwrap();
        assert_eq!(cache.shrink("x", 8000), 8000);
        assert_eq!(left(&cache).len(), 4);
        assert_eq!(cache.shrink("x", 5000), 4000);
        assert_eq!(left(&cache), ["new", "oldest"]);
        assert!(!cache.store_path("old").exists() && !cache.key_path("old").exists());
        assert_eq!(cache.shrink("x", 0), 2000, "in use");
        assert_eq!(left(&cache), ["oldest"]);
        drop(used);
        assert_eq!(cache.shrink("oldest", 0), 0, "the entry itself does not count");
        assert_eq!(left(&cache), ["oldest"]);
        assert_eq!(cache.shrink("x", 0), 0);
        assert!(left(&cache).is_empty());
    }

    #[test]
    fn other_peoples_files_in_the_folder_or_in_an_entry_stay() {
        let dir = tempfile::tempdir().unwrap();
        let cache = cache(&dir);
        entry(&cache, "mixed", 2000, 50);
        entry(&cache, "mine", 2000, 50);
        fs::remove_file(cache.key_path("mine")).unwrap();
        fs::write(cache.store_path("mixed").join("notes.txt"), "mine").unwrap();
        assert_eq!(cache.shrink("x", 0), 2000);
        assert!(cache.store_path("mixed").join("halos.bin").is_file() && cache.store_path("mine").is_dir());
    }

    #[test]
    fn room_that_another_was_promised_counts_while_it_lives() {
        let dir = tempfile::tempdir().unwrap();
        let cache = cache(&dir);
        let mut maker = Lock::alone(&cache.lock_path("growing")).unwrap().unwrap();
        maker.write_number(6000).unwrap();
        assert_eq!(cache.promised("x"), 6000);
        assert_eq!(cache.promised("growing"), 0);
        drop(maker);
        assert_eq!(cache.promised("x"), 0);
    }
}
