//! What a store is read from: named objects (files, blobs), read by ranges of bytes. A folder is one such place, memory
//! another; places behind a network have a crate of their own.

pub(super) mod folder;
pub(super) mod jail;
pub(super) mod level;
pub(super) mod memory;
mod nearby;

use std::borrow::Cow;
use std::fmt::Debug;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;

use super::error::{ManifestError, StoreError};
use super::hash::ContentHash;
use super::manifest::Manifest;
use super::profile::MANIFEST_FILE;
use crate::ids::StoreHash;

/// The objects of one store. A key is an object's path below the store, `/` between names.
pub trait Objects: Debug + Send + Sync {
    /// Where they are, for messages: a folder, an address.
    fn place(&self) -> &Path;

    /// Finds an object, without waiting for whoever might write it.
    ///
    /// # Errors
    /// [`StoreError::Io`] of the kind `NotFound` where there is none; what is no object that ends; what must not be
    /// read.
    fn open(&self, key: &str) -> Result<Arc<dyn Object>, StoreError>;

    /// As [`Objects::open`], of an object that is `bytes` long by what a manifest promises. A far place believes it
    /// until something is read: only then it finds that nothing is there, or another length
    /// ([`StoreError::FileLength`]).
    ///
    /// # Errors
    /// As [`Objects::open`].
    fn open_promised(&self, key: &str, bytes: u64) -> Result<Arc<dyn Object>, StoreError> {
        let _ = bytes;
        self.open(key)
    }

    /// Tells which objects are opened soon, each once, and the most bytes that each can have: a far place fetches them
    /// together.
    fn foresee(&self, keys: &[(Cow<'_, str>, u64)]) {
        let _ = keys;
    }

    /// True where each look costs a round trip: what a manifest promises of large objects is then believed until they
    /// are read, and many are read at a time.
    fn is_far(&self) -> bool {
        false
    }

    /// For messages: what is opened by this path need not be the object.
    fn path_of(&self, key: &str) -> PathBuf {
        self.place().join(key)
    }
}

/// One object, as it was when it was opened: what takes its key later is another one. Reads from any number of threads.
pub trait Object: Debug + Send + Sync {
    /// Bytes.
    ///
    /// # Errors
    /// A place that does not say.
    fn size(&self) -> Result<u64, StoreError>;

    /// The bytes of each of `ranges`, which come together: one round trip where that counts. Whoever asks bounds their
    /// lengths; no memory is taken for what lies beyond the object's end.
    ///
    /// # Errors
    /// [`StoreError::Io`] of the kind `UnexpectedEof` for a range beyond the end; a disk or a network that fails.
    fn read(&self, ranges: &[Range<u64>]) -> Result<Vec<Bytes>, StoreError>;
}

impl dyn Object + '_ {
    /// The bytes of one range.
    pub(crate) fn read_one(&self, range: Range<u64>) -> Result<Bytes, StoreError> {
        Ok(self.read(&[range])?.pop().unwrap_or_default())
    }

    /// The first `most` bytes, or all where there are fewer.
    pub(crate) fn read_at_most(&self, most: u64) -> Result<Bytes, StoreError> {
        self.read_one(0..self.size()?.min(most))
    }
}

impl dyn Objects + '_ {
    /// Hash of the store's manifest, and so of the store, whether or not the rest is in order.
    ///
    /// # Errors
    /// No manifest, one that is too long, leads out of the jail, or cannot be read.
    pub fn manifest_hash(&self) -> Result<StoreHash, StoreError> {
        Ok(StoreHash::of(&self.manifest_bytes()?))
    }

    /// The store's manifest, whether or not the rest is in order.
    ///
    /// # Errors
    /// As [`Self::manifest_hash`]; a manifest that is none.
    pub fn manifest(&self) -> Result<Manifest, StoreError> {
        Manifest::from_bytes(&self.manifest_bytes()?)
    }

    fn manifest_bytes(&self) -> Result<Bytes, StoreError> {
        let bytes = self.read_at_most(MANIFEST_FILE, Manifest::MAX_BYTES + 1)?;
        match bytes.len() as u64 {
            got if got > Manifest::MAX_BYTES => Err(ManifestError::TooLong { got, max: Manifest::MAX_BYTES }.into()),
            _ => Ok(bytes),
        }
    }

    pub(crate) fn read_at_most(&self, key: &str, most: u64) -> Result<Bytes, StoreError> {
        self.open(key)?.read_at_most(most)
    }

    /// Reads an object whose length is known beforehand.
    pub(crate) fn read_exactly(&self, key: &str, want: u64) -> Result<Bytes, StoreError> {
        let object = self.open(key)?;
        match object.size()? {
            got if got == want => object.read_one(0..want),
            got => Err(StoreError::FileLength { path: self.path_of(key), got, want }),
        }
    }

    /// Checks an object of at most `most` bytes that nobody reads; a longer one has another hash.
    pub(crate) fn check_file(&self, key: &str, most: u64, want: ContentHash) -> Result<(), StoreError> {
        self.check_hash(key, &self.read_at_most(key, most)?, want)
    }

    pub(crate) fn check_hash(&self, key: &str, bytes: &[u8], want: ContentHash) -> Result<(), StoreError> {
        match ContentHash::of(bytes) {
            got if got == want => Ok(()),
            got => Err(StoreError::FileHash { path: self.path_of(key), got, want }),
        }
    }
}

/// A range that ends behind the object's last byte.
pub(in crate::store) fn beyond_end(path: &Path) -> StoreError {
    StoreError::io("read", path)(io::Error::new(io::ErrorKind::UnexpectedEof, "failed to fill whole buffer"))
}
