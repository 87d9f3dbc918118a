//! The table of cell ranges: the volume seen from afar, for whoever asks where something shows without reading voxels.

use glam::UVec3;

use super::brick_ranges::{BrickRanges, Cubes, table_from_bytes, table_to_bytes};
use super::error::StoreError;
use super::manifest::Manifest;
use crate::brick::OwnedBox;

/// The smallest edge of a cell, voxels of level 0.
const SMALLEST_EDGE: u32 = 4;
/// The most cells: keeps the table within 1 MiB, whatever the volume.
pub(super) const MAX_CELLS: u64 = 1 << 18;
/// A sample in a cell reads at most one voxel beyond it.
const MARGIN: u32 = 1;

/// Smallest and largest stretched code that a sample in a cell can meet, x fastest; voxels without data left out,
/// [`BrickRanges::NONE`] where a cell meets no data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CellRanges {
    /// Voxels per edge.
    edge: u32,
    /// The volume's.
    dims: UVec3,
    ranges: Vec<[u16; 2]>,
}

/// The cells of a volume of `dims` voxels: of the smallest edge, a power of two from 4 on, that leaves at most 2^18 of
/// them. Those of a coarser level are the same cubes of space, as far as its voxels can tell them apart.
pub(super) fn cells_of(dims: UVec3, level: u8) -> Cubes {
    let edge = SMALLEST_EDGE.checked_shr(level.into()).unwrap_or(0).max(1);
    let mut cubes = Cubes { dims, edge, margin: MARGIN };
    while cubes.count() > MAX_CELLS {
        cubes.edge *= 2;
    }
    cubes
}

/// Where the cells of a volume lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cells {
    /// Voxels per edge.
    edge: u32,
    /// The volume's.
    dims: UVec3,
}

impl Cells {
    pub(super) fn new(cubes: Cubes) -> Self {
        Self { edge: cubes.edge, dims: cubes.dims }
    }

    fn cubes(self) -> Cubes {
        Cubes { dims: self.dims, edge: self.edge, margin: 0 }
    }

    #[must_use]
    pub fn edge(self) -> u32 {
        self.edge
    }

    /// The volume's, voxels.
    #[must_use]
    pub fn dims(self) -> UVec3 {
        self.dims
    }

    #[must_use]
    pub fn count(self) -> usize {
        self.cubes().count() as usize
    }

    /// The place of the cell that a voxel lies in.
    #[must_use]
    pub fn place(self, voxel: UVec3) -> usize {
        // A power of two long.
        let (n, at) = (self.counts(), voxel >> self.edge.trailing_zeros());
        ((at.z * n.y + at.y) * n.x + at.x) as usize
    }

    /// Per axis.
    #[must_use]
    pub fn counts(self) -> UVec3 {
        self.cubes().counts()
    }

    /// The voxels of the cell at a place of a table.
    #[must_use]
    pub fn voxels(self, place: usize) -> OwnedBox {
        let lo = self.cubes().at(place) * self.edge;
        OwnedBox { lo, hi: (lo + self.edge).min(self.dims) }
    }

    /// The places of the cells that some voxels lie in; none of those beyond the volume.
    pub fn around(self, voxels: &OwnedBox) -> impl Iterator<Item = usize> + use<> {
        let n = self.counts();
        let (lo, hi) = (voxels.lo / self.edge, voxels.hi.map(|v| v.div_ceil(self.edge)).min(n));
        let row = move |y, z| (lo.x..hi.x).map(move |x| ((z * n.y + y) * n.x + x) as usize);
        (lo.z..hi.z).flat_map(move |z| (lo.y..hi.y).flat_map(move |y| row(y, z)))
    }
}

impl CellRanges {
    pub(super) fn new(cubes: Cubes, ranges: Vec<[u16; 2]>) -> Self {
        Self { edge: cubes.edge, dims: cubes.dims, ranges }
    }

    /// Bricks in place of cells: what is known of stores that were written before there were any.
    #[must_use]
    pub fn of_bricks(manifest: &Manifest, ranges: &BrickRanges) -> Self {
        Self::new(Cubes::bricks(manifest.grid), ranges.0.clone())
    }

    #[must_use]
    pub fn cells(&self) -> Cells {
        Cells { edge: self.edge, dims: self.dims }
    }

