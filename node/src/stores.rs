//! The stores below the data root, by hash and by name. Nothing outside the root is ever opened.

use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use brickcast_proto::{StoreName, StoreQuery};
use brickcast_volume::StoreHash;
use brickcast_volume::store::{MANIFEST_FILE, Manifest, Store};

use crate::config::DataRoot;
use crate::error::NodeError;

/// Folders between the root and a store, at most.
const MAX_DEPTH: u32 = 4;
/// Folders looked into by one scan, at most: a data root that is someone's home must not stall the node.
const MAX_FOLDERS: usize = 100_000;
/// A miss scans again, but not more often than this.
const SCAN_INTERVAL: Duration = Duration::from_secs(1);
/// Names listed in an error, at most.
const LISTED: usize = 20;

/// A store that stays open.
#[derive(Debug)]
pub struct OpenStore {
    pub name: String,
    pub store: Store,
}

/// All stores of a node.
#[derive(Debug)]
pub struct Stores {
    /// Canonical.
    root: PathBuf,
    /// `Some` where the node has a single store, of this name.
    single: Option<String>,
    index: Mutex<Index>,
}

#[derive(Debug, Default)]
struct Index {
    /// By name.
    found: Vec<(StoreName, PathBuf)>,
    open: HashMap<StoreHash, Arc<OpenStore>>,
    scanned: Option<Instant>,
}

impl Stores {
    /// # Errors
    /// A data root that is not a folder.
    pub fn new(data: &DataRoot) -> Result<Self, NodeError> {
        let (DataRoot::Folder(path) | DataRoot::Single(path)) = data;
        let fail = |source| NodeError::DataRoot { path: path.clone(), source };
        let root = path.canonicalize().map_err(fail)?;
        std::fs::read_dir(&root).map_err(fail)?;
        let single = match data {
            DataRoot::Folder(_) => None,
            DataRoot::Single(_) => {
                Some(root.file_name().map_or_else(|| "store".to_owned(), |n| n.to_string_lossy().into_owned()))
            }
        };
        Ok(Self { root, single, index: Mutex::default() })
    }

    /// What is there, by name.
    #[must_use]
    pub fn list(&self) -> Vec<StoreName> {
        let mut index = self.lock();
        self.scan(&mut index);
        index.found.iter().map(|(name, _)| name.clone()).collect()
    }

    /// # Errors
    /// An unknown hash (listing what is there), a store that does not open.
    pub fn by_hash(&self, hash: StoreHash) -> Result<Arc<OpenStore>, NodeError> {
        let (name, path) = {
            let mut index = self.lock();
            if let Some(open) = index.open.get(&hash) {
                return Ok(open.clone());
            }
            let find = |index: &Index| index.found.iter().find(|(name, _)| name.hash == hash).cloned();
            let mut found = find(&index);
            if found.is_none() {
                self.scan(&mut index);
                found = find(&index);
            }
            found.ok_or_else(|| NodeError::UnknownStore { hash, there: listing(&index) })?
        };
        let open = self.open(name.name, &path)?;
        if open.store.hash() != hash {
            self.forget(hash);
            return Err(NodeError::OtherContent { name: open.name.clone(), got: open.store.hash(), want: hash });
        }
        Ok(open)
    }

    /// # Errors
    /// As [`Stores::by_hash`]; a name that leads outside the root; a name whose store has another hash than expected.
    pub fn query(&self, query: &StoreQuery) -> Result<Arc<OpenStore>, NodeError> {
        let (name, expected) = match query {
            StoreQuery::Hash(hash) => return self.by_hash(*hash),
            StoreQuery::Name { name, expected } => (name, expected),
        };
        let path = self.resolve(name)?;
        let Some(hash) = manifest_hash(&path) else {
            let mut index = self.lock();
            self.scan(&mut index);
            return Err(NodeError::UnknownName { name: name.clone(), there: listing(&index) });
        };
        if let Some(want) = *expected
            && want != hash
        {
            return Err(NodeError::OtherContent { name: name.clone(), got: hash, want });
        }
        if let Some(open) = self.lock().open.get(&hash) {
            return Ok(open.clone());
        }
        self.open(name.clone(), &path)
    }

