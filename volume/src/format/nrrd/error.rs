//! What can be wrong with an NRRD header.

use crate::format::voxel_type::VoxelType;
use crate::space::GeometryError;

/// Where no blank line has ended the header by then, it is no header.
pub const MAX_HEADER_BYTES: usize = 1 << 20;

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NrrdError {
    #[error("not an NRRD file: its first line is `{first_line}`, not NRRD0001 to NRRD0005")]
    Magic { first_line: String },
    #[error(
        "the NRRD header has not ended after {} KiB; a blank line must stand between header and data",
        MAX_HEADER_BYTES / 1024
    )]
    TooLong,
    #[error(
        "the file ends inside the NRRD header ({bytes} bytes): the blank line before the data, or a `data file` line, \
         is missing"
    )]
    NoEnd { bytes: usize },
    #[error("line {line} of the NRRD header, `{text}`, is neither a comment, nor `field: value`, nor `key:=value`")]
    Line { line: usize, text: String },
    #[error("line {line} of the NRRD header repeats the field `{field}`; remove one of the two")]
    Duplicate { line: usize, field: &'static str },
    #[error("the NRRD header has no field `{field}`; add a line `{field}: {example}`")]
    Missing { field: &'static str, example: &'static str },
    #[error("line {line} of the NRRD header: `{field}: {value}`: {problem}")]
    Value { line: usize, field: &'static str, value: String, problem: String },
    #[error(
        "line {line} of the NRRD header: type `{value}` is not supported; supported are {}. Convert the file, e.g. \
         with `unu convert -t float`",
        VoxelType::NAMES
    )]
    Type { line: usize, value: String },
    #[error(
        "line {line} of the NRRD header: encoding `{value}` is not supported; supported are raw, gzip, bzip2, ascii \
         and hex. Convert the file, e.g. with `unu save -f nrrd -e gzip`"
    )]
    Encoding { line: usize, value: String },
    #[error(
        "line {line} of the NRRD header: dimension {value} is not supported, a volume has 3 axes. Take one 3-D part \
         out of it, e.g. with `unu slice`"
    )]
    Dimension { line: usize, value: u64 },
    #[error(
        "the NRRD header's list of data files has not ended after {} KiB; join files, or name a numbered series \
         (slice%04d.raw 1 9999 1)",
        MAX_HEADER_BYTES / 1024
    )]
    ListTooLong,
    #[error(
        "line {line} of the NRRD header names {count} data files, but files of dimension {subdim} must be {want} for \
         these sizes. Name each file once, or say the dimension of each file behind LIST or the step of a series"
    )]
    FileCount { line: usize, count: u64, want: u64, subdim: u64 },
    #[error(
        "line {line} of the NRRD header names {count} data files for {planes} planes; each must hold whole planes, as \
         many as the others. Join them into one file"
    )]
    FilePlanes { line: usize, count: u64, planes: u32 },
    #[error("the NRRD header's sizes, spacing or origin: {0}")]
    Geometry(GeometryError),
    #[error("the data file ends within the {line_skip} lines that the NRRD field `line skip` leaves out")]
    LineSkip { line_skip: u64 },
    #[error("the NRRD field `byte skip: {byte_skip}` leads beyond the end of the file ({file_bytes} bytes)")]
    ByteSkip { byte_skip: u64, file_bytes: u64 },
}
