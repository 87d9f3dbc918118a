//! What a format's reader is given: what the user names, opened.

use std::fs::File;
use std::io::{Read as _, Seek as _};
use std::path::{Path, PathBuf};

use super::error::FormatError;
use super::source::open_regular;

/// How much of a file formats are known by, bytes: DICOM's mark is at 128, NIfTI's at 344.
const START_BYTES: u64 = 512;

/// An input that is one file, or begins with one; stacks of slices are read by the crate `formats`.
#[derive(Debug)]
pub(super) struct Input {
    /// As the user names it.
    pub(super) path: PathBuf,
    /// Its first bytes, [`START_BYTES`] where there are so many.
    pub(super) start: Vec<u8>,
    /// Opened as a regular file; at its first byte.
    pub(super) file: File,
    /// What the volume is read from so far, see [`super::VolumeSource::files`]. A reader adds what else it reads.
    pub(super) files: Vec<PathBuf>,
}

impl Input {
    /// # Errors
    /// No such file, a folder, no regular file, an empty one.
    pub(super) fn open(path: &Path) -> Result<Self, FormatError> {
        let mut file = open_regular(path)?;
        let mut start = Vec::new();
        file.by_ref()
            .take(START_BYTES)
            .read_to_end(&mut start)
            .and_then(|_| file.rewind())
            .map_err(|reason| FormatError::io(path, "read", reason))?;
        match start.is_empty() {
            true => Err(FormatError::Empty { path: path.into() }),
            false => Ok(Self { path: path.into(), start, file, files: vec![path.into()] }),
        }
    }
}