    /// Closes a store that turned out to be broken: the next order looks at the disk again.
    pub fn forget(&self, hash: StoreHash) {
        let mut index = self.lock();
        index.open.remove(&hash);
        index.found.retain(|(name, _)| name.hash != hash);
    }

    fn open(&self, name: String, path: &Path) -> Result<Arc<OpenStore>, NodeError> {
        // A single store was named by whoever runs the node, links and all.
        let outside = if self.single.is_none() { first_outside(&self.root, path) } else { None };
        if let Some(file) = outside {
            return Err(NodeError::Outside { name, file });
        }
        let store = Store::open(path).map_err(|source| NodeError::Store { name: name.clone(), source })?;
        let open = Arc::new(OpenStore { name, store });
        Ok(self.lock().open.entry(open.store.hash()).or_insert(open).clone())
    }

    /// The folder that `name` means; canonical and inside the root.
    fn resolve(&self, name: &str) -> Result<PathBuf, NodeError> {
        let bad = |why| NodeError::BadName { name: brickcast_proto::convert::clip(name, 256), why };
        let path = Path::new(name);
        if name.is_empty() || name.contains('\0') {
            return Err(bad("is empty or holds a NUL"));
        }
        if path.is_absolute() || name.starts_with('/') {
            return Err(bad("is an absolute path"));
        }
        if !path.components().all(|c| matches!(c, Component::Normal(_))) {
            return Err(bad("holds `.` or `..`"));
        }
        if let Some(single) = &self.single {
            let unknown =
                || NodeError::UnknownName { name: name.to_owned(), there: format!("there is only `{single}`") };
            return if single == name { Ok(self.root.clone()) } else { Err(unknown()) };
        }
        let joined = self.root.join(path);
        match joined.canonicalize() {
            Ok(found) if found.starts_with(&self.root) => Ok(found),
            Ok(_) => Err(bad("leads outside the data root")),
            // Nothing there: the caller says so.
            Err(_) => Ok(joined),
        }
    }

    /// Looks at the disk, if that was not done a moment ago.
    fn scan(&self, index: &mut Index) {
        if index.scanned.is_some_and(|at| at.elapsed() < SCAN_INTERVAL) {
            return;
        }
        let mut found = Vec::new();
        if let Some(name) = &self.single {
            if let Some(hash) = manifest_hash(&self.root) {
                found.push((StoreName { name: name.clone(), hash }, self.root.clone()));
            }
        } else {
            let mut folders = MAX_FOLDERS;
            scan_folder(&self.root, &self.root, "", 0, &mut folders, &mut found);
        }
        found.sort_by(|a, b| a.0.name.cmp(&b.0.name));
        index.found = found;
        index.scanned = Some(Instant::now());
    }

