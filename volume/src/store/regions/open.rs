//! The regions of an open store.

use std::sync::Arc;

use super::facts_table::{BrickFactsTable, FACTS_BYTES, REGION_BYTES, regions_from_bytes};
use crate::regions::RegionTable;
use crate::store::error::StoreError;
use crate::store::halo::reach::REGION_HALO;
use crate::store::halo::read::Halos;
use crate::store::halo::regions as halo_regions;
use crate::store::lacking::Lacking;
use crate::store::level::LevelArray;
use crate::store::manifest::Manifest;
use crate::store::objects::Objects;
use crate::store::profile::{
    DISTANCE_ARRAY_FILE, DISTANCE_SHARDS_FILE, LABEL_ARRAY_FILE, LABEL_IMAGE_FILE, LABEL_SHARDS_FILE,
    LABELS_GROUP_FILE, REGION_BRICKS_FILE, REGION_HALO_INDEX_FILE, REGION_HALOS_FILE, REGIONS_FILE, StoreArray,
};
use crate::store::shard::grid::ShardGrid;
use crate::store::shard::open::open_shards;
use crate::store::shard::read::Shards;
use crate::store::shard::tail::TailLayout;

#[derive(Debug)]
pub(crate) struct StoreRegions {
    pub(crate) table: RegionTable,
    pub(crate) facts: BrickFactsTable,
    pub(crate) labels: Shards,
    pub(crate) distances: Shards,
    /// Of labels and distances together.
    pub(crate) halos: Option<Halos>,
}

impl StoreRegions {
    /// Checks all that [`Store::open`](crate::store::Store::open) checks of the volume; nothing where the store has no
    /// regions. `lacking` takes large files that are not there in their full length.
    pub(crate) fn open(
        objects: &Arc<dyn Objects>,
        manifest: &Manifest,
        grid: ShardGrid,
        lacking: &mut Lacking,
    ) -> Result<Option<Self>, StoreError> {
        let Some(entry) = &manifest.regions else { return Ok(None) };
        let files = &entry.files;
        let described = [
            (LABELS_GROUP_FILE, files.group),
            (LABEL_IMAGE_FILE, files.image),
            (LABEL_ARRAY_FILE, files.labels),
            (DISTANCE_ARRAY_FILE, files.distances),
        ];
        for (name, want) in described {
            objects.check_file(name, Manifest::MAX_BYTES, want)?;
        }
        let bytes = objects.read_exactly(REGIONS_FILE, u64::from(entry.count) * REGION_BYTES as u64)?;
        objects.check_hash(REGIONS_FILE, &bytes, files.regions)?;
        let table = regions_from_bytes(manifest.geometry.voxel_count(), &bytes)?;
        let bytes = objects.read_exactly(REGION_BRICKS_FILE, manifest.grid.brick_count() * FACTS_BYTES as u64)?;
        objects.check_hash(REGION_BRICKS_FILE, &bytes, files.bricks)?;
        let facts = BrickFactsTable::from_bytes(manifest, &bytes)?;
        let layout = TailLayout::of_version(manifest.version);
        let on_level = |array| LevelArray { array, level: manifest.level };
        let labels = (LABEL_SHARDS_FILE, files.label_shards, layout);
        let labels = open_shards(objects, on_level(StoreArray::Labels), grid, labels, size_of::<u32>(), lacking)?;
        let distances = (DISTANCE_SHARDS_FILE, files.distance_shards, layout);
        let distances =
            open_shards(objects, on_level(StoreArray::Distances), grid, distances, size_of::<u8>(), lacking)?;
        let halos = manifest.halo.and_then(|halo| {
            let files = (REGION_HALOS_FILE, REGION_HALO_INDEX_FILE, halo.regions?);
            Some(Halos::open(objects, manifest.grid, REGION_HALO, files, halo_regions::BOUND, lacking))
        });
        let halos = halos.transpose()?;
        Ok(Some(Self { table, facts, labels, distances, halos }))
    }
}
