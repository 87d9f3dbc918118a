//! What can go wrong with a store, with the operands and the way out.

use std::io;
use std::path::{Path, PathBuf};

use super::hash::ContentHash;
use super::level::LevelArray;
use super::prepare::parts::error::PartsError;
use super::profile::{InnerChunk, MANIFEST_FILE, MAX_SHARDS, SERIES_FILE, ShardIndex};
use super::regions::error::RegionsError;
use crate::brick::BrickGridError;
use crate::format::FormatError;
use crate::ids::{BrickIndex, StoreHash};

#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    #[error("cannot {action} {}: {source}", path.display())]
    Io { action: &'static str, path: PathBuf, source: io::Error },
    #[error(
        "{} is not a brickcast store: it has no {MANIFEST_FILE}; make one with `brickcast prepare INPUT STORE`",
        path.display()
    )]
    NotAStore { path: PathBuf },
    #[error(
        "{} lies behind a link that leads out of the data root, which is never followed, or that was put there just \
         now; copy the file itself",
        file.display()
    )]
    Outside {
        /// Relative to the store.
        file: PathBuf,
    },
    #[error("{} is no regular file; the store is damaged: prepare it again", path.display())]
    NotAFile { path: PathBuf },
    #[error("manifest: {0}; prepare the store again")]
    Manifest(#[from] ManifestError),
    #[error("{file}: {error}; prepare the store again")]
    LevelManifest {
        /// Below the store.
        file: String,
        error: ManifestError,
    },
    #[error("there is no level {level}: the store has the levels 0 to {}, 0 the finest", levels - 1)]
    NoLevel { level: u8, levels: u8 },
    /// Something in a coarser level of a store.
    #[error("level {level}: {error}")]
    Level { level: u8, error: Box<StoreError> },
    #[error("{}: {got} bytes, the manifest promises {want}; the store is damaged: prepare it again", path.display())]
    FileLength { path: PathBuf, got: u64, want: u64 },
    #[error(
        "{}: its content has hash {got}, the manifest promises {want}; the store was changed: prepare it again",
        path.display()
    )]
    FileHash { path: PathBuf, got: ContentHash, want: ContentHash },
    #[error("brick ranges: {0}; prepare the store again")]
    Ranges(#[from] RangesError),
    #[error("regions: {0}")]
    Regions(#[from] RegionsError),
    #[error(
        "shard table: entry of shard {array}/{shard} says {bytes} bytes, which no shard has; prepare the store again"
    )]
    ShardTable { array: LevelArray, shard: ShardIndex, bytes: u64 },
    #[error("shard {array}/{shard} is missing ({}); the store is damaged: prepare it again", path.display())]
    ShardMissing { array: LevelArray, shard: ShardIndex, path: PathBuf },
    #[error(
        "shard {array}/{shard} ({}): {got} bytes, the manifest promises {want}; the store is damaged: prepare it again",
        path.display()
    )]
    ShardLength { array: LevelArray, shard: ShardIndex, path: PathBuf, got: u64, want: u64 },
    #[error("shard {array}/{shard} ({}): its index {fault}; the store is damaged: prepare it again", path.display())]
    ShardIndex { array: LevelArray, shard: ShardIndex, path: PathBuf, fault: IndexFault },
    #[error(
        "shard {array}/{shard} ({}): inner chunk {chunk}, bytes {start}..{end}: {fault}; the store is damaged: prepare \
         it again",
        path.display()
    )]
    Chunk {
        array: LevelArray,
        shard: ShardIndex,
        path: PathBuf,
        chunk: InnerChunk,
        start: u64,
        end: u64,
        fault: ChunkFault,
    },
    #[error(
        "halo index: entry of brick {brick}, layer {layer}, says {bytes} bytes, which no halo has; prepare the store \
         again"
    )]
    HaloIndex { brick: BrickIndex, layer: u32, bytes: u64 },
    #[error(
        "{}: {got} bytes, its index promises {want}; cut from the halo of brick {brick}, layer {layer}, on: prepare \
         the store again",
        path.display()
    )]
    HaloCut { path: PathBuf, brick: BrickIndex, layer: u32, got: u64, want: u64 },
    #[error(
        "{}: halo of brick {brick}, layer {layer}, bytes {start}..{end}: {fault}; the store is damaged: prepare it \
         again",
        path.display()
    )]
    Halo {
        path: PathBuf,
        brick: BrickIndex,
        /// The outermost that the record holds.
        layer: u32,
        start: u64,
        end: u64,
        fault: HaloFault,
    },
    #[error("brick {brick} is outside the store's {dims:?} bricks")]
    BrickOutside { brick: BrickIndex, dims: [u32; 3] },
    #[error("nobody wants any more what is read")]
    Unwanted,
    #[error("{ghost} ghost layers are more than the {max} that a read may ask for")]
    Ghost { ghost: u32, max: u32 },
    #[error("{shards} shards are more than the {MAX_SHARDS} that one store may have; split the volume")]
    TooManyShards { shards: u64 },
    #[error(transparent)]
    Grid(#[from] BrickGridError),
    #[error(
        "range {lo}..{hi}: both ends must be finite, the first below the second, and neither too near nor too far apart"
    )]
    Range { lo: f64, hi: f64 },
    #[error(
        "none of the {voxels} voxels holds data ({nan} are NaN, {fill} have a declared fill value): there is nothing \
         to show; check the file, and the value given with --no-data"
    )]
    NothingHoldsData { voxels: u64, nan: u64, fill: u64 },
    #[error("{} exists already; choose another name, or pass --force to replace it", path.display())]
    Exists { path: PathBuf },
    #[error(
        "{} is not a brickcast store ({why}), so --force does not replace it; remove it yourself or choose another \
         name",
        path.display()
    )]
    NotOurs { path: PathBuf, why: &'static str },
    #[error(
        "{} holds what is not of the store in it: {what}; nothing of that is ever removed, so --force does not replace \
         the store: move it elsewhere, or choose another name",
        path.display()
    )]
    Foreign {
        path: PathBuf,
        /// Some by name, the others counted.
        what: String,
    },
    #[error(
        "the input {} lies in {}, which the new store would replace; move it out of there, or choose another name for \
         the store",
        input.display(),
        target.display()
    )]
    InputInside { input: PathBuf, target: PathBuf },
    #[error("{} cannot name a store: {why}", path.display())]
    Target { path: PathBuf, why: &'static str },
    #[error(
        "cannot put the finished store at {}: {source}; the store that was there is now {}: move it back",
        target.display(),
        old.display()
    )]
    Stranded { target: PathBuf, old: PathBuf, source: io::Error },
    #[error(transparent)]
    Source(#[from] FormatError),
    #[error(
        "plane {plane} of the input came as {got} bytes where {want} were due; the reader of this format is at fault"
    )]
    SourceLength { plane: u32, got: usize, want: usize },
    #[error(
        "preparing needs {bytes} bytes of memory at once, which the system does not give; end other programs, or use a \
         machine with more"
    )]
    Memory { bytes: u64 },
    #[error(
        "preparing this volume needs at least {need} bytes of memory, and {available} are free ({by}); end other \
         programs, raise the limit, or use a machine with more"
    )]
    TooLittleMemory { need: u64, available: u64, by: String },
    #[error(
        "{}: making this store of {dims:?} voxels takes about {need} bytes of disk, of which {stays} stay, and {free} \
         are free there; make room, choose another disk, or ask for fewer voxels",
        path.display()
    )]
    TooLittleDisk {
        /// The store.
        path: PathBuf,
        dims: [u32; 3],
        need: u64,
        stays: u64,
        free: u64,
    },
    #[error("zstd: {0}")]
    Compress(io::Error),
    #[error("{}: {why}; make the view again", path.display())]
    ViewFile { path: PathBuf, why: String },
    #[error(
        "it is a view of voxels at {array}, which lies outside of the node's --data; put both below one folder or \
         prefix that is --data"
    )]
    ViewOutside { array: String },
    #[error("the voxels at {place} are {got}, and were {want} when the view of them was made; make the view again")]
    ViewType { place: String, got: &'static str, want: String },
    #[error(
        "inner chunk {chunk} ({}) is a view of voxels at {place} that are not those that it was made of: they were \
         changed since, or the view is another version's; make the view again",
        path.display()
    )]
    ViewChanged { path: PathBuf, chunk: InnerChunk, place: String },
    #[error(transparent)]
    Parts(#[from] PartsError),
    #[error("{SERIES_FILE}: {error}; prepare the series again")]
    SeriesManifest { error: ManifestError },
    /// Something in a step of a series.
    #[error("step {step}: {error}")]
    Step { step: usize, error: Box<StoreError> },
    #[error("step {step} is the store {got}, the series names {want}: copy the right one there, or prepare it again")]
    OtherStep { step: usize, got: StoreHash, want: StoreHash },
    #[error(
        "step {step} has another {what} than the first: {got}, not {want}; all steps of a series have the same: leave \
         it out, or bring it there first"
    )]
    UnlikeStep { step: usize, what: &'static str, got: String, want: String },
    #[error("times of steps: {0}; give one for each, ascending")]
    StepTimes(String),
    #[error("more than the {max} steps that a series may have; make several series")]
    TooManySteps { max: usize },
}

