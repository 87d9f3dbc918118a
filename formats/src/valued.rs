//! Voxels that are made values, where slope and intercept cannot go along with the whole volume: a slope below 0, or
//! one for each slice.

use std::path::PathBuf;

use brickcast_volume::format::{FormatError, Rescale, SourceHeader, VolumeSource, VoxelType};

use crate::number::number_of;

const BYTES: usize = 8;

#[derive(Debug)]
struct Valued {
    inner: Box<dyn VolumeSource>,
    header: SourceHeader,
    slope: f64,
    intercept: f64,
}

/// What both are good for: finite, and no 0.
pub(crate) fn is_line(slope: f64, intercept: f64) -> bool {
    slope.is_normal() && intercept.is_finite()
}

/// The same voxels as float64, slope and intercept applied.
pub(crate) fn valued(inner: Box<dyn VolumeSource>, slope: f64, intercept: f64) -> Box<dyn VolumeSource> {
    let mut header = SourceHeader { rescale: Rescale::IDENTITY, voxel_type: VoxelType::F64, ..inner.header().clone() };
    header.notes.push(format!(
        "values are {slope} times the file's numbers, plus {intercept}: they fall with the numbers, so voxels are \
         values, as float64"
    ));
    Box::new(Valued { inner, header, slope, intercept })
}

impl Valued {
    fn apply(&self, voxels: &mut Vec<u8>) {
        *voxels = values(voxels, self.inner.header().voxel_type, self.slope, self.intercept);
    }
}

impl VolumeSource for Valued {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn files(&self) -> &[PathBuf] {
        self.inner.files()
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.inner.rewind()
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        self.inner.read_planes(count, planes)?;
        self.apply(planes);
        Ok(())
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        self.inner.read_piece(most / BYTES * self.inner.header().voxel_type.bytes(), piece)?;
        self.apply(piece);
        Ok(())
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        self.inner.seek(voxel)
    }
}

/// Numbers as their values of 64 bits.
pub(crate) fn values(data: &[u8], voxel_type: VoxelType, slope: f64, intercept: f64) -> Vec<u8> {
    let value = |number: &[u8]| slope * number_of(voxel_type, number) + intercept;
    data.chunks_exact(voxel_type.bytes()).flat_map(|number| value(number).to_le_bytes()).collect()
}
