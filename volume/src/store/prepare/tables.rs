//! The tables of ranges of one level, as its voxels, or those that they stand for, pass by.

use std::ops::Range;

use crate::brick::BrickGrid;
use crate::store::brick_ranges::{BrickRanges, Cubes, RangeBuilder};
use crate::store::cell_ranges::{CellRanges, cells_of};
use crate::store::mean_ranges::{self, MeanRanges};
use crate::store::tiles::Tile;
use crate::store::voxel::Voxel;

/// Ranges of bricks and of cells, and of its own voxels in cells.
#[derive(Debug)]
pub(crate) struct Tables {
    cells: Cubes,
    of_bricks: RangeBuilder,
    of_cells: RangeBuilder,
    of_means: RangeBuilder,
}

/// A plane of a coarser level's voxels, as ordinals; of voxels without data the lowest is above the highest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MeanPlane<'a> {
    /// Of the finest voxels under each.
    pub(crate) low: &'a [u16],
    pub(crate) high: &'a [u16],
    /// Their mean, twice, but where there are none.
    pub(crate) means: [&'a [u16]; 2],
}

/// The bytes of the tables.
pub(crate) struct TableBytes {
    pub(crate) of_bricks: Vec<u8>,
    pub(crate) of_cells: Vec<u8>,
    pub(crate) of_means: Vec<u8>,
}

impl Tables {
    /// `no_data` is the ordinal of voxels without data.
    pub(crate) fn new(grid: BrickGrid, level: u8, no_data: Option<u16>) -> Self {
        let cells = cells_of(grid.volume_dims(), level);
        let of_bricks = RangeBuilder::new(Cubes::bricks(grid), no_data);
        let of_means = RangeBuilder::new(mean_ranges::cubes_of(grid.volume_dims(), level), no_data);
        Self { cells, of_bricks, of_cells: RangeBuilder::new(cells, no_data), of_means }
    }

    /// See [`RangeBuilder::add`].
    pub(crate) fn add<T: Voxel>(&mut self, tile: &Tile, z0: u32, slab: &[T]) {
        self.of_bricks.add(tile, z0, slab);
        self.of_cells.add(tile, z0, slab);
        self.of_means.add(tile, z0, slab);
    }

    /// See [`RangeBuilder::add_bounds`].
    pub(crate) fn add_means(&mut self, tile: &Tile, z: u32, MeanPlane { low, high, means }: MeanPlane<'_>) {
        self.of_bricks.add_bounds(tile, z, low, high);
        self.of_cells.add_bounds(tile, z, low, high);
        self.of_means.add_bounds(tile, z, means[0], means[1]);
    }

    /// What voxels of these planes say, u16 little endian.
    pub(crate) fn part(&self, planes: Range<u32>) -> Vec<u8> {
        let all = [&self.of_bricks, &self.of_cells, &self.of_means];
        let ranges = all.into_iter().flat_map(|of| of.part(&planes));
        ranges.flatten().flat_map(|ordinal| ordinal.to_le_bytes()).collect()
    }

    /// Takes what voxels of these planes say from elsewhere, which are as many bytes as is returned.
    pub(crate) fn join(&mut self, planes: Range<u32>, bytes: &[u8]) -> usize {
        let mut ranges = bytes.as_chunks::<4>().0.iter().map(|b| [[b[0], b[1]], [b[2], b[3]]].map(u16::from_le_bytes));
        let all = [&mut self.of_bricks, &mut self.of_cells, &mut self.of_means];
        let taken: usize = all.map(|of| of.join(&planes, &mut ranges)).into_iter().sum();
        taken * size_of::<[u16; 2]>()
    }

    pub(crate) fn finish(self, code_of_ordinal: &[u16]) -> TableBytes {
        TableBytes {
            of_bricks: BrickRanges(self.of_bricks.finish(code_of_ordinal)).to_bytes(),
            of_cells: CellRanges::new(self.cells, self.of_cells.finish(code_of_ordinal)).to_bytes(),
            of_means: MeanRanges::new(self.cells, self.of_means.finish(code_of_ordinal)).to_bytes(),
        }
    }
}
