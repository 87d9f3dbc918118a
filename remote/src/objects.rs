//! A store behind a network, as objects that are read by ranges.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use brickcast_volume::store::{Object, Objects, StoreError};
use bytes::Bytes;
use futures_util::StreamExt as _;
use futures_util::stream;
use object_store::coalesce_ranges;
use object_store::path::Path;

use crate::error::RemoteError;
use crate::fetch::{AT_ONCE, Fetched, Server};
use crate::runtime::wait_for;

/// Ranges so near to each other are fetched at once, bytes: what lies between costs less than another request.
const GAP: u64 = 64 << 10;
/// What is fetched of an object when it is opened, for its length is not known: all of most that are opened so, bytes.
const HEAD: u64 = 128 << 10;
/// No longer object is fetched before it is opened, bytes.
const MOST_FORESEEN: u64 = 32 << 20;
/// All that wait to be opened together, bytes.
const MOST_WAITING: u64 = 256 << 20;
/// Heads that may be asked for several times are kept, bytes; longer ones are given away.
const KEPT: u64 = 64 << 10;

/// The objects of one store. Cheap to clone.
#[derive(Debug, Clone)]
pub struct RemoteObjects {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    server: Server,
    /// For messages.
    place: PathBuf,
    /// Of the store, in the server's terms; empty where the server is all of it.
    prefix: Path,
    /// By their keys: what was fetched before it is opened.
    foreseen: Mutex<HashMap<String, Arc<RemoteObject>>>,
}

impl RemoteObjects {
    pub(crate) fn new(server: Server, place: PathBuf, prefix: Path) -> Self {
        Self { inner: Arc::new(Inner { server, place, prefix, foreseen: Mutex::default() }) }
    }

    fn object(&self, key: &str) -> Result<RemoteObject, StoreError> {
        let path = self.path_of(key);
        let below =
            Path::parse(key).map_err(|error| RemoteError::Setting(error.to_string()).of("open", path.clone()))?;
        let key = self.inner.prefix.parts().chain(below.parts()).collect();
        Ok(RemoteObject {
            file: Arc::new(File { server: self.inner.server.clone(), key, known: Mutex::default() }),
            path,
            head: Bytes::new(),
        })
    }

    fn taken(&self, key: &str) -> Option<Arc<RemoteObject>> {
        let mut foreseen = self.inner.foreseen.lock().unwrap_or_else(PoisonError::into_inner);
        match foreseen.get(key) {
            Some(object) if object.head.len() as u64 <= KEPT => Some(object.clone()),
            _ => foreseen.remove(key),
        }
    }
}

impl Objects for RemoteObjects {
    fn place(&self) -> &std::path::Path {
        &self.inner.place
    }

    fn open(&self, key: &str) -> Result<Arc<dyn Object>, StoreError> {
        if let Some(object) = self.taken(key) {
            return Ok(object);
        }
        let object = self.object(key)?;
        let file = object.file.clone();
        let path = object.path.clone();
        let head = wait_for(async move { file.head(HEAD).await }).map_err(|error| error.of("open", path))?;
        Ok(Arc::new(RemoteObject { head, ..object }))
    }

    fn open_promised(&self, key: &str, bytes: u64) -> Result<Arc<dyn Object>, StoreError> {
        let object = self.object(key)?;
        object.file.known().size = Some(bytes);
        Ok(Arc::new(object))
    }

    fn foresee(&self, keys: &[(Cow<'_, str>, u64)]) {
        let (mut objects, mut room) = (HashMap::new(), MOST_WAITING);
        for (key, most) in keys {
            let is_new = !objects.contains_key(&**key) && (1..=MOST_FORESEEN.min(room)).contains(most);
            if let (true, Ok(object)) = (is_new, self.object(key)) {
                room -= most;
                objects.insert(key.to_string(), (object, *most));
            }
        }
        let fetched = wait_for(async move {
            let fetch = |(key, (object, most)): (String, (RemoteObject, u64))| async move {
                // What does not come is asked for again when it is opened, and tells why then.
                let head = object.file.head(most).await.ok()?;
                Some((key, Arc::new(RemoteObject { head, ..object })))
            };
            Ok(stream::iter(objects).map(fetch).buffer_unordered(AT_ONCE).collect::<Vec<_>>().await)
        });
        let mut foreseen = self.inner.foreseen.lock().unwrap_or_else(PoisonError::into_inner);
        foreseen.extend(fetched.unwrap_or_default().into_iter().flatten());
    }

    fn is_far(&self) -> bool {
        true
    }
}

/// One object, as it was when something of it was first read.
struct RemoteObject {
    file: Arc<File>,
    /// For messages.
    path: PathBuf,
    /// Its first bytes, where some were fetched.
    head: Bytes,
}

impl fmt::Debug for RemoteObject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RemoteObject").field("path", &self.path).field("head", &self.head.len()).finish()
    }
}

