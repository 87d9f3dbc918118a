//! The volume in order, a band of it read ahead; or in boxes, where it lies in chunks.

use std::path::PathBuf;

use brickcast_volume::format::{FormatError, SourceHeader, VolumeSource};

use super::blocks::Blocks;
use crate::wrong::Wrong;

/// What is read ahead: whole planes, or rows of one.
const BAND_BYTES: u64 = 64 << 20;

#[derive(Debug)]
pub(super) struct Hdf5Source {
    header: SourceHeader,
    files: Vec<PathBuf>,
    blocks: Blocks,
    /// The voxel that comes next.
    next: u64,
    /// The first voxel that was read ahead, and bytes from it on.
    band: (u64, Vec<u8>),
}

impl Hdf5Source {
    pub(super) fn new(header: SourceHeader, path: PathBuf, blocks: Blocks) -> Self {
        Self { header, files: vec![path], blocks, next: 0, band: (0, Vec::new()) }
    }

    fn failed(&self, wrong: Wrong) -> FormatError {
        wrong.of(&self.files[0], self.header.format)
    }

    fn read_band(&mut self, voxel: u64) -> Result<(), FormatError> {
        let d = self.header.geometry.dims();
        let row = u64::from(d.x) * self.header.voxel_type.bytes() as u64;
        let plane = row * u64::from(d.y);
        let (y, z) =
            ((voxel / u64::from(d.x) % u64::from(d.y)) as u32, (voxel / u64::from(d.x) / u64::from(d.y)) as u32);
        let chunk = self.blocks.chunk_size();
        // To where chunks end, where one does within the bound; of what is in none, as much as goes.
        let to_end = |at: u32, axis: usize, most: u64| {
            let size = if self.blocks.is_in_chunks() { chunk[axis] } else { most.max(1) };
            let end = (u64::from(at) / size + 1) * size;
            end.min(u64::from(at) + most.max(1)).min(u64::from(d[axis])) as u32
        };
        let (lo, hi) = match plane <= BAND_BYTES {
            true => ([0, 0, z], [d.x, d.y, to_end(z, 2, BAND_BYTES / plane)]),
            false => ([0, y, z], [d.x, to_end(y, 1, BAND_BYTES / row), z + 1]),
        };
        let mut voxels = std::mem::take(&mut self.band.1);
        self.blocks.read(lo, hi, &mut voxels).map_err(|wrong| self.failed(wrong))?;
        self.band = (u64::from(d.x) * (u64::from(lo[1]) + u64::from(d.y) * u64::from(lo[2])), voxels);
        Ok(())
    }

    fn read(&mut self, most: u64, out: &mut Vec<u8>) -> Result<(), FormatError> {
        out.clear();
        let voxel = self.header.voxel_type.bytes() as u64;
        let end = self.header.geometry.voxel_count().min(self.next.saturating_add(most));
        while self.next < end {
            let there = self.band.0..self.band.0 + self.band.1.len() as u64 / voxel;
            if !there.contains(&self.next) {
                self.read_band(self.next)?;
                continue;
            }
            let stop = end.min(there.end);
            let part = ((self.next - there.start) * voxel) as usize..((stop - there.start) * voxel) as usize;
            out.extend_from_slice(&self.band.1[part]);
            self.next = stop;
        }
        Ok(())
    }
}

impl VolumeSource for Hdf5Source {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.next = 0;
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let d = self.header.geometry.dims();
        self.read(u64::from(d.x) * u64::from(d.y) * u64::from(count), planes)
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        self.read((most / self.header.voxel_type.bytes()).max(1) as u64, piece)
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        self.next = voxel;
        Ok(true)
    }

    fn read_box(&mut self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<bool, FormatError> {
        if !self.blocks.is_in_chunks() {
            return Ok(false);
        }
        self.blocks.read(lo, hi, voxels).map(|()| true).map_err(|wrong| self.failed(wrong))
    }
}
