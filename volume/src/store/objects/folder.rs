//! A folder's files as objects, and where they are opened for reading: the only place that does.

use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;

use super::jail::{Jail, Refusal, platform};
use super::nearby::read_nearby;
use super::{Object, Objects, beyond_end};
use crate::ids::StoreHash;
use crate::store::error::StoreError;
use crate::store::files::position::read_exact_at;

/// Ranges so near to each other in a file are read at once, bytes: a page more costs less than a call to the system.
const GAP: u64 = 4096;

/// The folder of a store. Cheap to clone.
#[derive(Debug, Clone)]
pub struct StoreFolder {
    path: PathBuf,
    /// With the folder's place in it. Without one, links lead wherever they lead.
    jail: Option<(Jail, PathBuf)>,
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

    /// As [`Objects`] have it.
    ///
    /// # Errors
    /// No manifest, one that is too long, leads out of the jail, or cannot be read.
    pub fn manifest_hash(&self) -> Result<StoreHash, StoreError> {
        (self as &dyn Objects).manifest_hash()
    }
}

impl Objects for StoreFolder {
    fn place(&self) -> &Path {
        &self.path
    }

    /// Opens a regular file; anything else is refused at once.
    fn open(&self, key: &str) -> Result<Arc<dyn Object>, StoreError> {
        let path = self.path.join(key);
        let opened = match &self.jail {
            Some((jail, folder)) => jail.open(&folder.join(key)),
            None => platform::open_free(&path).map_err(Refusal::Io),
        };
        let file = opened.map_err(|refusal| match refusal {
            Refusal::Outside => StoreError::Outside { file: key.into() },
            Refusal::Io(source) => StoreError::io("open", &path)(source),
        })?;
        let metadata = file.metadata().map_err(StoreError::io("open", &path))?;
        match metadata.is_file() {
            true => Ok(Arc::new(OpenFile { file, bytes: metadata.len(), path })),
            false => Err(StoreError::NotAFile { path }),
        }
    }
}

impl Jail {
    /// The folder of a store; `relative` to the root. Whether it is there, and inside, is seen when something is opened
    /// in it.
    #[must_use]
    pub fn folder(&self, relative: &Path) -> StoreFolder {
        StoreFolder::jailed(self, relative)
    }
}

/// A regular file that stays open.
#[derive(Debug)]
struct OpenFile {
    file: File,
    /// Its length when it was opened.
    bytes: u64,
    path: PathBuf,
}

impl Object for OpenFile {
    fn size(&self) -> Result<u64, StoreError> {
        Ok(self.bytes)
    }

    fn read(&self, ranges: &[Range<u64>]) -> Result<Vec<Bytes>, StoreError> {
        read_nearby(ranges, GAP, |range| {
            if range.end > self.bytes {
                return Err(beyond_end(&self.path));
            }
            let mut bytes = vec![0; (range.end - range.start) as usize];
            read_exact_at(&self.file, &mut bytes, range.start).map_err(StoreError::io("read", &self.path))?;
            Ok(bytes.into())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_file_is_the_one_that_was_opened_and_no_memory_is_taken_for_what_it_lacks() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        std::fs::write(&path, "0123456789").unwrap();
        let folder = StoreFolder::free(dir.path());
        let opened = folder.open("a").unwrap();
        std::fs::rename(&path, dir.path().join("b")).unwrap();
        std::fs::write(&path, "another").unwrap();
        assert_eq!(opened.read(&[7..10, 0..2, 4..4]).unwrap(), [&b"789"[..], b"01", b""]);
        assert_eq!((opened.size().unwrap(), folder.open("a").unwrap().size().unwrap()), (10, 7));
        let cut = |read: Result<Vec<Bytes>, StoreError>| {
            let error = read.unwrap_err();
            let text = error.to_string();
            assert!(text.starts_with("cannot read") && text.contains("/a"), "{text}");
            matches!(error, StoreError::Io { source, .. } if source.kind() == std::io::ErrorKind::UnexpectedEof)
        };
        assert!(cut(opened.read(&[0..2, 3..u64::MAX])));
        // It may shrink while it is open.
        std::fs::write(dir.path().join("b"), "01").unwrap();
        assert!(cut(opened.read(&[0..2, 7..10])));
    }
}
