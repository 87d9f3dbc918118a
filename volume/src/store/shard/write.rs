//! Shards are written append-only, those of one z of a tile at a time: inner chunks as their slab comes, the index when
//! the last slab has come. Memory holds their ends (indices and checksums), never a shard.

use std::cell::RefCell;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::ops::Range;
use std::path::PathBuf;

use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3Default;

use super::grid::ShardGrid;
use super::record::ShardRecord;
use super::tail;
use crate::leftovers;
use crate::store::codec;
use crate::store::error::StoreError;
use crate::store::files::root::StoreRoot;
use crate::store::hash::ContentHash;
use crate::store::profile::{
    ABSENT, CHUNK_EDGE, CHUNK_VOXELS, CHUNKS_PER_EDGE, CHUNKS_PER_SHARD, InnerChunk, SHARD_EDGE, ShardIndex, StoreArray,
};
use crate::store::tiles::Tile;
use crate::store::voxel::Cell;

/// Writes an array's shards in the order of their slabs.
pub(crate) struct ShardWriter {
    root: StoreRoot,
    kept: Kept,
    array: StoreArray,
    grid: ShardGrid,
    /// The shards being written, x fastest; empty between those of one z and the next.
    row: Vec<OpenShard>,
    /// By the shard's place in the grid.
    table: Vec<Option<ShardRecord>>,
}

/// What of a shard's bytes is written. Its record is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kept {
    Whole,
    /// All of it, until it is cut to its end.
    ForNow,
    /// The end alone: see [`crate::store::view`].
    End,
}

struct OpenShard {
    shard: ShardIndex,
    kept: Kept,
    path: PathBuf,
    bytes: u64,
    hash: Xxh3Default,
    /// Offset and length per inner chunk.
    index: Vec<[u64; 2]>,
    /// Checksums, by the same places.
    sums: Vec<u32>,
}

impl ShardWriter {
    pub(crate) fn new(root: &StoreRoot, array: StoreArray, grid: ShardGrid, kept: Kept) -> Self {
        Self { root: root.clone(), kept, array, grid, row: Vec::new(), table: vec![None; grid.count() as usize] }
    }

    /// Takes a tile's planes of the `cz`-th layer of inner chunks, x fastest; all layers of a tile come in order before
    /// the next tile's.
    pub(crate) fn add<T: Cell>(&mut self, tile: &Tile, cz: u32, slab: &[T]) -> Result<(), StoreError> {
        if cz.is_multiple_of(CHUNKS_PER_EDGE) {
            self.start_row(tile, cz / CHUNKS_PER_EDGE)?;
        }
        let grid = self.grid;
        let first = (cz % CHUNKS_PER_EDGE) as usize * (CHUNKS_PER_EDGE * CHUNKS_PER_EDGE) as usize;
        let add = |open: &mut OpenShard| {
            let slots = first..first + (CHUNKS_PER_EDGE * CHUNKS_PER_EDGE) as usize;
            let present: Vec<_> =
                slots.map(|slot| InnerChunk::at(open.shard, slot)).filter(|c| grid.holds(*c)).collect();
            let encoded: Vec<_> = present
                .into_par_iter()
                .map(|chunk| Ok((chunk.slot(), encode_chunk(chunk, tile, slab)?)))
                .collect::<Result<_, StoreError>>()?;
            open.append(encoded)
        };
        // One is written while another is encoded.
        self.row.chunks_mut(2).try_for_each(|two| two.par_iter_mut().try_for_each(add))?;
        let next = cz + 1;
        if next.is_multiple_of(CHUNKS_PER_EDGE) || next == grid.chunk_dims().z {
            let mut keys = Vec::new();
            for open in self.row.drain(..) {
                let place = grid.linear(open.shard);
                keys.push(open.shard.path(self.array));
                self.table[place] = Some(open.finish()?);
            }
            if self.kept != Kept::ForNow {
                self.root.finished(&keys)?;
            }
        }
        Ok(())
    }

    /// The table of all shards, once every layer was added.
    pub(crate) fn finish(self) -> Vec<ShardRecord> {
        let all = 0..self.table.len();
        self.finish_part(all)
    }

    /// The same of those at these places, where only their layers were added.
    pub(crate) fn finish_part(mut self, places: Range<usize>) -> Vec<ShardRecord> {
        let records = self.table.drain(places);
        debug_assert!(records.as_slice().iter().all(Option::is_some), "a shard was in no tile");
        records.flatten().collect()
    }

    fn start_row(&mut self, tile: &Tile, z: u32) -> Result<(), StoreError> {
        let first_x = tile.cells(0, SHARD_EDGE).start;
        for y in tile.cells(1, SHARD_EDGE) {
            for x in tile.cells(0, SHARD_EDGE) {
                let shard = ShardIndex([x, y, z]);
                let path = self.root.path(&shard.path(self.array));
                if let (true, Some(dir)) = (x == first_x, path.parent()) {
                    leftovers::create_dir_all(dir).map_err(StoreError::io("create", dir))?;
                }
                let (index, sums) = (vec![[ABSENT; 2]; CHUNKS_PER_SHARD], vec![0; CHUNKS_PER_SHARD]);
                let (kept, hash) = (self.kept, Xxh3Default::new());
                self.row.push(OpenShard { shard, kept, path, bytes: 0, hash, index, sums });
            }
        }
        Ok(())
    }
}

