//! A series: stores of one volume at several times, its steps, in one folder (docs/adr/0024-time.md).
//!
//! The invariant: *the series' manifest names the hash of every step's manifest, so that the hash of a series fixes
//! every byte of all its steps; and all steps have one geometry, one cut into bricks and levels, and one map from
//! stored numbers to values*.

mod alike;
pub(super) mod inspect;
mod make;
mod objects;

use std::path::Path;
use std::sync::Arc;

use crate::ids::StoreHash;
use crate::store::error::StoreError;
use crate::store::manifest::Manifest;
use crate::store::objects::Objects;
use crate::store::objects::folder::StoreFolder;
use crate::store::profile::{GROUP_FILE, SERIES_FILE, SERIES_LIST_FILE};
use crate::store::read::store::Store;
use crate::store::series_manifest::SeriesManifest;
use objects::StepObjects;

pub use alike::check_alike;
pub use make::{SeriesSummary, SeriesWriter};

/// A series that was found; its steps are opened one by one.
#[derive(Debug, Clone)]
pub struct Series {
    objects: Arc<dyn Objects>,
    hash: StoreHash,
    manifest: SeriesManifest,
}

impl Series {
    /// The series at the root of `objects`; nothing where there is none.
    ///
    /// # Errors
    /// A manifest that is broken or cannot be read; other files of the series' own that are not those it names.
    pub fn find(objects: Arc<dyn Objects>) -> Result<Option<Self>, StoreError> {
        let bytes = match objects.read_at_most(SERIES_FILE, SeriesManifest::MAX_BYTES + 1) {
            Err(error) if error.is_missing() => return Ok(None),
            read => read?,
        };
        let manifest = SeriesManifest::from_bytes(&bytes)?;
        for (name, want) in [GROUP_FILE, SERIES_LIST_FILE].into_iter().zip(manifest.files) {
            objects.check_file(name, Manifest::MAX_BYTES, want)?;
        }
        Ok(Some(Self::of(objects, StoreHash::of(&bytes), manifest)))
    }

    fn of(objects: Arc<dyn Objects>, hash: StoreHash, manifest: SeriesManifest) -> Self {
        Self { objects, hash, manifest }
    }

    /// As [`Series::find`], in a folder of this machine.
    ///
    /// # Errors
    /// As [`Series::find`].
    pub fn find_in(folder: &Path) -> Result<Option<Self>, StoreError> {
        Self::find(Arc::new(StoreFolder::free(folder)))
    }

    #[must_use]
    pub fn manifest(&self) -> &SeriesManifest {
        &self.manifest
    }

    /// Of the manifest, and so of all steps.
    #[must_use]
    pub fn hash(&self) -> StoreHash {
        self.hash
    }

    #[must_use]
    pub fn is_far(&self) -> bool {
        self.objects.is_far()
    }

    /// Where it is kept, for messages.
    #[must_use]
    pub fn place(&self) -> &Path {
        self.objects.place()
    }

    /// The step that is the store of this hash.
    #[must_use]
    pub fn step_of(&self, hash: StoreHash) -> Option<usize> {
        self.manifest.steps.iter().position(|step| step.hash == hash)
    }

    /// The objects of a step, as those of a store.
    #[must_use]
    pub fn objects_of(&self, step: usize) -> Arc<dyn Objects> {
        Arc::new(StepObjects::new(self.objects.clone(), step))
    }

    /// Opens a step.
    ///
    /// # Errors
    /// As [`Store::open_objects`]; a store that is another one than the series names.
    pub fn open_step(&self, step: usize) -> Result<Store, StoreError> {
        let store = Store::open_objects(self.objects_of(step)).map_err(|error| error.of_step(step))?;
        match self.manifest.steps.get(step) {
            Some(entry) if entry.hash != store.hash() => {
                Err(StoreError::OtherStep { step, got: store.hash(), want: entry.hash })
            }
            _ => Ok(store),
        }
    }

    /// What to say where a series was given for a store.
    #[must_use]
    pub fn words(&self) -> String {
        let (name, count) = (self.place().display(), self.manifest.steps.len());
        format!("{name} is a series of {count} steps, each of which is a store: name one, {name}/0")
    }
}
