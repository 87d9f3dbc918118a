//! The halos of an open store, and bricks put together from their own inner chunks and their halo.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use bytes::Bytes;
use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3Default;

use super::bound::RecordBound;
use super::index::{ENTRY_BYTES, HaloIndex, HaloRecord};
use super::reach::HaloReach;
use super::shell::Shell;
use crate::brick::BrickGrid;
use crate::ids::BrickIndex;
use crate::store::codec;
use crate::store::error::{ChunkFault, HaloFault, StoreError};
use crate::store::hash::ContentHash;
use crate::store::lacking::Lacking;
use crate::store::manifest::halo::HaloHashes;
use crate::store::objects::Objects;
use crate::store::read::cache::ChunkCache;

/// How much of a file is read at once where all of it is; more where one brick has more.
const PART_BYTES: u64 = 8 << 20;

/// One file of halos.
#[derive(Debug)]
pub(crate) struct Halos {
    objects: Arc<dyn Objects>,
    file: &'static str,
    grid: BrickGrid,
    reach: HaloReach,
    index: HaloIndex,
    /// Of the whole file.
    hash: ContentHash,
    bound: RecordBound,
}

/// A decoded record of a brick's halo.
pub(crate) struct HaloPart<H> {
    pub(crate) shell: Shell,
    /// Nothing where all of the shell is the fill value.
    pub(crate) content: Option<H>,
}

impl Halos {
    /// Checks the index; `lacking` takes a file that is not there in its full length. A far one is not looked at.
    pub(crate) fn open(
        objects: &Arc<dyn Objects>,
        grid: BrickGrid,
        reach: HaloReach,
        (file, index_file, hashes): (&'static str, &str, HaloHashes),
        bound: RecordBound,
        lacking: &mut Lacking,
    ) -> Result<Self, StoreError> {
        let bytes = objects.read_exactly(index_file, grid.brick_count() * (reach.records() * ENTRY_BYTES) as u64)?;
        objects.check_hash(index_file, &bytes, hashes.index)?;
        let longest = |brick, nth| match reach.shell(&grid, brick, nth).voxels() {
            // Layers beyond the volume.
            0 => 0,
            voxels => codec::compressed_bound(bound.bytes(voxels) as usize) as u64,
        };
        let index = HaloIndex::from_bytes(&bytes, &grid, reach, longest)?;
        let halos = Self { objects: objects.clone(), file, grid, reach, index, hash: hashes.file, bound };
        lacking.tolerate(halos.check_length())?;
        Ok(halos)
    }

    fn check_length(&self) -> Result<(), StoreError> {
        let want = self.index.file_bytes();
        let got = self.objects.open_promised(self.file, want)?.size()?;
        let path = self.path();
        match self.index.first_cut(&self.grid, got) {
            Some((brick, nth)) => {
                let (brick, layer) = (self.grid.index_of(brick), self.reach.layer(nth));
                Err(StoreError::HaloCut { path, brick, layer, got, want })
            }
            None if got > want => Err(StoreError::FileLength { path, got, want }),
            None => Ok(()),
        }
    }

    /// What a read of `margin` voxels beyond the owned box needs of a brick's halo, through `parse`, which gets a
    /// record and its voxels; counted by `cache`. Nothing where the halo does not serve such a read.
    pub(crate) fn read<H>(
        &self,
        brick: BrickIndex,
        margin: u32,
        cache: &ChunkCache,
        parse: impl Fn(Vec<u8>, usize) -> Result<H, HaloFault>,
    ) -> Result<Option<Vec<HaloPart<H>>>, StoreError> {
        let Some(count) = self.reach.serving(margin) else { return Ok(None) };
        let records: Vec<_> = self.index.of_brick(self.grid.id(brick)).take(count).collect();
        let start = records[0].start;
        // The index was checked: no more than a halo can have.
        let range = start..records[count - 1].end();
        let fault = |nth: usize, fault| StoreError::Halo {
            path: self.path(),
            brick,
            layer: self.reach.layer(nth),
            start: records[nth].start,
            end: records[nth].end(),
            fault,
        };
        let bytes = if range.is_empty() {
            Bytes::new()
        } else {
            let object = self.objects.open_promised(self.file, self.index.file_bytes())?;
            match object.read_one(range) {
                Err(StoreError::Io { source, .. }) if source.kind() == io::ErrorKind::UnexpectedEof => {
                    let size = object.size()?;
                    let whole = records.iter().take_while(|record| record.end() <= size).count();
                    return Err(fault(whole.min(count - 1), HaloFault::Cut));
                }
                read => read?,
            }
        };
        let part = |(nth, record): (usize, &HaloRecord)| {
            let shell = self.reach.shell(&self.grid, brick, nth);
            if record.length == 0 {
                return Ok(HaloPart { shell, content: None });
            }
            let of_record = &bytes[(record.start - start) as usize..][..record.length as usize];
            let content = decode(of_record, *record, self.bound.bytes(shell.voxels())).and_then(|raw| {
                cache.count_decoded(raw.len() as u64);
                parse(raw, shell.voxels() as usize)
            });
            Ok(HaloPart { shell, content: Some(content.map_err(|f| fault(nth, f))?) })
        };
        records.iter().enumerate().map(part).collect::<Result<_, _>>().map(Some)
    }

    /// Bytes of the file.
    pub(crate) fn bytes(&self) -> u64 {
        self.index.file_bytes()
    }

    pub(crate) fn file(&self) -> &'static str {
        self.file
    }

    /// Reads the file once, decodes every record and compares all bytes with the file's hash: every broken record.
    pub(crate) fn faults(&self) -> Vec<StoreError> {
        let mut faults = Vec::new();
        match self.read_through(&mut faults) {
            Ok(got) if faults.is_empty() && got != self.hash => {
                faults.push(StoreError::FileHash { path: self.path(), got, want: self.hash });
            }
            Ok(_) => {}
            Err(error) => faults.push(error),
        }
        faults
    }

    /// The hash of what was read.
    fn read_through(&self, faults: &mut Vec<StoreError>) -> Result<ContentHash, StoreError> {
        let object = self.objects.open_promised(self.file, self.index.file_bytes())?;
        let mut hash = Xxh3Default::new();
        let mut bricks = self.grid.ids().peekable();
        while let Some(first) = bricks.next() {
            let (start, mut end) = (self.index.start(first), self.index.end(first));
            let mut part = vec![first];
            while let Some(next) = bricks.next_if(|next| self.index.end(*next) - start < PART_BYTES) {
                end = self.index.end(next);
                part.push(next);
            }
            let bytes = object.read_one(start..end)?;
            hash.update(&bytes);
            let of_brick = |id| {
                let (brick, bytes) = (self.grid.index_of(id), &bytes);
                let records = self.index.of_brick(id).enumerate().filter(|(_, record)| record.length > 0);
                let broken = records.filter_map(move |(nth, record)| {
                    let of_record = &bytes[(record.start - start) as usize..][..record.length as usize];
                    let shell = self.reach.shell(&self.grid, brick, nth);
                    let fault = decode(of_record, record, self.bound.bytes(shell.voxels())).err()?;
                    let (layer, start, end) = (self.reach.layer(nth), record.start, record.end());
                    Some(StoreError::Halo { path: self.path(), brick, layer, start, end, fault })
                });
                broken.collect::<Vec<_>>()
            };
            faults.extend(part.into_par_iter().flat_map_iter(of_brick).collect::<Vec<_>>());
        }
        Ok(ContentHash(hash.digest128()))
    }

    fn path(&self) -> PathBuf {
        self.objects.path_of(self.file)
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
