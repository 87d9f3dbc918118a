//! Reading inner chunks from shard files by position, with a bounded number of them open.

use std::collections::HashMap;
use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use super::codec;
use super::error::{IndexFault, StoreError};
use super::folder::{StoreFile, StoreFolder};
use super::hash::ContentHash;
use super::profile::{ABSENT, CHUNK_VOXELS, INDEX_BYTES, InnerChunk, ShardGrid, ShardIndex, StoreArray};
use super::shard_table::ShardRecord;

/// Shards of one array that are open at once: a file and 64 KiB of index each.
const MAX_OPEN: usize = 32;

/// The shards of one array of a store.
#[derive(Debug)]
pub(super) struct Shards {
    pub(super) folder: StoreFolder,
    pub(super) array: StoreArray,
    pub(super) grid: ShardGrid,
    pub(super) table: Vec<ShardRecord>,
    voxel_bytes: usize,
    open: Mutex<OpenShards>,
}

#[derive(Debug, Default)]
struct OpenShards {
    /// Shard and when it was last used.
    shards: HashMap<ShardIndex, (Arc<OpenShard>, u64)>,
    clock: u64,
}

/// An open shard with its index, checked.
#[derive(Debug)]
pub(super) struct OpenShard {
    array: StoreArray,
    shard: ShardIndex,
    path: PathBuf,
    file: File,
    /// Offset and length per inner chunk, inside the file or [`ABSENT`].
    index: Vec<[u64; 2]>,
}

impl Shards {
    pub(super) fn new(
        folder: StoreFolder,
        array: StoreArray,
        grid: ShardGrid,
        table: Vec<ShardRecord>,
        voxel_bytes: usize,
    ) -> Self {
        Self { folder, array, grid, table, voxel_bytes, open: Mutex::default() }
    }

    /// Bytes of a decoded inner chunk.
    pub(super) fn chunk_bytes(&self) -> usize {
        CHUNK_VOXELS * self.voxel_bytes
    }

    /// Opens the shard's file, as long as promised. Its content is not looked at.
    pub(super) fn open_file(&self, shard: ShardIndex) -> Result<StoreFile, StoreError> {
        let (array, file) = (self.array, shard.path(self.array));
        let want = self.table[self.grid.linear(shard)].bytes;
        match self.folder.open(&file) {
            Ok(opened) if opened.bytes == want => Ok(opened),
            Ok(opened) => {
                Err(StoreError::ShardLength { array, shard, path: self.folder.path_of(&file), got: opened.bytes, want })
            }
            Err(StoreError::NotAFile { path }) => Err(StoreError::ShardMissing { array, shard, path }),
            Err(StoreError::Io { source, path, .. }) if source.kind() == io::ErrorKind::NotFound => {
                Err(StoreError::ShardMissing { array, shard, path })
            }
            Err(error) => Err(error),
        }
    }

    /// The decoded voxels of an inner chunk, or nothing where it holds the fill value only.
    pub(super) fn read_chunk(&self, chunk: InnerChunk) -> Result<Option<Vec<u8>>, StoreError> {
        self.open_shard(chunk.shard())?.read_chunk(chunk, self.chunk_bytes())
    }

    fn open_shard(&self, shard: ShardIndex) -> Result<Arc<OpenShard>, StoreError> {
        let lock = || self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(open) = lock().get(shard) {
            return Ok(open);
        }
        // Two threads may open it at once; one of the two is dropped again.
        let opened = Arc::new(self.open_new(shard)?);
        lock().insert(shard, opened.clone());
        Ok(opened)
    }

    /// Opens a shard and checks length and index.
    pub(super) fn open_new(&self, shard: ShardIndex) -> Result<OpenShard, StoreError> {
        let file = self.open_file(shard)?.file;
        let path = self.folder.path_of(&shard.path(self.array));
        let record = self.table[self.grid.linear(shard)];
        let data = record.bytes - INDEX_BYTES as u64;
        let mut bytes = vec![0; INDEX_BYTES];
        read_exact_at(&file, &mut bytes, data).map_err(StoreError::io("read", &path))?;
        let index = parse_index(shard, &bytes, &record, codec::encoded_bound(self.chunk_bytes()) as u64);
        match index {
            Ok(index) => Ok(OpenShard { array: self.array, shard, path, file, index }),
            Err(fault) => Err(StoreError::ShardIndex { array: self.array, shard, path, fault }),
        }
    }
}

