//! Blocks of cells: what of a volume is always drawn on one level.

use glam::UVec3;

use super::drawn::OfLevel;
use crate::brick::OwnedBox;
use crate::store::Cells;

/// Cubes of cells, each all in one chunk of any level that may be drawn: as long as the chunks of the finest of these.
#[derive(Debug)]
pub(super) struct Blocks {
    /// In voxels of the finest level, and in cells.
    edge: u32,
    cells_long: u32,
    /// Per axis.
    counts: UVec3,
    cells: UVec3,
}

/// Cells side by side along x.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    /// The first one: in the table, and in the grid of cells.
    pub(super) place: usize,
    pub(super) at: UVec3,
    pub(super) long: u32,
}

impl Row {
    pub(super) fn places(&self) -> std::ops::Range<usize> {
        self.place..self.place + self.long as usize
    }

    /// Each cell's place in the table and in the grid.
    pub(super) fn cells(&self) -> impl Iterator<Item = (usize, UVec3)> + use<> {
        let Self { place, at, long } = *self;
        (0..long).map(move |i| (place + i as usize, UVec3::new(at.x + i, at.y, at.z)))
    }
}

impl Blocks {
    pub(super) fn new(cells: Cells, levels: &[OfLevel]) -> Self {
        let edge = |of: &OfLevel| (of.tree.chunk_bricks() * of.tree.grid().brick_size()) << u32::from(of.level);
        // There are more cells than chunks, and both are powers of two long: none lies in two.
        let edge = levels.iter().map(edge).min().unwrap_or(0).max(cells.edge());
        let cells_long = edge / cells.edge();
        Self { edge, cells_long, counts: cells.counts().map(|n| n.div_ceil(cells_long)), cells: cells.counts() }
    }

    pub(super) fn count(&self) -> usize {
        self.counts.element_product() as usize
    }

    fn at(&self, block: usize) -> UVec3 {
        let (n, block) = (self.counts, block as u32);
        UVec3::new(block % n.x, block / n.x % n.y, block / (n.x * n.y))
    }

    fn number(&self, at: UVec3) -> usize {
        ((at.z * self.counts.y + at.y) * self.counts.x + at.x) as usize
    }

    /// That of the cell at a place.
    pub(super) fn of(&self, place: usize) -> usize {
        let (n, place) = (self.cells, place as u32);
        self.number(UVec3::new(place % n.x, place / n.x % n.y, place / (n.x * n.y)) / self.cells_long)
    }

    /// The blocks in a chunk's box, which may reach beyond the volume.
    pub(super) fn within(&self, voxels: &OwnedBox) -> impl Iterator<Item = usize> + '_ {
        let hi = voxels.hi.map(|v| v.div_ceil(self.edge)).min(self.counts);
        boxed(voxels.lo / self.edge, hi).map(|at| self.number(at))
    }

    /// A block, and those around it in which a cell lies that is at most so many away.
    pub(super) fn around(&self, block: usize, cells: u32) -> impl Iterator<Item = usize> + '_ {
        let (at, reach) = (self.at(block), cells.div_ceil(self.cells_long));
        let hi = (at + reach + 1).min(self.counts);
        boxed(at.saturating_sub(UVec3::splat(reach)), hi).map(|at| self.number(at))
    }

    /// A block's cells.
    fn cells(&self, block: usize) -> (UVec3, UVec3) {
        let lo = self.at(block) * self.cells_long;
        (lo, (lo + self.cells_long).min(self.cells))
    }

    pub(super) fn rows(&self, block: usize) -> impl Iterator<Item = Row> + use<> {
        self.rows_near(block, (block, 0))
    }

    /// The cells of a block that are at most so many away from another.
    pub(super) fn rows_near(&self, block: usize, (other, away): (usize, u32)) -> impl Iterator<Item = Row> + use<> {
        let ((lo, hi), (from, to)) = (self.cells(block), self.cells(other));
        let (lo, hi, n) = (lo.max(from.saturating_sub(UVec3::splat(away))), hi.min(to + away), self.cells);
        let place = move |at: UVec3| ((at.z * n.y + at.y) * n.x + at.x) as usize;
        boxed(lo, UVec3::new(hi.x.min(lo.x + 1), hi.y, hi.z)).map(move |at| Row {
            place: place(at),
            at,
            long: hi.x - lo.x,
        })
    }

    /// How many places it is to the next cell along each axis.
    pub(super) fn steps(&self) -> [usize; 3] {
        [1, self.cells.x as usize, (self.cells.x * self.cells.y) as usize]
    }

    /// Whether a cell is the first of its block along an axis, the last, and whether one follows.
    pub(super) fn ends(&self, at: UVec3, axis: usize) -> [bool; 3] {
        let (at, mask) = (at[axis], self.cells_long - 1);
        [at & mask == 0, at & mask == mask || at + 1 == self.cells[axis], at + 1 < self.cells[axis]]
    }
}

fn boxed(lo: UVec3, hi: UVec3) -> impl Iterator<Item = UVec3> {
    let row = move |y, z| (lo.x..hi.x).map(move |x| UVec3::new(x, y, z));
    (lo.z..hi.z).flat_map(move |z| (lo.y..hi.y).flat_map(move |y| row(y, z)))
}
