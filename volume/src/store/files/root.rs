//! The folder that a store is written into, and where in it each level's files lie.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::destination::{OnTheWay, Sent};
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
    /// Where files go as they are finished.
    sent: Option<Arc<Sent>>,
}

impl StoreRoot {
    /// With the folder that the level's own small files go into.
    pub(crate) fn create(folder: &Path, level: u8) -> Result<Self, StoreError> {
        let root = Self { folder: folder.to_path_buf(), level, sent: None };
        if let Some(own) = root.path(MANIFEST_FILE).parent() {
            leftovers::create_dir_all(own).map_err(StoreError::io("create", own))?;
        }
        Ok(root)
    }

    pub(crate) fn sent(self, sent: Option<Arc<Sent>>) -> Self {
        Self { sent, ..self }
    }

    /// Files by their keys, which nothing is written to any more: they go where the store goes.
    pub(crate) fn finished(&self, keys: &[String]) -> Result<(), StoreError> {
        let Some(sent) = &self.sent else { return Ok(()) };
        let file = |key: &String| (key_on(self.level, key).into_owned(), self.path(key));
        sent.take(&keys.iter().map(file).collect::<Vec<_>>())
    }

    /// Where the file is that a store of one level has at `key`.
    pub(crate) fn path(&self, key: &str) -> PathBuf {
        self.folder.join(&*key_on(self.level, key))
    }

    /// What is written so far, to be read.
    pub(crate) fn objects(&self) -> Arc<dyn Objects> {
        let here: Arc<dyn Objects> = Arc::new(StoreFolder::free(&self.folder));
        let store = match &self.sent {
            None => here,
            Some(sent) => Arc::new(OnTheWay { here, there: sent.objects() }),
        };
        objects_of_level(&store, self.level)
    }
}
