//! The objects of a step, which lie among those of its series.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::store::error::StoreError;
use crate::store::objects::{Object, Objects};

/// A step as a store of its own: its keys are a store's.
#[derive(Debug, Clone)]
pub(super) struct StepObjects {
    series: Arc<dyn Objects>,
    step: usize,
    place: PathBuf,
}

impl StepObjects {
    pub(super) fn new(series: Arc<dyn Objects>, step: usize) -> Self {
        let place = series.place().join(step.to_string());
        Self { series, step, place }
    }

    fn key(&self, key: &str) -> String {
        format!("{}/{key}", self.step)
    }
}

impl Objects for StepObjects {
    fn place(&self) -> &Path {
        &self.place
    }

    fn open(&self, key: &str) -> Result<Arc<dyn Object>, StoreError> {
        self.series.open(&self.key(key))
    }

    fn open_promised(&self, key: &str, bytes: u64) -> Result<Arc<dyn Object>, StoreError> {
        self.series.open_promised(&self.key(key), bytes)
    }

    fn foresee(&self, keys: &[(Cow<'_, str>, u64)]) {
        let within = |(key, most): &(Cow<'_, str>, u64)| (self.key(key).into(), *most);
        self.series.foresee(&keys.iter().map(within).collect::<Vec<_>>());
    }

    fn is_far(&self) -> bool {
        self.series.is_far()
    }

    fn path_of(&self, key: &str) -> PathBuf {
        self.series.path_of(&self.key(key))
    }
}
