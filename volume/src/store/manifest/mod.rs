//! What a store says of itself. A store is known by the hash of its manifest's bytes, and the manifest names the hash
//! of every other file, so that equal hashes mean equal stores.

pub(super) mod checks;
pub(super) mod file;
pub(super) mod halo;
pub(super) mod levels;
pub(super) mod notes;
mod of_level;
pub(super) mod regions;

use crate::brick::BrickGrid;
use crate::format::VoxelType;
use crate::space::Geometry;
use crate::store::hash::ContentHash;
use crate::store::no_data::NoData;
use crate::store::value_map::ValueMap;
use crate::store::voxel::StoredType;
use halo::HaloEntry;
use levels::LevelEntry;
use regions::RegionsEntry;

/// Shares of all voxels at which the manifest names values.
pub const QUANTILES: [f64; 9] = [0.001, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 0.999];
/// Bins of the manifest's histogram.
pub const HISTOGRAM_BINS: usize = 256;

/// What a store says of itself; parsed and validated from the bytes that the store's hash is of.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    /// Of the format; see [`crate::store::STORE_VERSION`].
    pub version: u64,
    /// 0 for a store; else which of its store's coarser levels this is the manifest of. That says of the whole volume
    /// what its store says of it, but for the counts of voxels: `histogram`, `no_data`, `regions`.
    pub level: u8,
    pub geometry: Geometry,
    pub grid: BrickGrid,
    /// Data values (file's units) that codes 0 and 65535 stand for; lo < hi. Where voxels lack data, lo is a code's
    /// width below [`Manifest::data_range`].
    pub range: (f64, f64),
    /// Otsu's threshold of all voxels, data units.
    pub otsu: f64,
    /// The 99.9 % quantile of all voxels, data units.
    pub quantile_999: f64,
    /// Name and version of the program that wrote the store.
    pub writer: String,
    pub source: Source,
    /// Unit of spacing and origin where the source names one, e.g. `mm`.
    pub space_unit: Option<String>,
    pub stored_type: StoredType,
    /// `value = scale * stored + offset`, data units.
    pub scale: f64,
    pub offset: f64,
    /// True where every voxel's value survives exactly.
    pub lossless: bool,
    /// Smallest and largest finite value of the source, data units.
    pub min: f64,
    pub max: f64,
    /// Mean of all voxels as stored, data units.
    pub mean: f64,
    pub not_finite: NotFinite,
    /// Nothing where every voxel holds data. Those that hold none count in none of the other numbers.
    pub no_data: Option<NoData>,
    /// Values that codes from the first one of data (0, or 1 where there are voxels without) to 65535 stand for.
    pub data_range: (f64, f64),
    /// Values at the shares [`QUANTILES`]: the smallest value whose cumulative share reaches it; data units.
    pub quantiles: [f64; 9],
    /// Voxels in [`HISTOGRAM_BINS`] equal bins over `range`; those outside count in the end bins.
    pub histogram: Vec<u64>,
    /// Standard deviation of what differs from voxel to voxel in homogeneous material, data units; nothing where there
    /// is none, or where it was not measured.
    pub noise: Option<f64>,
    pub files: FileHashes,
    /// Nothing where bricks are smaller than inner chunks.
    pub halo: Option<HaloEntry>,
    /// Nothing where the store was made without regions.
    pub regions: Option<RegionsEntry>,
    /// The coarser levels, from level 1 on.
    pub levels: Vec<LevelEntry>,
    /// What was guessed, mapped, counted or left aside on the way from the input, for people: harmless for a terminal,
    /// at most [`crate::store::MAX_NOTES`] of [`crate::store::MAX_NOTE_BYTES`].
    pub notes: Vec<String>,
}

/// The input that a store was made from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// File name without its directories, where known.
    pub name: Option<String>,
    /// Size of the file, where known.
    pub bytes: Option<u64>,
    /// Name of the file format, for people.
    pub format: String,
    pub voxel_type: VoxelType,
}

/// Voxels of the source that were no finite numbers: NaN holds no data, -Inf is stored as the smallest value, +Inf as
/// the largest.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct NotFinite {
    pub nan: u64,
    pub negative_infinity: u64,
    pub positive_infinity: u64,
}

impl NotFinite {
    #[must_use]
    pub fn total(&self) -> u64 {
        self.nan.saturating_add(self.negative_infinity).saturating_add(self.positive_infinity)
    }

    /// What became of infinite voxels, for people.
    pub(super) fn words(&self) -> Option<String> {
        let Self { negative_infinity, positive_infinity, .. } = self;
        (*negative_infinity > 0 || *positive_infinity > 0).then(|| {
            format!(
                "{negative_infinity} -Inf voxels became the smallest value, {positive_infinity} +Inf voxels the largest"
            )
        })
    }
}

/// Hashes of the files that every store has: cells from version 7 on, means from version 10 on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileHashes {
    /// `zarr.json`: the OME-Zarr group.
    pub group: ContentHash,
    /// `0/zarr.json`: the array.
    pub array: ContentHash,
    /// `bricks.bin`: the brick ranges.
    pub ranges: ContentHash,
    /// `shards.bin`: length and hash of every shard.
    pub shards: ContentHash,
    /// `cells.bin`: the cell ranges. Nothing in stores before version 7.
    pub cells: Option<ContentHash>,
    /// `means.bin`: the mean ranges. Nothing in stores before version 10.
    pub means: Option<ContentHash>,
}

impl FileHashes {
    /// Of files that are still to be written.
    pub(super) const UNKNOWN: Self = {
        let unknown = ContentHash(0);
        Self {
            group: unknown,
            array: unknown,
            ranges: unknown,
            shards: unknown,
            cells: Some(unknown),
            means: Some(unknown),
        }
    };
}

impl Manifest {
    /// The longest manifest that is read, in bytes.
    pub const MAX_BYTES: u64 = 1 << 20;

    #[must_use]
    pub fn value_map(&self) -> ValueMap {
        let (stored_type, no_data) = (self.stored_type, self.no_data.as_ref().map(|n| n.stored));
        ValueMap { stored_type, scale: self.scale, offset: self.offset, range: self.range, no_data }
    }

    /// The value, in the file's units, of a number as the store's array holds it.
    #[must_use]
    pub fn value_of_stored(&self, stored: i32) -> f64 {
        self.value_map().value_of_stored(stored)
    }

    /// The stretched code of a value in the file's units, clamped; NaN has code 0.
    #[must_use]
    pub fn code_of_value(&self, value: f64) -> u16 {
        self.value_map().code_of_value(value)
    }

    /// The value in the file's units that a stretched code stands for.
    #[must_use]
    pub fn value_of_code(&self, code: u16) -> f64 {
        self.value_map().value_of_code(code)
    }
}
