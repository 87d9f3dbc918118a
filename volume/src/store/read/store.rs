//! An open store and its bricks.

use std::borrow::Cow;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;

use super::cache::ChunkCache;
use super::window::{RowDecoder, ToCodes, Window};
use crate::brick::{BrickVoxels, StoredBox};
use crate::ids::{BrickIndex, StoreHash};
use crate::store::brick_ranges::BrickRanges;
use crate::store::cell_ranges::{CellRanges, cells_of};
use crate::store::error::{HaloFault, StoreError};
use crate::store::files::shape::small_files;
use crate::store::halo::bound::RecordBound;
use crate::store::halo::reach::VOXEL_HALO;
use crate::store::halo::read::Halos;
use crate::store::lacking::Lacking;
use crate::store::level::{LevelArray, key_on};
use crate::store::manifest::Manifest;
use crate::store::mean_ranges::MeanRanges;
use crate::store::no_data::NO_DATA_CODE;
use crate::store::objects::Objects;
use crate::store::objects::folder::StoreFolder;
use crate::store::objects::level::objects_of_level;
use crate::store::profile::{
    ARRAY_FILE, CELLS_FILE, GROUP_FILE, HALO_INDEX_FILE, HALOS_FILE, InnerChunk, MANIFEST_FILE, MEANS_FILE,
    RANGES_FILE, SHARDS_FILE, StoreArray,
};
use crate::store::regions::open::StoreRegions;
use crate::store::shard::grid::ShardGrid;
use crate::store::shard::open::open_shards;
use crate::store::shard::read::Shards;
use crate::store::shard::tail::TailLayout;

/// The most ghost layers that a read may ask for.
pub const MAX_GHOST: u32 = 64;

/// Inner chunks that are fetched together, at most: 2 MiB of voxels of 16 bits, which a read then holds beside the
/// cache.
pub const CHUNKS_AT_ONCE: usize = 256;

/// An open, finished store. Cheap to clone; reads from any number of threads.
#[derive(Debug, Clone)]
pub struct Store {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    objects: Arc<dyn Objects>,
    hash: StoreHash,
    manifest: Manifest,
    manifest_bytes: Bytes,
    ranges: BrickRanges,
    /// Nothing in stores before version 7.
    cells: Option<CellRanges>,
    means: Option<MeanRanges>,
    shards: Shards,
    /// Nothing where bricks are smaller than inner chunks.
    halos: Option<Halos>,
    regions: Option<StoreRegions>,
    /// The coarser levels, from level 1 on.
    levels: Vec<Store>,
    /// Stretched code of every bit pattern of the stored type; the same on every level.
    codes: Arc<Vec<u16>>,
    /// Of this level's large files.
    lacking: Lacking,
}

