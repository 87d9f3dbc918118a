//! A file of records as it grows, and as it is once it is on the disk.

use std::borrow::Cow;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3Default;

use super::index::HaloIndex;
use crate::store::codec;
use crate::store::error::StoreError;
use crate::store::hash::ContentHash;
use crate::store::manifest::halo::HaloHashes;

/// A file of halos that is on the disk, and its index, which is not yet.
#[derive(Debug)]
pub(crate) struct WrittenHalos {
    pub(crate) bytes: u64,
    /// Of the file of records.
    pub(crate) hash: ContentHash,
    pub(crate) index: Vec<u8>,
}

impl WrittenHalos {
    pub(crate) fn hashes(&self) -> HaloHashes {
        HaloHashes { file: self.hash, index: ContentHash::of(&self.index) }
    }
}

pub(crate) struct HaloWriter {
    pub(crate) path: PathBuf,
    file: BufWriter<File>,
    hash: Xxh3Default,
    /// Records of a brick.
    pub(crate) records: usize,
    /// Length and crc32c of each.
    pub(crate) entries: Vec<(u32, u32)>,
}

impl HaloWriter {
    /// Replaces a file of an earlier attempt.
    pub(crate) fn create(path: &Path, records: usize) -> Result<Self, StoreError> {
        let file = File::create(path).map_err(StoreError::io("create", path))?;
        let file = BufWriter::with_capacity(1 << 20, file);
        Ok(Self { path: path.to_path_buf(), file, hash: Xxh3Default::new(), records, entries: Vec::new() })
    }

    /// Takes the next records, which `raw` makes of each of `halos`; nothing where all is the fill value.
    pub(crate) fn add<H: Sync>(
        &mut self,
        halos: &[H],
        raw: impl Fn(&H) -> Option<Cow<'_, [u8]>> + Sync,
    ) -> Result<(), StoreError> {
        let record = |halo: &H| raw(halo).map_or(Ok(Vec::new()), |raw| codec::compress(&raw));
        let records: Vec<Vec<u8>> = halos.par_iter().map(record).collect::<Result<_, StoreError>>()?;
        for bytes in records {
            self.append(&bytes)?;
            // The crc32c of no bytes is 0.
            self.entries.push((bytes.len() as u32, crc32c::crc32c(&bytes)));
        }
        Ok(())
    }

    /// Bytes of records, whose entries are the caller's to add.
    pub(crate) fn append(&mut self, bytes: &[u8]) -> Result<(), StoreError> {
        self.file.write_all(bytes).map_err(StoreError::io("write", &self.path))?;
        self.hash.update(bytes);
        Ok(())
    }

    pub(crate) fn flush(&mut self) -> Result<(), StoreError> {
        self.file.flush().map_err(StoreError::io("write", &self.path))
    }

    pub(crate) fn finish(mut self) -> Result<WrittenHalos, StoreError> {
        let written = self.file.flush().and_then(|()| self.file.get_ref().sync_all());
        written.map_err(StoreError::io("write", &self.path))?;
        let index = HaloIndex::new(self.records, self.entries);
        let hash = ContentHash(self.hash.digest128());
        Ok(WrittenHalos { bytes: index.file_bytes(), hash, index: index.to_bytes() })
    }
}
