//! The halos of an open store, and bricks put together from their own inner chunks and their halo.

use std::io::{self, Read};
use std::path::PathBuf;

use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3Default;

use super::cache::ChunkCache;
use super::codec;
use super::error::{ChunkFault, HaloFault, StoreError};
use super::folder::StoreFolder;
use super::halo_index::{ENTRY_BYTES, HaloIndex, HaloRecord};
use super::halo_manifest::HaloHashes;
use super::hash::ContentHash;
use super::profile::InnerChunk;
use super::read::Store;
use super::shard_read::{Shards, read_exact_at};
use super::shell::Shell;
use super::window::{RowDecoder, Window};
use crate::brick::{BrickGrid, StoredBox};
use crate::ids::BrickIndex;

/// One file of halos.
#[derive(Debug)]
pub(super) struct Halos {
    folder: StoreFolder,
    file: &'static str,
    grid: BrickGrid,
    pub(super) layers: u32,
    index: HaloIndex,
    /// Of the whole file.
    hash: ContentHash,
    bound: RecordBound,
}

/// The longest that a record is before compression.
#[derive(Debug, Clone, Copy)]
pub(super) struct RecordBound {
    pub(super) head: u64,
    pub(super) per_voxel: u64,
}

impl RecordBound {
    /// Of a shell of so many voxels.
    pub(super) fn bytes(self, voxels: u64) -> u64 {
        self.head + self.per_voxel * voxels
    }
}

impl Halos {
    /// Checks the index, and that the file is there in its full length.
    pub(super) fn open(
        folder: &StoreFolder,
        grid: BrickGrid,
        layers: u32,
        (file, index_file, hashes): (&'static str, &str, HaloHashes),
        bound: RecordBound,
    ) -> Result<Self, StoreError> {
        let bytes = folder.read_exactly(index_file, grid.brick_count() * ENTRY_BYTES as u64)?;
        folder.check_hash(index_file, &bytes, hashes.index)?;
        let raw = |brick| bound.bytes(Shell::of(&grid, brick, layers).voxels());
        let index = HaloIndex::from_bytes(&bytes, &grid, |brick| codec::compressed_bound(raw(brick) as usize) as u64)?;
        let got = folder.open(file)?.bytes;
        let path = folder.path_of(file);
        match index.file_bytes() {
            want if got < want => {
                Err(StoreError::HaloCut { path, brick: grid.brick_at(index.first_cut(got)), got, want })
            }
            want if got > want => Err(StoreError::FileLength { path, got, want }),
            _ => Ok(Self { folder: folder.clone(), file, grid, layers, index, hash: hashes.file, bound }),
        }
    }

    /// True where a read of `margin` voxels beyond the owned box finds them all in the halo.
    pub(super) fn reach(&self, margin: u32) -> bool {
        (1..=self.layers).contains(&margin)
    }

    pub(super) fn shell(&self, brick: BrickIndex) -> Shell {
        Shell::of(&self.grid, brick, self.layers)
    }

    /// The decoded record of a brick through `parse`, counted by `cache`; nothing where it holds fill values only.
    pub(super) fn read<H>(
        &self,
        brick: BrickIndex,
        cache: &ChunkCache,
        parse: impl FnOnce(Vec<u8>, usize) -> Result<H, HaloFault>,
    ) -> Result<Option<H>, StoreError> {
        let record = self.index.record(self.grid.linear(brick));
        if record.length == 0 {
            return Ok(None);
        }
        let file = self.folder.open(self.file)?.file;
        // The index was checked: no more than a halo can have.
        let mut bytes = vec![0; record.length as usize];
        let voxels = self.shell(brick).voxels();
        let decoded = match read_exact_at(&file, &mut bytes, record.start) {
            Ok(()) => decode(&bytes, record, self.bound.bytes(voxels)),
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Err(HaloFault::Cut),
            Err(e) => return Err(StoreError::io("read", &self.path())(e)),
        };
        let parsed = decoded.and_then(|raw| {
            cache.count_decoded(raw.len() as u64);
            parse(raw, voxels as usize)
        });
        parsed.map(Some).map_err(|fault| StoreError::Halo {
            path: self.path(),
            brick,
            start: record.start,
            end: record.start + u64::from(record.length),
            fault,
        })
    }

    /// Decodes every record and compares the whole file with its hash.
    pub(super) fn verify(&self) -> Result<(), StoreError> {
        let uncounted = ChunkCache::new(0);
        (0..self.grid.brick_count() as usize)
            .into_par_iter()
            .try_for_each(|linear| self.read(self.grid.brick_at(linear), &uncounted, |_, _| Ok(())).map(drop))?;
        let mut file = self.folder.open(self.file)?.file;
        let (mut hash, mut part) = (Xxh3Default::new(), vec![0; 1 << 20]);
        loop {
            match file.read(&mut part).map_err(StoreError::io("read", &self.path()))? {
                0 => break,
                n => hash.update(&part[..n]),
            }
        }
        match ContentHash(hash.digest128()) {
            got if got == self.hash => Ok(()),
            got => Err(StoreError::FileHash { path: self.path(), got, want: self.hash }),
        }
    }

    fn path(&self) -> PathBuf {
        self.folder.path_of(self.file)
    }
}

fn decode(bytes: &[u8], record: HaloRecord, bound: u64) -> Result<Vec<u8>, HaloFault> {
    let crc = crc32c::crc32c(bytes);
    if crc != record.crc {
        return Err(ChunkFault::Crc { got: crc, want: record.crc }.into());
    }
    let raw = codec::decompressed_length(bytes)?;
    if raw > bound {
        return Err(ChunkFault::Length { got: raw as usize, want: bound as usize }.into());
    }
    Ok(codec::decompress(bytes, raw as usize)?)
}

impl Store {
    /// The elements of one array in a box about a brick, from the brick's own inner chunks and its halo: `halo_row` gives the
    /// shell's elements from a position on.
    pub(super) fn read_with_halo<T: Copy + Default>(
        &self,
        shards: &Shards,
        stored: StoredBox,
        cache: &ChunkCache,
        decoder: &impl RowDecoder<T>,
        (shell, halo_row): (Shell, impl FnMut(usize, &mut [T])),
    ) -> Result<Vec<T>, StoreError> {
        let mut window = Window::new(stored, self.manifest().grid.volume_dims());
        let [xs, ys, zs] = shell.core_chunks();
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    let chunk = InnerChunk([x, y, z]);
                    let decoded = cache.get(self.hash(), shards.array, chunk, || shards.read_chunk(chunk))?;
                    window.fill(chunk, (*decoded).as_deref(), decoder);
                }
            }
        }
        window.fill_shell(shell, halo_row);
        Ok(window.clamped_to_edge())
    }
}