impl StoreError {
    /// `map_err` for everything that touches files.
    pub(super) fn io<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(io::Error) -> Self + use<'a> {
        move |source| Self::Io { action, path: path.to_path_buf(), source }
    }

    /// True where nothing is at the place that was looked at.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        let none = |kind| matches!(kind, io::ErrorKind::NotFound | io::ErrorKind::NotADirectory);
        matches!(self, Self::Io { source, .. } if none(source.kind()))
    }

    /// True where the same call may succeed later with nothing changed: the system failed, not the data.
    #[must_use]
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::Level { error, .. } | Self::Step { error, .. } => error.is_retryable(),
            error => matches!(error, Self::Io { .. }),
        }
    }

    /// What is wrong with a manifest, by its file; all else names its own.
    pub(super) fn in_file(self, file: &str) -> Self {
        match self {
            Self::Manifest(error) => Self::LevelManifest { file: file.to_owned(), error },
            error => error,
        }
    }

    /// What went wrong with a step, as it is told of the whole series.
    pub(super) fn of_step(self, step: usize) -> Self {
        match self {
            error @ (Self::Step { .. } | Self::UnlikeStep { .. }) => error,
            error => Self::Step { step, error: Box::new(error) },
        }
    }

    /// What went wrong with a coarser level, as it is told of the whole store.
    pub(super) fn on_level(self, level: u8) -> Self {
        match self {
            // Whoever asks for a store asks for this one, whichever level's file it is; it is named.
            Self::Outside { file } => Self::Outside { file },
            error => Self::Level { level, error: Box::new(error) },
        }
    }
}

