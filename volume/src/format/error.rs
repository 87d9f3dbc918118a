//! What can be wrong with an input file, with its operands and the way out.

use std::io;
use std::path::{Path, PathBuf};

use super::voxel_type::VoxelType;
use crate::small_file::FileKind;
use crate::space::GeometryError;

#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    #[error("{path}: cannot {action} this file: {reason}")]
    Io { path: PathBuf, action: &'static str, reason: io::Error },
    #[error("{path} is a directory, but no OME-Zarr; give one file. Read are: {supported}")]
    Directory { path: PathBuf, supported: String },
    #[error("{path} is {kind}; copy its content to a regular file first, which is read more than once")]
    NotRegular { path: PathBuf, kind: FileKind },
    #[error("{path} is empty (0 bytes); copy or export it again")]
    Empty { path: PathBuf },
    #[error(
        "{path}: unknown format (it starts with `{start}`). Read are: {supported}. For a headerless file of another \
         name give --dims"
    )]
    Unknown { path: PathBuf, start: String, supported: String },
    /// For readers that tell what is wrong in plain words.
    #[error("{path}: {format}, {field}: {problem}; {remedy}")]
    Field { path: PathBuf, format: &'static str, field: String, problem: String, remedy: String },
    /// What is wrong in the terms of one format; its reader has the type.
    #[error("{path}: {reason}")]
    Header { path: PathBuf, reason: Box<dyn std::error::Error + Send + Sync> },
    #[error("{path}: {reason}")]
    Geometry { path: PathBuf, reason: GeometryError },
    #[error(
        "{header} names the data file {data_file}, which cannot be opened: {reason}. Put it there or correct `data \
         file`"
    )]
    DataFile { header: PathBuf, data_file: PathBuf, reason: io::Error },
    #[error("data file {number} of the {count} that {header} names: {reason}")]
    Part { header: PathBuf, number: usize, count: usize, reason: Box<FormatError> },
    #[error(
        "{path}: too short: {present} bytes of voxels from byte {start} on, but {dims:?} voxels of {voxel_type} are \
         {expected} bytes; {} are missing. Copy the file again or correct dims, type or skip",
        expected - present
    )]
    TooShort { path: PathBuf, start: u64, present: u64, expected: u64, dims: [u32; 3], voxel_type: VoxelType },
    #[error(
        "{path}: oversized: {present} bytes of voxels from byte {start} on, but {dims:?} voxels of {voxel_type} are \
         {expected} bytes; {} are too many. Correct dims or type, or skip a header in front of the voxels",
        present - expected
    )]
    TooLong { path: PathBuf, start: u64, present: u64, expected: u64, dims: [u32; 3], voxel_type: VoxelType },
    #[error(
        "{path}: the {coding} data ends after {present} bytes of voxels, but {dims:?} voxels of {voxel_type} are \
         {expected} bytes. The file is truncated (copy it again) or its sizes are wrong"
    )]
    CodedTooShort {
        path: PathBuf,
        coding: &'static str,
        present: u64,
        expected: u64,
        dims: [u32; 3],
        voxel_type: VoxelType,
    },
    #[error(
        "{path}: {present} bytes of {coding} data cannot hold the {expected} bytes that {dims:?} voxels of \
         {voxel_type} are ({why}). The file is truncated or its sizes are wrong"
    )]
    CodedImpossible {
        path: PathBuf,
        coding: &'static str,
        present: u64,
        expected: u64,
        dims: [u32; 3],
        voxel_type: VoxelType,
        why: &'static str,
    },
    #[error(
        "{path}: the {coding} data goes on after the {expected} bytes that {dims:?} voxels of {voxel_type} are. Its \
         sizes or type are wrong, or it was appended to"
    )]
    CodedTooLong { path: PathBuf, coding: &'static str, expected: u64, dims: [u32; 3], voxel_type: VoxelType },
    #[error("{path}: broken {coding} data after {position} bytes of voxels: {reason}. Copy or export the file again")]
    CodedBroken { path: PathBuf, coding: &'static str, position: u64, reason: io::Error },
    #[error("{path}: it shrank or was replaced while it was read: {got} bytes now, {was} before. Run it again")]
    Changed { path: PathBuf, was: u64, got: u64 },
    #[error(
        "{path}: {bytes} bytes for {planes} planes of {dims:?} voxels do not fit into memory; use a machine with more"
    )]
    Memory { path: PathBuf, bytes: u64, planes: u32, dims: [u32; 3] },
}

impl FormatError {
    pub(super) fn io(path: &Path, action: &'static str, reason: io::Error) -> Self {
        Self::Io { path: path.into(), action, reason }
    }

    pub(super) fn header(path: &Path, reason: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Header { path: path.into(), reason: Box::new(reason) }
    }
}
