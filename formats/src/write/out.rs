//! What is written: the header that a format says in its own way, and the voxels in their order.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use brickcast_volume::format::{FormatError, Rescale, SourceHeader, VolumeSource, VoxelType};

use super::numbers::Numbers;

/// Bytes that are written at once.
const PIECE: usize = 4 << 20;

#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    #[error("{path}: which format this is to be, its name does not say; name it {endings}")]
    Name { path: PathBuf, endings: String },
    #[error("{path} is there already; --force replaces it")]
    Exists { path: PathBuf },
    #[error(
        "{path}: {bytes} bytes are to be written, and {free} are free there; make room, or write a part of it (--crop, \
         --level)"
    )]
    TooLittleDisk { path: PathBuf, bytes: u64, free: u64 },
    #[error("{path}: cannot be written: {reason}")]
    Io { path: PathBuf, reason: io::Error },
    #[error(transparent)]
    Source(#[from] FormatError),
}

/// What a format's header says.
pub(super) struct Header<'a> {
    pub(super) of: &'a SourceHeader,
    pub(super) voxel_type: VoxelType,
    /// Of what is written: none but NIfTI's own.
    pub(super) rescale: Rescale,
    pub(super) notes: Vec<String>,
}

impl Header<'_> {
    /// Bytes of all voxels.
    pub(super) fn voxel_bytes(&self) -> u64 {
        self.of.geometry.voxel_count() * self.voxel_type.bytes() as u64
    }

    pub(super) fn dims(&self) -> [u32; 3] {
        self.of.geometry.dims().to_array()
    }
}

/// The voxels in file order, as they are to be written.
pub(super) struct Voxels<'a> {
    pub(super) source: &'a mut dyn VolumeSource,
    pub(super) numbers: Option<Numbers>,
    pub(super) raw: Vec<u8>,
    pub(super) done: u64,
    pub(super) total: u64,
    pub(super) progress: &'a mut dyn FnMut(u64, u64),
}

impl Voxels<'_> {
    /// Replaces `piece` by the next voxels, at most `most` bytes of what is written; nothing at the end.
    pub(super) fn next(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        piece.clear();
        if self.done >= self.total {
            return Ok(());
        }
        match &self.numbers {
            None => self.source.read_piece(most, piece)?,
            Some(numbers) => {
                self.source.read_piece(numbers.bytes_for(most), &mut self.raw)?;
                numbers.convert(&self.raw, piece);
            }
        }
        self.done += piece.len() as u64;
        (self.progress)(self.done, self.total);
        Ok(())
    }

    pub(super) fn copy(&mut self, out: &mut dyn Write, path: &Path) -> Result<(), WriteError> {
        let mut piece = Vec::new();
        loop {
            self.next(PIECE, &mut piece)?;
            if piece.is_empty() {
                return Ok(());
            }
            out.write_all(&piece).map_err(failed(path))?;
        }
    }
}

pub(super) fn failed(path: &Path) -> impl FnOnce(io::Error) -> WriteError {
    let path = path.to_path_buf();
    move |reason| WriteError::Io { path, reason }
}

/// A note where a volume does not lie along x, y, z from 0, or has a unit.
pub(super) fn note_place(header: &mut Header<'_>, format: &str, (has_origin, has_axes, has_unit): (bool, bool, bool)) {
    let g = header.of.geometry;
    let mut lost = Vec::new();
    if !has_origin && g.origin() != glam::DVec3::ZERO {
        let o = g.origin();
        lost.push(format!("the origin {}, {}, {}", o.x, o.y, o.z));
    }
    if !has_axes && !g.is_straight() {
        lost.push("which way the axes go".to_owned());
    }
    if let (false, Some(unit)) = (has_unit, &header.of.space_unit) {
        lost.push(format!("the unit {unit}"));
    }
    if !lost.is_empty() {
        header.notes.push(format!("{format} has no place for {}", lost.join(", ")));
    }
    if !header.of.no_data.is_empty() && format != "NRRD" {
        let shown: Vec<String> = header.of.no_data.iter().map(f64::to_string).collect();
        header.notes.push(format!("{format} does not say that {} stands for no data", shown.join(", ")));
    }
}

pub(super) fn finish(mut out: BufWriter<File>, path: &Path) -> Result<(), WriteError> {
    out.flush().map_err(failed(path))
}
