//! Reading all of a store to find damage.

use rayon::prelude::*;

use super::error::StoreError;
use super::prepare_options::{Phase, Progress};
use super::profile::{CHUNKS_PER_SHARD, InnerChunk};
use super::read::Store;

impl Store {
    /// Reads every shard and halo, decodes every inner chunk and record, and compares all bytes with the manifest's hashes. A chunk (or
    /// a halo's brick and layer) is named where one is broken; bytes that belong to no chunk are found by the shard's hash.
    ///
    /// # Errors
    /// The first damage found.
    pub fn verify(&self, progress: &mut dyn FnMut(Progress)) -> Result<(), StoreError> {
        let arrays = self.arrays();
        let shards: u64 = arrays.iter().map(|shards| shards.table.len() as u64).sum();
        let total = shards + self.halos().count() as u64;
        let all = arrays.iter().flat_map(|shards| shards.table.iter().enumerate().map(move |(i, r)| (shards, i, r)));
        for (done, (shards, linear, record)) in (0..).zip(all) {
            progress(Progress { phase: Phase::Verify, done, total });
            let shard = shards.grid.at(linear);
            let open = shards.open_new(shard)?;
            (0..CHUNKS_PER_SHARD).into_par_iter().try_for_each(|slot| {
                let chunk = InnerChunk::at(shard, slot);
                open.read_chunk(chunk, shards.chunk_bytes()).map(drop)
            })?;
            // No longer than inner chunks and index of one shard can be: the table was checked.
            shards.folder.check_file(&shard.path(shards.array), record.bytes, record.hash)?;
        }
        for (done, halos) in (shards..).zip(self.halos()) {
            progress(Progress { phase: Phase::Verify, done, total });
            halos.verify()?;
        }
        progress(Progress { phase: Phase::Verify, done: total, total });
        Ok(())
    }
}
