//! Planes that lie side by side, each decoded by itself: several at a time, and no more than a band of them held.

use std::fmt::Debug;
use std::path::PathBuf;

use brickcast_volume::format::{FormatError, SourceHeader, VolumeSource};
use rayon::prelude::*;

/// Planes are decoded ahead up to so many bytes, but one at least.
const BAND_BYTES: u64 = 64 << 20;
const MOST_AHEAD: u64 = 64;

/// Planes of one size and type, z from 0.
pub(crate) trait Slices: Debug + Send + Sync {
    /// Voxels little endian, x fastest; exactly one plane.
    fn plane(&self, z: u32) -> Result<Vec<u8>, FormatError>;
}

#[derive(Debug)]
pub(crate) struct SliceSource<S> {
    header: SourceHeader,
    files: Vec<PathBuf>,
    slices: S,
    plane_bytes: u64,
    /// The byte of voxels that comes next.
    next: u64,
    /// Planes that were decoded, and which the first of them is.
    band: (u64, Vec<Vec<u8>>),
}

impl<S: Slices> SliceSource<S> {
    pub(crate) fn new(header: SourceHeader, files: Vec<PathBuf>, slices: S) -> Self {
        let d = header.geometry.dims();
        let plane_bytes = u64::from(d.x) * u64::from(d.y) * header.voxel_type.bytes() as u64;
        Self { header, files, slices, plane_bytes, next: 0, band: (0, Vec::new()) }
    }

    fn read_band(&mut self, z: u64) -> Result<(), FormatError> {
        self.band.1.clear();
        let count = (BAND_BYTES / self.plane_bytes).clamp(1, MOST_AHEAD);
        let end = (z + count).min(u64::from(self.header.geometry.dims().z));
        let planes: Result<Vec<_>, _> = (z as u32..end as u32).into_par_iter().map(|z| self.slices.plane(z)).collect();
        self.band = (z, planes?);
        Ok(())
    }

    fn read(&mut self, want: u64, out: &mut Vec<u8>) -> Result<(), FormatError> {
        out.clear();
        let all = self.plane_bytes * u64::from(self.header.geometry.dims().z);
        let end = all.min(self.next.saturating_add(want));
        while self.next < end {
            let (z, within) = (self.next / self.plane_bytes, self.next % self.plane_bytes);
            if !(self.band.0..self.band.0 + self.band.1.len() as u64).contains(&z) {
                self.read_band(z)?;
            }
            let plane = &self.band.1[(z - self.band.0) as usize];
            let stop = self.plane_bytes.min(within + end - self.next);
            out.extend_from_slice(&plane[within as usize..stop as usize]);
            self.next += stop - within;
        }
        Ok(())
    }
}

impl<S: Slices> VolumeSource for SliceSource<S> {
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
        self.read(self.plane_bytes * u64::from(count), planes)
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        let voxel = self.header.voxel_type.bytes();
        self.read((most / voxel * voxel).max(voxel) as u64, piece)
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        self.next = voxel * self.header.voxel_type.bytes() as u64;
        Ok(true)
    }
}
