//! What a series of stores says of itself (docs/adr/0024-time.md). A series is known by the hash of its manifest's
//! bytes, which names the hash of every step.

pub(super) mod file;
mod statistics;

use crate::ids::StoreHash;
use crate::store::hash::ContentHash;

pub use statistics::CommonStatistics;

/// The most steps of a series; with their hashes and times the manifest stays below [`SeriesManifest::MAX_BYTES`].
pub const MAX_STEPS: usize = 10_000;

/// What a series says of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct SeriesManifest {
    /// At least one.
    pub steps: Vec<StepEntry>,
    /// Unit of the steps' times where one is known, e.g. `second`.
    pub time_unit: Option<String>,
    /// Of all steps together.
    pub statistics: CommonStatistics,
    /// Of `zarr.json` and `OME/zarr.json`.
    pub(super) files: [ContentHash; 2],
}

/// One step: its folder is its number, counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepEntry {
    pub hash: StoreHash,
    /// When it was, where that is known; later than the step before.
    pub time: Option<f64>,
}

#[cfg(test)]
mod tests;
