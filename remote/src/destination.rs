//! An object store as the place that a store is put to.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path as FilePath, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use brickcast_volume::small_file::{NotOpened, open_regular};
use brickcast_volume::store::{Destination, Objects, StoreError};
use bytes::Bytes;
use futures_util::{StreamExt as _, stream};
use object_store::path::Path;
use object_store::{ObjectStoreExt as _, PutPayload};
use tokio::time::timeout;

use crate::error::RemoteError;
use crate::failed::{Outcome, outcome_of};
use crate::fetch::Server;
use crate::root::Root;
use crate::runtime::wait_for;

/// A larger file is put in parts of so many bytes, or of as many as make [`MOST_PARTS`].
const PART: u64 = 16 << 20;
const MOST_PARTS: u64 = 9000;
/// A part that a server has not taken in so long is put again.
const SLOW: Duration = Duration::from_secs(60);
/// All tries of a file together, with some seconds for each MiB.
const DEADLINE: Duration = Duration::from_secs(120);
const SECONDS_PER_MIB: u64 = 4;
/// Objects that are removed at a time.
const REMOVED_AT_ONCE: usize = 16;

/// Below a prefix of a bucket.
#[derive(Debug)]
pub(crate) struct Bucket {
    pub(crate) root: Root,
    pub(crate) server: Server,
    pub(crate) prefix: Path,
}

impl Bucket {
    fn place_of(&self, key: &str) -> PathBuf {
        PathBuf::from(format!("{}/{key}", self.root.address()))
    }

    fn key(&self, key: &str) -> Result<Path, StoreError> {
        let below = Path::parse(key).map_err(|error| RemoteError::Setting(error.to_string()));
        let below = below.map_err(|error| error.of("write", self.place_of(key)))?;
        Ok(self.prefix.parts().chain(below.parts()).collect())
    }
}

/// The next bytes of a file, at most so many.
fn next(file: &mut File, most: u64) -> io::Result<Bytes> {
    let mut bytes = Vec::new();
    file.take(most).read_to_end(&mut bytes)?;
    Ok(bytes.into())
}

fn slow<T>(_: T) -> Outcome {
    Outcome::Again(format!("nothing was taken for {} s", SLOW.as_secs()))
}

/// All of a file, or nothing.
async fn put(server: &Server, key: &Path, path: &FilePath, bytes: u64) -> Result<(), Outcome> {
    let unread = |error: io::Error| Outcome::Final(RemoteError::Unread(format!("{}: {error}", path.display())));
    let mut file = open_regular(path).map_err(|error| match error {
        NotOpened::Io(error) => unread(error),
        NotOpened::NotRegular(_) => unread(io::ErrorKind::InvalidInput.into()),
    })?;
    let _turn = server.turns.acquire().await;
    if bytes <= PART {
        let payload = PutPayload::from_bytes(next(&mut file, PART).map_err(unread)?);
        let done = timeout(SLOW, server.store.put(key, payload)).await.map_err(slow)?;
        return done.map(drop).map_err(|failed| outcome_of(&failed));
    }
    let part = PART.max(bytes.div_ceil(MOST_PARTS));
    let begun = timeout(SLOW, server.store.put_multipart(key)).await.map_err(slow)?;
    let mut upload = begun.map_err(|failed| outcome_of(&failed))?;
    let parts = async {
        loop {
            let bytes = next(&mut file, part).map_err(unread)?;
            if bytes.is_empty() {
                break;
            }
            let done = timeout(SLOW, upload.put_part(bytes.into())).await.map_err(slow)?;
            done.map_err(|failed| outcome_of(&failed))?;
        }
        let done = timeout(SLOW, upload.complete()).await.map_err(slow)?;
        done.map(drop).map_err(|failed| outcome_of(&failed))
    };
    let ended = parts.await;
    if ended.is_err() {
        // Parts of nothing cost money, too.
        timeout(SLOW, upload.abort()).await.ok();
    }
    ended
}

impl Destination for Bucket {
    fn objects(&self) -> Arc<dyn Objects> {
        Arc::new(self.root.itself())
    }

    fn names(&self) -> Result<Vec<String>, StoreError> {
        let listing = self.root.list("")?.unwrap_or_default();
        let folders = listing.folders.into_iter().map(|name| name + "/");
        Ok(listing.files.into_iter().chain(folders).collect())
    }

    fn put(&self, key: &str, file: &FilePath) -> Result<(), StoreError> {
        let io = |source| StoreError::Io { action: "read", path: file.to_path_buf(), source };
        let bytes = file.metadata().map_err(io)?.len();
        let (server, at, path) = (self.server.clone(), self.key(key)?, file.to_path_buf());
        let time = DEADLINE + Duration::from_secs((bytes >> 20) * SECONDS_PER_MIB);
        let done = wait_for(async move { server.tried(time, || put(&server, &at, &path, bytes)).await });
        done.map_err(|error| error.of("write", self.place_of(key)))
    }

    fn remove(&self, keys: &[String]) -> Result<(), StoreError> {
        let all = keys.iter().map(|key| self.key(key)).collect::<Result<Vec<_>, _>>()?;
        let server = self.server.clone();
        let done = wait_for(async move {
            let server = &server;
            let removed = stream::iter(all).map(|key| async move {
                let once = || async {
                    let _turn = server.turns.acquire().await;
                    let done = timeout(SLOW, server.store.delete(&key)).await.map_err(slow)?;
                    done.map_err(|failed| outcome_of(&failed))
                };
                match server.tried(DEADLINE, once).await {
                    Err(RemoteError::NotFound) => Ok(()),
                    done => done,
                }
            });
            let ended: Vec<_> = removed.buffer_unordered(REMOVED_AT_ONCE).collect().await;
            ended.into_iter().collect::<Result<(), _>>()
        });
        done.map_err(|error| error.of("remove from", self.root.address().to_string().into()))
    }
}
