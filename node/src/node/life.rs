//! What became of a node since it started.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use brickcast_proto::{Fault, LastError, NodeLife};

use crate::error::NodeError;
use crate::version::BUILT_FROM;

#[derive(Debug)]
pub(super) struct Life {
    started: Instant,
    /// Rendered to the end.
    frames: AtomicU64,
    last_error: Mutex<Option<(String, Instant)>>,
}

impl Life {
    pub(super) fn new() -> Self {
        Self { started: Instant::now(), frames: AtomicU64::new(0), last_error: Mutex::default() }
    }

    pub(super) fn rendered(&self) {
        self.frames.fetch_add(1, Ordering::Relaxed);
    }

    /// Keeps an error that no client has made.
    pub(super) fn failed(&self, error: &NodeError) {
        use Fault::{BrokenStore, BudgetTooSmall, Device, Internal, OtherContent};
        if matches!(error.fault(), BrokenStore | BudgetTooSmall | Device | Internal | OtherContent) {
            let last = Some((error.to_string(), Instant::now()));
            *self.last_error.lock().unwrap_or_else(PoisonError::into_inner) = last;
        }
    }

    pub(super) fn told(&self, certificate_ends: Option<i64>) -> NodeLife {
        let last = self.last_error.lock().unwrap_or_else(PoisonError::into_inner).clone();
        NodeLife {
            uptime: Some(self.started.elapsed().as_secs_f64()),
            frames: Some(self.frames.load(Ordering::Relaxed)),
            last_error: last.map(|(message, at)| LastError { message, age: Some(at.elapsed().as_secs_f64()) }),
            certificate_ends,
            commit: BUILT_FROM.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_clients_do_wrong_is_no_error_of_the_node() {
        let life = Life::new();
        for theirs in [NodeError::Cancelled, NodeError::TooManyFrames(8), NodeError::Stalled(10), NodeError::Draining] {
            life.failed(&theirs);
        }
        assert_eq!(life.told(None).last_error, None);
        life.failed(&NodeError::Panicked("first".to_owned()));
        life.failed(&NodeError::BatchTooLarge { bytes: 2, budget: 1 });
        life.rendered();
        let told = life.told(Some(7));
        assert!(told.last_error.is_some_and(|error| error.message.contains("memory budget") && error.age.is_some()));
        assert_eq!((told.frames, told.certificate_ends), (Some(1), Some(7)));
        assert!(told.uptime.is_some_and(|uptime| uptime < 3600.0));
    }
}
