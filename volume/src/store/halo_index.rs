//! The index of a file of halos: where each brick's record lies, and its checksum. Named by the manifest's hash, it binds the
//! records to the store: a file of another store's halos is found at the first record read.

use super::error::StoreError;
use crate::brick::BrickGrid;
use crate::ids::BrickIndex;

/// Bytes of a brick: length and crc32c of its record, u32 little endian.
pub(super) const ENTRY_BYTES: usize = 8;

/// One record as the index has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct HaloRecord {
    /// Position in the file.
    pub(super) start: u64,
    /// Bytes; 0 where the halo holds nothing but fill values.
    pub(super) length: u32,
    pub(super) crc: u32,
}

/// Records lie one after the other in the grid's linear order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct HaloIndex {
    entries: Vec<(u32, u32)>,
    /// Where each record starts, and where the last one ends.
    starts: Vec<u64>,
}

impl HaloIndex {
    /// Length and crc32c per brick; lengths are 32 bits, so their sum cannot overflow.
    pub(super) fn new(entries: Vec<(u32, u32)>) -> Self {
        let ends = entries.iter().scan(0, |end, (length, _)| {
            *end += u64::from(*length);
            Some(*end)
        });
        let starts = std::iter::once(0).chain(ends).collect();
        Self { entries, starts }
    }

    /// The length of `bytes` must have been checked. `bound` says the longest that a brick's record can be.
    pub(super) fn from_bytes(
        bytes: &[u8],
        grid: &BrickGrid,
        bound: impl Fn(BrickIndex) -> u64,
    ) -> Result<Self, StoreError> {
        let number = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let entries: Vec<_> = bytes.as_chunks::<ENTRY_BYTES>().0.iter().map(|b| (number(b), number(&b[4..]))).collect();
        let too_long = grid.bricks().zip(&entries).find(|(brick, (length, _))| u64::from(*length) > bound(*brick));
        match too_long {
            Some((brick, (length, _))) => Err(StoreError::HaloIndex { brick, bytes: (*length).into() }),
            None => Ok(Self::new(entries)),
        }
    }

    pub(super) fn to_bytes(&self) -> Vec<u8> {
        self.entries.iter().flat_map(|(length, crc)| [*length, *crc]).flat_map(u32::to_le_bytes).collect()
    }

    /// Bytes of the file of records.
    pub(super) fn file_bytes(&self) -> u64 {
        self.starts.last().copied().unwrap_or(0)
    }

    /// The record of the brick at a position of the grid's linear order.
    pub(super) fn record(&self, linear: usize) -> HaloRecord {
        let (length, crc) = self.entries[linear];
        HaloRecord { start: self.starts[linear], length, crc }
    }

    /// The first brick, in linear order, whose record is not whole in a file of `bytes`, fewer than there should be.
    pub(super) fn first_cut(&self, bytes: u64) -> usize {
        self.starts[1..].partition_point(|end| *end <= bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec3;

    #[test]
    fn the_index_survives_its_bytes_and_lengths_are_bounded() {
        let grid = BrickGrid::new(UVec3::new(64, 16, 16), 16).unwrap();
        let index = HaloIndex::new(vec![(10, 1), (0, 0), (7, 2), (5, u32::MAX)]);
        assert_eq!(index.record(2), HaloRecord { start: 10, length: 7, crc: 2 });
        assert_eq!(index.file_bytes(), 22);
        for (bytes, brick) in [(0, 0), (9, 0), (10, 2), (16, 2), (17, 3), (21, 3)] {
            assert_eq!(index.first_cut(bytes), brick, "{bytes}");
        }
        let bytes = index.to_bytes();
        assert_eq!(bytes.len(), 4 * ENTRY_BYTES);
        assert_eq!(HaloIndex::from_bytes(&bytes, &grid, |_| 10).unwrap(), index);
        let error = HaloIndex::from_bytes(&bytes, &grid, |_| 9).unwrap_err();
        assert!(matches!(error, StoreError::HaloIndex { brick: BrickIndex([0, 0, 0]), bytes: 10 }), "{error}");
    }
}
