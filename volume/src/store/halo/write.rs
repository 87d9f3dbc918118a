//! Writing a file of halos: append-only, the compressed records of brick after brick, in the grid's linear order.

use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;

use super::gather::{ShellGatherer, append};
use super::reach::{REGION_HALO, VOXEL_HALO};
use super::regions;
use super::sort::sorted;
use super::writer::{HaloWriter, WrittenHalos};
use crate::brick::BrickGrid;
use crate::store::error::StoreError;
use crate::store::tiles::{Tile, Tiles};
use crate::store::voxel::Cell;

/// The halos of the volume's voxels, tile by tile and slab by slab.
pub(crate) struct VoxelHalos<T> {
    grid: BrickGrid,
    /// Of bricks.
    layers: Range<u32>,
    gatherer: ShellGatherer<Vec<T>>,
    writer: HaloWriter,
}

impl<T: Cell> VoxelHalos<T> {
    /// Of the bricks that begin in `planes`.
    pub(crate) fn create(path: &Path, grid: BrickGrid, planes: &Range<u32>) -> Result<Self, StoreError> {
        let writer = HaloWriter::create(path, VOXEL_HALO.records())?;
        let [start, end] = [planes.start, planes.end].map(|z| z.div_ceil(grid.brick_size()));
        let gatherer = ShellGatherer::new(grid, VOXEL_HALO, Tile::whole(grid.volume_dims()), start..end);
        Ok(Self { grid, layers: start..end, gatherer, writer })
    }

    /// Goes on with the next tile.
    pub(crate) fn start(&mut self, tile: Tile) {
        self.gatherer = ShellGatherer::new(self.grid, VOXEL_HALO, tile, self.layers.clone());
    }

    /// Takes planes of the tile grown by the halo's reach; planes come in order, from the first that a halo of the
    /// layers reaches to the last.
    pub(crate) fn add(&mut self, planes: Range<u32>, slab: &[T]) -> Result<(), StoreError> {
        let take = |shell: &mut Vec<T>, run| append(shell, &slab[run]);
        self.gatherer.add(planes, take, |shells| self.writer.add(shells, |shell| voxel_record(shell)))
    }

    /// What was written; for volumes of one tile.
    pub(crate) fn finish(self) -> Result<WrittenHalos, StoreError> {
        self.writer.finish()
    }

    /// What was written tile by tile, in the grid's order at `path`; the file it was in is removed.
    pub(crate) fn finish_sorted(self, tiles: Tiles, path: &Path) -> Result<WrittenHalos, StoreError> {
        sorted(self.writer, (&self.grid, self.layers.len()), tiles, path)
    }
}

/// Voxels as in an inner chunk: the stored type, little endian.
fn voxel_record<T: Cell>(shell: &[T]) -> Option<Cow<'_, [u8]>> {
    if shell.iter().all(|v| *v == T::zeroed()) {
        return None;
    }
    if cfg!(target_endian = "big") {
        let little: Vec<T> = shell.iter().map(|v| v.swapped_le()).collect();
        return Some(Cow::Owned(bytemuck::cast_slice(&little).to_vec()));
    }
    Some(Cow::Borrowed(bytemuck::cast_slice(shell)))
}

/// The halos of labels and distances, slab by slab.
pub(crate) struct RegionHalos {
    gatherer: ShellGatherer<(Vec<u32>, Vec<u8>)>,
    writer: HaloWriter,
}

impl RegionHalos {
    pub(crate) fn create(path: &Path, grid: BrickGrid) -> Result<Self, StoreError> {
        let writer = HaloWriter::create(path, REGION_HALO.records())?;
        let gatherer = ShellGatherer::new(grid, REGION_HALO, Tile::whole(grid.volume_dims()), 0..grid.dims().z);
        Ok(Self { gatherer, writer })
    }

    /// Takes whole planes; planes come in order.
    pub(crate) fn add(&mut self, planes: Range<u32>, labels: &[u32], distances: &[u8]) -> Result<(), StoreError> {
        let take = |shell: &mut (Vec<u32>, Vec<u8>), run: Range<usize>| {
            append(&mut shell.0, &labels[run.clone()]);
            append(&mut shell.1, &distances[run]);
        };
        self.gatherer.add(planes, take, |shells| {
            self.writer.add(shells, |(labels, distances)| regions::encode(labels, distances).map(Cow::Owned))
        })
    }

    pub(crate) fn finish(self) -> Result<WrittenHalos, StoreError> {
        self.writer.finish()
    }
}
