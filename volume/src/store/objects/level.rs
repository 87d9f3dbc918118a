//! The objects of a coarser level, which lie among those of its store.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{Object, Objects};
use crate::store::error::StoreError;
use crate::store::level::key_on;

/// A level as a store of its own: its keys are a store's.
#[derive(Debug, Clone)]
pub(crate) struct LevelObjects {
    store: Arc<dyn Objects>,
    level: u8,
}

/// The objects of a level of the store that `store` keeps.
pub(crate) fn objects_of_level(store: &Arc<dyn Objects>, level: u8) -> Arc<dyn Objects> {
    match level {
        0 => store.clone(),
        level => Arc::new(LevelObjects { store: store.clone(), level }),
    }
}

impl Objects for LevelObjects {
    fn place(&self) -> &Path {
        self.store.place()
    }

    fn open(&self, key: &str) -> Result<Arc<dyn Object>, StoreError> {
        self.store.open(&key_on(self.level, key))
    }

    fn open_promised(&self, key: &str, bytes: u64) -> Result<Arc<dyn Object>, StoreError> {
        self.store.open_promised(&key_on(self.level, key), bytes)
    }

    fn foresee(&self, keys: &[(Cow<'_, str>, u64)]) {
        let on_level = |(key, most): &(Cow<'_, str>, u64)| (key_on(self.level, key).into_owned().into(), *most);
        self.store.foresee(&keys.iter().map(on_level).collect::<Vec<_>>());
    }

    fn is_far(&self) -> bool {
        self.store.is_far()
    }

    fn path_of(&self, key: &str) -> PathBuf {
        self.store.path_of(&key_on(self.level, key))
    }
}
