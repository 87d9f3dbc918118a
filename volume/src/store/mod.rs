//! The brick store: a volume on disk, cut so that a node reads the bricks it needs and nothing else.
//!
//! [`prepare`] streams an input into a store, [`Store::open`] checks one, [`Store::read_brick`] reads a brick with its ghost
//! layers. On disk it is OME-Zarr 0.5 in one Zarr v3 profile, beside a manifest of our own: `docs/store-format.md`.

mod brick_ranges;
mod cache;
mod codec;
mod error;
mod hash;
mod histogram;
mod manifest;
mod manifest_file;
mod prepare;
mod profile;
mod quantise;
mod read;
mod shard_read;
mod shard_table;
mod shard_write;
mod value_map;
mod verify;
mod voxel;
mod workdir;
mod zarr_json;

pub use brick_ranges::BrickRanges;
pub use cache::ChunkCache;
pub use error::{ChunkFault, IndexFault, ManifestError, RangesError, StoreError};
pub use hash::ContentHash;
pub use manifest::{FileHashes, HISTOGRAM_BINS, Manifest, NotFinite, QUANTILES, Source};
pub use prepare::{Phase, PrepareOptions, PrepareSummary, Progress, prepare, survey};
pub use profile::{CHUNK_EDGE, InnerChunk, MANIFEST_FILE, MAX_SHARDS, SHARD_EDGE, ShardIndex};
pub use read::{BrickVoxels, MAX_GHOST, Store};
pub use value_map::ValueMap;
pub use voxel::StoredType;
