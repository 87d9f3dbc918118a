//! One range of bytes of one object: tries, pauses and deadlines.

use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::{Bytes, BytesMut};
use futures_util::StreamExt as _;
use object_store::path::Path;
use object_store::{GetOptions, GetRange, ObjectMeta, ObjectStore, ObjectStoreExt as _};
use tokio::sync::Semaphore;
use tokio::time::timeout;

use crate::error::RemoteError;
use crate::failed::{Outcome, outcome_of};

/// Tries of a request that nothing came of.
const TRIES: u32 = 6;
/// Before the second try; doubles from try to try.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// A server that says nothing for so long is given up, and asked again.
const SILENCE: Duration = Duration::from_secs(10);
/// All tries of a request together, with a second for each MiB that was asked for.
const DEADLINE: Duration = Duration::from_secs(30);
/// Requests under way at a time, of all who read from one place.
pub(crate) const AT_ONCE: usize = 64;

/// A server, and how many may ask it at once.
#[derive(Debug, Clone)]
pub(crate) struct Server {
    pub(crate) store: Arc<dyn ObjectStore>,
    pub(crate) turns: Arc<Semaphore>,
    /// What may be wrong where it does not answer; empty where nothing is known.
    pub(crate) hint: &'static str,
}

/// What came of a range: never more bytes than were asked for, and fewer only where the object ends.
#[derive(Debug)]
pub(crate) struct Fetched {
    pub(crate) bytes: Bytes,
    /// Of the object.
    pub(crate) size: u64,
    /// What tells the object from another one that takes its key.
    pub(crate) tag: Option<String>,
}

impl Server {
    /// The bytes of a range that is not empty; `tag` says of which object.
    pub(crate) async fn fetch(
        &self,
        key: &Path,
        range: Range<u64>,
        tag: Option<String>,
    ) -> Result<Fetched, RemoteError> {
        let time = DEADLINE + Duration::from_secs((range.end - range.start) >> 20);
        self.tried(time, || self.once(key, range.clone(), tag.clone())).await
    }

    /// How long an object is.
    pub(crate) async fn size(&self, key: &Path) -> Result<u64, RemoteError> {
        let look = || async {
            let _turn = self.turns.acquire().await;
            match timeout(SILENCE, self.store.head(key)).await {
                Err(_) => Err(silent()),
                Ok(head) => head.map(|meta| meta.size).map_err(|failed| outcome_of(&failed)),
            }
        };
        self.tried(DEADLINE, look).await
    }

    /// Tries until something final comes, or tries or time end.
    ///
    /// Not by the library's own retries: those do not go on where an answer breaks off and its object has no tag, and
    /// do not say how often they tried.
    pub(crate) async fn tried<T, F: Future<Output = Result<T, Outcome>>>(
        &self,
        time: Duration,
        once: impl Fn() -> F,
    ) -> Result<T, RemoteError> {
        let started = Instant::now();
        let (mut tries, mut last, mut pause) = (0, "it said nothing".to_owned(), FIRST_PAUSE);
        let all = async {
            loop {
                tries += 1;
                match once().await {
                    Ok(done) => return Ok(done),
                    Err(Outcome::Final(error)) => return Err(error),
                    Err(Outcome::Again(words)) => last = words,
                }
                if tries == TRIES {
                    let seconds = started.elapsed().as_secs();
                    return Err(RemoteError::Failed { tries, seconds, last: last.clone() + self.hint });
                }
                tokio::time::sleep(pause).await;
                pause *= 2;
            }
        };
        match timeout(time, all).await {
            Ok(outcome) => outcome,
            Err(_) => Err(RemoteError::Late { tries, seconds: time.as_secs(), last: last + self.hint }),
        }
    }

    async fn once(&self, key: &Path, range: Range<u64>, tag: Option<String>) -> Result<Fetched, Outcome> {
        let _turn = self.turns.acquire().await;
        let want = range.end - range.start;
        let options = GetOptions { range: Some(GetRange::Bounded(range)), if_match: tag, ..GetOptions::default() };
        let answer = timeout(SILENCE, self.store.get_opts(key, options)).await.map_err(|_| silent())?;
        let answer = answer.map_err(|failed| outcome_of(&failed))?;
        let ObjectMeta { size, e_tag, .. } = answer.meta.clone();
        let due = answer.range.end - answer.range.start;
        let mut parts = answer.into_stream();
        // No memory for what a server says that it will send: only for what comes, and no more than was asked for.
        let mut bytes = BytesMut::new();
        while let Some(part) = timeout(SILENCE, parts.next()).await.map_err(|_| silent())? {
            bytes.extend_from_slice(&part.map_err(|failed| outcome_of(&failed))?);
            if bytes.len() as u64 > due.min(want) {
                return Err(Outcome::Again(format!("more than the {} bytes that were asked for came", due.min(want))));
            }
        }
        if bytes.len() as u64 != due {
            return Err(Outcome::Again(format!("{} bytes came of {due}", bytes.len())));
        }
        // A weak tag matches nothing.
        let tag = e_tag.filter(|tag| !tag.starts_with("W/"));
        Ok(Fetched { bytes: bytes.freeze(), size, tag })
    }
}

fn silent() -> Outcome {
    Outcome::Again(format!("nothing came for {} s", SILENCE.as_secs()))
}

#[cfg(test)]
mod tests {
    use std::future::pending;
    use std::sync::atomic::{AtomicU32, Ordering};

    use object_store::memory::InMemory;

    use super::*;

    fn server() -> Server {
        Server { store: Arc::new(InMemory::new()), turns: Arc::new(Semaphore::new(AT_ONCE)), hint: "" }
    }

    #[tokio::test(start_paused = true)]
    async fn no_request_is_tried_without_end() {
        let tried = AtomicU32::new(0);
        let failing = || {
            tried.fetch_add(1, Ordering::SeqCst);
            async { Err::<(), _>(Outcome::Again("it broke".to_owned())) }
        };
        let error = server().tried(DEADLINE, failing).await.unwrap_err();
        assert!(matches!(&error, RemoteError::Failed { tries: TRIES, last, .. } if last == "it broke"), "{error}");
        assert_eq!(tried.load(Ordering::SeqCst), TRIES);
        let started = tokio::time::Instant::now();
        let error = server().tried(DEADLINE, pending::<Result<(), Outcome>>).await.unwrap_err();
        assert!(matches!(error, RemoteError::Late { tries: 1, seconds: 30, .. }), "{error}");
        assert_eq!(started.elapsed(), DEADLINE);
        let refused = || async { Err::<(), _>(Outcome::Final(RemoteError::Refused { status: 403 })) };
        assert_eq!(server().tried(DEADLINE, refused).await, Err(RemoteError::Refused { status: 403 }));
    }
}
