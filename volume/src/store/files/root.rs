//! The folder that a store is written into, and where in it each level's files lie.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::leftovers;
use crate::store::error::StoreError;
use crate::store::level::key_on;
use crate::store::objects::Objects;
use crate::store::objects::folder::StoreFolder;
use crate::store::objects::level::objects_of_level;
use crate::store::profile::MANIFEST_FILE;

/// One level of a store that is being written.
#[derive(Debug, Clone)]
pub(crate) struct StoreRoot {
    folder: PathBuf,
    level: u8,
}

impl StoreRoot {
    /// With the folder that the level's own small files go into.
    pub(crate) fn create(folder: &Path, level: u8) -> Result<Self, StoreError> {
        let root = Self { folder: folder.to_path_buf(), level };
        if let Some(own) = root.path(MANIFEST_FILE).parent() {
            leftovers::create_dir_all(own).map_err(StoreError::io("create", own))?;
        }
        Ok(root)
    }

    /// Where the file is that a store of one level has at `key`.
    pub(crate) fn path(&self, key: &str) -> PathBuf {
        self.folder.join(&*key_on(self.level, key))
    }

    /// What is written so far, to be read.
    pub(crate) fn objects(&self) -> Arc<dyn Objects> {
        let store: Arc<dyn Objects> = Arc::new(StoreFolder::free(&self.folder));
        objects_of_level(&store, self.level)
    }
}
