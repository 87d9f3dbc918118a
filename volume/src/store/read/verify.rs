//! Reading all of a store to find damage.

use rayon::prelude::*;

use super::store::Store;
use crate::store::codec;
use crate::store::error::{ChunkFault, StoreError};
use crate::store::files::shape::small_files;
use crate::store::hash::ContentHash;
use crate::store::manifest::Manifest;
use crate::store::profile::{CHUNKS_PER_SHARD, InnerChunk, ShardIndex};
use crate::store::progress::{Phase, Progress};
use crate::store::shard::read::Shards;

impl Store {
    /// Bytes of its files, as the manifests promise them.
    pub(crate) fn promised_bytes(&self) -> u64 {
        let of_level = |level: &Self| {
            let shards = level.arrays().into_iter().flat_map(|shards| &shards.table).map(|record| record.bytes);
            let halos = level.halos().map(|halos| halos.bytes());
            let small = small_files(level.manifest()).into_iter().map(|file| match file.bytes {
                // Known by what it cannot be longer than.
                Manifest::MAX_BYTES => 0,
                bytes => bytes,
            });
            shards.sum::<u64>() + halos.sum::<u64>() + small.sum::<u64>() + level.manifest_bytes().len() as u64
        };
        (0..self.level_count()).filter_map(|level| self.level(level)).map(of_level).sum()
    }

    /// Reads every shard and halo of every level, decodes every inner chunk and record, and compares all bytes with the
    /// manifest's hashes. A chunk (or a halo's brick and layer) is named where one is broken; bytes that belong to no
    /// chunk are found by the shard's hash.
    ///
    /// # Errors
    /// The first damage found; [`crate::store::inspect`] finds all.
    pub fn verify(&self, progress: &mut dyn FnMut(Progress)) -> Result<(), StoreError> {
        let levels = || (0..self.level_count()).filter_map(move |level| self.level(level));
        let arrays: Vec<_> = levels().flat_map(Self::arrays).collect();
        let halos: Vec<_> = levels().flat_map(Self::halos).collect();
        let shards = arrays.iter().flat_map(|shards| shards.table.iter()).map(|record| record.bytes);
        let total = shards.chain(halos.iter().map(|h| h.bytes())).sum();
        let mut done = 0;
        let mut read = |bytes| {
            progress(Progress { phase: Phase::Verify, done, total });
            done += bytes;
        };
        for shards in arrays {
            for (linear, record) in shards.table.iter().enumerate() {
                read(record.bytes);
                shards.faults(shards.grid.at(linear)).into_iter().next().map_or(Ok(()), Err)?;
            }
        }
        for halos in halos {
            read(halos.bytes());
            halos.faults().into_iter().next().map_or(Ok(()), Err)?;
        }
        read(0);
        Ok(())
    }
}

impl Shards {
    /// Reads a shard once and decodes every inner chunk: what is missing, cut or broken of it. Bytes of no chunk count
    /// as the file's.
    pub(crate) fn faults(&self, shard: ShardIndex) -> Vec<StoreError> {
        match self.decoded(shard) {
            Ok(broken) => broken,
            Err(error) => vec![error],
        }
    }

    fn decoded(&self, shard: ShardIndex) -> Result<Vec<StoreError>, StoreError> {
        let path = self.objects.path_of(&shard.path(self.array.array));
        let record = self.table[self.grid.linear(shard)];
        // No longer than inner chunks and end of one shard can be: the table was checked.
        let bytes = self.open_whole(shard)?.read_at_most(record.bytes).map_err(|error| self.of_shard(shard, error))?;
        let (got, want) = (bytes.len() as u64, record.bytes);
        if got != want {
            return Err(StoreError::ShardLength { array: self.array, shard, path, got, want });
        }
        let tail = self.tail(shard, &bytes[bytes.len() - self.tail_bytes()..])?;
        let broken = |slot| {
            let (start, length) = tail.place(slot)?;
            let encoded = &bytes[start as usize..][..length as usize];
            let whole = codec::decode(encoded, self.chunk_bytes()).and_then(|_| tail.check(slot, encoded));
            let of = |fault: ChunkFault| {
                let (array, path, chunk) = (self.array, path.clone(), InnerChunk::at(shard, slot));
                StoreError::Chunk { array, shard, path, chunk, start, end: start + length, fault }
            };
            whole.err().map(of)
        };
        let mut broken: Vec<_> = (0..CHUNKS_PER_SHARD).into_par_iter().filter_map(broken).collect();
        let got = ContentHash::of(&bytes);
        if broken.is_empty() && got != record.hash {
            broken.push(StoreError::FileHash { path, got, want: record.hash });
        }
        Ok(broken)
    }
}
