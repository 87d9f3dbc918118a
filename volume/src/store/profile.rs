//! The one Zarr v3 profile that stores are written in, and the arithmetic of shards and inner chunks.

use std::fmt;

use glam::UVec3;

/// Voxels per edge of a shard: one file.
pub const SHARD_EDGE: u32 = 256;
/// Voxels per edge of an inner chunk: the unit of compression, checksum and decoding. Without a halo, a ghost layer of
/// one voxel costs a layer of whole chunks: docs/figures/benchmarks.md has the figures that chose it.
pub const CHUNK_EDGE: u32 = 16;
/// Voxels of an inner chunk; those at the volume's high edges are padded with the fill value 0.
pub const CHUNK_VOXELS: usize = (CHUNK_EDGE as usize).pow(3);
/// The most shards that a store may have: keeps the shard table under 40 MiB.
pub const MAX_SHARDS: u64 = 1 << 20;

pub(super) const CHUNKS_PER_EDGE: u32 = SHARD_EDGE / CHUNK_EDGE;
pub(super) const CHUNKS_PER_SHARD: usize = (CHUNKS_PER_EDGE as usize).pow(3);
/// A shard's index: offset and length (u64 little endian) of every inner chunk, z slowest, then a crc32c of all that.
pub(super) const INDEX_BYTES: usize = CHUNKS_PER_SHARD * 16 + 4;
/// Offset and length of an inner chunk that is not there: it holds nothing but the fill value.
pub(super) const ABSENT: u64 = u64::MAX;
pub(super) const ZSTD_LEVEL: i32 = 1;

/// The file that makes a folder a finished store; the store's hash is of its bytes.
pub const MANIFEST_FILE: &str = "brickcast.json";
/// The file that makes a folder a finished series of stores; the series' hash is of its bytes.
pub const SERIES_FILE: &str = "brickcast-series.json";
/// Which stores a series has, for other programs.
pub(super) const SERIES_LIST_FILE: &str = "OME/zarr.json";
/// As [`MANIFEST_FILE`] of a coarser level, under another name: a level's folder is no store.
pub(super) const LEVEL_FILE: &str = "level.json";
/// Beside a view's manifest, which says nothing of it.
pub const VIEW_FILE: &str = "view.json";
pub(super) const GROUP_FILE: &str = "zarr.json";
pub(super) const ARRAY_FILE: &str = "0/zarr.json";
pub(super) const RANGES_FILE: &str = "bricks.bin";
/// Not in stores before version 7.
pub(super) const CELLS_FILE: &str = "cells.bin";
/// Not in stores before version 10.
pub(super) const MEANS_FILE: &str = "means.bin";
pub(super) const SHARDS_FILE: &str = "shards.bin";
/// Files of stores whose bricks have halos.
pub(super) const HALOS_FILE: &str = "halos.bin";
pub(super) const HALO_INDEX_FILE: &str = "halo_index.bin";
/// The same of labels and distances.
pub(super) const REGION_HALOS_FILE: &str = "region_halos.bin";
pub(super) const REGION_HALO_INDEX_FILE: &str = "region_halo_index.bin";
/// Files of stores with regions.
pub(super) const LABELS_GROUP_FILE: &str = "labels/zarr.json";
pub(super) const LABEL_IMAGE_FILE: &str = "labels/regions/zarr.json";
pub(super) const LABEL_ARRAY_FILE: &str = "labels/regions/0/zarr.json";
pub(super) const DISTANCE_ARRAY_FILE: &str = "distances/zarr.json";
pub(super) const REGIONS_FILE: &str = "regions.bin";
pub(super) const REGION_BRICKS_FILE: &str = "region_bricks.bin";
pub(super) const LABEL_SHARDS_FILE: &str = "label_shards.bin";
pub(super) const DISTANCE_SHARDS_FILE: &str = "distance_shards.bin";

/// Files of a part of a store (docs/adr/0022-preparing-in-parts.md), beside those that a store has. What it is and is
/// made from:
pub(super) const PART_FILE: &str = "part.json";
/// What was counted of its voxels.
pub(super) const STATISTICS_FILE: &str = "statistics.bin";
/// What is under the voxels of the coarsest level whose voxels lie in one part each.
pub(super) const SEAM_FILE: &str = "seam.bin";

/// The ranges of a level, as far as a part's voxels reach.
pub(super) fn tables_file(level: u8) -> String {
    format!("tables-{level}")
}

/// The voxels of a coarser level above a part's.
pub(super) fn gathered_file(level: u8) -> String {
    format!("voxels-{level}")
}

/// An array of a store; all have the same dims, shards and inner chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum StoreArray {
    /// The volume's voxels.
    Voxels,
    /// Labels of regions, u32.
    Labels,
    /// Distances to the nearest voxel of another label, u8.
    Distances,
}

impl StoreArray {
    /// The array's path below the store.
    #[must_use]
    pub fn path(self) -> &'static str {
        match self {
            Self::Voxels => "0",
            Self::Labels => "labels/regions/0",
            Self::Distances => "distances",
        }
    }
}

impl fmt::Display for StoreArray {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.path())
    }
}

/// A shard's position in the grid of shards, `[x, y, z]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ShardIndex(pub [u32; 3]);

impl ShardIndex {
    /// The shard's path below its array: Zarr's default chunk key, slowest axis first.
    #[must_use]
    pub fn key(self) -> String {
        let [x, y, z] = self.0;
        format!("c/{z}/{y}/{x}")
    }

    /// The shard's path below the store.
    pub(super) fn path(self, array: StoreArray) -> String {
        format!("{array}/{self}")
    }
}

impl fmt::Display for ShardIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.key())
    }
}

/// An inner chunk's position in the volume's grid of inner chunks, `[x, y, z]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct InnerChunk(pub [u32; 3]);

impl InnerChunk {
    /// The shard that holds it.
    #[must_use]
    pub fn shard(self) -> ShardIndex {
        ShardIndex(self.0.map(|c| c / CHUNKS_PER_EDGE))
    }

    /// Its place in that shard's index.
    pub(super) fn slot(self) -> usize {
        let [x, y, z] = self.0.map(|c| (c % CHUNKS_PER_EDGE) as usize);
        let n = CHUNKS_PER_EDGE as usize;
        x + n * (y + n * z)
    }

    /// The inner chunk at a place of a shard's index.
    pub(super) fn at(shard: ShardIndex, slot: usize) -> Self {
        let n = CHUNKS_PER_EDGE as usize;
        let within = [slot % n, slot / n % n, slot / n / n];
        Self(std::array::from_fn(|a| shard.0[a] * CHUNKS_PER_EDGE + within[a] as u32))
    }

    /// First voxel, global index space.
    pub(super) fn lo(self) -> UVec3 {
        UVec3::from(self.0) * CHUNK_EDGE
    }
}

impl fmt::Display for InnerChunk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {}, {})", self.0[0], self.0[1], self.0[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_and_shards_are_inverse_and_z_is_slowest() {
        let chunk = InnerChunk([17, 34, 63]);
        assert_eq!(chunk.shard(), ShardIndex([1, 2, 3]));
        assert_eq!(chunk.slot(), 1 + 16 * (2 + 16 * 15));
        assert_eq!(InnerChunk::at(chunk.shard(), chunk.slot()), chunk);
        assert_eq!(chunk.shard().key(), "c/3/2/1");
    }
}
