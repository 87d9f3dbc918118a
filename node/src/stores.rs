//! The stores below the data root, by hash and by name, and their levels, by hash alone. The root is a jail: nothing
//! outside of it is ever opened.

pub(crate) mod far;
mod open;
mod view;

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::path::{Component, Path};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use brickcast_proto::{StoreName, StoreQuery};
use brickcast_volume::StoreHash;
use brickcast_volume::store::{Jail, Objects, Store, StoreError, StoreFolder};

use self::far::FarRoot;
pub use self::open::{OpenStore, Source, Sources};
use crate::config::DataRoot;
use crate::error::NodeError;

/// Folders between the root and a store, at most.
const MAX_DEPTH: u32 = 4;
/// Folders looked into by one scan, at most: a data root that is someone's home must not stall the node.
const MAX_FOLDERS: usize = 100_000;
/// A miss scans again, but not more often than this.
const SCAN_INTERVAL: Duration = Duration::from_secs(1);
/// The same of a server, where it takes a round trip for each folder and each store.
const FAR_SCAN_INTERVAL: Duration = Duration::from_secs(10);
/// A store that nobody has asked for in so long is closed.
const CLOSED_AFTER: Duration = Duration::from_secs(600);
/// Names listed in an error, at most.
const LISTED: usize = 20;

/// All stores of a node.
#[derive(Debug)]
pub struct Stores {
    place: Place,
    /// Decoded chunks of arrays that views are of, bytes for each.
    room: u64,
    index: Mutex<Index>,
    /// Held while the disk is looked at, which may take long; the index is not.
    scanning: Mutex<()>,
}

#[derive(Debug)]
enum Place {
    Root(Jail),
    /// Named by whoever runs the node, links and all.
    Single {
        name: String,
        folder: StoreFolder,
    },
    /// Behind a network.
    Far(FarRoot),
}

#[derive(Debug, Default)]
struct Index {
    /// By name, which is the path below the root.
    found: Vec<StoreName>,
    open: HashMap<StoreHash, Kept>,
    scanned: Option<Instant>,
    /// Coarser levels, and the stores that have them.
    levels: HashMap<StoreHash, Level>,
    /// Stores whose levels were looked for.
    read: HashSet<StoreHash>,
}

impl Index {
    /// Two stores may have the same level: when one goes, the other is to be asked again.
    fn forget_levels(&mut self) {
        self.levels.clear();
        self.read.clear();
    }
}

/// A level of detail, which is a store within another.
#[derive(Debug, Clone)]
struct Level {
    /// The store that has it, by its name and its hash.
    of: StoreName,
    level: u8,
}

/// An open store, and when it was last asked for.
#[derive(Debug)]
struct Kept {
    store: Arc<OpenStore>,
    used: Instant,
}

impl Stores {
    /// # Errors
    /// A data root that is not a folder.
    pub fn new(data: &DataRoot) -> Result<Self, NodeError> {
        let (DataRoot::Folder(path) | DataRoot::Single(path)) = data;
        let path = match brickcast_remote::Place::of(path)? {
            brickcast_remote::Place::Folder(path) => path,
            brickcast_remote::Place::Far(root) => {
                let far = FarRoot::new(root, matches!(data, DataRoot::Single(_)));
                return Ok(Self::at(Place::Far(far)));
            }
        };
        let fail = |source| NodeError::DataRoot { path: path.clone(), source };
        let place = match data {
            DataRoot::Folder(_) => Place::Root(Jail::new(&path).map_err(fail)?),
            DataRoot::Single(_) => {
                let path = path.canonicalize().map_err(fail)?;
                std::fs::read_dir(&path).map_err(fail)?;
                let name = path.file_name().map_or_else(|| "store".to_owned(), |n| n.to_string_lossy().into_owned());
                Place::Single { name, folder: StoreFolder::free(&path) }
            }
        };
        Ok(Self::at(place))
    }

    fn at(place: Place) -> Self {
        Self { place, room: 0, index: Mutex::default(), scanning: Mutex::default() }
    }

    /// What is there, by name.
    #[must_use]
    pub fn list(&self) -> Vec<StoreName> {
        self.scan();
        self.lock().found.clone()
    }

    /// # Errors
    /// An unknown hash (listing what is there), a store that does not open.
    pub fn by_hash(&self, hash: StoreHash) -> Result<Arc<OpenStore>, NodeError> {
        if let Some(open) = self.known(hash) {
            return Ok(open);
        }
        let find = || self.lock().found.iter().find(|name| name.hash == hash).cloned();
        let Some(name) = find().or_else(|| {
            self.scan();
            find()
        }) else {
            return self.level(hash);
        };
        let folder = self.folder(&name.name)?;
        let open = self.open(name.name, folder)?;
        if open.store.hash() != hash {
            self.forget(hash);
            return Err(NodeError::OtherContent { name: open.name.clone(), got: open.store.hash(), want: hash });
        }
        Ok(open)
    }

