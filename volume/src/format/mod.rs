//! Volume file formats, read in slabs of whole z-planes.
//!
//! A new format is a line in [`FORMATS`] and a module that ends in a [`VolumeSource`].

mod coded;
mod directions;
mod error;
pub mod nrrd;
mod planes;
pub mod raw;
mod raw_name;
mod series;
mod text_voxels;
mod voxel_type;

use std::ffi::OsStr;
use std::fs::File;
use std::io::{Read as _, Seek as _};
use std::path::{Path, PathBuf};

use crate::small_file::{self, FileKind, NotOpened};
use crate::space::Geometry;

pub use error::FormatError;
pub use raw::RawHints;
pub use voxel_type::{Endian, ParseNameError, VoxelType};

/// What of a geometry a file, or the user, says; the rest was assumed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Placement {
    pub spacing: bool,
    pub origin: bool,
    pub directions: bool,
}

/// What a file says of its volume.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceHeader {
    pub geometry: Geometry,
    /// What of the geometry the file says.
    pub placement: Placement,
    pub voxel_type: VoxelType,
    /// Name of the format, for people.
    pub format: &'static str,
    /// Unit of spacing and origin where the file names one, e.g. `mm`.
    pub space_unit: Option<String>,
    /// Values that stand for no data (fill values), as the file or the user declares them; NaN always does.
    pub no_data: Vec<f64>,
    /// What was guessed or left aside (a raw file's name read as dims, axes of another space), for people.
    pub notes: Vec<String>,
}

/// An input volume, read in order; a second pass starts with [`VolumeSource::rewind`].
pub trait VolumeSource: Send + std::fmt::Debug {
    fn header(&self) -> &SourceHeader;

    /// Every file that the volume is read from, its header first: while none of them changes, nor does the volume. None where it is
    /// in memory.
    fn files(&self) -> &[PathBuf] {
        &[]
    }

    /// Starts over at plane 0.
    ///
    /// # Errors
    /// The file cannot be opened again.
    fn rewind(&mut self) -> Result<(), FormatError>;

    /// Replaces `planes` by the next `count` z-planes (fewer only at the volume's end), voxels little endian, x fastest.
    ///
    /// # Errors
    /// Truncated data, a broken compressed stream.
    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError>;

    /// Replaces `piece` by the voxels that come next: whole voxels, `most` bytes where so many are left. A source that cannot
    /// stop within a plane gives the whole next one.
    ///
    /// # Errors
    /// As [`VolumeSource::read_planes`].
    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        let _ = most;
        self.read_planes(1, piece)
    }

    /// Makes `voxel`, counted x fastest, the next one that [`VolumeSource::read_piece`] gives. False where the source goes in
    /// order only; then nothing has changed.
    ///
    /// # Errors
    /// The file cannot be opened again.
    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        let _ = voxel;
        Ok(false)
    }
}

/// One line of the table of formats.
struct Format {
    name: &'static str,
    /// Lower case, without the dot.
    extensions: &'static [&'static str],
    /// What of the format is read, for people.
    reads: &'static str,
    /// Knows a file by its first [`START_BYTES`] bytes; `None` for formats that have no mark of their own.
    recognises: Option<fn(&[u8]) -> bool>,
    open: OpenFormat,
}

type OpenFormat = fn(File, &Path, &RawHints) -> Result<Box<dyn VolumeSource>, FormatError>;

const START_BYTES: u64 = 16;

static FORMATS: [Format; 2] = [
    Format {
        name: "NRRD",
        extensions: &["nrrd", "nhdr"],
        reads: "raw, gzip, bzip2, ascii or hex encoding, attached or with one data file or many",
        recognises: Some(nrrd::has_magic),
        open: nrrd::open,
    },
    Format {
        name: "raw voxels",
        extensions: &["raw"],
        reads: "with --dims X,Y,Z --type uint16, or named like part_512x512x400_uint16.raw",
        recognises: None,
        open: raw::open,
    },
];

/// The formats that [`open`] reads, for people.
#[must_use]
pub fn supported() -> String {
    let list: Vec<String> = FORMATS
        .iter()
        .map(|f| {
            let extensions: Vec<String> = f.extensions.iter().map(|e| format!(".{e}")).collect();
            format!("{} ({}: {})", f.name, extensions.join(", "), f.reads)
        })
        .collect();
    list.join("; ")
}

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
        .or_else(|| FORMATS.iter().find(|f| f.extensions.contains(&extension.as_str())));
    match chosen {
        Some(format) => (format.open)(file, path, hints),
        None if hints.dims.is_some() => raw::open(file, path, hints),
        None => {
            Err(FormatError::Unknown { path: path.into(), start: error::excerpt(&String::from_utf8_lossy(&start)) })
        }
    }
}

/// Opens a regular file; anything else is refused, never waited for.
fn open_regular(path: &Path) -> Result<File, FormatError> {
    small_file::open_regular(path).map_err(|error| match error {
        NotOpened::Io(reason) => FormatError::io(path, "open", reason),
        NotOpened::NotRegular(FileKind::Folder) => FormatError::Directory { path: path.into() },
        NotOpened::NotRegular(kind) => FormatError::NotRegular { path: path.into(), kind },
    })
}
