//! Everything that is wrong with a store's folder: what is broken, what is missing, and what the manifest does not
//! name.

use std::path::Path;
use std::sync::Arc;

use super::store::Store;
use crate::ids::StoreHash;
use crate::store::error::StoreError;
use crate::store::files::shape::{SmallFile, StoreShape, small_files};
use crate::store::files::walk::Found;
use crate::store::halo::bound::RecordBound;
use crate::store::halo::reach::{REGION_HALO, VOXEL_HALO};
use crate::store::halo::read::Halos;
use crate::store::halo::regions as halo_regions;
use crate::store::lacking::Lacking;
use crate::store::level::{LevelArray, key_on};
use crate::store::manifest::Manifest;
use crate::store::objects::Objects;
use crate::store::objects::folder::StoreFolder;
use crate::store::objects::level::objects_of_level;
use crate::store::profile::{
    DISTANCE_SHARDS_FILE, HALO_INDEX_FILE, HALOS_FILE, LABEL_SHARDS_FILE, MANIFEST_FILE, REGION_HALO_INDEX_FILE,
    REGION_HALOS_FILE, SHARDS_FILE, StoreArray,
};
use crate::store::progress::{Phase, Progress};
use crate::store::shard::grid::ShardGrid;
use crate::store::shard::open::described_shards;
use crate::store::shard::read::Shards;
use crate::store::shard::tail::TailLayout;

/// What is wrong with a part of a store.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FaultKind {
    /// Its bytes are not those that the manifest promises.
    Broken,
    Missing,
    /// The manifest does not name it.
    Foreign,
}

impl FaultKind {
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Broken => "broken",
            Self::Missing => "missing",
            Self::Foreign => "foreign",
        }
    }
}

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    pub kind: FaultKind,
    /// The file's path below the store; a folder's ends with `/`.
    pub file: String,
    /// In words, with the part of the file where only a part is broken.
    pub what: String,
}

/// What was found in a store's folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Inspected {
    pub hash: StoreHash,
    /// Of the format; nothing where the manifest is broken.
    pub version: Option<u64>,
    /// Of the store's own files that are there.
    pub bytes: u64,
    /// True where the checksums of inner chunks are bound to the manifest: a read notices a part of another store.
    pub binds_chunks: bool,
    /// In the order in which they were found.
    pub faults: Vec<Fault>,
}

/// Reads everything in the store at `path` once.
///
/// # Errors
/// There is no store of ours, or its folder cannot be listed.
pub fn inspect(path: &Path, progress: &mut dyn FnMut(Progress)) -> Result<Inspected, StoreError> {
    inspect_objects(Arc::new(StoreFolder::free(path)), Some(path), progress)
}

/// The same, wherever the store's objects are kept: everything that the manifest names. What it does not name is looked
/// for in `folder`.
///
/// # Errors
/// There is no store of ours; a folder that cannot be listed.
pub fn inspect_objects(
    objects: Arc<dyn Objects>,
    folder: Option<&Path>,
    progress: &mut dyn FnMut(Progress),
) -> Result<Inspected, StoreError> {
    let bytes = match objects.read_at_most(MANIFEST_FILE, Manifest::MAX_BYTES + 1) {
        Err(error) if is_missing(&error) => return Err(StoreError::NotAStore { path: objects.place().to_path_buf() }),
        read => read?,
    };
    let mut inspection =
        Inspection { objects: objects.clone(), level: 0, faults: Vec::new(), progress, done: 0, total: 0 };
    let manifest = Manifest::from_bytes(&bytes);
    let shape = manifest.as_ref().map_or_else(|_| StoreShape::any(), StoreShape::of);
    let (foreign, total) = match folder {
        Some(folder) => Found::below(folder, &shape).map(|found| (found.foreign, found.bytes))?,
        None => (Vec::new(), Store::open_objects(objects.clone()).map_or(0, |store| store.promised_bytes())),
    };
    inspection.total = total;
    match &manifest {
        Ok(manifest) => {
            inspection.all_of(manifest)?;
            inspection.levels_of(manifest)?;
        }
        Err(error) => inspection.push(FaultKind::Broken, MANIFEST_FILE, error),
    }
    for name in &foreign {
        inspection.push(FaultKind::Foreign, name, &"the manifest does not name it");
    }
    let version = manifest.as_ref().ok().map(|m| m.version);
    let binds_chunks = version.is_some_and(|v| TailLayout::of_version(v) == TailLayout::SumsAndIndex);
    let Inspection { mut faults, .. } = inspection;
    if let (true, Err(error)) = (faults.is_empty(), Store::open_objects(objects)) {
        // All bytes are as promised, and what they say cannot be: a program at fault wrote them.
        faults.push(Fault { kind: FaultKind::Broken, file: MANIFEST_FILE.to_owned(), what: error.to_string() });
    }
    Ok(Inspected { hash: StoreHash::of(&bytes), version, bytes: total, binds_chunks, faults })
}

struct Inspection<'a> {
    /// Of the level that is looked at.
    objects: Arc<dyn Objects>,
    level: u8,
    faults: Vec<Fault>,
    progress: &'a mut dyn FnMut(Progress),
    done: u64,
    total: u64,
}

