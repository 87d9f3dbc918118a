//! NRRD and NHDR: <https://teem.sourceforge.net/nrrd/format.html>. Attached or with data files,
//! raw, compressed or as text.

mod axes;
mod data;
pub(super) mod error;
mod fields;
mod files;
mod header;
mod no_data;
mod space;
mod write;

use std::io::Read as _;

use super::error::FormatError;
use super::input::Input;
use super::raw::RawHints;
use super::source::{SourceHeader, VolumeSource};

pub use error::{MAX_HEADER_BYTES, NrrdError};
pub use files::DataFiles;
pub use header::{ByteSkip, Encoding, NrrdHeader};
pub use write::{write_header, write_no_data};

pub(super) fn has_magic(start: &[u8]) -> bool {
    start.starts_with(b"NRRD")
}

pub(super) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let Input { path, file, files, .. } = input;
    let mut start = Vec::new();
    file.take(MAX_HEADER_BYTES as u64)
        .read_to_end(&mut start)
        .map_err(|reason| FormatError::io(&path, "read", reason))?;
    let parsed = NrrdHeader::parse(&start).map_err(|reason| FormatError::header(&path, reason))?;
    let mut notes = parsed.notes.clone();
    notes.extend(hints.of_one_volume());
    if !hints.is_empty() {
        notes.push("--dims, --type, --endian, --skip are for raw files; the NRRD header's own were used".into());
    }
    let format = if parsed.data_files == DataFiles::Attached { "NRRD" } else { "NRRD, detached" };
    let header = SourceHeader {
        placement: parsed.placement,
        space_unit: parsed.space_unit.clone(),
        no_data: hints.no_data.into_iter().chain(parsed.no_data.iter().copied()).collect(),
        notes,
        ..SourceHeader::new(format, parsed.geometry, parsed.voxel_type)
    };
    data::source(&parsed, &path, files, header)
}
