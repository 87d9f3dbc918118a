//! Where the cache is and how large it may be.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Args;

use super::values::byte_size;
use crate::cache::{self, Cache};
use crate::cli::failure::Failure;
use crate::embedded::parse_size;

#[derive(Debug, Clone, Args)]
pub struct CacheArgs {
    /// Where inputs are prepared on the way; reused while unchanged [default: the user's cache folder]
    #[arg(long, value_name = "DIR", env = "BRICKCAST_CACHE_DIR")]
    pub cache_dir: Option<PathBuf>,
    /// The most that they may take there; those that were not used for longest make room
    #[arg(long, value_name = "SIZE", env = "BRICKCAST_CACHE_SIZE", value_parser = byte_size, default_value = "50GiB")]
    pub cache_size: String,
}

impl CacheArgs {
    /// The folder for prepared inputs.
    pub(crate) fn folder(&self) -> PathBuf {
        cache::folder(self.cache_dir.as_deref())
    }

    /// The most bytes that may lie there.
    ///
    /// # Errors
    /// Usage: a size that is none.
    pub(crate) fn limit(&self) -> Result<u64, Failure> {
        parse_size(&self.cache_size).map_err(|why| Failure::usage(anyhow!("--cache-size: {why}")))
    }

    /// # Errors
    /// The folder cannot be made, or someone else could put volumes there; usage: a size that is none.
    pub(crate) fn open(&self) -> Result<Cache, Failure> {
        Ok(Cache::open(self.cache_dir.as_deref(), self.limit()?, self.cache_size.clone())?)
    }
}
