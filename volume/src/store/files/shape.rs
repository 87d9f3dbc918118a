//! Which files and folders a store has: what else lies in its folder is not the store's.

use std::borrow::Cow;
use std::path::Path;

use bytes::Bytes;
use glam::UVec3;

use crate::store::cell_ranges::cells_of;
use crate::store::halo::index::ENTRY_BYTES;
use crate::store::halo::reach::{REGION_HALO, VOXEL_HALO};
use crate::store::hash::ContentHash;
use crate::store::level::{LevelArray, MAX_COARSER, SHARED_FILES, key_on};
use crate::store::manifest::Manifest;
use crate::store::manifest::file as manifest_file;
use crate::store::objects::Objects;
use crate::store::objects::folder::StoreFolder;
use crate::store::profile::{
    ARRAY_FILE, CELLS_FILE, DISTANCE_ARRAY_FILE, DISTANCE_SHARDS_FILE, GROUP_FILE, HALO_INDEX_FILE, HALOS_FILE,
    LABEL_ARRAY_FILE, LABEL_IMAGE_FILE, LABEL_SHARDS_FILE, LABELS_GROUP_FILE, MANIFEST_FILE, MEANS_FILE, PART_FILE,
    RANGES_FILE, REGION_BRICKS_FILE, REGION_HALO_INDEX_FILE, REGION_HALOS_FILE, REGIONS_FILE, SEAM_FILE, SERIES_FILE,
    SERIES_LIST_FILE, SHARD_EDGE, SHARDS_FILE, STATISTICS_FILE, ShardIndex, StoreArray, VIEW_FILE, gathered_file,
    tables_file,
};
use crate::store::regions::facts_table::{FACTS_BYTES, REGION_BYTES};
use crate::store::series_manifest::{MAX_STEPS, SeriesManifest, file as series_file};
use crate::store::shard::table::RECORD_BYTES;

/// A file that is read whole, with its length and hash as the manifest has them.
#[derive(Debug, Clone)]
pub(crate) struct SmallFile {
    /// Its key on the level.
    pub(crate) name: Cow<'static, str>,
    /// The most that it can have.
    pub(crate) bytes: u64,
    pub(crate) hash: ContentHash,
}

/// All files of a level's own but its manifest, shards and records of halos.
pub(crate) fn small_files(manifest: &Manifest) -> Vec<SmallFile> {
    let file = |name: &'static str, bytes, hash| SmallFile { name: name.into(), bytes, hash };
    let bricks = manifest.grid.brick_count();
    let table =
        manifest.geometry.dims().map(|n| n.div_ceil(SHARD_EDGE)).as_u64vec3().element_product() * RECORD_BYTES as u64;
    let f = &manifest.files;
    let mut files = vec![
        file(GROUP_FILE, Manifest::MAX_BYTES, f.group),
        file(ARRAY_FILE, Manifest::MAX_BYTES, f.array),
        file(RANGES_FILE, bricks * 4, f.ranges),
        file(SHARDS_FILE, table, f.shards),
    ];
    let cells = cells_of(manifest.geometry.dims(), manifest.level).count() * 4;
    files.extend(f.cells.map(|hash| file(CELLS_FILE, cells, hash)));
    files.extend(f.means.map(|hash| file(MEANS_FILE, cells, hash)));
    let index = |records: usize| bricks * (records * ENTRY_BYTES) as u64;
    if let Some(halo) = &manifest.halo {
        files.push(file(HALO_INDEX_FILE, index(VOXEL_HALO.records()), halo.voxels.index));
        files.extend(halo.regions.map(|r| file(REGION_HALO_INDEX_FILE, index(REGION_HALO.records()), r.index)));
    }
    if let Some(regions) = &manifest.regions {
        let f = &regions.files;
        files.extend([
            file(LABELS_GROUP_FILE, Manifest::MAX_BYTES, f.group),
            file(LABEL_IMAGE_FILE, Manifest::MAX_BYTES, f.image),
            file(LABEL_ARRAY_FILE, Manifest::MAX_BYTES, f.labels),
            file(DISTANCE_ARRAY_FILE, Manifest::MAX_BYTES, f.distances),
            file(REGIONS_FILE, u64::from(regions.count) * REGION_BYTES as u64, f.regions),
            file(REGION_BRICKS_FILE, bricks * FACTS_BYTES as u64, f.bricks),
            file(LABEL_SHARDS_FILE, table, f.label_shards),
            file(DISTANCE_SHARDS_FILE, table, f.distance_shards),
        ]);
    }
    if manifest.level > 0 {
        files.retain(|file| !SHARED_FILES.contains(&&*file.name));
    }
    files
}

/// The manifest's bytes in a folder of whoever runs the program, where there is a file of that name and of a manifest's
/// size.
fn read_free(folder: &Path, name: &str, most: u64) -> Option<Bytes> {
    StoreFolder::free(folder).open(name).and_then(|file| file.read_at_most(most + 1)).ok()
}

/// Where a store's files and folders may lie, or those of a series of stores.
#[derive(Debug, Clone, Default)]
pub(crate) struct StoreShape {
    files: Vec<Cow<'static, str>>,
    arrays: Vec<ShapeOfArray>,
    /// What lies in the folders of steps.
    steps: Steps,
}

