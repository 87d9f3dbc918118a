//! Volume file formats, read in slabs of whole z-planes.
//!
//! A new format is a line in [`FORMATS`], its words in `known.rs`, and a module that ends in a [`VolumeSource`].

mod coded;
mod directions;
mod error;
mod excerpt;
mod known;
pub mod nrrd;
mod planes;
pub mod raw;
mod series;
mod source;
mod text_voxels;
mod voxel_type;

use std::ffi::OsStr;
use std::fs::File;
use std::io::{Read as _, Seek as _};
use std::path::Path;

use excerpt::excerpt;
use known::Known;
use source::open_regular;

pub use error::FormatError;
pub use known::supported;
pub use raw::RawHints;
pub use source::{Placement, SourceHeader, VolumeSource};
pub use voxel_type::{Endian, ParseNameError, VoxelType};

/// One line of the table of formats.
struct Format {
    known: &'static Known,
    /// Knows a file by its first [`START_BYTES`] bytes; `None` for formats that have no mark of their own.
    recognises: Option<fn(&[u8]) -> bool>,
    open: OpenFormat,
}

type OpenFormat = fn(File, &Path, &RawHints) -> Result<Box<dyn VolumeSource>, FormatError>;

const START_BYTES: u64 = 16;

static FORMATS: [Format; 2] = [
    Format { known: &known::NRRD, recognises: Some(nrrd::has_magic), open: nrrd::open },
    Format { known: &known::RAW, recognises: None, open: raw::open },
];

/// Opens an input volume. A format's own mark decides, then the extension; a file of neither is raw where `hints` say its dims.
///
/// # Errors
/// No such file, not a regular file, an empty file, an unknown format, or what the format's own reader finds wrong.
pub fn open(path: &Path, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let mut file = open_regular(path)?;
    let mut start = Vec::new();
    file.by_ref()
        .take(START_BYTES)
        .read_to_end(&mut start)
        .and_then(|_| file.rewind())
        .map_err(|reason| FormatError::io(path, "read", reason))?;
    if start.is_empty() {
        return Err(FormatError::Empty { path: path.into() });
    }
    let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
    let chosen = FORMATS
        .iter()
        .find(|f| f.recognises.is_some_and(|knows| knows(&start)))
        .or_else(|| FORMATS.iter().find(|f| f.known.extensions.contains(&extension.as_str())));
    match chosen {
        Some(format) => (format.open)(file, path, hints),
        None if hints.dims.is_some() => raw::open(file, path, hints),
        None => Err(FormatError::Unknown { path: path.into(), start: excerpt(&String::from_utf8_lossy(&start)) }),
    }
}