struct File {
    server: Server,
    key: Path,
    known: Mutex<Known>,
}

/// What is known of an object.
#[derive(Debug, Clone, Default)]
struct Known {
    /// Promised, or told by the server; the two must be the same.
    size: Option<u64>,
    /// Tells it from another object that takes its key.
    tag: Option<String>,
}

impl File {
    fn known(&self) -> std::sync::MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The first `most` bytes, or all where there are fewer; the size is known from then on.
    async fn head(&self, most: u64) -> Result<Bytes, RemoteError> {
        match self.fetch(0..most).await {
            // No range of an empty object can be asked for.
            Err(RemoteError::BeyondEnd) => match self.server.size(&self.key).await? {
                0 => {
                    self.known().size = Some(0);
                    Ok(Bytes::new())
                }
                _ => Err(RemoteError::BeyondEnd),
            },
            fetched => fetched,
        }
    }

    /// A range that is not empty, or as much of it as there is.
    async fn fetch(&self, range: Range<u64>) -> Result<Bytes, RemoteError> {
        let tag = self.known().tag.clone();
        let Fetched { bytes, size, tag } = self.server.fetch(&self.key, range, tag).await?;
        let mut known = self.known();
        match known.size {
            Some(want) if want != size => Err(RemoteError::Length { got: size, want }),
            _ => {
                known.size = Some(size);
                known.tag = known.tag.take().or(tag);
                Ok(bytes)
            }
        }
    }

    async fn whole_range(&self, range: Range<u64>) -> Result<Bytes, RemoteError> {
        let want = range.end - range.start;
        let fetched = match self.fetch(range).await {
            // How long is it, if not as promised?
            Err(RemoteError::BeyondEnd) => {
                let (got, promised) = (self.server.size(&self.key).await?, self.known().size);
                return Err(match promised {
                    Some(want) if want != got => RemoteError::Length { got, want },
                    _ => RemoteError::BeyondEnd,
                });
            }
            fetched => fetched?,
        };
        match fetched.len() as u64 == want {
            true => Ok(fetched),
            false => Err(RemoteError::BeyondEnd),
        }
    }
}

impl Object for RemoteObject {
    fn size(&self) -> Result<u64, StoreError> {
        if let Some(size) = self.file.known().size {
            return Ok(size);
        }
        let file = self.file.clone();
        wait_for(async move { file.server.size(&file.key).await }).map_err(|error| error.of("read", self.path.clone()))
    }

    fn read(&self, ranges: &[Range<u64>]) -> Result<Vec<Bytes>, StoreError> {
        let failed = |error: RemoteError| error.of("read", self.path.clone());
        if let Some(size) = self.file.known().size
            && ranges.iter().any(|range| range.end > size)
        {
            return Err(failed(RemoteError::BeyondEnd));
        }
        let head = self.head.len() as u64;
        let is_far = |range: &&Range<u64>| !range.is_empty() && range.end > head;
        let far: Vec<Range<u64>> = ranges.iter().filter(is_far).cloned().collect();
        let mut fetched = Vec::new();
        if !far.is_empty() {
            let file = self.file.clone();
            let fetch = move |range| {
                let file = file.clone();
                async move { file.whole_range(range).await }
            };
            let work = async move { coalesce_ranges(&far, fetch, GAP).await };
            fetched = wait_for(work).map_err(failed)?;
        }
        let mut fetched = fetched.into_iter();
        let piece = |range: &Range<u64>| match range {
            range if range.is_empty() => Bytes::new(),
            range if range.end <= head => self.head.slice(range.start as usize..range.end as usize),
            _ => fetched.next().unwrap_or_default(),
        };
        Ok(ranges.iter().map(piece).collect())
    }
}

#[cfg(test)]
mod tests;
