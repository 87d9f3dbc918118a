//! The table of shards: length and hashes of every shard file, itself named by the manifest's hash.

use super::grid::ShardGrid;
use super::record::ShardRecord;
use super::tail::TailLayout;
use crate::store::error::StoreError;
use crate::store::hash::ContentHash;
use crate::store::level::LevelArray;
use crate::store::profile::CHUNKS_PER_SHARD;

/// Bytes of a line.
pub(crate) const RECORD_BYTES: usize = 8 + 16 + 16;

/// Bytes of the table of `grid`'s shards.
pub(crate) fn table_bytes(grid: &ShardGrid) -> u64 {
    grid.count() * RECORD_BYTES as u64
}

/// Bytes of `shards.bin`: per shard, x fastest, length (u64), hash and hash of its end (u128), all little endian.
pub(crate) fn to_bytes(table: &[ShardRecord]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(table.len() * RECORD_BYTES);
    for record in table {
        bytes.extend(record.bytes.to_le_bytes());
        bytes.extend(record.hash.0.to_le_bytes());
        bytes.extend(record.tail_hash.0.to_le_bytes());
    }
    bytes
}

/// `chunk_bound` is the longest that an inner chunk can be: no shard is longer than its inner chunks and its end.
/// The length of `bytes` must have been checked.
pub(crate) fn from_bytes(
    array: LevelArray,
    grid: &ShardGrid,
    bytes: &[u8],
    chunk_bound: usize,
    tail: TailLayout,
) -> Result<Vec<ShardRecord>, StoreError> {
    let least = tail.bytes() as u64;
    let most = (CHUNKS_PER_SHARD * chunk_bound) as u64 + least;
    let records = bytes.as_chunks::<RECORD_BYTES>().0.iter().enumerate().map(|(linear, b)| {
        let (length, hashes) = b.split_at(8);
        let (hash, tail_hash) = hashes.split_at(16);
        let u128_of = |b: &[u8]| b.iter().rev().fold(0u128, |n, &byte| n << 8 | u128::from(byte));
        let record = ShardRecord {
            bytes: u128_of(length) as u64,
            hash: ContentHash(u128_of(hash)),
            tail_hash: ContentHash(u128_of(tail_hash)),
        };
        if (least..=most).contains(&record.bytes) {
            Ok(record)
        } else {
            Err(StoreError::ShardTable { array, shard: grid.at(linear), bytes: record.bytes })
        }
    });
    records.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::profile::StoreArray;
    use glam::UVec3;

    const VOXELS: LevelArray = LevelArray { array: StoreArray::Voxels, level: 0 };

    #[test]
    fn the_table_survives_its_bytes_and_lengths_are_bounded() {
        let grid = ShardGrid::new(UVec3::new(300, 10, 10)).unwrap();
        let record = |bytes| ShardRecord { bytes, hash: ContentHash(1 << 100), tail_hash: ContentHash(77) };
        let tail = TailLayout::SumsAndIndex;
        let least = tail.bytes() as u64;
        let table = [record(90_000), record(least)];
        let bytes = to_bytes(&table);
        assert_eq!(bytes.len() as u64, table_bytes(&grid));
        assert_eq!(from_bytes(VOXELS, &grid, &bytes, 100, tail).unwrap(), table);
        for bad in [0, least - 1, least + CHUNKS_PER_SHARD as u64 * 100 + 1, u64::MAX] {
            let bytes = to_bytes(&[record(90_000), record(bad)]);
            assert!(
                matches!(from_bytes(VOXELS, &grid, &bytes, 100, tail), Err(StoreError::ShardTable { .. })),
                "{bad}"
            );
        }
    }
}
