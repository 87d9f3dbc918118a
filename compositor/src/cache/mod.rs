//! The cache of inputs that were prepared on the way.
//!
//! An entry is a store `NAME/`, with `NAME.key` beside it, which says what the store was made of and which store it is, and `NAME.lock`: held
//! alone by whoever makes or removes the entry, and together by all who use it. So one process makes an entry and the others wait for
//! it, nobody loses a store that is being rendered, and the locks of the dead are free.

mod entry;
mod key;
mod lock;
mod place;
mod room;

use std::path::PathBuf;

pub(crate) use entry::Wanted;
pub(crate) use key::Key;

use crate::cli::CacheArgs;
use crate::embedded::parse_size;
use crate::failure::Failure;

/// An opened cache.
#[derive(Debug)]
pub(crate) struct Cache {
    folder: PathBuf,
    /// The most bytes that all entries may have.
    limit: u64,
    /// The same in the words of whoever set it.
    limit_text: String,
}

impl CacheArgs {
    /// The folder for prepared inputs.
    pub(crate) fn folder(&self) -> PathBuf {
        place::Place::of(self.cache_dir.as_deref()).folder
    }

    /// The same, made, and no one else's where nobody named it.
    ///
    /// # Errors
    /// It cannot be made, or someone else could put volumes there.
    pub(crate) fn ready(&self) -> Result<PathBuf, Failure> {
        place::Place::of(self.cache_dir.as_deref()).ready()
    }

    /// # Errors
    /// As [`CacheArgs::ready`]; usage: a size that is none.
    pub(crate) fn open(&self) -> Result<Cache, Failure> {
        let limit_text = self.cache_size.clone();
        let limit = parse_size(&limit_text).map_err(|why| Failure::usage(anyhow::anyhow!("--cache-size: {why}")))?;
        Ok(Cache { folder: self.ready()?, limit, limit_text })
    }
}
