//! Stores behind a network: what a server has, and how many reads of them are under way at a time.

use std::cell::Cell;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use brickcast_proto::StoreName;
use brickcast_proto::cluster::MAX_STORES;
use brickcast_remote::{Root, is_address};
use brickcast_volume::store::{Objects, StoreError};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::MAX_DEPTH;

/// Folders that one scan asks a server for, at most.
const MAX_FOLDERS: usize = 2000;
/// Bricks that are read at a time: each waits for the network most of its time.
pub(crate) const READERS: usize = 32;
/// What says that a folder is an array of somebody else, or a part of one: no store of ours lies below.
const FOREIGN: [&str; 4] = ["zarr.json", ".zgroup", ".zarray", ".zattrs"];
/// ... but for the steps of a series of ours.
const SERIES_FILE: &str = brickcast_volume::store::SERIES_FILE;
const MANIFEST: &str = brickcast_volume::store::MANIFEST_FILE;

/// A data root on a server.
#[derive(Debug)]
pub(super) struct FarRoot {
    root: Root,
    /// True where the root is a store itself; nothing as long as the server did not say.
    is_store: OnceLock<bool>,
}

impl FarRoot {
    /// `is_store` where it is known to be one.
    pub(super) fn new(root: Root, is_store: bool) -> Self {
        let known = if is_store { OnceLock::from(true) } else { OnceLock::new() };
        Self { root, is_store: known }
    }

    /// True where the server tells what it has.
    pub(super) fn is_listed(&self) -> bool {
        self.root.address().is_listed() || self.is_store()
    }

    /// The store of this name, or at this address, whether or not there is one.
    ///
    /// # Errors
    /// Why it is no name below the root.
    pub(super) fn store(&self, name: &str) -> Result<Arc<dyn Objects>, &'static str> {
        let address = self.root.address().to_string();
        let below = match name.strip_prefix(&address) {
            Some("") => return Ok(Arc::new(self.root.itself())),
            Some(rest) => rest.strip_prefix('/').ok_or("lies elsewhere than the data root")?,
            None if is_address(Path::new(name)) => return Err("lies elsewhere than the data root"),
            None => name,
        };
        Ok(Arc::new(match below == self.root.address().name() && self.is_store() {
            true => self.root.itself(),
            false => self.root.store(below)?,
        }))
    }

    pub(super) fn root(&self) -> &Root {
        &self.root
    }

    pub(super) fn is_store(&self) -> bool {
        if let Some(is_store) = self.is_store.get() {
            return *is_store;
        }
        match (&self.root.itself() as &dyn Objects).manifest_hash() {
            Ok(_) => *self.is_store.get_or_init(|| true),
            Err(error) if error.is_missing() => *self.is_store.get_or_init(|| false),
            // Not reached: perhaps later.
            Err(_) => false,
        }
    }

    /// What is there; what was known before where the server does not tell.
    pub(super) fn scan(&self, known: Vec<StoreName>) -> Vec<StoreName> {
        if self.is_store() {
            let name = self.root.address().name().to_owned();
            let hash = (&self.root.itself() as &dyn Objects).manifest_hash();
            return hash.map_or(known, |hash| vec![StoreName { name, hash }]);
        }
        if !self.root.address().is_listed() {
            return known;
        }
        let budget = AtomicUsize::new(MAX_FOLDERS);
        match at_once(|| self.below("", 0, &budget)) {
            Ok(mut found) => {
                found.truncate(MAX_STORES);
                found
            }
            Err(error) => {
                tracing::warn!("what lies below --data is not looked at anew: {error}");
                known
            }
        }
    }

    fn below(&self, name: &str, depth: u32, budget: &AtomicUsize) -> Result<Vec<StoreName>, StoreError> {
        let is_over = budget.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_err();
        let listing = if is_over { None } else { self.root.list(name)? };
        let Some(listing) = listing else { return Ok(Vec::new()) };
        if listing.is_cut {
            tracing::warn!("{name:?} below --data holds more than is looked at; stores in it are found by their names");
        }
        let has = |file: &str| listing.files.iter().any(|there| there == file);
        if depth > 0 && has(MANIFEST) {
            let objects = self.root.store(name).ok();
            let hash = objects.and_then(|objects| (&objects as &dyn Objects).manifest_hash().ok());
            return Ok(hash.map(|hash| StoreName { name: name.to_owned(), hash }).into_iter().collect());
        }
        if depth == MAX_DEPTH || (FOREIGN.iter().any(|file| has(file)) && !has(SERIES_FILE)) {
            return Ok(Vec::new());
        }
        let names = listing.folders.into_par_iter().filter(|folder| !folder.starts_with('.'));
        let below = names.map(|folder| {
            let name = if name.is_empty() { folder } else { format!("{name}/{folder}") };
            self.below(&name, depth + 1, budget)
        });
        Ok(below.collect::<Result<Vec<_>, _>>()?.concat())
    }
}

thread_local! {
    /// What this thread asks for lies behind a network.
    static IS_FAR: Cell<bool> = const { Cell::new(false) };
}

/// Runs what loads bricks; within it, in this thread, [`readers`] are there where `is_far`.
pub(crate) fn reading<T>(is_far: bool, work: impl FnOnce() -> T) -> T {
    let before = IS_FAR.replace(is_far);
    let done = work();
    IS_FAR.set(before);
    done
}

/// More threads than there are processors, for reads that wait for a network; none elsewhere. Never for work that waits
/// for other such work: a thread of the pool that waits for its part takes up another one's.
pub(crate) fn readers() -> Option<&'static ThreadPool> {
    IS_FAR.get().then(pool).flatten()
}

fn pool() -> Option<&'static ThreadPool> {
    static POOL: OnceLock<Option<ThreadPool>> = OnceLock::new();
    let new = || ThreadPoolBuilder::new().num_threads(READERS).thread_name(|i| format!("far-{i}")).build().ok();
    POOL.get_or_init(new).as_ref()
}

/// As [`readers`], whatever this thread asks for.
fn at_once<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match pool() {
        Some(pool) => pool.install(work),
        None => work(),
    }
}
