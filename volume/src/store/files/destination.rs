//! Stores that are put somewhere file by file as they are made: where nothing can be renamed, a manifest that comes
//! last is what makes a store.
//!
//! The invariant: *there is a manifest only where everything that it names is there*. What is replaced loses its
//! manifest before anything else of it is touched.

use std::collections::BTreeSet;
use std::fmt::Debug;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::shape::StoreShape;
use crate::store::error::StoreError;
use crate::store::objects::Objects;
use crate::store::profile::MANIFEST_FILE;

/// Lies where a store is being put, until its manifest does: what lies there without one is ours.
const MARK_FILE: &str = "brickcast.unfinished";
/// Files that are put at a time: each waits for the network most of its time.
const AT_ONCE: usize = 8;

/// A place that files are put to. From any number of threads.
pub trait Destination: Debug + Send + Sync {
    /// What lies there.
    fn objects(&self) -> Arc<dyn Objects>;

    /// Names that lie directly there; those of folders end with `/`. Some of them, where there are very many.
    ///
    /// # Errors
    /// The place is not there, or refuses.
    fn names(&self) -> Result<Vec<String>, StoreError>;

    /// Puts a file there, all of it or nothing, in place of what has its key.
    ///
    /// # Errors
    /// The file cannot be read; the place is not there, or refuses.
    fn put(&self, key: &str, file: &Path) -> Result<(), StoreError>;

    /// Removes what has these keys, where something has.
    ///
    /// # Errors
    /// The place is not there, or refuses.
    fn remove(&self, keys: &[String]) -> Result<(), StoreError>;
}

/// A store on its way.
#[derive(Debug)]
pub(crate) struct Sent {
    to: Arc<dyn Destination>,
    /// Of the store that is replaced; its manifest goes with the first file of the new one.
    old: Vec<String>,
    /// A file here, put there first.
    mark: PathBuf,
    has_begun: Mutex<bool>,
    keys: Mutex<BTreeSet<String>>,
    is_published: AtomicBool,
}

impl Sent {
    /// A file of a few bytes is kept in the folder `scratch`.
    ///
    /// # Errors
    /// Something lies at the place: a store, unless `force` allows to replace it, or anything else.
    pub(crate) fn new(to: Arc<dyn Destination>, force: bool, scratch: &Path) -> Result<Self, StoreError> {
        let objects = to.objects();
        let path = objects.place().to_path_buf();
        let old = match objects.manifest() {
            Err(error) if error.is_missing() => None,
            // A manifest all the same.
            Err(StoreError::Manifest(_)) => Some(StoreShape::any()),
            read => Some(StoreShape::of(&read?)),
        };
        if old.is_some() && !force {
            return Err(StoreError::Exists { path });
        }
        let names = to.names()?;
        let is_begun = names.iter().any(|name| name == MARK_FILE);
        let shape = old.clone().unwrap_or_else(|| if is_begun { StoreShape::any() } else { StoreShape::default() });
        let is_ours = |name: &String| match name.strip_suffix('/') {
            Some(folder) => shape.has_folder(folder),
            None => name == MARK_FILE || shape.has_file(name),
        };
        match names.iter().find(|name| !is_ours(name)) {
            Some(what) if old.is_some() => return Err(StoreError::Foreign { path, what: what.clone() }),
            Some(_) => return Err(StoreError::NotOurs { path, why: "it is a prefix that holds something else" }),
            None => {}
        }
        let old = old.map_or_else(Vec::new, |shape| shape.keys());
        let mark = scratch.join("mark");
        fs::write(&mark, b"a store is being put here\n").map_err(StoreError::io("write", &mark))?;
        Ok(Self { to, old, mark, has_begun: Mutex::default(), keys: Mutex::default(), is_published: false.into() })
    }

    pub(crate) fn objects(&self) -> Arc<dyn Objects> {
        self.to.objects()
    }

    fn keys(&self) -> MutexGuard<'_, BTreeSet<String>> {
        self.keys.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts finished files, by their keys, and removes them here.
    pub(crate) fn take(&self, files: &[(String, PathBuf)]) -> Result<(), StoreError> {
        {
            let mut has_begun = self.has_begun.lock().unwrap_or_else(PoisonError::into_inner);
            if !*has_begun {
                self.to.put(MARK_FILE, &self.mark)?;
                if !self.old.is_empty() {
                    self.to.remove(&[MANIFEST_FILE.to_owned()])?;
                }
                *has_begun = true;
            }
        }
        let next = AtomicUsize::new(0);
        let some = || {
            while let Some((key, file)) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
                self.keys().insert(key.clone());
                self.to.put(key, file)?;
                fs::remove_file(file).map_err(StoreError::io("remove", file))?;
            }
            Ok(())
        };
        std::thread::scope(|scope| {
            let workers: Vec<_> = (0..AT_ONCE.min(files.len())).map(|_| scope.spawn(some)).collect();
            let ended = workers.into_iter().map(|worker| match worker.join() {
                Ok(ended) => ended,
                Err(panic) => std::panic::resume_unwind(panic),
            });
            // All of them, before an error is told.
            ended.collect::<Vec<_>>().into_iter().collect()
        })
    }

    /// Puts all that is left in `folder`, the manifest last.
    pub(crate) fn publish(&self, folder: &Path) -> Result<(), StoreError> {
        let (mut files, mut open) = (Vec::new(), vec![folder.to_path_buf()]);
        while let Some(at) = open.pop() {
            for entry in fs::read_dir(&at).map_err(StoreError::io("list", &at))? {
                let entry = entry.map_err(StoreError::io("list", &at))?;
                let path = entry.path();
                match entry.file_type().map_err(StoreError::io("look at", &path))?.is_dir() {
                    true => open.push(path),
                    false => files.push((key_of(folder, &path), path)),
                }
            }
        }
        let (manifest, others): (Vec<_>, Vec<_>) = files.into_iter().partition(|(key, _)| key == MANIFEST_FILE);
        self.take(&others)?;
        self.take(&manifest)?;
        self.is_published.store(true, Ordering::Relaxed);
        let keys = self.keys();
        let mut left: Vec<String> = self.old.iter().filter(|key| !keys.contains(*key)).cloned().collect();
        left.push(MARK_FILE.to_owned());
        // It is of no store any more, and does no harm where it stays.
        let _ = self.to.remove(&left);
        Ok(())
    }

    /// Takes away what was put of a store that will not be.
    pub(crate) fn clear(&self) {
        if !self.is_published.load(Ordering::Relaxed) {
            let mut keys: Vec<String> = self.keys().iter().cloned().collect();
            keys.push(MARK_FILE.to_owned());
            let _ = self.to.remove(&keys);
        }
    }
}