impl Store {
    /// Opens a store after checking that it is finished: the manifests of all levels and the hashes of all small files.
    /// Shards and halos are checked as they are read, see [`Store::verify`]; of those that are missing or cut,
    /// [`Store::lacking`] says so before.
    ///
    /// # Errors
    /// Not a finished store, unknown version, a file that is not the one that the manifest speaks of.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        Self::open_objects(Arc::new(StoreFolder::free(path)))
    }

    /// The same of a store that may be in a [`Jail`](crate::store::Jail): its files are opened through `folder`, now
    /// and later.
    ///
    /// # Errors
    /// As [`Store::open`]; a file that leads out of the jail.
    pub fn open_in(folder: &StoreFolder) -> Result<Self, StoreError> {
        Self::open_objects(Arc::new(folder.clone()))
    }

    /// The same, wherever the store's objects are kept.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_objects(objects: Arc<dyn Objects>) -> Result<Self, StoreError> {
        let manifest_bytes = match objects.read_at_most(MANIFEST_FILE, Manifest::MAX_BYTES + 1) {
            Err(error) if error.is_missing() => {
                return Err(StoreError::NotAStore { path: objects.place().to_path_buf() });
            }
            read => read?,
        };
        let manifest = Manifest::from_bytes(&manifest_bytes)?;
        let codes = Arc::new(manifest.value_map().code_of_bits_table());
        let levels = || (1..).take(manifest.levels.len());
        let mut soon = files_of(&manifest);
        soon.extend(levels().map(|level| (key_on(level, MANIFEST_FILE), Manifest::MAX_BYTES + 1)));
        objects.foresee(&soon);
        let described = levels().map(|level: u8| {
            let (objects, key) = (objects_of_level(&objects, level), key_on(level, MANIFEST_FILE));
            let read = objects.read_at_most(MANIFEST_FILE, Manifest::MAX_BYTES + 1).and_then(|bytes| {
                let of_level = manifest.level_from_bytes(level, &bytes).map_err(|error| error.in_file(&key))?;
                Ok((objects, of_level, bytes))
            });
            read.map_err(|error| error.on_level(level))
        });
        let described: Vec<_> = described.collect::<Result<_, _>>()?;
        let of_level = |(_, manifest, _): &(_, Manifest, _)| {
            let on_level = |(key, most): (Cow<'_, str>, u64)| (key_on(manifest.level, &key).into_owned().into(), most);
            files_of(manifest).into_iter().map(on_level).collect::<Vec<_>>()
        };
        objects.foresee(&described.iter().flat_map(of_level).collect::<Vec<_>>());
        let finest = Self::open_level(objects.clone(), manifest, manifest_bytes, &codes)?;
        let levels = (1..).zip(described).map(|(level, (objects, manifest, bytes))| {
            let opened = Self::open_level(objects, manifest, bytes, &codes);
            opened.map(|inner| Self { inner: Arc::new(inner) }).map_err(|error| error.on_level(level))
        });
        let levels = levels.collect::<Result<_, _>>()?;
        Ok(Self { inner: Arc::new(Inner { levels, ..finest }) })
    }

    /// One level, through its own objects.
    fn open_level(
        objects: Arc<dyn Objects>,
        manifest: Manifest,
        manifest_bytes: Bytes,
        codes: &Arc<Vec<u16>>,
    ) -> Result<Inner, StoreError> {
        for (name, want) in [(GROUP_FILE, manifest.files.group), (ARRAY_FILE, manifest.files.array)] {
            objects.check_file(name, Manifest::MAX_BYTES, want)?;
        }
        let ranges = objects.read_exactly(RANGES_FILE, manifest.grid.brick_count() * 4)?;
        let ranges = BrickRanges::from_bytes(&manifest, &ranges)?;
        let of_cells = cells_of(manifest.geometry.dims(), manifest.level).count() * 4;
        let of_cells =
            |name, hash: Option<_>| hash.map_or_else(|| Ok(Bytes::new()), |_| objects.read_exactly(name, of_cells));
        let cells = CellRanges::from_bytes(&manifest, &of_cells(CELLS_FILE, manifest.files.cells)?)?;
        let means = MeanRanges::from_bytes(&manifest, &of_cells(MEANS_FILE, manifest.files.means)?)?;
        let grid = ShardGrid::new(manifest.geometry.dims())?;
        let voxel_bytes = manifest.stored_type.bytes();
        let layout = TailLayout::of_version(manifest.version);
        let table = (SHARDS_FILE, manifest.files.shards, layout);
        let array = LevelArray { array: StoreArray::Voxels, level: manifest.level };
        let mut lacking = Lacking::default();
        let shards = open_shards(&objects, array, grid, table, voxel_bytes, &mut lacking)?;
        let halos = manifest.halo.map(|halo| {
            let files = (HALOS_FILE, HALO_INDEX_FILE, halo.voxels);
            let bound = RecordBound { head: 0, per_voxel: voxel_bytes as u64 };
            Halos::open(&objects, manifest.grid, VOXEL_HALO, files, bound, &mut lacking)
        });
        let halos = halos.transpose()?;
        let regions = StoreRegions::open(&objects, &manifest, grid, &mut lacking)?;
        Ok(Inner {
            hash: StoreHash::of(&manifest_bytes),
            objects,
            manifest,
            manifest_bytes,
            ranges,
            cells,
            means,
            shards,
            halos,
            regions,
            levels: Vec::new(),
            codes: codes.clone(),
            lacking,
        })
    }

    /// A level of detail, as a store of its own: 0 is this one. Nothing where the store has no such level, and for a
    /// level of a level.
    #[must_use]
    pub fn level(&self, level: u8) -> Option<&Self> {
        match level.checked_sub(1) {
            None => Some(self),
            Some(place) => self.inner.levels.get(usize::from(place)),
        }
    }

    /// How many levels there are, this one among them; 1 in stores before version 9.
    #[must_use]
    pub fn level_count(&self) -> u8 {
        1 + self.inner.levels.len() as u8
    }

    /// The first shard or file of halos that was missing or cut when the store was opened, and the level that it is of.
    /// What it holds cannot be read. Of a store behind a network nobody looks.
    #[must_use]
    pub fn lacking(&self) -> Option<(u8, &StoreError)> {
        (0..self.level_count()).find_map(|level| Some((level, self.level(level)?.inner.lacking.0.as_ref()?)))
    }

    /// True where it lies behind a network: see [`Objects::is_far`].
    #[must_use]
    pub fn is_far(&self) -> bool {
        self.inner.objects.is_far()
    }

    /// Where it is kept, for messages.
    #[must_use]
    pub fn path(&self) -> PathBuf {
        self.inner.objects.place().to_path_buf()
    }

    /// Of the manifest: that of a level tells it from all others, but stores are found by that of level 0.
    #[must_use]
    pub fn hash(&self) -> StoreHash {
        self.inner.hash
    }

    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.inner.manifest
    }

    /// The very bytes that the hash is of.
    #[must_use]
    pub fn manifest_bytes(&self) -> &[u8] {
        &self.inner.manifest_bytes
    }

    #[must_use]
    pub fn brick_ranges(&self) -> &BrickRanges {
        &self.inner.ranges
    }

    /// Nothing in stores before version 7.
    #[must_use]
    pub fn cell_ranges(&self) -> Option<&CellRanges> {
        self.inner.cells.as_ref()
    }

    /// Nothing in stores before version 10.
    #[must_use]
    pub fn mean_ranges(&self) -> Option<&MeanRanges> {
        self.inner.means.as_ref()
    }

    /// Smallest and largest value that sampling the brick can meet, in the file's units, to half a code; clamped to the
    /// manifest's range. Nothing for a brick outside the grid, or one that meets no data.
    #[must_use]
    pub fn value_range(&self, brick: BrickIndex) -> Option<(f64, f64)> {
        let manifest = self.manifest();
        let [min, max] = manifest.grid.contains(brick).then(|| self.inner.ranges.0[manifest.grid.id(brick).index()])?;
        (min <= max).then(|| (manifest.value_of_code(min), manifest.value_of_code(max)))
    }

    /// Its voxels.
    pub(crate) fn shards(&self) -> &Shards {
        &self.inner.shards
    }

    /// The store's arrays.
    pub(crate) fn arrays(&self) -> Vec<&Shards> {
        let regions = self.regions().into_iter().flat_map(|r| [&r.labels, &r.distances]);
        std::iter::once(&self.inner.shards).chain(regions).collect()
    }

    /// The store's files of halos.
    pub(crate) fn halos(&self) -> impl Iterator<Item = &Halos> {
        self.inner.halos.iter().chain(self.regions().and_then(|r| r.halos.as_ref()))
    }

    pub(crate) fn regions(&self) -> Option<&StoreRegions> {
        self.inner.regions.as_ref()
    }

    /// The brick's owned box grown by `ghost`, clamped at the volume's edge. What is beyond the owned box comes from
    /// the brick's halo; from the neighbours, through `cache`, where that does not reach.
    ///
    /// Decodes in the calling thread: read several bricks at once for speed.
    ///
    /// # Errors
    /// A broken or missing chunk, by name.
    pub fn read_brick(&self, brick: BrickIndex, ghost: u32, cache: &ChunkCache) -> Result<BrickVoxels, StoreError> {
        let stored = self.stored_box(brick, ghost)?;
        let (shards, decoder) = (&self.inner.shards, ToCodes(&self.inner.codes));
        let voxel_bytes = self.inner.manifest.stored_type.bytes();
        let parse = |raw: Vec<u8>, voxels| match voxels * voxel_bytes {
            want if want == raw.len() => Ok(raw),
            want => Err(HaloFault::RecordLength { got: raw.len(), want }),
        };
        let halo = self.inner.halos.as_ref().map(|halos| halos.read(brick, ghost, cache, parse)).transpose()?.flatten();
        let codes = match halo {
            None => self.read_box(shards, stored, cache, &decoder)?,
            Some(halo) => {
                let row = |voxels: Option<&Vec<u8>>, first, out: &mut [u16]| {
                    decoder.row(voxels.map(Vec::as_slice), first, out);
                };
                self.read_with_halo(shards, (brick, stored), cache, &decoder, (&halo, row))?
            }
        };
        let has_holes = self.inner.manifest.no_data.is_some() && codes.contains(&NO_DATA_CODE);
        Ok(BrickVoxels { stored, codes, has_holes })
    }

    /// The owned box of a brick grown by `ghost`, if both can be.
    pub(crate) fn stored_box(&self, brick: BrickIndex, ghost: u32) -> Result<StoredBox, StoreError> {
        let grid = &self.inner.manifest.grid;
        if !grid.contains(brick) {
            return Err(StoreError::BrickOutside { brick, dims: grid.dims().to_array() });
        }
        if ghost > MAX_GHOST {
            return Err(StoreError::Ghost { ghost, max: MAX_GHOST });
        }
        Ok(grid.owned_box(brick).stored(ghost))
    }

    /// The elements of one array in a box, clamped at the volume's edge.
    pub(crate) fn read_box<T: Copy + Default>(
        &self,
        shards: &Shards,
        stored: StoredBox,
        cache: &ChunkCache,
        decoder: &impl RowDecoder<T>,
    ) -> Result<Vec<T>, StoreError> {
        let mut window = Window::new(stored, self.inner.manifest.grid.volume_dims());
        let (first, last) = window.chunks();
        let [xs, ys, zs] = [0, 1, 2].map(|a| first[a]..last[a] + 1);
        self.fill(&mut window, shards, cache, decoder, [xs, ys, zs])?;
        Ok(window.clamped_to_edge())
    }

    /// Fills a window from the inner chunks of a box of them, half-open.
    pub(crate) fn fill<T: Copy + Default>(
        &self,
        window: &mut Window<T>,
        shards: &Shards,
        cache: &ChunkCache,
        decoder: &impl RowDecoder<T>,
        [xs, ys, zs]: [Range<u32>; 3],
    ) -> Result<(), StoreError> {
        let row = |y, z| xs.clone().map(move |x| InnerChunk([x, y, z]));
        let chunks: Vec<_> = zs.flat_map(|z| ys.clone().flat_map(move |y| row(y, z))).collect();
        for chunks in chunks.chunks(CHUNKS_AT_ONCE) {
            let read = |wanted: &[InnerChunk]| shards.read_chunks(wanted);
            cache.get(self.inner.hash, shards.array.array, chunks, read, |chunk, decoded| {
                window.fill(chunk, decoded.as_deref(), decoder);
            })?;
        }
        Ok(())
    }
}

/// The files of a level that opening it reads, and the most bytes of each.
fn files_of(manifest: &Manifest) -> Vec<(Cow<'static, str>, u64)> {
    small_files(manifest).into_iter().map(|file| (file.name, file.bytes)).collect()
}
