//! What lies in the cache: listed, and removed where nobody uses it.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use brickcast_volume::small_file::read_text;
use brickcast_volume::store::{MANIFEST_FILE, remove_leftovers, remove_store, stored_bytes};

use super::entry::MAX_KEY_BYTES;
use super::lock::Lock;
use super::opened::Cache;
use super::room::{COUNTING, Removal};

/// The store and the volume in a folder `demo-VERSION-SIZE` that the demo of earlier versions made for itself.
const DEMO_STORE: &str = "phantom.brickcast";
const DEMO_VOLUME: &str = "phantom.nrrd";

/// How a store came into the cache.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// With its key.
    Entry,
    /// Named as an entry is, but without a key: nobody takes it any more.
    Keyless,
    /// A folder of the demo's own, as earlier versions made them.
    Demo,
}

/// A store in the cache.
#[derive(Debug, Clone)]
pub(crate) struct Item {
    pub(crate) name: String,
    /// Of the store.
    pub(crate) path: PathBuf,
    /// The files that it was made of, as the key has them: in quotes where [`Path`] is written so.
    files: Vec<String>,
    pub(crate) bytes: u64,
    pub(crate) used: SystemTime,
    /// A process that lives makes or uses it.
    pub(crate) in_use: bool,
    kind: Kind,
    is_whole: bool,
}

impl Item {
    /// What it was made of, for people.
    pub(crate) fn input(&self) -> &str {
        match (self.files.first(), self.kind) {
            (Some(file), _) => file.trim_matches('"'),
            (None, Kind::Entry) if self.is_whole => "the demo's phantom part",
            (None, Kind::Entry) => "not finished",
            (None, Kind::Keyless) => "unknown: its key is missing",
            (None, Kind::Demo) => "the demo of an earlier version",
        }
    }

    /// True where `what` is its name, its store, or a file that it was made of.
    pub(crate) fn is_named(&self, what: &str) -> bool {
        let place = Path::new(what).canonicalize().ok();
        let is_file = |place: &Path| self.files.iter().any(|file| *file == format!("{place:?}"));
        let is_store = |place: &Path| self.path.canonicalize().is_ok_and(|own| own == place);
        self.name == what || place.is_some_and(|place| is_file(&place) || is_store(&place))
    }
}

impl Cache {
    /// Everything in the folder that this program put there, the least used first.
    pub(crate) fn items(&self) -> Vec<Item> {
        let entries = self.named(".key").map(|(name, key)| {
            let text = read_text("cache key", &key, MAX_KEY_BYTES).unwrap_or_default();
            let path = self.store_path(&name);
            self.item((name, path), &key, files_of(&text), (Kind::Entry, !text.is_empty()))
        });
        let mut items: Vec<Item> = entries.collect();
        let folders = std::fs::read_dir(&self.folder).into_iter().flatten().flatten();
        for (name, path) in folders.filter_map(|f| Some((f.file_name().to_str()?.to_owned(), f.path()))) {
            let (old, manifest) = (path.join(DEMO_STORE), path.join(MANIFEST_FILE));
            if name.starts_with("demo-") && old.join(MANIFEST_FILE).is_file() {
                let manifest = old.join(MANIFEST_FILE);
                items.push(self.item((name, old), &manifest, Vec::new(), (Kind::Demo, true)));
            } else if is_name(&name) && manifest.is_file() && !self.key_path(&name).exists() {
                items.push(self.item((name, path), &manifest, Vec::new(), (Kind::Keyless, true)));
            }
        }
        items.sort_by_key(|item| item.used);
        items
    }

    /// `dated` is the file that was touched when it was used last.
    fn item(&self, (name, path): (String, PathBuf), dated: &Path, files: Vec<String>, of: (Kind, bool)) -> Item {
        let lock = self.lock_path(&name);
        Item {
            bytes: stored_bytes(&path),
            used: dated.metadata().and_then(|data| data.modified()).unwrap_or(SystemTime::UNIX_EPOCH),
            in_use: lock.exists() && matches!(Lock::alone(&lock), Ok(None)),
            name,
            path,
            files,
            kind: of.0,
            is_whole: of.1,
        }
    }

    /// Removes those of `items` that nobody uses; what became of each.
    ///
    /// # Errors
    /// Others cannot be kept from counting what lies there.
    pub(crate) fn clear<'a>(&self, items: &[&'a Item]) -> anyhow::Result<Vec<(&'a Item, Removal)>> {
        let _counting = self.counting()?;
        remove_leftovers(&self.folder);
        let clear = |item: &&'a Item| {
            let removal = match item.kind {
                Kind::Entry | Kind::Keyless => self.removed(&item.name),
                Kind::Demo => demo_removed(&item.path),
            };
            (*item, removal)
        };
        let cleared = items.iter().map(clear).collect();
        self.remove_free_locks();
        Ok(cleared)
    }

    /// Locks of entries that are gone.
    fn remove_free_locks(&self) {
        for (name, path) in self.named(".lock") {
            let is_of_one = self.key_path(&name).exists() || self.store_path(&name).exists();
            if is_of_one || path.file_name().is_some_and(|name| name == COUNTING) {
                continue;
            }
            if let Ok(Some(lock)) = Lock::alone(&path) {
                lock.remove();
            }
        }
    }
}

/// True for names that [`Key`](super::Key) gives.
fn is_name(name: &str) -> bool {
    let hash = name.rsplit_once('-').map_or("", |(_, hash)| hash);
    hash.len() == 16 && hash.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
}

/// The files and folders of a key, as it has them: `file "/a/b", 12 bytes, modified ...`.
fn files_of(key: &str) -> Vec<String> {
    let quoted = |line: &str| {
        let (name, _) = line.strip_prefix("file ")?.rsplit_once(", modified ")?.0.rsplit_once(", ")?;
        Some(name.to_owned())
    };
    key.lines().filter_map(quoted).collect()
}

fn demo_removed(store: &Path) -> Removal {
    let Some(folder) = store.parent() else { return Removal::Foreign };
    let removed = remove_store(store).is_ok()
        && std::fs::remove_file(folder.join(DEMO_VOLUME)).is_ok()
        && std::fs::remove_dir(folder).is_ok();
    if removed { Removal::Done } else { Removal::Foreign }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_a_key_are_those_that_it_was_made_with() {
        let dir = tempfile::tempdir().unwrap();
        let odd = dir.path().join("a \"b\", modified c.raw");
        std::fs::write(&odd, b"1").unwrap();
        let key = super::super::Key::new(&odd, std::slice::from_ref(&odd), "x").unwrap();
        assert_eq!(files_of(&key.text), [format!("{:?}", odd.canonicalize().unwrap())]);
        assert!(is_name(&key.name) && !is_name("part") && !is_name("part-0123456789abcdeg"));
    }
}
