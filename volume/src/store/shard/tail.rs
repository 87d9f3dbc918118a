//! The end of a shard's file: the checksums of its inner chunks, and the index that says where they lie.
//!
//! The table of shards holds the hash of all that, and the manifest the table's. A checksum beside its own chunk says
//! that the chunk is whole, not that it is this store's: of noise, every chunk has one length, so the indices of
//! different volumes are the same bytes.

use super::record::ShardRecord;
use crate::store::codec;
use crate::store::error::{ChunkFault, IndexFault};
use crate::store::hash::ContentHash;
use crate::store::profile::{ABSENT, CHUNKS_PER_SHARD, INDEX_BYTES, InnerChunk, ShardIndex};

/// Bytes of the checksums: a crc32c (u32 little endian) per inner chunk, 0 where it is absent.
const SUM_BYTES: usize = CHUNKS_PER_SHARD * 4;
/// The first version of the format whose shards have them.
const SUMS_SINCE: u64 = 6;

/// What stands at the end of the shards of a store.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TailLayout {
    /// The index alone, in older stores.
    Index,
    /// Checksums, then the index, which Zarr wants at the very end.
    SumsAndIndex,
}

impl TailLayout {
    /// What this program writes.
    pub(crate) const WRITTEN: Self = Self::SumsAndIndex;

    pub(crate) fn of_version(version: u64) -> Self {
        if version < SUMS_SINCE { Self::Index } else { Self::SumsAndIndex }
    }

    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::Index => INDEX_BYTES,
            Self::SumsAndIndex => SUM_BYTES + INDEX_BYTES,
        }
    }
}

/// A shard's end, checked.
#[derive(Debug)]
pub(crate) struct ShardTail {
    /// Offset and length per inner chunk, inside the file or [`ABSENT`].
    index: Vec<[u64; 2]>,
    /// By the same places; nothing where the store is too old to have them.
    sums: Option<Vec<u32>>,
}

impl ShardTail {
    /// `chunk_bound` is the longest that an inner chunk can be.
    pub(crate) fn parse(
        layout: TailLayout,
        shard: ShardIndex,
        bytes: &[u8],
        record: &ShardRecord,
        chunk_bound: u64,
    ) -> Result<Self, IndexFault> {
        let (sums, index) = bytes.split_at(bytes.len() - INDEX_BYTES);
        let entries = match codec::checked(index) {
            Ok(entries) => entries.unwrap_or_default(),
            Err((got, want)) => return Err(IndexFault::Crc { got, want }),
        };
        let (got, want) = (ContentHash::of(bytes), record.tail_hash);
        if got != want {
            return Err(IndexFault::Hash { got, want });
        }
        let data = record.bytes - bytes.len() as u64;
        let parsed = entries.as_chunks::<16>().0.iter().enumerate().map(|(slot, entry)| {
            let (offset, length) = entry.split_at(8);
            let u64_of = |b: &[u8]| b.iter().rev().fold(0u64, |n, &byte| n << 8 | u64::from(byte));
            let (offset, length) = (u64_of(offset), u64_of(length));
            let absent = (offset, length) == (ABSENT, ABSENT);
            let inside = length <= chunk_bound && offset.checked_add(length).is_some_and(|end| end <= data);
            if absent || inside {
                Ok([offset, length])
            } else {
                Err(IndexFault::Entry { chunk: InnerChunk::at(shard, slot), offset, length, data })
            }
        });
        let index = parsed.collect::<Result<_, _>>()?;
        let sums = sums.as_chunks::<4>().0.iter().map(|sum| u32::from_le_bytes(*sum)).collect();
        Ok(Self { index, sums: (layout == TailLayout::SumsAndIndex).then_some(sums) })
    }

    /// Offset and length of an inner chunk; nothing where it is absent.
    pub(crate) fn place(&self, slot: usize) -> Option<(u64, u64)> {
        let [offset, length] = self.index[slot];
        (offset != ABSENT).then_some((offset, length))
    }

