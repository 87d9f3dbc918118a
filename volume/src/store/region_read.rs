//! The regions of an open store.

use super::cache::ChunkCache;
use super::error::StoreError;
use super::facts_table::{BrickFactsTable, FACTS_BYTES, REGION_BYTES, regions_from_bytes};
use super::folder::StoreFolder;
use super::halo_read::Halos;
use super::halo_regions::{self, RegionHalo};
use super::manifest::Manifest;
use super::profile::{
    DISTANCE_ARRAY_FILE, DISTANCE_SHARDS_FILE, LABEL_ARRAY_FILE, LABEL_IMAGE_FILE, LABEL_SHARDS_FILE,
    LABELS_GROUP_FILE, REGION_BRICKS_FILE, REGION_HALO, REGION_HALO_INDEX_FILE, REGION_HALOS_FILE, REGIONS_FILE,
    ShardGrid, StoreArray,
};
use super::read::{Store, open_shards};
use super::region_error::RegionsError;
use super::shard_read::Shards;
use super::shard_tail::TailLayout;
use super::window::{ToDistances, ToLabels};
use crate::ids::BrickIndex;
use crate::regions::{BrickFacts, BrickRegions, RegionTable};

#[derive(Debug)]
pub(super) struct StoreRegions {
    table: RegionTable,
    facts: BrickFactsTable,
    pub(super) labels: Shards,
    pub(super) distances: Shards,
    /// Of labels and distances together.
    pub(super) halos: Option<Halos>,
}

impl StoreRegions {
    /// Checks all that [`Store::open`] checks of the volume; nothing where the store has no regions.
    pub(super) fn open(folder: &StoreFolder, manifest: &Manifest, grid: ShardGrid) -> Result<Option<Self>, StoreError> {
        let Some(entry) = &manifest.regions else { return Ok(None) };
        let files = &entry.files;
        let described = [
            (LABELS_GROUP_FILE, files.group),
            (LABEL_IMAGE_FILE, files.image),
            (LABEL_ARRAY_FILE, files.labels),
            (DISTANCE_ARRAY_FILE, files.distances),
        ];
        for (name, want) in described {
            folder.check_file(name, Manifest::MAX_BYTES, want)?;
        }
        let bytes = folder.read_exactly(REGIONS_FILE, u64::from(entry.count) * REGION_BYTES as u64)?;
        folder.check_hash(REGIONS_FILE, &bytes, files.regions)?;
        let table = regions_from_bytes(manifest.geometry.voxel_count(), &bytes)?;
        let bytes = folder.read_exactly(REGION_BRICKS_FILE, manifest.grid.brick_count() * FACTS_BYTES as u64)?;
        folder.check_hash(REGION_BRICKS_FILE, &bytes, files.bricks)?;
        let facts = BrickFactsTable::from_bytes(manifest, &bytes)?;
        let layout = TailLayout::of_version(manifest.version);
        let labels = (LABEL_SHARDS_FILE, files.label_shards, layout);
        let labels = open_shards(folder, StoreArray::Labels, grid, labels, size_of::<u32>())?;
        let distances = (DISTANCE_SHARDS_FILE, files.distance_shards, layout);
        let distances = open_shards(folder, StoreArray::Distances, grid, distances, size_of::<u8>())?;
        let halos = manifest.halo.and_then(|halo| {
            let files = (REGION_HALOS_FILE, REGION_HALO_INDEX_FILE, halo.regions?);
            Some(Halos::open(folder, manifest.grid, REGION_HALO, files, halo_regions::BOUND))
        });
        let halos = halos.transpose()?;
        Ok(Some(Self { table, facts, labels, distances, halos }))
    }
}

impl Store {
    /// Nothing where the store was made without regions.
    #[must_use]
    pub fn region_table(&self) -> Option<&RegionTable> {
        self.regions().map(|r| &r.table)
    }

    /// In the grid's linear order; nothing where the store was made without regions.
    #[must_use]
    pub fn brick_facts(&self) -> Option<&[BrickFacts]> {
        self.brick_facts_table().map(|table| table.0.as_slice())
    }

    /// The same, as it travels.
    #[must_use]
    pub fn brick_facts_table(&self) -> Option<&BrickFactsTable> {
        self.regions().map(|r| &r.facts)
    }

    /// Labels and distances of the brick's owned box grown by `margin`, clamped at the volume's edge, found as by
    /// [`Store::read_brick`]. Distances are those of the whole volume.
    ///
    /// # Errors
    /// A store without regions; a broken or missing chunk, by name.
    pub fn read_brick_regions(
        &self,
        brick: BrickIndex,
        margin: u32,
        cache: &ChunkCache,
    ) -> Result<BrickRegions, StoreError> {
        let regions = self.regions().ok_or(RegionsError::None)?;
        let covered = self.stored_box(brick, margin)?;
        let parse = |raw: Vec<u8>, voxels| RegionHalo::parse(&raw, voxels);
        let halo = regions.halos.as_ref().map(|halos| halos.read(brick, margin, cache, parse)).transpose()?.flatten();
        if let Some(halo) = halo {
            let at = (brick, covered);
            let row = |part: Option<&RegionHalo>, first, out: &mut [u32]| {
                part.unwrap_or(&RegionHalo::NONE).labels(first, out);
            };
            let labels = self.read_with_halo(&regions.labels, at, cache, &ToLabels, (&halo, row))?;
            let row = |part: Option<&RegionHalo>, first, out: &mut [u8]| {
                part.unwrap_or(&RegionHalo::NONE).distances(first, out);
            };
            let distances = self.read_with_halo(&regions.distances, at, cache, &ToDistances, (&halo, row))?;
            return Ok(BrickRegions { covered, labels, distances });
        }
        let labels = self.read_box(&regions.labels, covered, cache, &ToLabels)?;
        let distances = self.read_box(&regions.distances, covered, cache, &ToDistances)?;
        Ok(BrickRegions { covered, labels, distances })
    }
}