    /// A level of a store by its own hash, which the store's manifest names. They are not listed: whoever wants one
    /// knows its store.
    fn level(&self, hash: StoreHash) -> Result<Arc<OpenStore>, NodeError> {
        let unknown = || NodeError::UnknownStore { hash, there: self.listing() };
        let Level { of: StoreName { name, hash: root }, level } = self.find_level(hash).ok_or_else(unknown)?;
        let store = self.opened(&name, self.folder(&name)?)?;
        if store.hash() != root {
            self.forget(root);
            return Err(NodeError::OtherContent { name, got: store.hash(), want: root });
        }
        let of_level = store.level(level).filter(|of_level| of_level.hash() == hash).cloned().ok_or_else(unknown)?;
        let coarser = store.level(level.saturating_add(1)).map(Store::hash);
        Ok(self.keep(format!("{name}, level {level}"), of_level, coarser))
    }

    /// The next coarser level of a store.
    ///
    /// # Errors
    /// As [`Stores::by_hash`]; a store that has none.
    pub fn coarser(&self, store: &OpenStore) -> Result<Arc<OpenStore>, NodeError> {
        let none = || NodeError::NoCoarserLevel { name: store.name.clone() };
        self.by_hash(store.coarser.ok_or_else(none)?)
    }

    /// Where a level is: among those that are known, or of stores that were not asked yet.
    fn find_level(&self, hash: StoreHash) -> Option<Level> {
        let new: Vec<StoreName> = {
            let index = self.lock();
            if let Some(known) = index.levels.get(&hash) {
                return Some(known.clone());
            }
            index.found.iter().filter(|name| !index.read.contains(&name.hash)).cloned().collect()
        };
        for name in new {
            let manifest = self.folder(&name.name).ok().map(|folder| folder.manifest());
            let mut index = self.lock();
            index.read.insert(name.hash);
            let levels = manifest.and_then(Result::ok).map(|manifest| manifest.levels).unwrap_or_default();
            for (level, entry) in (1..).zip(levels) {
                index.levels.insert(entry.hash.into(), Level { of: name.clone(), level });
            }
        }
        self.lock().levels.get(&hash).cloned()
    }

    /// # Errors
    /// As [`Stores::by_hash`]; a name that leads outside the root; a name whose store has another hash than expected.
    pub fn query(&self, query: &StoreQuery) -> Result<Arc<OpenStore>, NodeError> {
        let (name, expected) = match query {
            StoreQuery::Hash(hash) => return self.by_hash(*hash),
            StoreQuery::Name { name, expected } => (name, expected),
        };
        let folder = self.resolve(name)?;
        let hash = match folder.manifest_hash() {
            Ok(hash) => hash,
            Err(error @ StoreError::Outside { .. }) => return Err(NodeError::of_store(name, error)),
            // A server that is gone, or refuses, says nothing of what it has.
            Err(error) if matches!(self.place, Place::Far(_)) && !error.is_missing() => {
                return Err(NodeError::of_store(name, error));
            }
            Err(_) => {
                self.scan();
                return Err(NodeError::UnknownName { name: name.clone(), there: self.listing() });
            }
        };
        if let Some(want) = *expected
            && want != hash
        {
            return Err(NodeError::OtherContent { name: name.clone(), got: hash, want });
        }
        let open = match self.known(hash) {
            Some(open) => open,
            None => self.open(name.clone(), folder)?,
        };
        if let Place::Far(far) = &self.place
            && !far.is_listed()
        {
            // The server does not tell what it has: what was asked for is what is known of it.
            let found = &mut self.lock().found;
            found.retain(|known| known.name != *name);
            found.push(StoreName { name: name.clone(), hash });
        }
        Ok(open)
    }

    /// Closes a store that turned out to be broken: the next order looks at the disk again.
    pub fn forget(&self, hash: StoreHash) {
        let mut index = self.lock();
        index.open.remove(&hash);
        // Of a level: its store.
        let root = index.levels.get(&hash).map_or(hash, |level| level.of.hash);
        index.found.retain(|name| name.hash != root);
        index.forget_levels();
    }

    /// An open store, if it is. Closes those that nobody has asked for in a while.
    fn known(&self, hash: StoreHash) -> Option<Arc<OpenStore>> {
        let mut index = self.lock();
        let now = Instant::now();
        index.open.retain(|other, kept| {
            let is_used = Arc::strong_count(&kept.store) > 1;
            *other == hash || is_used || now.duration_since(kept.used) < CLOSED_AFTER
        });
        let kept = index.open.get_mut(&hash)?;
        kept.used = now;
        Some(kept.store.clone())
    }

    fn open(&self, name: String, objects: Arc<dyn Objects>) -> Result<Arc<OpenStore>, NodeError> {
        let store = self.opened(&name, objects)?;
        let coarser = store.level(1).map(Store::hash);
        Ok(self.keep(name, store, coarser))
    }

