//! The file's bytes for the parser of metadata, so many at a time.

use std::fs::File;
use std::io;
use std::path::Path;

use hdf5_reader::error::{Error, Result};
use hdf5_reader::{FileStorage, StorageBuffer};

use crate::packed::opened;

/// No block of metadata is longer: what a header says of lengths costs no more.
const LONGEST: usize = 64 << 20;

pub(super) struct Storage(FileStorage);

impl Storage {
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let file: File = opened(path)?.into_inner();
        FileStorage::from_file(file).map(Self).map_err(io::Error::other)
    }
}

impl hdf5_reader::Storage for Storage {
    fn len(&self) -> u64 {
        self.0.len()
    }

    fn read_range(&self, offset: u64, len: usize) -> Result<StorageBuffer> {
        match len <= LONGEST {
            true => self.0.read_range(offset, len),
            false => Err(Error::ResourceLimit(format!("a block of {len} bytes, and at most {LONGEST} are read"))),
        }
    }
}
