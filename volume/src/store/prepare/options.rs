//! How a store is made, and what came of it.

use std::path::PathBuf;

use super::step_map::StepMap;
use crate::format::{Opener, RawHints, VolumeSource};
use crate::ids::StoreHash;
use crate::store::error::StoreError;
use crate::store::manifest::Manifest;
use crate::store::tiles::MAX_TILE_VOXELS;
use crate::store::value_map::default_range;
use crate::store::view::ViewInput;

/// How a store is made.
#[derive(Debug, Clone, PartialEq)]
pub struct PrepareOptions {
    /// Voxels per brick edge, a power of two in 8..=512. Shards and inner chunks do not depend on it.
    pub brick_size: u32,
    /// Values, in the file's units, that codes 0 and 65535 stand for; by default the smallest and largest voxel.
    pub range: Option<(f64, f64)>,
    /// Replace a store that is there already; at the end, not before.
    pub force: bool,
    /// Name of the input for the manifest; directories are left out.
    pub source_name: Option<String>,
    /// Size of the input in bytes for the manifest.
    pub source_bytes: Option<u64>,
    /// Find regions that rays leap through; by default none.
    pub regions: Option<RegionOptions>,
    /// Coarser levels of detail.
    pub levels: Levels,
    /// The voxels lie here, and stay here: what is made is a view of them. The store's hash does not depend on it.
    pub view: Option<ViewInput>,
    /// The most voxels of a plane that are held at once: planes of more are prepared in tiles. The store does not
    /// depend on it.
    pub tile_voxels: u64,
    /// Of a step of a series: what all its steps have in common.
    pub steps: Option<StepMap>,
}

/// How many coarser levels of detail a store has, each of half as many voxels on every axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Levels {
    /// As many as it takes until the volume is one brick.
    #[default]
    Auto,
    /// No more than these, and no more than [`Levels::Auto`] has; 0 is none.
    AtMost(u8),
}

impl Levels {
    pub(crate) fn most(self) -> u8 {
        match self {
            Self::Auto => u8::MAX,
            Self::AtMost(most) => most,
        }
    }
}

/// How regions are found.
#[derive(Debug, Clone, PartialEq)]
pub struct RegionOptions {
    pub segmentation: Segmentation,
    /// Regions of fewer voxels are left out, on each level of its own voxels; 0 and 1 leave out none.
    pub min_region: u64,
}

/// Where regions come from; `range` is the largest difference within a region, a share (above 0, at most 1) of the
/// range that the store's codes are stretched over.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "there is one for each store that is made")]
pub enum Segmentation {
    /// Components of value windows, which are placed at the histogram's masses.
    Windows { range: f64 },
    /// The paper's seeded flood fill in raster order, in memory, for comparison.
    Flood { range: f64 },
    /// A label volume, taken as it is; 0 is no region.
    Labels { path: PathBuf, hints: RawHints, opener: Opener },
}

impl Default for PrepareOptions {
    fn default() -> Self {
        Self {
            brick_size: 64,
            range: None,
            force: false,
            source_name: None,
            source_bytes: None,
            regions: None,
            levels: Levels::Auto,
            view: None,
            tile_voxels: MAX_TILE_VOXELS,
            steps: None,
        }
    }
}

impl PrepareOptions {
    /// What codes 0 and 65535 are to stand for, where that does not follow from the input alone.
    pub(super) fn range(&self) -> Option<(f64, f64)> {
        self.range.or(self.steps.map(|steps| default_range(steps.bounds.0, steps.bounds.1)))
    }

    /// Every file that a store of `source` is made from; none where all is in memory.
    ///
    /// # Errors
    /// A label volume that cannot be opened.
    pub fn inputs(&self, source: &dyn VolumeSource) -> Result<Vec<PathBuf>, StoreError> {
        let mut files = source.files().to_vec();
        if let Some(Segmentation::Labels { path, hints, opener }) = self.regions.as_ref().map(|r| &r.segmentation) {
            files.extend_from_slice(opener.open(path, hints)?.files());
        }
        Ok(files)
    }
}

/// What was made.
#[derive(Debug, Clone)]
pub struct PrepareSummary {
    pub hash: StoreHash,
    pub manifest: Manifest,
    /// Bytes of all files of the store.
    pub store_bytes: u64,
    /// Seconds that regions took.
    pub region_seconds: f64,
}
