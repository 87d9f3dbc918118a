//! Reading inner chunks from shard files by position, with a bounded number of them open.

use std::collections::HashMap;
use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use super::grid::ShardGrid;
use super::record::ShardRecord;
use super::tail::{ShardTail, TailLayout};
use crate::store::codec;
use crate::store::error::StoreError;
use crate::store::files::folder::{StoreFile, StoreFolder};
use crate::store::profile::{CHUNK_VOXELS, InnerChunk, ShardIndex, StoreArray};

/// Shards of one array that are open at once: a file and 80 KiB of its end each.
const MAX_OPEN: usize = 32;

/// The shards of one array of a store.
#[derive(Debug)]
pub(crate) struct Shards {
    pub(crate) folder: StoreFolder,
    pub(crate) array: StoreArray,
    pub(crate) grid: ShardGrid,
    pub(crate) table: Vec<ShardRecord>,
    layout: TailLayout,
    voxel_bytes: usize,
    open: Mutex<OpenShards>,
}

#[derive(Debug, Default)]
struct OpenShards {
    /// Shard and when it was last used.
    shards: HashMap<ShardIndex, (Arc<OpenShard>, u64)>,
    clock: u64,
}

/// An open shard with its end, checked.
#[derive(Debug)]
struct OpenShard {
    array: StoreArray,
    shard: ShardIndex,
    path: PathBuf,
    file: File,
    tail: ShardTail,
}

impl Shards {
    pub(crate) fn new(
        folder: StoreFolder,
        array: StoreArray,
        grid: ShardGrid,
        (table, layout): (Vec<ShardRecord>, TailLayout),
        voxel_bytes: usize,
    ) -> Self {
        Self { folder, array, grid, table, layout, voxel_bytes, open: Mutex::default() }
    }

    /// Bytes of a decoded inner chunk.
    pub(crate) fn chunk_bytes(&self) -> usize {
        CHUNK_VOXELS * self.voxel_bytes
    }

    /// Opens the shard's file, as long as promised. Its content is not looked at.
    pub(crate) fn open_file(&self, shard: ShardIndex) -> Result<StoreFile, StoreError> {
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
    pub(crate) fn read_chunk(&self, chunk: InnerChunk) -> Result<Option<Vec<u8>>, StoreError> {
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

    /// Opens a shard and checks its length and its end.
    fn open_new(&self, shard: ShardIndex) -> Result<OpenShard, StoreError> {
        let file = self.open_file(shard)?.file;
        let path = self.folder.path_of(&shard.path(self.array));
        let mut bytes = vec![0; self.layout.bytes()];
        let start = self.table[self.grid.linear(shard)].bytes - bytes.len() as u64;
        read_exact_at(&file, &mut bytes, start).map_err(StoreError::io("read", &path))?;
        let tail = self.tail(shard, &bytes)?;
        Ok(OpenShard { array: self.array, shard, path, file, tail })
    }

    /// The end of a shard, from its bytes.
    pub(crate) fn tail(&self, shard: ShardIndex, bytes: &[u8]) -> Result<ShardTail, StoreError> {
        let (record, bound) = (&self.table[self.grid.linear(shard)], codec::encoded_bound(self.chunk_bytes()) as u64);
        ShardTail::parse(self.layout, shard, bytes, record, bound).map_err(|fault| {
            let path = self.folder.path_of(&shard.path(self.array));
            StoreError::ShardIndex { array: self.array, shard, path, fault }
        })
    }

    pub(crate) fn tail_bytes(&self) -> usize {
        self.layout.bytes()
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
    fn read_chunk(&self, chunk: InnerChunk, raw: usize) -> Result<Option<Vec<u8>>, StoreError> {
        let slot = chunk.slot();
        let Some((start, length)) = self.tail.place(slot) else { return Ok(None) };
        // The index was checked: no more than an inner chunk can have.
        let mut bytes = vec![0; length as usize];
        read_exact_at(&self.file, &mut bytes, start).map_err(StoreError::io("read", &self.path))?;
        let decoded = codec::decode(&bytes, raw).and_then(|voxels| self.tail.check(slot, &bytes).map(|()| voxels));
        decoded.map(Some).map_err(|fault| {
            let (array, shard, path) = (self.array, self.shard, self.path.clone());
            StoreError::Chunk { array, shard, path, chunk, start, end: start + length, fault }
        })
    }
}

/// Reads at a position, whatever other threads read from the same file.
#[cfg(unix)]
pub(crate) fn read_exact_at(file: &File, out: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, out, offset)
}

#[cfg(windows)]
pub(crate) fn read_exact_at(file: &File, mut out: &mut [u8], mut offset: u64) -> io::Result<()> {
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