/// Bytes that are no manifest of this version.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ManifestError {
    #[error("{got} bytes, more than the {max} that a manifest may have")]
    TooLong { got: u64, max: u64 },
    #[error("{0}")]
    Json(String),
    #[error("format version {got}, this brickcast knows {known}; use the brickcast that wrote it")]
    Version { got: u64, known: u64 },
    #[error("hash {got}, the store's manifest promises {want}")]
    LevelHash { got: ContentHash, want: ContentHash },
    #[error("format `{0}` is not a brickcast store's")]
    Format(String),
    #[error("`{field}`: {why}")]
    Field { field: &'static str, why: String },
}

/// Bytes that are not the table of ranges, of bricks or of cells, that a manifest speaks of.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RangesError {
    #[error("{got} bytes, {count} {what}s need {want}")]
    Length { what: &'static str, got: usize, want: u64, count: u64 },
    #[error("hash {got}, the manifest promises {want}")]
    Hash { got: ContentHash, want: ContentHash },
    #[error("{what} {at} has minimum {min} above maximum {max}")]
    Inverted { what: &'static str, at: BrickIndex, min: u16, max: u16 },
}

/// What is wrong with a shard's index.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum IndexFault {
    #[error("has hash {got}, the manifest promises {want}: the file is another store's, or was changed")]
    Hash { got: ContentHash, want: ContentHash },
    #[error("has crc32c {got:08x}, it says {want:08x}")]
    Crc { got: u32, want: u32 },
    #[error("puts inner chunk {chunk} at offset {offset}, length {length}, outside the {data} bytes of data")]
    Entry { chunk: InnerChunk, offset: u64, length: u64, data: u64 },
}

/// What is wrong with an inner chunk.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ChunkFault {
    #[error("{0} bytes are too few for data and checksum")]
    Short(usize),
    #[error("crc32c is {got:08x}, it says {want:08x}")]
    Crc { got: u32, want: u32 },
    #[error("crc32c is {got:08x}, the manifest promises {want:08x}: it is another store's")]
    Foreign { got: u32, want: u32 },
    #[error("zstd: {0}")]
    Zstd(String),
    #[error("decodes to {got} bytes, {want} are due")]
    Length { got: usize, want: usize },
}

/// What is wrong with the record of a halo.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum HaloFault {
    #[error("the file ends before its end")]
    Cut,
    #[error(transparent)]
    Frame(#[from] ChunkFault),
    #[error("holds {got} bytes, {want} are due")]
    RecordLength { got: usize, want: usize },
    #[error("a palette of {labels} labels for {voxels} voxels")]
    Palette { labels: usize, voxels: usize },
    #[error("a voxel has the label at place {place} of a palette of {labels}")]
    Place { place: usize, labels: usize },
}
