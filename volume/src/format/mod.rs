//! Volume file formats, read in slabs of whole z-planes.
//!
//! NRRD and raw files alone: all other formats lie in the crate `formats`, whose opener tries its own first and falls
//! to [`open`], so that a change of a reader compiles little anew.

mod ahead;
mod coded;
mod crop;
mod directions;
mod error;
mod excerpt;
mod hinted;
mod input;
mod known;
pub mod nrrd;
mod opener;
mod planes;
pub mod raw;
mod rescale;
mod said_by;
mod series;
mod source;
mod text_voxels;
mod voxel_type;

use std::ffi::OsStr;
use std::path::Path;

use input::Input;
use known::Known;

pub use ahead::Ahead;
pub use crop::Crop;
pub use directions::{Axes, AxesError};
pub use error::FormatError;
pub use excerpt::excerpt;
pub use hinted::hinted;
pub use known::supported;
pub use opener::Opener;
pub use raw::RawHints;
pub use rescale::Rescale;
pub use said_by::{Facts, FactsBy, SaidBy, facts_of_store};
pub use source::{Placement, SourceHeader, VolumeSource};
pub use voxel_type::{Endian, ParseNameError, VoxelType};

/// Bytes of a file of no known format that its error shows.
const SHOWN_BYTES: usize = 16;

/// One line of the table of formats.
struct Format {
    known: &'static Known,
    /// Knows a file by its first bytes, [`Input::start`]; `None` for formats that have no mark of their own.
    recognises: Option<fn(&[u8]) -> bool>,
    open: OpenFormat,
}

type OpenFormat = fn(Input, &RawHints) -> Result<Box<dyn VolumeSource>, FormatError>;

static FORMATS: [Format; 2] = [
    Format { known: &known::NRRD, recognises: Some(nrrd::has_magic), open: nrrd::open },
    Format { known: &known::RAW, recognises: None, open: raw::open },
];

/// Opens an input volume. A format's own mark decides, then the extension; a file of neither is raw where `hints` say
/// its dims.
///
/// # Errors
/// No such file, not a regular file, an empty file, an unknown format, or what the format's own reader finds wrong.
pub fn open(path: &Path, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let input = Input::open(path)?;
    let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
    let chosen = FORMATS
        .iter()
        .find(|f| f.recognises.is_some_and(|knows| knows(&input.start)))
        .or_else(|| FORMATS.iter().find(|f| f.known.extensions.contains(&extension.as_str())));
    match chosen {
        Some(format) => (format.open)(input, hints),
        None if hints.dims.is_some() => raw::open(input, hints),
        None => {
            let shown = &input.start[..input.start.len().min(SHOWN_BYTES)];
            let start = excerpt(&String::from_utf8_lossy(shown));
            Err(FormatError::Unknown { path: path.into(), start, supported: supported() })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_list_the_formats_that_are_read() {
        assert!(
            known::ALL.iter().map(|f| f.name).eq(FORMATS.iter().map(|f| f.known.name).chain([known::OME_ZARR.name]))
        );
    }
}
