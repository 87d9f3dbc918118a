//! Orders that nobody wants any more, as they are cancelled: at a pace that costs no connection.
//!
//! Invariant: an order is not reset before its node took it up, [`PATIENCE`] aside. HTTP/2 servers count calls that are
//! reset before that and close the connection, with everything else on it, where they pile up: h2 at 20 of them, unless
//! it is told otherwise.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::{Semaphore, oneshot};
use tokio::time::Instant;
use tonic::Status;

/// Orders of one connection that were sent and not taken up, cancelled ones among them; the next waits. As many as a
/// node lets one client have open, and well below 20.
const UNANSWERED: usize = 8;
/// A cancelled order that is not taken up for so long is reset all the same.
const PATIENCE: Duration = Duration::from_secs(5);
/// A connection that breaks so soon after a cancel was closed because of it, as far as can be known: the word of the
/// node may be lost with the connection.
const AFTERMATH: Duration = Duration::from_secs(1);

/// The orders of one connection.
#[derive(Debug, Clone)]
pub(crate) struct Cancels {
    places: Arc<Semaphore>,
    last: Arc<Mutex<Option<Instant>>>,
}

impl Default for Cancels {
    fn default() -> Self {
        Self { places: Arc::new(Semaphore::new(UNANSWERED)), last: Arc::default() }
    }
}

impl Cancels {
    /// Makes the call, and waits for its node to take it up even where this is dropped meanwhile.
    pub(crate) async fn call<T: Send + 'static>(
        &self,
        call: impl Future<Output = Result<T, Status>> + Send + 'static,
    ) -> Result<T, Status> {
        // Neither is seen while a runtime runs: nobody closes the semaphore, and the task below always answers.
        let over = || Status::cancelled("the program ends");
        let place = self.places.clone().acquire_owned().await.map_err(|_| over())?;
        let (mut asker, answer) = oneshot::channel();
        let cancels = self.clone();
        tokio::spawn(async move {
            let _place = place;
            tokio::pin!(call);
            tokio::select! {
                biased;
                // Where it is not wanted any more it is dropped here: a reset of what was taken up.
                taken = &mut call => if asker.send(taken).is_err() {
                    cancels.note();
                },
                () = asker.closed() => {
                    cancels.note();
                    tokio::time::timeout(PATIENCE, call).await.ok();
                }
            }
        });
        answer.await.map_err(|_| over())?
    }

    /// An answer that is dropped while this is kept was cancelled.
    pub(crate) fn unless_ended(&self) -> Unended {
        Unended { cancels: self.clone(), ended: false }
    }

    pub(crate) fn just_now(&self) -> bool {
        self.last().is_some_and(|at| at.elapsed() < AFTERMATH)
    }

    fn note(&self) {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    }

    fn last(&self) -> Option<Instant> {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Notes a cancel when it is dropped, unless the answer had ended.
#[derive(Debug)]
pub(crate) struct Unended {
    cancels: Cancels,
    ended: bool,
}

impl Unended {
    pub(crate) fn ended(&mut self) {
        self.ended = true;
    }
}

impl Drop for Unended {
    fn drop(&mut self) {
        if !self.ended {
            self.cancels.note();
        }
    }
}
