//! The file's bytes for the parser of metadata, so many at a time.

use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use hdf5_reader::error::{Error, Result};
use hdf5_reader::{FileStorage, StorageBuffer};

use crate::packed::opened;

/// No block of metadata is longer: what a header says of lengths costs no more.
const LONGEST: usize = 64 << 20;

/// Of all metadata until a dataset is found: the parser keeps what it read, and blocks may overlap.
const MOST_TO_OPEN: u64 = 192 << 20;

pub(super) struct Storage {
    file: FileStorage,
    /// Bytes that may still be read.
    left: AtomicU64,
}

impl Storage {
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let file: File = opened(path)?.into_inner();
        let file = FileStorage::from_file(file).map_err(io::Error::other)?;
        Ok(Self { file, left: AtomicU64::new(MOST_TO_OPEN) })
    }

    /// From now on it is voxels that are read, which nobody keeps.
    pub(super) fn is_found(&self) {
        self.left.store(u64::MAX, Ordering::Relaxed);
    }
}

impl hdf5_reader::Storage for Storage {
    fn len(&self) -> u64 {
        self.file.len()
    }

    fn read_range(&self, offset: u64, len: usize) -> Result<StorageBuffer> {
        if len > LONGEST {
            return Err(Error::ResourceLimit(format!("a block of {len} bytes, and at most {LONGEST} are read")));
        }
        let take = |left: u64| if left == u64::MAX { Some(left) } else { left.checked_sub(len as u64) };
        match self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, take) {
            Ok(_) => self.file.read_range(offset, len),
            Err(_) => Err(Error::ResourceLimit("there are more than 192 MiB of headers".into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use hdf5_reader::Storage as _;

    use super::*;

    #[test]
    fn headers_are_read_up_to_a_bound_and_voxels_without() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        File::create(&path).unwrap().set_len(MOST_TO_OPEN).unwrap();
        let storage = Storage::open(&path).unwrap();
        assert!(storage.read_range(0, LONGEST + 1).is_err());
        for _ in 0..3 {
            assert_eq!(storage.read_range(5, LONGEST - 9).unwrap().len(), LONGEST - 9);
        }
        assert!(storage.read_range(5, 28).is_err());
        storage.is_found();
        assert_eq!(storage.read_range(5, LONGEST - 9).unwrap().len(), LONGEST - 9);
    }
}
