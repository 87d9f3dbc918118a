//! The regions of an open store.

use super::cache::ChunkCache;
use super::store::Store;
use super::window::{ToDistances, ToLabels};
use crate::ids::BrickIndex;
use crate::regions::{BrickFacts, BrickRegions, RegionTable};
use crate::store::error::StoreError;
use crate::store::halo::regions::RegionHalo;
use crate::store::regions::error::RegionsError;
use crate::store::regions::facts_table::BrickFactsTable;

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