impl OpenShards {
    fn get(&mut self, shard: ShardIndex) -> Option<Arc<OpenShard>> {
        self.clock += 1;
        let (open, used) = self.shards.get_mut(&shard)?;
        *used = self.clock;
        Some(open.clone())
    }

    fn insert(&mut self, shard: ShardIndex, open: Arc<OpenShard>) {
        self.clock += 1;
        self.shards.insert(shard, (open, self.clock));
        while self.shards.len() > MAX_OPEN {
            let oldest = self.shards.iter().min_by_key(|(_, (_, used))| *used).map(|(shard, _)| *shard);
            let Some(oldest) = oldest else { return };
            self.shards.remove(&oldest);
        }
    }
}

impl OpenShard {
    /// See [`Shards::read_chunk`]; `raw` is the length of a decoded inner chunk.
    pub(super) fn read_chunk(&self, chunk: InnerChunk, raw: usize) -> Result<Option<Vec<u8>>, StoreError> {
        let [offset, length] = self.index[chunk.slot()];
        if offset == ABSENT {
            return Ok(None);
        }
        // The index was checked: no more than an inner chunk can have.
        let mut bytes = vec![0; length as usize];
        read_exact_at(&self.file, &mut bytes, offset).map_err(StoreError::io("read", &self.path))?;
        codec::decode(&bytes, raw).map(Some).map_err(|fault| StoreError::Chunk {
            array: self.array,
            shard: self.shard,
            path: self.path.clone(),
            chunk,
            start: offset,
            end: offset + length,
            fault,
        })
    }
}

fn parse_index(
    shard: ShardIndex,
    bytes: &[u8],
    record: &ShardRecord,
    chunk_bound: u64,
) -> Result<Vec<[u64; 2]>, IndexFault> {
    let entries = match codec::checked(bytes) {
        Ok(entries) => entries.unwrap_or_default(),
        Err((got, want)) => return Err(IndexFault::Crc { got, want }),
    };
    let (got, want) = (ContentHash::of(bytes), record.index_hash);
    if got != want {
        return Err(IndexFault::Hash { got, want });
    }
    let data = record.bytes - INDEX_BYTES as u64;
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
    parsed.collect()
}

/// Reads at a position, whatever other threads read from the same file.
#[cfg(unix)]
pub(super) fn read_exact_at(file: &File, out: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, out, offset)
}

#[cfg(windows)]
pub(super) fn read_exact_at(file: &File, mut out: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !out.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, out, offset)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            n => {
                out = &mut out[n..];
                offset += n as u64;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::profile::CHUNKS_PER_SHARD;

    fn index_with(slot: usize, entry: [u64; 2]) -> (Vec<u8>, ShardRecord) {
        let mut entries = vec![[ABSENT; 2]; CHUNKS_PER_SHARD];
        entries[slot] = entry;
        let mut bytes: Vec<u8> = entries.iter().flatten().flat_map(|n| n.to_le_bytes()).collect();
        bytes.extend(crc32c::crc32c(&bytes).to_le_bytes());
        let hash = ContentHash::of(&bytes);
        (bytes, ShardRecord { bytes: 1000 + INDEX_BYTES as u64, hash, index_hash: hash })
    }

    /// Entries whose checksum is right, as a forger would make them.
    #[test]
    fn index_entries_outside_the_data_are_refused() {
        let shard = ShardIndex([0; 3]);
        for good in [[0, 900], [100, 900], [1000, 0], [ABSENT, ABSENT]] {
            let (bytes, record) = index_with(3, good);
            assert_eq!(parse_index(shard, &bytes, &record, 900).unwrap()[3], good);
        }
        for bad in [[0, 901], [101, 900], [ABSENT, 1], [0, ABSENT], [ABSENT - 1, 2], [u64::MAX / 2, 10]] {
            let (bytes, record) = index_with(3, bad);
            let fault = parse_index(shard, &bytes, &record, 900).unwrap_err();
            assert!(matches!(fault, IndexFault::Entry { chunk: InnerChunk([3, 0, 0]), .. }), "{bad:?}: {fault}");
        }
    }
}