#[derive(Debug, Clone, Default)]
enum Steps {
    /// It is a store.
    #[default]
    None,
    /// One shape for each step.
    Known(Vec<StoreShape>),
    /// Any number of steps, of any store's shape.
    Any(Box<StoreShape>),
}

#[derive(Debug, Clone)]
struct ShapeOfArray {
    /// Below the store.
    path: String,
    /// Shards per axis.
    shards: UVec3,
}

impl StoreShape {
    /// Of the one store that `manifest` speaks of.
    pub(crate) fn of(manifest: &Manifest) -> Self {
        let mut files: Vec<_> = small_files(manifest).into_iter().map(|f| f.name).collect();
        files.push(MANIFEST_FILE.into());
        if let Some(halo) = &manifest.halo {
            files.push(HALOS_FILE.into());
            files.extend(halo.regions.map(|_| Cow::from(REGION_HALOS_FILE)));
        }
        let mut arrays = vec![StoreArray::Voxels];
        if manifest.regions.is_some() {
            arrays.extend([StoreArray::Labels, StoreArray::Distances]);
        }
        let dims = std::iter::once(manifest.geometry.dims()).chain(manifest.levels.iter().map(|level| level.dims));
        let mut shape = Self::on_levels(&files, &arrays, dims.map(|dims| dims.map(|n| n.div_ceil(SHARD_EDGE))));
        shape.files.push(VIEW_FILE.into());
        shape
    }

    /// The files and arrays of a store on its levels, which have so many `shards` per axis: all levels have the same.
    fn on_levels(files: &[Cow<'static, str>], arrays: &[StoreArray], shards: impl Iterator<Item = UVec3>) -> Self {
        let mut shape = Self::default();
        for (level, shards) in (0..).zip(shards) {
            let own = files.iter().filter(|file| level == 0 || !SHARED_FILES.contains(&&***file));
            shape.files.extend(own.map(|file| Cow::from(key_on(level, file).into_owned())));
            let path = |array| LevelArray { array, level }.to_string();
            shape.arrays.extend(arrays.iter().map(|array| ShapeOfArray { path: path(*array), shards }));
        }
        shape
    }

    /// Of any store of this or an earlier version (their files have the same names), or of a part of one, finished or
    /// not.
    pub(crate) fn any() -> Self {
        let files = [
            MANIFEST_FILE,
            GROUP_FILE,
            ARRAY_FILE,
            RANGES_FILE,
            SHARDS_FILE,
            CELLS_FILE,
            MEANS_FILE,
            HALOS_FILE,
            HALO_INDEX_FILE,
            REGION_HALOS_FILE,
            REGION_HALO_INDEX_FILE,
            LABELS_GROUP_FILE,
            LABEL_IMAGE_FILE,
            LABEL_ARRAY_FILE,
            DISTANCE_ARRAY_FILE,
            REGIONS_FILE,
            REGION_BRICKS_FILE,
            LABEL_SHARDS_FILE,
            DISTANCE_SHARDS_FILE,
        ];
        let arrays = [StoreArray::Voxels, StoreArray::Labels, StoreArray::Distances];
        let levels = usize::from(MAX_COARSER) + 1;
        let mut shape = Self::on_levels(&files.map(Cow::from), &arrays, std::iter::repeat_n(UVec3::MAX, levels));
        shape.files.extend([PART_FILE, STATISTICS_FILE, SEAM_FILE, VIEW_FILE].map(Cow::from));
        shape.files.extend((0..=MAX_COARSER).flat_map(|l| [tables_file(l), gathered_file(l)]).map(Cow::from));
        let step = Box::new(shape.clone());
        shape.files.extend([SERIES_FILE, SERIES_LIST_FILE].map(Cow::from));
        shape.steps = Steps::Any(step);
        shape
    }

    /// Of a series, whose steps lie in `folder`: what is there of each is as strict as its manifest allows.
    fn of_series(folder: &Path, steps: usize) -> Self {
        let step = |step: usize| Self::in_folder(&folder.join(step.to_string())).unwrap_or_else(Self::any);
        Self {
            files: [SERIES_FILE, GROUP_FILE, SERIES_LIST_FILE].map(Cow::from).into(),
            arrays: Vec::new(),
            steps: Steps::Known((0..steps).map(step).collect()),
        }
    }

    /// Of the series in `folder`, as far as there is one.
    fn of_series_in(folder: &Path) -> Option<Self> {
        let bytes = read_free(folder, SERIES_FILE, SeriesManifest::MAX_BYTES)?;
        series_file::is_ours(&bytes).then(|| {
            SeriesManifest::from_bytes(&bytes)
                .map_or_else(|_| Self::any(), |series| Self::of_series(folder, series.steps.len()))
        })
    }

    /// A path below a step's folder, and the shape of that store.
    fn in_step<'a>(&self, path: &'a str) -> Option<(&Self, &'a str)> {
        let (name, rest) = path.split_once('/').unwrap_or((path, ""));
        let step: usize = name.parse().ok().filter(|step: &usize| step.to_string() == name)?;
        let shape = match &self.steps {
            Steps::None => None,
            Steps::Known(steps) => steps.get(step),
            Steps::Any(shape) => (step < MAX_STEPS).then_some(&**shape),
        };
        shape.map(|shape| (shape, rest))
    }

