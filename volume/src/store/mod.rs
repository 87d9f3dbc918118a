//! The brick store: a volume on disk, cut so that a node reads the bricks it needs and nothing else.
//!
//! [`prepare`] streams an input into a store, [`Store::open`] checks one, [`Store::read_brick`] reads a brick with its ghost
//! layers. On disk it is OME-Zarr 0.5 in one Zarr v3 profile, beside a manifest of our own: `docs/store-format.md`.

mod brick_ranges;
mod cache;
mod codec;
mod error;
mod facts_build;
mod facts_table;
mod folder;
mod halo_gather;
mod halo_index;
mod halo_manifest;
mod halo_read;
mod halo_regions;
mod halo_sort;
mod halo_write;
mod hash;
mod histogram;
mod jail;
mod label_planes;
mod manifest;
mod manifest_file;
mod memory;
mod pass;
mod plane_read;
mod prepare;
mod prepare_options;
mod profile;
mod quantise;
mod read;
mod region_error;
mod region_manifest;
mod region_read;
mod region_write;
mod scratch;
mod segment;
mod shard_read;
mod shard_table;
mod shard_write;
mod shell;
mod spool;
mod tiles;
mod value_map;
mod verify;
mod voxel;
mod window;
mod workdir;
mod zarr_json;

pub use brick_ranges::BrickRanges;
pub use cache::ChunkCache;
pub use error::{ChunkFault, HaloFault, IndexFault, ManifestError, RangesError, StoreError};
pub use facts_table::BrickFactsTable;
pub use folder::StoreFolder;
pub use halo_manifest::{HaloEntry, HaloHashes};
pub use hash::ContentHash;
pub use jail::Jail;
pub use manifest::{FileHashes, HISTOGRAM_BINS, Manifest, NotFinite, QUANTILES, Source};
pub use prepare::{prepare, survey};
pub use prepare_options::{Phase, PrepareOptions, PrepareSummary, Progress, RegionOptions, Segmentation};
pub use profile::{CHUNK_EDGE, InnerChunk, MANIFEST_FILE, MAX_SHARDS, SHARD_EDGE, ShardIndex, StoreArray};
pub use read::{BrickVoxels, MAX_GHOST, Store};
pub use region_error::RegionsError;
pub use region_manifest::{RegionHashes, RegionsEntry, SegmentationMethod};
pub use value_map::ValueMap;
pub use voxel::StoredType;