impl OpenShard {
    /// Opened for each slab anew: a row may have more shards than a process may have open files.
    fn append(&mut self, chunks: Vec<(usize, Option<Vec<u8>>)>) -> Result<(), StoreError> {
        let open = || File::options().append(true).create(true).open(&self.path);
        let file = (self.kept != Kept::End).then(open).transpose().map_err(StoreError::io("create", &self.path))?;
        let mut file = file.map(|file| BufWriter::with_capacity(1 << 20, file));
        for (slot, bytes) in chunks {
            let Some(bytes) = bytes else { continue };
            let written = file.as_mut().map_or(Ok(()), |file| file.write_all(&bytes));
            written.map_err(StoreError::io("write", &self.path))?;
            self.hash.update(&bytes);
            self.index[slot] = [self.bytes, bytes.len() as u64];
            self.sums[slot] = codec::stated_sum(&bytes).unwrap_or_default();
            self.bytes += bytes.len() as u64;
        }
        file.map_or(Ok(()), |mut file| file.flush()).map_err(StoreError::io("write", &self.path))
    }

    fn finish(mut self) -> Result<ShardRecord, StoreError> {
        let tail = tail::to_bytes(&self.index, &self.sums);
        self.hash.update(&tail);
        let written = File::options().append(true).create(true).open(&self.path).and_then(|mut file| {
            file.write_all(&tail)?;
            file.sync_all()
        });
        written.map_err(StoreError::io("write", &self.path))?;
        Ok(ShardRecord {
            bytes: self.bytes + tail.len() as u64,
            hash: ContentHash(self.hash.digest128()),
            tail_hash: ContentHash::of(&tail),
        })
    }
}

/// Cuts an inner chunk out of its slab, padded with 0, and encodes it; nothing where it holds nothing but 0.
pub(crate) fn encode_chunk<T: Cell>(chunk: InnerChunk, tile: &Tile, slab: &[T]) -> Result<Option<Vec<u8>>, StoreError> {
    let [nx, ny] = tile.size();
    let planes = slab.len() / (nx * ny);
    const EDGE: usize = CHUNK_EDGE as usize;
    let [x0, y0] = [0, 1].map(|a| (chunk.0[a] * CHUNK_EDGE - tile.lo[a]) as usize);
    let (width, height) = (EDGE.min(nx - x0), EDGE.min(ny - y0));
    let row = |z: usize, y: usize| &slab[(z * ny + y0 + y) * nx + x0..][..width];
    let is_whole = [width, height, planes] == [EDGE; 3];
    // Rows of a length that the compiler knows.
    let rows = || (0..EDGE * EDGE).filter_map(|i| row(i / EDGE, i % EDGE).first_chunk::<EDGE>());
    let first = row(0, 0)[0];
    if is_whole && rows().all(|row| row.iter().fold(true, |all, v| all & (*v == first))) {
        return if first == T::zeroed() { Ok(None) } else { encode_same(first).map(Some) };
    }
    let mut voxels = Vec::new();
    if is_whole {
        voxels.reserve_exact(CHUNK_VOXELS);
        rows().for_each(|row| voxels.extend_from_slice(row));
    } else {
        voxels.resize(CHUNK_VOXELS, T::zeroed());
        for (z, y) in (0..planes).flat_map(|z| (0..height).map(move |y| (z, y))) {
            voxels[(z * EDGE + y) * EDGE..][..width].copy_from_slice(row(z, y));
        }
    }
    if voxels.iter().all(|v| *v == T::zeroed()) {
        return Ok(None);
    }
    encode_voxels(voxels).map(Some)
}

fn encode_voxels<T: Cell>(mut voxels: Vec<T>) -> Result<Vec<u8>, StoreError> {
    if cfg!(target_endian = "big") {
        voxels.iter_mut().for_each(|v| *v = v.swapped_le());
    }
    codec::encode(bytemuck::cast_slice(&voxels))
}

/// As [`encode_voxels`] of an inner chunk of equal voxels, as most are of labels: the last of each thread is kept.
fn encode_same<T: Cell>(voxel: T) -> Result<Vec<u8>, StoreError> {
    thread_local! {
        // The voxel's bytes, which say how many they are.
        static LAST: RefCell<(Vec<u8>, Vec<u8>)> = const { RefCell::new((Vec::new(), Vec::new())) };
    }
    LAST.with_borrow_mut(|(of, encoded)| {
        let bytes = bytemuck::bytes_of(&voxel);
        if of != bytes {
            *encoded = encode_voxels(vec![voxel; CHUNK_VOXELS])?;
            *of = bytes.to_vec();
        }
        Ok(encoded.clone())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of one thread, one after the other: what is kept of one is not taken for another, nor for another type's.
    #[test]
    fn chunks_of_equal_voxels_are_encoded_like_all_others() {
        fn check<T: Cell>(voxel: T) {
            let (tile, chunk) = (Tile { lo: [0; 2], hi: [16; 2] }, InnerChunk([0; 3]));
            let same = vec![voxel; CHUNK_VOXELS];
            let encoded = encode_chunk(chunk, &tile, &same).unwrap();
            let want = (voxel != T::zeroed()).then(|| encode_voxels(same.clone()).unwrap());
            assert_eq!(encoded, want);
            let mut other = same;
            other[CHUNK_VOXELS - 1] = T::zeroed();
            let encoded = encode_chunk(chunk, &tile, &other).unwrap();
            assert_eq!(encoded, (voxel != T::zeroed()).then(|| encode_voxels(other.clone()).unwrap()));
        }
        for _ in 0..2 {
            [3_u32, 3, 0, 0x0303_0303, 4].into_iter().for_each(check);
            [3_u8, 3, 0, 4].into_iter().for_each(check);
            [0x0303_u16, 3, 0].into_iter().for_each(check);
        }
    }
}
