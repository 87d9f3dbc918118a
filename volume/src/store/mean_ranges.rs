//! The table of mean ranges: what a level's own voxels are, cell by cell. Beside that of the finest level it tells what
//! a coarser one hides.
//!
//! Invariant: a range is of the voxels *in* the cell, without a margin, so that of two levels it is of the same place.

use glam::UVec3;

use super::brick_ranges::{Cubes, table_from_bytes, table_to_bytes};
use super::cell_ranges::{Cells, cells_of};
use super::error::StoreError;
use super::manifest::Manifest;

/// Smallest and largest stretched code of a level's own voxels in each cell, x fastest: means of the finest, but on
/// level 0 those themselves. [`super::BrickRanges::NONE`] where a cell holds no data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeanRanges {
    cells: Cells,
    ranges: Vec<[u16; 2]>,
}

/// The cells of `cells.bin`, without their margin.
pub(super) fn cubes_of(dims: UVec3, level: u8) -> Cubes {
    Cubes { margin: 0, ..cells_of(dims, level) }
}

impl MeanRanges {
    pub(super) fn new(cubes: Cubes, ranges: Vec<[u16; 2]>) -> Self {
        Self { cells: Cells::new(cubes), ranges }
    }

    /// The bytes of `means.bin`; nothing where the store has none.
    ///
    /// # Errors
    /// Bytes that are not the ones that `manifest` speaks of.
    pub fn from_bytes(manifest: &Manifest, bytes: &[u8]) -> Result<Option<Self>, StoreError> {
        let Some(hash) = manifest.files.means else { return Ok(None) };
        let cubes = cubes_of(manifest.geometry.dims(), manifest.level);
        let ranges = table_from_bytes("cell", cubes, bytes, hash, manifest.no_data.is_some())?;
        Ok(Some(Self::new(cubes, ranges)))
    }

    /// Of a volume that is nowhere: `range` by the middle of a cell, in voxels of the level.
    #[cfg(test)]
    pub(crate) fn made(dims: UVec3, level: u8, mut range: impl FnMut(glam::DVec3) -> [u16; 2]) -> Self {
        let cubes = cubes_of(dims.map(|n| n.div_ceil(1 << level)), level);
        let middle = |place| (cubes.at(place).as_dvec3() + 0.5) * f64::from(cubes.edge);
        Self::new(cubes, (0..cubes.count() as usize).map(|place| range(middle(place))).collect())
    }

    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        table_to_bytes(&self.ranges)
    }

    #[must_use]
    pub fn cells(&self) -> Cells {
        self.cells
    }

    /// In the order of the table.
    #[must_use]
    pub fn ranges(&self) -> &[[u16; 2]] {
        &self.ranges
    }
}