    /// Checks that the bytes at a chunk's place, whole by their own checksum, are those that were written there.
    pub(crate) fn check(&self, slot: usize, encoded: &[u8]) -> Result<(), ChunkFault> {
        let Some(sums) = &self.sums else { return Ok(()) };
        match (codec::stated_sum(encoded), sums[slot]) {
            (Some(got), want) if got != want => Err(ChunkFault::Foreign { got, want }),
            _ => Ok(()),
        }
    }
}

/// The end of a shard, from offset and length per inner chunk and the checksums by the same places.
pub(crate) fn to_bytes(index: &[[u64; 2]], sums: &[u32]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(TailLayout::WRITTEN.bytes());
    bytes.extend(sums.iter().flat_map(|sum| sum.to_le_bytes()));
    let start = bytes.len();
    bytes.extend(index.iter().flatten().flat_map(|n| n.to_le_bytes()));
    bytes.extend(crc32c::crc32c(&bytes[start..]).to_le_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHARD: ShardIndex = ShardIndex([0; 3]);

    fn tail_with(layout: TailLayout, slot: usize, entry: [u64; 2], sum: u32) -> (Vec<u8>, ShardRecord) {
        let (mut index, mut sums) = (vec![[ABSENT; 2]; CHUNKS_PER_SHARD], vec![0; CHUNKS_PER_SHARD]);
        (index[slot], sums[slot]) = (entry, sum);
        let mut bytes = to_bytes(&index, &sums);
        bytes.drain(..bytes.len() - layout.bytes());
        let hash = ContentHash::of(&bytes);
        let record = ShardRecord { bytes: 1000 + bytes.len() as u64, hash, tail_hash: hash };
        (bytes, record)
    }

    /// Entries whose checksum is right, as a forger would make them.
    #[test]
    fn index_entries_outside_the_data_are_refused() {
        for layout in [TailLayout::Index, TailLayout::SumsAndIndex] {
            for good in [[0, 900], [100, 900], [1000, 0], [ABSENT, ABSENT]] {
                let (bytes, record) = tail_with(layout, 3, good, 9);
                let tail = ShardTail::parse(layout, SHARD, &bytes, &record, 900).unwrap();
                assert_eq!(tail.place(3), (good[0] != ABSENT).then_some((good[0], good[1])));
                assert_eq!(tail.place(4), None);
            }
            for bad in [[0, 901], [101, 900], [ABSENT, 1], [0, ABSENT], [ABSENT - 1, 2], [u64::MAX / 2, 10]] {
                let (bytes, record) = tail_with(layout, 3, bad, 9);
                let fault = ShardTail::parse(layout, SHARD, &bytes, &record, 900).unwrap_err();
                assert!(matches!(fault, IndexFault::Entry { chunk: InnerChunk([3, 0, 0]), .. }), "{bad:?}: {fault}");
            }
        }
    }

    #[test]
    fn another_stores_tail_with_the_same_index_is_refused() {
        let (_, record) = tail_with(TailLayout::SumsAndIndex, 3, [0, 900], 9);
        let (other, _) = tail_with(TailLayout::SumsAndIndex, 3, [0, 900], 10);
        let fault = ShardTail::parse(TailLayout::SumsAndIndex, SHARD, &other, &record, 900).unwrap_err();
        assert!(matches!(fault, IndexFault::Hash { .. }), "{fault}");
    }

    #[test]
    fn a_whole_chunk_of_another_store_is_told_from_the_own_one() {
        let (own, other) = (codec::encode(&[7; 500]).unwrap(), codec::encode(&[8; 500]).unwrap());
        let sum = codec::stated_sum(&own).unwrap();
        let of = |layout| {
            let (bytes, record) = tail_with(layout, 5, [0, own.len() as u64], sum);
            ShardTail::parse(layout, SHARD, &bytes, &record, 900).unwrap()
        };
        let tail = of(TailLayout::SumsAndIndex);
        assert_eq!(tail.check(5, &own), Ok(()));
        assert!(matches!(tail.check(5, &other), Err(ChunkFault::Foreign { want, .. }) if want == sum));
        assert_eq!(of(TailLayout::Index).check(5, &other), Ok(()), "stores before version 6 cannot tell");
    }
}
