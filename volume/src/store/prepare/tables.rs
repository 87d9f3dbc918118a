//! The tables of ranges of one level, as its voxels pass by.

use std::ops::Range;

use crate::brick::BrickGrid;
use crate::store::brick_ranges::{BrickRanges, Cubes, RangeBuilder};
use crate::store::cell_ranges::{CellRanges, cells_of};
use crate::store::tiles::Tile;
use crate::store::voxel::Voxel;

/// Ranges of bricks and of cells.
#[derive(Debug)]
pub(crate) struct Tables {
    cells: Cubes,
    of_bricks: RangeBuilder,
    of_cells: RangeBuilder,
}

impl Tables {
    /// `no_data` is the ordinal of voxels without data.
    pub(crate) fn new(grid: BrickGrid, level: u8, no_data: Option<u16>) -> Self {
        let cells = cells_of(grid.volume_dims(), level);
        let of_bricks = RangeBuilder::new(Cubes::bricks(grid), no_data);
        Self { cells, of_bricks, of_cells: RangeBuilder::new(cells, no_data) }
    }

    /// See [`RangeBuilder::add`].
    pub(crate) fn add<T: Voxel>(&mut self, tile: &Tile, z0: u32, slab: &[T]) {
        self.of_bricks.add(tile, z0, slab);
        self.of_cells.add(tile, z0, slab);
    }

    /// See [`RangeBuilder::add_bounds`].
    pub(crate) fn add_bounds(&mut self, tile: &Tile, z: u32, low: &[u16], high: &[u16]) {
        self.of_bricks.add_bounds(tile, z, low, high);
        self.of_cells.add_bounds(tile, z, low, high);
    }

    /// What voxels of these planes say, u16 little endian.
    pub(crate) fn part(&self, planes: Range<u32>) -> Vec<u8> {
        let ranges = [&self.of_bricks, &self.of_cells].map(|of| of.part(&planes));
        ranges.into_iter().flatten().flatten().flat_map(|ordinal| ordinal.to_le_bytes()).collect()
    }

    /// Takes what voxels of these planes say from elsewhere, which are as many bytes as is returned.
    pub(crate) fn join(&mut self, planes: Range<u32>, bytes: &[u8]) -> usize {
        let mut ranges = bytes.as_chunks::<4>().0.iter().map(|b| [[b[0], b[1]], [b[2], b[3]]].map(u16::from_le_bytes));
        let taken = [&mut self.of_bricks, &mut self.of_cells].map(|of| of.join(&planes, &mut ranges));
        taken.iter().sum::<usize>() * size_of::<[u16; 2]>()
    }

    /// The bytes of `bricks.bin` and of `cells.bin`.
    pub(crate) fn finish(self, code_of_ordinal: &[u16]) -> [Vec<u8>; 2] {
        let bricks = BrickRanges(self.of_bricks.finish(code_of_ordinal)).to_bytes();
        [bricks, CellRanges::new(self.cells, self.of_cells.finish(code_of_ordinal)).to_bytes()]
    }
}
