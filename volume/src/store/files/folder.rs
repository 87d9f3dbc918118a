//! Where the files of a store are opened for reading: the only place that does.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::jail::{Jail, Refusal, platform};
use crate::ids::StoreHash;
use crate::store::error::{ManifestError, StoreError};
use crate::store::hash::ContentHash;
use crate::store::manifest::Manifest;
use crate::store::profile::MANIFEST_FILE;

/// The folder of a store. Cheap to clone.
#[derive(Debug, Clone)]
pub struct StoreFolder {
    path: PathBuf,
    /// With the folder's place in it. Without one, links lead wherever they lead.
    jail: Option<(Jail, PathBuf)>,
}

/// A regular file, open for reading from its start.
#[derive(Debug)]
pub(crate) struct StoreFile {
    pub(crate) file: File,
    /// Its length when it was opened.
    pub(crate) bytes: u64,
}

impl StoreFolder {
    /// A folder that was named by whoever runs the program: its links are followed.
    #[must_use]
    pub fn free(path: &Path) -> Self {
        Self { path: path.to_path_buf(), jail: None }
    }

    fn jailed(jail: &Jail, relative: &Path) -> Self {
        Self { path: jail.path(relative), jail: Some((jail.clone(), relative.to_path_buf())) }
    }

    /// For messages: what is opened by this path need not be in the jail.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Hash of the store's manifest, and so of the store, whether or not the rest is in order.
    ///
    /// # Errors
    /// No manifest, one that is too long, leads out of the jail, or cannot be read.
    pub fn manifest_hash(&self) -> Result<StoreHash, StoreError> {
        let bytes = self.read_at_most(MANIFEST_FILE, Manifest::MAX_BYTES + 1)?;
        match bytes.len() as u64 {
            got if got > Manifest::MAX_BYTES => Err(ManifestError::TooLong { got, max: Manifest::MAX_BYTES }.into()),
            _ => Ok(StoreHash::of(&bytes)),
        }
    }

    pub(crate) fn path_of(&self, file: &str) -> PathBuf {
        self.path.join(file)
    }

    /// Opens a file of the store, `file` being its path below the folder. Does not wait, whatever is there.
    pub(crate) fn open(&self, file: &str) -> Result<StoreFile, StoreError> {
        let opened = match &self.jail {
            Some((jail, folder)) => jail.open(&folder.join(file)),
            None => platform::open_free(&self.path_of(file)).map_err(Refusal::Io),
        };
        let io = |source| StoreError::Io { action: "open", path: self.path_of(file), source };
        let opened = opened.map_err(|refusal| match refusal {
            Refusal::Outside => StoreError::Outside { file: file.into() },
            Refusal::Io(source) => io(source),
        })?;
        let metadata = opened.metadata().map_err(io)?;
        if !metadata.is_file() {
            return Err(StoreError::NotAFile { path: self.path_of(file) });
        }
        Ok(StoreFile { file: opened, bytes: metadata.len() })
    }

    pub(crate) fn read_at_most(&self, file: &str, max: u64) -> Result<Vec<u8>, StoreError> {
        let opened = self.open(file)?;
        opened.read_at_most(max).map_err(|source| StoreError::Io { action: "read", path: self.path_of(file), source })
    }

    /// Reads a file whose length is known beforehand.
    pub(crate) fn read_exactly(&self, file: &str, want: u64) -> Result<Vec<u8>, StoreError> {
        let opened = self.open(file)?;
        let got = opened.bytes;
        let path = self.path_of(file);
        let bytes = match got == want {
            true => opened.read_at_most(want).map_err(StoreError::io("read", &path))?,
            false => Vec::new(),
        };
        match bytes.len() as u64 {
            n if n == want => Ok(bytes),
            _ => Err(StoreError::FileLength { path, got, want }),
        }
    }

    /// Checks a file of at most `max` bytes that nobody reads; a longer one has another hash.
    pub(crate) fn check_file(&self, file: &str, max: u64, want: ContentHash) -> Result<(), StoreError> {
        self.check_hash(file, &self.read_at_most(file, max)?, want)
    }

    pub(crate) fn check_hash(&self, file: &str, bytes: &[u8], want: ContentHash) -> Result<(), StoreError> {
        match ContentHash::of(bytes) {
            got if got == want => Ok(()),
            got => Err(StoreError::FileHash { path: self.path_of(file), got, want }),
        }
    }
}

impl Jail {
    /// The folder of a store; `relative` to the root. Whether it is there, and inside, is seen when something is opened in it.
    #[must_use]
    pub fn folder(&self, relative: &Path) -> StoreFolder {
        StoreFolder::jailed(self, relative)
    }
}

impl StoreFile {
    pub(crate) fn read_at_most(self, max: u64) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(self.bytes.min(max) as usize);
        self.file.take(max).read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}
