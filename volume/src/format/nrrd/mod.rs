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

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use super::error::FormatError;
use super::raw::RawHints;
use super::source::{SourceHeader, VolumeSource};

pub use error::{MAX_HEADER_BYTES, NrrdError};
pub use files::DataFiles;
pub use header::{ByteSkip, Encoding, NrrdHeader};
pub use write::write_header;

pub(super) fn has_magic(start: &[u8]) -> bool {
    start.starts_with(b"NRRD")
}

pub(super) fn open(file: File, path: &Path, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let mut start = Vec::new();
    file.take(MAX_HEADER_BYTES as u64)
        .read_to_end(&mut start)
        .map_err(|reason| FormatError::io(path, "read", reason))?;
    let parsed = NrrdHeader::parse(&start).map_err(|reason| FormatError::Nrrd { path: path.into(), reason })?;
    let mut notes = parsed.notes.clone();
    if !hints.is_empty() {
        notes.push(
            "--dims, --type, --endian, --skip, --spacing are for raw files; the NRRD header's own were used".into(),
        );
    }
    let header = SourceHeader {
        geometry: parsed.geometry,
        placement: parsed.placement,
        voxel_type: parsed.voxel_type,
        format: if parsed.data_files == DataFiles::Attached { "NRRD" } else { "NRRD, detached" },
        space_unit: parsed.space_unit.clone(),
        no_data: hints.no_data.into_iter().chain(parsed.no_data.iter().copied()).collect(),
        notes,
    };
    data::source(&parsed, path, header)
}