    fn lock(&self) -> MutexGuard<'_, Index> {
        self.index.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Adds the stores at and below `folder`. Symlinks are followed where they stay inside the root.
fn scan_folder(
    root: &Path,
    folder: &Path,
    name: &str,
    depth: u32,
    folders: &mut usize,
    found: &mut Vec<(StoreName, PathBuf)>,
) {
    if *folders == 0 || found.len() >= brickcast_proto::cluster::MAX_STORES {
        return;
    }
    *folders -= 1;
    if depth > 0
        && let Some(hash) = manifest_hash(folder)
    {
        found.push((StoreName { name: name.to_owned(), hash }, folder.to_path_buf()));
        return;
    }
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    if depth == MAX_DEPTH {
        return;
    }
    for entry in entries.flatten() {
        let file_name = entry.file_name();
        // Stores that are being written have hidden names; a name must travel as text.
        let Some(text) = file_name.to_str().filter(|t| !t.starts_with('.')) else { continue };
        let Ok(path) = entry.path().canonicalize() else { continue };
        if path.is_dir() && path.starts_with(root) {
            let name = if name.is_empty() { text.to_owned() } else { format!("{name}/{text}") };
            scan_folder(root, &path, &name, depth + 1, folders, found);
        }
    }
}

/// What of the store a link leads out of the data root to, or cannot be looked at; relative to the store. Folders behind links
/// that stay inside are looked at too, each once.
fn first_outside(root: &Path, store: &Path) -> Option<PathBuf> {
    let relative = |path: &Path| path.strip_prefix(store).unwrap_or(path).to_path_buf();
    let mut seen = HashSet::new();
    let mut folders = vec![store.to_path_buf()];
    while let Some(folder) = folders.pop() {
        match folder.canonicalize() {
            Ok(real) if !real.starts_with(root) => return Some(relative(&folder)),
            Ok(real) => {
                if !seen.insert(real) {
                    continue;
                }
            }
            Err(_) => return Some(relative(&folder)),
        }
        let Ok(entries) = std::fs::read_dir(&folder) else { return Some(relative(&folder)) };
        for entry in entries {
            let Ok(path) = entry.map(|e| e.path()) else { return Some(relative(&folder)) };
            if path.is_dir() {
                folders.push(path);
            } else if path.is_symlink() && !path.canonicalize().is_ok_and(|to| to.starts_with(root)) {
                return Some(relative(&path));
            }
        }
    }
    None
}

/// The hash of the store in `folder`; `None` where there is none.
fn manifest_hash(folder: &Path) -> Option<StoreHash> {
    let path = folder.join(MANIFEST_FILE);
    let length = std::fs::metadata(&path).ok().filter(std::fs::Metadata::is_file)?.len();
    if length > Manifest::MAX_BYTES {
        return None;
    }
    std::fs::read(path).ok().map(|bytes| StoreHash::of(&bytes))
}

fn listing(index: &Index) -> String {
    if index.found.is_empty() {
        return "there is no store below the node's --data at all".to_owned();
    }
    let mut names: Vec<String> =
        index.found.iter().take(LISTED).map(|(s, _)| format!("`{}` ({})", s.name, s.hash)).collect();
    if index.found.len() > LISTED {
        names.push(format!("and {} more", index.found.len() - LISTED));
    }
    format!("there are {}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{make_store, ramp};

    fn by_name(name: &str) -> StoreQuery {
        StoreQuery::Name { name: name.to_owned(), expected: None }
    }

    #[test]
    fn stores_are_found_below_the_root_by_name_and_by_hash() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("scans/2024")).unwrap();
        let hash = make_store(&folder.path().join("scans/2024/ramp"), ramp);
        let stores = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
        assert_eq!(stores.list(), [StoreName { name: "scans/2024/ramp".to_owned(), hash }]);
        assert_eq!(stores.by_hash(hash).unwrap().name, "scans/2024/ramp");
        assert_eq!(stores.query(&by_name("scans/2024/ramp")).unwrap().store.hash(), hash);
        let single = Stores::new(&DataRoot::Single(folder.path().join("scans/2024/ramp"))).unwrap();
        assert_eq!(single.list()[0].name, "ramp");
        assert!(single.query(&by_name("ramp")).is_ok() && single.query(&by_name("other")).is_err());
    }