    /// In the order of the table.
    #[must_use]
    pub fn ranges(&self) -> &[[u16; 2]] {
        &self.ranges
    }

    /// The bytes of `cells.bin`; nothing where the store has none.
    ///
    /// # Errors
    /// Bytes that are not the ones that `manifest` speaks of.
    pub fn from_bytes(manifest: &Manifest, bytes: &[u8]) -> Result<Option<Self>, StoreError> {
        let Some(hash) = manifest.files.cells else { return Ok(None) };
        let cubes = cells_of(manifest.geometry.dims(), manifest.level);
        let ranges = table_from_bytes("cell", cubes, bytes, hash, manifest.no_data.is_some())?;
        Ok(Some(Self::new(cubes, ranges)))
    }

    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        table_to_bytes(&self.ranges)
    }

    /// The smallest box of voxels around all cells whose range of codes `shows`; nothing where none does. Cells without
    /// data show nothing.
    #[must_use]
    pub fn box_of(&self, shows: impl Fn([u16; 2]) -> bool) -> Option<OwnedBox> {
        let cubes = Cubes { dims: self.dims, edge: self.edge, margin: 0 };
        let shown = self.ranges.iter().enumerate().filter(|(_, range)| range[0] <= range[1] && shows(**range));
        let (lo, hi) = shown.fold((UVec3::MAX, UVec3::ZERO), |(lo, hi), (index, _)| {
            let cell = cubes.at(index);
            (lo.min(cell), hi.max(cell + 1))
        });
        lo.cmplt(hi).all().then(|| OwnedBox { lo: lo * self.edge, hi: (hi * self.edge).min(self.dims) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_as_small_as_a_mebibyte_allows() {
        for (dims, edge) in [([1, 1, 1], 4), ([256; 3], 4), ([257, 256, 256], 8), ([512; 3], 8), ([2048; 3], 32)] {
            let cubes = cells_of(UVec3::from(dims), 0);
            assert_eq!(cubes.edge, edge, "{dims:?}");
            assert!(cubes.count() <= MAX_CELLS);
        }
        // The largest volume that can be.
        assert!(cells_of(UVec3::splat(1 << 16), 0).count() <= MAX_CELLS);
    }

    #[test]
    fn cells_of_all_levels_are_the_same_cubes_until_a_voxel_is_larger() {
        for dims in [UVec3::new(256, 200, 31), UVec3::splat(512), UVec3::new(2047, 1, 900)] {
            let finest = cells_of(dims, 0);
            for level in 0..=9_u8 {
                let cubes = cells_of(dims.map(|n| n.div_ceil(1 << level)), level);
                let edge = finest.edge.max(1 << level);
                assert_eq!(cubes.edge << level, edge, "{dims} on level {level}");
                assert_eq!(cubes.counts(), dims.map(|n| n.div_ceil(edge)));
            }
        }
    }

    #[test]
    fn the_box_is_around_all_that_shows_and_no_larger() {
        let dims = UVec3::new(17, 9, 10);
        let cubes = cells_of(dims, 0);
        let count = cubes.count() as usize;
        let mut ranges = vec![[5, 6]; count];
        let all = CellRanges::new(cubes, ranges.clone());
        assert_eq!(all.box_of(|_| true), Some(OwnedBox { lo: UVec3::ZERO, hi: dims }));
        assert_eq!(all.box_of(|_| false), None);
        // Cell (4, 1, 2), which the volume's end cuts, and (1, 1, 1).
        ranges[4 + 5 * (1 + 3 * 2)] = [5, 9];
        ranges[1 + 5 * (1 + 3)] = [0, 9];
        let cells = CellRanges::new(cubes, ranges.clone());
        let shows = |[_, hi]: [u16; 2]| hi > 8;
        assert_eq!(cells.box_of(shows), Some(OwnedBox { lo: UVec3::new(4, 4, 4), hi: UVec3::new(17, 8, 10) }));
        ranges[4 + 5 * (1 + 3 * 2)] = BrickRanges::NONE;
        let without = CellRanges::new(cubes, ranges).box_of(shows);
        assert_eq!(without, Some(OwnedBox { lo: UVec3::splat(4), hi: UVec3::splat(8) }), "no data shows nothing");
    }
}
