//! Where a store is made: a folder here, in which it appears once it is finished, or a place that it is put to as it is
//! made.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::destination::{Destination, Sent};
use super::root::StoreRoot;
use super::workdir::WorkDir;
use crate::leftovers::Farewell;
use crate::store::error::StoreError;

#[derive(Debug)]
pub(crate) struct Target {
    work: WorkDir,
    sent: Option<Guard>,
}

/// Takes away what was put, where it did not become a store, and so does a signal.
#[derive(Debug)]
struct Guard {
    sent: Arc<Sent>,
    _farewell: Farewell,
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.sent.clear();
    }
}

impl Target {
    /// A folder of this machine.
    pub(crate) fn folder(out: &Path, force: bool) -> Result<Self, StoreError> {
        Ok(Self { work: WorkDir::create(out, force)?, sent: None })
    }

    /// A place elsewhere; what is not there yet is in the folder `scratch`.
    pub(crate) fn elsewhere(to: Arc<dyn Destination>, force: bool, scratch: &Path) -> Result<Self, StoreError> {
        let work = WorkDir::create(&scratch.join("made"), false)?;
        let sent = Arc::new(Sent::new(to, force, &work.scratch())?);
        let last = sent.clone();
        let farewell = Farewell::of(move || {
            last.clear();
            None
        });
        Ok(Self { work, sent: Some(Guard { sent, _farewell: farewell }) })
    }

    /// Of a level.
    pub(crate) fn root(&self, level: u8) -> Result<StoreRoot, StoreError> {
        let root = StoreRoot::create(&self.work.store(), level)?;
        Ok(root.sent(self.sent.as_ref().map(|guard| guard.sent.clone())))
    }

    /// From now on it is made of a step of a series.
    pub(crate) fn enter(&mut self, step: usize) -> Result<(), StoreError> {
        self.work.enter(step)
    }

    /// The step is made.
    pub(crate) fn leave(&mut self) {
        self.work.leave();
    }

    /// Where files are until they are there.
    pub(crate) fn store(&self) -> PathBuf {
        self.work.store()
    }

    /// Where files are that live no longer than the work.
    pub(crate) fn scratch(&self) -> PathBuf {
        self.work.scratch()
    }

    pub(crate) fn publish(self) -> Result<(), StoreError> {
        match &self.sent {
            None => self.work.publish(),
            Some(guard) => guard.sent.publish(&self.work.store()),
        }
    }
}
