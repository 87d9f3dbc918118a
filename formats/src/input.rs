//! One file that somebody names, looked at: what it begins with once gzip or zstd around it is taken off.

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use brickcast_volume::format::FormatError;
use brickcast_volume::small_file;

use crate::packed::{Packing, opened};
use crate::wrong::unreadable;

/// How much of a file formats are known by: HDF5's mark may follow 2048 bytes of the user's own.
pub(crate) const START_BYTES: u64 = 2056;

#[derive(Debug)]
pub(crate) struct Input {
    pub(crate) path: PathBuf,
    pub(crate) packing: Packing,
    /// The first bytes, unpacked.
    pub(crate) start: Vec<u8>,
    /// Of the file as it lies there.
    pub(crate) file_bytes: u64,
    /// Which of the arrays in it somebody names.
    pub(crate) array: Option<String>,
}

impl Input {
    /// Nothing where there is no regular file, or nothing in it.
    pub(crate) fn open(path: &Path) -> Result<Option<Self>, FormatError> {
        let Ok(mut file) = small_file::open_regular(path) else { return Ok(None) };
        let failed = |reason| unreadable(path, reason);
        let file_bytes = file.metadata().map_err(failed)?.len();
        let mut start = Vec::new();
        file.by_ref().take(START_BYTES).read_to_end(&mut start).map_err(failed)?;
        if start.is_empty() {
            return Ok(None);
        }
        let packing = Packing::of(&start);
        let mut input = Self { path: path.into(), packing, start, file_bytes, array: None };
        if packing != Packing::None {
            input.start = input.head(START_BYTES)?;
        }
        Ok(Some(input))
    }

    pub(crate) fn is_packed(&self) -> bool {
        self.packing != Packing::None
    }

    /// At most `most` of the first bytes, unpacked.
    pub(crate) fn head(&self, most: u64) -> Result<Vec<u8>, FormatError> {
        let mut head = Vec::new();
        let read = self.stream().and_then(|stream| stream.take(most).read_to_end(&mut head));
        read.map_err(|reason| unreadable(&self.path, reason))?;
        Ok(head)
    }

    /// The file's bytes from the first one, unpacked.
    pub(crate) fn stream(&self) -> io::Result<Box<dyn Read + Send>> {
        self.packing.unpacked(opened(&self.path)?)
    }
}
