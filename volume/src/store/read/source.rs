//! What a node needs of a volume: what it is, and its bricks.

use std::fmt::Debug;

use super::cache::ChunkCache;
use super::store::Store;
use crate::brick::BrickVoxels;
use crate::ids::{BrickIndex, StoreHash};
use crate::regions::{BrickFacts, BrickRegions, RegionTable};
use crate::store::brick_ranges::BrickRanges;
use crate::store::cell_ranges::CellRanges;
use crate::store::error::StoreError;
use crate::store::manifest::Manifest;
use crate::store::mean_ranges::MeanRanges;

/// Bricks of one volume that never changes, read from any number of threads. A [`Store`] is one such source; another
/// kind of store would be one too, and make what it lacks (ranges, halos) as it is read.
pub trait BrickSource: Debug + Send + Sync {
    /// Equal hashes mean equal bricks.
    fn hash(&self) -> StoreHash;

    /// Geometry, grid of bricks, range of values.
    fn manifest(&self) -> &Manifest;

    /// The very bytes that the hash is of.
    fn manifest_bytes(&self) -> &[u8];

    /// Which codes sampling each brick can meet.
    fn brick_ranges(&self) -> &BrickRanges;

    /// Which codes sampling each cell can meet; nothing in stores before version 7.
    fn cell_ranges(&self) -> Option<&CellRanges>;

    /// Between which codes its own voxels lie in each cell; nothing in stores before version 10.
    fn mean_ranges(&self) -> Option<&MeanRanges>;

    /// In the grid's linear order; nothing where there are no regions.
    fn brick_facts(&self) -> Option<&[BrickFacts]>;

    /// Nothing where there are no regions.
    fn region_table(&self) -> Option<&RegionTable>;

    /// True where each read waits for a network: many are then to be made at a time.
    fn is_far(&self) -> bool {
        false
    }

    /// The brick's owned box grown by `ghost` voxels, clamped at the volume's edge. In the calling thread.
    ///
    /// # Errors
    /// A brick outside the grid, too many ghost layers; what is broken or missing, by name.
    fn read_brick(&self, brick: BrickIndex, ghost: u32, cache: &ChunkCache) -> Result<BrickVoxels, StoreError>;

    /// Labels and distances of the brick's owned box grown by `margin` voxels, clamped at the volume's edge. In the
    /// calling thread.
    ///
    /// # Errors
    /// As [`BrickSource::read_brick`]; no regions.
    fn read_brick_regions(
        &self,
        brick: BrickIndex,
        margin: u32,
        cache: &ChunkCache,
    ) -> Result<BrickRegions, StoreError>;
}

impl BrickSource for Store {
    fn hash(&self) -> StoreHash {
        self.hash()
    }

    fn manifest(&self) -> &Manifest {
        self.manifest()
    }

    fn manifest_bytes(&self) -> &[u8] {
        self.manifest_bytes()
    }

    fn brick_ranges(&self) -> &BrickRanges {
        self.brick_ranges()
    }

    fn cell_ranges(&self) -> Option<&CellRanges> {
        self.cell_ranges()
    }

    fn mean_ranges(&self) -> Option<&MeanRanges> {
        self.mean_ranges()
    }

    fn brick_facts(&self) -> Option<&[BrickFacts]> {
        self.brick_facts()
    }

    fn region_table(&self) -> Option<&RegionTable> {
        self.region_table()
    }

    fn is_far(&self) -> bool {
        self.is_far()
    }

    fn read_brick(&self, brick: BrickIndex, ghost: u32, cache: &ChunkCache) -> Result<BrickVoxels, StoreError> {
        self.read_brick(brick, ghost, cache)
    }

    fn read_brick_regions(
        &self,
        brick: BrickIndex,
        margin: u32,
        cache: &ChunkCache,
    ) -> Result<BrickRegions, StoreError> {
        self.read_brick_regions(brick, margin, cache)
    }
}
