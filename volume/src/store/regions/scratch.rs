//! Files that live as long as the work on a store: what a pass leaves for the next one, so that memory need not hold
//! it.

use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::store::error::StoreError;

/// A file in the working directory; removed with this, or with the directory.
#[derive(Debug)]
pub(crate) struct Scratch {
    path: PathBuf,
    file: File,
}

impl Scratch {
    pub(crate) fn create(dir: &Path, name: &str) -> Result<Self, StoreError> {
        let path = dir.join(name);
        let file = File::options().read(true).write(true).create_new(true).open(&path);
        let file = file.map_err(StoreError::io("create", &path))?;
        Ok(Self { path, file })
    }

    pub(crate) fn write(&mut self, offset: u64, bytes: &[u8]) -> Result<(), StoreError> {
        let written = self.file.seek(SeekFrom::Start(offset)).and_then(|_| self.file.write_all(bytes));
        written.map_err(StoreError::io("write", &self.path))
    }

    pub(crate) fn read(&mut self, offset: u64, out: &mut [u8]) -> Result<(), StoreError> {
        let read = self.file.seek(SeekFrom::Start(offset)).and_then(|_| self.file.read_exact(out));
        read.map_err(StoreError::io("read", &self.path))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // The next level's regions have a file of the same name; what is left goes with the directory.
        let _ = fs::remove_file(&self.path);
    }
}
