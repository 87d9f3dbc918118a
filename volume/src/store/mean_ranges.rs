//! The table of mean ranges: what the voxels of a coarser level are, beside the finest voxels under them. It tells what
//! the level hides.
//!
//! Invariant: of each cell both ranges are of the voxels *in* it, without a margin, so the smallest and the largest
//! mean are those of voxels that stand for the very finest voxels of the other range.

use super::brick_ranges::{BrickRanges, Cubes, table_from_bytes, table_to_bytes};
use super::cell_ranges::{Cells, cells_of};
use super::error::{RangesError, StoreError};
use super::manifest::Manifest;
use crate::ids::BrickIndex;

/// Of a cell of a coarser level: smallest and largest stretched codes, [`BrickRanges::NONE`] where it holds no data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeanRange {
    /// Of the finest voxels under its voxels.
    pub finest: [u16; 2],
    /// Of its voxels, which are means of those.
    pub means: [u16; 2],
}

/// Of every cell of a coarser level, x fastest.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeanRanges {
    cells: Cells,
    ranges: Vec<MeanRange>,
}

/// The cells of `cells.bin`, without their margin.
pub(super) fn cubes_of(dims: glam::UVec3, level: u8) -> Cubes {
    Cubes { margin: 0, ..cells_of(dims, level) }
}

/// The length of `means.bin`.
pub(super) fn bytes_of(manifest: &Manifest) -> u64 {
    cubes_of(manifest.geometry.dims(), manifest.level).count() * 8
}

impl MeanRanges {
    /// `finest` and `means` have a range for each of `cubes`.
    pub(super) fn new(cubes: Cubes, finest: Vec<[u16; 2]>, means: Vec<[u16; 2]>) -> Self {
        let ranges = finest.into_iter().zip(means).map(|(finest, means)| MeanRange { finest, means });
        Self { cells: Cells::new(cubes), ranges: ranges.collect() }
    }

    /// The bytes of `means.bin`; nothing where the store has none: it is no coarser level, or older than version 10.
    ///
    /// # Errors
    /// Bytes that are not the ones that `manifest` speaks of; means that are none of the finest voxels.
    pub fn from_bytes(manifest: &Manifest, bytes: &[u8]) -> Result<Option<Self>, StoreError> {
        let Some(hash) = manifest.files.means else { return Ok(None) };
        let cubes = cubes_of(manifest.geometry.dims(), manifest.level);
        let table = table_from_bytes(("cell", 2), cubes, bytes, hash, manifest.no_data.is_some())?;
        let (finest, means) = table.as_chunks::<2>().0.iter().map(|[finest, means]| (*finest, *means)).unzip();
        let all = Self::new(cubes, finest, means);
        let is_among = |MeanRange { finest, means }: &MeanRange| {
            if *finest == BrickRanges::NONE { means == finest } else { finest[0] <= means[0] && means[1] <= finest[1] }
        };
        match all.ranges.iter().position(|range| !is_among(range)) {
            None => Ok(Some(all)),
            Some(place) => {
                let MeanRange { finest, means } = all.ranges[place];
                Err(RangesError::Means { at: BrickIndex(cubes.at(place).to_array()), finest, means }.into())
            }
        }
    }

    /// Of each cell both ranges, u16 little endian, the finest voxels' first.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        table_to_bytes(self.ranges.iter().flat_map(|range| [&range.finest, &range.means]))
    }

    #[must_use]
    pub fn cells(&self) -> Cells {
        self.cells
    }

    /// In the order of the table.
    #[must_use]
    pub fn ranges(&self) -> &[MeanRange] {
        &self.ranges
    }
}
