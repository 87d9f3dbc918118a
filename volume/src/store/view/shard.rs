//! A shard that is made of an array, but for its end.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use bytes::{Bytes, BytesMut};

use super::objects::Made;
use crate::store::codec;
use crate::store::error::StoreError;
use crate::store::objects::{Object, beyond_end};
use crate::store::profile::{ABSENT, CHUNK_EDGE, CHUNKS_PER_SHARD, INDEX_BYTES, InnerChunk, ShardIndex};
use crate::store::shard::tail::TailLayout;

/// An inner chunk by the end of its shard, which nobody has checked: it is, by whoever reads it, and what is made is
/// held against it.
#[derive(Debug, Clone, Copy)]
struct Entry {
    start: u64,
    bytes: u64,
    slot: usize,
    sum: u32,
}

#[derive(Debug)]
pub(super) struct ViewShard {
    shard: ShardIndex,
    /// The end, which lies there.
    end: Arc<dyn Object>,
    /// Of the whole shard.
    bytes: u64,
    path: PathBuf,
    made: Arc<Made>,
    /// By where they start.
    entries: OnceLock<Vec<Entry>>,
}

impl ViewShard {
    /// `bytes` of the whole shard; where nobody knows, the end says it.
    pub(super) fn new(
        shard: ShardIndex,
        end: Arc<dyn Object>,
        bytes: Option<u64>,
        path: PathBuf,
        made: Arc<Made>,
    ) -> Result<Self, StoreError> {
        let mut new = Self { shard, end, bytes: 0, path, made, entries: OnceLock::new() };
        let said = |entries: &[Entry]| entries.last().map_or(0, |last| last.start.saturating_add(last.bytes));
        new.bytes = match bytes {
            Some(bytes) => bytes,
            None => said(new.entries()?).saturating_add(TailLayout::WRITTEN.bytes() as u64),
        };
        Ok(new)
    }

    fn entries(&self) -> Result<&[Entry], StoreError> {
        if let Some(entries) = self.entries.get() {
            return Ok(entries);
        }
        let end = self.end.read_one(0..TailLayout::WRITTEN.bytes() as u64)?;
        let (sums, index) = end.split_at(end.len() - INDEX_BYTES);
        let sums = sums.as_chunks::<4>().0.iter().map(|sum| u32::from_le_bytes(*sum));
        let numbers = index.as_chunks::<16>().0.iter().take(CHUNKS_PER_SHARD);
        let all = numbers.zip(sums).enumerate().map(|(slot, (entry, sum))| {
            let [start, bytes] = [0, 1].map(|i| entry.as_chunks::<8>().0.get(i).map_or(0, |n| u64::from_le_bytes(*n)));
            Entry { start, bytes, slot, sum }
        });
        let mut entries: Vec<_> = all.filter(|entry| entry.start != ABSENT).collect();
        entries.sort_by_key(|entry| entry.start);
        Ok(self.entries.get_or_init(|| entries))
    }

    /// What [`encode`](codec::encode) gives of a chunk's voxels, as the array has them now.
    fn made(&self, entry: &Entry) -> Result<Bytes, StoreError> {
        let Made { finest, form, place } = &*self.made;
        let chunk = InnerChunk::at(self.shard, entry.slot);
        let changed = || StoreError::ViewChanged { path: self.path.clone(), chunk, place: place.clone() };
        let (lo, dims) = (chunk.0.map(|at| u64::from(at) * u64::from(CHUNK_EDGE)), finest.dims().map(u64::from));
        if (0..3).any(|a| lo[a] >= dims[a]) {
            return Err(changed());
        }
        let hi: [u32; 3] = std::array::from_fn(|a| dims[a].min(lo[a] + u64::from(CHUNK_EDGE)) as u32);
        let lo = lo.map(|at| at as u32);
        let mut voxels = Vec::new();
        finest.read_box(lo, hi, &mut voxels)?;
        match form.encoded(chunk, (lo, hi), &voxels)? {
            Some(encoded) if encoded.len() as u64 == entry.bytes && codec::stated_sum(&encoded) == Some(entry.sum) => {
                Ok(encoded.into())
            }
            _ => Err(changed()),
        }
    }

    /// Any range before the end.
    fn joined(&self, range: &Range<u64>) -> Result<Bytes, StoreError> {
        let entries = self.entries()?;
        let first = entries.partition_point(|entry| entry.start.saturating_add(entry.bytes) <= range.start);
        if let Some(entry) = entries.get(first)
            && (entry.start, entry.start.saturating_add(entry.bytes)) == (range.start, range.end)
        {
            return self.made(entry);
        }
        let mut joined = BytesMut::new();
        for entry in entries[first..].iter().take_while(|entry| entry.start < range.end) {
            let made = self.made(entry)?;
            let end = entry.start.saturating_add(entry.bytes);
            let [from, to] = [range.start, range.end].map(|at| at.clamp(entry.start, end));
            joined.extend_from_slice(&made[(from - entry.start) as usize..(to - entry.start) as usize]);
        }
        match joined.len() as u64 == range.end - range.start {
            true => Ok(joined.freeze()),
            false => Err(beyond_end(&self.path)),
        }
    }
}

impl Object for ViewShard {
    fn size(&self) -> Result<u64, StoreError> {
        Ok(self.bytes)
    }

    fn read(&self, ranges: &[Range<u64>]) -> Result<Vec<Bytes>, StoreError> {
        let before = self.bytes.saturating_sub(TailLayout::WRITTEN.bytes() as u64);
        let piece = |range: &Range<u64>| {
            if range.start > range.end || range.end > self.bytes {
                return Err(beyond_end(&self.path));
            }
            let (made, kept) = (range.start..range.end.min(before), range.start.max(before)..range.end);
            let end = |kept: Range<u64>| self.end.read_one(kept.start - before..kept.end - before);
            match (made.is_empty(), kept.is_empty()) {
                (true, true) => Ok(Bytes::new()),
                (true, false) => end(kept),
                (false, true) => self.joined(&made),
                (false, false) => Ok([self.joined(&made)?, end(kept)?].concat().into()),
            }
        };
        ranges.iter().map(piece).collect()
    }
}
