//! The cache as it is opened: its folder, and how much may lie there.

use std::path::{Path, PathBuf};

use super::place::Place;

/// An opened cache.
#[derive(Debug)]
pub(crate) struct Cache {
    pub(super) folder: PathBuf,
    /// The most bytes that all entries may have.
    pub(super) limit: u64,
    /// The same in the words of whoever set it.
    pub(super) limit_text: String,
}

impl Cache {
    /// As [`ready`], with a limit.
    ///
    /// # Errors
    /// As [`ready`].
    pub(crate) fn open(named: Option<&Path>, limit: u64, limit_text: String) -> anyhow::Result<Self> {
        Ok(Self { folder: ready(named)?, limit, limit_text })
    }
}

/// The folder for prepared inputs: `named`, or the user's own.
pub(crate) fn folder(named: Option<&Path>) -> PathBuf {
    Place::of(named).folder
}

/// The same, made, and no one else's where nobody named it.
///
/// # Errors
/// It cannot be made, or someone else could put volumes there.
fn ready(named: Option<&Path>) -> anyhow::Result<PathBuf> {
    Place::of(named).ready()
}
