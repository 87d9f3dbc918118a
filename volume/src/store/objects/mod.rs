//! What a store is read from: named objects (files, blobs), read by ranges of bytes. A folder is one such place, memory
//! another.

pub(super) mod folder;
pub(super) mod jail;
pub(super) mod level;
pub(super) mod memory;
mod nearby;

use std::fmt::Debug;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;

use super::error::StoreError;
use super::hash::ContentHash;

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
fn beyond_end(path: &Path) -> StoreError {
    StoreError::io("read", path)(io::Error::new(io::ErrorKind::UnexpectedEof, "failed to fill whole buffer"))
}