impl Inspection<'_> {
    /// The coarser levels. Where a level's manifest is broken, nothing is known of its other files.
    fn levels_of(&mut self, manifest: &Manifest) -> Result<(), StoreError> {
        let store = self.objects.clone();
        for (level, entry) in (1..).zip(&manifest.levels) {
            (self.objects, self.level) = (objects_of_level(&store, level), level);
            let read = self.objects.check_file(MANIFEST_FILE, Manifest::MAX_BYTES + 1, entry.hash);
            let read = read.and_then(|()| self.objects.read_at_most(MANIFEST_FILE, Manifest::MAX_BYTES + 1));
            match read.and_then(|bytes| Ok((bytes.len(), manifest.level_from_bytes(level, &bytes)?))) {
                Ok((bytes, of_level)) => {
                    self.read(bytes as u64);
                    self.all_of(&of_level)?;
                }
                Err(error) => self.error(MANIFEST_FILE, &error),
            }
        }
        (self.objects, self.level) = (store, 0);
        Ok(())
    }

    /// One level.
    fn all_of(&mut self, manifest: &Manifest) -> Result<(), StoreError> {
        let grid = ShardGrid::new(manifest.geometry.dims())?;
        let small = small_files(manifest);
        let whole: Vec<&str> = small.iter().filter(|file| self.small(file)).map(|f| &*f.name).collect();
        let layout = TailLayout::of_version(manifest.version);
        let mut arrays = vec![(StoreArray::Voxels, (SHARDS_FILE, manifest.files.shards), manifest.stored_type.bytes())];
        if let Some(regions) = &manifest.regions {
            let files = &regions.files;
            arrays.push((StoreArray::Labels, (LABEL_SHARDS_FILE, files.label_shards), size_of::<u32>()));
            arrays.push((StoreArray::Distances, (DISTANCE_SHARDS_FILE, files.distance_shards), size_of::<u8>()));
        }
        for (array, (table, hash), voxel_bytes) in arrays {
            if !whole.contains(&table) {
                self.presence_of_shards(array, grid);
                continue;
            }
            let on_level = LevelArray { array, level: self.level };
            match described_shards(&self.objects, on_level, grid, (table, hash, layout), voxel_bytes) {
                Ok(shards) => self.shards(&shards),
                Err(error) => self.error(table, &error),
            }
        }
        let Some(halo) = manifest.halo else { return Ok(()) };
        let voxels = RecordBound { head: 0, per_voxel: manifest.stored_type.bytes() as u64 };
        let files = [
            Some((VOXEL_HALO, (HALOS_FILE, HALO_INDEX_FILE, halo.voxels), voxels)),
            halo.regions.map(|r| (REGION_HALO, (REGION_HALOS_FILE, REGION_HALO_INDEX_FILE, r), halo_regions::BOUND)),
        ];
        for (reach, (file, index, hashes), bound) in files.into_iter().flatten() {
            if !whole.contains(&index) {
                self.presence(file);
                continue;
            }
            let mut lacking = Lacking::default();
            let opened = Halos::open(&self.objects, manifest.grid, reach, (file, index, hashes), bound, &mut lacking);
            match lacking.0.map_or(opened, Err) {
                Ok(halos) => {
                    let file = key_on(self.level, halos.file());
                    self.faults.extend(halos.faults().iter().map(|error| fault(&file, error)));
                    self.read(halos.bytes());
                }
                Err(error) => self.error(file, &error),
            }
        }
        Ok(())
    }

    /// True where it is as the manifest has it.
    fn small(&mut self, file: &SmallFile) -> bool {
        let checked = self.objects.check_file(&file.name, file.bytes + 1, file.hash);
        self.read(file.bytes);
        checked.map_err(|error| self.error(&file.name, &error)).is_ok()
    }

    fn shards(&mut self, shards: &Shards) {
        for (linear, record) in shards.table.iter().enumerate() {
            let shard = shards.grid.at(linear);
            let file = shards.array.shard(shard);
            self.faults.extend(shards.faults(shard).iter().map(|error| fault(&file, error)));
            self.read(record.bytes);
        }
    }

    /// Without their table nothing is known of shards but that they must be there.
    fn presence_of_shards(&mut self, array: StoreArray, grid: ShardGrid) {
        for linear in 0..grid.count() as usize {
            self.presence(&grid.at(linear).path(array));
        }
    }

    fn presence(&mut self, file: &str) {
        if let Err(error) = self.objects.open(file) {
            self.error(file, &error);
        }
    }

    fn read(&mut self, bytes: u64) {
        self.done = (self.done + bytes).min(self.total);
        (self.progress)(Progress { phase: Phase::Verify, done: self.done, total: self.total });
    }

    /// `file` is its key on the level.
    fn error(&mut self, file: &str, error: &StoreError) {
        self.faults.push(fault(&key_on(self.level, file), error));
    }

    fn push(&mut self, kind: FaultKind, file: &str, what: &dyn std::fmt::Display) {
        self.faults.push(Fault { kind, file: file.to_owned(), what: what.to_string() });
    }
}

pub(crate) fn fault(file: &str, error: &StoreError) -> Fault {
    let kind = if is_missing(error) { FaultKind::Missing } else { FaultKind::Broken };
    Fault { kind, file: file.to_owned(), what: error.to_string() }
}

fn is_missing(error: &StoreError) -> bool {
    error.is_missing() || matches!(error, StoreError::ShardMissing { .. } | StoreError::NotAStore { .. })
}
