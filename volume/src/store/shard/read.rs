//! Reading inner chunks from shards: those of a read together, with a bounded number of shards open.

use std::collections::HashMap;
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;

use super::grid::ShardGrid;
use super::record::ShardRecord;
use super::tail::{ShardTail, TailLayout};
use crate::store::codec;
use crate::store::error::StoreError;
use crate::store::level::LevelArray;
use crate::store::objects::{Object, Objects};
use crate::store::profile::{CHUNK_VOXELS, InnerChunk, ShardIndex};

/// Shards of one array that are open at once: an object and 80 KiB of its end each.
const MAX_OPEN: usize = 32;

/// The shards of one array of a store's level.
#[derive(Debug)]
pub(crate) struct Shards {
    /// Of the level.
    pub(crate) objects: Arc<dyn Objects>,
    pub(crate) array: LevelArray,
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
    array: LevelArray,
    shard: ShardIndex,
    path: PathBuf,
    object: Arc<dyn Object>,
    tail: ShardTail,
}

/// An inner chunk as it lies in its shard.
struct Fetched {
    open: Arc<OpenShard>,
    chunk: InnerChunk,
    /// Its first byte in the shard.
    start: u64,
    bytes: Bytes,
}

impl Shards {
    pub(crate) fn new(
        objects: Arc<dyn Objects>,
        array: LevelArray,
        grid: ShardGrid,
        (table, layout): (Vec<ShardRecord>, TailLayout),
        voxel_bytes: usize,
    ) -> Self {
        Self { objects, array, grid, table, layout, voxel_bytes, open: Mutex::default() }
    }

    /// Bytes of a decoded inner chunk.
    pub(crate) fn chunk_bytes(&self) -> usize {
        CHUNK_VOXELS * self.voxel_bytes
    }

    /// Opens a shard, as long as promised. Its content is not looked at, and of a far one not even whether it is there.
    pub(crate) fn open_whole(&self, shard: ShardIndex) -> Result<Arc<dyn Object>, StoreError> {
        let (array, key) = (self.array, shard.path(self.array.array));
        let want = self.table[self.grid.linear(shard)].bytes;
        let object = self.objects.open_promised(&key, want).map_err(|error| self.of_shard(shard, error))?;
        match object.size()? {
            got if got == want => Ok(object),
            got => Err(StoreError::ShardLength { array, shard, path: self.objects.path_of(&key), got, want }),
        }
    }

    /// What went wrong with a shard's file, as it is told of the shard.
    pub(crate) fn of_shard(&self, shard: ShardIndex, error: StoreError) -> StoreError {
        let array = self.array;
        match error {
            StoreError::NotAFile { path } => StoreError::ShardMissing { array, shard, path },
            StoreError::Io { source, path, .. } if source.kind() == io::ErrorKind::NotFound => {
                StoreError::ShardMissing { array, shard, path }
            }
            StoreError::FileLength { path, got, want } => StoreError::ShardLength { array, shard, path, got, want },
            error => error,
        }
    }

    /// The decoded voxels of inner chunks in their order, or nothing of those that hold the fill value only. They are
    /// fetched at once, a read of each shard; each is decoded as it is taken.
    pub(crate) fn read_chunks(
        &self,
        chunks: &[InnerChunk],
    ) -> Result<impl Iterator<Item = Result<Option<Vec<u8>>, StoreError>> + use<>, StoreError> {
        let mut fetched: Vec<Option<Fetched>> = chunks.iter().map(|_| None).collect();
        let mut order: Vec<usize> = (0..chunks.len()).collect();
        order.sort_by_key(|i| chunks[*i].shard().0);
        for of_shard in order.chunk_by(|a, b| chunks[*a].shard() == chunks[*b].shard()) {
            let open = self.open_shard(chunks[of_shard[0]].shard())?;
            let present = of_shard.iter().filter_map(|i| Some((*i, open.tail.place(chunks[*i].slot())?)));
            let present: Vec<_> = present.collect();
            // The index was checked: no more of each than an inner chunk can have.
            let ranges: Vec<_> = present.iter().map(|(_, (start, length))| *start..start + length).collect();
            let read = open.object.read(&ranges).map_err(|error| self.of_shard(open.shard, error))?;
            for ((i, (start, _)), bytes) in present.into_iter().zip(read) {
                fetched[i] = Some(Fetched { open: open.clone(), chunk: chunks[i], start, bytes });
            }
        }
        let raw = self.chunk_bytes();
        Ok(fetched.into_iter().map(move |fetched| fetched.map(|fetched| fetched.decoded(raw)).transpose()))
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
        let object = self.open_whole(shard)?;
        let path = self.objects.path_of(&shard.path(self.array.array));
        let bytes = self.table[self.grid.linear(shard)].bytes;
        let end = object.read_one(bytes - self.tail_bytes() as u64..bytes);
        let tail = self.tail(shard, &end.map_err(|error| self.of_shard(shard, error))?)?;
        Ok(OpenShard { array: self.array, shard, path, object, tail })
    }

    /// The end of a shard, from its bytes.
    pub(crate) fn tail(&self, shard: ShardIndex, bytes: &[u8]) -> Result<ShardTail, StoreError> {
        let (record, bound) = (&self.table[self.grid.linear(shard)], codec::encoded_bound(self.chunk_bytes()) as u64);
        ShardTail::parse(self.layout, shard, bytes, record, bound).map_err(|fault| {
            let path = self.objects.path_of(&shard.path(self.array.array));
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

impl Fetched {
    /// The voxels; `raw` is the length of a decoded inner chunk.
    fn decoded(self, raw: usize) -> Result<Vec<u8>, StoreError> {
        let Self { open, chunk, start, bytes } = self;
        let decoded = codec::decode(&bytes, raw);
        decoded.and_then(|voxels| open.tail.check(chunk.slot(), &bytes).map(|()| voxels)).map_err(|fault| {
            let (array, shard, path) = (open.array, open.shard, open.path.clone());
            StoreError::Chunk { array, shard, path, chunk, start, end: start + bytes.len() as u64, fault }
        })
    }
}
