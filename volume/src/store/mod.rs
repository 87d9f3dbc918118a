//! The brick store: a volume on disk, cut so that a node reads the bricks it needs and nothing else.
//!
//! [`prepare`] streams an input into a store, [`Store::open`] checks one, [`Store::read_brick`] reads a brick with its
//! ghost layers. On disk it is OME-Zarr 0.5 in one Zarr v3 profile, beside a manifest of our own:
//! `docs/reference/store-format.md`.

mod brick_ranges;
mod cell_ranges;
mod codec;
mod error;
mod files;
mod halo;
mod hash;
mod lacking;
mod level;
mod manifest;
mod mean_ranges;
mod no_data;
mod objects;
mod prepare;
mod profile;
mod progress;
mod pyramid;
mod read;
mod regions;
mod series;
mod series_manifest;
mod shard;
mod tiles;
mod value_map;
mod view;
mod voxel;
mod zarr_json;

pub use crate::brick::BrickVoxels;
pub use brick_ranges::BrickRanges;
pub use cell_ranges::{CellRanges, Cells};
pub use error::{ChunkFault, HaloFault, IndexFault, ManifestError, RangesError, StoreError};
pub use files::abandoned::remove_leftovers;
pub use files::destination::Destination;
pub use files::walk::{remove_store, stored_bytes};
pub use files::workdir::ScratchFolder;
pub use hash::ContentHash;
pub use level::LevelArray;
pub use manifest::file::VERSION as STORE_VERSION;
pub use manifest::halo::{HaloEntry, HaloHashes};
pub use manifest::levels::LevelEntry;
pub use manifest::notes::{MAX_NOTE_BYTES, MAX_NOTES};
pub use manifest::regions::{RegionHashes, RegionsEntry, SegmentationMethod};
pub use manifest::{FileHashes, HISTOGRAM_BINS, Manifest, NotFinite, QUANTILES, Source};
pub use mean_ranges::MeanRanges;
pub use no_data::{NO_DATA_CODE, NoData};
pub use objects::folder::StoreFolder;
pub use objects::jail::Jail;
pub use objects::memory::MemoryObjects;
pub use objects::{Object, Objects};
pub use prepare::disk::{check_disk, free_bytes};
pub use prepare::job::{prepare, prepare_to, survey};
pub use prepare::options::{Levels, PrepareOptions, PrepareSummary, RegionOptions, Segmentation};
pub use prepare::parts::error::{PartFault, PartsError};
pub use prepare::parts::{Journal, MadePart, PartNumber, merge_parts, parts_folder, prepare_part, resume, scan_part};
pub use prepare::step_map::StepMap;
pub use profile::VIEW_FILE;
pub use profile::{
    CHUNK_EDGE, CHUNK_VOXELS, InnerChunk, MANIFEST_FILE, MAX_SHARDS, SERIES_FILE, SHARD_EDGE, ShardIndex, StoreArray,
};
pub use progress::{Phase, Progress};
pub use read::cache::ChunkCache;
pub use read::inspect::{Fault, FaultKind, Inspected, inspect, inspect_objects};
pub use read::source::BrickSource;
pub use read::store::{CHUNKS_AT_ONCE, MAX_GHOST, Store};
pub use read::voxels::{StoreSource, StoredArray};
pub use regions::error::RegionsError;
pub use regions::facts_table::BrickFactsTable;
pub use series::inspect::inspect_series;
pub use series::{Series, SeriesSummary, SeriesWriter, check_alike};
pub use series_manifest::{CommonStatistics, MAX_STEPS, SeriesManifest, StepEntry};
pub use value_map::ValueMap;
pub use view::{FinestVoxels, ViewFile, ViewInput, ViewObjects};
pub use voxel::StoredType;