    /// Of the store or the series in `folder`, as strictly as its manifest allows; nothing where that is no manifest of
    /// ours at all.
    pub(crate) fn in_folder(folder: &Path) -> Option<Self> {
        if let Some(series) = Self::of_series_in(folder) {
            return Some(series);
        }
        let bytes = read_free(folder, MANIFEST_FILE, Manifest::MAX_BYTES)?;
        let ours = manifest_file::is_ours(&bytes);
        ours.then(|| Manifest::from_bytes(&bytes).map_or_else(|_| Self::any(), |manifest| Self::of(&manifest)))
    }

    /// A small one, for tests.
    #[cfg(test)]
    pub(crate) fn small() -> Self {
        let files = [MANIFEST_FILE, LABEL_IMAGE_FILE].map(Cow::from);
        Self::on_levels(&files, &[StoreArray::Labels], [UVec3::new(2, 1, 11), UVec3::ONE].into_iter())
    }

    /// Every file that there may be; shards only where it is known how many.
    pub(crate) fn keys(&self) -> Vec<String> {
        let shards = self.arrays.iter().filter(|array| array.shards != UVec3::MAX).flat_map(|array| {
            let UVec3 { x, y, z } = array.shards;
            let row = move |z| (0..y).flat_map(move |y| (0..x).map(move |x| ShardIndex([x, y, z])));
            (0..z).flat_map(row).map(|shard| format!("{}/{}", array.path, shard.key()))
        });
        self.files.iter().map(|file| file.clone().into_owned()).chain(shards).collect()
    }

    /// `path` is below the store's folder, `/` between names.
    pub(crate) fn has_file(&self, path: &str) -> bool {
        self.files.iter().any(|file| file == path)
            || self.shard_part(path).is_some_and(|indices| indices == 3)
            || self.in_step(path).is_some_and(|(step, rest)| step.has_file(rest))
    }

    pub(crate) fn has_folder(&self, path: &str) -> bool {
        let within = |file: &str| file.strip_prefix(path).is_some_and(|rest| rest.starts_with('/'));
        let leads_to_array = self.arrays.iter().any(|array| array.path == path || within(&array.path));
        let leads_to_file = self.files.iter().any(|file| within(file));
        leads_to_array
            || leads_to_file
            || self.shard_part(path).is_some_and(|indices| indices < 3)
            || self.in_step(path).is_some_and(|(step, rest)| rest.is_empty() || step.has_folder(rest))
    }

    /// How many of a shard's three indices `path` has, where it is one of a shard or leads to one.
    fn shard_part(&self, path: &str) -> Option<usize> {
        let within = |array: &ShapeOfArray| Some((path.strip_prefix(&*array.path)?.strip_prefix("/c")?, array.shards));
        let (key, shards) = self.arrays.iter().find_map(within)?;
        let limits = [shards.z, shards.y, shards.x];
        let indices: Vec<&str> = key.strip_prefix('/').map_or(Vec::new(), |key| key.split('/').collect());
        let good =
            |(index, limit): (&&str, u32)| index.parse::<u32>().is_ok_and(|n| n < limit && n.to_string() == **index);
        let fits = (key.is_empty() || key.starts_with('/')) && indices.len() <= 3;
        (fits && indices.iter().zip(limits).all(good)).then_some(indices.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_a_store_has_is_known() {
        let shape = StoreShape::small();
        let files = ["brickcast.json", "levels/1/level.json", "labels/regions/zarr.json", "labels/regions/0/c/10/0/1"];
        for file in files.into_iter().chain(["labels/regions/1/c/0/0/0"]) {
            assert!(shape.has_file(file) && !shape.has_folder(file), "{file}");
        }
        for folder in [
            "labels",
            "labels/regions",
            "labels/regions/0",
            "labels/regions/0/c",
            "labels/regions/0/c/10",
            "labels/regions/0/c/10/0",
            "labels/regions/1/c/0",
            "levels",
            "levels/1",
        ] {
            assert!(shape.has_folder(folder) && !shape.has_file(folder), "{folder}");
        }
        let foreign = [
            "",
            "c",
            "notes.txt",
            "label",
            "labels/",
            "brickcast.json/x",
            "labels/regions/0/c/11/0/0",
            "labels/regions/0/c/0/1/0",
            "labels/regions/0/c/00/0/0",
            "labels/regions/0/c/+1/0/0",
            "labels/regions/0/c/1/0/0/0",
            "labels/regions/0/cc",
            "labels/regions/1/c/0/0/1",
            "labels/regions/2",
            "levels/1/labels/regions/zarr.json",
            "levels/1/brickcast.json",
            "levels/2",
            "0/c/0/0/0",
            "labels/regions/0/c/ 1",
        ];
        for path in foreign {
            assert!(!shape.has_file(path) && !shape.has_folder(path), "{path}");
        }
    }
}
