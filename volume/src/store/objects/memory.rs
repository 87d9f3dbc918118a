//! A store in memory.

use std::collections::BTreeMap;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;

use super::{Object, Objects, beyond_end};
use crate::store::error::StoreError;

/// Objects in memory, by their keys.
#[derive(Debug, Clone)]
pub struct MemoryObjects {
    place: PathBuf,
    objects: BTreeMap<String, Bytes>,
}

impl MemoryObjects {
    /// None yet; `place` names them in messages.
    #[must_use]
    pub fn new(place: &Path) -> Self {
        Self { place: place.to_path_buf(), objects: BTreeMap::new() }
    }

    /// Puts an object in place of the one that has its key, if one has.
    pub fn put(&mut self, key: &str, content: impl Into<Bytes>) {
        self.objects.insert(key.to_owned(), content.into());
    }

    /// Takes an object out.
    pub fn remove(&mut self, key: &str) -> Option<Bytes> {
        self.objects.remove(key)
    }

    /// Keys and contents, in the order of the keys.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Bytes)> {
        self.objects.iter().map(|(key, content)| (key.as_str(), content))
    }
}

impl Objects for MemoryObjects {
    fn place(&self) -> &Path {
        &self.place
    }

    fn open(&self, key: &str) -> Result<Arc<dyn Object>, StoreError> {
        let path = self.place.join(key);
        match self.objects.get(key) {
            Some(content) => Ok(Arc::new(Content { path, content: content.clone() })),
            None => Err(StoreError::io("open", &path)(io::ErrorKind::NotFound.into())),
        }
    }
}

#[derive(Debug)]
struct Content {
    path: PathBuf,
    content: Bytes,
}

impl Object for Content {
    fn size(&self) -> Result<u64, StoreError> {
        Ok(self.content.len() as u64)
    }

    fn read(&self, ranges: &[Range<u64>]) -> Result<Vec<Bytes>, StoreError> {
        let size = self.content.len() as u64;
        let piece = |range: &Range<u64>| match range.end <= size && range.start <= range.end {
            true => Ok(self.content.slice(range.start as usize..range.end as usize)),
            false => Err(beyond_end(&self.path)),
        };
        ranges.iter().map(piece).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_come_as_asked_and_nothing_lies_beyond_the_end() {
        let mut objects = MemoryObjects::new(Path::new("memory"));
        objects.put("a/b", &b"0123456789"[..]);
        let object = objects.open("a/b").unwrap();
        assert_eq!(object.size().unwrap(), 10);
        assert_eq!(object.read(&[7..10, 0..2, 4..4]).unwrap(), [&b"789"[..], b"01", b""]);
        // A length that no memory has.
        let error = object.read(&[0..2, 3..u64::MAX]).unwrap_err();
        let is_end = matches!(&error, StoreError::Io { source, .. } if source.kind() == io::ErrorKind::UnexpectedEof);
        assert!(is_end && error.to_string().contains("a/b"), "{error}");
        let error = objects.open("a").unwrap_err();
        assert!(matches!(&error, StoreError::Io { source, .. } if source.kind() == io::ErrorKind::NotFound), "{error}");
    }
}