/// `/` between names.
fn key_of(folder: &Path, file: &Path) -> String {
    let below = file.strip_prefix(folder).unwrap_or(file);
    below.components().map(|name| name.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}

/// Objects that are on their way: those that are here still, then those that are there.
#[derive(Debug)]
pub(crate) struct OnTheWay {
    pub(crate) here: Arc<dyn Objects>,
    pub(crate) there: Arc<dyn Objects>,
}

impl Objects for OnTheWay {
    fn place(&self) -> &Path {
        self.there.place()
    }

    fn open(&self, key: &str) -> Result<Arc<dyn crate::store::objects::Object>, StoreError> {
        match self.here.open(key) {
            Err(error) if error.is_missing() => self.there.open(key),
            opened => opened,
        }
    }

    fn is_far(&self) -> bool {
        self.there.is_far()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::store::objects::memory::MemoryObjects;

    #[derive(Debug, Default)]
    struct Bucket(Mutex<BTreeMap<String, Vec<u8>>>);

    impl Bucket {
        fn names(&self) -> Vec<String> {
            self.0.lock().unwrap().keys().cloned().collect()
        }
    }

    impl Destination for Bucket {
        fn objects(&self) -> Arc<dyn Objects> {
            let mut objects = MemoryObjects::new(Path::new("bucket"));
            self.0.lock().unwrap().iter().for_each(|(key, bytes)| objects.put(key, bytes.clone()));
            Arc::new(objects)
        }

        fn names(&self) -> Result<Vec<String>, StoreError> {
            let name = |key: &String| key.split_once('/').map_or(key.clone(), |(folder, _)| format!("{folder}/"));
            Ok(self.0.lock().unwrap().keys().map(name).collect())
        }

        fn put(&self, key: &str, file: &Path) -> Result<(), StoreError> {
            let bytes = fs::read(file).map_err(StoreError::io("read", file))?;
            self.0.lock().unwrap().insert(key.to_owned(), bytes);
            Ok(())
        }

        fn remove(&self, keys: &[String]) -> Result<(), StoreError> {
            keys.iter().for_each(|key| drop(self.0.lock().unwrap().remove(key)));
            Ok(())
        }
    }

    #[test]
    fn a_store_is_there_with_its_manifest_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let bucket = Arc::new(Bucket::default());
        let write = |name: &str| {
            let path = dir.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, b"content").unwrap();
            (name.to_owned(), path)
        };
        let begin = |force| Sent::new(bucket.clone(), force, dir.path());
        let sent = begin(false).unwrap();
        sent.take(&[write("0/c/0/0/0"), write("0/c/0/0/1")]).unwrap();
        assert!(!dir.path().join("0/c/0/0/0").exists());
        assert_eq!(bucket.names(), ["0/c/0/0/0", "0/c/0/0/1", MARK_FILE]);
        // One that was killed is gone on from, or not.
        begin(false).unwrap();
        sent.clear();
        assert_eq!(bucket.names(), [""; 0]);
        let (sent, out) = (begin(false).unwrap(), dir.path().join("out"));
        sent.take(&[write("0/c/0/0/0")]).unwrap();
        write("out/zarr.json");
        write("out/brickcast.json");
        sent.publish(&out).unwrap();
        sent.clear();
        assert_eq!(bucket.names(), ["0/c/0/0/0", MANIFEST_FILE, "zarr.json"]);
        assert!(matches!(begin(false), Err(StoreError::Exists { .. })));
        // The manifest is none, and goes before anything else is touched.
        let sent = begin(true).unwrap();
        assert_eq!(bucket.names().len(), 3);
        sent.take(&[write("0/c/0/0/1")]).unwrap();
        assert_eq!(bucket.names(), ["0/c/0/0/0", "0/c/0/0/1", MARK_FILE, "zarr.json"]);
        bucket.0.lock().unwrap().insert("thesis.tex".to_owned(), b"years of work".to_vec());
        assert!(matches!(begin(true), Err(StoreError::NotOurs { .. })));
        // Somebody else's arrays look like ours.
        bucket.remove(&[MARK_FILE.to_owned(), "thesis.tex".to_owned()]).unwrap();
        assert!(matches!(begin(true), Err(StoreError::NotOurs { .. })));
    }
}
