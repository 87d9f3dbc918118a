//! The index of a file of halos: where each brick's records lie, and their checksums. Named by the manifest's hash, it
//! binds the records to the store: a file of another store's halos is found at the first record read.

use super::reach::HaloReach;
use crate::brick::BrickGrid;
use crate::ids::{BrickId, BrickIndex};
use crate::store::error::StoreError;

/// Bytes of a record's entry: its length and crc32c, u32 little endian.
pub(crate) const ENTRY_BYTES: usize = 8;

/// One record as the index has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct HaloRecord {
    /// Position in the file.
    pub(crate) start: u64,
    /// Bytes; 0 where the record would hold nothing, or nothing but fill values.
    pub(crate) length: u32,
    pub(crate) crc: u32,
}

impl HaloRecord {
    pub(crate) fn end(&self) -> u64 {
        self.start + u64::from(self.length)
    }
}

/// Records lie one after the other: bricks in the grid's linear order, those of a brick from the inside out. So what a
/// read needs of a brick is one piece of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct HaloIndex {
    /// Records of a brick.
    records: usize,
    /// Length and crc32c of each record.
    entries: Vec<(u32, u32)>,
    /// Where the records of each brick start, and where the last brick's end.
    starts: Vec<u64>,
}

impl HaloIndex {
    /// Length and crc32c per record; lengths are 32 bits, so their sum cannot overflow.
    pub(crate) fn new(records: usize, entries: Vec<(u32, u32)>) -> Self {
        let ends = entries.chunks(records).scan(0, |end, brick| {
            *end += brick.iter().map(|(length, _)| u64::from(*length)).sum::<u64>();
            Some(*end)
        });
        let starts = std::iter::once(0).chain(ends).collect();
        Self { records, entries, starts }
    }

    /// The length of `bytes` must have been checked. `bound` says the longest that a brick's `nth` record can be.
    pub(crate) fn from_bytes(
        bytes: &[u8],
        grid: &BrickGrid,
        reach: HaloReach,
        bound: impl Fn(BrickIndex, usize) -> u64,
    ) -> Result<Self, StoreError> {
        let number = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let entries: Vec<_> = bytes.as_chunks::<ENTRY_BYTES>().0.iter().map(|b| (number(b), number(&b[4..]))).collect();
        let records = reach.records();
        for (brick, entries) in grid.bricks().zip(entries.chunks(records)) {
            let too_long = |(nth, (length, _)): &(usize, &(u32, u32))| u64::from(*length) > bound(brick, *nth);
            if let Some((nth, (length, _))) = entries.iter().enumerate().find(too_long) {
                return Err(StoreError::HaloIndex { brick, layer: reach.layer(nth), bytes: (*length).into() });
            }
        }
        Ok(Self::new(records, entries))
    }

    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        self.entries.iter().flat_map(|(length, crc)| [*length, *crc]).flat_map(u32::to_le_bytes).collect()
    }

    /// Bytes of the file of records.
    pub(crate) fn file_bytes(&self) -> u64 {
        self.starts.last().copied().unwrap_or(0)
    }

    /// Where the records of a brick start.
    pub(crate) fn start(&self, brick: BrickId) -> u64 {
        self.starts[brick.index()]
    }

    /// Where they end: where the next brick's start, or the file ends.
    pub(crate) fn end(&self, brick: BrickId) -> u64 {
        self.starts[brick.index() + 1]
    }

    /// The records of a brick, from the inside out.
    pub(crate) fn of_brick(&self, brick: BrickId) -> impl Iterator<Item = HaloRecord> {
        let entries = &self.entries[brick.index() * self.records..][..self.records];
        entries.iter().scan(self.start(brick), |start, (length, crc)| {
            let record = HaloRecord { start: *start, length: *length, crc: *crc };
            *start = record.end();
            Some(record)
        })
    }

    /// The first record, as its brick and its number there, that is not whole in a file of `bytes`; nothing where all
    /// are.
    pub(crate) fn first_cut(&self, grid: &BrickGrid, bytes: u64) -> Option<(BrickId, usize)> {
        if bytes >= self.file_bytes() {
            return None;
        }
        let brick = grid.ids().nth(self.starts[1..].partition_point(|end| *end <= bytes))?;
        Some((brick, self.of_brick(brick).take_while(|record| record.end() <= bytes).count()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec3;

    #[test]
    fn the_index_survives_its_bytes_and_lengths_are_bounded() {
        let grid = BrickGrid::new(UVec3::new(48, 16, 16), 16).unwrap();
        let reach = HaloReach { first: 2, last: 3 };
        let index = HaloIndex::new(2, vec![(10, 1), (0, 0), (7, 2), (5, u32::MAX), (0, 0), (9, 3)]);
        let records: Vec<_> = index.of_brick(BrickId::finest(1)).collect();
        let record = |start, length, crc| HaloRecord { start, length, crc };
        assert_eq!(records, [record(10, 7, 2), record(17, 5, u32::MAX)]);
        assert_eq!(index.of_brick(BrickId::finest(2)).last(), Some(record(22, 9, 3)));
        assert_eq!(index.file_bytes(), 31);
        let cuts = [(0, (0, 0)), (9, (0, 0)), (10, (1, 0)), (16, (1, 0)), (17, (1, 1)), (21, (1, 1)), (22, (2, 1))];
        for (bytes, (brick, nth)) in cuts {
            assert_eq!(index.first_cut(&grid, bytes), Some((BrickId::finest(brick), nth)), "{bytes}");
        }
        assert_eq!(index.first_cut(&grid, 31), None);
        let bytes = index.to_bytes();
        assert_eq!(bytes.len(), 6 * ENTRY_BYTES);
        assert_eq!(HaloIndex::from_bytes(&bytes, &grid, reach, |_, _| 10).unwrap(), index);
        let bound = |brick: BrickIndex, nth| if (brick.0[0], nth) == (1, 1) { 4 } else { 10 };
        let error = HaloIndex::from_bytes(&bytes, &grid, reach, bound).unwrap_err();
        let second = BrickIndex([1, 0, 0]);
        assert!(matches!(error, StoreError::HaloIndex { brick, layer: 3, bytes: 5 } if brick == second), "{error}");
    }
}
