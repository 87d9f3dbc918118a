//! Writing a file of halos: append-only, the compressed records of brick after brick, in the grid's linear order.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3Default;

use super::codec;
use super::error::StoreError;
use super::halo_gather::ShellGatherer;
use super::halo_index::HaloIndex;
use super::halo_manifest::HaloHashes;
use super::halo_regions;
use super::halo_sort::sorted;
use super::hash::ContentHash;
use super::profile::{REGION_HALO, VOXEL_HALO};
use super::tiles::{Tile, Tiles};
use super::voxel::Cell;
use crate::brick::BrickGrid;

/// A file of halos that is on the disk, and its index, which is not yet.
#[derive(Debug)]
pub(super) struct WrittenHalos {
    pub(super) bytes: u64,
    /// Of the file of records.
    pub(super) hash: ContentHash,
    pub(super) index: Vec<u8>,
}

impl WrittenHalos {
    pub(super) fn hashes(&self) -> HaloHashes {
        HaloHashes { file: self.hash, index: ContentHash::of(&self.index) }
    }
}

pub(super) struct HaloWriter {
    pub(super) path: PathBuf,
    file: BufWriter<File>,
    hash: Xxh3Default,
    /// Records of a brick.
    pub(super) records: usize,
    /// Length and crc32c of each.
    pub(super) entries: Vec<(u32, u32)>,
}

impl HaloWriter {
    /// Replaces a file of an earlier attempt.
    pub(super) fn create(path: &Path, records: usize) -> Result<Self, StoreError> {
        let file = File::create(path).map_err(StoreError::io("create", path))?;
        let file = BufWriter::with_capacity(1 << 20, file);
        Ok(Self { path: path.to_path_buf(), file, hash: Xxh3Default::new(), records, entries: Vec::new() })
    }

    /// Takes the next records, which `raw` makes of each of `halos`; nothing where all is the fill value.
    pub(super) fn add<H: Sync>(
        &mut self,
        halos: &[H],
        raw: impl Fn(&H) -> Option<Vec<u8>> + Sync,
    ) -> Result<(), StoreError> {
        let record = |halo: &H| raw(halo).map_or(Ok(Vec::new()), |raw| codec::compress(&raw));
        let records: Vec<Vec<u8>> = halos.par_iter().map(record).collect::<Result<_, StoreError>>()?;
        for bytes in records {
            self.append(&bytes)?;
            // The crc32c of no bytes is 0.
            self.entries.push((bytes.len() as u32, crc32c::crc32c(&bytes)));
        }
        Ok(())
    }

    /// Bytes of records, whose entries are the caller's to add.
    pub(super) fn append(&mut self, bytes: &[u8]) -> Result<(), StoreError> {
        self.file.write_all(bytes).map_err(StoreError::io("write", &self.path))?;
        self.hash.update(bytes);
        Ok(())
    }

    pub(super) fn flush(&mut self) -> Result<(), StoreError> {
        self.file.flush().map_err(StoreError::io("write", &self.path))
    }

    pub(super) fn finish(mut self) -> Result<WrittenHalos, StoreError> {
        let written = self.file.flush().and_then(|()| self.file.get_ref().sync_all());
        written.map_err(StoreError::io("write", &self.path))?;
        let index = HaloIndex::new(self.records, self.entries);
        let hash = ContentHash(self.hash.digest128());
        Ok(WrittenHalos { bytes: index.file_bytes(), hash, index: index.to_bytes() })
    }
}

/// The halos of the volume's voxels, tile by tile and slab by slab.
pub(super) struct VoxelHalos<T> {
    grid: BrickGrid,
    gatherer: ShellGatherer<Vec<T>>,
    writer: HaloWriter,
}

impl<T: Cell> VoxelHalos<T> {
    pub(super) fn create(path: &Path, grid: BrickGrid) -> Result<Self, StoreError> {
        let writer = HaloWriter::create(path, VOXEL_HALO.records())?;
        let gatherer = ShellGatherer::new(grid, VOXEL_HALO, Tile::whole(grid.volume_dims()));
        Ok(Self { grid, gatherer, writer })
    }

    /// Goes on with the next tile.
    pub(super) fn start(&mut self, tile: Tile) {
        self.gatherer = ShellGatherer::new(self.grid, VOXEL_HALO, tile);
    }

    /// Takes planes of the tile grown by the halo's reach; planes come in order.
    pub(super) fn add(&mut self, planes: Range<u32>, slab: &[T]) -> Result<(), StoreError> {
        let take = |shell: &mut Vec<T>, run| shell.extend_from_slice(&slab[run]);
        self.gatherer.add(planes, take, |shells| self.writer.add(shells, |shell| voxel_record(shell)))
    }

    /// What was written; for volumes of one tile.
    pub(super) fn finish(self) -> Result<WrittenHalos, StoreError> {
        self.writer.finish()
    }

    /// What was written tile by tile, in the grid's order at `path`; the file it was in is removed.
    pub(super) fn finish_sorted(self, tiles: Tiles, path: &Path) -> Result<WrittenHalos, StoreError> {
        sorted(self.writer, &self.grid, tiles, path)
    }
}

/// Voxels as in an inner chunk: the stored type, little endian.
fn voxel_record<T: Cell>(shell: &[T]) -> Option<Vec<u8>> {
    if shell.iter().all(|v| *v == T::zeroed()) {
        return None;
    }
    let little: Vec<T> = shell.iter().map(|v| v.swapped_le()).collect();
    Some(bytemuck::cast_slice(&little).to_vec())
}

/// The halos of labels and distances, slab by slab.
pub(super) struct RegionHalos {
    gatherer: ShellGatherer<(Vec<u32>, Vec<u8>)>,
    writer: HaloWriter,
}

impl RegionHalos {
    pub(super) fn create(path: &Path, grid: BrickGrid) -> Result<Self, StoreError> {
        let writer = HaloWriter::create(path, REGION_HALO.records())?;
        let gatherer = ShellGatherer::new(grid, REGION_HALO, Tile::whole(grid.volume_dims()));
        Ok(Self { gatherer, writer })
    }

    /// Takes whole planes; planes come in order.
    pub(super) fn add(&mut self, planes: Range<u32>, labels: &[u32], distances: &[u8]) -> Result<(), StoreError> {
        let take = |shell: &mut (Vec<u32>, Vec<u8>), run: Range<usize>| {
            shell.0.extend_from_slice(&labels[run.clone()]);
            shell.1.extend_from_slice(&distances[run]);
        };
        let record = |shell: &(Vec<u32>, Vec<u8>)| halo_regions::encode(&shell.0, &shell.1);
        self.gatherer.add(planes, take, |shells| self.writer.add(shells, record))
    }

    pub(super) fn finish(self) -> Result<WrittenHalos, StoreError> {
        self.writer.finish()
    }
}
