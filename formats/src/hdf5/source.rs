//! The volume in order, a band of it read ahead; or in boxes, where it lies in chunks.

use std::path::PathBuf;

use brickcast_volume::format::{Ahead, FormatError, SourceHeader, VolumeSource};

use super::blocks::Blocks;
use crate::wrong::Wrong;

/// What is read ahead: whole planes, or rows of one.
const BAND_BYTES: u64 = 64 << 20;

#[derive(Debug)]
pub(super) struct Hdf5Source {
    header: SourceHeader,
    files: Vec<PathBuf>,
    blocks: Blocks,
    ahead: Ahead,
}

impl Hdf5Source {
    pub(super) fn new(header: SourceHeader, path: PathBuf, blocks: Blocks) -> Self {
        Self { header, files: vec![path], blocks, ahead: Ahead::default() }
    }

    fn failed(&self, wrong: Wrong) -> FormatError {
        wrong.of(&self.files[0], self.header.format)
    }

    fn read(&mut self, most: u64, out: &mut Vec<u8>) -> Result<(), FormatError> {
        let chunk = self.blocks.is_in_chunks().then(|| self.blocks.chunk_size());
        let volume = (self.header.geometry, self.header.voxel_type);
        let Self { blocks, ahead, .. } = self;
        let read = ahead.read(volume, (chunk, BAND_BYTES), most, out, |lo, hi, voxels| blocks.read(lo, hi, voxels));
        read.map_err(|wrong| self.failed(wrong))
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
        self.ahead.go_to(0);
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
        self.ahead.go_to(voxel);
        Ok(true)
    }

    fn read_box(&mut self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<bool, FormatError> {
        if !self.blocks.is_in_chunks() {
            return Ok(false);
        }
        self.blocks.read(lo, hi, voxels).map(|()| true).map_err(|wrong| self.failed(wrong))
    }
}