    /// Keeps a store open; the one that is open already, where somebody was faster.
    fn keep(&self, name: String, store: Store, coarser: Option<StoreHash>) -> Arc<OpenStore> {
        let store = Arc::new(OpenStore { name, store: Arc::new(store), coarser });
        let hash = store.store.hash();
        let opened = match self.lock().open.entry(hash) {
            Entry::Occupied(kept) => return kept.get().store.clone(),
            Entry::Vacant(place) => place.insert(Kept { store, used: Instant::now() }).store.clone(),
        };
        tracing::info!(store = opened.name, %hash, "store opened");
        opened
    }

    /// The folder of a store, or what is one behind a network.
    fn folder(&self, name: &str) -> Result<Arc<dyn Objects>, NodeError> {
        Ok(match &self.place {
            Place::Root(jail) => Arc::new(jail.folder(Path::new(name))),
            Place::Single { folder, .. } => Arc::new(folder.clone()),
            Place::Far(far) => far.store(name).map_err(|why| bad_name(name, why))?,
        })
    }

    /// The folder that `name` means. Whether there is one is not looked at, only that it is not outside the root.
    fn resolve(&self, name: &str) -> Result<Arc<dyn Objects>, NodeError> {
        let bad = |why| bad_name(name, why);
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
        match &self.place {
            Place::Single { name: single, .. } if single != name => {
                Err(NodeError::UnknownName { name: name.to_owned(), there: format!("there is only `{single}`") })
            }
            Place::Root(jail) if matches!(jail.subfolders(path), Err(StoreError::Outside { .. })) => {
                Err(bad("leads outside the data root"))
            }
            _ => self.folder(name),
        }
    }

    /// Looks at the disk, if that was not done a moment ago. Who comes meanwhile waits for what is found; who needs
    /// nothing new does not.
    fn scan(&self) {
        let _scanning = self.scanning.lock().unwrap_or_else(PoisonError::into_inner);
        let interval = if matches!(self.place, Place::Far(_)) { FAR_SCAN_INTERVAL } else { SCAN_INTERVAL };
        if self.lock().scanned.is_some_and(|at| at.elapsed() < interval) {
            return;
        }
        let mut found = Vec::new();
        match &self.place {
            Place::Root(jail) => scan_folder(jail, "", 0, &mut { MAX_FOLDERS }, &mut found),
            Place::Single { name, folder } => {
                found.extend(folder.manifest_hash().ok().map(|hash| StoreName { name: name.clone(), hash }));
            }
            Place::Far(far) => {
                let known = self.lock().found.clone();
                found = far.scan(known);
            }
        }
        found.sort_by(|a, b| a.name.cmp(&b.name));
        let mut index = self.lock();
        if index.found != found {
            index.forget_levels();
        }
        index.found = found;
        index.scanned = Some(Instant::now());
    }

    /// What is there, for people.
    fn listing(&self) -> String {
        match &self.place {
            Place::Far(far) if !far.is_listed() && self.lock().found.is_empty() => {
                "the node's --data is a server that does not tell which stores it has: name one by its path below it"
                    .to_owned()
            }
            _ => listing(&self.lock()),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Index> {
        self.index.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Adds the stores at and below the folder `name`. Links are followed where they stay inside.
fn scan_folder(jail: &Jail, name: &str, depth: u32, folders: &mut usize, found: &mut Vec<StoreName>) {
    if *folders == 0 || found.len() >= brickcast_proto::cluster::MAX_STORES {
        return;
    }
    let Ok(entries) = jail.subfolders(Path::new(name)) else { return };
    *folders -= 1;
    if depth > 0
        && let Ok(hash) = jail.folder(Path::new(name)).manifest_hash()
    {
        found.push(StoreName { name: name.to_owned(), hash });
        return;
    }
    if depth == MAX_DEPTH {
        return;
    }
    for entry in entries {
        // Stores that are being written have hidden names; a name must travel as text.
        let Some(text) = entry.to_str().filter(|t| !t.starts_with('.')) else { continue };
        let name = if name.is_empty() { text.to_owned() } else { format!("{name}/{text}") };
        scan_folder(jail, &name, depth + 1, folders, found);
    }
}

/// A name as it came, with why it is none.
fn bad_name(name: &str, why: &'static str) -> NodeError {
    NodeError::BadName { name: brickcast_proto::convert::clip(name, 256), why }
}

fn listing(index: &Index) -> String {
    if index.found.is_empty() {
        return "there is no store below the node's --data at all".to_owned();
    }
    let mut names: Vec<String> =
        index.found.iter().take(LISTED).map(|s| format!("`{}` ({})", s.name, s.hash)).collect();
    if index.found.len() > LISTED {
        names.push(format!("and {} more", index.found.len() - LISTED));
    }
    format!("there are {}", names.join(", "))
}

#[cfg(test)]
mod tests;