    #[test]
    fn an_unknown_store_is_told_what_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let stores = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
        assert!(stores.by_hash(StoreHash(5)).unwrap_err().to_string().contains("no store below"));
        let hash = make_store(&folder.path().join("ramp"), ramp);
        std::thread::sleep(SCAN_INTERVAL);
        for error in [stores.by_hash(StoreHash(5)).unwrap_err(), stores.query(&by_name("rump")).unwrap_err()] {
            assert!(matches!(error, NodeError::UnknownStore { .. } | NodeError::UnknownName { .. }), "{error}");
            assert!(error.to_string().contains(&format!("`ramp` ({hash})")), "{error}");
        }
        let error = stores.query(&StoreQuery::Name { name: "ramp".to_owned(), expected: Some(StoreHash(5)) });
        let error = error.unwrap_err();
        assert!(matches!(error, NodeError::OtherContent { .. }), "{error}");
        assert!(error.to_string().contains(&hash.to_string()) && error.to_string().contains("ramp"), "{error}");
    }

    #[test]
    fn names_that_lead_outside_the_data_root_are_refused() {
        let outside = tempfile::tempdir().unwrap();
        make_store(&outside.path().join("secret"), ramp);
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("inner")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(outside.path(), folder.path().join("link")).unwrap();
        let stores = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
        let absolute = outside.path().join("secret").display().to_string();
        let dotted = format!("../{}/secret", outside.path().file_name().unwrap().display());
        let mut bad = vec!["", "..", ".", "inner/../..", "inner/../inner/..", "/", "a\0b", &absolute, &dotted];
        if cfg!(unix) {
            bad.extend(["link", "link/secret"]);
        }
        for name in bad {
            let error = stores.query(&by_name(name)).unwrap_err();
            assert!(matches!(error, NodeError::BadName { .. }), "{name}: {error}");
        }
        assert!(stores.list().is_empty(), "a link must not put outside stores into the index");
    }

    /// A link in the store itself, and one behind a link that stays inside; links that lead nowhere else are fine.
    #[cfg(unix)]
    #[test]
    fn links_of_a_store_that_lead_outside_are_refused_however_deep() {
        use std::os::unix::fs::symlink;
        let outside = tempfile::tempdir().unwrap();
        for (at, to, is_refused) in [
            ("ramp/more", "inner", false),
            ("ramp/round", "ramp", false),
            ("inner/deep", "OUTSIDE", true),
            ("ramp/0/gone", "nothing", true),
        ] {
            let folder = tempfile::tempdir().unwrap();
            make_store(&folder.path().join("ramp"), ramp);
            std::fs::create_dir(folder.path().join("inner")).unwrap();
            let target = if to == "OUTSIDE" { outside.path().to_path_buf() } else { folder.path().join(to) };
            symlink(target, folder.path().join(at)).unwrap();
            if at.starts_with("inner") {
                symlink(folder.path().join("inner"), folder.path().join("ramp/more")).unwrap();
            }
            let answer = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap().query(&by_name("ramp"));
            assert_eq!(matches!(answer, Err(NodeError::Outside { .. })), is_refused, "{at} to {to}: {answer:?}");
            assert_eq!(answer.is_ok(), !is_refused, "{at} to {to}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_that_go_round_in_circles_end() {
        let folder = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink(folder.path(), folder.path().join("round")).unwrap();
        make_store(&folder.path().join("ramp"), ramp);
        let stores = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
        let names: Vec<String> = stores.list().into_iter().map(|s| s.name).collect();
        assert!(names.contains(&"ramp".to_owned()) && names.len() <= MAX_DEPTH as usize, "{names:?}");
    }

    #[test]
    fn a_store_that_was_replaced_is_not_served_under_its_old_hash() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ramp");
        let old = make_store(&path, ramp);
        let stores = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
        assert_eq!(stores.list().len(), 1);
        std::fs::remove_dir_all(&path).unwrap();
        let new = make_store(&path, |x, _, _| x as u8);
        assert!(matches!(stores.by_hash(old), Err(NodeError::OtherContent { got, .. }) if got == new));
        std::thread::sleep(SCAN_INTERVAL);
        assert!(stores.by_hash(new).is_ok());
        assert!(matches!(stores.by_hash(old), Err(NodeError::UnknownStore { .. })));
    }

    #[test]
    fn a_missing_data_root_is_named() {
        let error = Stores::new(&DataRoot::Folder("no/such/folder".into())).unwrap_err().to_string();
        assert!(error.contains("no/such/folder") && error.contains("--data"), "{error}");
    }
}
